from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs.toy_text.frozen_lake import FrozenLakeEnv
from gymnasium.wrappers import TransformAction

from replication import GymTask, TaskError
from replication.envs.gym import MazeEnv
from replication.envs.tasks.stepped import WrappedTask
from replication.envs.tasks.table import TabularTask

LAKE = ("left", "down", "right", "up")


def lake(**options: Any) -> gymnasium.Env[Any, Any]:
    """Return Gymnasium's frozen lake."""
    return gymnasium.make("FrozenLake-v1", **options)


@pytest.mark.parametrize("id", ["FrozenLake-v1", "CliffWalking-v1", "Taxi-v4"])
def test_tables_of_gymnasium_are_used(id: str) -> None:
    """An environment that has a table is a table, with Gymnasium's own starts and moves."""
    env = gymnasium.make(id)
    task = GymTask(env)
    assert isinstance(task.task, TabularTask)
    assert env.reset(seed=3)[0] in task.task.table.starts
    assert task.kind == "gymnasium"


def test_a_table_says_what_stepping_says() -> None:
    """The table and the environment agree along random episodes, where nothing is random."""
    env = gymnasium.make("CliffWalking-v1")
    task, rng = GymTask(env), np.random.default_rng(1)
    for _ in range(20):
        actions, states = [], [int(env.reset(seed=0)[0])]
        for action in rng.integers(4, size=30).tolist():
            observation, _, ended, _, _ = env.step(action)
            actions.append(action)
            states.append(int(observation))
            if ended:
                break
        assert task.replay(actions).tolist() == states
        assert task.fault(np.array(states), np.array(actions)) is None


class Icier(FrozenLakeEnv):
    """A lake whose steps are not those of its table."""

    def step(self, action: Any) -> Any:
        """Take the opposite action."""
        return super().step((action + 2) % 4)  # type: ignore[no-untyped-call]


@pytest.mark.parametrize(
    "env", [gymnasium.make("Taxi-v4", fickle_passenger=True), Icier(is_slippery=False)]
)
def test_a_table_that_steps_do_not_follow_is_not_used(env: gymnasium.Env[Any, Any]) -> None:
    """An environment whose steps may differ from its table is stepped."""
    assert isinstance(GymTask(env).task, WrappedTask)


def test_a_file_names_the_environment_not_how_it_is_shown() -> None:
    """Options are described, a limit of steps of one's own among them; a picture is none."""
    assert options(lake(is_slippery=False)) == options(lake()) | {"is_slippery": False}
    assert options(lake(render_mode="rgb_array")) == options(lake())
    assert options(lake(max_episode_steps=9)) == options(lake()) | {"max_episode_steps": 9}


def options(env: gymnasium.Env[Any, Any]) -> Any:
    """Return what a demonstration file says of an environment's options."""
    return GymTask(env).describe()["options"]


def test_a_move_that_ends_nothing_where_another_does_is_refused() -> None:
    """An end that depends on the move is no state's, so such a table is not taken."""
    moves = {
        0: {0: [(1.0, 1, 0.0, True)], 1: [(1.0, 1, 0.0, False)]},
        1: {0: [(1.0, 1, 0.0, True)], 1: [(1.0, 1, 0.0, True)]},
    }
    with pytest.raises(TaskError, match="a move from state 0 does not end the episode"):
        TabularTask(moves)


def test_a_wrapper_that_may_change_the_moves_hides_the_table() -> None:
    """Actions that a wrapper swaps are stepped, and lead where the wrapper leads them."""
    env = lake(is_slippery=False)
    swapped = TransformAction(env, lambda action: 3 - action, env.action_space)
    task = GymTask(swapped)
    assert isinstance(task.task, WrappedTask)
    assert task.replay([2, 2]).tolist() == GymTask(env).replay([1, 1]).tolist() == [0, 4, 8]
    assert task.kind == "own"


def test_a_reset_seed_fixes_the_start() -> None:
    """With a seed for resets there is one start, that of the environment."""
    env = gymnasium.make("Taxi-v4")
    task = GymTask(env, reset_seed=5)
    assert not task.is_random
    assert task.replay([]).tolist() == [int(env.reset(seed=5)[0])]
    assert GymTask(env).is_random


def test_environments_without_a_table_are_stepped() -> None:
    """Our own maze, which has no table that Gymnasium knows, is known by stepping it."""
    maze = MazeEnv(["S..", "##G"])
    task = GymTask(maze, actions=("up", "down", "right", "left"))
    assert isinstance(task.task, WrappedTask)
    assert not task.is_random
    assert task.replay([2, 2, 1]).tolist() == maze.maze.replay([2, 2, 1]).tolist()
    assert task.is_over(task.replay([2, 2, 1]), np.array([2, 2, 1]))


class Counted(gymnasium.Env[int, int]):
    """Five states in a row, whose states and actions are counted from 1."""

    observation_space: Any = spaces.Discrete(5, start=1)
    action_space: Any = spaces.Discrete(2, start=1)

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[int, dict[str, Any]]:
        """Go to the first state."""
        super().reset(seed=seed)
        self.at = 1
        return self.at, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Go on with action 2."""
        assert action in (1, 2)
        self.at += action - 1
        return self.at, 0.0, self.at == 5, False, {}


def test_spaces_may_begin_at_any_number() -> None:
    """States and actions are counted from 0, whatever the environment counts from."""
    task = GymTask(Counted())
    assert (task.n_states, task.n_actions) == (5, 2)
    assert task.replay([1, 0, 1, 1, 1]).tolist() == [0, 1, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("env", "message"),
    [
        ("CartPole-v1", r"CartPole-v1: observations are Box.*WrappedTask\(env, state, n_states\)"),
        ("Blackjack-v1", "Blackjack-v1: observations are Tuple"),
    ],
)
def test_observations_without_numbers_need_a_function(env: str, message: str) -> None:
    """What is not discrete is refused, with the way to number it."""
    with pytest.raises(TaskError, match=message):
        GymTask(gymnasium.make(env))


def test_continuous_actions_are_refused() -> None:
    """Actions that are not discrete cannot be numbered."""
    with pytest.raises(TaskError, match=r"MountainCarContinuous-v0: actions are Box"):
        WrappedTask(gymnasium.make("MountainCarContinuous-v0"), lambda observation: 0, 1)
