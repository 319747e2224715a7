"""The specification curve: a claim's effects under all choices at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from replication.evidence.claims import short_label
from replication.evidence.sensitivity import HOLDS, LEVEL, UNDEFINED
from replication.evidence.specifications import DEFAULT, default_of, named_choices, sort_key
from replication.report import drawing
from replication.report.drawing import OUTCOMES, SMALL, handle
from replication.report.picture import Picture
from replication.report.readable import p_is
from replication.report.style import canvas, legend_below, settled


def curve(effects: pd.DataFrame, claim: str) -> Picture:
    """Show a claim's effects under all specifications, sorted, above the choices that made them.

    `effects` is an :func:`~replication.evidence.sensitivity.effects_table`. The default of its
    group "single" becomes a row of the group "default", with its choices written out.
    """
    rows = effects[effects["claim"] == claim]
    factorial = rows[rows["group"] == "factorial"].sort_values("effect", kind="stable")
    default = rows[(rows["group"] == "single") & (rows["specification"] == DEFAULT)]
    ids = named_choices(factorial["specification"].iloc[0])
    written = " ".join(f"{id}={default_of(id)}" for id in ids)
    default = default.assign(group=DEFAULT, specification=written)
    drawn = factorial[factorial["outcome"] != UNDEFINED]
    if drawn.empty:
        words = f"{claim} has no effect in any of {len(factorial)} specifications"
    else:
        words = (
            f"{claim} holds in {drawing.holding(drawn)}; it is {drawing.counted(drawn)}"
            f"{_without_caps(drawn).replace(chr(10), '; ')}. Effects run from "
            f"{drawn['effect'].min():.3g} to {drawn['effect'].max():.3g}"
        )
    for row in default.itertuples():
        words += f", that of the default specification is {row.effect:.3g} ({row.outcome})"
    return Picture(pd.concat([factorial, default], ignore_index=True), draw_curve, f"{words}.")


@settled
def draw_curve(numbers: pd.DataFrame) -> Figure:
    """Draw a specification curve; where no specification has an effect, one without counts."""
    default = numbers[numbers["group"] == DEFAULT]
    factorial = numbers[numbers["group"] != DEFAULT]
    part = factorial[factorial["outcome"] != UNDEFINED].reset_index(drop=True)
    choices = pd.DataFrame(map(named_choices, factorial["specification"]))
    rows = [(id, value) for id in choices for value in sorted(set(choices[id]), key=sort_key)]
    ids = [id for id, _ in rows]
    y = drawing.blocks(ids)
    heights = 2.25, 0.123 * (y[-1] + 1)
    layout = {"sharex": "col", "sharey": "row", "height_ratios": heights, "width_ratios": (10, 1)}
    figure, grid = canvas(2, 2, height=3.0 + heights[1], **layout)
    drawing.pad(figure, w_pad=0.03, h_pad=0.03, wspace=0.0, hspace=0.0)
    (top, corner), (matrix, shares) = grid
    first = factorial.iloc[0]
    _set_up(top, first, part)
    _draw_effects(top, part)
    corner.set_axis_off()
    for row in default.dropna(subset="effect").itertuples():
        top.axhline(row.effect, color="0.1", lw=1, ls=(0, (4, 2)), zorder=5)
        text = f"default\n{drawing.number(row.effect)}\n({row.n} trials)"
        corner.text(0, row.effect, text, size=7, va="center")
    x, outcome = np.arange(len(part)), part["outcome"].to_numpy()
    chosen = pd.DataFrame(map(named_choices, part["specification"]), columns=choices.columns)
    for at, (id, value) in zip(y, rows, strict=True):
        on = (chosen[id] == value).to_numpy()
        if on.any():
            colours = [OUTCOMES[name] for name in outcome[on]]
            matrix.vlines(x[on], at - 0.4, at + 0.4, colors=colours, lw=0.9)
            share = float((outcome[on] == HOLDS).mean())
            shares.barh(at, share, height=0.8, color=OUTCOMES[HOLDS], alpha=0.35, lw=0)
            shares.text(0.04, at, f"{share:.0%}", size=SMALL, va="center_baseline")
    drawing.shade_blocks(matrix, ids, y)
    bold = [pair for name in default["specification"] for pair in named_choices(name).items()]
    drawing.label_blocks(matrix, rows, y, bold)
    if len(part):
        _write_counts(top, part)
        shares.axvline((outcome == HOLDS).mean(), color=OUTCOMES[HOLDS], lw=0.8, ls=":")
    shares.set(xlim=(0, 1), xticks=[], xlabel=HOLDS)
    lost = len(factorial) - len(part)
    more = f"; {lost} more have none" if lost else ""
    matrix.set(xlabel=f"{len(part)} specifications, in the order of their effects{more}", xticks=[])
    for panel in (matrix, shares):
        panel.spines[:].set_visible(False)
        panel.tick_params(left=False, labelleft=False)
        panel.xaxis.label.set_size(7.5)
    neutral = f"no effect ({drawing.number(first['neutral'])})"
    handles = drawing.outcome_handles("o", neutral, capped=bool((part["capped"] > 0).any()))
    if part["null_low"].notna().any():
        handles.append(Patch(color="0.85", lw=0, label="95 % without any effect"))
    handles.append(handle("holds, over all", "", OUTCOMES[HOLDS], lw=0.8, ls=":"))
    legend_below(figure, handles)
    return figure


def _set_up(panel: Axes, first: pd.Series, part: pd.DataFrame) -> None:
    """Set up the panel of the effects, with the claim's name and what no effect is."""
    drawing.scale(panel, "y", first["statistic"], part["effect"])
    panel.axhline(first["neutral"], color="0.25", lw=1, zorder=1)
    panel.set_xlim(-1.5, len(part) + 0.5)
    name, symmetric = drawing.unit(panel, "y", first["statistic"], first["measure"])
    panel.set_ylabel(f"{name}\n(95 % interval{symmetric})")
    maps = ", on all maps" if "MAP" in named_choices(first["specification"]) else ""
    panel.set_title(f"{short_label(first['claim'])}{maps} ({first['claim']})", loc="left")
    panel.tick_params(axis="x", bottom=False)


def _draw_effects(panel: Axes, part: pd.DataFrame) -> None:
    band = part[["null_low", "null_high"]].to_numpy(float).T
    panel.fill_between(part.index, *band, color="0.85", lw=0, zorder=0)
    style: dict[str, Any] = {"ms": 2.6, "mew": 0.7, "zorder": 4}
    for outcome, colour in OUTCOMES.items():
        rows = part[part["outcome"] == outcome]
        panel.vlines(rows.index, rows["low"], rows["high"], color=colour, lw=0.9, alpha=0.4)
        for face, capped in ((colour, False), ("white", True)):
            some = rows[(rows["capped"] > 0) == capped]
            panel.plot(some.index, some["effect"], "o", mec=colour, mfc=face, **style)


def _write_counts(panel: Axes, part: pd.DataFrame) -> None:
    """Write in how many specifications a claim holds, where there is room.

    The curve rises: its upper left and lower right are free, one of them more than the other.
    """
    low, high, effect = _finite(panel, part[["low", "high", "effect"]].to_numpy(float))
    third = max(len(part) * 2 // 5, 1)
    above = np.nanmax(high) - np.nanmax(np.append(high[:third], effect[0]))
    below = np.nanmin(np.append(low[-third:], effect[-1])) - np.nanmin(low)
    (x, y), (ha, va) = (0.015, 0.97), ("left", "top")
    if below > above:
        (x, y), (ha, va) = (0.985, 0.04), ("right", "bottom")
    text = f"holds in {drawing.holding(part)}\n{drawing.counted(part)}{_without_caps(part)}"
    text += _jointly(part)
    halo = [patheffects.withStroke(linewidth=2.5, foreground="white")]
    place: dict[str, Any] = {"transform": panel.transAxes, "ha": ha, "va": va}
    panel.text(x, y, text, size=8, linespacing=1.4, path_effects=halo, zorder=6, **place)


def _jointly(part: pd.DataFrame) -> str:
    """Say what the joint test of all specifications gives, if there is one."""
    first = part.iloc[0]
    if np.isnan(first["p_median"]):
        return ""
    alone = int((part["p_family"] < LEVEL).sum())
    return (
        f"\njointly: median {p_is(first['p_median'])}, number {p_is(first['p_holds'])}"
        f"\n{alone} beyond chance by themselves (family-wise)"
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
    holds = (some["outcome"] == HOLDS).sum()
    share = 100 * holds / len(some)
    return f"\nwithout trials at the cap: holds in {holds} of {len(some)} ({share:.0f} %)"
