"""Judge the paper's claims by the frozen criteria of :mod:`replication.evidence.claims`.

One file because a verdict is read with the numbers and the reason that stand beside it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from replication.errors import UserError
from replication.evidence.claims import Claim, ClaimError, Claims, Judging, criteria_hash
from replication.evidence.experiments import EXPERIMENTS, main_trials, under
from replication.evidence.statistics import (
    compare,
    holm,
    mean_prediction,
    sd_interval,
    sd_prediction,
    share_interval,
    summarise,
)
from replication.evidence.tables import read_table

REPRODUCED = "reproduced"
PARTLY = "partly"
UNDECIDED = "undecided"
REVERSED = "reversed"
NOT_REPRODUCED = "not reproduced"
NOT_TESTABLE = "not testable"


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
    """Return one row for each claim and reading of Eq. 9, with its verdict.

    Parameters
    ----------
    measures
        The trials of all tasks, see :func:`judged_trials`.
    claims
        What to judge, and how.

    Returns
    -------
    DataFrame
        `effect` with its 95 % interval `low` to `high` is the claim's statistic, `paper` the
        published value of it. For published means and SDs, `predicted_low` to `predicted_high` is
        where ours should lie. `fewer` is the probability that x is below y in one trial each, ties
        counting half. `p_holm` is adjusted over all tests of the table. `why` is empty for what is
        reproduced or reversed. `criteria` is the hash of the frozen file.

    Raises
    ------
    ClaimError
        If a method that a claim is about has no trials.
    """
    table = pd.DataFrame(
        [
            _row(claim, reading, measures)
            for claim in claims.claim
            for reading in _readings(measures, claim, claims.judging)
        ]
    )
    table["p_holm"] = np.nan
    tested = table["p"].notna()
    table.loc[tested, "p_holm"] = holm(table.loc[tested, "p"].tolist())
    by_id = {claim.id: claim for claim in claims.claim}
    judged = [_verdict(by_id[row.id], row, claims.judging) for row in table.itertuples()]
    table["verdict"], table["why"] = zip(*judged, strict=True)
    table["criteria"] = criteria_hash()
    return table


def overall(verdicts: Sequence[str]) -> str:
    """Return the verdict on a claim from those under each reading of Eq. 9.

    A claim of which one reading cannot be tested gets no verdict: what the other reading gives
    still stands in its row. So a number that made a choice under one reading is never judged.

    Examples
    --------
    >>> overall(["reproduced", "undecided"]), overall(["not testable", "reproduced"])
    ('partly', 'not testable')
    >>> overall(["undecided", "not reproduced"]), overall(["reversed", "not reproduced"])
    ('undecided', 'not reproduced')
    """
    if NOT_TESTABLE in verdicts:
        return NOT_TESTABLE
    if len(set(verdicts)) == 1:
        return verdicts[0]
    if REPRODUCED in verdicts:
        return PARTLY
    return UNDECIDED if UNDECIDED in verdicts else NOT_REPRODUCED


def decide(low: float, high: float, margin: float, direction: str, p: float, level: float) -> str:
    """Judge an interval and the adjusted p-value of the test beside it, NaN if there is none.

    Examples
    --------
    >>> decide(-3.0, -1.0, 0.0, "less", 0.01, 0.05), decide(-3.0, -1.0, 0.0, "less", 0.08, 0.05)
    ('reproduced', 'undecided')
    >>> decide(1.0, 3.0, 0.0, "less", 0.01, 0.05), decide(-1.0, 1.0, 0.0, "less", 0.5, 0.05)
    ('reversed', 'not reproduced')
    """
    excluded = not low <= margin <= high
    rejected = excluded if np.isnan(p) else p < level
    if excluded != rejected:
        return UNDECIDED
    if not excluded:
        return NOT_REPRODUCED
    return REPRODUCED if (high < margin) == (direction == "less") else REVERSED


def _readings(measures: pd.DataFrame, claim: Claim, judging: Judging) -> list[str]:
    """Return the readings of Eq. 9 that the first method of a claim was run under."""
    used = set(_trials_of(measures, claim.task, claim.x)["reading"])
    return [reading for reading in (*judging.readings, "") if reading in used]


def _row(claim: Claim, reading: str, measures: pd.DataFrame) -> dict[str, Any]:
    x = _paired(measures, claim.task, claim.x, reading)
    y = _paired(measures, claim.task, claim.y, reading) if claim.y else x
    row: dict[str, Any] = {
        "id": claim.id,
        "claim": claim.claim,
        "place": claim.place,
        "task": claim.task,
        "reading": reading,
        "measure": claim.measure,
        "statistic": claim.statistic,
        "x": claim.x,
        "y": claim.y,
        "direction": claim.direction,
        "margin": claim.margin if claim.direction != "inside" else np.nan,
        "test": claim.test,
        "n": len(x),
        "capped": int((x["converged"] == 0).sum() + (claim.y != "") * (y["converged"] == 0).sum()),
        "paper": claim.paper_effect,
    }
    counts = ("effect", "low", "high", "predicted_low", "predicted_high", "fewer", "p")
    return row | dict.fromkeys(counts, np.nan) | _numbers(claim, x, y)


def _numbers(claim: Claim, x: pd.DataFrame, y: pd.DataFrame) -> dict[str, float]:
    """Return the effect, its interval and whatever else the claim's statistic gives."""
    a, b = x[claim.measure].to_numpy(float), y[claim.measure].to_numpy(float)
    if claim.statistic == "share":
        share, n = min((values.mean(), len(values)) for values in (a, b))
        low, high = share_interval(round(share * n), n)
        return {"effect": share, "low": low, "high": high}
    if not (x["converged"].all() and y["converged"].all()):  # at the cap there is no count
        return {}
    if claim.statistic in ("mean-difference", "mean"):
        shift = 0.0 if claim.y else claim.margin
        against = b if claim.y else np.full(len(a), shift)
        result = compare(a, against)
        return {
            "effect": result.difference + shift,
            "low": result.low + shift,
            "high": result.high + shift,
            "fewer": result.fewer if claim.y else np.nan,
            "p": result.p,
        }
    if claim.statistic == "sd-ratio":
        result = compare(a, b)
        bounds = {"low": result.sd_low, "high": result.sd_high}
        return {"effect": result.sd_ratio, **bounds, "p": result.p_spread}
    ours = summarise(a, x["converged"])
    if claim.statistic == "published-run":
        low, high = np.quantile(a, [0.025, 0.975])
        return {"effect": ours.median, "low": float(low), "high": float(high)}
    paper = claim.published(claim.x)
    if claim.statistic == "published-mean":
        low, high = mean_prediction(paper.mean, paper.sd, paper.n, ours.n)
        moments = {"effect": ours.mean, "low": ours.low, "high": ours.high}
    else:
        low, high = sd_prediction(paper.sd, paper.n, a)
        sd_low, sd_high = sd_interval(a)
        moments = {"effect": ours.sd, "low": sd_low, "high": sd_high}
    return moments | {"predicted_low": low, "predicted_high": high}


def _verdict(claim: Claim, row: Any, judging: Judging) -> tuple[str, str]:
    """Return the verdict on a row, and the reason unless it is reproduced or reversed."""
    used = claim.used.get("all") or claim.used.get(row.reading or "all")
    if used:
        return NOT_TESTABLE, used
    if row.n < judging.fewest:
        return NOT_TESTABLE, f"{row.n} trials; {judging.fewest} are needed"
    if np.isnan(row.effect) and row.capped:
        return NOT_TESTABLE, f"{row.capped} trials at the iteration cap"
    if np.isnan([row.effect, row.low, row.high]).any():
        return NOT_TESTABLE, "the trials do not vary"
    if claim.statistic == "published-run":
        if row.low <= row.paper <= row.high:
            return REPRODUCED, ""
        return NOT_REPRODUCED, "the paper's run lies outside the central 95 % of ours"
    if claim.direction == "inside":
        if row.predicted_low <= row.effect <= row.predicted_high:
            return REPRODUCED, ""
        return NOT_REPRODUCED, "ours lies outside the range that the paper's predicts"
    verdict = decide(row.low, row.high, claim.margin, claim.direction, row.p_holm, judging.level)
    if verdict in (REPRODUCED, REVERSED):
        return verdict, ""
    if verdict == UNDECIDED:
        if row.low <= claim.margin <= row.high:
            return verdict, "the test rejects, but the interval includes the margin"
        return verdict, "the interval excludes the margin, but the test does not reject"
    if np.isnan(row.paper):
        return verdict, "the interval includes the margin"
    included = "and" if row.low <= row.paper <= row.high else "but not"
    return verdict, f"the interval includes the margin, {included} the published effect"


def _trials_of(measures: pd.DataFrame, task: str, method: str) -> pd.DataFrame:
    rows = measures[(measures["task"] == task) & (measures["method"] == method)]
    if rows.empty:
        notebook = task.replace("-", "_")
        raise ClaimError(f"no trials of {method} on {task}: run the notebook {notebook} first")
    return rows


def _paired(measures: pd.DataFrame, task: str, method: str, reading: str) -> pd.DataFrame:
    """Return a method's trials in order; without a trace it has the same under each reading."""
    return under(_trials_of(measures, task, method), reading).sort_values("trial")


def by_claim(table: pd.DataFrame) -> Iterable[tuple[str, pd.DataFrame]]:
    """Yield each claim's id and rows, in the order of the table."""
    yield from table.groupby("id", sort=False)
