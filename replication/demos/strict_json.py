"""JSON for demonstration files: read strictly, written in a fixed layout."""

from __future__ import annotations

import json
import math
import os
from collections import Counter
from typing import Any

from replication.demos.checks import DemoError
from replication.errors import clip, compact, show
from replication.files import FileError, read_file

MAX_BYTES = 10_000_000
MAX_FIELDS = 50


def read_content(path: str | os.PathLike[str]) -> bytes:
    """Return the bytes of a file that :func:`read_json` may take.

    Raises
    ------
    DemoError
        If it is missing, not a regular file, unreadable or too large.
    """
    try:
        return read_file(path, MAX_BYTES)
    except FileError as error:
        raise DemoError(error.reason) from None


def read_json(content: bytes) -> Any:
    """Read JSON text strictly, without the extensions of Python's reader.

    Raises
    ------
    DemoError
        If it is not UTF-8, not JSON, too large or too deep, or holds a field twice or a number
        that is not finite.
    """
    if len(content) > MAX_BYTES:
        raise DemoError(f"is larger than {MAX_BYTES // 1_000_000} MB; drop some demos")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DemoError(f"is not UTF-8 text (byte {error.start + 1}); save it as UTF-8") from None
    if not text.strip():
        raise DemoError("is empty; a demonstration file is one JSON object")
    try:
        return json.loads(
            text,
            object_pairs_hook=_object,
            parse_int=_number,
            parse_float=_number,
            parse_constant=_number,
        )
    except json.JSONDecodeError as error:
        raise DemoError(
            f"is not JSON: {error.msg} at line {error.lineno}, column {error.colno}; fix it there"
        ) from None
    except RecursionError:
        raise DemoError("is nested too deeply; a demonstration file has five levels") from None


def layout(value: Any, *, rows: bool = False, indent: str = "\n") -> str:
    """Return JSON text: a line for each field and each row of a map, one line for other lists."""
    inner = indent + "  "
    if isinstance(value, dict):
        items = [
            f"{compact(key)}: {layout(item, rows=key == 'map', indent=inner)}"
            for key, item in value.items()
        ]
        return "{" + inner + f",{inner}".join(items) + indent + "}"
    if isinstance(value, list) and value and (rows or isinstance(value[0], dict)):
        items = [layout(item, indent=inner) for item in value]
        return "[" + inner + f",{inner}".join(items) + indent + "]"
    if isinstance(value, list):
        return "[" + ", ".join(map(compact, value)) + "]"
    return compact(value)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    fields = dict(pairs)
    if len(fields) < len(pairs):
        twice, _ = Counter(key for key, _ in pairs).most_common(1)[0]
        raise DemoError(f"the field {show(twice)} appears twice in one object; keep one")
    if len(fields) > MAX_FIELDS:
        raise DemoError(f"an object has {len(fields)} fields; this format has no such object")
    return fields


def _number(text: str) -> int | float:
    """Read a number; NaN and infinities, which JSON lacks, come here as well."""
    whole = text.lstrip("-").isdigit()
    if not math.isfinite(float(text)) or (whole and len(text) > 16):
        raise DemoError(f"the number {clip(text)} is too large or not finite; write a small number")
    return int(text) if whole else float(text)
