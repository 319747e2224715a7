"""Small notebooks for tests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from replication.pipeline.manifest import damaged, published_folders


def write_notebook(
    path: Path, *code: str, parameters: str = 'out = "x"', prose: str = "", **declared: Any
) -> Any:
    """Write a notebook: text, the parameters cell and cells of code; return its contents."""
    cells = [new_markdown_cell(prose, id="head")] if prose else []
    tagged = {"tags": ["parameters"]}
    cells.append(new_code_cell(parameters, id="parameters", metadata=tagged))
    cells += [new_code_cell(source, id=f"code-{at}") for at, source in enumerate(code)]
    node = new_notebook(cells=cells, metadata={"replication": declared})
    path.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(node, path)
    return node


def damage(out: Path) -> list[str]:
    """Return the published files in a folder that are not as their manifests have them."""
    return [
        f"{name}/{output} is {how}"
        for name, manifest in published_folders(out).items()
        for output, how in damaged(out / name, manifest).items()
    ]
