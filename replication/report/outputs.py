"""What a notebook writes and shows: each figure and table, together with its numbers.

What is displayed carries in its metadata, under "replication", the name of the files that it is
also written to, what it is, and the code that drew it. Whoever publishes the notebook or builds a
page from it goes by that name.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from replication.errors import UserError
from replication.evidence.tables import read_table, write_csv
from replication.files import read_file, write_file
from replication.progress import GIVEN
from replication.report.moving import Player
from replication.report.picture import Picture
from replication.report.readable import markdown
from replication.report.style import save_figure
from replication.trials.measures import Report
from replication.trials.table import Group, computed_table, planned_table

TRIALS = "trials.csv"
"""The file with the table of trials."""

Stage = tuple[int, Callable[[pd.DataFrame], Sequence[Group]]]
"""A root seed, and what is run with it, given the trials of the stages before."""


class Shown:
    """Something for Jupyter to display, with the metadata of the output."""

    def __init__(self, data: dict[str, Any], **metadata: Any) -> None:
        self.data = data
        self.metadata = {"replication": metadata}

    def _repr_mimebundle_(self, **_: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        return self.data, self.metadata


class Outputs:
    """The folder that a notebook writes to.

    Parameters
    ----------
    folder
        Made when missing.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.folder.mkdir(parents=True, exist_ok=True)

    def figure(self, picture: Picture, name: str) -> Shown:
        """Write `name`.csv, and draw it into `name`.png and `name`.svg; return it for display."""
        numbers = read_table(write_csv(picture.numbers, self.folder / f"{name}.csv"))
        png, _ = save_figure(picture.draw(numbers), self.folder / name, ("png", "svg"))
        data = {"image/png": read_file(png), "text/plain": picture.words}
        return Shown(data, kind="figure", name=name, alt=picture.words, code=picture.code)

    def table(self, table: pd.DataFrame, name: str, *, readable: pd.DataFrame) -> Shown:
        """Write a table in full as `name`.csv and for reading as `name`.md; show the latter."""
        text = markdown(readable)
        write_csv(table, self.folder / f"{name}.csv")
        write_file(self.folder / f"{name}.md", text)
        return Shown({"text/markdown": text, "text/plain": text}, kind="table", name=name)

    def player(self, player: Player, name: str) -> Shown:
        """Write a moving figure as `name`.html, and its numbers as `name`.csv; show it."""
        write_csv(player.numbers, self.folder / f"{name}.csv")
        write_file(self.folder / f"{name}.html", player.html)
        data = {"text/html": player.html, "text/plain": player.words}
        return Shown(data, kind="player", name=name, alt=player.words)

    def data(self, table: pd.DataFrame, name: str) -> None:
        """Write a table that is not shown as `name`.csv."""
        write_csv(table, self.folder / f"{name}.csv")

    def computed(
        self, *stages: Stage, report: Report | None = None, **options: Any
    ) -> pd.DataFrame:
        """Return the table of trials, on which everything else rests, as trials.csv has it.

        It is computed, see :func:`replication.trials.table.computed_table`, unless the environment
        variable GIVEN names a folder that has it: so everything else can be made again from it.

        Parameters
        ----------
        stages
            The root seed of each stage, and what is run in it, given the trials of those before.
        report, options
            See :func:`replication.trials.table.computed_table`.

        Raises
        ------
        UserError
            If the given table has other trials than the plan.
        """
        given = os.environ.get(GIVEN)
        if not given:
            table = pd.DataFrame()
            for seed, plan in stages:
                new = computed_table(plan(table), report, seed=seed, **options)
                table = pd.concat([table, new], ignore_index=True)
                table = read_table(write_csv(table, self.folder / TRIALS))
            return table
        file, planned = Path(given) / TRIALS, pd.DataFrame()
        known = read_table(file)
        for seed, plan in stages:
            new = planned_table(plan(known[: len(planned)]), seed)
            planned = pd.concat([planned, new], ignore_index=True)
            _check_planned(known[: len(planned)], planned, file)
        _check_planned(known, planned, file)
        return read_table(write_csv(known, self.folder / TRIALS))


def _check_planned(table: pd.DataFrame, planned: pd.DataFrame, file: Path) -> None:
    """Refuse a table whose rows are not the planned ones, in their order."""
    if len(table) != len(planned):
        raise UserError(f"{file} has {len(table)} trials instead of {len(planned)}")
    for name in planned:
        if name not in table or table[name].tolist() != planned[name].tolist():
            raise UserError(f"{file} has other trials than were planned: see its column {name}")
