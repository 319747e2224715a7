"""The panels of Fig. 7: maps, lines along the expert's path, and the paper's surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from replication.report.drawing import READING_MARKS
from replication.report.maze import ticks
from replication.report.readable import F_LABELS
from replication.report.style import WIDTH, settled

SURFACES = {"q_mid": "(a) Q", "q_end": "(b) Q", "reward_end": "(d) reward"}
HEIGHT = 6.5
LEFT = 0.5  # inches


@settled
def draw_values(numbers: pd.DataFrame) -> Figure:
    """Draw maps above, lines along the path below them, and the paper's surfaces at the foot."""
    figure = Figure(figsize=(WIDTH, HEIGHT))
    FigureCanvasAgg(figure)
    _draw_maps(figure, numbers)
    _draw_lines(figure, numbers)
    _draw_surfaces(figure, numbers)
    return figure


def _axes(
    figure: Figure, left: float, bottom: float, width: float, height: float, **more: Any
) -> Any:
    """Add axes, in inches."""
    box = np.array([left / WIDTH, bottom / HEIGHT, width / WIDTH, height / HEIGHT])
    return figure.add_axes(tuple(box), **more)


def grid_of(numbers: pd.DataFrame, surface: str) -> NDArray[np.float64]:
    """Return the values of a surface, `[y, x]`."""
    rows = numbers[numbers["surface"] == surface]
    return rows.pivot(index="y", columns="x", values="value").sort_index().to_numpy(float)


def _draw_maps(figure: Figure, numbers: pd.DataFrame) -> None:
    middle, end = (grid_of(numbers, name) for name in ("q_mid", "q_end"))
    reward, change = grid_of(numbers, "reward_end"), end - middle
    iteration = {str(s): i for s, i in zip(numbers["surface"], numbers["iteration"], strict=True)}
    path = numbers[numbers["surface"] == "path"]
    q = {"vmin": np.nanmin([middle, end]), "vmax": np.nanmax([middle, end]), "cmap": "viridis"}
    size = np.abs(change[np.nan_to_num(change) != 0])
    # The few cells that change most, as the agent had not learned of them, would hide the rest.
    far = np.quantile(size, 0.9) if len(size) else 1.0
    both = {"vmin": -far, "vmax": far, "cmap": "PuOr_r"}
    shown: list[tuple[str, NDArray[np.float64], dict[str, Any]]] = [
        (f"(a) Q, iteration {iteration['q_mid']:.0f}", middle, q),
        (f"(b) Q, end: iteration {iteration['q_end']:.0f}", end, q),
        ("(c) Q: (b) \N{MINUS SIGN} (a)", change, both),
        ("(d) reward, end", reward, {"cmap": "viridis"}),
    ]
    width, gap, bottom = 1.47, 0.17, 4.73
    images, lefts = [], [LEFT + place * (width + gap) for place in range(4)]
    for left, (title, grid, style) in zip(lefts, shown, strict=True):
        panel = _axes(figure, left, bottom, width, width)
        images.append(panel.imshow(grid, origin="lower", **style))
        line = panel.plot(path["x"], path["y"], color="white", lw=0.7)
        line[0].set_path_effects([Stroke(linewidth=1.5, foreground="black"), Normal()])
        panel.set_title(title, size=8.5)
        panel.set(xticks=ticks(grid.shape[1]), yticks=ticks(grid.shape[0]), facecolor="0.55")
        panel.tick_params(labelsize=7, length=2, labelleft=left == LEFT)
        panel.spines[:].set_visible(True)
        panel.set_xlabel("x (cells)", size=8, labelpad=2)
    figure.axes[0].set_ylabel("y (cells)", size=8)
    bars = [(lefts[0], 2 * width + gap, images[0], "Q of a cell, in (a) and (b)")]
    bars += [
        (lefts[2], width, images[2], "change of Q"),
        (lefts[3], width, images[3], "reward weight"),
    ]
    for left, length, image, label in bars:
        place = _axes(figure, left, bottom - 0.52, length, 0.08)
        extend = "both" if image is images[2] else "neither"
        bar = figure.colorbar(image, cax=place, orientation="horizontal", extend=extend)
        bar.ax.tick_params(labelsize=7, length=2, pad=1)
        bar.locator = MaxNLocator(4 if length == width else 8)
        bar.update_ticks()
        bar.set_label(label, size=8, labelpad=2)


def _draw_lines(figure: Figure, numbers: pd.DataFrame) -> None:
    rows = numbers[numbers["surface"].isin(["along_mid", "along_end", "along_growth", "growth"])]
    readings = [name for name in READING_MARKS if name in set(rows["reading"])]
    by = {(str(s), str(r)): part for (s, r), part in rows.groupby(["surface", "reading"])}
    width, gap, bottom, height = 1.72, 0.16, 2.0, 1.5
    n = rows["n"].max()
    levels: list[Axes] = []
    for place, reading in enumerate(readings):
        panel = _axes(figure, LEFT + place * (width + gap), bottom, width, height)
        for name, style in (
            ("along_mid", {"color": "0.45", "ls": "--", "label": "mid-term"}),
            ("along_end", {"color": "#0072B2", "label": "end"}),
        ):
            part = by[name, reading]
            panel.fill_between(
                part["step"], part["low"], part["high"], alpha=0.2, lw=0, color=style["color"]
            )
            panel.plot(part["step"], part["value"], **style)
        panel.set_title(f"({'ef'[place]}) {F_LABELS[reading]}", size=8.5)
        levels.append(panel)
    low = min(0, *(panel.get_ylim()[0] for panel in levels))
    high = max(panel.get_ylim()[1] for panel in levels)
    for panel in levels:
        panel.set(ylim=(low, high + 0.4 * (high - low)))  # room for the legend
        panel.tick_params(labelleft=panel is levels[0])
    levels[0].set_ylabel("max Q on the path: mean", size=8)
    middle_half = Patch(color="0.45", alpha=0.3, lw=0, label=f"middle half of {n:.0f} trials")
    handles = [*levels[0].get_legend_handles_labels()[0], middle_half]
    small: dict[str, Any] = {
        "fontsize": 7,
        "handlelength": 1.6,
        "borderaxespad": 0,
        "labelspacing": 0.3,
    }
    levels[-1].legend(handles=handles, loc="upper right", **small)
    left = LEFT + len(readings) * (width + gap) + 0.42
    panel = _axes(figure, left, bottom, WIDTH - left - 0.62, height)
    panel.axhline(0, color="0.5", lw=0.7)
    _draw_growth(panel, by, readings)
    panel.set_title(f"({'efg'[len(readings)]}) growth of Q, with 95 % interval", size=8.5)
    for each in (*levels, panel):
        last = max(int(rows["step"].max()), 1)
        each.set_xlim(0, last)
        each.set_xticks([*range(0, last - 3, 10), last])
        each.tick_params(labelsize=7, length=2)
        each.set_xlabel("step on the expert's path", size=8, labelpad=2)


def _draw_growth(
    panel: Axes, by: dict[tuple[str, str], pd.DataFrame], readings: Sequence[str]
) -> None:
    """Draw the growth along the path, and its mean over the path at the right of it."""
    for reading in readings:
        _, colour = READING_MARKS[reading]
        part = by["along_growth", reading]
        panel.fill_between(part["step"], part["low"], part["high"], alpha=0.25, lw=0, color=colour)
        panel.plot(part["step"], part["value"], color=colour)
    low, high = panel.get_ylim()
    panel.set_ylim(low, high)
    means = sorted((by["growth", reading]["value"].iloc[0], reading) for reading in readings)
    at = -np.inf
    outside: dict[str, Any] = {"transform": panel.get_yaxis_transform(), "clip_on": False}
    for value, reading in means:
        mark, colour = READING_MARKS[reading]
        (mean,) = by["growth", reading].itertuples()
        panel.plot([1.07, 1.07], [mean.low, mean.high], color=colour, lw=1.5, **outside)
        panel.plot(1.07, value, mark, ms=4, color=colour, **outside)
        at = max(at + 0.22 * (high - low), value)
        text = f"{F_LABELS[reading].split()[0]}:\n{value:.2f}".replace("-", "\N{MINUS SIGN}")
        panel.text(1.13, at, text, size=7.5, va="center", color=colour, **outside)
    panel.text(1.07, high, "mean", size=7.5, va="top", **outside)


def _draw_surfaces(figure: Figure, numbers: pd.DataFrame) -> None:
    """Draw the maps as surfaces, as the paper does; what has no value is left out."""
    facets: dict[str, Any] = {"rstride": 1, "cstride": 1, "lw": 0.1, "ec": "0.35", "shade": False}
    figure.text(
        LEFT / WIDTH,
        1.35 / HEIGHT,
        "as in the paper:\n(a), (b) and (d)\nas surfaces",
        size=8,
        va="top",
    )
    for place, (surface, title) in enumerate(SURFACES.items()):
        height = grid_of(numbers, surface)
        x, y = np.meshgrid(*(np.arange(n) for n in height.shape[::-1]))
        panel = _axes(figure, 1.5 + 1.8 * place, 0.2, 1.8, 1.35, projection="3d")
        panel.plot_surface(x, y, height, facecolors=_face_colours(height), **facets)
        panel.set(xticklabels=[], yticklabels=[], zticklabels=[])
        panel.set_xlabel("x", labelpad=-14, size=7)
        panel.set_ylabel("y", labelpad=-14, size=7)
        panel.set_title(title, size=8, y=0.93, x=0.2)
        panel.set_box_aspect((1, 1, 0.75), zoom=1.05)
        panel.view_init(elev=28, azim=-125)


def _face_colours(height: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the colour of each facet by its highest corner, so that peaks of one cell show."""
    corners = np.stack([height[:-1, :-1], height[1:, :-1], height[:-1, 1:], height[1:, 1:]])
    top = np.where(np.isnan(corners).any(axis=0), np.nan, corners.max(axis=0))
    scaled = (top - np.nanmin(height)) / max(np.nanmax(height) - np.nanmin(height), 1e-300)
    colours: NDArray[np.float64] = mpl.colormaps["viridis"](scaled)
    return colours
