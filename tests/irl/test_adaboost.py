from __future__ import annotations

import hypothesis.extra.numpy as hnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replication.irl import adaboost
from replication.paper.params import Update
from replication.paper.register import load_choices

ENTRY = load_choices()["ADABOOST-RULE"]
RULES = [str(rule) for rule in (ENTRY.default, *ENTRY.alternatives)]
NONE = np.zeros((1, 4), dtype=bool)


def test_reconstruction_on_given_numbers() -> None:
    """One of four pairs differs: e = 1/4, c = ln(3)/2, and D weighs it three times the others."""
    mu_e, mu_i = np.array([[0.9, 0.5, 0.0, 0.0]]), np.array([[0.0, 0.5, 0.0, 0.0]])
    d = adaboost.start((1, 4), Update())
    w, d_next = adaboost.update(np.zeros((1, 4)), d, mu_e, mu_i, NONE, Update())
    np.testing.assert_allclose(d_next, [[1 / 2, 1 / 6, 1 / 6, 1 / 6]])
    np.testing.assert_allclose(w, [[0.9, 0, 0, 0]])


def test_distribution_does_not_freeze_while_the_mismatches_stay() -> None:
    """The margin keeps D moving when the same pairs differ again; without it D would stand."""
    mu_e, mu_i = np.array([[0.9, 0.5, 0.0, 0.0]]), np.array([[0.0, 0.5, 0.0, 0.0]])
    w, d = np.zeros((1, 4)), adaboost.start((1, 4), Update())
    shares = []
    for _ in range(3):
        w, d = adaboost.update(w, d, mu_e, mu_i, NONE, Update())
        shares.append(d[0, 0])
    assert shares[0] == pytest.approx(0.5)
    assert shares[0] < shares[1] < shares[2]


visits = hnp.arrays(float, (3, 4), elements=st.floats(0, 10, allow_subnormal=False))


@pytest.mark.parametrize("rule", RULES)
@given(mu_e=visits, mu_i=visits)
def test_every_rule_keeps_a_distribution_and_the_residuals_signs(
    rule: str, mu_e: np.ndarray, mu_i: np.ndarray
) -> None:
    """D is positive and sums to 1; a weight never moves against its residual."""
    params = Update(adaboost_rule=rule)
    d = adaboost.start((3, 4), params)
    mu_b = np.zeros((3, 4), dtype=bool)
    w, d_next = adaboost.update(np.zeros((3, 4)), d, mu_e, mu_i, mu_b, params)
    assert np.isfinite(w).all()
    assert (d_next > 0).all()
    assert d_next.sum() == pytest.approx(1)
    assert (w * (mu_e - mu_i) >= 0).all()


@given(visits, visits, hnp.arrays(bool, (3, 4)))
def test_incorrect_demonstrations_make_no_difference(
    mu_e: np.ndarray, mu_i: np.ndarray, mu_b: np.ndarray
) -> None:
    """The baseline does not look at mu_B."""
    d = adaboost.start((3, 4), Update())
    with_them = adaboost.update(np.zeros((3, 4)), d, mu_e, mu_i, mu_b, Update())
    without = adaboost.update(np.zeros((3, 4)), d, mu_e, mu_i, np.zeros_like(mu_b), Update())
    for one, other in zip(with_them, without, strict=True):
        np.testing.assert_array_equal(one, other)


def test_rules_differ() -> None:
    """No two rules are the same update under different names."""
    mu_e, mu_i = np.array([[0.9, 0.5, 0.0, 0.3]]), np.array([[0.0, 0.5, 0.8, 0.2]])
    weights = set()
    for rule in RULES:
        params = Update(adaboost_rule=rule)
        d = adaboost.start((1, 4), params)
        w, _ = adaboost.update(np.zeros((1, 4)), d, mu_e, mu_i, NONE, params)
        weights.add(tuple(np.round(w[0], 12)))
    assert len(weights) == len(RULES)
