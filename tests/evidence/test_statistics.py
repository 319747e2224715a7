from __future__ import annotations

from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from replication.evidence import statistics
from replication.evidence.statistics import (
    FEWEST,
    RESAMPLES_OF_MANY,
    compare,
    holm,
    mean_interval,
    mean_intervals,
    mean_prediction,
    power,
    sd_interval,
    sd_prediction,
    sd_ratio_intervals,
    share_interval,
    standard_errors,
    summarise,
)

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
    compared = compare([1, 2, 300], [4, 5, 6], capped=True, published=-4.8)
    assert np.isnan(astuple(compared)[:-1]).all()
    assert compared.n == 3


# --- comparisons -----------------------------------------------------------------------------


def test_comparison_by_hand() -> None:
    """Small samples worked out on paper: differences, pairs of trials, Welch's t, ratio of SDs."""
    x, y = [1, 2, 3, 6], [2, 4, 6, 8]
    found = compare(x, y)
    assert found.difference == -2.0
    # Of 16 pairs, x is the smaller in 4 + 3 + 3 + 1 and equal in 0 + 1 + 0 + 1.
    assert found.fewer == (11 + 0.5 * 2) / 16
    assert found.sd_ratio == pytest.approx((14 / 3) ** 0.5 / (20 / 3) ** 0.5)
    # t = -2 / sqrt(14/12 + 20/12), by Welch and Satterthwaite with 5.8235... degrees of freedom.
    freedom = (14 / 12 + 20 / 12) ** 2 / ((14 / 12) ** 2 / 3 + (20 / 12) ** 2 / 3)
    assert found.p_welch == pytest.approx(2 * stats.t.cdf(-2 / (34 / 12) ** 0.5, freedom))
    # All four differences have one sign: two of 2**4 assignments of signs are as extreme.
    assert found.p_wilcoxon == pytest.approx(2 / 16)
    assert np.isnan(found.power)


def test_spread_by_hand() -> None:
    """Brown-Forsythe is the analysis of variance of the distances from the medians."""
    x, y = [1, 2, 3, 4, 9], [0, 10, 20, 35, 50]
    expected = stats.f_oneway([2, 1, 0, 1, 6], [20, 10, 0, 15, 30]).pvalue
    assert compare(x, y).p_spread == pytest.approx(expected)


@given(COUNTS)
@settings(deadline=None, max_examples=8)
def test_a_sample_does_not_differ_from_itself(x: list[int]) -> None:
    """Against itself a condition differs by 0, is fewer in half the pairs, and no test rejects."""
    found = compare(x, x, published=-4.8)
    assert (found.difference, found.low, found.high, found.fewer) == (0.0, 0.0, 0.0, 0.5)
    assert (found.p_welch, found.p_wilcoxon) == (1.0, 1.0)


@given(st.lists(st.tuples(st.integers(0, 300), st.integers(0, 300)), min_size=2, max_size=12))
@settings(deadline=None, max_examples=8)
def test_exchange_of_the_samples(pairs: list[tuple[int, int]]) -> None:
    """Exchanged samples have the opposite difference and the same p-values, without a warning."""
    x, y = zip(*pairs, strict=True)
    one, other = compare(x, y), compare(y, x)
    assert one.difference == -other.difference
    assert one.fewer == pytest.approx(1 - other.fewer)
    for name in ("p_welch", "p_wilcoxon", "p_spread"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), nan_ok=True)
    assert one.low <= one.difference <= one.high


def test_samples_that_do_not_spread() -> None:
    """Constant samples have no spread to compare, and a constant difference is its interval."""
    found = compare([3, 3, 3], [4, 4, 4], published=-1.0)
    assert (found.difference, found.low, found.high, found.fewer) == (-1.0, -1.0, -1.0, 1.0)
    assert np.isnan([found.sd_ratio, found.sd_low, found.sd_high, found.p_spread]).all()
    assert np.isnan(found.power)
    assert found.p_welch == 0.0


# --- intervals -------------------------------------------------------------------------------


@given(st.lists(st.integers(-50, 50), min_size=2, max_size=15))
@settings(deadline=None, max_examples=25)
def test_interval_contains_the_mean_and_never_changes(differences: list[int]) -> None:
    """The interval of equal differences has equal bits, and the mean lies in it."""
    sample = np.array(differences, dtype=float)
    low, high = mean_interval(sample)
    assert (low, high) == mean_interval(sample.copy())
    assert sample.min() <= low <= sample.mean() <= high <= sample.max()


def test_interval_is_that_of_students_t_for_a_normal_sample() -> None:
    """On 200 normal numbers the bootstrap agrees with the textbook's interval to a few percent."""
    sample = np.random.default_rng(1).normal(3.0, 10.0, 200)
    half = stats.t.ppf(0.975, 199) * sample.std(ddof=1) / 200**0.5
    low, high = mean_interval(sample)
    assert low == pytest.approx(sample.mean() - half, abs=0.06 * half)
    assert high == pytest.approx(sample.mean() + half, abs=0.06 * half)


def test_interval_leans_to_the_longer_tail() -> None:
    """Of a skewed sample, the interval reaches further on the side of the long tail."""
    sample = np.array([0.0] * 30 + [5.0, 20.0, 40.0])
    low, high = mean_interval(sample)
    assert high - sample.mean() > 1.3 * (sample.mean() - low)


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


# --- many intervals at once ------------------------------------------------------------------


@pytest.fixture
def resamples_of_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give single intervals as few resamples as those of many rows have."""
    monkeypatch.setattr(statistics, "RESAMPLES", RESAMPLES_OF_MANY)


@pytest.mark.usefixtures("resamples_of_many")
def test_intervals_of_many_means_are_those_of_each() -> None:
    """Row by row they are the BCa intervals of single samples, with the same resamples."""
    rng = np.random.default_rng(3)
    samples = np.array([rng.normal(0, 1, 12), rng.exponential(5, 12), rng.integers(0, 4, 12)])
    low, high = mean_intervals(samples)
    for row, bounds in zip(samples, zip(low, high, strict=True), strict=True):
        assert bounds == pytest.approx(mean_interval(row), rel=1e-9, abs=1e-9)
    alone = mean_intervals(samples[1:2])
    assert (alone[0][0], alone[1][0]) == pytest.approx((low[1], high[1]))


@pytest.mark.usefixtures("resamples_of_many")
def test_intervals_of_many_ratios_are_those_of_each() -> None:
    """Likewise for ratios of SDs, the pairs resampled together."""
    x, y = np.random.default_rng(5).normal(40, [[[3]], [[8]]], (2, 4, FEWEST))
    ratio, low, high = sd_ratio_intervals(x, y)
    for at in range(4):
        one = compare(x[at], y[at])
        expected = one.sd_ratio, one.sd_low, one.sd_high
        assert (ratio[at], low[at], high[at]) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("values", [[0.0, 3.0, -7.1], [0.1, 40.0, 1 / 3]])
def test_constant_rows_are_their_own_intervals(values: list[float]) -> None:
    """A row that does not vary has its value as both bounds, whatever the other rows do."""
    flat = np.repeat(np.array(values)[:, None], 10, axis=1)
    noise = np.random.default_rng(6).normal(size=(1, 10))
    low, high = mean_intervals(np.concatenate([flat, noise]))
    assert low[:3] == pytest.approx(values)
    assert (low[:3] == high[:3]).all()
    assert low[3] < noise.mean() < high[3]


def test_ratio_to_a_constant_is_missing() -> None:
    """Where y does not vary there is no ratio and no interval; the other rows keep theirs."""
    rng = np.random.default_rng(7)
    x, y = rng.normal(size=(2, 3, 12))
    y[1] = 4.0
    found = np.array(sd_ratio_intervals(x, y))
    assert np.isnan(found[:, 1]).all()
    assert np.isnan(np.array(sd_ratio_intervals(y, x))[:, 1]).all()
    assert np.isfinite(found[:, [0, 2]]).all()
    assert (found[1] <= found[0])[[0, 2]].all()
    assert (found[0] <= found[2])[[0, 2]].all()


def test_standard_errors_are_those_of_normal_intervals() -> None:
    """An interval of an estimate with standard error s is 2 x 1.96 s wide."""
    s = np.array([0.5, 2.0])
    found = standard_errors(3.0 - stats.norm.ppf(0.975) * s, 3.0 + stats.norm.ppf(0.975) * s)
    assert found == pytest.approx(s)


# --- power -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "effect"), [(10, 0.5), (30, 0.3), (100, -0.3)])
def test_power_by_simulation(n: int, effect: float) -> None:
    """The power is the share of simulated paired t-tests that reject."""
    rng = np.random.default_rng(3)
    draws = rng.normal(effect, 1.25, (10_000, n))
    rejected = (stats.ttest_1samp(draws, 0.0, axis=1).pvalue < 0.05).mean()
    assert power(1.25, n, effect) == pytest.approx(rejected, abs=0.02)  # four standard errors


@pytest.mark.parametrize("n", [2, 10, 100])
def test_power_rises_with_the_effect_to_one(n: int) -> None:
    """From the level it rises to 1, whatever the sign; without effect or spread there is none."""
    powers = [power(1.2, n, effect) for effect in np.linspace(0.0, 60.0, 241)]
    assert np.diff(powers).min() >= -1e-12
    assert powers[0] == pytest.approx(0.05)
    assert powers[-1] > 0.99
    assert np.isnan([power(1.2, n, NAN), power(0.0, n, 1.0)]).all()
    assert power(1.2, n, -0.4) == power(1.2, n, 0.4)
    assert power(1.2, n, 1e4) == pytest.approx(1.0)


# --- ratios of SDs ---------------------------------------------------------------------------


def test_few_trials_give_no_interval_of_a_ratio() -> None:
    """Below 30 trials the ratio of SDs stands without an interval."""
    sample = np.random.default_rng(4).normal(40.0, 5.0, (2, FEWEST))
    assert np.isfinite(compare(*sample).sd_low)
    few = compare(*sample[:, 1:])
    assert np.isnan([few.sd_low, few.sd_high]).all()
    assert np.isfinite(few.sd_ratio)


def test_ratio_of_sds_has_an_interval_that_knows_the_pairs() -> None:
    """Of samples that are multiples of each other the ratio is exact; of noise it is wide."""
    rng = np.random.default_rng(2)
    sample = rng.normal(40.0, 5.0, 100)
    exact = compare(2 * sample, sample)
    assert (exact.sd_low, exact.sd_high) == pytest.approx((2.0, 2.0))
    noise = compare(rng.normal(40.0, 10.0, 100), sample)
    assert noise.sd_low < noise.sd_ratio < noise.sd_high
    assert 1.4 < noise.sd_low < 2.0 < noise.sd_high < 3.0


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
