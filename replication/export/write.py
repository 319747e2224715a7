"""Write what is published for other programs: a folder that stands on its own.

The folder holds a copy of the files that it describes, since an RO-Crate must have them, and so
that it can be archived, and its records be loaded, without the rest of the project.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from replication import files
from replication.export.about import About, ExportError, about
from replication.export.codemeta import codemeta
from replication.export.crate import METADATA, crate, payload
from replication.export.croissant import croissant
from replication.export.facts import described
from replication.files import read_file, scratch_folder, write_file
from replication.pipeline.folders import exclusive, outputs_folder
from replication.pipeline.plan import prepare
from replication.pipeline.publish import swap
from replication.pipeline.run import render_text
from replication.pipeline.status import check_fresh

MADE = ("codemeta.json", "croissant.json")
"""What is made beside the description of the crate."""


def write_export(
    notebooks: Sequence[Path], out: Path, *, echo: Callable[[str], object] = print
) -> Path:
    """Write the folder from the results in `figures`, without executing anything.

    Parameters
    ----------
    notebooks
        The notebooks whose results are published.
    out
        The folder; it is replaced as a whole.
    echo
        Prints a line.

    Returns
    -------
    Path
        The description of the crate.

    Raises
    ------
    UserError
        If a notebook is stale, a file is missing, or the folder holds something else.
    """
    if out.exists() and not out.is_dir():
        raise ExportError(f"{out} is not a folder; choose another one")
    if out.exists() and any(out.iterdir()) and not all((out / name).exists() for name in MADE):
        raise ExportError(f"{out} holds other files than an export; choose another folder")
    with exclusive(outputs_folder("paper"), echo):
        runs = prepare(notebooks, profile="paper", out=outputs_folder("paper"))
        check_fresh(runs)
        for run in runs:
            render_text(run)
        content = contents(about(), [run.name for run in runs])
        out.absolute().parent.mkdir(parents=True, exist_ok=True)
        with scratch_folder(out.absolute().parent) as scratch:
            draft = scratch / "draft"
            for name, data in content.items():
                write_file(draft / name, data)
            swap(draft, out.absolute())
    echo(f"{len(content)} files, {sum(map(len, content.values())) / 1e6:.0f} MB")
    return out / METADATA


def contents(about: About, names: Sequence[str]) -> dict[str, bytes]:
    """Return every file of the folder, by name, given the notebooks."""
    names = sorted(names)
    made = {"codemeta.json": codemeta(about), "croissant.json": croissant(about, names)}
    texts = {name: _json(document) for name, document in made.items()}
    graph = crate(about, names, {name: described(name, data) for name, data in texts.items()})
    copied = [name for name in payload(graph["@graph"]) if name not in texts]
    texts[METADATA] = _json(graph)
    return texts | {name: read_file(files.PROJECT / name) for name in copied}


def _json(document: dict[str, Any]) -> bytes:
    return (json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode()
