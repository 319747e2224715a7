from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from replication.evidence import joint, statistics
from replication.evidence.joint import joint_test
from replication.evidence.statistics import EXACT, mean_interval, sign_flip_p

Array = NDArray[np.float64]


def correlated(rng: np.random.Generator, specifications: int, trials: int) -> Array:
    """Draw differences that are symmetric about zero and much the same in all specifications."""
    own = rng.laplace(size=(specifications, trials))
    scales = np.arange(1, specifications + 1)[:, None]
    return np.asarray(scales * (own + 2 * rng.laplace(size=trials)))


def test_by_hand() -> None:
    """Two specifications of two trials: 2^2 patterns, of which all numbers are written down."""
    found = joint_test(np.array([[1.0, 3.0], [1.0, 1.0]]))
    # Means by pattern (as they are, first, second, both flipped): 2, 1, -1, -2 and 1, 0, 0, -1.
    # Their medians: 1.5, .5, -.5, -1.5.
    assert (found.median, found.p_median) == (1.5, 2 / 4)
    # t of the first is 2, of the second infinity, as is that of the pattern itself only.
    assert (found.significant, found.p_significant) == (1, 1 / 4)
    # |mean| over root mean square: 2, 1, 1, 2 over sqrt(5) and 1, 0, 0, 1.
    assert found.p_familywise.tolist() == [2 / 4, 2 / 4]
    lows, highs = zip((-2, -1), (-1, 0), (0, 1), (1, 2), strict=True)
    for bound, share in ((found.null_low, 0.025), (found.null_high, 0.975)):
        assert bound == pytest.approx([np.quantile(lows, share), np.quantile(highs, share)])


def slow_familywise(differences: Array) -> list[float]:
    """Adjust by the definition: largest |t| of SciPy over all assignments of signs."""
    sizes = []
    for signs in product((1, -1), repeat=differences.shape[1]):
        with np.errstate(all="ignore"):
            t = stats.ttest_1samp(differences * signs, 0.0, axis=1).statistic
        sizes.append(np.abs(t))
    largest = np.max(sizes, axis=1)
    return [float((largest >= own - 1e-9).mean()) for own in sizes[0]]


def test_familywise_by_definition() -> None:
    """The adjusted p-values are those of the largest |t| of SciPy, pattern by pattern."""
    differences = correlated(np.random.default_rng(1), 4, 7) - np.array([[0.0], [-1], [-5], [-9]])
    found = joint_test(differences)
    assert found.p_familywise == pytest.approx(slow_familywise(differences))
    t = stats.ttest_1samp(differences, 0.0, axis=1, alternative="greater")
    assert found.significant == (t.pvalue < 0.025).sum()
    assert found.median == pytest.approx(np.median(differences.mean(axis=1)))


@pytest.mark.parametrize("n", [2, 3, 5])
def test_significant_by_definition(n: int) -> None:
    """In each pattern of signs those count whose t-test by SciPy has p < 2.5 % on that side."""
    differences = np.random.default_rng(9).normal(0.1, 1, (300, n))
    counts = []
    for signs in product((1, -1), repeat=n):
        t = stats.ttest_1samp(differences * signs, 0.0, axis=1, alternative="greater")
        counts.append(int((t.pvalue < 0.025).sum()))
    found = joint_test(differences)
    assert found.significant == counts[0] > 0
    assert found.p_significant == np.mean(np.array(counts) >= counts[0])


@pytest.mark.parametrize("n", [8, 40])
def test_one_specification_is_a_sign_flip_test(n: int) -> None:
    """Alone, a specification has the p-value of its own test, and its null lies about zero."""
    d = np.random.default_rng(2).normal(0.5, 1, n)
    found = joint_test(d[None])
    assert found.p_median == pytest.approx(sign_flip_p(d), abs=0.01)
    assert found.p_familywise == pytest.approx([found.p_median])
    assert found.significant == (mean_interval(d)[0] > 0)
    half = 1.96 * ((d**2).mean() / n) ** 0.5
    assert [found.null_low[0], found.null_high[0]] == pytest.approx([-half, half], rel=0.15)


@pytest.mark.parametrize("n", [8, 40])
def test_flips_are_the_same_for_all_specifications(n: int) -> None:
    """Copies of one specification are no more evidence than it is alone; scaled neither."""
    d = np.random.default_rng(3).normal(-0.4, 1, n)
    alone, many = joint_test(d[None]), joint_test(np.tile(d, (9, 1)))
    assert many.p_median == alone.p_median
    assert many.p_significant == alone.p_significant
    assert many.significant == 9 * alone.significant
    assert many.p_familywise == pytest.approx(np.repeat(alone.p_familywise, 9))
    assert many.null_low == pytest.approx(np.repeat(alone.null_low, 9))
    scaled = joint_test(d * np.arange(1.0, 10)[:, None])
    assert scaled.p_median == alone.p_median
    assert scaled.p_familywise == pytest.approx(many.p_familywise)


def test_levels() -> None:
    """Without any effect, at most 5 % of correlated sets of specifications have p <= .05."""
    rng = np.random.default_rng(4)
    drawn = [joint_test(correlated(rng, 6, 9)) for _ in range(1000)]
    most = 0.05 + 3 * (0.05 * 0.95 / len(drawn)) ** 0.5
    for p in ("p_median", "p_significant"):
        assert np.mean([getattr(one, p) <= 0.05 for one in drawn]) <= most
    smallest = np.array([one.p_familywise.min() for one in drawn])
    assert 0.02 < (smallest <= 0.05).mean() <= most


def test_an_effect_is_found_on_the_claimed_side_only() -> None:
    """Positive differences are significant together; negative ones are, two-sided, the reverse."""
    differences = correlated(np.random.default_rng(5), 20, 60) / 20
    saved, lost = joint_test(differences + 2), joint_test(differences - 2)
    assert (saved.significant, lost.significant) == (20, 0)
    assert max(saved.p_median, saved.p_significant, lost.p_median) < 0.01
    assert lost.p_significant == 1.0
    assert (np.sort((differences + 2).mean(axis=1)) > saved.null_high).all()
    assert saved.p_familywise.max() < 0.01


def test_rows_without_variation() -> None:
    """A row of zeros is nothing, a constant one as extreme as can be; none gives a NaN."""
    rng = np.random.default_rng(6)
    for n in (6, 30):
        found = joint_test(np.stack([np.zeros(n), np.full(n, 0.1), rng.normal(size=n)]))
        assert found.p_familywise[0] == 1.0
        assert found.p_familywise[1] == pytest.approx(2 / 2**6 if n == 6 else 1e-4)
        assert found.significant >= 1
        assert np.isfinite([found.p_median, found.p_significant, *found.null_low]).all()
    nothing = joint_test(np.zeros((3, 5)))
    assert (nothing.p_median, nothing.significant, nothing.p_significant) == (1.0, 0, 1.0)
    assert nothing.p_familywise.tolist() == [1.0] * 3


def test_null_band_is_symmetric_and_in_order() -> None:
    """Its bounds rise along the curve, and each is the other's, mirrored."""
    differences = correlated(np.random.default_rng(7), 5, EXACT) - 3
    found = joint_test(differences)
    assert (np.diff(found.null_low) >= 0).all()
    assert (np.diff(found.null_high) >= 0).all()
    assert found.null_low == pytest.approx(-found.null_high[::-1])


def test_p_values_do_not_depend_on_the_seed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same in every run, with another seed nearly so."""
    differences = correlated(np.random.default_rng(8), 5, 40) - 1.5
    found = joint_test(differences)
    assert joint_test(differences).p_median == found.p_median
    monkeypatch.setattr(statistics, "FLIP_SEED", 1)
    other = joint_test(differences)
    assert other.p_median == pytest.approx(found.p_median, abs=0.02)
    assert other.p_familywise == pytest.approx(found.p_familywise, abs=0.02)
    assert joint.FLIPS < statistics.FLIPS
