from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from replication.evidence.explained import share_table


def test_shares_by_hand() -> None:
    """What follows one cause exactly is explained by it, and by the other as far as they agree."""
    rng = np.random.default_rng(np.random.SeedSequence(6))
    n = 40
    delta, length = rng.uniform(0.01, 0.1, n), rng.integers(4, 30, n)
    table = pd.DataFrame(
        {
            "method": "perceptron",
            "reading": "",
            "solver": "planning",
            "vary": np.where(np.arange(n) < 25, "shape", "length"),
            "delta": delta,
            "length": length,
            "mean": 3 * delta**-0.5 * np.exp(rng.normal(0, 0.3, n)),
        }
    )
    shares = share_table(table).set_index(["among", "cause"])
    assert shares["cases"].tolist() == [25, 25, 40, 40]
    row = shares.loc["all", "margin"]
    x, y = np.log(delta**-2.0), np.log(table["mean"])
    slope, constant = np.polyfit(x, y, 1)
    explained = 1 - ((y - constant - slope * x) ** 2).sum() / ((y - y.mean()) ** 2).sum()
    assert (row["share"], row["slope"]) == pytest.approx((explained, slope))
    # Fisher's interval, as SciPy has it
    ends = stats.pearsonr(x, y).confidence_interval(0.95)
    assert (row["low"], row["high"]) == pytest.approx((ends.low**2, ends.high**2), rel=1e-6)
    right = [
        (delta[i] < delta[j]) == (y[i] > y[j])
        for i in range(n)
        for j in range(i)
        if delta[i] != delta[j]
    ]
    assert (row["pairs"], row["right"]) == (len(right), pytest.approx(np.mean(right)))
    other = shares.loc["all", "length"]
    assert other["low"] == 0 < other["share"] < other["high"]
    assert other["pairs"] == sum(length[i] != length[j] for i in range(n) for j in range(i))


FEW = pd.DataFrame(
    {
        "method": "unified",
        "reading": "printed",
        "solver": "planning",
        "vary": "shape",
        "delta": [1.0, 2.0, 3.0, 5.0, 4.0],
        "length": [2, 4, 8, 16, 32],
        "mean": [10.0, 20.0, 20.0, 40.0, 30.0],
    }
)


def test_few_cases_by_hand() -> None:
    """A tie of iterations counts half, and an interval that holds no correlation begins at 0.

    With length r is 0.87 and Fisher's z 1.91 standard errors, just less than 1.96; with 1 / delta^2
    it is -0.97, so that the end nearer to 0 is the upper one.
    """
    margin, length = share_table(FEW).iloc[:2].to_dict("records")
    assert (margin["pairs"], margin["right"]) == (10, pytest.approx(0.05))
    assert (length["pairs"], length["right"]) == (10, pytest.approx(0.85))
    assert length["low"] == 0
    ends = stats.pearsonr(np.log(FEW["delta"] ** -2.0), np.log(FEW["mean"])).confidence_interval()
    assert ends.low < ends.high < 0
    assert (margin["low"], margin["high"]) == pytest.approx((ends.high**2, ends.low**2), rel=1e-6)


def test_runs_stand_by_themselves() -> None:
    """Each has its own rows, as if it were alone, in the order of the table."""
    other = FEW.assign(method="perceptron", reading="", mean=[5.0, 7.0, 9.0, 8.0, 6.0])
    together = share_table(pd.concat([FEW, other]))
    alone = [share_table(FEW), share_table(other)]
    pd.testing.assert_frame_equal(together, pd.concat(alone, ignore_index=True))
