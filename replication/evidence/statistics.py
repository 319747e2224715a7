"""Statistics of trials: summaries, paired comparisons, intervals and predictions.

All methods share their seeds, so comparisons are paired by trial. Intervals are 95 %. A trial that
ended at the iteration cap has no count: if there is one, means are not computed and a comparison is
not testable.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

Array = NDArray[np.float64]

CONFIDENCE = 0.95
RESAMPLES = 9999
RESAMPLES_OF_MANY = 1999
BOOTSTRAP_SEED = 95  # any fixed number: intervals must not change between runs

FEWEST = 30
"""Trials below which a ratio of SDs gets no interval."""


@dataclass(frozen=True)
class Summary:
    """Iterations of one condition; mean, SD and the mean's interval are NaN if any are capped."""

    n: int
    capped: int
    mean: float
    low: float
    high: float
    sd: float
    median: float
    quartile_1: float
    quartile_3: float


@dataclass(frozen=True)
class Comparison:
    """Iterations of `x` against those of `y`, trial by trial.

    Attributes
    ----------
    difference, low, high
        Mean of x - y with its BCa bootstrap interval.
    fewer
        Probability that a trial of x needs fewer iterations than one of y, ties counting half.
    p_welch, p_wilcoxon
        Two-sided p-values of Welch's t-test and of the paired signed-rank test.
    sd_ratio, sd_low, sd_high
        SD of x over SD of y with its BCa bootstrap interval, trials resampled in pairs.
    p_spread
        P-value of the Brown-Forsythe test of equal spread (which takes samples as independent).
    power
        Probability that a t-test at 5 % would find a true difference as large as the published
        one between samples that spread as ours do, taken as independent, since pairs that hardly
        differ say nothing about pairs that would; NaN where none is published.
    """

    difference: float
    low: float
    high: float
    fewer: float
    p_welch: float
    p_wilcoxon: float
    sd_ratio: float
    sd_low: float
    sd_high: float
    p_spread: float
    power: float
    n: int


def summarise(iterations: ArrayLike, converged: ArrayLike) -> Summary:
    """Summarise the iterations of one condition, [trial], and whether each trial converged."""
    counts, done = np.asarray(iterations, dtype=float), np.asarray(converged, dtype=bool)
    quartiles = np.quantile(counts, [0.5, 0.25, 0.75])
    if done.all():
        mean, sd = counts.mean(), counts.std(ddof=1)
        half = stats.t.ppf((1 + CONFIDENCE) / 2, len(counts) - 1) * sd / np.sqrt(len(counts))
        moments = (mean, mean - half, mean + half, sd)
    else:
        moments = (np.nan,) * 4
    return Summary(len(counts), int((~done).sum()), *map(float, moments), *map(float, quartiles))


def compare(
    x: ArrayLike, y: ArrayLike, *, capped: bool = False, published: float = np.nan
) -> Comparison:
    """Compare paired iteration counts `x` and `y`, both [trial].

    Parameters
    ----------
    x, y
        Iterations over the same seeds.
    capped
        Whether any trial ended at the cap; then every statistic is NaN.
    published
        The paper's own difference of means, for the power.
    """
    a, b = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if capped:
        return Comparison(*(np.nan,) * 11, n=len(a))
    low, high = mean_interval(a - b)
    equal = bool((a == b).all())
    flat = a.std() == 0 or b.std() == 0
    sd_bounds: Any = (np.nan, np.nan)
    if not flat and len(a) >= FEWEST:
        sd_bounds = _bootstrap((a, b), _sd_ratio, RESAMPLES, rounding=1e-12)
    moments = [moment for s in (a, b) for moment in (s.mean(), s.std(ddof=1), len(s))]
    with np.errstate(divide="ignore", invalid="ignore"):  # samples that do not spread
        welch = stats.ttest_ind_from_stats(*moments, equal_var=False).pvalue
        spread = stats.levene(a, b, center="median").pvalue
    return Comparison(
        difference=float((a - b).mean()),
        low=low,
        high=high,
        fewer=float((a[:, None] < b).mean() + 0.5 * (a[:, None] == b).mean()),
        p_welch=1.0 if equal else float(welch),
        p_wilcoxon=1.0 if equal else float(stats.wilcoxon(a, b).pvalue),
        sd_ratio=np.nan if flat else float(_sd_ratio(a, b)),
        sd_low=float(sd_bounds[0]),
        sd_high=float(sd_bounds[1]),
        p_spread=np.nan if flat else float(spread),
        power=power(float(np.hypot(a.std(ddof=1), b.std(ddof=1))), len(a), published),
        n=len(a),
    )


def mean_interval(differences: Array) -> tuple[float, float]:
    """Return the BCa bootstrap interval of a mean; a constant sample is its own interval."""
    if np.ptp(differences) == 0:
        return float(differences[0]), float(differences[0])
    low, high = _bootstrap((differences,), np.mean, RESAMPLES)
    return float(low), float(high)


def mean_intervals(samples: Array) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the BCa intervals of many means at once: bounds [sample] of values [sample, trial]."""
    return _bootstrap((samples,), np.mean, RESAMPLES_OF_MANY)


def sd_ratio_intervals(x: Array, y: Array) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return many ratios of SDs at once, with their BCa intervals; NaN where either is constant."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = _sd_ratio(x, y)
    low, high = _bootstrap((x, y), _sd_ratio, RESAMPLES_OF_MANY)
    bounds = np.array([ratio, low, high])
    bounds[:, ~np.isfinite(bounds).all(axis=0) | (ratio == 0)] = np.nan
    return bounds[0], bounds[1], bounds[2]


def standard_errors(low: Array, high: Array) -> Array:
    """Return the standard errors that intervals imply, if estimates are about normal."""
    return (high - low) / (2 * _normal())


def _sd_ratio(a: Array, b: Array, axis: int = -1) -> Array:
    return np.std(a, axis=axis, ddof=1) / np.std(b, axis=axis, ddof=1)


def _bootstrap(
    samples: tuple[Array, ...],
    statistic: Callable[..., Any],
    resamples: int,
    *,
    rounding: float = 0.0,
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the BCa interval of a statistic along the last axis, trials resampled together.

    A statistic that no resample changes, by more than the relative error `rounding`, is its own
    interval.
    """
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)
        result = stats.bootstrap(
            samples,
            statistic,
            axis=-1,
            paired=True,
            vectorized=True,
            confidence_level=CONFIDENCE,
            n_resamples=resamples,
            method="BCa",
            rng=np.random.default_rng(np.random.SeedSequence(BOOTSTRAP_SEED)),
        )
        estimate = statistic(*samples, axis=-1)
        resampled = result.bootstrap_distribution
        flat = np.ptp(resampled, axis=-1) <= rounding * np.abs(resampled[..., 0])
    interval = result.confidence_interval
    return np.where(flat, estimate, interval.low), np.where(flat, estimate, interval.high)


def power(sd: float, n: int, effect: float) -> float:
    """Return the power of a two-sided t-test at 5 % of `n` differences that spread by `sd`.

    `effect` is the true mean difference.
    """
    if not np.isfinite(effect) or sd == 0:
        return float("nan")
    critical = stats.t.ppf((1 + CONFIDENCE) / 2, n - 1)
    shift = abs(effect) / sd * np.sqrt(n)
    wrong_side = stats.nct.cdf(-critical, n - 1, shift)  # SciPy's NaN where it vanishes
    return float(stats.nct.sf(critical, n - 1, shift) + np.nan_to_num(wrong_side))


def mean_prediction(mean: float, sd: float, n: int, m: int) -> tuple[float, float]:
    """Return where the mean of `m` new trials should lie, given `n` with this mean and SD."""
    half = stats.t.ppf((1 + CONFIDENCE) / 2, n - 1) * sd * np.sqrt(1 / n + 1 / m)
    return float(mean - half), float(mean + half)


def sd_prediction(sd: float, n: int, sample: Array) -> tuple[float, float]:
    """Return where the SD of `sample` should lie, given the SD of `n` trials before.

    The logarithm of an SD is taken as normal, with the variance (kurtosis - 1) / (4 n) that it has
    for large samples, and both samples with the kurtosis of `sample`.
    """
    half = _normal() * np.sqrt(_log_sd_variance(sample) * (1 + len(sample) / n))
    return float(sd * np.exp(-half)), float(sd * np.exp(half))


def sd_interval(sample: Array) -> tuple[float, float]:
    """Return the interval of an SD, by the same approximation as :func:`sd_prediction`."""
    sd, half = sample.std(ddof=1), _normal() * np.sqrt(_log_sd_variance(sample))
    return float(sd * np.exp(-half)), float(sd * np.exp(half))


def _log_sd_variance(sample: Array) -> float:
    if np.ptp(sample) == 0:
        return float("nan")
    return float((stats.kurtosis(sample, fisher=False) - 1) / (4 * len(sample)))


def _normal() -> float:
    return float(stats.norm.ppf((1 + CONFIDENCE) / 2))


def share_interval(k: int, n: int) -> tuple[float, float]:
    """Return the Clopper-Pearson interval of a share, `k` of `n`.

    Examples
    --------
    >>> [round(x, 3) for x in share_interval(100, 100)]
    [0.964, 1.0]
    """
    interval = stats.binomtest(k, n).proportion_ci(CONFIDENCE)
    return float(interval.low), float(interval.high)


def holm(p_values: Sequence[float]) -> Array:
    """Return p-values adjusted by Holm's method for making several comparisons.

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03]).tolist()
    [0.03, 0.06, 0.06]
    """
    p = np.asarray(p_values, dtype=float)
    order = np.argsort(p)
    scaled = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(scaled, 1.0)
    return adjusted
