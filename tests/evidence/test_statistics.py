from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from replication.evidence import statistics
from replication.evidence.statistics import (
    DETECTABLE,
    EXACT,
    compare,
    detectable,
    effect_prediction,
    equivalence_p,
    holm,
    log_sd_ratio,
    mean_interval,
    mean_prediction,
    patterns,
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
    summarise,
)

Array = NDArray[np.float64]

COUNTS = st.lists(st.integers(0, 300), min_size=2, max_size=12)
NAN = float("nan")


# --- summaries -------------------------------------------------------------------------------


def test_summary_by_hand() -> None:
    """Mean 3, SD sqrt(2.5) and the interval 3 -+ t sd / sqrt(5), t(.975, 4) = 2.7764 by a table."""
    found = summarise([1, 2, 3, 4, 5], [True] * 5)
    assert (found.n, found.capped, found.mean, found.median) == (5, 0, 3.0, 3.0)
    assert (found.quartile_1, found.quartile_3) == (2.0, 4.0)
    assert found.sd == pytest.approx(2.5**0.5)
    assert found.low == pytest.approx(3 - 2.7764 * 0.5**0.5, abs=1e-4)
    assert found.high == pytest.approx(3 + 2.7764 * 0.5**0.5, abs=1e-4)


def test_capped_trials_are_never_averaged() -> None:
    """With one trial at the cap there is no mean and no comparison; quartiles stay."""
    found = summarise([1, 2, 3, 4, 300], [True, True, True, True, False])
    assert (found.n, found.capped) == (5, 1)
    assert np.isnan([found.mean, found.low, found.high, found.sd]).all()
    assert (found.quartile_1, found.median, found.quartile_3) == (2.0, 3.0, 4.0)
    compared = compare([1, 2, 300], [4, 5, 6], capped=True)
    assert np.isnan(astuple(compared)[:-1]).all()
    assert compared.n == 3


# --- comparisons -----------------------------------------------------------------------------


def test_comparison_by_hand() -> None:
    """Small samples worked out on paper: differences, flips, pairs of trials, ratio of SDs."""
    x, y = np.array([1.0, 2, 3, 6]), np.array([2.0, 4, 6, 8])
    found = compare(x, y)
    assert found.difference == -2.0
    # All four differences have one sign: two of 2**4 assignments of signs are as extreme.
    assert found.p == 2 / 16
    # Of 16 pairs, x is the smaller in 4 + 3 + 3 + 1 and equal in 0 + 1 + 0 + 1.
    assert found.fewer == (11 + 0.5 * 2) / 16
    assert found.sd_ratio == pytest.approx((14 / 3) ** 0.5 / (20 / 3) ** 0.5)
    assert [found.low, found.high] == [*mean_interval(x - y)]
    assert [found.sd_ratio, found.sd_low, found.sd_high] == [*sd_ratio_interval(x, y)]
    assert (found.p_spread, found.n) == (spread_p(x, y), 4)


@given(COUNTS)
@settings(deadline=None, max_examples=8)
def test_a_sample_does_not_differ_from_itself(x: list[int]) -> None:
    """Against itself a condition differs by 0, is fewer in half the pairs, and no test rejects."""
    found = compare(x, x)
    assert (found.difference, found.low, found.high, found.fewer) == (0.0, 0.0, 0.0, 0.5)
    assert found.p == 1.0
    assert found.p_spread == 1.0 or len(set(x)) == 1


@given(st.lists(st.tuples(st.integers(0, 300), st.integers(0, 300)), min_size=2, max_size=12))
@settings(deadline=None, max_examples=8)
def test_exchange_of_the_samples(pairs: list[tuple[int, int]]) -> None:
    """Exchanged samples have opposite differences and inverse ratios, and the same p-values."""
    x, y = zip(*pairs, strict=True)
    one, other = compare(x, y), compare(y, x)
    assert one.difference == -other.difference
    assert (one.low, one.high) == pytest.approx((-other.high, -other.low))
    assert one.fewer == pytest.approx(1 - other.fewer)
    assert (one.p, one.p_spread) == pytest.approx((other.p, other.p_spread), nan_ok=True)
    inverse = np.array([other.sd_ratio, other.sd_high, other.sd_low]) ** -1
    assert [one.sd_ratio, one.sd_low, one.sd_high] == pytest.approx(inverse, nan_ok=True)
    assert one.low <= one.difference <= one.high


def test_samples_that_do_not_spread() -> None:
    """Constant samples have no spread to compare, and a constant difference is its interval."""
    found = compare([3, 3, 3], [4, 4, 4])
    assert (found.difference, found.low, found.high, found.fewer) == (-1.0, -1.0, -1.0, 1.0)
    assert np.isnan([found.sd_ratio, found.sd_low, found.sd_high, found.p_spread]).all()
    assert found.p == 2 / 8


# --- means -----------------------------------------------------------------------------------


@pytest.mark.parametrize("confidence", [0.9, 0.95])
def test_intervals_of_means_are_those_of_scipy(confidence: float) -> None:
    """Along the last axis, as SciPy's of each sample."""
    samples = np.random.default_rng(1).exponential(3.0, (2, 3, 12))
    low, high = mean_interval(samples, confidence=confidence)
    expected = stats.ttest_1samp(samples, 0.0, axis=-1).confidence_interval(confidence)
    np.testing.assert_allclose((low, high), (expected.low, expected.high))
    np.testing.assert_allclose(
        mean_interval(samples[1, 2], confidence=confidence), (low[1, 2], high[1, 2])
    )


@pytest.mark.parametrize("values", [[0.0, 3.0, -7.1], [0.3, -0.3, 1 / 3]])
def test_constant_rows_are_their_own_intervals(values: list[float]) -> None:
    """A row that does not vary has its value as both bounds, whatever the other rows do."""
    flat = np.repeat(np.array(values)[:, None], 10, axis=1)
    noise = np.random.default_rng(6).normal(size=(1, 10))
    low, high = mean_interval(np.concatenate([flat, noise]))
    assert low[:3].tolist() == high[:3].tolist() == values
    assert low[3] < noise.mean() < high[3]


@given(st.lists(st.integers(-30, 30), min_size=2, max_size=9), st.sampled_from([1.0, 0.1, 1 / 3]))
@settings(deadline=None, max_examples=40)
def test_sign_flips_are_those_of_scipy(values: list[int], unit: float) -> None:
    """The exact p-value is that of SciPy for whole numbers, and the same in any unit."""
    d = np.array(values, dtype=float)
    expected = stats.permutation_test(
        (d,), np.mean, permutation_type="samples", n_resamples=np.inf, vectorized=True
    )
    assert sign_flip_p(d) == pytest.approx(expected.pvalue)
    assert sign_flip_p(unit * d) == sign_flip_p(d)


def test_sign_flips_by_hand() -> None:
    """Of 1, 2, 4 the sum 7 is the largest of 2^3; sums that tie but for rounding count as ties."""
    assert sign_flip_p(np.array([1.0, 2, 4])) == 2 / 8
    assert sign_flip_p(np.array([-1.0, 2, 4])) == 4 / 8
    assert sign_flip_p(np.array([0.1, 0.2, -0.3])) == 1.0
    assert sign_flip_p(np.zeros(5)) == sign_flip_p(np.zeros(50)) == 1.0


def test_zeros_do_not_matter() -> None:
    """A difference of zero is the same under each flip, so that few others stay exact."""
    d = np.array([1.0, 2, 4])
    assert sign_flip_p(np.concatenate([d, np.zeros(100)])) == sign_flip_p(d)


def test_random_flips_are_near_the_exact_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """With random patterns in place of all, p-values move by four standard errors at most."""
    rng = np.random.default_rng(2)
    d, x, y = rng.normal(0.4, 1, EXACT), rng.normal(0, 1, EXACT), rng.normal(0, 2, EXACT)
    exact = sign_flip_p(d), spread_p(x, y)
    monkeypatch.setattr(statistics, "EXACT", 0)
    assert (sign_flip_p(d), spread_p(x, y)) == pytest.approx(exact, abs=0.006)
    assert (sign_flip_p(d), spread_p(x, y)) != exact


def test_p_values_do_not_depend_on_the_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are the same in every run, and another seed moves none by 0.005."""
    rng = np.random.default_rng(3)
    samples = [(rng.normal(0, 1, 60), rng.normal(shift, 1 + shift, 60)) for shift in (0.2, 0.4)]
    pairs = [(sign_flip_p(x - y), spread_p(x, y)) for x, y in samples]
    assert [(sign_flip_p(x - y), spread_p(x, y)) for x, y in samples] == pairs
    monkeypatch.setattr(statistics, "FLIP_SEED", 1)
    others = [(sign_flip_p(x - y), spread_p(x, y)) for x, y in samples]
    assert others != pairs
    np.testing.assert_allclose(others, pairs, atol=0.005)


def test_random_p_values_do_not_depend_on_order() -> None:
    """The trials may be numbered in another way, and the samples exchanged."""
    rng = np.random.default_rng(17)
    x, y = rng.integers(0, 20, (2, 60)).astype(float)
    order = rng.permutation(60)
    expected = sign_flip_p(x - y), spread_p(x, y)
    assert (sign_flip_p((x - y)[order]), spread_p(x[order], y[order])) == expected
    assert (sign_flip_p(y - x), spread_p(y, x)) == expected


def test_random_p_values_are_never_zero() -> None:
    """The trials as they are count as one of the patterns."""
    assert sign_flip_p(np.arange(1.0, 200)) == 1 / (1 + statistics.FLIPS)


def test_sign_flips_agree_with_t_for_a_large_sample() -> None:
    """For 1,000 normal differences the p-value is that of Student's t."""
    d = np.random.default_rng(4).normal(0.06, 1, 1000)
    assert sign_flip_p(d) == pytest.approx(stats.ttest_1samp(d, 0).pvalue, abs=0.005)


def test_patterns() -> None:
    """Few are all different; many come in blocks, first the one without a flip, half flipped."""
    (every,) = patterns(3)
    assert {tuple(row) for row in every} == set(product((0.0, 1.0), repeat=3))
    assert not every[0].any()
    n = 2 * EXACT + 1
    blocks = list(patterns(n))
    assert max(map(np.size, blocks)) <= statistics.BLOCK
    every = np.concatenate(blocks)
    assert every.shape == (1 + statistics.FLIPS, n)
    assert not every[0].any()
    assert every.mean(axis=0) == pytest.approx(0.5, abs=0.01)
    assert np.abs(np.corrcoef(every.T) - np.eye(n)).max() < 0.02


def test_level_of_the_sign_flips() -> None:
    """Without a difference on average, 5 % of skewed samples are rejected, give or take."""
    d = np.random.default_rng(5).exponential(1.0, (1000, EXACT)) - 1
    own = d - np.random.default_rng(6).exponential(1.0, (1000, EXACT)) + 1
    assert np.mean([sign_flip_p(row) <= 0.05 for row in own]) == pytest.approx(0.05, abs=0.025)


@pytest.mark.parametrize("n", [2, 30])
def test_standard_errors_are_those_of_the_intervals(n: int) -> None:
    """From an interval by t or by the normal distribution follows its standard error."""
    sample = np.random.default_rng(7).normal(size=(3, n))
    expected = sample.std(axis=1, ddof=1) / n**0.5
    assert standard_errors(*mean_interval(sample), n - 1) == pytest.approx(expected)
    s = np.array([0.5, 2.0])
    assert standard_errors(3 - 1.959964 * s, 3 + 1.959964 * s) == pytest.approx(s)


@pytest.mark.parametrize(("n", "m"), [(5, 100), (100, 100), (30, 5)])
def test_mean_prediction_by_simulation(n: int, m: int) -> None:
    """The mean of m new trials lies in the interval in 95 of 100 replications."""
    rng = np.random.default_rng(7)
    first = rng.normal(40.0, 8.0, (10_000, n))
    means = rng.normal(40.0, 8.0 / m**0.5, 10_000)
    moments = zip(first.mean(axis=1), first.std(axis=1, ddof=1), strict=True)
    bounds = np.array([mean_prediction(mean, sd, n, m) for mean, sd in moments])
    inside = (bounds[:, 0] <= means) & (means <= bounds[:, 1])
    assert inside.mean() == pytest.approx(0.95, abs=0.009)  # four standard errors


def test_mean_prediction_of_the_paper() -> None:
    """For Table I's 36.48 (3.58), 100 against 100: 36.48 -+ 1.9842 x 3.58 x sqrt(2 / 100)."""
    low, high = mean_prediction(36.48, 3.58, 100, 100)
    assert (low, high) == pytest.approx((36.48 - 1.00458, 36.48 + 1.00458), abs=1e-4)


# --- predictions and intervals of SDs and shares ---------------------------------------------

DRAWS = {
    "normal": lambda rng, shape: rng.normal(40.0, 5.0, shape),
    "uniform": lambda rng, shape: rng.uniform(0.0, 1.0, shape),
    "counts": lambda rng, shape: rng.poisson(6.0, shape).astype(float),
}


@pytest.mark.parametrize("shape", list(DRAWS))
def test_sd_interval_covers(shape: str) -> None:
    """The interval of an SD holds the true one in about 95 of 100 samples, normal or not."""
    sd = {"normal": 5.0, "uniform": 12**-0.5, "counts": 6**0.5}[shape]
    samples = DRAWS[shape](np.random.default_rng(1), (800, 100))
    bounds = np.array([sd_interval(sample) for sample in samples])
    inside = (bounds[:, 0] <= sd) & (sd <= bounds[:, 1])
    assert inside.mean() == pytest.approx(0.95, abs=0.025)


@pytest.mark.parametrize(("shape", "n", "m"), [("normal", 100, 60), ("uniform", 60, 100)])
def test_sd_prediction_covers(shape: str, n: int, m: int) -> None:
    """The SD of a sample like the published one lies within in 92 to 98 of 100 replications."""
    rng = np.random.default_rng(2)
    published = DRAWS[shape](rng, (800, n)).std(axis=1, ddof=1)
    ours = DRAWS[shape](rng, (800, m))
    inside = [
        low <= own.std(ddof=1) <= high
        for sd, own in zip(published, ours, strict=True)
        for low, high in [sd_prediction(sd, n, own)]
    ]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.035)


def test_sd_prediction_by_hand() -> None:
    """Of two equal halves (kurtosis 1) the SD is certain, of a constant unknown; scale is free."""
    halves = np.array([0.0, 1.0] * 20)
    assert sd_prediction(4.73, 100, halves) == pytest.approx((4.73, 4.73))
    sample = np.array([0.0, 1.0, 2.0, 3.0])  # kurtosis 1.64, so that the variance is .64 / 16
    half = 1.959964 * (0.04 * (1 + 4 / 100)) ** 0.5
    expected = 4.73 * np.exp(-half), 4.73 * np.exp(half)
    assert sd_prediction(4.73, 100, sample) == pytest.approx(expected)
    assert sd_prediction(4.73, 100, 40 + 3 * sample) == pytest.approx(expected)
    low, high = sd_interval(sample)
    assert low * high == pytest.approx(sample.var(ddof=1))
    assert np.log(high / low) == pytest.approx(2 * 1.959964 * 0.2)
    flat = np.ones(40)
    assert np.isnan([sd_interval(flat), sd_prediction(5.0, 100, flat)]).all()


@pytest.mark.parametrize(
    ("k", "n", "low", "high"),
    [(0, 10, 0.0, 0.3085), (10, 10, 0.6915, 1.0), (5, 10, 0.1871, 0.8129), (1, 20, 0.0013, 0.2487)],
)
def test_share_interval_by_a_table(k: int, n: int, low: float, high: float) -> None:
    """Clopper and Pearson's intervals as they are printed in tables."""
    assert share_interval(k, n) == pytest.approx((low, high), abs=5e-5)


@given(st.integers(1, 60), st.data())
@settings(deadline=None, max_examples=30)
def test_share_interval_inverts_the_binomial_test(n: int, data: st.DataObject) -> None:
    """At its bounds each tail has 2.5 %; shares and their complements mirror each other."""
    k = data.draw(st.integers(0, n))
    low, high = share_interval(k, n)
    assert low <= k / n <= high
    if k > 0:
        assert stats.binom.sf(k - 1, n, low) == pytest.approx(0.025)
    if k < n:
        assert stats.binom.cdf(k, n, high) == pytest.approx(0.025)
    assert share_interval(n - k, n) == pytest.approx((1 - high, 1 - low))


# --- ratios of SDs ---------------------------------------------------------------------------


def skewed_pairs(rng: np.random.Generator, shape: tuple[int, ...]) -> tuple[Array, Array]:
    """Draw correlated samples from gamma distributions, whose SDs are 2 and 4."""
    shared = rng.gamma(2.0, 1.0, shape)
    return shared + rng.gamma(2.0, 1.0, shape), 2 * (shared + rng.gamma(2.0, 1.0, shape))


def test_ratio_of_sds_by_hand() -> None:
    """Of [0, 1, 2, 3] over [0, 0, 2, 2] the ratio is sqrt(5 / 4), its variance worked out."""
    x, y = np.array([0.0, 1, 2, 3]), np.array([0.0, 0, 2, 2])
    # Squared distances 2.25, .25, .25, 2.25 over 5/3 and 1, 1, 1, 1 over 4/3: half the difference
    # is .3, -.3, -.3, .3, with the variance .12.
    log, se = log_sd_ratio(x, y)
    assert (log, se) == pytest.approx((np.log(5 / 4) / 2, (0.12 / 4) ** 0.5))
    expected = 1.25**0.5 * np.exp(1.959964 * np.array([0, -1, 1]) * 0.03**0.5)
    assert sd_ratio_interval(x, y) == pytest.approx(expected)


@pytest.mark.parametrize(("n", "cover"), [(100, 0.93), (1000, 0.95)])
def test_interval_of_a_ratio_of_sds_covers(n: int, cover: float) -> None:
    """It holds the true ratio in 95 of 100 large samples that are skewed and correlated."""
    x, y = skewed_pairs(np.random.default_rng(8), (3000, n))
    _, low, high = sd_ratio_interval(x, y)
    assert ((low <= 0.5) & (high >= 0.5)).mean() == pytest.approx(cover, abs=0.015)
    log, se = log_sd_ratio(x, y)
    assert se.mean() == pytest.approx(log.std(), rel=0.1)


def test_interval_of_a_ratio_knows_the_pairs() -> None:
    """Of samples that are multiples of each other the ratio is certain; in any unit the same."""
    sample = np.random.default_rng(2).normal(40.0, 5.0, 100)
    assert sd_ratio_interval(2 * sample, sample) == pytest.approx((2.0, 2.0, 2.0))
    x, y = skewed_pairs(np.random.default_rng(9), (50,))
    assert sd_ratio_interval(3 * x + 7, 3 * y - 1) == pytest.approx(sd_ratio_interval(x, y))


def test_ratio_to_a_constant_is_missing() -> None:
    """Where either does not vary there is no ratio, interval or test; other rows keep theirs."""
    x, y = np.random.default_rng(7).normal(size=(2, 3, 12))
    y[1] = 4.1
    for found in (np.array(sd_ratio_interval(x, y)), np.array(sd_ratio_interval(y, x))):
        assert np.isnan(found[:, 1]).all()
        assert (np.diff(found[[1, 0, 2]][:, [0, 2]], axis=0) > 0).all()
    assert np.isnan([spread_p(x[1], y[1]), spread_p(y[1], x[1])]).all()
    assert np.isnan(spread_equivalence_p(x[1], y[1], 1.25))


def slow_spread_p(x: Array, y: Array) -> float:
    """Swap the centred values of pairs in every way, and compare the log ratios of the SDs."""
    a, b = x - np.median(x), y - np.median(y)

    def size(swaps: tuple[bool, ...]) -> float:
        one, other = np.where(swaps, b, a), np.where(swaps, a, b)
        if one.var() == other.var() == 0:
            return 0.0
        with np.errstate(divide="ignore"):
            return float(abs(np.log(one.var()) - np.log(other.var())))

    sizes = np.array([size(swaps) for swaps in product((False, True), repeat=len(a))])
    return float((sizes >= sizes[0] - 1e-9).mean())


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 30)), min_size=2, max_size=7))
@example([(0, 1), (1, 0)])
@settings(deadline=None, max_examples=30)
def test_swaps_by_definition(pairs: list[tuple[int, int]]) -> None:
    """The exact p-value is that of all swaps, made one by one."""
    x, y = np.array(pairs, dtype=float).T
    if np.ptp(x) > 0 and np.ptp(y) > 0:
        assert spread_p(x, y) == pytest.approx(slow_spread_p(x, y))


def test_pairs_that_do_not_differ_are_not_swapped() -> None:
    """They count in the SDs, but leave the others few enough to be exact."""
    x, y = np.array([0.0, 9, 1, 7, 3]), np.array([1.0, 2, 0, 1, 2])
    same = np.tile([-4.0, 4.0], 4)
    found = spread_p(np.append(x - 3, same), np.append(y - 1, same))
    assert found == pytest.approx(slow_spread_p(np.append(x - 3, same), np.append(y - 1, same)))
    assert found * 2**5 == int(found * 2**5)
    many = np.tile(same, 30)
    found = spread_p(np.append(x - 3, many), np.append(y - 1, many))
    assert found * 2**5 == int(found * 2**5)


def test_level_and_power_of_the_swaps() -> None:
    """Of skewed pairs with equal SDs about 5 % are rejected, with SDs 1 to 2 nearly all."""
    x, y = skewed_pairs(np.random.default_rng(10), (500, EXACT))
    rejected = [spread_p(a, b / 2) <= 0.05 for a, b in zip(x, y, strict=True)]
    assert np.mean(rejected) == pytest.approx(0.05, abs=0.03)
    x, y = skewed_pairs(np.random.default_rng(11), (10, 100))
    assert max(spread_p(a, b) for a, b in zip(x, y, strict=True)) < 0.005


# --- equivalence -----------------------------------------------------------------------------


def test_equivalence_by_hand() -> None:
    """For [-1, 0, 1, 2] and a margin of 2: t = 1.5 / (1.29099 / 2) with 3 degrees of freedom."""
    d = np.array([-1.0, 0, 1, 2])
    expected = stats.t.sf(1.5 / ((5 / 3) ** 0.5 / 2), 3)
    assert equivalence_p(d, 2.0) == pytest.approx(expected)
    assert equivalence_p(-d, 2.0) == pytest.approx(expected)
    assert equivalence_p(d, 0.5) == pytest.approx(0.5)


@given(st.lists(st.integers(-20, 20), min_size=3, max_size=20), st.floats(0.5, 20))
@settings(deadline=None, max_examples=40)
def test_equivalence_is_an_interval_within_the_margin(values: list[int], margin: float) -> None:
    """P is below 5 % exactly where the 90 % interval lies within the margin (Schuirmann)."""
    d = np.array(values, dtype=float)
    low, high = mean_interval(d, confidence=0.9)
    assert (equivalence_p(d, margin) < 0.05) == (-margin < low and high < margin)


def test_relative_equivalence_by_hand() -> None:
    """The contrasts x - .9 y and 1.1 y - x are tested each, and the worse p counts."""
    rng = np.random.default_rng(12)
    y = rng.normal(40, 5, 30)
    x = 0.97 * y + rng.normal(0, 6, 30)
    one = stats.ttest_1samp(x - 0.9 * y, 0, alternative="greater").pvalue
    other = stats.ttest_1samp(x - 1.1 * y, 0, alternative="less").pvalue
    assert relative_equivalence_p(x, y, 0.1) == pytest.approx(max(one, other))
    assert relative_equivalence_p(3 * x, 3 * y, 0.1) == pytest.approx(max(one, other))


def test_equivalence_of_spread_by_hand() -> None:
    """The distance of |log ratio| from log 1.5, in standard errors, on the normal's tail."""
    x, y = np.array([0.0, 1, 2, 3]), np.array([0.0, 0, 2, 2])  # as in the ratio by hand
    expected = stats.norm.sf((np.log(1.5) - np.log(1.25) / 2) / 0.03**0.5)
    assert spread_equivalence_p(x, y, 1.5) == pytest.approx(expected)
    assert spread_equivalence_p(y, x, 1.5) == pytest.approx(expected)
    assert spread_equivalence_p(x, y, 1.25**0.5) == pytest.approx(0.5)


def test_equivalence_of_what_does_not_vary() -> None:
    """A constant difference or a certain ratio is within the margin or is not."""
    ones = np.ones(5)
    assert (equivalence_p(ones, 1.5), equivalence_p(ones, 1.0), equivalence_p(-ones, 0.5)) == (
        0.0,
        1.0,
        1.0,
    )
    assert relative_equivalence_p(41 * ones, 40 * ones, 0.05) == 0.0
    assert relative_equivalence_p(43 * ones, 40 * ones, 0.05) == 1.0
    assert relative_equivalence_p(0 * ones, 0 * ones, 0.05) == 1.0
    sample = np.arange(5.0)
    assert (spread_equivalence_p(sample, sample, 1.2)) == 0.0
    assert (spread_equivalence_p(2 * sample, sample, 1.2)) == pytest.approx(1.0)


BORDERS: dict[str, Callable[[Array, Array], float]] = {
    "mean": lambda x, y: equivalence_p(x + 3 - y, 3.0),
    "relative": lambda x, y: relative_equivalence_p(0.9 * x, y, 0.1),
    "spread": lambda x, y: spread_equivalence_p(1.5 * x, y, 1.5),
}


@pytest.mark.parametrize("border", list(BORDERS))
def test_level_of_the_equivalence_tests(border: str) -> None:
    """Where the truth lies on the margin, 5 % are rejected, give or take."""
    x, y = skewed_pairs(np.random.default_rng(13), (2000, 100))
    rejected = [BORDERS[border](a, b / 2) <= 0.05 for a, b in zip(x, y, strict=True)]
    assert np.mean(rejected) == pytest.approx(0.05, abs=0.025)


# --- consistency with published numbers ------------------------------------------------------


def test_detectable_effects_have_a_power_of_one_third() -> None:
    """A two-sided z-test finds an effect of that size in a third of all studies."""
    assert pytest.approx(1.5286, abs=1e-4) == DETECTABLE
    z = np.random.default_rng(14).normal(detectable(0.3), 0.3, 100_000) / 0.3
    assert (np.abs(z) > 1.959964).mean() == pytest.approx(1 / 3, abs=0.006)


def test_detectable_effects_are_those_of_small_telescopes() -> None:
    """Simonsohn's d33 of two groups of 20 or 100 is .5 or .2 by Student's t, a bit less here."""
    for n in (20, 100):
        d33 = detectable((2 / n) ** 0.5)
        shift, critical = d33 * (n / 2) ** 0.5, stats.t.ppf(0.975, 2 * n - 2)
        assert stats.nct.sf(critical, 2 * n - 2, shift) == pytest.approx(1 / 3, abs=0.02)


def test_effect_prediction_covers() -> None:
    """95 of 100 replications have their estimate within, given the paper's."""
    rng = np.random.default_rng(15)
    paper, ours = rng.normal(5, 0.4, 20_000), rng.normal(5, 0.3, 20_000)
    low, high = effect_prediction(0.0, 0.4, 0.3)
    assert (low, high) == pytest.approx((-1.959964 * 0.5, 1.959964 * 0.5))
    inside = (paper + low <= ours) & (ours <= paper + high)
    assert inside.mean() == pytest.approx(0.95, abs=0.007)


def test_published_standard_errors_by_simulation() -> None:
    """They are the SDs of differences of means, and of log ratios of SDs, of normal samples."""
    rng = np.random.default_rng(16)
    x, y = rng.normal(0, 3, (20_000, 40)), rng.normal(0, 4, (20_000, 60))
    differences = x.mean(axis=1) - y.mean(axis=1)
    assert published_difference_se(3, 40, 4, 60) == pytest.approx(differences.std(), rel=0.02)
    logs = np.log(x.std(axis=1, ddof=1) / y.std(axis=1, ddof=1))
    assert published_log_sd_ratio_se(40, 60) == pytest.approx(logs.std(), rel=0.02)


@given(st.lists(st.integers(0, 20), min_size=1, max_size=20))
def test_rank_of_a_published_run_is_exact(counts: list[int]) -> None:
    """If any of our trials were the published one, at most a share p would have p or less."""
    found = np.array([run_p(counts[:i] + counts[i + 1 :], counts[i]) for i in range(len(counts))])
    assert all((found <= p + 1e-12).mean() <= p + 1e-12 for p in found)


def test_rank_of_a_published_run_by_hand() -> None:
    """Below all of 99 trials it is one of a hundred on one side; in the middle nothing is odd."""
    counts = np.arange(1, 100)
    assert run_p(counts, 0) == run_p(counts, 100) == 0.02
    assert run_p(counts, 2) == pytest.approx(0.06)
    assert run_p(counts, 50) == 1.0


# --- Holm ------------------------------------------------------------------------------------


def slow_holm(p: list[float]) -> list[float]:
    """Adjust by the definition: the least level at which the step-down procedure rejects each."""
    order = sorted(range(len(p)), key=p.__getitem__)
    adjusted = [0.0] * len(p)
    for place, i in enumerate(order):
        before = [(len(p) - k) * p[order[k]] for k in range(place + 1)]
        adjusted[i] = min(1.0, max(before))
    return adjusted


@given(st.lists(st.floats(0.0, 1.0), max_size=8))
def test_holm(p: list[float]) -> None:
    """Adjusted values follow the definition, keep the order, and are never below the raw ones."""
    found = holm(p)
    assert found.tolist() == slow_holm(p)
    assert (found >= p).all()
    assert (found <= 1.0).all()
    assert (np.diff(found[np.argsort(p)]) >= 0).all()


def test_holm_with_a_comparison_that_is_not_testable() -> None:
    """NaN stays NaN and counts as a comparison, so that the others are judged the more strictly."""
    assert holm([0.01, NAN, 0.02]).tolist() == pytest.approx([0.03, NAN, 0.04], nan_ok=True)
