"""The reference: what it leaves out, and where the code that it links to lies."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pydantic import BaseModel
from sphinx.application import Sphinx

from replication import files
from replication.files import read_file, write_file

CODE = "code/"
"""Where the package's code lies in the site."""


def connect(app: Sphinx) -> None:
    """Register everything with Sphinx."""
    app.connect("autodoc-skip-member", _skip_fields)
    app.connect("autodoc-process-signature", _shorten)
    app.connect("build-finished", _write_code)


def source_of(domain: str, info: Mapping[str, str]) -> str | None:
    """Return the address of an object's code, as the first page sees it."""
    module = files.PROJECT / info["module"].replace(".", "/")
    path = module / "__init__.py" if module.is_dir() else module.with_suffix(".py")
    if domain != "py" or not path.exists():
        return None
    name = info["fullname"].rpartition(".")[2]
    at = f"text=def%20{quote(name)}&text=class%20{quote(name)}"  # browsers scroll to the first
    return f"{CODE}{path.relative_to(files.PROJECT).as_posix()}.txt#:~:{at}"


def _skip_fields(
    app: Sphinx, what: str, name: str, value: object, skip: bool, options: object
) -> bool | None:
    """Leave out the fields of named tuples, which docstrings describe, and pydantic's settings."""
    return True if type(value).__name__ == "_tuplegetter" or name == "model_config" else None


def _shorten(app: Sphinx, what: str, name: str, thing: Any, *_: Any) -> tuple[str, None] | None:
    """Leave out the arguments of pydantic's models: they are the fields, with all their limits."""
    is_model = isinstance(thing, type) and issubclass(thing, BaseModel)
    return ("", None) if is_model else None


def _write_code(app: Sphinx, error: Exception | None) -> None:
    """Write the code that pages link to beside them, as text that a browser shows."""
    documented = app.env.domains["py"].data["objects"]
    for path in files.PROJECT.glob("replication/**/*.py"):
        name, code = path.relative_to(files.PROJECT), read_file(path)
        module = ".".join(name.with_suffix("").parts).removesuffix(".__init__")
        draws = module.startswith("replication.report.") and b"\ndef draw" in code
        if draws or any(entry.startswith(f"{module}.") for entry in documented):
            write_file(Path(app.outdir) / "code" / f"{name.as_posix()}.txt", code)
