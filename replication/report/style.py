"""The style of all figures, and how they become files.

Figures do not go through pyplot and its global state. Files carry no time or version, and SVG ids
are derived from the content, so that equal numbers give equal bytes on one platform.
"""

from __future__ import annotations

import functools
import io
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from replication.files import write_file

P = ParamSpec("P")

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.labelsize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.2,
    "svg.hashsalt": "replication",
    "svg.fonttype": "path",
    "figure.dpi": 200,  # as saved: letters are as wide as their pixels make them
    "savefig.dpi": 200,
}

CORRECT_COLOUR = "#D0021B"
KIND_COLOURS = {"hit": "#0B3C8C", "detour": "#56A3E8"}
OTHER_KIND_COLOUR = "#009E73"

WIDTH = 7.0
"""Inches: both columns of a page."""

ROW = 115
"""Characters that a row of a legend has room for, 8 of them for each handle."""


def style() -> AbstractContextManager[None]:
    """Draw in our style, whatever the caller's conditions are."""
    return mpl.rc_context(mpl.rcParamsDefault | STYLE)


def settled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Draw in our style and settle the layout, else each save would go on from the one before.

    Positions are rounded: their last bits depend on addresses in memory, and the ids of an SVG on
    them.
    """

    @functools.wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with style():
            figure = draw(*args, **kwargs)
            figure.draw_without_rendering()
        figure.set_layout_engine("none")
        for axes in figure.axes:
            axes.set_position(np.round(axes.get_position(original=True).bounds, 9).tolist())
        return figure

    return wrapper


def save_figure(figure: Figure, path: Path, formats: Sequence[str] = ("png", "svg")) -> list[Path]:
    """Write a figure as `path` with each of the suffixes; returns the files."""
    options: dict[str, dict[str, Any]] = {
        "png": {"metadata": {"Software": None}, "pil_kwargs": {"optimize": True}},
        "svg": {"metadata": {"Date": None, "Creator": None}},
    }
    written = []
    for suffix in formats:
        buffer = io.BytesIO()
        with style():
            figure.savefig(buffer, format=suffix, **options[suffix])
        written.append(write_file(path.with_suffix(f".{suffix}"), buffer.getvalue()))
    return written


def canvas(n_rows: int, n_columns: int, *, height: float, **layout: Any) -> tuple[Figure, Any]:
    """Return a figure as wide as a page, and its axes as an array."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(n_rows, n_columns, **layout)
    return figure, np.atleast_1d(axes)


def legend_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """Put a legend below all axes, in as many rows as its entries need."""
    sizes = [len(str(handle.get_label())) + 8 for handle in handles]
    for rows in range(1, len(sizes) + 1):
        columns = np.array_split(sizes, -(-len(sizes) // rows))
        if sum(map(max, columns)) <= ROW:
            break
    figure.legend(handles=handles, loc="outside lower center", ncols=len(columns))
