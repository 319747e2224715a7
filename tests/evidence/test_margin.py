from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from replication import Maze
from replication.baselines import Problem, table_of
from replication.demos.maze_expert import demonstrate
from replication.demos.model import Demo
from replication.envs.tasks.moves import Moves
from replication.evidence.margin import (
    TOLERANCE,
    MarginError,
    best_visits,
    deviations,
    least_norm,
    margin,
)
from replication.learning.planning import plan

TINY = ("SG", "S.G", "S..\n..G", ".S.\n..G", "S.\nG.")


def problem_of(text: str, gamma: float) -> Problem:
    """Return the problem of a small maze with a shortest path."""
    demos = demonstrate("tiny", Maze.from_text(text))
    moves = table_of(demos.environment)
    assert moves is not None
    return Problem(moves, demos.correct, (), gamma)


def trajectories(maze: Maze, gamma: float, length: int) -> Iterator[NDArray[np.float64]]:
    """Yield the discounted visits of all trajectories, those cut after some moves among them."""
    waiting = [(maze.start, 0, np.zeros((maze.n_states, 4)))]
    while waiting:
        state, t, mu = waiting.pop()
        if state == maze.goal or t == length:
            yield mu
            continue
        for action in range(4):
            after = mu.copy()
            after[state, action] += gamma**t
            waiting.append((int(maze.next_state[state, action]), t + 1, after))


@pytest.mark.parametrize("text", TINY)
def test_margin_is_that_of_all_trajectories(text: str) -> None:
    """All trajectories of a tiny maze are listed, and the program solved by another solver."""
    gamma, length = 0.05, 5  # what is cut off is worth 3e-7
    problem = problem_of(text, gamma)
    found = np.array([*trajectories(Maze.from_text(text), gamma, length)])
    rows = (problem.mu_e - found).reshape(len(found), -1)
    rows = np.unique(rows.round(12), axis=0)
    rows = rows[np.abs(rows).sum(axis=1) > 1e-9]
    delta = margin(problem).delta
    rows /= delta  # so that the least norm is about 1
    least = minimize(
        lambda w: w @ w,
        np.ones(rows.shape[1]),
        jac=lambda w: 2 * w,
        constraints={"type": "ineq", "fun": lambda w: rows @ w - 1, "jac": lambda w: rows},
        method="SLSQP",
        options={"maxiter": 500, "ftol": 1e-10},
    )
    assert least.success
    assert np.linalg.norm(least.x) == pytest.approx(1, rel=2 * TOLERANCE)


@pytest.mark.parametrize("gamma", [0.5, 0.9])
@pytest.mark.parametrize("text", [*TINY, "S...\n.##.\n...G"])
def test_margin_holds_for_trajectories_at_random(text: str, gamma: float) -> None:
    """No trajectory, drawn without any policy, is nearer along w* than delta."""
    problem, maze = problem_of(text, gamma), Maze.from_text(text)
    found = margin(problem)
    unit = found.weights / np.linalg.norm(found.weights)
    rng = np.random.default_rng(np.random.SeedSequence(5))
    nearest = np.inf
    for _ in range(400):
        state, mu, factor = maze.start, np.zeros((maze.n_states, 4)), 1.0
        while state != maze.goal and factor > 1e-14:
            action = int(rng.integers(4))
            mu[state, action] += factor
            state, factor = int(maze.next_state[state, action]), factor * gamma
        if np.abs(mu - problem.mu_e).max() > 1e-12:
            nearest = min(nearest, float((unit * (problem.mu_e - mu)).sum()))
    assert nearest >= found.delta


@pytest.mark.parametrize("text", [*TINY, ".S...\n.G...\n.#..#", "S..\n...\nG..\n...\n..."])
def test_delta_is_what_the_weights_keep(text: str) -> None:
    """It is the least w* . (mu_E - mu) over |w*|, by plain value iteration: 1, or hardly less.

    In the last two mazes there are ever longer loops, each a little better.
    """
    problem = problem_of(text, 0.9)
    found = margin(problem)
    w, (demo,) = found.weights, problem.correct
    q = plan(w, problem.moves.ahead, gamma=0.9)
    whole, before, kept = (w * problem.mu_e).sum(), 0.0, []
    for t, (state, right) in enumerate(zip(demo.states[:-1], demo.actions, strict=True)):
        kept += [whole - before - 0.9**t * q[state, a] for a in range(4) if a != right]
        before += 0.9**t * w[state, right]
    assert 1 - 1e-4 <= min(kept) < 1 + 1e-9
    assert found.delta < min(kept) / np.linalg.norm(w)
    assert found.delta == pytest.approx(min(kept) / np.linalg.norm(w), rel=2e-9)


def test_margin_by_hand() -> None:
    """A move before the goal: w is a for it and, by symmetry, -b for each of the three walls.

    The nearest other trajectory runs into a wall once: a - (-b + gamma a) = 1.
    """
    gamma = 0.5
    found = margin(problem_of("SG", gamma))
    a, b = found.weights[0, 2], -found.weights[0, [0, 1, 3]]
    assert b == pytest.approx(b[0])
    # of all with a / 2 + b = 1 the least a^2 + 3 b^2
    assert (a, b[0]) == pytest.approx((6 / 7, 4 / 7), rel=1e-3)
    assert found.delta == pytest.approx((36 / 49 + 3 * 16 / 49) ** -0.5, rel=1e-3)
    assert found.constraints == 3


def test_margin_is_at_least_that_of_the_one_line_reward() -> None:
    """Punishing each first wrong step by gamma^-t separates, so its weights are not shorter."""
    gamma = 0.9
    problem = problem_of("S....\n.....\n....G", gamma)
    n = len(problem.correct[0].actions)
    assert margin(problem).delta > (3 * sum(gamma ** (-2 * t) for t in range(n))) ** -0.5


@pytest.mark.parametrize(
    ("text", "states", "path"),
    [("S..\n.#.\n..G", [0, 1, 2, 5, 8], [2, 2, 1, 1]), ("S.\nG.", [0, 1, 3, 2], [2, 1, 3])],
)
def test_ways_lead_off_the_path_and_on_as_planned(
    text: str, states: list[int], path: list[int]
) -> None:
    """Each way has the visits of its best trajectory, followed here step by step.

    The second path is no shortest one, so that a way off it leads straight to the goal.
    """
    demo, maze = walk(states, path), Maze.from_text(text)
    problem = replace(problem_of(text, 0.8), correct=(demo,))
    ways = deviations(problem)
    assert len(ways.states) == 3 * len(demo.actions)
    q = np.random.default_rng(np.random.SeedSequence(3)).normal(size=problem.moves.shape)
    found = best_visits(problem, q, ways)
    for k, (state, action) in enumerate(zip(ways.states, ways.actions, strict=True)):
        t = demo.states.tolist().index(state)
        assert demo.actions[t] != action
        actions = [*demo.actions[:t].tolist(), int(action)]
        here = int(maze.replay(actions)[-1])
        while here != maze.goal and len(actions) < 150:
            actions.append(int(q[here].argmax()))
            here = int(maze.next_state[here, actions[-1]])
        mu = np.zeros(problem.moves.shape)
        for step, (s, a) in enumerate(zip(maze.replay(actions)[:-1], actions, strict=True)):
            mu[s, a] += 0.8**step
        np.testing.assert_allclose(found[k], mu, atol=1e-12)


def test_least_norm_is_that_of_another_solver() -> None:
    """The program of random rows, of which few are decisive."""
    rng = np.random.default_rng(np.random.SeedSequence(7))
    for _ in range(20):
        rows = rng.normal(size=(12, 6)) + 2
        x, multipliers = least_norm(rows)
        other = minimize(
            lambda w: w @ w,
            x + 1,
            constraints={"type": "ineq", "fun": lambda w, rows=rows: rows @ w - 1},
            method="SLSQP",
            options={"ftol": 1e-14},
        )
        assert x @ x == pytest.approx(other.fun, rel=1e-6)
        assert (rows @ x).min() == pytest.approx(1)
        assert (rows @ x)[multipliers > 0] == pytest.approx(1)


def walk(states: list[int], actions: list[int]) -> Demo:
    """Return a demonstration."""
    return Demo("mine", "correct", np.array(states), np.array(actions))


def test_what_has_no_margin_is_refused() -> None:
    """One line says why, and what to give instead."""
    problem = problem_of("S.G", 0.9)
    path = problem.correct[0]
    for changed, words in (
        (replace(problem, correct=(path, path)), "one correct demonstration, not of 2"),
        (replace(problem, gamma=1.0), "between 0 and 1, not 1.0"),
        (replace(problem, gamma=0.0), "between 0 and 1, not 0.0"),
        (replace(problem, correct=(walk([0, 1, 0, 1, 2], [2, 3, 2, 2]),)), "'mine' has no margin"),
        (replace(problem, correct=(walk([0, 1], [2]),)), "ends at the goal"),
    ):
        with pytest.raises(MarginError, match=words):
            margin(changed)
    by_chance = ([0, 0, 1], [0, 0, 0], [0, 1, 1], [0.5, 0.5, 1]), [1, 0]
    from_anywhere = ([0, 1], [0, 0], [1, 1], [1, 1]), [0.5, 0.5]
    for outcomes, starts in (by_chance, from_anywhere):
        moves = Moves.of(outcomes, shape=(2, 1), starts=starts, ends=[False, True])
        with pytest.raises(MarginError, match="moves by chance"):
            margin(Problem(moves, (walk([0, 1], [0]),), (), 0.9))
