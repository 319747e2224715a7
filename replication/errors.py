"""The base of all errors that users see, and the words of their messages."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable
from importlib.util import find_spec
from typing import Any

EXTRAS = {
    "notebooks": ("ipykernel", "joblib", "nbformat", "packaging", "papermill"),
    "cluster": ("distributed", "joblib"),
    "site": ("bs4", "jinja2", "myst_nb", "sphinx", "yaml"),
    "minari": ("h5py", "minari"),
}
"""The modules that each extra of the package brings, as far as this package imports them."""


class UserError(ValueError):
    """A mistake in what the user gave; the message says in one line where, and how to fix it."""

    def _render_traceback_(self) -> list[str]:
        """Show one line in a notebook instead of a traceback; IPython asks for it by this name."""
        return [f"error: {self}"]


def need(extra: str) -> None:
    """Check that the modules of an extra are installed, before they are imported.

    Raises
    ------
    UserError
        If one is missing, with the command that installs it.
    """
    for module in EXTRAS[extra]:
        if find_spec(module) is None:
            raise UserError(
                f"{module} is not installed; the extra {extra!r} has it: "
                f"pip install 'unified-irl-replication[{extra}]'"
            )


def unknown(name: str, known: Iterable[str], what: str) -> str:
    """Return the message about an unknown `name`, with the most similar of the `known` ones first.

    Examples
    --------
    >>> unknown("alpa", ["alpha", "beta"], "parameter")
    "unknown parameter 'alpa' (did you mean 'alpha'?); known: alpha, beta"
    """
    names = list(known)
    near = difflib.get_close_matches(name[:40], names, n=1)
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    return f"unknown {what} {show(name)}{hint}; known: {', '.join(names)}"


def compact(value: Any) -> str:
    """Return JSON text without blanks."""
    return json.dumps(value, ensure_ascii=False, separators=(",", ":"))


def show(value: Any) -> str:
    r"""Describe any JSON value in a few words.

    Examples
    --------
    >>> show([1, 2]), show([0] * 9), show("two\nlines"), show(None)
    ('[1, 2]', 'a list of 9', "'two\\nlines'", 'null')
    """
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list):
        short = len(value) <= 4 and all(isinstance(item, int | str) for item in value)
        return clip(repr(value)) if short else f"a list of {len(value)}"
    if isinstance(value, str):
        return clip(repr(value[:200]))
    return clip(json.dumps(value))


def clip(text: str, length: int = 60) -> str:
    """Shorten a text to a length."""
    return text if len(text) <= length else f"{text[: length - 3]}..."
