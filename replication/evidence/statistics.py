"""Statistics of trials: intervals, tests, equivalence, and consistency with published numbers.

All methods share their seeds, so comparisons are paired by trial. Intervals are 95 %. A trial that
ended at the iteration cap has no count: if there is one, means are not computed and a comparison is
not testable.

An interval and the test beside it are about the same number: the mean of the differences (Student's
t; sign flips), or the ratio of the SDs (delta method; swaps within pairs). No interval draws random
numbers. A test of more than 12 trials does, so many that its p-value has a standard error of 0.0007
at 0.05 and of at most 0.0016. One file because an interval is read with its test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import optimize, stats

Array = NDArray[np.float64]

CONFIDENCE = 0.95

FLIPS = 99_999
"""Random patterns of a permutation test; all patterns are tried where they are fewer."""

EXACT = 12
"""Most trials of which all 2^n patterns are tried."""

FLIP_SEED = 95  # any fixed number: p-values must not change between runs
BLOCK = 4_000_000  # entries of a block of patterns, 32 MB: memory does not grow with the trials

ROUNDING = 1e-12
"""Statistics that differ by less, relative to the largest possible, are tied."""


# --- summaries and comparisons -------------------------------------------------------------------


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
    difference, low, high, p
        Mean of x - y with its interval, and the test that it is zero: :func:`mean_interval`,
        :func:`sign_flip_p`.
    fewer
        Probability that a trial of x needs fewer iterations than one of y, ties counting half.
    sd_ratio, sd_low, sd_high, p_spread
        SD of x over SD of y with its interval, and the test that it is one:
        :func:`sd_ratio_interval`, :func:`spread_p`. NaN where either is constant.
    """

    difference: float
    low: float
    high: float
    p: float
    fewer: float
    sd_ratio: float
    sd_low: float
    sd_high: float
    p_spread: float
    n: int


def summarise(iterations: ArrayLike, converged: ArrayLike) -> Summary:
    """Summarise the iterations of one condition, [trial], and whether each trial converged."""
    counts, done = np.asarray(iterations, dtype=float), np.asarray(converged, dtype=bool)
    quartiles = np.quantile(counts, [0.5, 0.25, 0.75])
    moments = np.full(4, np.nan)
    if done.all():
        moments = np.array([counts.mean(), *mean_interval(counts), counts.std(ddof=1)])
    return Summary(len(counts), int((~done).sum()), *map(float, moments), *map(float, quartiles))


def compare(x: ArrayLike, y: ArrayLike, *, capped: bool = False) -> Comparison:
    """Compare iteration counts `x` and `y` over the same seeds, both [trial].

    If any trial ended at the cap (`capped`), every statistic is NaN.
    """
    a, b = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if capped:
        return Comparison(*(np.nan,) * 9, n=len(a))
    low, high = mean_interval(a - b)
    ratio, ratio_low, ratio_high = sd_ratio_interval(a, b)
    return Comparison(
        difference=float((a - b).mean()),
        low=float(low),
        high=float(high),
        p=sign_flip_p(a - b),
        fewer=float((a[:, None] < b).mean() + 0.5 * (a[:, None] == b).mean()),
        sd_ratio=float(ratio),
        sd_low=float(ratio_low),
        sd_high=float(ratio_high),
        p_spread=spread_p(a, b),
        n=len(a),
    )


# --- means ---------------------------------------------------------------------------------------


def mean_interval(d: Array, *, confidence: float = CONFIDENCE) -> tuple[Array, Array]:
    """Return Student's t interval of the mean along the last axis of `d`, [..., trial].

    A constant sample is its own interval.
    """
    n = d.shape[-1]
    half = stats.t.ppf((1 + confidence) / 2, n - 1) * d.std(axis=-1, ddof=1) / np.sqrt(n)
    # A sum of equal numbers is rounded, so that their mean need not be one of them.
    flat, mean = np.ptp(d, axis=-1) == 0, d.mean(axis=-1)
    return np.where(flat, d[..., 0], mean - half), np.where(flat, d[..., 0], mean + half)


def sign_flip_p(d: Array) -> float:
    """Return the two-sided p-value that the mean of the paired differences `d`, [trial], is zero.

    The sign-flip permutation test (Fisher 1935): exact if the differences are symmetric about zero,
    and for large samples whenever their mean is zero. Flips keep the sum of squares, so Student's t
    in place of the mean would give the same. A difference of zero has no sign and changes nothing.
    """
    d = d[d != 0]
    if d.size == 0:
        return 1.0
    if d.sum() < 0:
        d = -d  # to the last digit, y against x is as x against y
    total, largest = d.sum(), np.abs(d).sum()
    return _permutation_p(d[:, None], lambda flipped: np.abs(total - 2 * flipped[:, 0]) / largest)


def standard_errors(low: Array, high: Array, freedom: ArrayLike = np.inf) -> Array:
    """Return the standard errors of estimates from their intervals, by t with that `freedom`."""
    return (high - low) / (2 * stats.t.ppf((1 + CONFIDENCE) / 2, freedom))


# --- spread --------------------------------------------------------------------------------------


def log_sd_ratio(x: Array, y: Array) -> tuple[Array, Array]:
    """Return log(SD x / SD y) of paired samples, [..., trial], and its standard error.

    By the delta method: a pair's influence on the logarithm is half the difference of its squared
    standard scores (Hampel 1974), so that pairs may be correlated and need not be normal. A few
    trials do not tell it: of two the standard error is zero. NaN where either is constant.
    """
    flat = (np.ptp(x, axis=-1) == 0) | (np.ptp(y, axis=-1) == 0)
    squares = [(s - s.mean(axis=-1, keepdims=True)) ** 2 for s in (x, y)]
    a, b = (np.where(flat, np.nan, s.var(axis=-1, ddof=1)) for s in (x, y))
    influence = (squares[0] / a[..., None] - squares[1] / b[..., None]) / 2
    return np.log(a / b) / 2, influence.std(axis=-1, ddof=1) / np.sqrt(x.shape[-1])


def sd_ratio_interval(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return SD x over SD y of paired samples, [..., trial], with its interval.

    Normal for the logarithm, see :func:`log_sd_ratio`: for large samples. Of 100 skewed pairs it
    covers in about 93 cases of 100. NaN where either is constant.
    """
    log, se = log_sd_ratio(x, y)
    half = _normal() * se
    return np.exp(log), np.exp(log - half), np.exp(log + half)


def spread_p(x: Array, y: Array) -> float:
    """Return the two-sided p-value that paired samples, [trial], have the same SD.

    A permutation test (Pitman 1937): after both are centred, the values of a pair are swapped at
    random. Exact, but for the centring, if the values of a pair are then exchangeable; for large
    samples the level is near 5 % also where shapes differ. NaN where either is constant.
    """
    if np.ptp(x) == 0 or np.ptp(y) == 0:
        return float("nan")
    if x.std() < y.std():
        x, y = y, x  # to the last digit, y against x is as x against y
    # Medians, as in Brown and Forsythe (1974): with means, small skewed samples reject too often.
    a, b = x - np.median(x), y - np.median(y)
    differ = a != b
    moved = np.stack([b - a, b**2 - a**2], axis=1)[differ]
    n, sum_a, sum_b, squares_a, squares_b = len(a), a.sum(), b.sum(), a @ a, b @ b

    def statistic(swapped: Array) -> Array:
        """Return |A - B| / (A + B) of the sums of squares, which rises with |log(A / B)|."""
        sums, squares = swapped.T
        one = squares_a + squares - (sum_a + sums) ** 2 / n
        other = squares_b - squares - (sum_b - sums) ** 2 / n
        # Swaps may leave nothing of both, which is equal.
        return np.abs(one - other) / np.maximum(one + other, ROUNDING * (squares_a + squares_b))

    return _permutation_p(moved, statistic)


# --- permutations --------------------------------------------------------------------------------


def patterns(n: int, random: int = FLIPS) -> Iterator[Array]:
    """Yield which of `n` signs or pairs to flip, in blocks [pattern, n] of zeros and ones.

    All 2^n patterns if `n` is at most EXACT; otherwise none flipped, and so many `random` ones,
    the same in every run.
    """
    if n <= EXACT:
        yield ((np.arange(2**n)[:, None] >> np.arange(n)) & 1).astype(float)
        return
    yield np.zeros((1, n))
    rng = np.random.default_rng(np.random.SeedSequence(FLIP_SEED))
    most = max(1, BLOCK // n)
    for start in range(0, random, most):
        rows = min(most, random - start)
        drawn = rng.integers(0, 256, (rows, -(-n // 8)), dtype=np.uint8)
        yield np.unpackbits(drawn, axis=1, count=n).astype(float)


def _permutation_p(moved: Array, statistic: Callable[[Array], Array]) -> float:
    """Return the share of patterns whose statistic is at least that of the trials as they are.

    The trials as they are count as a pattern, too, so that a random p-value is never too small:
    (1 + count) / (1 + FLIPS) (Phipson and Smyth 2010).

    Parameters
    ----------
    moved
        What a flip of each trial adds to some sums, [trial, sum].
    statistic
        Of what is added to the sums, [pattern, sum]: values from 0 to 1, [pattern].
    """
    moved = moved[np.lexsort(moved.T)]  # the order of the trials must not matter
    values = np.concatenate([statistic(flips @ moved) for flips in patterns(len(moved))])
    return float((values >= values[0] - ROUNDING).mean())


# --- equivalence ---------------------------------------------------------------------------------


def equivalence_p(d: Array, margin: float) -> float:
    """Return the p-value against a mean of `d`, [trial], at or beyond plus or minus `margin`.

    Two one-sided t-tests, the larger p (Schuirmann 1987). Where it is small, there is practically
    no difference.
    """
    return max(_positive_p(d + margin), _positive_p(margin - d))


def relative_equivalence_p(x: Array, y: Array, fraction: float) -> float:
    """Return the p-value against mean x / mean y at or beyond 1 - `fraction` or 1 + `fraction`.

    Two one-sided t-tests of the linear contrasts of paired samples, [trial], the larger p
    (Sasabuchi 1980; Berger and Hsu 1996). Both contrasts can be positive only if mean y is.
    """
    return max(_positive_p(x - (1 - fraction) * y), _positive_p((1 + fraction) * y - x))


def spread_equivalence_p(x: Array, y: Array, margin: float) -> float:
    """Return the p-value against SD x / SD y at or beyond `margin` or its inverse.

    Two one-sided normal tests of the log ratio, the larger p; see :func:`log_sd_ratio`. NaN where
    either is constant.
    """
    log, se = map(float, log_sd_ratio(x, y))
    inside = np.log(margin) - abs(log)
    if se == 0:
        return float(inside <= 0)
    return float(stats.norm.sf(inside / se))


def _positive_p(d: Array) -> float:
    """Return the one-sided p-value of Student's t-test that the mean is above zero."""
    if np.ptp(d) == 0:
        return float(d[0] <= 0)
    n = len(d)
    return float(stats.t.sf(d.mean() / (d.std(ddof=1) / np.sqrt(n)), n - 1))


# --- consistency with published numbers ----------------------------------------------------------


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


def run_p(counts: ArrayLike, run: float) -> float:
    """Return the two-sided probability of a trial at least as extreme as a published single `run`.

    By its rank among our `counts`, [trial], itself included: exact if all are exchangeable.

    Examples
    --------
    >>> run_p(range(39), 50), run_p(range(39), 19)
    (0.05, 1.0)
    """
    own = np.asarray(counts, dtype=float)
    tail = 1 + min((own <= run).sum(), (own >= run).sum())
    return float(min(1.0, 2 * tail / (len(own) + 1)))


def effect_prediction(effect: float, se_paper: float, se_ours: float) -> tuple[float, float]:
    """Return where our estimate should lie, given a published `effect` and both standard errors.

    The prediction interval of a replication (Patil, Peng and Leek 2016); normal.
    """
    half = _normal() * np.hypot(se_paper, se_ours)
    return float(effect - half), float(effect + half)


def published_difference_se(sd_1: float, n_1: int, sd_2: float, n_2: int) -> float:
    """Return the standard error of a published difference of means.

    The paper does not say whether its runs are paired; they are taken as independent.
    """
    return float(np.sqrt(sd_1**2 / n_1 + sd_2**2 / n_2))


def published_log_sd_ratio_se(n_1: int, n_2: int) -> float:
    """Return the standard error of the log of a published ratio of SDs: normal, independent."""
    return float(np.sqrt(1 / (2 * (n_1 - 1)) + 1 / (2 * (n_2 - 1))))


def _detectable() -> float:
    """Return the effect, in standard errors, that a two-sided test at 5 % finds once in three."""
    critical = _normal()

    def power(effect: float) -> float:
        return float(stats.norm.cdf(effect - critical) + stats.norm.cdf(-effect - critical))

    return float(optimize.brentq(lambda effect: power(effect) - 1 / 3, 0.0, 2 * critical))


def detectable(se: float) -> float:
    """Return the effect that a study whose estimate has this standard error finds once in three.

    That is with power 1/3 in a two-sided test at 5 %, by the normal approximation. What is smaller,
    such a study could not have found (Simonsohn 2015, small telescopes).

    Examples
    --------
    Of two groups of 100, in SDs:

    >>> round(detectable((2 / 100) ** 0.5), 3)
    0.216
    """
    return DETECTABLE * se


# --- shares and several tests --------------------------------------------------------------------


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
    """Return p-values adjusted by Holm's method (1979) for making several comparisons.

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


def _normal() -> float:
    return float(stats.norm.ppf((1 + CONFIDENCE) / 2))


DETECTABLE = _detectable()
"""The effect, in standard errors, that :func:`detectable` scales: 1.53."""
