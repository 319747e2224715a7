"""The specification curve: a claim's effects under all choices at once."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from replication.evidence.claims import short_label
from replication.evidence.sensitivity import HOLDS, UNDEFINED
from replication.evidence.specifications import DEFAULT, default_of, named_choices, sort_key
from replication.report.axes import (
    OUTCOMES,
    blocks,
    counted,
    handle,
    holding,
    label_blocks,
    number,
    outcome_handles,
    pad,
    scale,
    unit,
)
from replication.report.picture import Picture
from replication.report.style import canvas, legend_below, settled


def curve(effects: pd.DataFrame, claim: str) -> Picture:
    """Show a claim's effects under all specifications, sorted, above the choices that made them.

    Parameters
    ----------
    effects
        Of :func:`replication.evidence.sensitivity.effects_table`. The default of the group "single"
        becomes a row of the group "default", with its choices written out.
    claim
        Its id.
    """
    rows = effects[effects["claim"] == claim]
    factorial = rows[rows["group"] == "factorial"].sort_values("effect", kind="stable")
    default = rows[(rows["group"] == "single") & (rows["specification"] == DEFAULT)]
    ids = named_choices(factorial["specification"].iloc[0])
    written = " ".join(f"{id}={default_of(id)}" for id in ids)
    default = default.assign(group=DEFAULT, specification=written)
    drawn = factorial[factorial["outcome"] != UNDEFINED]
    words = (
        f"{claim} holds in {holding(drawn)}; it is {counted(drawn)}"
        f"{_without_caps(drawn).replace(chr(10), '; ')}. Effects run from "
        f"{drawn['effect'].min():.3g} to {drawn['effect'].max():.3g}"
    )
    for row in default.itertuples():
        words += f", that of the default specification is {row.effect:.3g} ({row.outcome})"
    return Picture(pd.concat([factorial, default], ignore_index=True), draw_curve, f"{words}.")


@settled
def draw_curve(numbers: pd.DataFrame) -> Figure:
    """Draw a specification curve."""
    default = numbers[numbers["group"] == DEFAULT]
    factorial = numbers[numbers["group"] != DEFAULT]
    part = factorial[factorial["outcome"] != UNDEFINED].reset_index(drop=True)
    chosen = pd.DataFrame(map(named_choices, part["specification"]))
    rows = [(id, value) for id in chosen for value in sorted(set(chosen[id]), key=sort_key)]
    y = blocks([id for id, _ in rows])
    matrix_height = 0.123 * (y[-1] + 1)
    figure, grid = canvas(
        2,
        2,
        height=3.0 + matrix_height,
        sharex="col",
        sharey="row",
        height_ratios=(2.25, matrix_height),
        width_ratios=(10, 1),
    )
    pad(figure, w_pad=0.03, h_pad=0.03, wspace=0.0, hspace=0.0)
    (top, corner), (matrix, shares) = grid
    _draw_effects(top, part)
    corner.set_axis_off()
    for row in default.dropna(subset="effect").itertuples():
        top.axhline(row.effect, color="0.1", lw=1, ls=(0, (4, 2)), zorder=5)
        text = f"default\n{number(row.effect)}\n({row.n} trials)"
        corner.text(0, row.effect, text, size=7, va="center")
    x, outcome = np.arange(len(part)), part["outcome"].to_numpy()
    for at, (id, value) in zip(y, rows, strict=True):
        on = (chosen[id] == value).to_numpy()
        colours = [OUTCOMES[name] for name in outcome[on]]
        matrix.vlines(x[on], at - 0.4, at + 0.4, colors=colours, lw=0.9)
        share = float((outcome[on] == HOLDS).mean())
        shares.barh(at, share, height=0.8, color=OUTCOMES[HOLDS], alpha=0.35, lw=0)
        shares.text(0.04, at, f"{share:.0%}", size=6.5, va="center_baseline")
    defaults = {id: value for name in default["specification"] for id, value in _items(name)}
    label_blocks(matrix, rows, y, defaults=defaults)
    shares.axvline((outcome == HOLDS).mean(), color=OUTCOMES[HOLDS], lw=0.8, ls=":")
    shares.set(xlim=(0, 1), xticks=[], xlabel=HOLDS)
    lost = len(factorial) - len(part)
    more = f"; {lost} more have none" if lost else ""
    matrix.set(xlabel=f"{len(part)} specifications, in the order of their effects{more}", xticks=[])
    for panel in (matrix, shares):
        panel.spines[:].set_visible(False)
        panel.tick_params(left=False, labelleft=False)
        panel.xaxis.label.set_size(7.5)
    margin = f"margin ({number(part['margin'].iloc[0])})"
    handles = outcome_handles("o", margin, capped=bool((part["capped"] > 0).any()))
    handles.append(handle("holds, over all", "", OUTCOMES[HOLDS], lw=0.8, ls=":"))
    legend_below(figure, handles)
    return figure


def _items(name: str) -> list[tuple[str, str]]:
    return list(named_choices(name).items())


def _draw_effects(panel: Axes, part: pd.DataFrame) -> None:
    first = part.iloc[0]
    scale(panel, "y", first["statistic"], part["effect"])
    panel.axhline(first["margin"], color="0.25", lw=1, zorder=1)
    for outcome, colour in OUTCOMES.items():
        rows = part[part["outcome"] == outcome]
        panel.vlines(rows.index, rows["low"], rows["high"], color=colour, lw=0.9, alpha=0.4)
        for capped in (False, True):
            some = rows[(rows["capped"] > 0) == capped]
            face = "white" if capped else colour
            panel.plot(
                some.index, some["effect"], "o", ms=2.6, mew=0.7, mec=colour, mfc=face, zorder=4
            )
    panel.set_xlim(-1.5, len(part) + 0.5)
    name, symmetric = unit(panel, "y", first["statistic"], first["measure"])
    panel.set_ylabel(f"{name}\n(95 % interval{symmetric})")
    maps = ", on all maps" if "MAP" in named_choices(first["specification"]) else ""
    panel.set_title(f"{short_label(first['claim'])}{maps} ({first['claim']})", loc="left")
    panel.tick_params(axis="x", bottom=False)
    # The curve rises: its upper left and lower right are free, one of them more than the other.
    low, high, effect = _finite(panel, part[["low", "high", "effect"]].to_numpy(float))
    third = max(len(part) * 2 // 5, 1)
    above = np.nanmax(high) - np.nanmax(np.append(high[:third], effect[0]))
    below = np.nanmin(np.append(low[-third:], effect[-1])) - np.nanmin(low)
    place, side = ((0.015, 0.97), ("left", "top"))
    if below > above:
        place, side = ((0.985, 0.04), ("right", "bottom"))
    panel.text(
        *place,
        f"holds in {holding(part)}\n{counted(part)}{_without_caps(part)}",
        transform=panel.transAxes,
        ha=side[0],
        va=side[1],
        size=8,
        linespacing=1.4,
        path_effects=[patheffects.withStroke(linewidth=2.5, foreground="white")],
        zorder=6,
    )


def _finite(panel: Axes, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return columns as rows, on a linear scale."""
    log = panel.get_yscale() == "log"
    with np.errstate(divide="ignore"):
        scaled: NDArray[np.float64] = (np.log(values) if log else values).T
    return np.where(np.isfinite(scaled), scaled, np.nan)


def _without_caps(part: pd.DataFrame) -> str:
    """Say in how many specifications without a trial at the cap a claim holds, if others exist.

    Nothing is said of shares: without such a trial they are 1.
    """
    some = part[part["capped"] == 0]
    if part["statistic"].iloc[0] == "share" or len(some) in (0, len(part)):
        return ""
    holds = int((some["outcome"] == HOLDS).sum())
    share = 100 * holds / len(some)
    return f"\nwithout trials at the cap: holds in {holds} of {len(some)} ({share:.0f} %)"
