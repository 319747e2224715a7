from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest

from replication import DemoError, Demos, Params, WrappedTask, fit, make_demos
from replication.baselines import BASELINES, BaselineCondition, Problem, condition
from replication.errors import UserError
from replication.irl import METHODS
from replication.learning.seeds import trial_seeds
from replication.paper.register import ChoiceError
from replication.trials.condition import Condition
from replication.trials.results import digest

FINDERS = [name for name, method in BASELINES.items() if method.find]
LOOPS = [name for name, method in BASELINES.items() if not method.find]


def refused(call: Callable[[], Any], kind: type[UserError] = ChoiceError) -> str:
    """Return the one line in which a call is refused."""
    with pytest.raises(UserError) as caught:
        call()
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, kind)
    return str(caught.value)


@pytest.mark.parametrize("method", FINDERS)
def test_where_there_is_no_table_it_is_said_what_works(soccer_demos: Demos, method: str) -> None:
    """Soccer is refused by methods that need the table, with those that do not."""
    said = refused(lambda: fit(soccer_demos, method=method))
    assert f"the method '{method}' needs the table of moves" in said
    assert "'soccer'" in said
    assert all(name in said for name in LOOPS)
    assert not any(f" {name}" in said.partition("work:")[2] for name in FINDERS)


@pytest.mark.parametrize("method", LOOPS)
def test_methods_of_the_loop_need_no_table(soccer_demos: Demos, method: str) -> None:
    """They are taken in soccer, but not with a planner."""
    assert BaselineCondition(soccer_demos, method, Params.of(incorrect="none"))
    asked = BaselineCondition(soccer_demos, method, Params.of(incorrect="none", solver="planning"))
    assert "soccer has no table to plan on" in refused(lambda: asked.agent)


def test_environments_that_are_stepped_have_no_table() -> None:
    """One whose table is hidden is refused like soccer."""
    env = gymnasium.make("FrozenLake-v1", is_slippery=False)
    task = WrappedTask(env, int, 16)
    demos = make_demos(task, {"correct": [[1, 1, 2, 1, 2, 2]]})
    said = refused(lambda: BaselineCondition(demos, "bayesian", Params.of(incorrect="none")))
    assert "a task of the kind 'own'" in said


@pytest.mark.parametrize("method", FINDERS)
def test_sums_without_end_are_refused(small_demos: Demos, method: str) -> None:
    """Without a discount nothing can be found beforehand; the line says what to set."""
    said = refused(lambda: fit(small_demos, method=method, gamma=1.0))
    assert f"the method '{method}' needs a discount below 1: set gamma = 0.99" in said


def test_nothing_can_be_compared_with_nothing(small_demos: Demos) -> None:
    """Ranking is refused without incorrect demonstrations, whether they are absent or left out."""
    for demos, kinds in ((small_demos, "none"), (small_demos.select("none"), "all")):
        said = refused(lambda: BaselineCondition(demos, "ranking", Params.of(incorrect=kinds)))  # noqa: B023
        assert "there are no incorrect ones" in said
    assert "no incorrect ones" in refused(
        lambda: fit(small_demos, method="ranking", incorrect="none")
    )


def test_unknown_methods_and_kinds_are_refused(small_demos: Demos) -> None:
    """As in conditions of the paper's methods, and when the condition is made."""
    said = refused(lambda: BaselineCondition(small_demos, "rankin", Params()))
    assert "did you mean 'ranking'?" in said
    hits, params = small_demos.select("hit"), Params.of(incorrect="detour")
    assert "'detour'" in refused(lambda: BaselineCondition(hits, "wary", params), DemoError)


def test_a_method_sees_only_what_it_uses(small_demos: Demos) -> None:
    """Incorrect demonstrations are for those that use them, and of the kinds asked for."""
    params = Params.of(incorrect="hit")
    for name, method in BASELINES.items():
        kinds = BaselineCondition(small_demos, name, params).selected.kinds
        assert kinds == (("hit",) if method.uses_incorrect else ())


@pytest.mark.parametrize("method", METHODS)
def test_methods_of_the_paper_are_what_they_were(small_demos: Demos, method: str) -> None:
    """Identity: a trial has the same bits in this condition and in the paper's."""
    params = Params.of(episodes=100, horizon=40, max_iterations=20, incorrect="all")
    seed = trial_seeds(11, 1)[0]
    one, other = (kind(small_demos, method, params) for kind in (BaselineCondition, Condition))
    assert digest(one.trial(seed=seed)) == digest(other.trial(seed=seed))
    assert one.params == params


def test_a_found_reward_is_found_once_and_learned_by(
    small_demos: Demos, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One search serves all trials, each of one iteration at most, and its plans are counted."""
    calls = []

    def find(problem: Problem) -> Any:
        calls.append(problem)
        problem.plan(problem.mu_e)
        return np.where(problem.mu_e > 0, 0.0, -1.0)

    row = replace(BASELINES["bayesian"], find=find)
    monkeypatch.setitem(BASELINES, "bayesian", row)
    monkeypatch.setattr(condition, "_FOUND", {})
    asked = BaselineCondition(small_demos, "bayesian", Params.of(incorrect="hit"))
    for seed in trial_seeds(12, 3):
        trial = asked.trial(seed=seed)
        assert (trial.iterations, trial.errors[-1]) == (1, 0.0)
        np.testing.assert_array_equal(trial.weights, asked.found.weights)
    assert (len(calls), asked.found.plans) == (1, 1)
    assert [demo.kind for demo in calls[0].incorrect] == ["hit"] * len(calls[0].incorrect)
    other = BaselineCondition(small_demos, "bayesian", Params.of(incorrect="detour"))
    assert other.found is not asked.found
    assert len(calls) == 2


def test_each_problem_is_solved_for_itself(
    small_demos: Demos, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A reward is found anew for another method or discount; if it is useless, that is the end."""
    calls: list[Problem] = []

    def find(problem: Problem) -> Any:
        calls.append(problem)
        return np.zeros(problem.moves.shape)

    for name in ("bayesian", "max-margin"):
        monkeypatch.setitem(BASELINES, name, replace(BASELINES[name], find=find))
    monkeypatch.setattr(condition, "_FOUND", {})
    for name in ("bayesian", "max-margin"):
        for gamma in (0.9, 0.5):
            params = Params.of(incorrect="hit", gamma=gamma, solver="planning")
            trial = BaselineCondition(small_demos, name, params).trial(seed=trial_seeds(13, 1)[0])
            assert (trial.iterations, trial.converged) == (1, False)
    assert [problem.gamma for problem in calls] == [0.9, 0.5] * 2
