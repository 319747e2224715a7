from __future__ import annotations

import dataclasses
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from replication import Demos, Maze, Params
from replication.envs.maze import MazeError, as_maze
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.rules import FORWARD, SoccerParams
from replication.envs.soccer.world import SoccerWorld
from replication.errors import UserError
from replication.learning import reference, soccer
from replication.learning.seeds import stream
from replication.paper.params import Learner
from replication.paper.published import SOCCER
from replication.paper.register import ChoiceError
from replication.trials import soccer_agent, table_agent
from replication.trials.agents import make_agent
from replication.trials.condition import Condition
from replication.trials.soccer_agent import SoccerAgent
from replication.trials.table_agent import TableAgent

Array = NDArray[np.float64]


def test_each_environment_has_its_agent(small_demos: Demos, soccer_demos: Demos) -> None:
    """A maze makes a maze agent, a field a soccer agent, another kind an error that lists both."""
    assert isinstance(make_agent(small_demos.environment, Params()), TableAgent)
    assert isinstance(make_agent(soccer_demos.environment, Params.of(**SOCCER)), SoccerAgent)
    chess: Any = SimpleNamespace(kind="chess")
    with pytest.raises(ChoiceError, match="unknown kind of environment 'chess'; known: maze, socc"):
        make_agent(chess, Params())


def test_agents_refuse_the_other_kind_of_environment(
    small_demos: Demos, soccer_demos: Demos
) -> None:
    """The maze's agent needs a maze and the soccer agent a field: else one line says so."""
    with pytest.raises(MazeError, match=r"a maze is needed here, .* of kind 'soccer'"):
        table_agent.make_agent(soccer_demos.environment, Params())
    with pytest.raises(UserError, match=r"robot soccer is needed here, .* of kind 'maze'"):
        soccer_agent.make_agent(small_demos.environment, Params())


def test_mazes_refuse_a_falling_epsilon(small_demos: Demos) -> None:
    """What the compiled maze learner cannot do is refused, not ignored."""
    with pytest.raises(ChoiceError, match=r"^here the exploration .*: set epsilon_end = 0\.3"):
        make_agent(small_demos.environment, Params.of(epsilon=0.3))


@pytest.mark.parametrize("gamma", [0.0, 0.5, 0.9])
def test_planning_finds_what_no_policy_betters(small_demos: Demos, gamma: float) -> None:
    """SOLVER planning: Q is the fixed point of Eq. 1's target, with nothing beyond the goal."""
    maze = as_maze(small_demos.environment)
    agent = make_agent(maze, Params.of(solver="planning", gamma=gamma))
    weights = np.random.default_rng(1).normal(size=agent.shape)
    start = stream(np.random.SeedSequence(1))
    q, after, steps, hits = agent.learn(weights, np.ones(agent.shape), start)
    value = np.where(maze.next_state == maze.goal, 0.0, q.max(axis=1)[maze.next_state])
    np.testing.assert_allclose(q, weights + gamma * value, rtol=1e-13, atol=1e-13)
    assert (after.tolist(), steps, hits) == (start.tolist(), 0, 0)


def test_soccer_cannot_plan(soccer_demos: Demos) -> None:
    """Where there is no table, planning is refused."""
    with pytest.raises(ChoiceError, match='set solver = "q-learning"'):
        make_agent(soccer_demos.environment, Params.of(**SOCCER, solver="planning"))


# --- what reaches the learner: in mazes ------------------------------------------------------

UNUSUAL: dict[str, Any] = {
    "beta": 0.35,
    "gamma": 0.6,
    "epsilon": 0.25,
    "epsilon_end": 0.25,
    "episodes": 7,
    "horizon": 23,
    "ties": "first",
    "tie_tolerance": 1e-3,
    "arithmetic": "single",
}
"""A value of every field of the learner that none of them has otherwise."""

CHANGES: list[dict[str, Any]] = [
    {},
    {"beta": 0.6, "gamma": 0.35},
    {"beta": 0.9},
    {"gamma": 0.95},
    {"epsilon": 0.5, "epsilon_end": 0.5},
    {"episodes": 9},
    {"horizon": 230},
    {"ties": "random"},
    {"tie_tolerance": 1e-6},
    {"arithmetic": "double"},
    {"arithmetic": "fused"},
]


def values(shape: tuple[int, int], seed: int = 0) -> tuple[Array, Array]:
    """Return weights, and values of which many tie: exactly, or to one part in two thousand."""
    rng = np.random.default_rng(seed)
    q = rng.integers(1, 3, shape) * (1 + rng.choice([0.0, 0.0, 5e-4], shape))
    return rng.normal(size=shape) / 5, q


def by_the_reference(maze: Maze, fields: dict[str, Any]) -> tuple[Any, ...]:
    """Learn by the definition, given the learner's fields by their names."""
    weights, q = values((maze.n_states, maze.n_actions))
    return reference.learn(
        maze.next_state.tolist(),
        weights.tolist(),
        q.tolist(),
        stream(np.random.SeedSequence(3)).tolist(),
        start=maze.start,
        goal=maze.goal,
        episodes=fields["episodes"],
        horizon=fields["horizon"],
        beta=fields["beta"],
        gamma=fields["gamma"],
        epsilon=fields["epsilon"],
        tolerance=fields["tie_tolerance"],
        random_ties={"random": True, "first": False}[fields["ties"]],
        arithmetic=fields["arithmetic"],
    )


@pytest.mark.parametrize("change", CHANGES, ids=str)
def test_maze_agent_learns_by_its_fields(small_demos: Demos, change: dict[str, Any]) -> None:
    """Learning is the reference's with the learner's own fields; each of them changes it."""
    maze, fields = as_maze(small_demos.environment), UNUSUAL | change
    agent = make_agent(maze, Params.of(**fields, rollout_ties="random"))
    weights, q = values(agent.shape)
    learned, words, *counts = agent.learn(weights, q, stream(np.random.SeedSequence(3)))
    expected = by_the_reference(maze, fields)
    assert learned.tolist() == expected[0]
    assert words.tolist() == expected[1]
    assert counts == list(expected[2:])
    if change:
        assert expected[0] != by_the_reference(maze, UNUSUAL)[0]


def test_unusual_values_are_not_the_defaults() -> None:
    """No field of the learner has its default above, but for those that act elsewhere."""
    usual = {field.name: getattr(Learner(), field.name) for field in dataclasses.fields(Learner)}
    assert usual.keys() - UNUSUAL.keys() == {"q_start", "goal_value", "solver"}
    assert all(usual[name] != value for name, value in UNUSUAL.items())
    assert UNUSUAL.keys() == {name for change in CHANGES for name in change}


@pytest.mark.parametrize(
    "change", [{}, {"horizon": 90}, {"tie_tolerance": 1e-6}, {"rollout_ties": "first"}], ids=str
)
def test_maze_agent_rolls_out_by_its_fields(small_demos: Demos, change: dict[str, Any]) -> None:
    """A trajectory is the reference's, by ROLLOUT-TIES and not by TIES, without exploring."""
    maze, usual = as_maze(small_demos.environment), UNUSUAL | {"rollout_ties": "random"}

    def expected(fields: dict[str, Any], seed: int) -> tuple[Any, ...]:
        return reference.roll_out(
            maze.next_state.tolist(),
            values((maze.n_states, maze.n_actions), seed)[1].tolist(),
            stream(np.random.SeedSequence(seed)).tolist(),
            start=maze.start,
            goal=maze.goal,
            horizon=fields["horizon"],
            tolerance=fields["tie_tolerance"],
            random_ties={"random": True, "first": False}[fields["rollout_ties"]],
        )

    agent = make_agent(maze, Params.of(**usual | change))
    changed = []
    for seed in range(10):
        q, words = values(agent.shape, seed)[1], stream(np.random.SeedSequence(seed))
        episode, after = agent.roll_out(q, words)
        states, actions, draws = expected(usual | change, seed)
        assert episode.states.tolist() == states
        assert episode.actions.tolist() == actions
        assert after.tolist() == draws
        changed.append(states != expected(usual, seed)[0])
    assert any(changed) == bool(change)


def test_lowest_action_is_first(small_demos: Demos) -> None:
    """TIES and ROLLOUT-TIES "first": where all is equal the agent goes up, and bumps for ever."""
    maze = as_maze(small_demos.environment)
    up = maze.cell(maze.start)[0]  # so many moves to the wall
    zeros = np.zeros((maze.n_states, maze.n_actions))
    quiet: dict[str, Any] = {"epsilon": 0.0, "epsilon_end": 0.0, "episodes": 5, "horizon": 30}
    words = stream(np.random.SeedSequence(1))
    for ties, rollout_ties in (("first", "random"), ("random", "first")):
        agent = make_agent(maze, Params.of(**quiet, ties=ties, rollout_ties=rollout_ties))
        steps, collisions = agent.learn(zeros, zeros, words)[2:]
        episode, _ = agent.roll_out(zeros, words)
        learned_up = (steps, collisions) == (5 * 30, 5 * (30 - up))
        assert learned_up == (ties == "first")
        assert (not episode.actions.any()) == (rollout_ties == "first")
        if rollout_ties == "first":
            assert episode.hits.tolist() == [False] * up + [True] * (30 - up)
        else:
            assert set(episode.actions.tolist()) == {0, 1, 2, 3}


def test_goal_has_no_value_of_its_own_in_a_maze(small_demos: Demos) -> None:
    """GOAL-VALUE: from Q = 0 the goal's row stays 0, so that looking it up would be the same."""
    maze = as_maze(small_demos.environment)
    weights = np.ones((maze.n_states, maze.n_actions))
    learned = []
    for goal_value in ("zero", "bootstrap"):
        agent = make_agent(maze, Params.of(episodes=50, goal_value=goal_value))
        learned.append(agent.learn(weights, 0 * weights, stream(np.random.SeedSequence(1)))[0])
    assert not learned[0][maze.goal].any()
    assert learned[0].any(axis=1).sum() > 10
    assert learned[0].tolist() == learned[1].tolist()


# --- in soccer -------------------------------------------------------------------------------

SOCCER_UNUSUAL: dict[str, Any] = {
    "beta": 0.35,
    "gamma": 0.6,
    "epsilon": 0.8,
    "epsilon_end": 0.2,
    "episodes": 6,
    "ties": "first",
    "tie_tolerance": 1e-3,
    "goal_value": "bootstrap",
}

SOCCER_CHANGES: list[dict[str, Any]] = [
    {},
    {"beta": 0.6, "gamma": 0.35},
    {"beta": 0.9},
    {"gamma": 0.95},
    {"epsilon": 0.2, "epsilon_end": 0.8},
    {"epsilon": 0.5},
    {"epsilon_end": 0.0},
    {"episodes": 9},
    {"ties": "random"},
    {"tie_tolerance": 1e-6},
    {"goal_value": "zero"},
]


def short_field(demos: Demos) -> SoccerField:
    """Return the stored field with less time."""
    assert isinstance(demos.environment, SoccerField)
    return replace(demos.environment, params=SoccerParams(time_limit=40.0))


def soccer_learned(field: SoccerField, fields: dict[str, Any]) -> tuple[Any, ...]:
    """Learn in robot soccer, given the learner's fields by their names."""
    weights, q = values((field.n_states, field.n_actions))
    weights[:, FORWARD] += 1.0  # so that some episodes end with a goal
    q, words, *counts = soccer.learn(
        field.params,
        weights,
        q,
        stream(np.random.SeedSequence(3)),
        episodes=fields["episodes"],
        beta=fields["beta"],
        gamma=fields["gamma"],
        epsilon_start=fields["epsilon"],
        epsilon_end=fields["epsilon_end"],
        tolerance=fields["tie_tolerance"],
        random_ties={"random": True, "first": False}[fields["ties"]],
        bootstrap_goal={"bootstrap": True, "zero": False}[fields["goal_value"]],
    )
    return q.tolist(), words.tolist(), counts


@pytest.mark.parametrize("change", SOCCER_CHANGES, ids=str)
def test_soccer_agent_learns_by_its_fields(soccer_demos: Demos, change: dict[str, Any]) -> None:
    """Learning is that of `learning.soccer` with the learner's fields; each of them changes it."""
    field, fields = short_field(soccer_demos), SOCCER_UNUSUAL | change
    agent = make_agent(field, Params.of(**fields, rollout_ties="random"))
    weights, q = values(agent.shape)
    weights[:, FORWARD] += 1.0
    learned, words, *counts = agent.learn(weights, q, stream(np.random.SeedSequence(3)))
    assert (learned.tolist(), words.tolist(), counts) == soccer_learned(field, fields)
    if change:
        assert learned.tolist() != soccer_learned(field, SOCCER_UNUSUAL)[0]


@pytest.mark.parametrize(
    "change", [{}, {"tie_tolerance": 1e-6}, {"rollout_ties": "first"}], ids=str
)
def test_soccer_agent_rolls_out_by_its_fields(soccer_demos: Demos, change: dict[str, Any]) -> None:
    """A trajectory chooses by the reference's rule, by ROLLOUT-TIES and not by TIES."""
    field, usual = short_field(soccer_demos), SOCCER_UNUSUAL | {"rollout_ties": "random"}
    fields = usual | change
    agent = make_agent(field, Params.of(**fields))
    world, other = SoccerWorld(field.params), False
    for seed in range(3):
        q, words = values(agent.shape, seed)[1], stream(np.random.SeedSequence(seed))
        episode, after = agent.roll_out(q, words)
        draws, state, actions = words.tolist(), world.reset(), []
        for _ in episode.actions:
            word = reference.draw(draws)
            ties, tolerance = fields["rollout_ties"] == "random", fields["tie_tolerance"]
            actions.append(reference.choose(q[state].tolist(), word, 0.0, ties, tolerance))
            plain = reference.choose(q[state].tolist(), word, 0.0, True, usual["tie_tolerance"])
            other |= actions[-1] != plain
            state = world.step(actions[-1])[0]
        assert episode.actions.tolist() == actions
        assert int(episode.states[-1]) == state
        assert after.tolist() == draws
    assert other == bool(change)


def test_soccer_has_one_arithmetic(soccer_demos: Demos) -> None:
    """What the compiled soccer learner cannot do is refused, not ignored."""
    for arithmetic in ("fused", "single"):
        with pytest.raises(ChoiceError, match='set arithmetic = "double"'):
            make_agent(soccer_demos.environment, Params.of(**SOCCER, arithmetic=arithmetic))


# --- hits ------------------------------------------------------------------------------------


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
