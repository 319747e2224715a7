from __future__ import annotations

import math

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
Matrix = list[list[float]]


def test_reconstruction_on_given_numbers() -> None:
    """One of four pairs differs: e = 1/4, c = ln(3)/2, and D weighs it three times the others."""
    mu_e, mu_i = np.array([[0.9, 0.5, 0.0, 0.0]]), np.array([[0.0, 0.5, 0.0, 0.0]])
    d = adaboost.start((1, 4), Update())
    w, d_next = adaboost.update(np.zeros((1, 4)), d, mu_e, mu_i, NONE, Update())
    np.testing.assert_allclose(d_next, [[1 / 2, 1 / 6, 1 / 6, 1 / 6]])
    np.testing.assert_allclose(w, [[0.9, 0, 0, 0]])


def by_formula(
    rule: str, margin: float, w: Matrix, d: Matrix, mu_e: Matrix, mu_i: Matrix
) -> tuple[Matrix, Matrix]:
    """Return the next weights and distribution, pair by pair as the notes of `update` have it."""
    pairs = [(s, a) for s in range(len(w)) for a in range(len(w[0]))]
    r = {(s, a): mu_e[s][a] - mu_i[s][a] for s, a in pairs}
    most = max(abs(value) for value in r.values())
    if rule == "log-odds":
        for s, a in pairs:
            x = min(abs(r[s, a]) / most, 1 - margin)
            w[s][a] += math.copysign(math.log((1 + x) / (1 - x)) / 2, r[s, a])
        return w, d
    m = {pair: abs(r[pair]) / most if rule == "graded" else float(r[pair] != 0) for pair in pairs}
    e = min(max(sum(d[s][a] * m[s, a] for s, a in pairs), 1e-6), 0.5 - margin)
    c = math.log((1 - e) / e) / 2
    for s, a in pairs:
        d[s][a] *= math.exp(c * (2 * m[s, a] - 1))
    z = sum(map(sum, d))
    d = [[value / z for value in row] for row in d]
    top = max(map(max, d))
    for s, a in pairs:
        sign = (r[s, a] > 0) - (r[s, a] < 0)
        moves = {"vote": c * d[s][a] * sign, "confidence": c * r[s, a]}
        w[s][a] += moves.get(rule, d[s][a] / top * r[s, a])
    return w, d


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("margin", [0.01, 0.2])
@pytest.mark.parametrize(
    "d",
    [[1, 1, 1, 1, 1, 1], [1, 2, 3, 1, 2, 3], [1e-8, 1e-8, 1, 1e-8, 1e-8, 1], [1, 1, 1e-8] * 2],
    ids=["even", "uneven", "hardly any error", "hardly anything right"],
)
def test_each_rule_is_its_formula(rule: str, margin: float, d: list[float]) -> None:
    """From any weights and distribution, each rule does what its formula says, pair by pair."""
    mu_e = [[0.9, 0.5, 0.25], [0.0, 1.0, 0.7]]
    mu_i = [[0.0, 0.7, 0.25], [0.3, 0.6, 0.7]]
    w = [[0.5, -1.0, 2.0], [0.0, 0.25, -3.0]]
    weighed = (np.array(d).reshape(2, 3) / sum(d)).tolist()
    params = Update(adaboost_rule=rule, adaboost_margin=margin)
    weights, before, expert, agent = (np.array(x) for x in (w, weighed, mu_e, mu_i))
    found = adaboost.update(weights, before, expert, agent, np.zeros((2, 3), bool), params)
    due = by_formula(rule, margin, w, weighed, mu_e, mu_i)
    np.testing.assert_allclose(found[0], due[0], rtol=1e-12)
    np.testing.assert_allclose(found[1], due[1], rtol=1e-12)


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
