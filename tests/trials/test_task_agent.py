from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import pytest

from replication import Bins, GymTask, Maze, Params, TabularTask, Task, TaskError, WrappedTask, fit
from replication.envs.gym import MazeEnv
from replication.envs.tasks.base import Walk
from replication.learning import reference
from replication.learning.seeds import stream
from replication.paper.register import ChoiceError
from replication.trials.agents import make_agent
from replication.trials.table_agent import TableAgent
from replication.trials.task_agent import make_agent as make_task_agent

MAZE = Maze.from_text("""
    ....G
    .##..
    S....
""")
FEW = {"episodes": 50, "horizon": 40}


def words(seed: int = 1) -> Any:
    """Return a random stream."""
    return stream(np.random.SeedSequence(seed))


def weights(shape: tuple[int, int]) -> Any:
    """Return some reward weights."""
    return np.random.default_rng(2).normal(size=shape)


@pytest.mark.parametrize("solver", ["q-learning", "planning"])
def test_a_maze_as_a_table_is_learned_as_a_maze(solver: str) -> None:
    """The same moves give the same bits, whether a maze or a user's table holds them."""
    table = TabularTask(MAZE.next_state, start=MAZE.start, terminal=[MAZE.goal])
    params = Params.of(**FEW, solver=solver)
    one, other = make_agent(MAZE, params), make_agent(table, params)
    assert isinstance(one, TableAgent)
    assert one.shape == other.shape
    q = np.zeros(one.shape)
    learned = [agent.learn(weights(one.shape), q, words()) for agent in (one, other)]
    np.testing.assert_array_equal(learned[0][0], learned[1][0])
    assert learned[0][1].tolist() == learned[1][1].tolist()
    assert learned[0][2:] == learned[1][2:]
    rolled = [agent.roll_out(learned[0][0], words())[0] for agent in (one, other)]
    for a, b in zip(*rolled, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_maze_that_is_stepped_is_learned_as_a_maze() -> None:
    """Stepping an environment gives the Q of its table, but for the draw that seeds it."""
    params = Params.of(**FEW)
    stepped = make_agent(GymTask(MazeEnv(MAZE)), params)
    table = make_agent(MAZE, params)
    later = words()
    advanced = later.tolist()
    reference.draw(advanced)
    q = np.zeros(table.shape)
    one = stepped.learn(weights(table.shape), q, later)
    other = table.learn(weights(table.shape), q, np.array(advanced, np.uint64))
    np.testing.assert_array_equal(one[0], other[0])
    assert one[2:] == other[2:]


def test_the_end_of_an_episode_is_the_state_that_ended_it() -> None:
    """Of several terminal states a trajectory shows the one that it has reached."""
    task = TabularTask([[1, 2], [1, 1], [2, 2]], terminal=[1, 2])
    agent = make_agent(task, Params.of(**FEW))
    for action, end in ((0, 1), (1, 2)):
        q = np.zeros((3, 2))
        q[0, action] = 1.0
        episode, _ = agent.roll_out(q, words())
        assert (episode.states.tolist(), episode.actions.tolist()) == ([0, end], [action])


def test_planning_knows_the_odds() -> None:
    """On random moves a plan weighs outcomes by their probability, and ends count nothing."""
    moves = np.zeros((3, 2, 3))
    moves[0, 0], moves[0, 1] = [0, 0.5, 0.5], [0, 0, 1]
    moves[1, :, 2] = moves[2, :, 2] = 1
    agent = make_agent(TabularTask(moves, terminal=[2]), Params.of(solver="planning", gamma=0.5))
    reward = np.array([[1.0, 1.2], [3.0, 1.0], [9.0, 9.0]])
    q, after, steps, hits = agent.learn(reward, np.zeros((3, 2)), words())
    np.testing.assert_allclose(q[:2], [[1 + 0.5 * 0.5 * 3, 1.2], [3.0, 1.0]])
    assert (after.tolist(), steps, hits) == (words().tolist(), 0, 0)


@pytest.mark.parametrize("wrong", ["x", 99, 0.5])
def test_a_function_that_errs_while_learning_is_one_line(wrong: Any) -> None:
    """States that are no numbers, met only while learning, are told with the task's name."""
    calls = itertools.count()
    env = gymnasium.make("MountainCar-v0")
    task = WrappedTask(env, lambda _: 0 if next(calls) < 2000 else wrong, 4)
    agent = make_agent(task, Params.of(episodes=100, horizon=100))
    with pytest.raises(TaskError, match=r"^MountainCar-v0: the state of .*must be a whole"):
        agent.learn(np.zeros(agent.shape), np.zeros(agent.shape), words())


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"epsilon": 0.3}, "set epsilon_end = 0.3"),
        ({"arithmetic": "single"}, 'set arithmetic = "double"'),
        ({"solver": "planning"}, "no table to plan on"),
    ],
)
def test_what_stepping_cannot_do_is_refused(values: dict[str, Any], message: str) -> None:
    """A parameter that the agent cannot follow is refused, not ignored."""
    bins = Bins(low=[-1.2, -0.07], high=[0.6, 0.07], counts=[5, 5])
    task = WrappedTask(gymnasium.make("MountainCar-v0"), bins)
    with pytest.raises(ChoiceError, match=message):
        make_agent(task, Params.of(**values))


def test_planning_without_a_discount_is_refused() -> None:
    """Sums without end have no value: planning needs a discount below 1."""
    for environment in (MAZE, TabularTask(MAZE.next_state, start=MAZE.start)):
        with pytest.raises(ChoiceError, match="planning needs a discount below 1"):
            make_agent(environment, Params.of(solver="planning", gamma=1.0))


def test_mazes_have_an_agent_of_their_own() -> None:
    """The agent of tasks refuses what is no task."""
    with pytest.raises(TaskError, match="an agent needs a task that has a table of moves"):
        make_task_agent(MAZE, Params())


class Stairs(Task):
    """A task that somebody else wrote: five steps up, and what an agent learns on."""

    n_states = 6
    actions = ("stay", "up")

    def __init__(self) -> None:
        moves = [[k, min(k + 1, 5)] for k in range(6)]
        self.table = TabularTask(moves, terminal=5).table

    @property
    def is_random(self) -> bool:
        """Nothing is."""
        return False

    def walk(self, actions: Sequence[int]) -> Walk:
        """Count the steps up."""
        states = np.minimum(np.cumsum([0, *actions]), 5)
        return Walk(states, len(actions) if states[-1] == 5 else None)

    def fault(self, states: Any, actions: Any) -> str | None:
        """Find nothing."""
        return None

    def is_over(self, states: Any, actions: Any) -> bool:
        """Return whether one is at the top."""
        return bool(states[-1] == 5)

    def describe(self) -> dict[str, Any]:
        """Return plain values."""
        return {"kind": "own", "states": 6, "actions": ["stay", "up"]}


def test_a_task_of_another_class_is_learned() -> None:
    """What does all that a `Task` must do needs no other change."""
    assert fit({"correct": [["up"] * 5]}, task=Stairs(), seed=1).converged
