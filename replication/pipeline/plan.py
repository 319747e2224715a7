"""Runs: notebooks with their parameters, checked and put in order before any of them begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import joblib

from replication import files
from replication.errors import unknown
from replication.pipeline.declaration import MANIFEST
from replication.pipeline.inputs import NEUTRAL, Inputs, changes, inputs_of
from replication.pipeline.manifest import State, published_folders, read_manifest, state_of
from replication.pipeline.notebook import Notebook, NotebookError, read_notebook, refuse


@dataclass(frozen=True)
class Run:
    """A notebook with the parameters of a run, and everything that its outputs depend on.

    `out` holds the folders of all notebooks; this one publishes into the folder of its name.
    """

    notebook: Notebook
    values: Mapping[str, Any]
    inputs: Inputs
    out: Path

    @property
    def name(self) -> str:
        """The notebook's name."""
        return self.notebook.name

    @property
    def folder(self) -> Path:
        """The folder that it publishes."""
        return self.out / self.name

    @property
    def state(self) -> State:
        """Whether what is published is up to date."""
        return state_of(self.folder, self.inputs)

    @property
    def edits(self) -> list[str]:
        """What is not as it was for what is published, but for the outputs of other notebooks.

        Where other folders are published and this one's manifest cannot be read, nobody knows.
        """
        manifest = read_manifest(self.folder)
        if not manifest:
            lost = f"its {MANIFEST} is missing or damaged"
            return [lost] if published_folders(self.out) else []
        theirs = tuple(f"{need}/" for need in self.notebook.declared.needs)
        found = changes(manifest["inputs"], self.inputs)
        return [change for change in found if not change.startswith(theirs)]

    def again(self) -> Run:
        """Return the same run with what its outputs depend on now."""
        return replace(self, inputs=inputs_of(self.notebook, self.values, self.out))


def run_name(
    profile: str, *, seed: int | None = None, parameters: Mapping[str, Any] | None = None
) -> str:
    """Name what a run is: its profile, or "custom" where a result may differ from the profile's.

    Examples
    --------
    >>> run_name("paper", parameters={"jobs": 2}), run_name("paper", parameters={"trials": 2})
    ('paper', 'custom')
    """
    return "custom" if departures(seed, parameters) else profile


def departures(seed: int | None, parameters: Mapping[str, Any] | None) -> list[str]:
    """Return the options by which a run departs from its profile."""
    named = [f"-p {name}" for name in parameters or {} if name not in NEUTRAL]
    return named if seed is None else [*named, "--seed"]


def prepare(
    notebooks: Sequence[Path],
    *,
    profile: str,
    out: Path,
    jobs: int | None = None,
    seed: int | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> list[Run]:
    """Read notebooks and check everything that can be checked before one runs.

    Returns
    -------
    list of Run
        In the given order, but for notebooks that need others: these stand before them.

    Raises
    ------
    NotebookError
        If a notebook cannot be run, a parameter is unknown or of the wrong type, or a notebook
        needs another one whose outputs are not in `out`.
    """
    for name in {"out", "results"} & (parameters or {}).keys():
        raise NotebookError(f"{name!r} follows from the folder of the outputs; use --out")
    runs = []
    for notebook in _ordered([read_notebook(path) for path in notebooks], out):
        values = {**notebook.declared.profiles.get(profile, {}), **(parameters or {})}
        if "jobs" in notebook.literals:
            values.setdefault("jobs", joblib.cpu_count() if jobs is None else jobs)
        if seed is not None and "seed" in notebook.literals:
            values["seed"] = seed
        notebook.check(values)
        runs.append(Run(notebook, values, inputs_of(notebook, values, out), out))
    return runs


def foreign(notebooks: Sequence[Path]) -> str:
    """Say which of some notebooks is not one of the project's own, if any."""
    own = (files.PROJECT / "notebooks").resolve()
    others = [path for path in notebooks if path.resolve().parent != own]
    return f"{others[0]} is not in notebooks/" if others else ""


def check_unedited(runs: Sequence[Run]) -> None:
    """Refuse to replace published results by others than a notebook gave then."""
    for run in runs:
        if edits := run.edits:
            more = f" and {len(edits) - 1} more" if len(edits) > 1 else ""
            raise NotebookError(
                f"{run.folder} keeps what was published, as {edits[0]}{more} since then; "
                "--publish replaces it"
            )


def _ordered(notebooks: Sequence[Notebook], out: Path) -> list[Notebook]:
    """Put notebooks behind those that they need; refuse a need that is neither there nor asked."""
    asked: dict[str, Notebook] = {}
    for notebook in notebooks:
        if notebook.name in asked:
            refuse(notebook.path, f"has the name of {asked[notebook.name].path}")
        asked[notebook.name] = notebook
    ordered: dict[str, Notebook] = {}

    def add(notebook: Notebook, behind: tuple[str, ...]) -> None:
        if notebook.name in behind:
            refuse(notebook.path, f"needs itself: {' needs '.join((*behind, notebook.name))}")
        for need in notebook.declared.needs:
            if need in asked:
                add(asked[need], (*behind, notebook.name))
            elif not (notebook.path.parent / f"{need}.ipynb").exists():
                known = sorted(path.stem for path in notebook.path.parent.glob("*.ipynb"))
                refuse(notebook.path, f"needs {unknown(need, known, 'notebook')}")
            elif not read_manifest(out / need):
                first = f"first, with the same options: replicate run {need} --out {out}"
                refuse(notebook.path, f"needs the outputs of {need}; {first}")
        ordered[notebook.name] = notebook

    for notebook in notebooks:
        add(notebook, ())
    return list(ordered.values())
