from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from replication import (
    DemoError,
    Demos,
    Fit,
    GymTask,
    Params,
    TabularTask,
    WrappedTask,
    fit,
)
from replication.errors import UserError
from replication.result import FitError
from tests.conftest import Spoil

LAKE = ("left", "down", "right", "up")
ACROSS = ["down", "down", "right", "down", "right", "right"]
CORRIDOR = TabularTask([[0, 1], [0, 2], [2, 2]], terminal=[2], actions=("back", "on"))


@pytest.fixture(scope="module")
def fitted(small_demos: Demos) -> Fit:
    """Learn once for all tests."""
    params = Params.of(incorrect="all", episodes=300, horizon=50)
    return fit(small_demos, params=params, seed=3)


@pytest.fixture(scope="module")
def corridor() -> Fit:
    """Learn in a corridor."""
    return fit({"correct": [["on", "on"]], "dawdle": [["back"]]}, task=CORRIDOR, seed=1)


# --- what it says ----------------------------------------------------------------------------


def test_a_fit_shows_itself_in_one_line(corridor: Fit) -> None:
    """Printed or shown in a notebook, a fit is a line, not its arrays."""
    count = corridor.iterations
    ended = f"converged after {count} iteration{'s' * (count != 1)}"
    assert repr(corridor) == f"<Fit of 'mine' by unified-incorrect: {ended}>"


def test_a_summary_says_what_came_out_and_why_it_ended(corridor: Fit) -> None:
    """Task, demonstrations, method, reason to stop and path are there."""
    summary = corridor.summary()
    for part in (
        "mine: 3 states, 2 actions",
        "1 correct, 1 dawdle",
        "unified-incorrect seed 1 INCORRECT-KINDS=all",
        "converged: d is within the threshold",
        "path        0 1 2 (2 steps)",
    ):
        assert part in summary


def test_reasons_to_stop_are_told_apart(small_demos: Demos) -> None:
    """A cap is no plateau, and its summary says so."""
    result = fit(small_demos, seed=1, max_iterations=1, episodes=2)
    assert result.stopped == "cap"
    assert "ended at the cap of 1 iterations" in result.summary()
    assert result.error == result.errors[-1]


def test_a_path_is_in_the_terms_of_its_environment(fitted: Fit) -> None:
    """A path in a maze has rows and columns and names of actions."""
    first, *_, last = fitted.path
    assert first[0] == fitted.demos.environment.cell(int(fitted.states[0]))
    assert first[1] == fitted.demos.environment.actions[fitted.actions[0]]
    assert last == (fitted.demos.environment.cell(int(fitted.states[-1])), "")


# --- policy and reward -----------------------------------------------------------------------


def test_predictions_are_the_greedy_policy(fitted: Fit) -> None:
    """A state's number and its cell give the action of greatest Q."""
    environment = fitted.demos.environment
    for state, action in enumerate(fitted.policy().tolist()):
        assert fitted.q[state, action] == fitted.q[state].max()
        name = environment.actions[action]
        assert name == fitted.predict(state) == fitted.predict(environment.cell(state))
        assert fitted.predict(np.int64(state)) == name


def test_rewards_are_the_weights(corridor: Fit) -> None:
    """A reward is that of a state and an action, by name or number."""
    for state in range(2):
        for number, name in enumerate(("back", "on")):
            due = corridor.weights[state, number]
            assert corridor.reward(state, name) == corridor.reward(state, number) == due


def test_where_nobody_was_there_is_no_reward(corridor: Fit) -> None:
    """A state that neither a demonstration nor the agent left is refused, not rewarded by 0."""
    with pytest.raises(FitError, match=r"^state 2 has no reward: .* was ever there"):
        corridor.reward(2, "on")
    assert corridor.predict(2) in ("back", "on")


@pytest.mark.parametrize("state", [3, -1, "1", 0.5, (1, 2), None])
def test_unseen_states_are_one_line(corridor: Fit, state: Any) -> None:
    """What is no state of the task has neither action nor reward."""
    for ask in (corridor.predict, lambda state: corridor.reward(state, "on")):
        with pytest.raises(UserError, match=r"there is no state .*; states are 0\.\.2$"):
            ask(state)
    with pytest.raises(DemoError, match="unknown action 'away'"):
        corridor.reward(0, "away")


def test_observations_are_numbered_by_the_task() -> None:
    """A function's numbers count, whatever the observation itself looks like."""
    env = gymnasium.make("FrozenLake-v1", is_slippery=False)
    task = WrappedTask(env, lambda seen: 15 - int(seen), 16, actions=LAKE)
    result = fit({"correct": [ACROSS]}, task=task, seed=1)
    seen = [0, 4, 8, 9, 13, 14]
    assert [result.predict(one) for one in seen] == ACROSS
    assert result.policy()[[15 - one for one in seen]].tolist() == [LAKE.index(a) for a in ACROSS]


@pytest.mark.parametrize("cell", [(9, 9), (), (0,), ((0, 1), 2)])
def test_cells_that_are_none_are_refused(fitted: Fit, cell: Any) -> None:
    """Row and column are two numbers of the maze; a list or an array will do as well."""
    with pytest.raises(FitError, match="there is no state"):
        fitted.predict(cell)
    assert fitted.predict([0, 0]) == fitted.predict(np.array([0, 0])) == fitted.predict((0, 0))


# --- pictures --------------------------------------------------------------------------------


def test_each_kind_of_task_has_a_picture(fitted: Fit, corridor: Fit, soccer_demos: Demos) -> None:
    """A maze shows path, reward and errors; a task without a map shows the reward on its path."""
    soccer = fit(soccer_demos, seed=1, episodes=2, max_iterations=1)
    figures = [one.plot() for one in (fitted, corridor, soccer)]
    panels = [sum(bool(axes.get_title()) for axes in figure.axes) for figure in figures]
    assert panels == [3, 2, 2]
    for line, action in zip(figures[1].axes[0].lines, ("on", "back"), strict=True):
        assert list(line.get_ydata()) == [corridor.reward(0, action), corridor.reward(1, action)]  # type: ignore[arg-type]


# --- files -----------------------------------------------------------------------------------


def test_saved_fit_loads_with_every_bit(fitted: Fit, tmp_path: Path) -> None:
    """Save and load are inverse, and saving again writes the same bytes."""
    path = fitted.save(tmp_path / "fit.json")
    loaded = Fit.load(path)
    for name in ("weights", "q", "states", "actions", "errors"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(fitted, name))
    assert (loaded.method, loaded.params, loaded.seed, loaded.converged) == (
        fitted.method,
        fitted.params,
        fitted.seed,
        fitted.converged,
    )
    assert loaded.demos == fitted.demos
    assert loaded.save(tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_saved_fit_is_plain_json(fitted: Fit, tmp_path: Path) -> None:
    """Other programs can read the file without this package."""
    document = json.loads(fitted.save(tmp_path / "fit.json").read_text(encoding="utf-8"))
    assert document["format"] == "replication-fit"
    assert np.array(document["weights"]).shape == (fitted.demos.environment.n_states, 4)


@pytest.mark.parametrize(
    "text", ["", "{}", "[]", '{"format": "replication-fit", "version": 9}', '{"format": "other"}']
)
def test_other_files_are_refused_in_one_line(text: str, tmp_path: Path) -> None:
    """A file that holds no fit gives one clear error with its name."""
    path = tmp_path / "broken.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FitError, match=r"broken\.json") as caught:
        Fit.load(path)
    assert "\n" not in str(caught.value)


def test_whatever_is_in_the_place_of_a_fit(tmp_path: Path, spoil: Spoil) -> None:
    """A pipe, a device, a folder, a huge file and JSON that is none are refused in one line."""
    spoil(tmp_path / "fit.json")
    with pytest.raises(FitError, match=r"fit\.json: is [^\n]+$"):
        Fit.load(tmp_path / "fit.json")


def test_truncated_fit_is_refused(fitted: Fit, tmp_path: Path) -> None:
    """Half a file is not taken for a whole one."""
    path = fitted.save(tmp_path / "fit.json")
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(FitError):
        Fit.load(path)


def test_fits_of_tasks_are_saved_too(corridor: Fit, tmp_path: Path) -> None:
    """A fit in a registered environment loads by itself, one in a user's own with its task."""
    lake = GymTask(gymnasium.make("FrozenLake-v1", is_slippery=False))
    saved = fit({"correct": [[1, 1, 2, 2, 1, 2]]}, task=lake, seed=1)
    again = Fit.load(saved.save(tmp_path / "lake.json"))
    np.testing.assert_array_equal(again.weights, saved.weights)
    path = corridor.save(tmp_path / "corridor.json")
    np.testing.assert_array_equal(Fit.load(path, task=CORRIDOR).q, corridor.q)
    with pytest.raises(UserError, match=r"corridor\.json.*task="):
        Fit.load(path)
