"""What the results mean: the numbers and sentences that interpret the published tables.

Notebooks show the sentences below their tables. :func:`findings_context` gives the numbers, already
formatted, to the template ``docs/findings.md.jinja``, which holds the prose around them.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from replication.evidence.calibration import CALIBRATED, PAIR, grid
from replication.evidence.claims import Claims, criteria_hash, load_claims, short_label
from replication.evidence.sensitivity import (
    HOLDS,
    NOISE,
    OPEN,
    REST,
    REVERSED,
    UNDEFINED,
    epsilon_squared,
    level_table,
    outcome_shares,
    unchanged,
)
from replication.evidence.specifications import DEFAULT, named_choices
from replication.evidence.statistics import mean_prediction
from replication.evidence.tables import read_table
from replication.evidence.verdicts import (
    NOT_TESTABLE,
    REPRODUCED,
    by_claim,
    judged_trials,
    overall,
    read_trials,
)
from replication.irl import METHODS, READINGS
from replication.report.readable import F_LABELS, markdown, readable_verdicts

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

OPPOSITE = ("opposite", "hit+detour+opposite", "all")
"""The values of INCORRECT-KINDS that include the opposite direction."""


# --- below the verdicts --------------------------------------------------------------------------


def caveats(claims: Claims, trials: pd.DataFrame) -> str:
    """Return what to know before quoting a verdict, as Markdown.

    Parameters
    ----------
    claims
        The frozen file.
    trials
        What was judged.
    """
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

    Parameters
    ----------
    table
        Of :func:`replication.evidence.calibration.calibration_table`.
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

    Parameters
    ----------
    check
        Of :func:`replication.evidence.calibration.check_table`: the grid's own trials, new ones,
        and new ones under the other reading of Eq. 9.
    """
    old, new, other = check.itertuples()
    mean = new.predicted_low <= new.mean <= new.predicted_high
    sd = new.sd_predicted_low <= new.sd <= new.sd_predicted_high
    inside = {
        (True, True): "both are inside the ranges that the published distribution predicts",
        (True, False): "the mean is inside the range that the published distribution predicts, "
        "the SD is not",
        (False, True): "the SD is inside the range that the published distribution predicts, "
        "the mean is not",
        (False, False): "neither is inside the range that the published distribution predicts",
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

    Parameters
    ----------
    effects
        Of :func:`replication.evidence.sensitivity.effects_table`: the factorial, and the
        specifications that change one choice, on the mazes and in soccer.
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
    shares, uncapped = epsilon_squared(effects), epsilon_squared(effects[effects["capped"] == 0])
    levels = level_table(effects)
    lines = []
    for row in outcome_shares(effects).itertuples():
        part = effects[effects["claim"] == row.claim]
        line = f"{_title(row.claim)}: {_outcomes(row)}{_caps(row, part)}"
        largest = _choices(shares, row.claim).nlargest(1, "share")
        for choice, share in largest[["choice", "share"]].itertuples(index=False, name=None):
            if share > MATTERS:
                name = NAMES.get(choice, choice)
                line += f" It depends most on {name}: {share:.0%} of the variance of the effect"
                without = _choices(uncapped, row.claim).set_index("choice")["share"]
                if row.with_caps and choice in without.index:
                    line += f", {without[choice]:.0%} without trials at the cap"
                if row.holds:
                    line += f". It holds with {_by_value(levels, part, row.claim, choice)}"
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


def _choices(shares: pd.DataFrame, claim: str) -> pd.DataFrame:
    """Return the known shares of the choices themselves."""
    rows = shares[(shares["claim"] == claim) & ~shares["choice"].isin([NOISE, REST])]
    return rows.dropna(subset="share")


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


# --- the page of findings ------------------------------------------------------------------------


def findings_context(figures: Path) -> dict[str, Any]:
    """Return the numbers of ``docs/findings.md.jinja``, formatted; it lists their names.

    Parameters
    ----------
    figures
        The folder that holds the published folders of the notebooks.
    """
    read = partial(_read, figures)
    judged, effects = read("claims/verdicts"), read("sensitivity/effects")
    factorial = effects[effects["group"] == "factorial"]
    trials = judged_trials(read_trials(figures), load_claims().judging)
    compared = judged[judged["direction"] != "inside"]
    holds = {id: holding(effects, id) for id in compared["id"].drop_duplicates()}
    table = readable_verdicts(compared).assign(**{"Holds with other choices": list(holds.values())})
    return {
        "judging": {"seed": load_claims().judging.root_seed},
        "holds": holds,
        "verdict": {id: overall(rows["verdict"].tolist()) for id, rows in by_claim(judged)},
        "tables": {"verdicts": markdown(table)},
        "published": _published(judged),
        "zero": {
            "mazes": _effects(judged, "ZERO-OPEN", 2)[READINGS[0]],
            "soccer": _effects(judged, "ZERO-SOCCER", 2)[READINGS[0]],
        },
        "faster": _faster(judged, factorial),
        "steadier": _steadier(judged, factorial),
        "baseline": _baseline(judged, read("sensitivity/ablations")),
        "saves": _saves(judged, factorial, read("open_maze/sets"), read("sensitivity/numbers")),
        "opposite": _opposite(read("open_maze/sets"), read("obstacle_maze/sets")),
        "soccer": _soccer(judged, trials),
        "motions": _motions(judged, trials),
        **_surfaces(judged, factorial, trials),
        **_calibration(read("calibration/check")),
        "trace": _trace(read("sensitivity/ablations")),
        "depends": at_once(factorial),
        "chance": chance(factorial),
    }


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
        chosen = effects["claim"].isin(same) & (effects["group"] == "factorial") & on_map
        rows = effects[chosen]
    rows = rows[rows["outcome"] != UNDEFINED]
    uncapped = rows[rows["capped"] == 0]
    if rows.empty:
        return "–"
    text = _of(rows["outcome"] == HOLDS)
    without = f"; uncapped {_of(uncapped['outcome'] == HOLDS)}"
    return text if len(uncapped) == len(rows) else f"{text}{without}"


def _read(figures: Path, name: str) -> pd.DataFrame:
    return read_table(figures / f"{name}.csv")


def _published(judged: pd.DataFrame) -> dict[str, int]:
    inside = judged[judged["direction"] == "inside"]
    verdicts = [overall(rows["verdict"].tolist()) for _, rows in by_claim(inside)]
    tested = [verdict for verdict in verdicts if verdict != NOT_TESTABLE]
    return {"tested": len(tested), "reproduced": tested.count(REPRODUCED)}


def _faster(judged: pd.DataFrame, factorial: pd.DataFrame) -> dict[str, Any]:
    effects = factorial[factorial["claim"] == "FASTER"]
    outcomes = next(outcome_shares(effects).itertuples())
    rules = _levels(effects, "ADABOOST-RULE")
    held = (rules["holds"] * rules["specifications"]).round().astype(int)
    return _saved(judged, "FASTER") | {
        "paper": f"{-load_claims().by_id('FASTER').paper_effect:.1f}",
        "holds": outcomes.holds,
        "specifications": outcomes.specifications,
        "holds_graded": held["graded"],
        "holds_uncapped": outcomes.holds_uncapped,
        "uncapped": outcomes.uncapped,
        "holds_r1": held["mismatch"],
        "r1": rules["specifications"]["mismatch"],
        "rule_share": _variance(effects, "ADABOOST-RULE"),
        "rule_share_uncapped": _variance(effects[effects["capped"] == 0], "ADABOOST-RULE"),
    }


def _steadier(judged: pd.DataFrame, factorial: pd.DataFrame) -> dict[str, str]:
    return _effects(judged, "STEADIER", 2) | {
        "paper": f"{load_claims().by_id('STEADIER').paper_effect:.2f}",
        "rule_share": _variance(factorial[factorial["claim"] == "STEADIER"], "ADABOOST-RULE"),
    }


def _baseline(judged: pd.DataFrame, ablations: pd.DataFrame) -> dict[str, Any]:
    r1 = next(judged[judged["id"] == "MEAN-ADABOOST-OPEN"].itertuples())
    rules = {row.choices.partition("=")[2]: row for row in _of_baseline(ablations).itertuples()}
    return {
        "mean": _bounds(r1.effect, r1.low, r1.high),
        "trials": r1.n,
        "paper": f"{r1.paper:.2f}",
        **{
            name.replace("-", "_"): _bounds(rules[name].mean, rules[name].low, rules[name].high)
            for name in ("confidence", "log-odds")
        },
        "vote_median": f"{rules['vote'].median:g}",
        "rule_trials": rules["vote"].n,
    }


def _saves(
    judged: pd.DataFrame, factorial: pd.DataFrame, sets: pd.DataFrame, numbers: pd.DataFrame
) -> dict[str, Any]:
    places = {"open": "SAVES-OPEN", "obstacles": "SAVES-OBSTACLES"}
    saves: dict[str, Any] = {
        place: _saved(judged, id) | {"paper": f"{-load_claims().by_id(id).paper_effect:.2f}"}
        for place, id in places.items()
    }
    saves["open"]["first_updated"] = _set_saves(sets, "hit+detour")["updated"]
    most = numbers[numbers["pairs"] == numbers["pairs"].max()]
    every_pair = {row.reading: (row.saved, row.saved_low, row.saved_high) for row in _rows(most)}
    kinds = _levels(factorial[factorial["claim"] == "SAVES-OPEN"], "INCORRECT-KINDS")["holds"]
    with_it, without = kinds[list(OPPOSITE)], kinds.drop(list(OPPOSITE))
    return saves | {
        "every_pair": {reading: _bounds(*bounds) for reading, bounds in every_pair.items()},
        "opposite_least": f"{with_it.min():.0%}",
        "opposite_most": f"{with_it.max():.0%}",
        "other_least": f"{without.min():.0%}",
        "other_most": f"{without.max():.0%}",
    }


def _opposite(open_maze: pd.DataFrame, obstacle_maze: pd.DataFrame) -> dict[str, Any]:
    name = "hit+detour+opposite"
    return {
        "open": _set_saves(open_maze, name),
        "obstacles": _set_saves(obstacle_maze, name),
        "trials": open_maze["n"].iloc[0],
    }


def _soccer(judged: pd.DataFrame, trials: pd.DataFrame) -> dict[str, Any]:
    rows = judged[judged["id"] == "SAVES-SOCCER"]
    runs: dict[str, Any] = {}
    for name, id in (("without", "RUN-UNIFIED-SOCCER"), ("with", "RUN-INCORRECT-SOCCER")):
        own = judged[judged["id"] == id]
        runs[name] = {row.reading: f"{row.low:.1f} to {row.high:.1f}" for row in _rows(own)}
        runs[name]["paper"] = f"{own['paper'].iloc[0]:g}"
    kicked = trials[(trials["task"] == "soccer") & (trials["method"] == "unified-incorrect")]
    paper_run = judged.loc[judged["id"] == "RUN-INCORRECT-SOCCER", "paper"].iloc[0]
    few = (kicked["iterations"] <= paper_run).groupby(kicked["reading"]).mean()
    return _saved(judged, "SAVES-SOCCER") | {
        "paper": f"{-rows['paper'].iloc[0]:g}",
        "largest": f"{-rows['low'].min():.1f}",
        **runs,
        "few": {reading: f"{few[reading]:.0%}" for reading in READINGS},
    }


def _motions(judged: pd.DataFrame, trials: pd.DataFrame) -> dict[str, Any]:
    places = {"open": "open-maze", "obstacles": "obstacle-maze", "soccer": "soccer"}
    same: dict[str, Any] = {}
    for place, task in places.items():
        rows = trials[trials["task"] == task]
        for reading in READINGS:
            errors = rows[rows["reading"] == reading].pivot(
                index="trial", columns="method", values="early_errors"
            )
            equal = int((errors["unified"] == errors["unified-incorrect"]).sum())
            same.setdefault(place, {})[reading] = equal
        same[place]["trials"] = len(errors)
    return same | {"difference": _effects(judged, "AVOIDS-OPEN")}


def _surfaces(
    judged: pd.DataFrame, factorial: pd.DataFrame, trials: pd.DataFrame
) -> dict[str, dict[str, Any]]:
    turned = next(outcome_shares(factorial[factorial["claim"] == "Q-TO-GOAL"]).itertuples())
    start = _levels(factorial[factorial["claim"] == "REWARD-TO-GOAL"], "F-START")["holds"]
    unified = trials[(trials["task"] == "open-maze") & (trials["method"] == "unified")]
    slopes = unified.loc[unified["reading"] == READINGS[0], "reward_slope"]
    return {
        "q": _effects(judged, "Q-TO-GOAL", 2)
        | {"reversed": turned.reversed, "specifications": turned.specifications},
        "reward": _effects(judged, "REWARD-TO-GOAL", 2)
        | {
            "sd": f"{slopes.std():.2f}",
            "start_least": start.index[0],
            "holds_least": f"{start.iloc[0]:.0%}",
            "start_most": start.index[-1],
            "holds_most": f"{start.iloc[-1]:.0%}",
        },
        "growth": _effects(judged, "Q-GROWS", 2),
    }


def _calibration(check: pd.DataFrame) -> dict[str, dict[str, Any]]:
    old, new, other = check.itertuples()
    return {
        "grid": {
            "trials": old.n,
            "mean": f"{old.mean:.2f}",
            "sd": f"{old.sd:.2f}",
            "points": len(grid()),
            "paper_mean": f"{PAIR.mean:.2f}",
            "paper_sd": f"{PAIR.sd:.2f}",
        },
        "new": {
            "trials": new.n,
            "mean": _bounds(new.mean, new.low, new.high, 2),
            "expected_mean": f"{new.predicted_low:.2f} to {new.predicted_high:.2f}",
            "sd": _bounds(new.sd, new.sd_low, new.sd_high, 2),
            "expected_sd": f"{new.sd_predicted_low:.2f} to {new.sd_predicted_high:.2f}",
            "updated_mean": _bounds(other.mean, other.low, other.high, 2),
            "updated_sd": f"{other.sd:.2f}",
        },
    }


def _trace(ablations: pd.DataFrame) -> dict[str, Any]:
    unified = ablations[ablations["method"] == "unified"]
    printed = unified[unified["reading"] == READINGS[0]].set_index("choices")
    ones = printed.loc["ALPHA=0.0 F-START=1.0"]
    r1 = _of_baseline(ablations).set_index("choices").loc["ADABOOST-RULE=mismatch"]
    bounds = ["more", "more_low", "more_high"]
    return {
        "more": _bounds(*ones[bounds]),
        "trials": ones["n"],
        "mean": f"{ones['mean']:.1f}",
        "default_mean": f"{printed.loc[DEFAULT, 'mean']:.1f}",
        "r1_more": _bounds(*r1[bounds]),
    }


# --- parts of tables, and numbers as text --------------------------------------------------------


def _rows(table: pd.DataFrame) -> list[Any]:
    return list(table.itertuples())


def _of_baseline(ablations: pd.DataFrame) -> pd.DataFrame:
    return ablations[ablations["choices"].str.startswith("ADABOOST-RULE=")]


def _levels(effects: pd.DataFrame, choice: str) -> pd.DataFrame:
    """Return what goes with each value of a choice, for the only claim."""
    levels = level_table(effects)
    return levels[levels["choice"] == choice].set_index("value")


def _variance(effects: pd.DataFrame, choice: str) -> str:
    """Return a choice's share of the variance of the only claim's effect."""
    shares = epsilon_squared(effects).set_index("choice")["share"]
    return f"{shares[choice]:.0%}"


def _effects(judged: pd.DataFrame, id: str, digits: int = 1) -> dict[str, str]:
    """Return a claim's effects by reading."""
    return {
        row.reading: _bounds(row.effect, row.low, row.high, digits)
        for row in _rows(judged[judged["id"] == id])
    }


def _saved(judged: pd.DataFrame, id: str) -> dict[str, str]:
    """Return by reading what the first method of a claim saves against the second."""
    return {
        row.reading: _bounds(-row.effect, -row.high, -row.low)
        for row in _rows(judged[judged["id"] == id])
    }


def _set_saves(sets: pd.DataFrame, name: str) -> dict[str, str]:
    """Return by reading what a set of incorrect demonstrations saves."""
    return {
        row.reading: _bounds(-row.difference, -row.high, -row.low)
        for row in _rows(sets[sets["set"] == name])
    }


def _bounds(value: float, low: float, high: float, digits: int = 1) -> str:
    """Return a number with its interval, without a minus before zero."""
    return f"{value:z.{digits}f} [{low:z.{digits}f}, {high:z.{digits}f}]"


def _of(which: pd.Series) -> str:
    return f"{int(which.sum())} of {len(which)}"
