"""What a notebook writes and shows: each figure and table together with its numbers."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from IPython.display import HTML, Image, Markdown
from matplotlib.figure import Figure

from replication.evidence.tables import markdown, write_csv, write_trials
from replication.files import write_file
from replication.report.figures import save_figure


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

    def figure(self, figure: Figure, name: str, *, numbers: pd.DataFrame, alt: str) -> Image:
        """Write a figure as PNG and SVG, and its plotted numbers as CSV; return it for display.

        Parameters
        ----------
        figure
            From :mod:`replication.report.figures`.
        name
            File name without a suffix.
        numbers
            What is plotted.
        alt
            What the figure shows, in words, for those who cannot see it.
        """
        write_csv(numbers, self.folder / f"{name}.csv")
        png, _ = save_figure(figure, self.folder / name, ("png", "svg"))
        return Image(data=png.read_bytes(), width=700, alt=alt)

    def player(self, player: str, name: str, *, numbers: pd.DataFrame) -> HTML:
        """Write a moving figure as HTML, and its numbers as CSV; return it for display.

        Parameters
        ----------
        player
            From :mod:`replication.report.players`.
        name
            File name without a suffix.
        numbers
            What moves.
        """
        write_csv(numbers, self.folder / f"{name}.csv")
        write_file(self.folder / f"{name}.html", player)
        return HTML(player)

    def table(self, table: pd.DataFrame, name: str, *, readable: pd.DataFrame) -> Markdown:
        """Write a table in full as CSV and for reading as Markdown; return the latter."""
        text = markdown(readable)
        write_csv(table, self.folder / f"{name}.csv")
        write_file(self.folder / f"{name}.md", text)
        return Markdown(text)

    def trials(self, trials: pd.DataFrame) -> None:
        """Write tidy trials to `trials.csv`, beside those of other tasks."""
        write_trials(trials, self.folder / "trials.csv")
