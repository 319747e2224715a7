"""What the claims depend on: their effects under every declared specification.

Effects and intervals are those of the claims; only the number of bootstrap samples is smaller. A
trial at the iteration cap counts as that many iterations here, and how many there are is said.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.evidence.claims import Claim, load_claims, short_label
from replication.evidence.experiments import Key
from replication.evidence.specifications import Specification, default_of
from replication.evidence.statistics import (
    mean_intervals,
    sd_ratio_intervals,
    share_interval,
    standard_errors,
)
from replication.evidence.tables import pairs_near
from replication.irl import METHODS
from replication.paper.register import Value
from replication.trials.condition import Condition
from replication.trials.measures import measure_trials
from replication.trials.results import Results

HOLDS, OPEN, REVERSED = "holds", "open", "reversed"
"""Whether an interval lies beyond the margin on the claimed side, includes it, or on the other."""

UNDEFINED = "undefined"
"""There is no effect: a ratio of SDs needs samples that vary."""

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

Conditions = Mapping[Specification, Mapping[Key, Condition]]


def effects_table(
    results: Results, conditions: Conditions, claims: Sequence[Claim]
) -> pd.DataFrame:
    """Return one row for each claim and specification: the effect, its interval, and what it says.

    A share (errors that reach zero) holds where it is above the margin itself: so few trials give
    no interval that could be. `capped` counts the trials at the iteration cap of all methods of the
    claim, `capped_x` those of its first.

    Parameters
    ----------
    results
        The trials of all conditions.
    conditions
        The conditions of each specification, by method and F index, one reading of Eq. 9 each.
    claims
        What to evaluate; a specification without a claim's methods gives no row.
    """
    measured = {
        specification: measure_trials(results, own.values()).groupby("method")
        for specification, own in conditions.items()
    }
    parts = []
    for claim in claims:
        wanted = {claim.x, *filter(None, [claim.y])}
        having = [one for one, groups in measured.items() if wanted <= set(groups.groups)]
        if not having:
            continue
        x = np.array([measured[one].get_group(claim.x)[claim.measure] for one in having], float)
        y = x
        if claim.y:
            y = np.array([measured[one].get_group(claim.y)[claim.measure] for one in having], float)
        capped = {
            name: [int((measured[one].get_group(name)["converged"] == 0).sum()) for one in having]
            for name in wanted
        }
        effect, low, high = _effects(claim, x, y)
        parts.append(
            pd.DataFrame(
                {
                    "claim": claim.id,
                    "statistic": claim.statistic,
                    "group": [one.group for one in having],
                    "specification": [one.name for one in having],
                    "n": x.shape[1],
                    "capped": np.sum(list(capped.values()), axis=0),
                    "capped_x": capped[claim.x],
                    "effect": effect,
                    "low": low,
                    "high": high,
                    "outcome": [
                        _outcome(claim, *row) for row in zip(effect, low, high, strict=True)
                    ],
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def outcome_shares(effects: pd.DataFrame) -> pd.DataFrame:
    """Return for each claim and group in how many specifications it holds, is open, is reversed.

    `share` is that of the specifications in which it holds, among those with an effect. In
    `with_caps` of them a trial ended at the iteration cap; of the `uncapped` others that have an
    effect, the claim holds in `holds_uncapped`. `unchanged` counts those with the numbers of the
    default, whose choice cannot act on the claim or did not.
    """
    rows = []
    for (claim, group), part in effects.groupby(["claim", "group"], sort=False):
        counts = part["outcome"].value_counts()
        uncapped = part[(part["capped"] == 0) & (part["outcome"] != UNDEFINED)]
        rows.append(
            {
                "claim": claim,
                "group": group,
                "specifications": len(part),
                **{name: int(counts.get(name, 0)) for name in (HOLDS, OPEN, REVERSED, UNDEFINED)},
                "share": _share(part["outcome"], HOLDS),
                "with_caps": int((part["capped"] > 0).sum()),
                "uncapped": len(uncapped),
                "holds_uncapped": int((uncapped["outcome"] == HOLDS).sum()),
                "unchanged": int(unchanged(part).sum()),
                "median": float(part["effect"].median()),
                "lowest": float(part["effect"].min()),
                "highest": float(part["effect"].max()),
            }
        )
    return pd.DataFrame(rows)


def unchanged(effects: pd.DataFrame) -> pd.Series:
    """Return which rows of one claim have the default's effect and interval, itself left out."""
    numbers = effects[["effect", "low", "high"]]
    default = effects["specification"] == "default"
    same = pd.Series(False, index=effects.index)
    for _, row in numbers[default].iterrows():
        same = (numbers == row).all(axis=1) & ~default
    return same


def variance_shares(effects: pd.DataFrame, specifications: Sequence[Specification]) -> pd.DataFrame:
    """Return which share of an effect's variance over the factorial each choice accounts for.

    Ratios of SDs enter by their logarithm; specifications without an effect are left out. Each
    claim's effects are regressed on all choices at once, every value with its own coefficient. A
    choice's share is what the sum of squares loses without it, less what as many columns of noise
    would explain, over the total: it is about 0 for a choice that does not matter, and may be
    slightly negative. `noise` is the share of the sampling error, estimated from the intervals;
    `rest` is what remains: choices that act together, and choices that are correlated by chance.
    Fewer specifications than values give NaN.
    """
    chosen = {one.name: dict(one.choices) for one in specifications}
    rows = []
    for claim, part in effects.groupby("claim", sort=False):
        own = part[part["specification"].isin(chosen)].dropna(subset="effect")
        bounds = own[["effect", "low", "high"]].to_numpy(float).T
        if (own["statistic"] == "sd-ratio").any():
            with np.errstate(divide="ignore"):  # an interval that reaches down to 0
                bounds = np.log(bounds)
        y, low, high = bounds
        total = float(((y - y.mean()) ** 2).sum()) if len(y) else 0.0
        if total == 0:
            continue
        design = {
            id: pd.get_dummies(
                pd.Series([str(chosen[name][id]) for name in own["specification"]]),
                drop_first=True,
            ).to_numpy(float)
            for id, _ in specifications[0].choices
        }
        full, free = _residual(list(design.values()), y)
        unexplained = full / free if free > 0 else np.nan  # fewer specifications than values
        shares = {}
        for id in design:
            without, _ = _residual([block for name, block in design.items() if name != id], y)
            width = design[id].shape[1]
            shares[id] = (without - full - width * unexplained) / total
        known = np.isfinite(low) & np.isfinite(high)
        error = float((standard_errors(low[known], high[known]) ** 2).mean()) if known.any() else 0
        noise = min(error * len(y) / total, 1.0)
        rest = 1.0 - sum(shares.values()) - noise
        rows += [
            {"claim": claim, "choice": id, "share": share}
            for id, share in {**shares, "noise": noise, "rest": rest}.items()
        ]
    return pd.DataFrame(rows, columns=["claim", "choice", "share"]).astype({"share": float})


def level_table(effects: pd.DataFrame, specifications: Sequence[Specification]) -> pd.DataFrame:
    """Return for each claim, choice and value of the factorial the mean effect and what holds."""
    rows = []
    for claim, part in effects.groupby("claim", sort=False):
        own = part.set_index("specification").loc[[one.name for one in specifications]]
        for id, _ in specifications[0].choices:
            values = [dict(one.choices)[id] for one in specifications]
            for value in dict.fromkeys(sorted(values, key=_order)):
                chosen = own[[other == value for other in values]]
                rows.append(
                    {
                        "claim": claim,
                        "choice": id,
                        "value": value,
                        "default": value == default_of(id),
                        "specifications": len(chosen),
                        "mean_effect": float(chosen["effect"].mean()),
                        "holds": _share(chosen["outcome"], HOLDS),
                        "reversed": _share(chosen["outcome"], REVERSED),
                    }
                )
    return pd.DataFrame(rows)


def findings(
    effects: pd.DataFrame,
    specifications: Sequence[Specification],
    single: pd.DataFrame,
    soccer: pd.DataFrame,
) -> str:
    """Return in words what the claims depend on, as a Markdown list.

    Parameters
    ----------
    effects, specifications
        Of the factorial.
    single, soccer
        Effects of the specifications that change one choice.
    """
    lines = ["All choices at once:", "", *findings_at_once(effects, specifications)]
    for title, own in (("mazes", single), ("soccer", soccer)):
        lines += ["", f"One choice at a time, {title}:", ""]
        for claim, part in own.groupby("claim", sort=False):
            outcome = part.set_index("specification")["outcome"]
            start = outcome["default"]
            others = [name for name in (HOLDS, REVERSED, OPEN, UNDEFINED) if name != start]
            moved = [
                f"{other} under {', '.join(outcome.index[outcome == other])}"
                for other in others
                if (outcome == other).any()
            ]
            said = "; ".join(moved) or "the same under every other value"
            lines.append(
                f"- {_title(claim)}: {start} with the defaults; {said}. "
                f"{int(unchanged(part).sum())} of the {len(part) - 1} changes leave its numbers as "
                "they are."
            )
    return "\n".join(lines)


def findings_at_once(effects: pd.DataFrame, specifications: Sequence[Specification]) -> list[str]:
    """Return in words what each claim depends on when all choices vary, a line of a list each.

    Parameters
    ----------
    effects, specifications
        Of the factorial.
    """
    shares = variance_shares(effects, specifications)
    without = variance_shares(effects[effects["capped"] == 0], specifications)
    levels = level_table(effects, specifications)
    lines = []
    for row in outcome_shares(effects).itertuples():
        part = effects[effects["claim"] == row.claim]
        line = f"- {_title(row.claim)}: {_counts(row)}{_caps(row, part)}"
        largest = _choices_of(shares, row.claim).nlargest(1, "share")
        for one in largest[largest["share"] > MATTERS].itertuples():
            name = NAMES.get(one.choice, one.choice)
            line += f" It depends most on {name}: {one.share:.0%} of the variance of the effect"
            left = _choices_of(without, row.claim).set_index("choice")["share"]
            if row.with_caps and one.choice in left.index:
                line += f", {left[one.choice]:.0%} without trials at the cap"
            if row.holds:
                line += f". It holds with {_by_value(levels, part, row.claim, one.choice)}"
            line += "."
        lines.append(line)
    return lines


def chance(effects: pd.DataFrame, specifications: Sequence[Specification]) -> str:
    """Return in words how far the shares of a choice that cannot act differ by chance."""
    levels = level_table(effects, specifications)
    own = levels[(levels["claim"] == "SAVES-OPEN") & (levels["choice"] == "ADABOOST-RULE")]
    return (
        f"{NAMES['ADABOOST-RULE']} cannot act on *{short_label('SAVES-OPEN')}*, and yet this holds "
        f"with its {len(own)} values in {own['holds'].min():.0%} to {own['holds'].max():.0%} of "
        f"the specifications"
    )


def _title(claim: str) -> str:
    label = short_label(claim)
    return f"**{label[0].upper()}{label[1:]}**"


def _counts(row: Any) -> str:
    """Say how many specifications have which outcome."""
    n = row.specifications - row.undefined
    said = f"holds in {row.holds} of {n} specifications ({row.share:.0%})"
    if row.undefined:
        said += f" that have an effect ({row.undefined} do not)"
    return f"{said}, is open in {row.open} and reversed in {row.reversed}."


def _caps(row: Any, part: pd.DataFrame) -> str:
    """Say in how many specifications trials end at the cap, whose they are, and what is left."""
    if not row.with_caps:
        return ""
    claim = load_claims().by_id(row.claim)
    said = f" In {row.with_caps} of them trials end at the iteration cap"
    whose = (
        ""
        if part["capped_x"].any()
        else f", all of them of {METHODS[claim.y].label.partition(' (')[0]}"
    )
    if claim.statistic == "share":
        other = "; every trial of the other method reaches zero, in every specification"
        return f"{said}{whose}{other if whose else ''}."
    others = f"{row.uncapped} others{' that have an effect' if row.undefined else ''}"
    return f"{said}{whose}; it holds in {row.holds_uncapped} of the {others}."


def _choices_of(shares: pd.DataFrame, claim: str) -> pd.DataFrame:
    own = shares[(shares["claim"] == claim) & ~shares["choice"].isin(["noise", "rest"])]
    return own.dropna(subset="share")


def _by_value(levels: pd.DataFrame, part: pd.DataFrame, claim: str, choice: str) -> str:
    """Say in which share of the specifications a claim holds with each value of a choice."""
    own = levels[(levels["claim"] == claim) & (levels["choice"] == choice)].dropna(subset="holds")
    words = part["specification"].str.split()
    said = []
    for value in own.sort_values("holds", ascending=False, kind="stable").itertuples():
        having = [f"{choice}={value.value}" in some for some in words]
        always = (part["capped"][having] >= part["n"][having]).all()
        said.append(f"{value.value} {value.holds:.0%}{' (always at the cap)' if always else ''}")
    return ", ".join(said)


def ablations_table(results: Results, conditions: Mapping[str, Condition]) -> pd.DataFrame:
    """Return one row a condition: a summary of its iterations, capped trials counting as the cap.

    `more` is the mean number of iterations more than in the first condition, over the same seeds,
    with its interval.
    """
    rows = []
    first = results.iterations(next(iter(conditions.values())))
    for name, condition in conditions.items():
        counts = results.iterations(condition).astype(float)
        low, high = mean_intervals(np.stack([counts, counts - first]))
        rows.append(
            {
                "setting": name,
                "n": len(counts),
                "capped": int((~results.converged(condition)).sum()),
                "mean": counts.mean(),
                "low": low[0],
                "high": high[0],
                "sd": counts.std(ddof=1),
                "median": float(np.median(counts)),
                "more": (counts - first).mean(),
                "more_low": low[1],
                "more_high": high[1],
            }
        )
    return pd.DataFrame(rows)


def numbers_table(
    results: Results, conditions: Mapping[tuple[int, str], Condition]
) -> pd.DataFrame:
    """Return one row for each number of incorrect demonstrations and reading of Eq. 9.

    `saved` is the mean number of iterations fewer than without any, over the same seeds, with its
    interval; `pairs` and `leaving` count the marked pairs, see
    :func:`replication.evidence.tables.pairs_near`.
    """
    rows = []
    for (number, f), condition in conditions.items():
        counts = results.iterations(condition).astype(float)
        saved = results.iterations(conditions[0, f]) - counts
        low, high = mean_intervals(np.stack([counts, saved]))
        near = pairs_near(condition.selected)
        rows.append(
            {
                "F": f,
                "number": number,
                "pairs": near["pairs"],
                "leaving": near["leaving"],
                "capped": int((~results.converged(condition)).sum()),
                "mean": counts.mean(),
                "low": low[0],
                "high": high[0],
                "saved": saved.mean(),
                "saved_low": low[1],
                "saved_high": high[1],
            }
        )
    return pd.DataFrame(rows)


def _order(value: Value) -> tuple[bool, float, str]:
    number = isinstance(value, (int, float))
    return (not number, float(value) if number else 0.0, str(value))


def _effects(
    claim: Claim, x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return a claim's effect with its interval for each row of trials, [specification]."""
    if claim.statistic == "mean-difference":
        return (x - y).mean(axis=1), *mean_intervals(x - y)
    if claim.statistic == "mean":
        return x.mean(axis=1), *mean_intervals(x)
    if claim.statistic == "sd-ratio":
        return sd_ratio_intervals(x, y)
    assert claim.statistic == "share", f"{claim.id} has no effect under a specification"
    share = np.minimum(x.mean(axis=1), y.mean(axis=1))
    n = x.shape[1]
    low, high = zip(*(share_interval(round(one * n), n) for one in share), strict=True)
    return share, np.array(low), np.array(high)


def _share(outcomes: pd.Series, outcome: str) -> float:
    """Return the share of an outcome among specifications that have an effect."""
    defined = outcomes[outcomes != UNDEFINED]
    return float((defined == outcome).mean())


def _outcome(claim: Claim, effect: float, low: float, high: float) -> str:
    if np.isnan(effect):
        return UNDEFINED
    if claim.statistic == "share":
        return HOLDS if effect > claim.margin else REVERSED if high < claim.margin else OPEN
    below, above = high < claim.margin, low > claim.margin
    if not (below or above):
        return OPEN
    return HOLDS if below == (claim.direction == "less") else REVERSED


def _residual(blocks: Sequence[NDArray[np.float64]], y: NDArray[np.float64]) -> tuple[float, int]:
    """Return the residual sum of squares of a regression with a constant, and its freedom."""
    matrix = np.column_stack([np.ones(len(y)), *blocks])
    fitted = matrix @ np.linalg.lstsq(matrix, y, rcond=None)[0]
    return float(((y - fitted) ** 2).sum()), len(y) - int(np.linalg.matrix_rank(matrix))
