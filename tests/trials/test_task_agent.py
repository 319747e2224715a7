from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

from replication import Bins, GymTask, Maze, Params, TabularTask, TaskError, WrappedTask
from replication.envs.gym import MazeEnv
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
    from replication.learning import reference

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


def test_a_function_that_errs_while_learning_is_one_line() -> None:
    """States that are no numbers, met only while learning, are told with the task's name."""
    calls: list[int] = []

    def late(observation: Any) -> Any:
        calls.append(1)
        return 0 if len(calls) < 2000 else "x" if wrong == "text" else 99

    for wrong in ("text", "number"):
        calls.clear()
        task = WrappedTask(gymnasium.make("MountainCar-v0"), late, 4)
        agent = make_agent(task, Params.of(episodes=100, horizon=100))
        with pytest.raises(TaskError, match=r"^MountainCar-v0: each state must be a whole number"):
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
    with pytest.raises(TaskError, match="an environment of kind 'maze' has no agent"):
        make_task_agent(MAZE, Params())
