"""What the results mean, in words: sentences that notebooks show below their tables.

One file because it is prose: each part is short, and none computes what a table does not have.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from replication.evidence.calibration import CALIBRATED, PAIR, grid
from replication.evidence.claims import Claims, criteria_hash, load_claims, short_label
from replication.evidence.sensitivity import (
    HOLDS,
    OPEN,
    REVERSED,
    UNDEFINED,
    level_table,
    outcome_shares,
    shares_table,
    unchanged,
)
from replication.evidence.specifications import DEFAULT, named_choices
from replication.evidence.statistics import mean_prediction
from replication.irl import METHODS
from replication.report.readable import F_LABELS

MATTERS = 0.05
"""Share of the variance from which on a choice is named in words."""

NAMES = {
    "MAP": "the map",
    "DEMO-SHAPE": "the shape of the correct demonstration",
    "INCORRECT-KINDS": "the kind of the incorrect demonstrations",
    "F-INDEX": "the reading of Eq. 9",
    "ALPHA": "α",
    "F-START": "F₀",
    "Q-START": "whether Q is kept or reset in each iteration",
    "TIES": "how ties are broken",
    "W-START": "the first weights",
    "ADABOOST-RULE": "the rule of AdaBoost-IRL",
}
"""The choices of the factorial, in words."""


# --- below the verdicts --------------------------------------------------------------------------


def caveats(claims: Claims, trials: pd.DataFrame) -> str:
    """Return what to know before quoting a verdict on these trials, as Markdown."""
    seeds = ", ".join(map(str, trials["seed"].unique()))
    lines = [f"- {claim.id}: {claim.note}" for claim in claims.claim if claim.note]
    lines += [
        "",
        f"The judging run has root seed {claims.judging.root_seed}; these trials have root seed "
        f"{seeds}. The hash of the criteria is `{criteria_hash()[:16]}`. Runs whose outcome was "
        "known when the criteria were frozen:",
        "",
    ]
    for run in claims.explored:
        plural = "s" if len(run.root_seeds) > 1 else ""
        lines.append(f"- Root seed{plural} {', '.join(map(str, run.root_seeds))}: {run.what}")
    return "\n".join(lines)


# --- below the calibration -----------------------------------------------------------------------


def calibrated(table: pd.DataFrame) -> str:
    """Return in words how well the published pair is met, and how little it decides.

    `table` is that of :func:`replication.evidence.calibration.calibration_table`.
    """
    best = table.iloc[0]
    n = int(best["n"])
    low, high = mean_prediction(PAIR.mean, PAIR.sd, PAIR.n, n)
    least, most = PAIR.sd * np.sqrt(stats.f.ppf([0.025, 0.975], n - 1, PAIR.n - 1))
    inside = table["mean"].between(low, high) & table["sd"].between(least, most)
    near = table[inside & (table["capped"] == 0)]
    values = "; ".join(
        f"{id}: {', '.join(map(str, sorted(near[id].unique())))}" for id in CALIBRATED
    )
    point = ", ".join(f"{id} = {best[id]}" for id in CALIBRATED)
    return (
        f"The nearest point is {'' if best['default'] else 'NOT '}our default: {point}, with a "
        f"mean of {best['mean']:.2f} (SD {best['sd']:.2f}) in {n} trials; the paper has "
        f"{PAIR.mean:.2f} ({PAIR.sd:.2f}). But {len(near)} of the {len(table)} points have a mean "
        f"and an SD within the 95 % ranges of {n} trials from the published distribution "
        f"({low:.1f} to {high:.1f}, and {least:.1f} to {most:.1f}). They have these values: "
        f"{values}. So the pair narrows the choices down but does not determine them."
    )


def rechecked(check: pd.DataFrame) -> str:
    """Return in words whether the chosen point stays as near in new trials.

    `check` is that of :func:`replication.evidence.calibration.check_table`: the grid's own trials,
    new ones, and new ones under the other reading of Eq. 9.
    """
    old, new, other = check.itertuples()
    mean = new.predicted_low <= new.mean <= new.predicted_high
    sd = new.sd_predicted_low <= new.sd <= new.sd_predicted_high
    predicted = "that the published distribution predicts"
    inside = {
        (True, True): f"both are inside the ranges {predicted}",
        (True, False): f"the mean is inside the range {predicted}, the SD is not",
        (False, True): f"the SD is inside the range {predicted}, the mean is not",
        (False, False): f"neither is inside the range {predicted}",
    }[mean, sd]
    return (
        f"In the {old.n} trials of the grid the chosen point has a mean of {old.mean:.2f} "
        f"(SD {old.sd:.2f}); in {new.n} new ones, {new.mean:.2f} ({new.sd:.2f}): {inside}. The "
        f"best of {len(grid())} noisy points, each known from {old.n} trials only, is partly "
        f"lucky, so its fit regresses in new trials (winner's curse). Only {F_LABELS[new.reading]} "
        f"was calibrated. {F_LABELS[other.reading]} inherits the point, and has {other.mean:.2f} "
        f"({other.sd:.2f})."
    )


# --- below the specifications --------------------------------------------------------------------


def dependence(effects: pd.DataFrame) -> str:
    """Return in words what the claims depend on, as Markdown lists.

    `effects` are those of :func:`replication.evidence.sensitivity.effects_table`, of all
    specifications.
    """
    factorial, single = (effects[effects["group"] == name] for name in ("factorial", "single"))
    soccer = single["claim"].map(lambda id: load_claims().by_id(id).task == "soccer").astype(bool)
    lists = {
        "All choices at once": at_once(factorial),
        "One choice at a time, mazes": one_at_a_time(single[~soccer]),
        "One choice at a time, soccer": one_at_a_time(single[soccer]),
    }
    parts = ["\n- ".join([f"{title}:\n", *lines]) for title, lines in lists.items()]
    return "\n\n".join([*parts, f"How far chance goes: {chance(factorial)}."])


def at_once(effects: pd.DataFrame) -> list[str]:
    """Return in words what each claim depends on when all choices vary, a sentence or two each."""
    levels, shares = level_table(effects), shares_table(effects)
    shares = shares[shares["choice"].isin(NAMES)]
    lines = []
    for row in outcome_shares(effects).itertuples():
        part = effects[effects["claim"] == row.claim]
        line = f"{_title(row.claim)}: {_outcomes(row)}{_caps(row, part)}"
        for most in shares[shares["claim"] == row.claim].nlargest(1, "share").itertuples():
            if most.share > MATTERS:
                line += f" It depends most on {NAMES[most.choice]}: {most.share:.0%} of the "
                line += "variance of the effect"
                if row.with_caps and not np.isnan(most.share_uncapped):
                    line += f", {most.share_uncapped:.0%} without trials at the cap"
                if row.holds:
                    line += f". It holds with {_by_value(levels, part, row.claim, most.choice)}"
                line += "."
        lines.append(line)
    return lines


def one_at_a_time(effects: pd.DataFrame) -> list[str]:
    """Return in words which single changes move each claim, two sentences each."""
    lines = []
    for claim, part in effects.groupby("claim", sort=False):
        outcome = part.set_index("specification")["outcome"]
        usual = outcome[DEFAULT]
        moved = [
            f"{name} under {', '.join(outcome.index[outcome == name])}"
            for name in (HOLDS, REVERSED, OPEN, UNDEFINED)
            if name != usual and (outcome == name).any()
        ]
        lines.append(
            f"{_title(str(claim))}: {usual} with the defaults; "
            f"{'; '.join(moved) or 'the same under every other value'}. "
            f"{int(unchanged(part).sum())} of the {len(part) - 1} changes leave its numbers as "
            "they are."
        )
    return lines


def chance(effects: pd.DataFrame) -> str:
    """Return in words how far the outcomes differ over a choice that cannot act."""
    levels = level_table(effects[effects["claim"] == "SAVES-OPEN"])
    holds = levels.loc[levels["choice"] == "ADABOOST-RULE", "holds"]
    return (
        f"{NAMES['ADABOOST-RULE']} cannot act on *{short_label('SAVES-OPEN')}*, and yet this holds "
        f"with its {len(holds)} values in {holds.min():.0%} to {holds.max():.0%} of the "
        "specifications"
    )


def _title(claim: str) -> str:
    label = short_label(claim)
    return f"**{label[0].upper()}{label[1:]}**"


def _outcomes(row: Any) -> str:
    """Say how many specifications have which outcome."""
    counted = row.specifications - row.undefined
    missing = f" that have an effect ({row.undefined} do not)" if row.undefined else ""
    return (
        f"holds in {row.holds} of {counted} specifications ({row.share:.0%}){missing}, is open in "
        f"{row.open} and reversed in {row.reversed}."
    )


def _caps(row: Any, part: pd.DataFrame) -> str:
    """Say in how many specifications trials end at the cap, whose they are, and what is left."""
    if not row.with_caps:
        return ""
    claim = load_claims().by_id(row.claim)
    whose = "" if part["capped_x"].any() else f", all of them of {_name(claim.y)}"
    text = f" In {row.with_caps} of them trials end at the iteration cap{whose}"
    if claim.statistic == "share":
        other = "; every trial of the other method reaches zero, in every specification"
        return f"{text}{other if whose else ''}."
    others = f"{row.uncapped} others{' that have an effect' if row.undefined else ''}"
    return f"{text}; it holds in {row.holds_uncapped} of the {others}."


def _name(method: str) -> str:
    return METHODS[method].label.partition(" (")[0]


def _by_value(levels: pd.DataFrame, part: pd.DataFrame, claim: str, choice: str) -> str:
    """Say in which share of the specifications a claim holds with each value of a choice."""
    rows = levels[(levels["claim"] == claim) & (levels["choice"] == choice)].dropna(subset="holds")
    values = part["specification"].map(lambda name: named_choices(name)[choice])
    texts = []
    for row in rows.sort_values("holds", ascending=False, kind="stable").itertuples():
        level = part[values == row.value]
        always = " (always at the cap)" if (level["capped"] >= level["n"]).all() else ""
        texts.append(f"{row.value} {row.holds:.0%}{always}")
    return ", ".join(texts)


def holding(effects: pd.DataFrame, id: str) -> str:
    """Say in how many specifications a claim holds on its own map; in soccer, of single changes."""
    claims = load_claims()
    claim = claims.by_id(id)
    if claim.task == "soccer":
        rows = effects[effects["claim"] == id]
    else:
        content = (claim.measure, claim.statistic, claim.x, claim.y)
        same = [c.id for c in claims.claim if (c.measure, c.statistic, c.x, c.y) == content]
        place = "open" if claim.task == "open-maze" else "obstacles"
        on_map = effects["specification"].map(lambda name: named_choices(name).get("MAP") == place)
        rows = effects[effects["claim"].isin(same) & (effects["group"] == "factorial") & on_map]
    rows = rows[rows["outcome"] != UNDEFINED]
    uncapped = rows[rows["capped"] == 0]
    if rows.empty:
        return "–"
    without = f"; uncapped {_of(uncapped)}" if len(uncapped) < len(rows) else ""
    return f"{_of(rows)}{without}"


def _of(effects: pd.DataFrame) -> str:
    return f"{(effects['outcome'] == HOLDS).sum()} of {len(effects)}"
