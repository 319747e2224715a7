from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from replication.statistics import (
    NOT_REPRODUCED,
    NOT_TESTABLE,
    REPRODUCED,
    REVERSED,
    UNDECIDED,
    Comparison,
    compare,
    holm,
    mean_interval,
    power,
    prediction_interval,
    summarise,
    verdict_fewer,
    verdict_steadier,
)

COUNTS = st.lists(st.integers(0, 300), min_size=2, max_size=12)
NEUTRAL = Comparison(0.0, -1.0, 1.0, 0.5, 1.0, 1.0, 1.0, 0.8, 1.2, 1.0, 0.5, n=100)
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
    """With one trial at the cap there is no mean, SD or interval; quartiles stay."""
    found = summarise([1, 2, 3, 4, 300], [True, True, True, True, False])
    assert (found.n, found.capped) == (5, 1)
    assert np.isnan([found.mean, found.low, found.high, found.sd]).all()
    assert (found.quartile_1, found.median, found.quartile_3) == (2.0, 3.0, 4.0)


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
    due = stats.f_oneway([2, 1, 0, 1, 6], [20, 10, 0, 15, 30]).pvalue
    assert compare(x, y).p_spread == pytest.approx(due)


@given(COUNTS)
@settings(deadline=None, max_examples=8)
def test_a_sample_does_not_differ_from_itself(x: list[int]) -> None:
    """Against itself a setting differs by 0, is fewer in half of the pairs, and no test rejects."""
    found = compare(x, x, published=-4.8)
    assert (found.difference, found.low, found.high, found.fewer) == (0.0, 0.0, 0.0, 0.5)
    assert (found.p_welch, found.p_wilcoxon) == (1.0, 1.0)
    assert verdict_fewer(replace(found, n=100), found.p_wilcoxon) == NOT_REPRODUCED
    assert verdict_steadier(found, found.p_spread) == NOT_TESTABLE


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
    assert verdict_steadier(found, found.p_spread) == NOT_TESTABLE


def test_capped_comparison_is_not_testable() -> None:
    """With a trial at the cap every statistic is NaN, and so is each verdict not testable."""
    found = compare([1, 2, 300], [4, 5, 6], capped=True, published=-4.8)
    assert np.isnan(astuple(found)[:-1]).all()
    assert found.n == 3
    for verdict in (verdict_fewer, verdict_steadier):
        assert verdict(replace(found, n=100), 0.001) == NOT_TESTABLE


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
def test_prediction_interval_by_simulation(n: int, m: int) -> None:
    """The mean of m new trials lies in the interval in 95 of 100 replications."""
    rng = np.random.default_rng(7)
    first = rng.normal(40.0, 8.0, (10_000, n))
    means = rng.normal(40.0, 8.0 / m**0.5, 10_000)
    inside = [
        low <= new <= high
        for (low, high), new in zip(
            (
                prediction_interval(mean, sd, n, m)
                for mean, sd in zip(first.mean(1), first.std(1, ddof=1), strict=True)
            ),
            means,
            strict=True,
        )
    ]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.009)  # four standard errors


def test_prediction_interval_of_the_paper() -> None:
    """For Table I's 36.48 (3.58), 100 against 100: 36.48 -+ 1.9842 x 3.58 x sqrt(2 / 100)."""
    low, high = prediction_interval(36.48, 3.58, 100, 100)
    assert (low, high) == pytest.approx((36.48 - 1.00458, 36.48 + 1.00458), abs=1e-4)


# --- power -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "effect"), [(10, 0.5), (30, 0.3), (100, -0.3)])
def test_power_by_simulation(n: int, effect: float) -> None:
    """The power is the share of simulated paired t-tests that reject."""
    rng = np.random.default_rng(3)
    draws = rng.normal(effect, 1.25, (10_000, n))
    rejected = (stats.ttest_1samp(draws, 0.0, axis=1).pvalue < 0.05).mean()
    assert power(1.25, n, effect) == pytest.approx(rejected, abs=0.02)  # four standard errors


def test_power_without_an_effect_is_the_level() -> None:
    """Where nothing differs, one test in twenty rejects."""
    assert power(2.0, 4, 0.0) == pytest.approx(0.05)


@pytest.mark.parametrize("n", [2, 10, 100])
def test_power_rises_with_the_effect_to_one(n: int) -> None:
    """The larger the effect the larger the power, its sign does not matter, far out it is 1."""
    powers = [power(1.2, n, effect) for effect in np.linspace(0.0, 60.0, 241)]
    assert np.diff(powers).min() >= -1e-12
    assert powers[-1] > 0.99
    assert power(1.2, n, -0.4) == power(1.2, n, 0.4)
    assert power(1.2, n, 1e4) == pytest.approx(1.0)


def test_power_needs_an_effect_and_a_spread() -> None:
    """Without a published effect, or without any spread, there is no power."""
    assert np.isnan(power(1.0, 2, NAN))
    assert np.isnan(power(0.0, 2, 1.0))


# --- verdicts --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("low", "high", "p", "due"),
    [
        (-2.0, -1e-9, 0.0499, REPRODUCED),
        (-2.0, -1e-9, 0.0501, UNDECIDED),
        (-2.0, 0.0, 0.0499, UNDECIDED),
        (-2.0, 0.0, 0.0501, NOT_REPRODUCED),
        (0.0, 0.0, 1.0, NOT_REPRODUCED),
        (1e-9, 2.0, 0.0499, REVERSED),
        (1e-9, 2.0, 0.0501, UNDECIDED),
        (NAN, NAN, 0.001, NOT_TESTABLE),
        (-2.0, -1.0, NAN, NOT_TESTABLE),
    ],
)
def test_verdict_needs_both_locks(low: float, high: float, p: float, due: str) -> None:
    """The whole interval lies on one side and the test rejects; else it is undecided."""
    assert verdict_fewer(replace(NEUTRAL, low=low, high=high), p) == due
    ratio = replace(NEUTRAL, sd_low=1 + low / 10, sd_high=1 + high / 10)
    assert verdict_steadier(ratio, p) == due


def test_few_trials_get_no_verdict() -> None:
    """Below 30 trials nothing is judged, however clear it looks."""
    clear = replace(NEUTRAL, low=-3.0, high=-2.0, sd_low=0.1, sd_high=0.2)
    assert verdict_fewer(replace(clear, n=30), 0.001) == REPRODUCED
    assert verdict_fewer(replace(clear, n=29), 0.001) == NOT_TESTABLE
    assert verdict_steadier(replace(clear, n=29), 0.001) == NOT_TESTABLE


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
