"""What the results mean, in words: sentences that notebooks show below their tables.

One file because it is prose: each part is short, and none computes what a table does not have.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from replication.evidence.calibration import TRACE, WORLD, nearest, rule_follows
from replication.evidence.claims import Claims, criteria_hash, load_claims, short_label
from replication.evidence.rounding import LEVEL, chosen_tolerance
from replication.evidence.sensitivity import (
    HOLDS,
    NOISE,
    OPEN,
    REVERSED,
    UNDEFINED,
    level_table,
    outcome_shares,
    shares_table,
    unchanged,
)
from replication.evidence.specifications import DEFAULT, named_choices
from replication.evidence.verdicts import INCONCLUSIVE, NOT_TESTABLE, SHOWN
from replication.irl import METHODS
from replication.paper.register import load_choices
from replication.report.choices import NAMES, value
from replication.report.readable import F_LABELS, full_label

MATTERS, MOSTLY = 0.05, 0.5
"""The shares of the variance from which on a choice is named in words, and chance instead of it."""


# --- below the verdicts --------------------------------------------------------------------------


def caveats(claims: Claims, trials: pd.DataFrame) -> str:
    """Return what to know before quoting a verdict on these trials, as Markdown."""
    seeds = ", ".join(map(str, trials["seed"].unique()))
    lines = [f"- {claim.id}: {claim.note}" for claim in claims.claim if claim.note]
    lines += [
        "",
        f"The judging run has root seed {claims.judging.root_seed}; these trials have root seed "
        f"{seeds}. The hash of the criteria is `{criteria_hash()[:16]}`. What was known when they "
        "were frozen:",
        "",
    ]
    for known in claims.known:
        seeds = ", ".join(map(str, known.root_seeds))
        plural = "s" if len(known.root_seeds) > 1 else ""
        lines.append(f"- {known.what}{f' (root seed{plural} {seeds})' if seeds else ''}")
    return "\n".join(lines)


# --- below the experiment on rounding ------------------------------------------------------------


def rounded(table: pd.DataFrame) -> str:
    """Return in words which tolerance the rule takes, and what hangs on rounding without one.

    `table` is that of :func:`replication.evidence.rounding.rounding_table`.
    """
    taken, default = chosen_tolerance(table), load_choices()["TIE-TOLERANCE"].default
    others = table[table["arithmetic"] != "double"]
    none = others[others["tolerance"] == 0]
    most = none.loc[none["difference"].abs().idxmax()]
    fused = others[(others["arithmetic"] == "fused") & (others["tolerance"] > 0)]["equal"].min()
    same = "all" if fused == 1 else f"at least {fused:.0%} of the"
    failing = [f"{t:g}" for t, rows in others.groupby("tolerance") if rows["p_holm"].min() < LEVEL]
    if taken is None:
        rule = "At none of them is there no difference"
    else:
        own = "which is our default" if taken == default else f"NOT our default of {default:g}"
        rule = f"The least tolerance at which none is shown is {taken:g}, {own}"
    single = others[(others["arithmetic"] == "single") & (others["tolerance"] > 0)]
    alike = [f"{rows['equal'].min():.0%} at {t:g}" for t, rows in single.groupby("tolerance")]
    return (
        f"Without a tolerance the mean changes by up to {abs(most.difference):.1f} iterations "
        f"({full_label(most.method, most.reading)}, {most.arithmetic}, {most.task}). With any of "
        f"the tolerances {same} trials of a setting have the same number of "
        f"iterations in double and fused arithmetic. A difference is shown at a tolerance of "
        f"{', '.join(failing) or 'none'}. {rule}. In single precision, in which values differ by "
        f"more than a small tolerance, at least so many trials have the same number: "
        f"{', '.join(alike)}."
    )


# --- below the calibration -----------------------------------------------------------------------


def calibrated(screen: pd.DataFrame, final: pd.DataFrame) -> str:
    """Return in words how well the published pair is met, and what was taken.

    Both tables are those of :func:`replication.evidence.calibration.calibration_table`.
    """
    best = final.iloc[0]
    fits = int(final["fits"].sum())
    texts = []
    for trace, point in nearest(final).items():
        pairs = zip((*WORLD, *TRACE), point, strict=False)
        values = ", ".join(f"{id} = {value}" for id, value in pairs)
        texts.append(f"under {F_LABELS[trace]}: {values}")
    values = "; ".join(texts)
    follows = "These are" if rule_follows(final) else "These are NOT"
    return (
        f"Of {len(screen)} points {len(final)} went on to the second stage, and **{fits or 'none'} "
        f"of them** {'fits' if fits < 2 else 'fit'} the pair. The nearest has a mean of "
        f"{best['mean']:.2f} (SD {best['sd']:.2f}) in {best['n']} trials; the paper has "
        f"{best['paper_mean']:.2f} ({best['paper_sd']:.2f}). The rule takes {values}. {follows} "
        "our defaults."
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
    noise = shares[shares["choice"] == NOISE].set_index("claim")["share"]
    shares = shares[shares["choice"].isin(NAMES)]
    lines = []
    for row in outcome_shares(effects).itertuples():
        part = effects[effects["claim"] == row.claim]
        line = f"{_title(row.claim)}: {_outcomes(row)}{_caps(row, part)}"
        for most in shares[shares["claim"] == row.claim].nlargest(1, "share").itertuples():
            if noise[row.claim] > MOSTLY:
                line += f" No choice stands out: {noise[row.claim]:.0%} of the variance is chance."
            elif most.share > MATTERS:
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
        texts.append(f"{value(choice, row.value)}: {row.holds:.0%}{always}")
    return "; ".join(texts)


STEADY = 0.9
"""Share of the specifications that must not speak against a finding."""

ROBUST, UNOPPOSED, FRAGILE, NOT_TESTED = "robust", "not contradicted", "fragile", "not tested"


def robustness(judged: pd.DataFrame, holds: int, count: int) -> str:
    """Say in a word or two whether a finding is the same in other cells and with other choices.

    A claim that is shown in all cells is robust if it holds in nine of ten specifications. One that
    is absent or reversed in all of them is not contradicted if it does not hold in nine of ten: the
    few trials of a specification cannot confirm an absence.
    """
    verdict = judged["verdict"].iloc[0]
    if judged["verdict"].nunique() > 1 or verdict in (INCONCLUSIVE, NOT_TESTABLE):
        return FRAGILE
    if verdict == SHOWN:
        return ROBUST if holds >= STEADY * count else FRAGILE
    return UNOPPOSED if count - holds >= STEADY * count else FRAGILE


def held(effects: pd.DataFrame, id: str) -> tuple[int, int]:
    """Return in how many specifications a claim holds on its own map, and how many there are."""
    return counted(_specifications(effects, id), id)


def counted(rows: pd.DataFrame, id: str) -> tuple[int, int]:
    """Return in how many of some specifications a claim holds, and how many there are.

    The error of the unified method falls to zero where none of its trials ends at the cap, whatever
    the other method does.
    """
    zero = load_claims().by_id(id).statistic == "share"
    holds = rows["capped_x"] == 0 if zero else rows["outcome"] == HOLDS
    return int(holds.sum()), len(rows)


def holding(effects: pd.DataFrame, id: str) -> str:
    """Say in how many specifications a claim holds on its own map; in soccer, of single changes."""
    claim, rows = load_claims().by_id(id), _specifications(effects, id)
    if rows.empty:
        return "–"
    if claim.task == "soccer" or not METHODS[claim.x].uses_incorrect:
        return _counts(rows)
    opposite = rows["specification"].map(lambda name: shows_opposite(named_choices(name)))
    with_it, without = _counts(rows[opposite]), _counts(rows[~opposite])
    return f"with moves in the opposite direction {with_it}; without {without}"


def _specifications(effects: pd.DataFrame, id: str) -> pd.DataFrame:
    """Return the specifications on a claim's own map in which it has an effect."""
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
    return rows[rows["outcome"] != UNDEFINED]


def shows_opposite(choices: Mapping[str, str]) -> bool:
    """Return whether a specification's incorrect demonstrations include the opposite direction."""
    kinds = choices["INCORRECT-KINDS"].split("+")
    return "opposite" in kinds or "all" in kinds


def _counts(rows: pd.DataFrame) -> str:
    uncapped = rows[rows["capped"] == 0]
    without = f" (uncapped {_of(uncapped)})" if len(uncapped) < len(rows) else ""
    return f"{_of(rows)}{without}"


def _of(effects: pd.DataFrame) -> str:
    return f"{(effects['outcome'] == HOLDS).sum()} of {len(effects)}"
