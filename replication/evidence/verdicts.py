"""Judge the paper's claims by the frozen criteria of :mod:`replication.evidence.claims`.

One file because a verdict is read with the numbers and the reason that stand beside it.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.errors import UserError
from replication.evidence.claims import (
    TESTED,
    Claim,
    ClaimError,
    Claims,
    Judging,
    criteria_hash,
)
from replication.evidence.experiments import EXPERIMENTS, NONE, main_trials
from replication.evidence.statistics import (
    detectable,
    effect_prediction,
    equivalence_p,
    holm,
    mean_interval,
    mean_prediction,
    published_difference_se,
    published_log_sd_ratio_se,
    relative_equivalence_p,
    run_p,
    sd_interval,
    sd_prediction,
    sd_ratio_interval,
    share_interval,
    sign_flip_p,
    spread_equivalence_p,
    spread_p,
    standard_errors,
)
from replication.evidence.tables import read_table
from replication.irl import get_method

SHOWN = "shown"
ABSENT = "absent"
REVERSED = "reversed"
INCONCLUSIVE = "inconclusive"
CONSISTENT = "consistent"
INCONSISTENT = "inconsistent"
NOT_TESTABLE = "not testable"

Array = NDArray[np.float64]

EMPTY = (
    "effect",
    "low",
    "high",
    "margin",
    "p",
    "p_absent",
    "paper",
    "predicted_low",
    "predicted_high",
)


def read_trials(figures: Path) -> pd.DataFrame:
    """Return the tables ``trials.csv`` of all experiments, one below the other.

    Raises
    ------
    UserError
        If they do not come from one root seed.
    """
    folders = [figures / task.replace("-", "_") for task in EXPERIMENTS]
    tables = [read_table(folder / "trials.csv") for folder in folders]
    trials = pd.concat(tables, ignore_index=True)
    if trials["seed"].nunique() > 1:
        seeds = ", ".join(
            f"{folder.name} {table['seed'].iloc[0]}"
            for folder, table in zip(folders, tables, strict=True)
        )
        raise UserError(f"{figures}: the root seeds differ ({seeds}); use one for all")
    return trials


def judged_trials(trials: pd.DataFrame, judging: Judging) -> pd.DataFrame:
    """Return the trials that count: those of the main conditions, as many as are to be judged."""
    main = main_trials(trials)
    return main[main["trial"] < main["task"].map(dict(judging.trials))]


def judge_claims(measures: pd.DataFrame, claims: Claims) -> pd.DataFrame:
    """Return one row for each claim and cell, with its verdict.

    Parameters
    ----------
    measures
        The trials of all tasks, see :func:`judged_trials`.
    claims
        What to judge, and how.

    Returns
    -------
    DataFrame
        `effect` with its 95 % interval `low` to `high` is the claim's statistic, `margin` the
        smallest effect of interest and `paper` the published one; ours is `consistent` with it if
        it lies between `predicted_low` and `predicted_high`. `p` is that of the test of no effect,
        `p_absent` that of equivalence within the margin; `p_holm` and `p_absent_holm` are adjusted
        over the cells of the claim. `why` says what a verdict rests on where that is not in these
        numbers. `criteria` is the hash of what was frozen.

    Raises
    ------
    ClaimError
        If a method that a claim is about has no trials.
    """
    rows = []
    for claim in claims.claim:
        cells = [_row(claim, reading, set, measures) for reading, set in claim.cells()]
        for name in ("p", "p_absent"):
            known = [row for row in cells if claim.statistic in TESTED and not np.isnan(row[name])]
            for row, p in zip(known, holm([row[name] for row in known]), strict=True):
                row[f"{name}_holm"] = float(p)
        for row in cells:
            row["verdict"], row["why"] = _verdict(claim, row, claims.judging)
        rows += cells
    table = pd.DataFrame(rows)
    table["criteria"] = criteria_hash()
    return table


def decide(
    effect: float, *, neutral: float, p: float, p_absent: float, level: float, less: bool = False
) -> str:
    """Return the verdict on an effect, given the adjusted p-values of difference and equivalence.

    `neutral` is no effect, and `less` says that the claimed side is below it.

    Examples
    --------
    >>> decide(3.0, neutral=0.0, p=0.01, p_absent=1.0, level=0.05)
    'shown'
    >>> decide(0.3, neutral=0.0, p=0.01, p_absent=0.01, level=0.05)
    'absent'
    >>> decide(0.8, neutral=1.0, p=0.2, p_absent=0.2, level=0.05, less=True)
    'inconclusive'
    """
    if p_absent < level:
        return ABSENT
    if not p < level:
        return INCONCLUSIVE
    return SHOWN if (effect < neutral) == less else REVERSED


def _row(claim: Claim, reading: str, set: str, measures: pd.DataFrame) -> dict[str, Any]:
    x = trials_of(measures, claim.task, claim.x, reading, set)
    y = trials_of(measures, claim.task, claim.y, reading, set) if claim.y else x
    both = np.intersect1d(x["trial"], y["trial"])
    x, y = (rows.set_index("trial").loc[both] for rows in (x, y))
    capped = int((x["converged"] == 0).sum() + (claim.y != "") * (y["converged"] == 0).sum())
    row: dict[str, Any] = {
        "id": claim.id,
        "claim": claim.claim,
        "place": claim.place,
        "task": claim.task,
        "reading": reading,
        "set": set,
        "measure": claim.measure,
        "statistic": claim.statistic,
        "x": claim.x,
        "y": claim.y,
        "n": len(both),
        "capped": capped,
    }
    row |= dict.fromkeys(EMPTY, np.nan)
    row |= {"p_holm": np.nan, "p_absent_holm": np.nan, "consistent": ""}
    row["paper"] = claim.paper_effect
    a, b = (rows[claim.measure].to_numpy(float) for rows in (x, y))
    if claim.statistic == "share":
        share, n = min((values.mean(), len(values)) for values in (a, b))
        low, high = share_interval(round(share * n), n)
        return row | {"effect": share, "low": low, "high": high, "margin": claim.margin}
    if capped:  # at the cap there is no count
        return row
    numbers = _NUMBERS[claim.statistic](claim, a, b)
    if not np.isnan(numbers.get("predicted_low", np.nan)):
        inside = numbers["predicted_low"] <= numbers["effect"] <= numbers["predicted_high"]
        row["consistent"] = "yes" if inside else "no"
    return row | numbers


def _saved(claim: Claim, x: Array, y: Array) -> dict[str, float]:
    d = y - x
    low, high = mean_interval(d)
    row = {"effect": d.mean(), "low": float(low), "high": float(high), "p": sign_flip_p(d)}
    if claim.fraction is not None:
        margin = claim.fraction * y.mean()
        return row | {"margin": margin, "p_absent": relative_equivalence_p(x, y, claim.fraction)}
    (_, sd_x, n_x), (_, sd_y, n_y) = claim.paper[claim.x], claim.paper[claim.y]
    se = published_difference_se(sd_x, n_x, sd_y, n_y)
    margin = detectable(se) if claim.margin is None else claim.margin
    row |= {"margin": margin, "p_absent": equivalence_p(d, margin)}
    if np.isnan(se):
        return row
    ours = float(standard_errors(low, high, len(d) - 1))
    return row | _predicted(*effect_prediction(claim.paper_effect, se, ours))


def _sd_ratio(claim: Claim, x: Array, y: Array) -> dict[str, float]:
    ratio, low, high = map(float, sd_ratio_interval(x, y))
    se = published_log_sd_ratio_se(claim.paper[claim.x][2], claim.paper[claim.y][2])
    margin = float(np.exp(-detectable(se)))
    ours = float(standard_errors(np.log(low), np.log(high)))
    bounds = effect_prediction(np.log(claim.paper_effect), se, ours)
    return {
        "effect": ratio,
        "low": low,
        "high": high,
        "margin": margin,
        "p": spread_p(x, y),
        "p_absent": spread_equivalence_p(x, y, 1 / margin),
    } | _predicted(*np.exp(bounds))


def _mean(claim: Claim, x: Array, y: Array) -> dict[str, float]:
    low, high = mean_interval(x)
    return {"effect": x.mean(), "low": float(low), "high": float(high), "p": sign_flip_p(x)}


def _published_mean(claim: Claim, x: Array, y: Array) -> dict[str, float]:
    mean, sd, n = claim.paper[claim.x]
    low, high = mean_interval(x)
    row = {"effect": x.mean(), "low": float(low), "high": float(high)}
    return row | _predicted(*mean_prediction(mean, sd, n, len(x)))


def _published_sd(claim: Claim, x: Array, y: Array) -> dict[str, float]:
    _, sd, n = claim.paper[claim.x]
    low, high = sd_interval(x)
    row = {"effect": x.std(ddof=1), "low": low, "high": high}
    return row | _predicted(*sd_prediction(sd, n, x))


def _published_run(claim: Claim, x: Array, y: Array) -> dict[str, float]:
    low, middle, high = np.quantile(x, [0.025, 0.5, 0.975])
    run = claim.paper[claim.x][0]
    return {"effect": middle, "low": float(low), "high": float(high), "p": run_p(x, run)}


def _predicted(low: float, high: float) -> dict[str, float]:
    return {"predicted_low": float(low), "predicted_high": float(high)}


_NUMBERS = {
    "saved": _saved,
    "sd-ratio": _sd_ratio,
    "mean": _mean,
    "published-mean": _published_mean,
    "published-sd": _published_sd,
    "published-run": _published_run,
}


def _verdict(claim: Claim, row: dict[str, Any], judging: Judging) -> tuple[str, str]:
    """Return the verdict in a cell, and what it rests on if that is not in its numbers."""
    if claim.used:
        return NOT_TESTABLE, claim.used
    if row["n"] < judging.fewest:
        return NOT_TESTABLE, f"{row['n']} trials; {judging.fewest} are needed"
    if np.isnan(row["effect"]) and row["capped"]:
        return NOT_TESTABLE, f"{row['capped']} trials at the iteration cap"
    if np.isnan([row["effect"], row["low"], row["high"]]).any():
        return NOT_TESTABLE, "the trials do not vary"
    if claim.statistic == "share":
        if row["low"] > row["margin"]:
            return SHOWN, ""
        return (ABSENT if row["high"] < row["margin"] else INCONCLUSIVE), ""
    if claim.statistic == "published-run":
        return "", "a single run: only how probable it is"
    if claim.is_published:
        return (CONSISTENT if row["consistent"] == "yes" else INCONSISTENT), ""
    less = claim.statistic == "sd-ratio"
    p, p_absent = row["p_holm"], row["p_absent_holm"]
    settings: dict[str, Any] = {"neutral": float(less), "less": less, "level": judging.level}
    return decide(row["effect"], p=p, p_absent=p_absent, **settings), ""


def trials_of(
    measures: pd.DataFrame, task: str, method: str, reading: str, set: str
) -> pd.DataFrame:
    """Return the trials of a method that count in a cell, in order.

    A method without a trace counts under each reading, and one that is given no incorrect
    demonstrations beside each set.

    Raises
    ------
    ClaimError
        If there are none.
    """
    used = get_method(method)
    own = {
        "task": task,
        "method": method,
        "reading": used.under(reading),
        "set": set if used.uses_incorrect else NONE,
    }
    rows = measures[(measures[list(own)] == list(own.values())).all(axis=1)]
    if rows.empty:
        notebook = task.replace("-", "_")
        raise ClaimError(f"no trials of {method} on {task}: run the notebook {notebook} first")
    return rows.sort_values("trial")


def by_claim(table: pd.DataFrame) -> Iterable[tuple[str, pd.DataFrame]]:
    """Yield each claim's id and rows, in the order of the table."""
    yield from table.groupby("id", sort=False)
