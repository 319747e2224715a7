"""The specification curve: a claim's effects under all choices at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from replication.evidence.claims import load_claims
from replication.evidence.sensitivity import HOLDS, LEVEL, UNDEFINED, epsilon_squared
from replication.evidence.specifications import DEFAULT, default_of, named_choices, sort_key
from replication.report import choices, drawing
from replication.report.drawing import OUTCOMES, handle
from replication.report.picture import Picture
from replication.report.readable import p_is
from replication.report.style import canvas, legend_below, settled

MOST, LEAST = 5, 0.01
"""How many choices are drawn at most, and the share of the variance that one has at least."""


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
            f"{claim}: {'; '.join(_counts(drawn))}. Effects run from "
            f"{drawn['effect'].min():.3g} to {drawn['effect'].max():.3g}"
        )
    for row in default.itertuples():
        words += f", that of the default specification is {row.effect:.3g} ({row.outcome})"
    return Picture(pd.concat([factorial, default], ignore_index=True), draw_curve, f"{words}.")


@settled
def draw_curve(numbers: pd.DataFrame) -> Figure:
    """Draw a specification curve above the choices that matter most to it."""
    default = numbers[numbers["group"] == DEFAULT]
    factorial = numbers[numbers["group"] != DEFAULT]
    part = factorial[factorial["outcome"] != UNDEFINED].reset_index(drop=True)
    variance = _variance(factorial)
    ids = variance.index[: max((variance[:MOST] >= LEAST).sum(), 1)].tolist()
    values = pd.DataFrame(map(named_choices, factorial["specification"]))
    rows = [(id, value) for id in ids for value in sorted(set(values[id]), key=sort_key)]
    y = drawing.blocks([id for id, _ in rows])
    heights = 2.2, 0.135 * (y[-1] + 1)
    layout = {"sharex": "col", "sharey": "row", "height_ratios": heights, "width_ratios": (9, 1)}
    figure, grid = canvas(2, 2, height=2.0 + sum(heights), **layout)
    drawing.pad(figure, w_pad=0.03, h_pad=0.03, wspace=0.0, hspace=0.0)
    (top, corner), (matrix, shares) = grid
    claim = load_claims().by_id(factorial["claim"].iloc[0]).claim
    title: dict[str, Any] = {"x": 0.004, "ha": "left", "size": 9, "weight": "bold"}
    figure.suptitle(f"The claim: {drawing.statement(claim)}", **title)
    _draw_effects(top, factorial.iloc[0], part)
    corner.set_axis_off()
    for row in default.dropna(subset="effect").itertuples():
        top.axhline(row.effect, color="0.1", lw=1, ls=drawing.DASHES, zorder=5)
        text = f"default\n{drawing.number(row.effect)}\n({row.n} trials)"
        corner.text(0, row.effect, text, size=7, va="center")
    _draw_choices(matrix, shares, part, rows, y)
    bold = [pair for name in default["specification"] for pair in named_choices(name).items()]
    drawing.label_blocks(matrix, rows, y, bold)
    for id in ids:
        second = y[[one for one, _ in rows].index(id) + 1]
        share = f"{100 * max(variance[id], 0):.0f} % of the variance"
        drawing.beside(matrix, share, 0, second, drawing.LABELS, color="0.35")
    lost = len(factorial) - len(part)
    more = f"; {lost} more have none" if lost else ""
    text = f"{len(part)} specifications in the order of their effects{more}"
    others = ", ".join(choices.title(id) for id in variance.index if id not in ids)
    matrix.set_xlabel(text, size=7.5)
    neutral = f"no effect ({drawing.number(factorial['neutral'].iloc[0])})"
    handles = drawing.outcome_handles("o", neutral, capped=bool((part["capped"] > 0).any()))
    handles.append(handle("default (values in bold)", "", "0.1", lw=1, ls=drawing.DASHES))
    handles.append(handle("holds, over all", "", OUTCOMES[HOLDS], lw=0.8, ls=":"))
    if part["null_low"].notna().any():
        handles.append(Patch(color="0.85", lw=0, label="95 % without any effect"))
    legend_below(figure, handles)
    drawing.note(figure, f"Not drawn, as they matter less: {others}.")
    return figure


def _variance(factorial: pd.DataFrame) -> pd.Series:
    """Return the share of the variance of each choice that can act, the largest first."""
    claim, names = factorial[["claim", "specification"]].iloc[0]
    ids = [id for id in named_choices(names) if choices.acts(id, claim)]
    known = epsilon_squared(factorial).set_index("choice")["share"].reindex(ids).fillna(0.0)
    return known.sort_values(ascending=False, kind="stable")


def _draw_effects(panel: Axes, first: pd.Series, part: pd.DataFrame) -> None:
    """Draw the curve with its null band, and say above it in how many specifications it holds."""
    drawing.scale(panel, "y", first["statistic"], part["effect"])
    panel.axhline(first["neutral"], color="0.25", lw=1, zorder=1)
    panel.set_xlim(-1.5, len(part) + 0.5)
    name = drawing.unit(panel, "y", first["statistic"], first["measure"])
    name = name.replace(", log", ",\nlog")
    panel.set_ylabel(f"{name}\n(95 % interval)", size=8)
    panel.tick_params(axis="x", bottom=False)
    if len(part):
        place: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
        place |= {"size": 8, "linespacing": 1.4, "va": "bottom"}
        panel.annotate("\n".join(_counts(part)), (0, 1), (drawing.LABELS, 5), **place)
    band = part[["null_low", "null_high"]].to_numpy(float).T
    panel.fill_between(part.index, *band, color="0.85", lw=0, zorder=0)
    for outcome, colour in OUTCOMES.items():
        rows = part[part["outcome"] == outcome]
        panel.vlines(rows.index, rows["low"], rows["high"], color=colour, lw=0.9, alpha=0.35)
        for face, capped in ((colour, False), ("white", True)):
            some = rows[(rows["capped"] > 0) == capped]
            look: dict[str, Any] = {"mec": colour, "mfc": face, "ms": 2.8, "mew": 0.6}
            panel.plot(some.index, some["effect"], "o", alpha=0.65, zorder=4, **look)


def _draw_choices(
    matrix: Axes,
    shares: Axes,
    part: pd.DataFrame,
    rows: Sequence[tuple[str, str]],
    y: NDArray[np.float64],
) -> None:
    """Draw which specifications have each value, and in which share of them the claim holds."""
    outcome = part["outcome"].to_numpy()
    names = [named_choices(name) for name in part["specification"]]
    for at, (id, value) in zip(y, rows, strict=True):
        on = np.array([name[id] == value for name in names], bool)
        if on.any():
            x, colours = np.flatnonzero(on), [OUTCOMES[name] for name in outcome[on]]
            matrix.vlines(x, at - 0.4, at + 0.4, colors=colours, lw=0.9)
            share = float((outcome[on] == HOLDS).mean())
            shares.barh(at, share, height=0.7, color=OUTCOMES[HOLDS], alpha=0.5, lw=0)
            drawing.beside(shares, f"{100 * share:.0f} %", 1, at, 28, ha="right")
    drawing.shade_blocks(matrix, [id for id, _ in rows], y)
    if len(part):
        shares.axvline((outcome == HOLDS).mean(), color=OUTCOMES[HOLDS], lw=0.8, ls=":")
    matrix.set_xticks([])
    shares.set(xlim=(0, 1), xticks=[])
    shares.set_xlabel(HOLDS, size=7.5)
    for panel in (matrix, shares):
        panel.spines[:].set_visible(False)
        panel.tick_params(left=False, labelleft=False)


def _counts(part: pd.DataFrame) -> list[str]:
    """Say in how many specifications the claim holds, and what the joint test gives, if any."""
    lines = [f"holds in {drawing.holding(part)}, {drawing.counted(part)}"]
    uncapped = part[part["capped"] == 0]
    if 0 < len(uncapped) < len(part):
        holds = (uncapped["outcome"] == HOLDS).sum()
        share = 100 * holds / len(uncapped)
        lines.append(
            f"without trials at the cap: holds in {holds} of {len(uncapped)} ({share:.0f} %)"
        )
    first = part.iloc[0]
    if not np.isnan(first["p_median"]):
        alone = int((part["p_family"] < LEVEL).sum())
        lines.append(
            f"joint test: median {p_is(first['p_median'])}, number that hold "
            f"{p_is(first['p_holds'])}; {alone} beyond chance by themselves"
        )
    return lines
