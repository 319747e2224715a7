"""A figure as one object: its numbers, how they are drawn, and what they show in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd
from matplotlib.figure import Figure


@dataclass(frozen=True)
class Picture:
    """A figure that is drawn from the table that is saved beside it, and from nothing else.

    Attributes
    ----------
    numbers
        What is plotted: the table that is saved.
    draw
        A function of a module that draws the table, as it is read back from its file.
    words
        What the figure shows, for those who cannot see it.
    """

    numbers: pd.DataFrame
    draw: Callable[[pd.DataFrame], Figure]
    words: str

    @property
    def code(self) -> str:
        """The drawing function's full name, by which it is found again."""
        return f"{self.draw.__module__}.{self.draw.__qualname__}"
