"""What the claims depend on: their effects under every declared specification.

Effects and intervals are those of the claims. A trial at the iteration cap counts as that many
iterations here, and the number of such trials is reported. One file because every table here is
computed from that of the effects.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.evidence.claims import Claim
from replication.evidence.joint import joint_test
from replication.evidence.specifications import (
    DEFAULT,
    Specification,
    default_of,
    named_choices,
    sort_key,
)
from replication.evidence.statistics import (
    mean_interval,
    sd_ratio_interval,
    share_interval,
    standard_errors,
)

HOLDS, OPEN, REVERSED = "holds", "open", "reversed"
"""Whether an interval lies beyond the margin on the claimed side, includes it, or on the other."""

UNDEFINED = "undefined"
"""There is no effect: a ratio of SDs needs samples that vary."""

LEVEL = 0.05
"""Of the joint test, for a specification by itself."""

NOISE, REST = "noise", "rest"
"""What the variance of an effect is due to beside single choices."""

Array = NDArray[np.float64]


# --- effects -------------------------------------------------------------------------------------


def effects_table(
    trials: pd.DataFrame, specifications: Sequence[Specification], claims: Sequence[Claim]
) -> pd.DataFrame:
    """Return one row for each claim and specification: the effect, its interval, its outcome.

    An effect holds where its interval lies beyond no effect (`neutral`) on the claimed side. A
    share (errors that reach zero) holds where it is above the margin itself: so few trials give
    no interval that could be. `capped` counts the trials at the iteration cap of all methods of the
    claim, `capped_x` those of its first.

    What is saved is also tested jointly, over all specifications of a group, see
    :func:`replication.evidence.joint.joint_test`: `p_family` is the adjusted p-value of each,
    `null_low` to `null_high` where an effect of its rank lies with 95 % without any effect, and
    `p_median` and `p_holds` the joint p-values of the median and of the number that hold.

    Parameters
    ----------
    trials
        The trials of each specification, under one reading of Eq. 9 each; its column `number` is
        the specification's place among `specifications`.
    specifications
        In the order in which they were declared.
    claims
        What to evaluate; a specification without a claim's methods gives no row.
    """
    measured = {
        specifications[int(number)]: dict(list(rows.groupby("method")))
        for number, rows in trials.groupby("number")
    }
    parts = []
    for claim in claims:
        methods = {claim.x, claim.y or claim.x}
        names = [name for name, groups in measured.items() if methods <= groups.keys()]
        if not names:
            continue
        x, y = (
            np.array([measured[name][method][claim.measure] for name in names], float)
            for method in (claim.x, claim.y or claim.x)
        )
        capped = {
            method: [int((measured[name][method]["converged"] == 0).sum()) for name in names]
            for method in methods
        }
        bounds = _effects(claim, x, y)
        groups = np.array([name.group for name in names])
        columns = {
            "claim": claim.id,
            "statistic": claim.statistic,
            "measure": claim.measure,
            "neutral": neutral(claim),
            "group": groups,
            "specification": [name.name for name in names],
            "n": x.shape[1],
            "capped": np.sum(list(capped.values()), axis=0),
            "capped_x": capped[claim.x],
            **dict(zip(("effect", "low", "high"), bounds, strict=True)),
            "outcome": [_outcome(claim, *row) for row in zip(*bounds, strict=True)],
            **dict.fromkeys(JOINT, np.nan),
        }
        part = pd.DataFrame(columns)
        for group in dict.fromkeys(groups) if claim.statistic == "saved" else ():
            own = groups == group
            part.loc[own, list(JOINT)] = _joint(y[own] - x[own])
        parts.append(part)
    return pd.concat(parts, ignore_index=True)


JOINT = ("p_family", "null_low", "null_high", "p_median", "p_holds")
"""The columns of the joint test."""


def _joint(saved: Array) -> Array:
    """Return the columns of the joint test, [specification, column], given [specification, trial].

    The band of the null hypothesis is that of the effect with the same rank.
    """
    test = joint_test(saved)
    rank = np.argsort(np.argsort(saved.mean(axis=1), kind="stable"), kind="stable")
    whole = np.broadcast_to([test.p_median, test.p_significant], (len(saved), 2))
    band = np.column_stack([test.null_low[rank], test.null_high[rank]])
    return np.column_stack([test.p_familywise, band, whole])


def neutral(claim: Claim) -> float:
    """Return what a claim's statistic is without any effect; of a share, its margin."""
    if claim.statistic == "share":
        assert claim.margin is not None
        return claim.margin
    return float(claim.statistic == "sd-ratio")


def _effects(claim: Claim, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return a claim's effect with its interval for each row of trials, [specification]."""
    if claim.statistic == "saved":
        return (y - x).mean(axis=1), *mean_interval(y - x)
    if claim.statistic == "mean":
        return x.mean(axis=1), *mean_interval(x)
    if claim.statistic == "sd-ratio":
        return sd_ratio_interval(x, y)
    assert claim.statistic == "share", f"{claim.id} has no effect under a specification"
    shares = np.minimum(x.mean(axis=1), y.mean(axis=1))
    n = x.shape[1]
    low, high = zip(*(share_interval(round(share * n), n) for share in shares), strict=True)
    return shares, np.array(low), np.array(high)


def _outcome(claim: Claim, effect: float, low: float, high: float) -> str:
    if np.isnan(effect):
        return UNDEFINED
    even = neutral(claim)
    if claim.statistic == "share":
        return HOLDS if effect > even else REVERSED if high < even else OPEN
    below, above = high < even, low > even
    if not (below or above):
        return OPEN
    return HOLDS if below == (claim.statistic == "sd-ratio") else REVERSED


# --- outcomes ------------------------------------------------------------------------------------


def outcome_shares(effects: pd.DataFrame) -> pd.DataFrame:
    """Return for each claim and group in how many specifications it holds, is open, is reversed.

    `share` is that of the specifications in which it holds, among those with an effect. In
    `with_caps` of them a trial ended at the iteration cap; of the `uncapped` others that have an
    effect, the claim holds in `holds_uncapped`. `unchanged` counts those with the numbers of the
    default, whose choice cannot act on the claim or did not. `p_median` and `p_holds` are those of
    the joint test, and `alone` counts the specifications with an effect of either sign that it
    shows by itself, allowing for all others.
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
                "p_median": float(part["p_median"].iloc[0]),
                "p_holds": float(part["p_holds"].iloc[0]),
                "alone": int((part["p_family"] < LEVEL).sum()),
            }
        )
    return pd.DataFrame(rows)


def unchanged(effects: pd.DataFrame) -> pd.Series:
    """Return which rows of one claim have the default's effect and interval, itself left out."""
    numbers = effects[["effect", "low", "high"]]
    default = effects["specification"] == DEFAULT
    same = pd.Series(False, index=effects.index)
    for _, row in numbers[default].iterrows():
        same = (numbers == row).all(axis=1) & ~default
    return same


def _share(outcomes: pd.Series, outcome: str) -> float:
    """Return the share of an outcome among specifications that have an effect."""
    defined = outcomes[outcomes != UNDEFINED]
    return float((defined == outcome).mean())


# --- which choice matters ------------------------------------------------------------------------


def shares_table(effects: pd.DataFrame) -> pd.DataFrame:
    """Return what the variance of each claim's effect over the factorial is due to.

    `share` is that of each choice, of noise and of the rest, see :func:`epsilon_squared`, and
    `share_uncapped` the same without the specifications in which a trial ended at the iteration
    cap. The last rows of a claim are the shares of the specifications in which it holds, is open
    and is reversed.
    """
    factorial = effects[effects["group"] == "factorial"]
    variance = epsilon_squared(factorial).merge(
        epsilon_squared(factorial[factorial["capped"] == 0]),
        how="left",
        on=["claim", "choice"],
        suffixes=("", "_uncapped"),
    )
    outcomes = [
        {"claim": claim, "choice": outcome, "share": _share(part["outcome"], outcome)}
        for claim, part in factorial.groupby("claim", sort=False)
        for outcome in (HOLDS, OPEN, REVERSED)
    ]
    return pd.concat([variance, pd.DataFrame(outcomes)], ignore_index=True)


def epsilon_squared(effects: pd.DataFrame) -> pd.DataFrame:
    """Return the share of each choice in the variance of effects: type-II ε² by claim and choice.

    Each claim's effects are regressed on all choices of the factorial at once, every value with its
    own coefficient. A choice's share is the sum of squares that is lost without it, less what as
    many columns of noise would explain, over the total: about 0 for a choice that does not matter,
    perhaps slightly negative. Ratios of SDs enter by their logarithm; specifications without an
    effect are left out. `noise` is the share of the sampling error, estimated from the intervals;
    `rest` is what remains: choices that act together, and choices that are correlated by chance.
    Fewer specifications than values give NaN.
    """
    rows = []
    factorial = effects[effects["group"] == "factorial"].dropna(subset="effect")
    for claim, part in factorial.groupby("claim", sort=False):
        bounds = part[["effect", "low", "high"]].to_numpy(float).T
        ratios = (part["statistic"] == "sd-ratio").any()
        if ratios:
            bounds = np.log(bounds)
        y, low, high = bounds
        total = float(((y - y.mean()) ** 2).sum())
        if total == 0:
            continue
        chosen = _choices(part)
        design = {id: pd.get_dummies(chosen[id], drop_first=True).to_numpy(float) for id in chosen}
        full, freedom = _residual(list(design.values()), y)
        unexplained = full / freedom if freedom > 0 else np.nan
        shares = {}
        for id, block in design.items():
            without, _ = _residual([other for name, other in design.items() if name != id], y)
            shares[id] = (without - full - block.shape[1] * unexplained) / total
        known = np.isfinite(low) & np.isfinite(high)
        # Intervals of ratios are normal, those of means Student's.
        of_t = np.inf if ratios else part["n"].to_numpy(float)[known] - 1
        errors = standard_errors(low[known], high[known], of_t)
        error = float((errors**2).mean()) if known.any() else 0
        noise = min(error * len(y) / total, 1.0)
        rest = 1.0 - sum(shares.values()) - noise
        rows += [
            {"claim": claim, "choice": id, "share": share}
            for id, share in {**shares, NOISE: noise, REST: rest}.items()
        ]
    return pd.DataFrame(rows, columns=["claim", "choice", "share"]).astype({"share": float})


def _residual(blocks: Sequence[Array], y: Array) -> tuple[float, int]:
    """Return the residual sum of squares of a regression with a constant, and its freedom."""
    matrix = np.column_stack([np.ones(len(y)), *blocks])
    fitted = matrix @ np.linalg.lstsq(matrix, y, rcond=None)[0]
    return float(((y - fitted) ** 2).sum()), len(y) - int(np.linalg.matrix_rank(matrix))


def level_table(effects: pd.DataFrame) -> pd.DataFrame:
    """Return for each claim, choice and value of the factorial the mean effect and the outcomes."""
    rows = []
    factorial = effects[effects["group"] == "factorial"]
    for claim, part in factorial.groupby("claim", sort=False):
        chosen = _choices(part)
        for id in chosen:
            for value in sorted(set(chosen[id]), key=sort_key):
                level = part[chosen[id] == value]
                rows.append(
                    {
                        "claim": claim,
                        "choice": id,
                        "value": value,
                        "default": value == str(default_of(id)),
                        "specifications": len(level),
                        "mean_effect": float(level["effect"].mean()),
                        "holds": _share(level["outcome"], HOLDS),
                        "reversed": _share(level["outcome"], REVERSED),
                    }
                )
    return pd.DataFrame(rows)


def _choices(effects: pd.DataFrame) -> pd.DataFrame:
    """Return the values, as text, that the specification of each row gives to its choices."""
    return pd.DataFrame(map(named_choices, effects["specification"]), index=effects.index)
