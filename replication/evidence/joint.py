"""Joint tests of one claim under many specifications, whose trials have the same seeds.

After the specification curve analysis of Simonsohn, Simmons and Nelson (2020): what the whole curve
would look like without any effect is found by flipping the signs of the differences, of a trial
under all specifications at once, so that specifications stay as correlated as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from replication.evidence.statistics import CONFIDENCE, ROUNDING, Array, patterns

FLIPS = 9_999
"""Random patterns of signs where there are too many to try all."""


@dataclass(frozen=True)
class Joint:
    """Many specifications, tested together. The claimed side is above zero.

    Attributes
    ----------
    median, p_median
        Median over specifications of the mean difference, and the two-sided p-value.
    significant, p_significant
        Number of specifications whose mean difference is above zero by a t-test at 2.5 %, and the
        probability of so many without any effect.
    p_familywise
        P-value of each specification, two-sided, adjusted for all of them, [specification].
    null_low, null_high
        Where the mean differences, sorted from the lowest, lie with 95 % without any effect, each
        by itself, [specification].
    """

    median: float
    p_median: float
    significant: int
    p_significant: float
    p_familywise: Array
    null_low: Array
    null_high: Array


def joint_test(differences: Array) -> Joint:
    """Test the paired differences of many specifications, [specification, trial], together.

    A column has the same seed in all rows, so that it is flipped as a whole. The null hypothesis is
    that the differences are symmetric about zero. The adjustment is the single step by the largest
    size of t (Westfall and Young 1993), which holds whichever specifications have an effect. Signs
    are flipped in all 2^n ways, not in half as many: a count on one side changes when all are
    flipped.
    """
    _, n = differences.shape
    flips = np.concatenate(list(patterns(n, FLIPS)))
    means = (1 - 2 * flips) @ differences.T / n
    # Flips keep the sum of squares, so that t rises with the mean over the root mean square. This
    # lies between -1 and 1 where t is infinite, in a row without variation.
    size = np.sqrt((differences**2).mean(axis=1))
    scores = means / np.where(size == 0, 1, size)
    t = stats.t.ppf((1 + CONFIDENCE) / 2, n - 1)
    critical = t / np.sqrt(n - 1 + t**2)

    median = np.median(means, axis=1)
    significant = (scores > critical).sum(axis=1)
    largest = np.abs(scores).max(axis=1)
    low, high = np.quantile(
        np.sort(means, axis=1), [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2], axis=0
    )
    return Joint(
        median=float(median[0]),
        p_median=float((np.abs(median) >= np.abs(median[0]) - ROUNDING * size.max()).mean()),
        significant=int(significant[0]),
        p_significant=float((significant >= significant[0]).mean()),
        p_familywise=(largest[:, None] >= np.abs(scores[0]) - ROUNDING).mean(axis=0),
        null_low=low,
        null_high=high,
    )
