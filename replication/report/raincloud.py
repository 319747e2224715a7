"""A raincloud: the density of a sample, a dot for each trial, our mean, and the paper's."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

Array = NDArray[np.float64]

OURS: dict[str, Any] = {"marker": "|", "ms": 6, "mew": 1}
PAPER: dict[str, Any] = {"marker": "v", "ms": 5, "mfc": "white"}


def draw_cloud(panel: Axes, place: float, colour: str, values: Array) -> None:
    """Draw the density of a sample, and below it a dot for each trial."""
    # Of whole numbers: a narrower kernel would show them one by one.
    width = max(0.5, values.std() * len(values) ** -0.2)
    grid = np.linspace(values.min() - 3 * width, values.max() + 3 * width, 400)
    known, often = np.unique(values, return_counts=True)
    density = np.exp(-(((grid[:, None] - known) / width) ** 2) / 2) @ often
    top = place + 0.05 + 0.45 * density / density.max()
    panel.fill_between(grid, place + 0.05, top, color=colour, alpha=0.35, lw=0)
    # The golden ratio spreads the dots evenly, without chance.
    below = place - 0.16 * (np.arange(len(values)) * 0.618 % 1)
    style: dict[str, Any] = {"ms": 1, "mew": 0, "alpha": 0.4, "rasterized": True}
    panel.plot(values, below, "o", color=colour, **style)


def draw_mean(
    panel: Axes, place: float, colour: str, mean: float, ends: tuple[float, float], sd: float
) -> None:
    """Draw a mean, as wide as its interval, with the SD on both sides."""
    at = place - 0.26
    panel.plot([mean - sd, mean + sd], [at, at], color=colour, lw=1, solid_capstyle="butt")
    panel.plot(ends, [at, at], color=colour, lw=6, solid_capstyle="butt")
    panel.plot(mean, at, color=colour, **OURS)


def draw_paper(panel: Axes, place: float, colour: str, mean: float, sd: float) -> None:
    """Draw the mean and SD that the paper has."""
    at = place - 0.4
    panel.plot([mean - sd, mean + sd], [at, at], color=colour, lw=1, ls=(0, (2, 1)))
    panel.plot(mean, at, ls="none", mec=colour, zorder=4, **PAPER)
