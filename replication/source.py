"""Hashes of the package's code, without prose.

The hashes cover every module of the package that some code imports, directly or not, without
docstrings, comments, layout and the messages of errors. So finished trials and published outputs
stay valid when prose changes, and never when what computes them does.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
PACKAGE = FOLDER.name

SILENT = frozenset(
    f"{PACKAGE}.{name}"
    for name in (
        *("demos.checks", "errors", "files", "irl.methods", "source", "trials.agents"),
        *("paper.params", "paper.register"),  # the values of parameters are part of the key
        *("envs.tasks.base", "envs.tasks.moves"),  # of tasks whose trials are not stored
    )
)
"""Modules that change no stored trial: they check, read, phrase messages, list, or hash."""


@cache
def source_hash(*modules: str) -> str:
    """Return the SHA-256 of some modules and of all modules of the package that they import.

    Modules in `SILENT`, and what only they import, do not count. Neither do data files.
    """
    digest = hashlib.sha256()
    for name, code in sorted(_closure(modules, without=SILENT).items()):
        digest.update(f"{name}\n{code}\n".encode())
    return digest.hexdigest()


def module_hashes(names: Iterable[str]) -> dict[str, str]:
    """Return the hash of each module of the package that is among `names` or imported by one.

    A module that is named in a text, to be imported when it is needed, counts as imported. Other
    names are passed over. The hashes are the first 16 digits of SHA-256.
    """
    found = sorted(_closure(names, texts=True).items())
    return {name: hashlib.sha256(code.encode()).hexdigest()[:16] for name, code in found}


def imports_of(code: str) -> list[str]:
    """Return the names of the package that a notebook's cell imports; a magic imports nothing.

    Invalid Python imports nothing, either: it is reported when the cell runs.
    """
    lines = [line for line in code.splitlines() if not line.lstrip().startswith(("%", "!"))]
    try:
        return sorted(_imports(ast.parse("\n".join(lines))))
    except SyntaxError:
        return []


def bare_source(text: str) -> str:
    """Return Python source without docstrings, comments and layout.

    Text that is not Python, such as a line magic, is returned as it is.
    """
    try:
        return ast.unparse(_bare(ast.parse(text)))
    except SyntaxError:
        return text


def _closure(
    names: Iterable[str], *, without: frozenset[str] = frozenset(), texts: bool = False
) -> dict[str, str]:
    """Return the bare source of the modules among `names` and of all that they import, by name."""
    found: dict[str, str] = {}
    waiting = list(names)
    while waiting:
        name = waiting.pop()
        if name in found or name in without or (file := _file(name)) is None:
            continue
        found[name], imports, named = _read(file.read_bytes())
        waiting += imports | named if texts else imports
    return found


@cache
def _read(content: bytes) -> tuple[str, frozenset[str], frozenset[str]]:
    """Return a module's bare source, what it imports, and the modules that its texts name.

    Equal contents are parsed once.
    """
    tree = ast.parse(content)
    imports = frozenset(_imports(tree))
    bare = _bare(tree)
    texts = {node.value for node in ast.walk(bare) if isinstance(node, ast.Constant)}
    named = {text for text in texts if isinstance(text, str) and text.startswith(f"{PACKAGE}.")}
    return ast.unparse(bare), imports, frozenset(filter(_file, named))


def _imports(tree: ast.Module) -> set[str]:
    """Return the modules of the package that some code imports.

    The package itself counts only where a name is imported from it that is no module.
    """
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            inside = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= inside
            if node.module != PACKAGE or any(_file(name) is None for name in inside):
                names.add(node.module)
    return {name for name in names if _file(name) is not None}


def _file(name: str) -> Path | None:
    """Return the file of a module of the package; None for any other name. Nothing is imported."""
    package, *parts = name.split(".")
    path = FOLDER.joinpath(*parts)
    candidates = (path / "__init__.py", path.with_suffix(".py"))
    return next((f for f in candidates if package == PACKAGE and f.is_file()), None)


def _bare(tree: ast.Module) -> ast.Module:
    """Return the tree without docstrings, other bare text, and the messages of errors."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            node.exc.args, node.exc.keywords = [], []
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [item for item in body if not _is_text(item)] or [ast.Pass()]  # type: ignore[attr-defined]
    return tree


def _is_text(node: ast.AST) -> bool:
    constant = node.value if isinstance(node, ast.Expr) else None
    return isinstance(constant, ast.Constant) and isinstance(constant.value, str)
