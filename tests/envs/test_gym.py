from __future__ import annotations

import math
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st

from replication import Demos
from replication.envs.gym import MazeEnv
from replication.envs.maze import ACTIONS, Maze, MazeError
from replication.envs.soccer import rules
from replication.envs.soccer.compiled import FastSoccerWorld
from tests.envs.mazes import CORRIDOR, ROWS, mazes


def test_maze_passes_gymnasiums_check() -> None:
    """Gymnasium's own checker finds no fault, in any render mode, with the default and own maps."""
    for mode in (None, "ansi", "rgb_array"):
        check_env(gymnasium.make("replication/Maze-v0", render_mode=mode).unwrapped)
    check_env(gymnasium.make("replication/Maze-v0", maze=ROWS).unwrapped)


@settings(max_examples=50, deadline=None)
@given(mazes(5), st.lists(st.integers(0, 3), max_size=60))
def test_maze_follows_the_table(maze: Maze, actions: list[int]) -> None:
    """An episode visits the states of the table, earns w[s, a] and terminates at the goal only."""
    weights = np.arange(maze.n_states * 4.0).reshape(-1, 4)
    env = MazeEnv(maze, weights)
    state, _ = env.reset()
    assert state == maze.start
    for action, due in zip(actions, maze.replay(actions)[1:], strict=True):
        there, reward, terminated, truncated, _ = env.step(action)
        assert there == due
        assert reward == weights[state, action]
        assert terminated == (there == maze.goal)
        assert not truncated
        state = there


def test_registered_maze_truncates_after_500_steps() -> None:
    """The registered environment cuts an episode at the paper's 500 steps, not earlier."""
    env = gymnasium.make("replication/Maze-v0", maze=Maze(CORRIDOR))
    env.reset(seed=1)
    cut = [env.step(0)[3] for _ in range(500)]
    assert cut == [False] * 499 + [True]


def test_maze_refuses_nonsense() -> None:
    """Wrong weights, render modes, actions and steps before a reset are refused clearly."""
    with pytest.raises(ValueError, match=r"shape \(2, 4\); this environment needs \(5, 4\)"):
        MazeEnv(CORRIDOR, np.zeros((2, 4)))
    with pytest.raises(ValueError, match="finite"):
        MazeEnv(CORRIDOR, np.full((5, 4), np.nan))
    with pytest.raises(ValueError, match="unknown render mode 'human'"):
        MazeEnv(CORRIDOR, render_mode="human")
    with pytest.raises(MazeError, match="no goal"):
        MazeEnv(["S.."])
    with pytest.raises(gymnasium.error.ResetNeeded):
        MazeEnv(CORRIDOR).step(0)
    env = MazeEnv(CORRIDOR)
    env.reset()
    for action in (4, -1):
        with pytest.raises(gymnasium.error.InvalidAction):
            env.step(action)


def test_rewards_are_a_copy() -> None:
    """Changing the caller's weights afterwards does not change the environment's rewards."""
    weights = np.ones((5, 4))
    env = MazeEnv(CORRIDOR, weights)
    weights[:] = 7
    env.reset()
    assert env.step(2)[1] == 1.0


def test_maze_is_drawn() -> None:
    """The text shows the agent at its cell; the image differs from the empty one there only."""
    env = MazeEnv(ROWS, render_mode="ansi")
    assert env.render() == "...#G\n.#...\nS..#.\n"
    env.reset()
    env.step(ACTIONS.index("right"))
    assert env.render() == "...#G\n.#...\nS@.#.\n"
    env = MazeEnv(ROWS, render_mode="rgb_array")
    empty = env.render()
    env.reset()
    image = env.render()
    assert image.dtype == np.uint8
    assert image.shape == (3 * 8, 5 * 8, 3)
    rows, columns = np.nonzero((image != empty).any(axis=2))
    assert set(rows // 8) == {2}
    assert set(columns // 8) == {0}


def test_soccer_does_what_its_world_does(soccer_demos: Demos) -> None:
    """The environment passes Gymnasium's checks and reports what its world does."""
    env = gymnasium.make("replication/Soccer-v0", render_mode="rgb_array")
    check_env(env.unwrapped)
    (correct,) = soccer_demos.correct
    world, last = FastSoccerWorld(), len(correct.actions) - 1
    state, _ = env.reset(seed=0)
    for i, action in enumerate(correct.actions.tolist()):
        assert state == world.state == correct.states[i]
        world.step(action)
        state, reward, terminated, truncated, info = env.step(action)
        assert (reward, terminated, truncated) == (0.0, i == last, False)
        assert (state, info["time"]) == (world.state, world.time)


def test_the_robot_is_drawn_where_it_is() -> None:
    """The robot is drawn where it is, and nowhere else."""
    env = gymnasium.make("replication/Soccer-v0", render_mode="rgb_array")
    env.reset()
    image: Any = env.render()
    blue = np.argwhere((image == (40, 80, 200)).all(axis=-1))
    row, column = blue.mean(axis=0)
    assert (column / 200, 1.2 - row / 200) == pytest.approx(rules.ROBOT_START, abs=0.02)
    assert np.ptp(blue, axis=0).max() < 0.075 * math.sqrt(2) * 200
