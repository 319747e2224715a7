"""Redraw published figures from the tables beside them, by the functions that drew them.

Nothing is executed. What draws a figure stands in the metadata of the published notebook's output.
"""

from __future__ import annotations

import base64
import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from replication.errors import unknown
from replication.files import read_file, read_json, write_file
from replication.pipeline.declaration import EXECUTED
from replication.pipeline.folders import exclusive
from replication.pipeline.index import shown_outputs, write_index
from replication.pipeline.manifest import damaged, hashes, published_folders, save_manifest
from replication.pipeline.notebook import NotebookError, first_line
from replication.pipeline.publish import draft_folder, swap

Draw = Callable[[str, Path], Mapping[str, bytes]]
"""Takes the full name of a drawing function and a table; returns a picture's files by suffix."""


def redraw(
    out: Path, names: Sequence[str], *, draw: Draw, echo: Callable[[str], object] = print
) -> None:
    """Redraw figures in the notebooks' folders in `out`; say which have changed.

    `names` are those of figures (`fig05`, or `open_maze/fig05`) or notebooks; if empty, all
    figures are drawn.

    Raises
    ------
    NotebookError
        If a name is unknown, a table is missing or has changed, or a figure cannot be drawn.
    """
    with exclusive(out, echo):
        manifests = published_folders(out)
        for notebook, manifest in manifests.items():
            _check_whole(out / notebook, manifest, EXECUTED)
        figures = {
            (notebook, shown["name"]): shown["code"]
            for notebook in manifests
            for shown, _ in shown_outputs(out / notebook)
            if shown.get("kind") == "figure" and "code" in shown
        }
        called = {key: {*key, "/".join(key)} for key in figures}
        known = sorted(set().union(*called.values()))
        for name in names:
            if name not in known:
                raise NotebookError(unknown(name, known, "figure"))
        chosen = [key for key in figures if not names or called[key] & {*names}]
        for notebook, manifest in manifests.items():
            codes = {key[1]: figures[key] for key in chosen if key[0] == notebook}
            for figure in _redraw_folder(out / notebook, manifest, codes, draw):
                echo(f"{notebook}/{figure}: redrawn, other bytes than before")
        write_index(out)
        number = len(chosen)
        echo(f"{number} figure{'s' * (number != 1)} drawn; the others have the same bytes")


def _redraw_folder(
    folder: Path, manifest: dict[str, Any], figures: Mapping[str, str], draw: Draw
) -> list[str]:
    """Redraw figures of one folder, which is replaced as a whole; return those that changed."""
    drawn: dict[str, bytes] = {}
    for figure, code in figures.items():
        table = f"{figure}.csv"
        _check_whole(folder, manifest, table)
        try:
            pictures = draw(code, folder / table)
        except Exception as error:  # whatever other code makes of the table
            message = f"{code} cannot draw it: {type(error).__name__}: {first_line(error)}"
            raise NotebookError(f"{folder / table}: {message}") from error
        drawn |= {f"{figure}{suffix}": content for suffix, content in pictures.items()}
    new = {
        name: content
        for name, content in drawn.items()
        if not (folder / name).is_file() or read_file(folder / name) != content
    }
    if not new:
        return []
    with draft_folder(folder.parent) as draft:
        shutil.copytree(folder, draft, dirs_exist_ok=True)
        for name, content in new.items():
            write_file(draft / name, content)
        write_file(draft / EXECUTED, _embedded(folder / EXECUTED, drawn))
        outputs = manifest["outputs"] | hashes(draft, (*new, EXECUTED))
        save_manifest(draft, manifest | {"outputs": outputs})
        swap(draft, folder)
    return sorted({name.rpartition(".")[0] for name in new})


def _check_whole(folder: Path, manifest: Mapping[str, Any], file: str) -> None:
    how = damaged(folder, manifest, (file,)).get(file)
    if file not in manifest["outputs"]:
        how = "not in the manifest"
    if how:
        message = f"is {how} since its run; first: replicate run {folder.name}"
        raise NotebookError(f"{folder / file}: {message}")


def _embedded(notebook: Path, drawn: Mapping[str, bytes]) -> str:
    """Return the text of a notebook with the new pictures in it."""
    document = read_json(notebook)
    for output in (output for cell in document["cells"] for output in cell.get("outputs", [])):
        name = f"{output.get('metadata', {}).get('replication', {}).get('name')}.png"
        if name in drawn and "image/png" in output["data"]:
            before = output["data"]["image/png"]
            end = "\n" if "".join(before).endswith("\n") else ""
            text = base64.b64encode(drawn[name]).decode() + end
            output["data"]["image/png"] = [text] if isinstance(before, list) else text
    return json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False) + "\n"
