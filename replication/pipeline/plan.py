"""Runs: notebooks with their parameters, checked before any of them begins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import joblib

from replication.pipeline import provenance
from replication.pipeline.notebook import Notebook, NotebookError, read_notebook, refuse


@dataclass(frozen=True)
class Run:
    """A notebook with the parameters of a run, and everything that its outputs depend on."""

    notebook: Notebook
    values: Mapping[str, Any]
    inputs: provenance.Inputs

    def again(self) -> Run:
        """Return the same run with what its outputs depend on now."""
        provenance.forget_sources()
        return replace(self, inputs=provenance.inputs_of(self.notebook, self.values))


def run_name(
    profile: str,
    *,
    seed: int | None = None,
    parameters: Mapping[str, Any] | None = None,
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
    named = [f"-p {name}" for name in parameters or {} if name not in provenance.NEUTRAL]
    return named if seed is None else [*named, "--seed"]


def prepare(
    notebooks: Sequence[Path],
    *,
    profile: str,
    jobs: int | None = None,
    seed: int | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> list[Run]:
    """Read notebooks and check everything that can be checked before one runs.

    Raises
    ------
    NotebookError
        If a notebook cannot be run, or a parameter is unknown or of the wrong type.
    """
    if parameters and "out" in parameters:
        raise NotebookError("'out' is the folder that the outputs are published from; use --out")
    provenance.forget_sources()
    runs = []
    for notebook in map(read_notebook, notebooks):
        values = {**notebook.profiles.get(profile, {}), **(parameters or {})}
        if jobs is not None:
            values.setdefault("jobs", jobs)
        elif "jobs" in notebook.literals:
            values.setdefault("jobs", joblib.cpu_count())
        if seed is not None:
            values["seed"] = seed
        notebook.check(values)
        runs.append(Run(notebook, values, provenance.inputs_of(notebook, values)))
    _check_apart([run.notebook for run in runs])
    return runs


def _check_apart(notebooks: Sequence[Notebook]) -> None:
    """Refuse notebooks that would overwrite each other's files."""
    owners: dict[str, Notebook] = {}
    for notebook in notebooks:
        own = set(notebook.published) - set(notebook.merged)
        for name in sorted(own):
            if name in owners:
                refuse(notebook.path, f"would overwrite {name} of {owners[name].path}")
            owners[name] = notebook
    for notebook in notebooks:
        for name in notebook.merged:
            if name in owners:
                refuse(
                    notebook.path,
                    f"merges {name}, which {owners[name].path} overwrites",
                )
