"""Pictures of what the claims depend on: choices, one at a time and all at once, and numbers."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from replication.evidence.claims import short_label
from replication.evidence.sensitivity import (
    HOLDS,
    NOISE,
    OPEN,
    REST,
    REVERSED,
    UNDEFINED,
    unchanged,
)
from replication.evidence.specifications import DEFAULT, default_of, named_choices, sort_key
from replication.report.axes import (
    MARKS,
    OUTCOMES,
    READING_MARKS,
    SMALL,
    beside,
    blocks,
    handle,
    label_blocks,
    number,
    outcome_handles,
    pad,
    reading_handles,
    scale,
    unit,
)
from replication.report.picture import Picture
from replication.report.readable import F_LABELS
from replication.report.style import canvas, legend_below, settled

# --- all choices at once -------------------------------------------------------------------------


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
        f"{claim} holds in {_holding(drawn)}; it is {_counted(drawn)}"
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
        f"holds in {_holding(part)}\n{_counted(part)}{_without_caps(part)}",
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


# --- one choice at a time ------------------------------------------------------------------------


def single(effects: pd.DataFrame, claims: Sequence[str]) -> Picture:
    """Show the effects with one choice changed, a row for each value and a panel for each claim.

    Parameters
    ----------
    effects
        Of :func:`replication.evidence.sensitivity.effects_table`; the group "single" is drawn.
    claims
        The ids of two to four claims that have the same specifications.
    """
    rows = effects[effects["group"] == "single"]
    parts = [rows[rows["claim"] == claim] for claim in claims]
    texts = []
    for claim, part in zip(claims, parts, strict=True):
        default = part["specification"] == DEFAULT
        usual, others = part.loc[default, "outcome"].item(), part[~default]
        texts.append(
            f"{claim} {usual if usual == HOLDS else 'is ' + usual} by default; with one choice "
            f"changed it holds in {_holding(others)}, is {_counted(others)}; "
            f"{int(unchanged(part).sum())} of them have the numbers of the default"
        )
    return Picture(pd.concat(parts, ignore_index=True), draw_single, f"{'. '.join(texts)}.")


@settled
def draw_single(numbers: pd.DataFrame) -> Figure:
    """Draw the effects with one choice changed."""
    parts = [part for _, part in numbers.groupby("claim", sort=False)]
    names = parts[0]["specification"].tolist()
    rows = [(name.partition("=")[0], name.partition("=")[2]) for name in names]
    y = blocks([id for id, _ in rows])
    figure, axes = canvas(1, len(parts), height=1.5 + 0.128 * (y[-1] + 1), sharey=True)
    for panel, part in zip(axes, parts, strict=True):
        first = part.iloc[0]
        part = part.set_index("specification").loc[names].assign(y=y)
        scale(panel, "x", first["statistic"], part["effect"])
        panel.axvline(first["margin"], color="0.25", lw=1, zorder=1)
        panel.axvline(part.loc[DEFAULT, "effect"], color="0.1", lw=1, ls=(0, (4, 2)), zorder=1)
        for row in part[part["outcome"] != UNDEFINED].itertuples():
            colour = OUTCOMES[row.outcome]
            face = "white" if row.capped else colour
            panel.hlines(row.y, row.low, row.high, color=colour, lw=1.3)
            panel.plot(row.effect, row.y, MARKS[row.outcome], ms=3.4, mec=colour, mfc=face)
        for row in part[part["outcome"] == UNDEFINED].itertuples():
            beside(panel, UNDEFINED, 0, row.y, 2, color="0.35")
        width = 78 // len(parts)
        title = textwrap.fill(short_label(first["claim"]), width)
        panel.set_title(f"{title}\n{first['claim']}", size=7.5)
        label = "".join(unit(panel, "x", first["statistic"], first["measure"]))
        panel.set_xlabel(textwrap.fill(label, width), size=7.5)
        panel.tick_params(axis="x", labelsize=SMALL)
        panel.tick_params(axis="y", left=False, labelleft=False)
        panel.spines["left"].set_visible(False)
        label_blocks(panel, rows, y, defaults={}, labelled=panel is axes[0])
    capped = bool((numbers["capped"] > 0).any())
    handles = outcome_handles("", "margin", capped=capped)
    handles.append(handle("default", "", "0.1", lw=1, ls=(0, (4, 2))))
    legend_below(figure, handles)
    return figure


# --- which choices matter ------------------------------------------------------------------------


def shares(table: pd.DataFrame) -> Picture:
    """Show what the variance of each claim's effect is due to, and how often each claim holds.

    Parameters
    ----------
    table
        Of :func:`replication.evidence.sensitivity.shares_table`.
    """
    choices = table[~table["choice"].isin([NOISE, REST, *OUTCOMES])].dropna(subset="share")
    largest = choices.loc[choices.groupby("claim", sort=False)["share"].idxmax()]
    named = [f"{row.choice} for {row.claim} ({row.share:.0%})" for row in largest.itertuples()]
    held = table[table["choice"] == HOLDS]
    holds = [f"{row.claim} in {row.share:.0%}" for row in held.itertuples()]
    words = (
        f"The choice with the largest share of the variance is {', '.join(named)}. Of all "
        f"specifications, claims hold as follows: {', '.join(holds)}."
    )
    return Picture(table, draw_shares, words)


@settled
def draw_shares(numbers: pd.DataFrame) -> Figure:
    """Draw the shares of the variance as a heat map, beside bars of the outcomes."""
    known = list(dict.fromkeys(numbers["choice"]))
    others = [name for name in (NOISE, REST) if name in known]
    choices = [name for name in known if name not in (*others, *OUTCOMES)]
    claims = list(dict.fromkeys(numbers.loc[numbers["choice"].isin(OUTCOMES), "claim"]))
    grid = numbers.pivot(index="claim", columns="choice", values="share").reindex(claims)
    figure, axes = canvas(
        1, 3, height=1.7 + 0.32 * len(grid), sharey=True, width_ratios=(len(choices), 2, 5)
    )
    pad(figure, wspace=0.02, h_pad=0.08)
    for panel, columns, colours in zip(axes, (choices, others), ("Blues", "Greys"), strict=False):
        values = grid[columns].to_numpy(float)
        panel.imshow(values, cmap=colours, vmin=0, vmax=1, aspect="auto")
        for (row, column), value in np.ndenumerate(values):
            text = "–" if np.isnan(value) else number(round(100 * value))
            text = "≥100" if columns[column] == NOISE and value >= 1 else text
            colour = "white" if value > 0.55 else "0.15" if abs(value) >= 0.005 else "0.65"
            panel.text(column, row, text, size=7, ha="center", va="center_baseline", color=colour)
        panel.set_xticks(range(len(columns)), columns, size=SMALL, rotation=90)
        panel.xaxis.tick_top()
        panel.set_xticks(np.arange(len(columns) - 1) + 0.5, minor=True)
        panel.set_yticks(np.arange(len(grid) - 1) + 0.5, minor=True)
        panel.grid(which="minor", color="white", lw=1.5)
        panel.tick_params(which="both", length=0)
        panel.spines[:].set_visible(False)
    labels = [f"{short_label(id)}\n{id}" for id in claims]
    axes[0].set_yticks(range(len(grid)), labels, size=SMALL)
    axes[0].set_xlabel("share of the effect's variance (%)", size=7.5)
    start = np.zeros(len(grid))
    for outcome, colour in OUTCOMES.items():
        part = grid[outcome].to_numpy(float)
        axes[2].barh(range(len(grid)), part, left=start, height=0.7, color=colour, ec="white")
        for row in np.flatnonzero(part >= 0.1):
            middle, text = start[row] + part[row] / 2, f"{100 * part[row]:.0f}"
            ink = "0.1" if outcome == OPEN else "white"
            axes[2].text(middle, row, text, size=7, ha="center", va="center_baseline", color=ink)
        start += part
    axes[2].set(xlim=(0, 1), xticks=[])
    axes[2].set_xlabel("share of specifications (%)", size=7.5)
    axes[2].spines[:].set_visible(False)
    axes[2].tick_params(which="both", length=0, labelleft=False)
    axes[1].tick_params(labelleft=False)
    legend_below(figure, [Patch(color=colour, label=name) for name, colour in OUTCOMES.items()])
    return figure


# --- the number of incorrect demonstrations ------------------------------------------------------


def numbers(table: pd.DataFrame) -> Picture:
    """Show the iterations saved against the number of marked pairs.

    Parameters
    ----------
    table
        Of :func:`replication.evidence.sensitivity.numbers_table`.
    """
    parts = []
    for reading, rows in table.groupby("reading", sort=False):
        most = rows.loc[rows["pairs"].idxmax()]
        parts.append(
            f"{most['saved']:.1f} [{most['saved_low']:.1f}, {most['saved_high']:.1f}] iterations "
            f"under {F_LABELS[str(reading)]}"
        )
    pairs = table["pairs"].max()
    words = f"With the most marked pairs, {pairs}, incorrect demonstrations save"
    return Picture(table, draw_numbers, f"{words} {', '.join(parts)}.")


@settled
def draw_numbers(numbers: pd.DataFrame) -> Figure:
    """Draw the saving of each number of demonstrations, and the published one."""
    figure, (panel,) = canvas(1, 1, height=3.4)
    pairs = numbers.drop_duplicates("pairs").sort_values("pairs")
    linear = float(pairs["pairs"][pairs["pairs"] > 0].min())
    panel.set_xscale("symlog", linthresh=linear, linscale=0.3)
    panel.axhline(0, color="0.25", lw=1)
    panel.axhline(numbers["paper"].iloc[0], color="0.3", lw=1, ls=(0, (4, 2)))
    for reading, rows in numbers.groupby("reading", sort=False):
        mark, colour = READING_MARKS[str(reading)]
        rows = rows.sort_values("pairs")
        low, high = rows["saved_low"], rows["saved_high"]
        panel.fill_between(rows["pairs"], low, high, color=colour, alpha=0.15, lw=0)
        panel.plot(rows["pairs"], rows["saved"], color=colour, marker=mark, ms=4.5)
    ticks = [f"{row.pairs}\n({row.number})" for row in pairs.itertuples()]
    panel.set_xticks(pairs["pairs"], ticks)
    panel.xaxis.set_minor_locator(NullLocator())
    panel.tick_params(axis="x", labelsize=7.5)
    panel.set(xlabel="marked pairs of state and action (incorrect demonstrations), log axis")
    panel.set(ylabel="iterations saved, same seeds")
    handles = reading_handles(numbers)
    handles.append(Patch(color="0.4", alpha=0.25, lw=0, label="95 % interval of the mean"))
    handles.append(handle("the paper's saving", "", "0.3", lw=1, ls=(0, (4, 2))))
    legend_below(figure, handles)
    return figure


# --- counts in words -----------------------------------------------------------------------------


def _holding(part: pd.DataFrame) -> str:
    holds = int((part["outcome"] == HOLDS).sum())
    return f"{holds} of {len(part)} specifications ({100 * holds / len(part):.0f} %)"


def _counted(part: pd.DataFrame) -> str:
    return ", ".join(
        f"{name} in {int((part['outcome'] == name).sum())}" for name in (OPEN, REVERSED)
    )


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
