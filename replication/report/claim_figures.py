"""Figures of the claims, and of what they depend on, each with its finding in words.

As in :mod:`replication.report.figures`, all numbers are computed already: nothing is estimated here.
"""

from __future__ import annotations

import textwrap
from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps, patheffects
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import Locator, MaxNLocator, NullFormatter, NullLocator
from numpy.typing import NDArray

from replication.evidence.calibration import CALIBRATED
from replication.evidence.claims import LABELS, Claim, short_label
from replication.evidence.experiments import F_LABELS
from replication.evidence.sensitivity import HOLDS, OPEN, REVERSED, UNDEFINED, unchanged
from replication.evidence.specifications import Specification, default_of
from replication.evidence.verdicts import REPRODUCED, by_claim, overall
from replication.evidence.verdicts import REVERSED as VERDICT_REVERSED
from replication.paper.published import Published
from replication.paper.register import Value
from replication.report.style import canvas, legend_below, settled

OUTCOMES = {HOLDS: "#0072B2", OPEN: "#9A9A9A", REVERSED: "#D55E00"}
MARKS = {HOLDS: "o", OPEN: "s", REVERSED: "D"}
READINGS = {"printed": ("o", "#222222"), "updated": ("s", "#009E73"), "": ("o", "#222222")}
VERDICTS = {REPRODUCED: OUTCOMES[HOLDS], VERDICT_REVERSED: OUTCOMES[REVERSED]}
SMALL = 6.8

FAR = 8
"""How far beyond the upper quartile an effect has to lie for an axis that turns logarithmic."""

UNITS = {
    ("mean-difference", "iterations"): "difference in iterations",
    ("mean-difference", "early_errors"): "difference in erroneous motions",
    ("sd-ratio", "iterations"): "ratio of SDs",
    ("mean", "q_growth"): "growth of Q",
    ("mean", "q_slope"): "rank correlation",
    ("mean", "reward_slope"): "rank correlation",
    ("share", "converged"): "share of trials at zero",
}
"""The unit of a comparative claim's effect, by its statistic and its measure."""


# --- the verdicts --------------------------------------------------------------------------------


@settled
def claims_figure(table: pd.DataFrame) -> Figure:
    """Draw the verdicts on the comparative claims, a panel for each unit.

    Parameters
    ----------
    table
        Of :func:`replication.evidence.verdicts.judge_claims`; claims about published numbers are left out.
    """
    table = _comparative(table)
    units = [unit for unit in dict.fromkeys(UNITS.values()) if unit in set(table["unit"])]
    parts = [table[table["unit"] == unit] for unit in units]
    sizes = [part["id"].nunique() for part in parts]
    figure, axes = canvas(
        len(units), 1, height=0.4 + 0.37 * len(units) + 0.29 * sum(sizes), height_ratios=sizes
    )
    for panel, unit, part in zip(axes, units, parts, strict=True):
        _draw_verdicts(panel, part)
        panel.set_xlabel(unit, size=7.5, labelpad=1)
    handles = _reading_handles(table)
    handles += [
        _handle("the paper's effect", "v", "0.3", ms=6, mfc="white", lw=0),
        _handle("margin", "", "0.25", lw=1),
        Patch(color="0.93", lw=0, label="claimed side"),
    ]
    legend_below(figure, handles)
    return figure


def describe_claims(table: pd.DataFrame) -> str:
    """Return in words how many comparative claims have which verdict over both readings."""
    found: dict[str, list[str]] = {}
    for id, rows in by_claim(_comparative(table)):
        found.setdefault(overall(rows["verdict"].tolist()), []).append(id)
    parts = [f"{len(ids)} {verdict} ({', '.join(ids)})" for verdict, ids in found.items()]
    return f"Of {sum(map(len, found.values()))} comparative claims, {'; '.join(parts)}."


def _comparative(table: pd.DataFrame) -> pd.DataFrame:
    units = [UNITS.get(key) for key in zip(table["statistic"], table["measure"], strict=True)]
    return table.assign(unit=units).dropna(subset="unit")


def _draw_verdicts(panel: Axes, part: pd.DataFrame) -> None:
    ids = list(dict.fromkeys(part["id"]))
    _scale(panel, "x", part["statistic"].iloc[0], part["effect"])
    _limit(panel, part[["low", "high", "effect", "paper", "margin"]].to_numpy(float))
    for at, (_, rows) in enumerate(by_claim(part)):
        claimed, margin = rows["direction"].iloc[0], rows["margin"].iloc[0]
        side = panel.get_xlim()[int(claimed == "greater")]
        panel.fill_betweenx([at - 0.48, at + 0.48], margin, side, color="0.93", lw=0, zorder=0)
        panel.vlines(margin, at - 0.48, at + 0.48, color="0.25", lw=1, zorder=1)
        for place, row in zip(np.linspace(-0.25, 0.25, len(rows)), rows.itertuples(), strict=True):
            mark, colour = READINGS[row.F]
            panel.hlines(at + place, row.low, row.high, color=colour, lw=1.4)
            panel.plot(row.effect, at + place, mark, color=colour, ms=4, zorder=4)
            bold = "bold" if row.verdict in VERDICTS else "normal"
            told = VERDICTS.get(row.verdict, "0.35")
            _beside(panel, row.verdict, 1, at + place, 5, color=told, weight=bold)
        panel.plot(rows["paper"].iloc[0], at, "v", ms=6, mfc="none", mec="0.3", zorder=5)
    panel.set(yticks=range(len(ids)), ylim=(len(ids) - 0.5, -0.5))
    panel.set_yticklabels([f"{LABELS.get(id, id)}\n{id}" for id in ids], size=SMALL)
    panel.tick_params(axis="x", labelsize=SMALL, pad=2)
    panel.tick_params(axis="y", length=0)
    panel.spines["left"].set_visible(False)


# --- all choices at once -------------------------------------------------------------------------


@settled
def curve_figure(
    effects: pd.DataFrame, specifications: Sequence[Specification], claim: Claim
) -> Figure:
    """Draw a claim's effects under all specifications, sorted, above the choices that made them.

    Parameters
    ----------
    effects
        Of :func:`replication.evidence.sensitivity.effects_table`; the row "default" of the group "single" is
        drawn as a line.
    specifications
        Those of the factorial.
    claim
        The claim.
    """
    part = _sorted_effects(effects, specifications, claim)
    chosen = {one.name: dict(one.choices) for one in specifications}
    values = {
        id: sorted({chosen[name][id] for name in part["specification"]}, key=_order)
        for id, _ in specifications[0].choices
    }
    rows = [(id, value) for id, some in values.items() for value in some]
    y = _blocks([id for id, _ in rows])
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
    _pad(figure, w_pad=0.03, h_pad=0.03, wspace=0.0, hspace=0.0)
    (top, corner), (matrix, shares) = grid
    _draw_curve(top, part, claim)
    corner.set_axis_off()
    for row in _default(effects, claim).dropna(subset="effect").itertuples():
        top.axhline(row.effect, color="0.1", lw=1, ls=(0, (4, 2)), zorder=5)
        said = f"default\n{_number(row.effect)}\n({row.n} trials)"
        corner.text(0, row.effect, said, size=7, va="center")
    x, outcome = np.arange(len(part)), part["outcome"].to_numpy()
    for at, (id, value) in zip(y, rows, strict=True):
        on = np.array([chosen[name][id] == value for name in part["specification"]])
        colours = [OUTCOMES[one] for one in outcome[on]]
        matrix.vlines(x[on], at - 0.4, at + 0.4, colors=colours, lw=0.9)
        share = float((outcome[on] == HOLDS).mean())
        shares.barh(at, share, height=0.8, color=OUTCOMES[HOLDS], alpha=0.35, lw=0)
        shares.text(0.04, at, f"{share:.0%}", size=6.5, va="center_baseline")
    _label_blocks(matrix, rows, y)
    shares.axvline((outcome == HOLDS).mean(), color=OUTCOMES[HOLDS], lw=0.8, ls=":")
    shares.set(xlim=(0, 1), xticks=[], xlabel=HOLDS)
    lost = len(specifications) - len(part)
    more = f"; {lost} more have none" if lost else ""
    matrix.set(xlabel=f"{len(part)} specifications, in the order of their effects{more}", xticks=[])
    for panel in (matrix, shares):
        panel.spines[:].set_visible(False)
        panel.tick_params(left=False, labelleft=False)
        panel.xaxis.label.set_size(7.5)
    margin = f"margin ({_number(claim.margin)})"
    handles = _outcome_handles("o", margin, capped=bool((part["capped"] > 0).any()))
    handles.append(_handle("holds, over all", "", OUTCOMES[HOLDS], lw=0.8, ls=":"))
    legend_below(figure, handles)
    return figure


def describe_curve(
    effects: pd.DataFrame, specifications: Sequence[Specification], claim: Claim
) -> str:
    """Return in words in how many specifications a claim holds, and how far its effects reach."""
    part = _sorted_effects(effects, specifications, claim)
    said = (
        f"{claim.id} holds in {_holding(part)}; it is {_counted(part)}"
        f"{_without_caps(part, claim).replace(chr(10), '; ')}. Effects run from "
        f"{part['effect'].min():.3g} to {part['effect'].max():.3g}"
    )
    for row in _default(effects, claim).itertuples():
        said += f", that of the default specification is {row.effect:.3g} ({row.outcome})"
    return f"{said}."


def _sorted_effects(
    effects: pd.DataFrame, specifications: Sequence[Specification], claim: Claim
) -> pd.DataFrame:
    wanted = {one.name for one in specifications}
    own = effects[(effects["claim"] == claim.id) & effects["specification"].isin(wanted)]
    own = own[own["outcome"] != UNDEFINED]
    return own.sort_values("effect", kind="stable", ignore_index=True)


def _default(effects: pd.DataFrame, claim: Claim) -> pd.DataFrame:
    own = effects[(effects["claim"] == claim.id) & (effects["group"] == "single")]
    return own[own["specification"] == "default"]


def _draw_curve(panel: Axes, part: pd.DataFrame, claim: Claim) -> None:
    _scale(panel, "y", claim.statistic, part["effect"])
    panel.axhline(claim.margin, color="0.25", lw=1, zorder=1)
    for outcome, colour in OUTCOMES.items():
        own = part[part["outcome"] == outcome]
        panel.vlines(own.index, own["low"], own["high"], color=colour, lw=0.9, alpha=0.4)
        for capped in (False, True):
            some = own[(own["capped"] > 0) == capped]
            face = "white" if capped else colour
            panel.plot(
                some.index, some["effect"], "o", ms=2.6, mew=0.7, mec=colour, mfc=face, zorder=4
            )
    panel.set_xlim(-1.5, len(part) + 0.5)
    axis = ", symmetric log axis" if panel.get_yscale() == "symlog" else ""
    panel.set_ylabel(f"{UNITS[claim.statistic, claim.measure]}\n(95 % interval{axis})")
    several = "MAP=" in part["specification"].iloc[0]
    title = f"{short_label(claim.id)}{', on all maps' if several else ''} ({claim.id})"
    panel.set_title(title, loc="left")
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
        f"holds in {_holding(part)}\n{_counted(part)}{_without_caps(part, claim)}",
        transform=panel.transAxes,
        ha=side[0],
        va=side[1],
        size=8,
        linespacing=1.4,
        path_effects=[patheffects.withStroke(linewidth=2.5, foreground="white")],
        zorder=6,
    )


# --- one choice at a time ------------------------------------------------------------------------


@settled
def single_figure(effects: pd.DataFrame, claims: Sequence[Claim]) -> Figure:
    """Draw the effects with one choice changed, a row for each value and a panel for each claim.

    Parameters
    ----------
    effects
        Of :func:`replication.evidence.sensitivity.effects_table`, of which the group "single" is drawn.
    claims
        Two to four claims that have the same specifications.
    """
    parts = [_single(effects, claim) for claim in claims]
    names = parts[0]["specification"].tolist()
    rows: list[tuple[str, str]] = [(*name.split("=", 1), "")[:2] for name in names]
    y = _blocks([id for id, _ in rows])
    figure, axes = canvas(1, len(claims), height=1.5 + 0.128 * (y[-1] + 1), sharey=True)
    for panel, claim, part in zip(axes, claims, parts, strict=True):
        part = part.set_index("specification").loc[names].assign(y=y)
        _scale(panel, "x", claim.statistic, part["effect"])
        panel.axvline(claim.margin, color="0.25", lw=1, zorder=1)
        panel.axvline(part.loc["default", "effect"], color="0.1", lw=1, ls=(0, (4, 2)), zorder=1)
        for row in part[part["outcome"] != UNDEFINED].itertuples():
            colour = OUTCOMES[row.outcome]
            face = "white" if row.capped else colour
            panel.hlines(row.y, row.low, row.high, color=colour, lw=1.3)
            panel.plot(row.effect, row.y, MARKS[row.outcome], ms=3.4, mec=colour, mfc=face)
        for row in part[part["outcome"] == UNDEFINED].itertuples():
            _beside(panel, UNDEFINED, 0, row.y, 2, color="0.35")
        width = 78 // len(claims)
        panel.set_title(textwrap.fill(short_label(claim.id), width) + f"\n{claim.id}", size=7.5)
        axis = ", symmetric log axis" if panel.get_xscale() == "symlog" else ""
        unit = UNITS[claim.statistic, claim.measure] + axis
        panel.set_xlabel(textwrap.fill(unit, width), size=7.5)
        panel.tick_params(axis="x", labelsize=SMALL)
        panel.tick_params(axis="y", left=False, labelleft=False)
        panel.spines["left"].set_visible(False)
        _label_blocks(panel, rows, y, labelled=panel is axes[0])
    capped = any((part["capped"] > 0).any() for part in parts)
    handles = _outcome_handles("", "margin", capped=capped)
    handles.append(_handle("default", "", "0.1", lw=1, ls=(0, (4, 2))))
    legend_below(figure, handles)
    return figure


def describe_single(effects: pd.DataFrame, claims: Sequence[Claim]) -> str:
    """Return in words how often one changed choice leaves each claim as it is."""
    parts = []
    for claim in claims:
        own = _single(effects, claim)
        default = own["specification"] == "default"
        (start,), others = own.loc[default, "outcome"], own[~default]
        parts.append(
            f"{claim.id} {start if start == HOLDS else 'is ' + start} by default; with one choice "
            f"changed it holds in {_holding(others)}, is {_counted(others)}; "
            f"{int(unchanged(own).sum())} of them have the numbers of the default"
        )
    return f"{'. '.join(parts)}."


def _single(effects: pd.DataFrame, claim: Claim) -> pd.DataFrame:
    own = effects[(effects["claim"] == claim.id) & (effects["group"] == "single")]
    return own.reset_index(drop=True)


# --- which choices matter ------------------------------------------------------------------------


@settled
def shares_figure(shares: pd.DataFrame, outcomes: pd.DataFrame) -> Figure:
    """Draw which choices account for the variance of each claim's effect, and what becomes of it.

    Parameters
    ----------
    shares, outcomes
        Of :func:`replication.evidence.sensitivity.variance_shares` and
        :func:`replication.evidence.sensitivity.outcome_shares`; of the latter the group "factorial".
    """
    outcomes = outcomes[outcomes["group"] == "factorial"].set_index("claim")
    others = [name for name in ("noise", "rest") if name in set(shares["choice"])]
    choices = [name for name in dict.fromkeys(shares["choice"]) if name not in others]
    grid = shares.pivot(index="claim", columns="choice", values="share").reindex(outcomes.index)
    figure, axes = canvas(
        1, 3, height=1.7 + 0.32 * len(grid), sharey=True, width_ratios=(len(choices), 2, 5)
    )
    _pad(figure, wspace=0.02, h_pad=0.08)
    for panel, columns, colours in zip(axes, (choices, others), ("Blues", "Greys"), strict=False):
        values = grid[columns].to_numpy(float)
        panel.imshow(values, cmap=colours, vmin=0, vmax=1, aspect="auto")
        for (row, column), value in np.ndenumerate(values):
            said = "–" if np.isnan(value) else _number(round(100 * value))
            said = "≥100" if columns[column] == "noise" and value >= 1 else said
            colour = "white" if value > 0.55 else "0.15" if abs(value) >= 0.005 else "0.65"
            panel.text(column, row, said, size=7, ha="center", va="center_baseline", color=colour)
        panel.set_xticks(range(len(columns)), columns, size=SMALL, rotation=90)
        panel.xaxis.tick_top()
        panel.set_xticks(np.arange(len(columns) - 1) + 0.5, minor=True)
        panel.set_yticks(np.arange(len(grid) - 1) + 0.5, minor=True)
        panel.grid(which="minor", color="white", lw=1.5)
        panel.tick_params(which="both", length=0)
        panel.spines[:].set_visible(False)
    labels = [f"{short_label(id)}\n{id}" for id in grid.index]
    axes[0].set_yticks(range(len(grid)), labels, size=SMALL)
    axes[0].set_xlabel("share of the effect's variance (%)", size=7.5)
    start = np.zeros(len(grid))
    defined = outcomes["specifications"] - outcomes[UNDEFINED]
    for outcome, colour in OUTCOMES.items():
        part = (outcomes[outcome] / defined).to_numpy(float)
        axes[2].barh(range(len(grid)), part, left=start, height=0.7, color=colour, ec="white")
        for row in np.flatnonzero(part >= 0.1):
            middle, said = start[row] + part[row] / 2, f"{100 * part[row]:.0f}"
            ink = "0.1" if outcome == OPEN else "white"
            axes[2].text(middle, row, said, size=7, ha="center", va="center_baseline", color=ink)
        start += part
    axes[2].set(xlim=(0, 1), xticks=[])
    axes[2].set_xlabel("share of specifications (%)", size=7.5)
    axes[2].spines[:].set_visible(False)
    axes[2].tick_params(which="both", length=0, labelleft=False)
    axes[1].tick_params(labelleft=False)
    legend_below(figure, [Patch(color=colour, label=name) for name, colour in OUTCOMES.items()])
    return figure


def describe_shares(shares: pd.DataFrame, outcomes: pd.DataFrame) -> str:
    """Return in words which choice has most of each claim's variance, and what holds."""
    own = shares[~shares["choice"].isin(["noise", "rest"])].dropna(subset="share")
    largest = own.loc[own.groupby("claim", sort=False)["share"].idxmax()]
    named = [f"{row.choice} for {row.claim} ({row.share:.0%})" for row in largest.itertuples()]
    factorial = outcomes[outcomes["group"] == "factorial"]
    holds = [f"{row.claim} in {row.share:.0%}" for row in factorial.itertuples()]
    return (
        f"The choice with the largest share of the variance is {', '.join(named)}. Of all "
        f"specifications, claims hold as follows: {', '.join(holds)}."
    )


# --- calibration, and the number of incorrect demonstrations ------------------------------------


@settled
def calibration_figure(table: pd.DataFrame, published: Published) -> Figure:
    """Draw the SD against the mean of each point of the calibration grid.

    Parameters
    ----------
    table
        Of :func:`replication.evidence.calibration.calibration_table`.
    published
        The pair that the defaults were chosen for.
    """
    figure, (panel,) = canvas(1, 1, height=4.3)
    shapes = sorted(set(table["DEMO-SHAPE"]), key=_order)
    colours = dict(
        zip(shapes, colormaps["viridis_r"](np.linspace(0.08, 1, len(shapes))), strict=True)
    )
    marks = dict(zip(sorted(set(table["TIES"]), key=str, reverse=True), "o^sD", strict=False))
    for row in table[["DEMO-SHAPE", "TIES", "mean", "sd"]].itertuples(index=False, name=None):
        shape, ties, mean, sd = row
        panel.plot(mean, sd, marks[ties], ms=5, mfc=colours[shape], mec="white", mew=0.5)
    panel.plot(
        published.mean, published.sd, "*", ms=15, mfc="white", mec="#D0021B", mew=1.4, zorder=5
    )
    panel.set(xlabel="mean of the iterations", ylabel="SD of the iterations")
    panel.margins(0.08)
    for _, row in table[table["default"]].iterrows():
        panel.plot(row["mean"], row["sd"], "o", ms=12, mfc="none", mec="0.1", mew=1.3, zorder=6)
        _label_in_free_corner(panel, table, row)
    handles = [_handle(f"DEMO-SHAPE {one}", "o", colours[one], lw=0) for one in shapes]
    handles += [_handle(f"TIES {ties}", mark, "0.4", lw=0) for ties, mark in marks.items()]
    star = f"published ({published.mean:.2f}, {published.sd:.2f})"
    handles.append(_handle(star, "*", "#D0021B", ms=11, mfc="white", lw=0))
    legend_below(figure, handles)
    return figure


def describe_calibration(table: pd.DataFrame, published: Published) -> str:
    """Return in words how near the default comes to the published pair, and how many nearer."""
    said = f"{len(table)} points, with means from {table['mean'].min():.1f} to "
    said += f"{table['mean'].max():.1f} and SDs from {table['sd'].min():.1f} to "
    said += f"{table['sd'].max():.1f}; published are {published.mean:.2f} and {published.sd:.2f}."
    for _, row in table[table["default"]].iterrows():
        nearer = int((table["divergence"] < row["divergence"]).sum())
        said += (
            f" The default ({_point(row)}) has {row['mean']:.2f} and {row['sd']:.2f}; "
            f"{nearer or 'none'} of the points {'is' if nearer < 2 else 'are'} nearer."
        )
    return said


def _point(row: pd.Series) -> str:
    return ", ".join(f"{id} {row[id]}" for id in CALIBRATED)


def _label_in_free_corner(panel: Axes, table: pd.DataFrame, row: pd.Series) -> None:
    """Label a point from the corner that has the fewest points around it."""
    x, y = ((table[c] - table[c].min()) / (table[c].max() - table[c].min()) for c in ("mean", "sd"))
    corners = [(0, 1), (1, 1), (0, 0), (1, 0)]
    across, up = min(
        corners, key=lambda at: int(((abs(x - at[0]) < 0.5) & (abs(y - at[1]) < 0.25)).sum())
    )
    first, second = _point(row).split(", ")[:2], _point(row).split(", ")[2:]
    panel.annotate(
        f"default: {', '.join(first)},\n{', '.join(second)}",
        (row["mean"], row["sd"]),
        (0.02 + 0.96 * across, 0.04 + 0.92 * up),
        textcoords="axes fraction",
        ha="right" if across else "left",
        va="top" if up else "bottom",
        size=7.5,
        arrowprops={"arrowstyle": "-", "color": "0.1", "lw": 0.8, "shrinkB": 6},
        zorder=7,
    )


@settled
def numbers_figure(table: pd.DataFrame, published: float) -> Figure:
    """Draw the iterations saved against the number of marked pairs.

    Parameters
    ----------
    table
        One row for each number of demonstrations and reading: `F`, `number`, `pairs`, and the mean
        number of iterations `saved`, with its interval `saved_low` to `saved_high`.
    published
        The published saving.
    """
    figure, (panel,) = canvas(1, 1, height=3.4)
    pairs = table.drop_duplicates("pairs").sort_values("pairs")
    linear = float(pairs["pairs"][pairs["pairs"] > 0].min())
    panel.set_xscale("symlog", linthresh=linear, linscale=0.3)
    panel.axhline(0, color="0.25", lw=1)
    panel.axhline(published, color="0.3", lw=1, ls=(0, (4, 2)))
    for f, own in table.groupby("F", sort=False):
        mark, colour = READINGS[f]
        own = own.sort_values("pairs")
        low, high = own["saved_low"], own["saved_high"]
        panel.fill_between(own["pairs"], low, high, color=colour, alpha=0.15, lw=0)
        panel.plot(own["pairs"], own["saved"], color=colour, marker=mark, ms=4.5)
    panel.set_xticks(pairs["pairs"], [f"{r.pairs}\n({r.number})" for r in pairs.itertuples()])
    panel.xaxis.set_minor_locator(NullLocator())
    panel.tick_params(axis="x", labelsize=7.5)
    panel.set(xlabel="marked pairs of state and action (incorrect demonstrations), log axis")
    panel.set(ylabel="iterations saved, same seeds")
    handles = _reading_handles(table)
    handles.append(Patch(color="0.4", alpha=0.25, lw=0, label="95 % interval of the mean"))
    handles.append(_handle("the paper's saving", "", "0.3", lw=1, ls=(0, (4, 2))))
    legend_below(figure, handles)
    return figure


def describe_numbers(table: pd.DataFrame) -> str:
    """Return in words what the most marked pairs save."""
    parts = []
    for f, own in table.groupby("F", sort=False):
        most = own.loc[own["pairs"].idxmax()]
        parts.append(
            f"{most['saved']:.1f} [{most['saved_low']:.1f}, {most['saved_high']:.1f}] iterations "
            f"under {F_LABELS[f]}"
        )
    pairs = table["pairs"].max()
    return f"With the most marked pairs, {pairs}, incorrect demonstrations save {', '.join(parts)}."


# --- what they share -----------------------------------------------------------------------------


def _order(value: Value) -> tuple[bool, float, str]:
    number = isinstance(value, (int, float))
    return (not number, float(value) if number else 0.0, str(value))


def _number(value: float) -> str:
    return f"{value:.3g}".replace("-", "\N{MINUS SIGN}")


def _holding(part: pd.DataFrame) -> str:
    holds = int((part["outcome"] == HOLDS).sum())
    return f"{holds} of {len(part)} specifications ({100 * holds / len(part):.0f} %)"


def _without_caps(part: pd.DataFrame, claim: Claim) -> str:
    """Say in how many specifications without a trial at the cap a claim holds, if others exist.

    Nothing is said of shares: without such a trial they are 1.
    """
    some = part[part["capped"] == 0]
    if claim.statistic == "share" or len(some) in (0, len(part)):
        return ""
    holds = int((some["outcome"] == HOLDS).sum())
    share = 100 * holds / len(some)
    return f"\nwithout trials at the cap: holds in {holds} of {len(some)} ({share:.0f} %)"


def _counted(part: pd.DataFrame) -> str:
    return ", ".join(f"{one} in {int((part['outcome'] == one).sum())}" for one in (OPEN, REVERSED))


def _pad(figure: Figure, **pads: float) -> None:
    engine: Any = figure.get_layout_engine()
    engine.set(**pads)


class _Ratios(Locator):
    """Ticks of a logarithmic axis that are apart by at least a share of its length."""

    def __init__(self, apart: float) -> None:
        self.apart = apart

    def __call__(self) -> list[float]:
        """Return the ticks in view."""
        assert self.axis is not None
        low, high = sorted(self.axis.get_view_interval())
        decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
        for steps in ([1, 1.5, 2, 3, 5, 7], [1, 2, 5], [1, 3], [1]):
            ticks = [tick for tick in np.outer(decades, steps).ravel() if low <= tick <= high]
            gaps = np.diff(np.log(ticks)) / np.log(high / low)
            if (gaps >= self.apart).all():
                break
        return ticks


def _scale(panel: Axes, axis: str, statistic: str, effects: pd.Series) -> None:
    """Give an axis few ticks, ratios a logarithmic one, and far outliers one that they fit on."""
    size = effects.abs().dropna()
    own: Any = getattr(panel, f"{axis}axis")
    if statistic == "sd-ratio":
        getattr(panel, f"set_{axis}scale")("log")
        own.set_major_locator(_Ratios(0.2 if axis == "x" else 0.06))
        own.set_major_formatter(lambda value, _: f"{value:g}")
        own.set_minor_formatter(NullFormatter())
        own.set_minor_locator(NullLocator())
    elif size.max() > FAR * size.quantile(0.75) > 0:
        linear = 10.0 ** np.ceil(np.log10(size.quantile(0.75)))
        getattr(panel, f"set_{axis}scale")("symlog", linthresh=linear)
        own.set_major_formatter(lambda value, _: f"{value:g}".replace("-", "\N{MINUS SIGN}"))
        own.set_minor_locator(NullLocator())
    else:
        own.set_major_locator(MaxNLocator(4 if axis == "x" else 6, steps=[1, 2, 2.5, 5, 10]))


def _finite(panel: Axes, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return columns as rows, on a linear scale."""
    log = panel.get_yscale() == "log"
    with np.errstate(divide="ignore"):
        scaled: NDArray[np.float64] = (np.log(values) if log else values).T
    return np.where(np.isfinite(scaled), scaled, np.nan)


def _limit(panel: Axes, values: NDArray[np.float64]) -> None:
    """Give the x axis room for all values, so that something can be drawn up to its ends."""
    log = panel.get_xscale() == "log"
    used = values[np.isfinite(values) & ((values > 0) | (not log))]
    used = np.log(used) if log else used
    room = 0.05 * (used.max() - used.min()) or 0.05
    ends = used.min() - room, used.max() + room
    panel.set_xlim(*(np.exp(ends) if log else ends))


def _blocks(ids: Sequence[Hashable]) -> NDArray[np.float64]:
    """Return where rows lie, with a gap wherever the id changes."""
    changes = [0.0, *(float(one != other) for one, other in zip(ids[1:], ids[:-1], strict=True))]
    return np.arange(len(ids)) + 0.45 * np.cumsum(changes)


def _beside(panel: Axes, text: str, x: float, y: float, points: float, **style: Any) -> None:
    """Write beside a row: so many points right of an end of the panel, x = 0 or 1."""
    panel.annotate(
        text,
        (x, y),
        (points, 0),
        xycoords=panel.get_yaxis_transform(),
        textcoords="offset points",
        va="center_baseline",
        size=SMALL,
        **style,
    )


def _label_blocks(
    panel: Axes, rows: Sequence[tuple[str, Value]], y: NDArray[np.float64], *, labelled: bool = True
) -> None:
    """Shade every other block of rows; name it and its values at the left, defaults in bold."""
    ids = [id for id, _ in rows]
    for number, id in enumerate(dict.fromkeys(ids)):
        own = y[[other == id for other in ids]]
        if number % 2 == 0:
            panel.axhspan(own[0] - 0.72, own[-1] + 0.72, color="0.96", lw=0, zorder=-1)
        if labelled:
            _beside(panel, id, 0, own[0], -158)
            for at, (_, value) in zip(own, (row for row in rows if row[0] == id), strict=True):
                bold = "bold" if id != "default" and value == default_of(id) else "normal"
                _beside(panel, str(value), 0, at, -4, ha="right", weight=bold)
    panel.set_ylim(y[-1] + 0.8, -0.8)


def _outcome_handles(mark: str, margin: str, *, capped: bool) -> list[Artist]:
    """Return what a legend says of outcomes; without a mark each outcome has its own."""
    handles = [_handle(one, mark or MARKS[one], colour) for one, colour in OUTCOMES.items()]
    if capped:
        handles.append(_handle("hollow: trials at the cap", mark or "o", "0.4", mfc="white", lw=0))
    return [*handles, _handle(margin, "", "0.25", lw=1)]


def _reading_handles(table: pd.DataFrame) -> list[Artist]:
    used = set(table["F"])
    return [_handle(F_LABELS[f], *READINGS[f]) for f in READINGS if f in used]


def _handle(label: str, mark: str, colour: Any, **style: Any) -> Artist:
    return Line2D([], [], label=label, marker=mark, color=colour, **{"ms": 4, **style})
