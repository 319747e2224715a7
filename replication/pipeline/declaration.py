"""What a notebook declares in its metadata: what a run publishes and reads, and its profiles.

An example::

    {
        "replication": {
            "figures": ["fig05"],
            "tables": ["table1"],
            "players": ["player"],
            "data": ["screen.csv"],
            "trials": true,
            "needs": [],
            "inputs": ["replication/paper/choices.toml"],
            "profiles": {"quick": {"trials": 6}, "paper": {"trials": 100}},
        }
    }
"""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict

EXECUTED = "notebook.ipynb"
"""The executed notebook, in the folder of its outputs."""

MANIFEST = "provenance.json"
"""What the outputs came from, in the same folder."""

TRIALS = "trials.csv"
"""The table of trials that a notebook computes; all else that it publishes follows from it."""

SUFFIXES = {
    "figures": (".csv", ".png", ".svg"),
    "tables": (".csv", ".md"),
    "players": (".csv", ".html"),
    "data": ("",),
}


def _plain(names: tuple[str, ...]) -> tuple[str, ...]:
    for name in names:
        if not re.fullmatch(r"\w[\w.-]*", name):
            raise ValueError(f"{name!r} is not a plain name without a folder")
        if name in (EXECUTED, MANIFEST):
            raise ValueError(f"{name!r} is written by every run")
        if names.count(name) > 1:
            raise ValueError(f"{name!r} stands there twice")
    return names


Names = Annotated[tuple[str, ...], AfterValidator(_plain)]


class Declaration(BaseModel):
    """The metadata `replication` of a notebook.

    Attributes
    ----------
    figures, tables, players
        Outputs by their names without suffix: a figure is NAME.png, NAME.svg and its numbers
        NAME.csv, a table NAME.md and NAME.csv, a player NAME.html and NAME.csv.
    data
        Other files that it writes.
    trials
        Whether it computes trials, and so writes their table, `trials.csv`.
    needs
        Notebooks whose published folders it reads, from the folder in its parameter `results`.
    inputs
        Files of the project that it reads without having them as parameters.
    profiles
        Parameter values by the name of the profile; a profile that is not among them keeps the
        literals of the parameters cell.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    figures: Names = ()
    tables: Names = ()
    players: Names = ()
    data: Names = ()
    trials: bool = False
    needs: Names = ()
    inputs: tuple[str, ...] = ()
    profiles: dict[str, dict[str, Any]] = {}

    @property
    def outputs(self) -> tuple[str, ...]:
        """The names of all files."""
        stems = ((stem, kind) for kind in SUFFIXES for stem in getattr(self, kind))
        names = [stem + suffix for stem, kind in stems for suffix in SUFFIXES[kind]]
        return tuple(dict.fromkeys([*names, TRIALS] if self.trials else names))
