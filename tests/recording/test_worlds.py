from __future__ import annotations

import re
from typing import Any

import gymnasium
import numpy as np
import pytest

from replication import Bins, Demos, GymTask, Maze, TabularTask, WrappedTask
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.rules import FORWARD
from replication.errors import UserError
from replication.recording.worlds import as_world

MAZE = Maze.from_text("""
    ....G
    .##..
    S....
""")
UP, DOWN, RIGHT, LEFT = range(4)


def drawn(maze: Maze, actions: list[int], columns: int = 80, lines: int = 24) -> list[str]:
    """Draw a maze without colours."""
    world = as_world(maze)
    text = world.draw(actions, world.play(actions, 0), columns, lines)
    return [re.sub(r"\x1b\[[0-9;]*m", "", line) for line in text]


class Drifting(gymnasium.Env[Any, Any]):
    """An environment that forgets its seed: each episode drifts a step further."""

    observation_space = gymnasium.spaces.Discrete(1000)
    action_space = gymnasium.spaces.Discrete(2)
    episodes = 0

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[int, dict[str, Any]]:
        """Begin one state further than the last time."""
        self.episodes += 1
        self.state = self.episodes
        return self.state, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Go on by one."""
        self.state += 1
        return self.state, 0.0, False, self.state > 900, {}


DICE = TabularTask(
    np.array([[[0.5, 0.5], [0.5, 0.5]], [[0.0, 1.0], [0.0, 1.0]]]),
    terminal=[1],
    actions=("roll", "throw"),
)
"""Both actions lead from state 0 to state 0 or 1, where it ends."""


def test_the_way_is_drawn() -> None:
    """The agent is @; the cells that it left point where it went."""
    assert drawn(MAZE, []) == [". . . . G", ". # # . .", "@ . . . ."]
    assert drawn(MAZE, [RIGHT, RIGHT, RIGHT, UP]) == [". . . . G", ". # # @ .", "S > > ^ ."]


def test_a_small_terminal_shows_the_agent() -> None:
    """Where the maze has no room, the part around the agent is drawn."""
    assert drawn(MAZE, [], columns=4, lines=2) == [". #", "@ ."]
    assert drawn(MAZE, [RIGHT] * 4, columns=4, lines=2) == [". .", "> @"]
    assert drawn(MAZE, [], columns=1, lines=1) == ["@"]


def test_what_happened_is_told() -> None:
    """A wall and the goal are named; after the goal it is over."""
    world = as_world(MAZE)
    assert world.play([DOWN], 0).told == "hits a wall and stays"
    end = world.play([RIGHT] * 4 + [UP] * 2, 0)
    assert (end.told, end.over) == ("reaches the goal [0,4]", True)
    assert world.play([RIGHT], 0).told == ""


def test_soccer_is_played() -> None:
    """The field has no picture, but states and an end."""
    world = as_world(SoccerField())
    scene = world.play([FORWARD], 0)
    assert len(scene.states) == 2
    assert world.draw([FORWARD], scene, 80, 24) == []


def test_soccer_ends_with_a_goal(soccer_demos: Demos) -> None:
    """The stored correct demonstration is over at its last step, not before."""
    world = as_world(soccer_demos.environment)
    actions = soccer_demos.correct[0].actions.tolist()
    assert world.play(actions, 0).told == "reaches the gate: a goal"
    assert not world.play(actions[:-1], 0).over


def test_a_maze_of_gymnasium_is_a_maze() -> None:
    """The environment `replication/Maze-v0` is drawn and recorded as its maze."""
    env = gymnasium.make("replication/Maze-v0", maze=MAZE)
    assert as_world(env).environment is MAZE


def test_gymnasium_draws_itself() -> None:
    """An environment that can draw itself as text does so, however it was made."""
    world = as_world(gymnasium.make("FrozenLake-v1", is_slippery=False))
    scene = world.play([1, 1], 0)
    assert scene.states == (0, 4, 8)
    assert world.draw([1, 1], scene, 80, 24)[-1] == "HFFG"


@pytest.mark.parametrize(
    ("id", "name", "leads_to"),
    [
        ("FrozenLake-v1", "right", 1),
        ("FrozenLake8x8-v1", "down", 8),
        ("CliffWalking-v1", "up", 24),
        ("Taxi-v4", "east", None),
    ],
)
def test_actions_that_are_documented_have_names(id: str, name: str, leads_to: int | None) -> None:
    """The names of Gymnasium's documentation are those of what the actions do."""
    options = {"is_slippery": False} if "Lake" in id else {}
    world = as_world(gymnasium.make(id, **options))
    states = world.play([world.environment.actions.index(name)], 3).states
    assert leads_to is None or states[1] == leads_to


def test_the_end_of_an_episode_is_told() -> None:
    """A hole ends it, and so does the time limit."""
    lake = gymnasium.make("FrozenLake-v1", is_slippery=False, max_episode_steps=3)
    world = as_world(lake)
    hole = world.play([2, 1], 0)
    assert (hole.told, hole.over) == ("reward 0, and the episode is over", True)
    late = world.play([0, 0, 0], 1)
    assert (late.told, late.over) == ("reward 0, and the episode is over: its time is up", True)


def test_luck_repeats_in_an_attempt() -> None:
    """An undone random move ends up where it did before; another attempt has other luck."""
    world = as_world(gymnasium.make("FrozenLake-v1"))
    plays = [world.play([1, 2, 1], attempt).states for attempt in range(20)]
    assert world.play([1, 2], 19).states == plays[19][:3]
    assert world.play([1, 2, 1], 19).states == plays[19]
    assert [world.play([1, 2, 1], attempt).states for attempt in range(20)] == plays
    assert len(set(plays)) > 1


def test_nobody_else_steps_it() -> None:
    """What is recorded goes on where it was, although its task is walked to check something."""
    lake = gymnasium.make("FrozenLake-v1", is_slippery=False)
    for task in (GymTask(lake), WrappedTask(lake, int, 16)):
        world = as_world(task)
        world.play([1, 1], 0)
        task.walk([2, 2])
        lake.reset(seed=1)
        assert world.play([1, 1, 2], 0).states == (0, 4, 8, 9)


def test_an_observation_is_numbered() -> None:
    """A task that numbers observations is recorded by its numbers."""
    car = WrappedTask(gymnasium.make("MountainCar-v0"), Bins([-1.2, -0.07], [0.6, 0.07], [9, 9]))
    states = as_world(car).play([2, 2, 2], 5).states
    assert len(states) == 4
    assert all(0 <= state < 81 for state in states)


def test_a_start_that_was_chosen_is_kept() -> None:
    """Where every episode starts by one seed, so does what is recorded."""
    env = gymnasium.make("Taxi-v4")
    fixed = as_world(GymTask(env, reset_seed=3))
    assert {fixed.play([], attempt).states for attempt in range(5)} == {fixed.play([], 9).states}
    free = as_world(GymTask(env))
    assert len({free.play([], attempt).states for attempt in range(5)}) > 1


def test_an_environment_that_does_not_repeat_itself_is_found_out() -> None:
    """Where a step cannot be undone, that is said, instead of showing another way."""
    world = as_world(Drifting())
    first = world.play([0, 0], 0).states
    assert first == (first[0], first[0] + 1, first[0] + 2)
    with pytest.raises(UserError, match="does not repeat itself"):
        world.play([0], 0)


def test_a_table_is_played() -> None:
    """A task whose moves are not random needs no luck."""
    world = as_world(TabularTask([[0, 1], [0, 2], [2, 2]], terminal=[2], actions=("back", "on")))
    scene = world.play([1, 1], 0)
    assert (scene.states, scene.over) == ((0, 1, 2), True)
    assert scene.told == "reaches an end of the episode"
    assert world.play([0], 0).told == "changes nothing"


def test_a_random_task_is_played_by_its_table() -> None:
    """Each attempt has its own luck, which does not change, and ends where the table says."""
    world = as_world(DICE)
    plays = [world.play([0, 1, 0], attempt) for attempt in range(20)]
    assert plays == [world.play([0, 1, 0], attempt) for attempt in range(20)]
    assert len({play.states for play in plays}) > 1
    assert all(play.over == (play.states[-1] == 1) for play in plays)
    assert world.play([0, 1], 3).states == plays[3].states[:3]


@pytest.mark.parametrize("given", [5, None, gymnasium.make("CartPole-v1")])
def test_what_has_no_numbers_is_refused(given: object) -> None:
    """Only environments with numbered states and actions can be recorded."""
    with pytest.raises(UserError):
        as_world(given)
