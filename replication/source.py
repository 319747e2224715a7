"""A hash of the code that computes a trial.

The hash covers every module of the package that a given module imports, directly or not, without
docstrings, comments and layout. So finished trials stay valid when prose or drawing code changes,
and are never used again when what computes them does.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path

PACKAGE = __name__.split(".")[0]


SILENT = frozenset(
    f"{PACKAGE}.{name}" for name in ("demos.checks", "errors", "irl.methods", "source")
)
"""Modules that change no trial: they check, phrase messages, list methods, or hash."""


@cache
def source_hash(*modules: str) -> str:
    """Return the SHA-256 of some modules and of all modules of the package that they import.

    Modules in `SILENT`, and what only they import, do not count. Neither do data files.
    """
    digest = hashlib.sha256()
    for name, tree in sorted(_closure(modules, without=SILENT).items()):
        digest.update(f"{name}\n{ast.unparse(_bare(tree))}\n".encode())
    return digest.hexdigest()


def module_hashes(modules: Iterable[str]) -> dict[str, str]:
    """Return the hash of each module of the package that some modules are or import, by name.

    Names of other packages, and of what is no module, are passed over. The hashes are the first 16
    digits of SHA-256.
    """
    own = [name for name in modules if name.split(".")[0] == PACKAGE and _is_module(name)]
    found = {}
    for name, tree in sorted(_closure(own).items()):
        text = ast.unparse(_bare(tree))
        found[name] = hashlib.sha256(text.encode()).hexdigest()[:16]
    return found


def bare_source(text: str) -> str:
    """Return Python source without docstrings, comments and layout.

    Text that is not Python, such as a line magic, is returned as it is.
    """
    try:
        return ast.unparse(_bare(ast.parse(text)))
    except SyntaxError:
        return text


def _closure(
    modules: Iterable[str], *, without: frozenset[str] = frozenset()
) -> dict[str, ast.Module]:
    found: dict[str, ast.Module] = {}
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        if name in found or name in without:
            continue
        spec = find_spec(name)
        if spec is None or spec.origin is None:
            continue  # `from package import function` names no module
        found[name] = ast.parse(Path(spec.origin).read_bytes())
        waiting.extend(_imports(found[name]))
    return found


def _imports(tree: ast.Module) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return {name for name in names if name.startswith(f"{PACKAGE}.") and _is_module(name)}


def _is_module(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def _bare(tree: ast.Module) -> ast.Module:
    """Return the tree without docstrings, other bare text, and the messages of errors."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            node.exc.args, node.exc.keywords = [], []
        body = getattr(node, "body", None)
        if isinstance(body, list):
            kept = [
                one
                for one in body
                if not (
                    isinstance(one, ast.Expr)
                    and isinstance(one.value, ast.Constant)
                    and isinstance(one.value.value, str)
                )
            ]
            node.body = kept or [ast.Pass()]  # type: ignore[attr-defined]
    return tree
