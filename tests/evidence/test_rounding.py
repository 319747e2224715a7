from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from replication import Demos
from replication.evidence import rounding
from replication.evidence.claims import load_claims
from replication.evidence.experiments import conditions_of
from replication.evidence.recompute import declared_condition
from replication.evidence.rounding import (
    CHOICES,
    LEG,
    ROOT,
    TRIALS,
    chosen_tolerance,
    conditions,
    plan,
    profile_table,
    rounding_table,
    settings,
    variants,
)
from replication.evidence.statistics import holm, mean_interval, sign_flip_p
from replication.evidence.tables import read_table
from replication.files import PROJECT
from replication.learning import qlearning
from replication.learning.seeds import child, stream
from replication.paper.register import load_choices
from replication.trials.compute import trial_key

Array = NDArray[np.float64]

TOLERANCE = float(load_choices()["TIE-TOLERANCE"].default)
N = 20
GAMMA = Fraction(9, 10)


# --- why rounding can decide -----------------------------------------------------------------


def test_loops_along_the_path_tie_on_paper() -> None:
    """In exact numbers: ahead and back, or back and ahead, is worth c gamma^t / (1 - gamma^2).

    A corridor of N moves, in which moving on from cell t is worth c gamma^t and moving back is
    worth nothing, as after the first update: these values solve the Bellman equation, and along the
    path both actions have the same.
    """
    c = Fraction(1, 2)
    reward = [c * GAMMA**t for t in range(N)]
    value = [c * GAMMA**t / (1 - GAMMA**2) for t in range(N)] + [Fraction(0)]
    ahead = [reward[t] + GAMMA * value[t + 1] for t in range(N)]
    back = [GAMMA * value[max(t - 1, 0)] for t in range(N)]
    assert [max(pair) for pair in zip(ahead, back, strict=True)] == value[:N]
    assert [a == b for a, b in zip(ahead, back, strict=True)] == [0 < t < N - 1 for t in range(N)]
    assert ahead[0] > back[0]  # behind the start there is a wall
    assert ahead[-1] < back[-1]  # beyond the goal there is nothing


@pytest.fixture(scope="module")
def corridor() -> dict[str, Array]:
    """Learn that corridor until nothing changes any more; return Q by arithmetic."""
    moves = np.array([[max(t - 1, 0), min(t + 1, N)] for t in range(N + 1)])
    weights = np.zeros((N + 1, 2))
    weights[:N, 1] = 0.5 * np.cumprod([1.0] + [0.9] * (N - 1))
    options: dict[str, Any] = {"start": 0, "goal": N, "horizon": 500, "beta": 0.7, "gamma": 0.9}
    found = {}
    for arithmetic in ("double", "fused", "single"):
        options |= {"epsilon": 1.0, "arithmetic": arithmetic}
        words = stream(np.random.SeedSequence(1))
        q, words, *_ = qlearning.learn(moves, weights, 0 * weights, words, episodes=4000, **options)
        again, *_ = qlearning.learn(moves, weights, q, words, episodes=1000, **options)
        assert (again == q).all()
        found[arithmetic] = q
    return found


def test_learned_ties_are_broken_by_rounding(corridor: dict[str, Array]) -> None:
    """What ties on paper differs in its last bits, and not in the same ones in each arithmetic."""
    exact = [float(Fraction(1, 2) * GAMMA**t / (1 - GAMMA**2)) for t in range(1, N - 1)]
    for arithmetic, unit in (("double", 2.0**-52), ("fused", 2.0**-52), ("single", 2.0**-22)):
        q = corridor[arithmetic][1 : N - 1]
        np.testing.assert_allclose(q, np.stack([exact, exact], axis=1), rtol=4 * unit)
        assert (q[:, 0] != q[:, 1]).any()
        assert (q[:, 0] == q[:, 1]).any()
    double, fused, single = (corridor[name][1 : N - 1] for name in ("double", "fused", "single"))
    for other in (fused, single):
        assert (np.sign(other[:, 1] - other[:, 0]) != np.sign(double[:, 1] - double[:, 0])).any()


def test_tolerance_takes_rounded_values_for_ties(corridor: dict[str, Array]) -> None:
    """With the default tolerance the loops tie again in 64 bits, and what differs stays apart."""
    for arithmetic in ("double", "fused"):
        q = corridor[arithmetic]
        best = q.max(axis=1, keepdims=True)
        tied = (q >= best - TOLERANCE * np.abs(best)).all(axis=1)
        assert tied[:N].tolist() == [0 < t < N - 1 for t in range(N)]
        plainly = (q == best).all(axis=1)
        assert plainly[:N].tolist() != tied[:N].tolist()


@pytest.mark.parametrize("method", ["adaboost", "unified"])
def test_iterations_hang_on_rounding_without_a_tolerance_only(
    small_demos: Demos, method: str
) -> None:
    """In forty trials double and fused agree with the default tolerance, and do not at 0."""

    def iterations(tolerance: float, arithmetic: str) -> list[int]:
        choices = {"episodes": 300, "horizon": 50, "arithmetic": arithmetic}
        own = conditions_of(small_demos, choices | {"tie_tolerance": tolerance}, [method])
        condition = next(iter(own.values()))
        seeds = (child(np.random.SeedSequence(5), k) for k in range(40))
        return [condition.trial(seed=seed).iterations for seed in seeds]

    assert iterations(TOLERANCE, "double") == iterations(TOLERANCE, "fused")
    differ = zip(iterations(0.0, "double"), iterations(0.0, "fused"), strict=True)
    assert sum(a != b for a, b in differ) > 5


# --- what is run -----------------------------------------------------------------------------


def test_settings_are_those_of_the_rule() -> None:
    """Six settings: both mazes; AdaBoost-IRL and both traces, without incorrect demonstrations."""
    assert settings() == [
        (task, *rest)
        for task in ("open-maze", "obstacle-maze")
        for rest in (("adaboost", ""), ("unified", "printed"), ("unified", "updated"))
    ]
    assert (ROOT, TRIALS) == (13, 100)
    assert any(ROOT in run.root_seeds for run in load_claims().known)
    assert load_claims().judging.root_seed != ROOT


def test_every_tolerance_stands_with_every_arithmetic() -> None:
    """All registered values, tolerances from the least; double first, as the others' reference."""
    tolerances = sorted({0.0, 1e-12, 1e-9, 1e-6, 1e-3})
    expected = [(t, a) for t in tolerances for a in ("double", "fused", "single")]
    assert variants() == expected


def test_conditions_differ_in_tolerance_and_arithmetic_alone() -> None:
    """A setting's conditions have the choices of that time, the same demonstrations, no others."""
    found = conditions()
    assert len(found) == 6 * 15
    for ((task, method, reading), tolerance, arithmetic), condition in found.items():
        values = condition.params.values()
        assert (condition.demos.task, condition.method) == (task, method)
        assert (values["tie_tolerance"], values["arithmetic"]) == (tolerance, arithmetic)
        assert values["f_index"] == (reading or "printed")
        assert {name: values[name] for name in CHOICES} == CHOICES
        assert condition.selected.incorrect == ()
        changed = condition.params.differences().keys()
        now = {"ALPHA", "F-START", "TIES", "Q-START"}  # where the defaults are others by now
        usual = {"TIE-TOLERANCE", "ARITHMETIC", "F-INDEX", "INCORRECT-KINDS"}
        assert changed <= usual | now
    legs = {condition.demos.correct for condition in found.values()}
    assert len(legs) == 2
    corners = found[("open-maze", "adaboost", ""), 0.0, "double"].demos.correct[0].actions
    turns = np.flatnonzero(np.diff(corners)) + 1
    assert int(np.median(np.diff(turns))) == LEG == 2


def test_plan_comes_back_from_its_rows() -> None:
    """Each group has one condition, whose place among all is its number in the table."""
    groups = plan(3)
    assert [group.labels for group in groups] == [
        {"part": "rounding", "number": n} for n in range(90)
    ]
    for group in groups[::13]:
        assert group.trials == 3
        (own,) = group.conditions
        row = {"part": "rounding", "number": str(group.labels["number"]), "set": "none"}
        row |= {"task": own.demos.task, "method": own.method}
        reading = own.params.update.f_index if own.rule.readings != ("",) else ""
        again = declared_condition(row | {"reading": reading})
        assert trial_key(again, 13, 2) == trial_key(own, 13, 2)


# --- the table -------------------------------------------------------------------------------


def made(counts: dict[tuple[Any, float, str], Any]) -> pd.DataFrame:
    """Make trials up, in any order."""
    places = {key: number for number, key in enumerate(conditions())}
    parts = [
        pd.DataFrame(
            {
                "number": places[key],
                "trial": np.arange(len(each)),
                "iterations": each,
                "wrong_pairs": 3 * (each - 1),
            }
        )
        for key, each in counts.items()
    ]
    return pd.concat(parts).sample(frac=1.0, random_state=1)


def test_table_by_hand() -> None:
    """Each arithmetic is held against double over the same seeds, setting and tolerance."""
    rng = np.random.default_rng(2)
    one, other = settings()[1], settings()[5]
    counts: dict[tuple[Any, float, str], Any] = {}
    for setting, mean in ((one, 40), (other, 60)):
        for tolerance, shift in ((0.0, 3), (1e-12, 0)):
            double = mean + rng.integers(-5, 6, 30)
            counts[setting, tolerance, "double"] = double
            counts[setting, tolerance, "fused"] = double + shift * rng.integers(0, 3, 30)
            counts[setting, tolerance, "single"] = rng.permutation(double)
    table = rounding_table(made(counts))
    keys = list(zip(table["task"], table["method"], table["reading"], strict=True))
    assert keys == [one] * 6 + [other] * 6
    assert table["arithmetic"].tolist() == ["double", "fused", "single"] * 4
    assert table["tolerance"].tolist() == ([0.0] * 3 + [1e-12] * 3) * 2
    for setting, row in zip(keys, table.to_dict("records"), strict=True):
        own = counts[setting, row["tolerance"], row["arithmetic"]].astype(float)
        d = own - counts[setting, row["tolerance"], "double"]
        assert (row["n"], row["mean"], row["sd"]) == (30, own.mean(), own.std(ddof=1))
        assert (row["difference"], row["equal"]) == (d.mean(), (d == 0).mean())
        assert row["wrong"] == 3
        assert (row["low"], row["high"]) == tuple(map(float, mean_interval(d)))
        if row["arithmetic"] == "double":
            assert (row["difference"], row["equal"]) == (0.0, 1.0)
            assert np.isnan([row["p"], row["p_holm"]]).all()
        else:
            assert row["p"] == sign_flip_p(d)
    # Fused adds up to six iterations at 0 and nothing at 1e-12.
    fused = table[table["arithmetic"] == "fused"].set_index("tolerance")
    assert (fused.loc[0.0, "p_holm"] < 0.01).all()
    assert (fused.loc[1e-12, "p_holm"] == 1.0).all()
    for _, part in table[table["p"].notna()].groupby("tolerance"):
        assert part["p_holm"].tolist() == holm(part["p"].tolist()).tolist()
    assert chosen_tolerance(table) == 1e-12


@pytest.mark.parametrize(
    ("smallest", "expected"),
    [
        ({0.0: 0.04, 1e-12: 0.05, 1e-9: 0.9}, 1e-12),
        ({0.0: 0.05, 1e-12: 0.05}, 0.0),
        ({0.0: 0.01, 1e-12: 0.01, 1e-9: 0.02, 1e-3: 0.3}, 1e-3),
        ({0.0: 0.3, 1e-12: 0.01, 1e-9: 0.9}, 0.0),
        ({0.0: 0.01, 1e-12: 0.049}, None),
    ],
)
def test_tolerance_is_the_least_with_which_nothing_is_shown(
    smallest: dict[float, float], expected: float | None
) -> None:
    """One difference that is shown rules a tolerance out, whatever its other rows are."""
    rows = [
        {"tolerance": tolerance, "p_holm": p}
        for tolerance, least in smallest.items()
        for p in (np.nan, 1.0, least, 0.7)
    ]
    assert chosen_tolerance(pd.DataFrame(rows).sample(frac=1.0, random_state=1)) == expected


# --- where rounding decides ------------------------------------------------------------------


def test_gaps_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the Q-tables after updates: how far the second best action is behind, of each state."""
    q = np.zeros((3, 4, 3))
    q[0] = 7.0  # before any update: does not count
    q[1, 0] = 2.0, 1.0, 2.0  # tied
    q[1, 2] = -4.0, -2.0, -3.0  # by half of the best
    q[2, 0] = 1.0, 1.0 - 2e-13, 0.0  # by rounding
    q[2, 2] = 0.0, 0.0, -1.0
    seeds = []

    def trial(*, seed: np.random.SeedSequence, keep: bool) -> Any:
        seeds.append((seed.entropy, seed.spawn_key))
        assert keep
        return SimpleNamespace(snapshots=SimpleNamespace(q=q))

    path = np.array([2, 0])
    demo = SimpleNamespace(states=np.array([2, 0, 3]))
    fake: Any = SimpleNamespace(trial=trial, demos=SimpleNamespace(correct=[demo]))
    gaps = rounding._gaps(fake, 5, path)
    assert gaps == pytest.approx(np.array([[0.5, 0.0], [0.0, 2e-13]]), rel=1e-2)
    assert seeds == [(13, (5,))]

    keys = [(setting, 0.0, "double") for setting in settings()]
    monkeypatch.setattr(rounding, "conditions", lambda: dict.fromkeys(keys, fake))
    monkeypatch.setattr(rounding, "PROFILED", 2)
    table = profile_table()
    assert table["step"].tolist() == [0, 1] * 3
    assert table["method"].tolist() == ["adaboost"] * 2 + ["unified"] * 4
    assert table["reading"].tolist() == [""] * 2 + ["printed"] * 2 + ["updated"] * 2
    assert set(table["tables"]) == {4}
    assert table["tied"].tolist() == [0.5, 0.5] * 3
    assert table["rounded"].tolist() == [0.0, 0.5] * 3


# --- what is published -----------------------------------------------------------------------


def test_published_tolerance_follows_from_the_published_trials() -> None:
    """From the trials to the register: the table, and the tolerance that the rule takes."""
    folder = PROJECT / "figures" / "rounding"
    if not (folder / "rounding.csv").exists():
        pytest.skip("figures/rounding is not published yet")
    trials, stored = (read_table(folder / f"{name}.csv") for name in ("trials", "rounding"))
    table = rounding_table(trials)
    pd.testing.assert_frame_equal(stored, table, check_dtype=False, rtol=1e-8)
    assert set(trials["seed"]) == {ROOT}
    assert len(table) == 6 * 15
    assert set(table["n"]) == {TRIALS}
    assert chosen_tolerance(table) == TOLERANCE
