from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from replication import Demos, Fit, GymTask, Maze, Params, TabularTask, fit, fit_many, make_demos
from replication.demos.checks import DemoWarning
from replication.errors import UserError
from replication.fitting import PLATEAU, ROLLOUTS, own_params
from replication.learning.planning import plan
from replication.trials.condition import Condition
from replication.trials.run import run_trials
from replication.trials.store import Store

FEW = Params.of(incorrect="all", episodes=300, horizon=50)


@pytest.fixture(scope="module")
def fitted(small_demos: Demos) -> Fit:
    """Learn once for all tests."""
    return fit(small_demos, params=FEW, seed=3)


def test_fit_repeats_the_demonstration(fitted: Fit) -> None:
    """A converged fit walks the expert's path, and its last error is within the threshold."""
    assert fitted.converged
    np.testing.assert_array_equal(fitted.states, fitted.demos.correct[0].states)
    assert fitted.errors[-1] <= fitted.params.loop.threshold
    assert fitted.iterations == len(fitted.errors) - 1


def test_fit_is_trial_0_of_the_same_root(fitted: Fit, small_demos: Demos, store_path: Path) -> None:
    """The front door and the batch compute the same bits."""
    condition = Condition(small_demos, "unified-incorrect", FEW)
    trial = run_trials([condition], trials=1, store=Store(store_path), seed=3).trial(condition, 0)
    np.testing.assert_array_equal(fitted.weights, trial.weights)
    np.testing.assert_array_equal(fitted.q, trial.q)
    np.testing.assert_array_equal(fitted.errors, trial.errors)
    np.testing.assert_array_equal(fitted.states, trial.episodes[-1].states)
    np.testing.assert_array_equal(fitted.actions, trial.episodes[-1].actions)


def test_another_seed_gives_another_course(fitted: Fit, small_demos: Demos) -> None:
    """The seed matters, and the same seed gives the same bits."""
    again, other = (fit(small_demos, params=FEW, seed=seed) for seed in (3, 4))
    np.testing.assert_array_equal(again.q, fitted.q)
    assert not np.array_equal(other.q, fitted.q)


def test_each_update_is_reported(fitted: Fit, small_demos: Demos) -> None:
    """A report gets the error before each weight update, and changes nothing."""
    told: list[tuple[int, float]] = []
    again = fit(small_demos, params=FEW, seed=3, report=lambda *news: told.append(news))
    assert told == list(enumerate(fitted.errors[:-1], start=1))
    np.testing.assert_array_equal(again.q, fitted.q)


# --- tasks of one's own ----------------------------------------------------------------------

LAKE = ("left", "down", "right", "up")
ACROSS = ["down", "down", "right", "right", "down", "right"]
ALONG = ["right", "right", "down", "down", "down", "right"]


def lake(*, slippery: bool = False) -> GymTask:
    """Return the frozen lake."""
    env = gymnasium.make("FrozenLake-v1", is_slippery=slippery, max_episode_steps=1000)
    return GymTask(env, actions=LAKE)


@pytest.mark.parametrize("method", ["adaboost", "unified", "unified-incorrect"])
def test_every_method_learns_gymnasium_tasks(method: str) -> None:
    """FrozenLake and CliffWalking, which nobody here wrote, are learned exactly."""
    cliff = GymTask(gymnasium.make("CliffWalking-v1"), actions=("up", "right", "down", "left"))
    for task, way in ((lake(), ACROSS), (cliff, ["up", *["right"] * 11, "down"])):
        result = fit({"correct": [way], "other": [["left"]]}, task=task, method=method, seed=1)
        assert result.converged
        assert [action for _, action in result.path[:-1]] == way


def test_two_ways_end_on_a_plateau_with_a_word() -> None:
    """Correct demonstrations that differ give the nearest reward, and the fit says why it ended."""
    with pytest.warns(DemoWarning) as told:
        result = fit({"correct": [ACROSS, ALONG]}, task=lake(), seed=1)
    assert any("2 different trajectories" in str(one.message) for one in told)
    assert (result.stopped, result.converged) == ("plateau", False)
    assert result.iterations == result.errors.argmin() + PLATEAU
    assert result.error == result.errors.min()
    assert [action for _, action in result.path[:-1]] in (ACROSS, ALONG)
    assert f"no smaller d in {PLATEAU} iterations" in result.summary()


def test_slippery_ice_is_learned_from_many_demonstrations() -> None:
    """Where moves are random, the policy of the demonstrations comes out again."""
    task = lake(slippery=True)
    table = task.env.unwrapped.P
    reward = np.array(
        [[sum(p * r for p, _, r, _ in table[s][a]) for a in range(4)] for s in range(16)]
    )
    policy = plan(reward, task.task.table.ahead, gamma=0.99).argmax(axis=1)  # type: ignore[union-attr]
    ways: list[Any] = []
    for seed in range(60):
        states, actions, over = [int(task.env.reset(seed=seed)[0])], list[int](), False
        while not over:
            actions.append(int(policy[states[-1]]))
            state, _, over, *_ = task.env.step(actions[-1])
            states.append(int(state))
        ways.append((states, actions))
    result = fit({"correct": ways}, task=task, seed=1)
    assert result.stopped == "plateau"
    assert result.error < 0.25 * result.errors[0]
    often = [0, 4, 8, 9, 10, 14]
    assert (result.policy()[often] == policy[often]).mean() >= 5 / 6


def test_own_parameters_suit_the_task() -> None:
    """Random moves get many trajectories; a plateau may end what cannot be matched."""
    sure, coin = lake(), TabularTask(np.array([[[0.5, 0.5]], [[0.0, 1.0]]]), terminal=[1])
    one = own_params(make_demos(sure, {"correct": [ACROSS]}))
    two = own_params(make_demos(sure, {"correct": [ACROSS, ALONG]}))
    odds = own_params(make_demos(coin, {"correct": [([0, 1], [0])]}))
    assert [p.loop.rollouts for p in (one, two, odds)] == [1, 1, ROLLOUTS]
    assert [p.loop.plateau for p in (one, two, odds)] == [0, PLATEAU, PLATEAU]
    assert own_params(make_demos(sure, {"correct": [ACROSS]}), alpha=0.2).update.alpha == 0.2
    assert one.demonstrations.incorrect == "all"


def test_values_by_name_are_parameters(small_demos: Demos) -> None:
    """A value that the register does not list is taken within its range, and makes a difference."""
    few: dict[str, Any] = {"episodes": 300, "horizon": 50}
    one, other = fit(small_demos, seed=3, **few), fit(small_demos, seed=3, alpha=0.2, **few)
    assert other.params == Params.of(incorrect="all", alpha=0.2, **few)
    assert not np.array_equal(one.weights, other.weights)


@pytest.mark.parametrize(
    ("given", "options", "message"),
    [
        (None, {"seed": -1}, "seed = -1 must be a whole number, at least 0"),
        (None, {"task": gymnasium.make("FrozenLake-v1")}, r"is no task; wrap it: GymTask.env."),
        ({"correct": [[0]]}, {}, r"need their environment: fit\(\.\.\., task=\.\.\.\)"),
        (None, {"params": Params(), "alpha": 0.2}, "give alpha = 0.2 or params, not both"),
        (None, {"alhpa": 0.2}, "unknown parameter 'alhpa' .did you mean 'alpha'"),
        (None, {"alpha": 1.5}, r"Update\.alpha = 1\.5 is not accepted .* from 0\.0 to 1\.0"),
        (None, {"alpha": float("nan")}, r"Update\.alpha = nan is not accepted"),
        (None, {"method": "unify"}, "unknown method"),
        (None, {"method": "unify", "incorrect": "hit"}, "unknown method"),
        (None, {"incorrect": "hits"}, "no incorrect demo of kind 'hits'; use all, none, hit"),
    ],
)
def test_mistakes_of_a_call_are_one_line(
    small_demos: Demos, given: Any, options: dict[str, Any], message: str
) -> None:
    """What is missing, unknown or out of range is said in one line."""
    with pytest.raises(UserError, match=message) as caught:
        fit(given or small_demos, **options)
    assert "\n" not in str(caught.value)


def test_a_demonstration_that_stops_too_early_is_told() -> None:
    """If the episode goes on after a correct demonstration, a warning says how to end both."""
    endless = TabularTask([[1, 0], [0, 1]], actions=("go", "stay"))
    with pytest.warns(
        DemoWarning, match="stops after 2 steps, but the episode goes on.*horizon = 2"
    ):
        fit({"correct": [["go", "stay"]]}, task=endless, seed=1, max_iterations=1)
    result = fit({"correct": [["go", "stay"]]}, task=endless, seed=1, horizon=2)
    assert result.converged


def test_a_demonstration_beyond_the_horizon_is_told(small_demos: Demos) -> None:
    """No agent can go on longer than the horizon lets it."""
    with pytest.warns(DemoWarning, match=r"has \d+ steps, but horizon = 2"):
        fit(small_demos, seed=1, horizon=2, max_iterations=1)


def test_a_reward_of_nothing_is_told() -> None:
    """If nothing is better than the untrained agent, a warning says so and what to try."""
    coin = TabularTask(np.array([[[0.5, 0.5]] * 2, [[0.0, 1.0]] * 2]), terminal=[1])
    ways = [([0, 1], [0]), ([0, 1], [1])]
    with pytest.warns(DemoWarning) as told:
        result = fit({"correct": ways}, task=coin, seed=1, plateau=1, rollouts=2000)
    assert not result.weights.any()
    assert any("nothing was better than the untrained" in str(one.message) for one in told)


def test_the_horizon_is_that_of_the_environment() -> None:
    """An environment that cuts its episodes earlier than we do gives the horizon."""
    short = gymnasium.make("FrozenLake-v1", is_slippery=False, max_episode_steps=30)
    for env, due in ((short, 30), (gymnasium.make("CliffWalking-v1"), 500)):
        demos = make_demos(GymTask(env), {"correct": [[0]]})
        assert own_params(demos).learner.horizon == due


def test_kinds_of_mistakes_are_chosen_by_name() -> None:
    """A user's own kinds are taken as `incorrect`, alone or together."""
    ways = {"correct": [ACROSS], "hole": [["right", "down"]], "bump": [["left"]]}
    for kinds in ("hole", "hole+bump", "none"):
        result = fit(ways, task=lake(), seed=1, incorrect=kinds)
        assert "+".join(result.demos.kinds) == kinds.replace("none", "")


@pytest.mark.parametrize("method", ["adaboost", "unified", "perceptron", "one-line", "cloning"])
def test_kinds_are_not_taken_by_who_uses_none(small_demos: Demos, method: str) -> None:
    """A choice that would be ignored is refused, with the methods that do not; "none" is true."""
    able = "unified-incorrect, .*wary, .*bayesian, .*ranking"
    for kinds in ("hit", "all"):
        with pytest.raises(UserError, match=f"'{method}' uses no .* take one of {able}") as caught:
            fit(small_demos, method=method, seed=1, incorrect=kinds)
        assert "\n" not in str(caught.value)
        assert f"leave out incorrect = '{kinds}'" in str(caught.value)
    result = fit(small_demos, method=method, seed=1, incorrect="none", solver="planning")
    assert result.demos.incorrect == ()


def test_many_fits_are_a_table() -> None:
    """Each seed is a row, the same as that of a single fit."""
    table = fit_many({"correct": [ACROSS]}, seeds=[3, 1], task=lake(), progress=False)
    assert table.columns.tolist() == [
        *("seed", "method", "iterations", "converged", "stopped", "error")
    ]
    single = fit({"correct": [ACROSS]}, task=lake(), seed=1)
    assert table["seed"].tolist() == [3, 1]
    assert table.loc[1, "iterations"] == single.iterations
    assert table.loc[1, "stopped"] == "threshold"


def test_a_task_may_stand_in_for_another() -> None:
    """Demonstrations of a maze are checked again in the task that is given."""
    demos = Maze.from_text("S.G")
    made = make_demos(demos, {"correct": [["right", "right"]]})
    table = TabularTask(demos.next_state, start=0, terminal=[2], actions=demos.actions)
    assert fit(made, task=table, seed=1).path[-1] == ((2,), "")
