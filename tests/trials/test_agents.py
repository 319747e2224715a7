from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from replication import Demos, Params
from replication.envs.maze import MazeError, as_maze
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.rules import SoccerParams
from replication.envs.soccer.world import SoccerWorld
from replication.errors import UserError
from replication.learning.seeds import stream
from replication.paper.published import SOCCER
from replication.paper.register import ChoiceError
from replication.trials import maze_agent, soccer_agent
from replication.trials.condition import Condition, make_agent
from replication.trials.maze_agent import MazeAgent
from replication.trials.soccer_agent import SoccerAgent


def test_each_environment_has_its_agent(small_demos: Demos, soccer_demos: Demos) -> None:
    """A maze makes a maze agent, a field a soccer agent, another kind an error that lists both."""
    assert isinstance(make_agent(small_demos.environment, Params()), MazeAgent)
    assert isinstance(make_agent(soccer_demos.environment, Params.of(**SOCCER)), SoccerAgent)
    chess: Any = SimpleNamespace(kind="chess")
    with pytest.raises(ChoiceError, match="unknown kind of environment 'chess'; known: maze, socc"):
        make_agent(chess, Params())


def test_agents_refuse_the_other_kind_of_environment(
    small_demos: Demos, soccer_demos: Demos
) -> None:
    """The maze's agent needs a maze and the soccer agent a field: else one line says so."""
    with pytest.raises(MazeError, match=r"a maze is needed here, .* of kind 'soccer'"):
        maze_agent.make_agent(soccer_demos.environment, Params())
    with pytest.raises(UserError, match=r"robot soccer is needed here, .* of kind 'maze'"):
        soccer_agent.make_agent(small_demos.environment, Params())


def test_mazes_refuse_a_falling_epsilon(small_demos: Demos) -> None:
    """What the compiled maze learner cannot do is refused, not ignored."""
    with pytest.raises(ChoiceError, match=r"epsilon_end = 0\.3"):
        make_agent(small_demos.environment, Params.of(epsilon=0.3))


def test_hits_in_mazes_are_the_moves_that_change_nothing(stored_demos: Demos) -> None:
    """A maze's episode moves by the table, and hits something just where it stays in place."""
    maze = as_maze(stored_demos.environment)
    agent = make_agent(maze, Params.of(horizon=60))
    rng = np.random.default_rng(1)
    seen: set[bool] = set()
    for seed in range(20):
        q = rng.integers(0, 3, size=agent.shape).astype(float)
        episode, _ = agent.roll_out(q, stream(np.random.SeedSequence(seed)))
        moves = zip(episode.states.tolist(), episode.actions.tolist(), strict=False)
        there = [int(maze.next_state[state, action]) for state, action in moves]
        assert episode.states[1:].tolist() == there
        assert episode.hits.tolist() == [
            a == b for a, b in zip(episode.states, there, strict=False)
        ]
        assert episode.hits.dtype == np.bool_
        seen.update(episode.hits.tolist())
    assert seen == {True, False}


@pytest.mark.parametrize("macro", ["decision", "cell"])
def test_hits_in_soccer_are_the_decisions_with_contacts(soccer_demos: Demos, macro: str) -> None:
    """Where the plain world, given an episode's actions, counts more contacts, there is a hit."""
    assert isinstance(soccer_demos.environment, SoccerField)
    field = replace(soccer_demos.environment, params=SoccerParams(macro=macro, time_limit=60.0))
    agent = make_agent(field, Params.of(**SOCCER))
    world = SoccerWorld(field.params)
    seen: set[bool] = set()
    for seed in range(4):
        q = np.random.default_rng(seed).integers(0, 3, size=agent.shape).astype(float)
        episode, _ = agent.roll_out(q, stream(np.random.SeedSequence(seed)))
        states, touched = [world.reset()], []
        for action in episode.actions.tolist():
            before = world.contacts
            states.append(world.step(action)[0])
            touched.append(world.contacts != before)
        assert episode.states.tolist() == states
        assert episode.hits.tolist() == touched
        seen.update(touched)
    assert seen == {True, False}


def test_soccer_goal_value_matters(soccer_demos: Demos) -> None:
    """GOAL-VALUE bootstrap changes what is learned where a goal falls, and nothing before."""
    tables = []
    for goal_value in ("zero", "bootstrap"):
        condition = Condition(soccer_demos, "unified", Params.of(**SOCCER, goal_value=goal_value))
        (correct,) = soccer_demos.correct
        weights = np.zeros(condition.agent.shape)
        weights[correct.states[:-1], correct.actions] = 1.0
        words = stream(np.random.SeedSequence(2))
        tables.append(condition.agent.learn(weights, np.zeros_like(weights), words)[0])
    assert not np.array_equal(tables[0], tables[1])
