"""Whether outputs are up to date, by their manifest and by what is remembered of the last run."""

from __future__ import annotations

import datetime
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replication.files import write_file
from replication.pipeline import provenance
from replication.pipeline.notebook import Notebook
from replication.pipeline.plan import Run

RUNS = "run.json"
"""What differs from run to run, beside the executed notebooks."""

FRESH, STALE, MISSING, PROSE = "fresh", "stale", "missing", "prose"


@dataclass(frozen=True)
class State:
    """Whether the outputs of a notebook are up to date.

    `kind` is "fresh", "stale", "missing", or "prose" where only text has changed that is not
    executed; `why` says what has changed.
    """

    kind: str
    why: tuple[str, ...] = ()


def state_of(run: Run, out: Path, folder: Path) -> State:
    """Return whether a notebook's outputs in `out`, executed in `folder`, are up to date."""
    notebook = run.notebook
    entry = provenance.read_manifest(out).get(notebook.name)
    if entry is None:
        own = set(notebook.outputs) - set(notebook.merged)
        some = any((out / output).exists() for output in own)
        unknown = ("there is no record of how they were made",)
        return State(STALE, unknown) if some else State(MISSING)
    lost = provenance.damaged(out, entry)
    if len(lost) == len(entry["outputs"]) and set(lost.values()) == {"missing"}:
        return State(MISSING)
    if lost == {notebook.executed: "changed"} and _lacks_text_only(notebook, out, entry):
        lost = {}
    why = provenance.changes(entry["inputs"], run.inputs)
    why += [f"{output} is {how}" for output, how in lost.items()]
    if notebook.executed not in entry["outputs"]:
        why.append("its executed notebook was not published")
    if why:
        return State(STALE, tuple(why))
    executed = folder / notebook.executed
    if executed.exists() and (notebook.name not in read_runs(folder) or not _whole(executed)):
        return State(STALE, ("its last run did not finish",))
    return State(FRESH if notebook.is_shown_by(out / notebook.executed) else PROSE)


def read_runs(folder: Path) -> dict[str, Any]:
    """Return what is remembered of the last run of each notebook, by name.

    What cannot be read counts as not remembered.
    """
    try:
        runs = dict(json.loads((folder / RUNS).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return {}
    return {name: entry for name, entry in runs.items() if _is_run(entry)}


def remember(folder: Path, name: str, entry: Mapping[str, Any] | None) -> None:
    """Write down a notebook's last run, or that there is none."""
    runs = {key: value for key, value in read_runs(folder).items() if key != name}
    if entry is not None:
        runs[name] = entry
    write_file(folder / RUNS, json.dumps(runs, indent=1, sort_keys=True) + "\n")


def _is_run(entry: Any) -> bool:
    try:
        float(entry["seconds"])
        return datetime.datetime.fromisoformat(entry["finished"]).tzinfo is not None
    except (KeyError, TypeError, ValueError):
        return False


def _lacks_text_only(notebook: Notebook, out: Path, entry: Mapping[str, Any]) -> bool:
    """Return whether new text makes the published notebook what the manifest says it is.

    So it is where a run was killed while it brought the text up to date.
    """
    from replication.pipeline.rendering import rendered  # loads nbformat, which takes a second

    try:
        text = rendered(notebook, out / notebook.executed)
    except Exception:  # whatever a damaged file makes the reader raise
        return False
    return provenance.text_hash(text) == entry["outputs"][notebook.executed]


def _whole(executed: Path) -> bool:
    """Return whether an executed notebook's file was written to its end."""
    try:
        json.loads(executed.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return True
