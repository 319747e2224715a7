from __future__ import annotations

import numpy as np
import pytest

from replication.baselines import Problem, table_of
from replication.baselines.features import (
    BESIDE,
    ITERATIONS,
    NAMES,
    Found,
    features,
    first_best,
    perceptron,
)
from replication.demos.model import Demo
from replication.envs.maze import Maze
from replication.irl.expectations import norm

UP, DOWN, RIGHT, LEFT = range(4)

TINY = Maze.from_text("""
    .#G
    S..
""")


def problem_of(maze: Maze, *ways: list[int]) -> Problem:
    """Return the problem of some correct demonstrations."""
    demos = [Demo(str(k), "correct", maze.replay(way), np.array(way)) for k, way in enumerate(ways)]
    moves = table_of(maze)
    assert moves is not None
    return Problem(moves, demos, (), 0.9)


@pytest.mark.parametrize(
    ("row", "column", "action", "wanted"),
    [
        (1, 0, UP, [0, 0, 2 / 3, 0, 0.5]),  # the edge is beside, at the left
        (1, 0, RIGHT, [1, 1 / 2, 2 / 3, 0, 0.5]),  # the edge is below
        (1, 0, LEFT, [1, 0, 1, 1, 0.5]),  # bumps and stays
        (1, 1, UP, [1, 1 / 2, 2 / 3, 1, 0]),  # bumps into the obstacle
        (1, 1, RIGHT, [1, 1, 1 / 3, 0, 1]),  # obstacle above, edge below
        (1, 2, UP, [0, 1, 0, 0, 0.5]),  # reaches the goal
        (0, 0, DOWN, [1, 0, 1, 0, 1]),  # edge and obstacle on both sides
    ],
)
def test_features_by_hand(row: int, column: int, action: int, wanted: list[float]) -> None:
    """Where the move leads, how far that is from the goal, and what is in front and beside."""
    assert len(NAMES) == len(wanted)
    found = features(TINY)[TINY.state(row, column), action]
    np.testing.assert_allclose(found, wanted, atol=1e-15)


def test_features_know_no_map() -> None:
    """In the mirrored maze a mirrored move has the same features, but for the column."""
    phi = features(TINY)
    mirrored = features(Maze(tuple(row[::-1] for row in TINY.rows)))
    phi, mirrored = (x.reshape(2, 3, 4, 5) for x in (phi, mirrored))
    back = mirrored[:, ::-1][:, :, [UP, DOWN, LEFT, RIGHT]]
    np.testing.assert_allclose(back[..., [0, 2, 3, 4]], phi[..., [0, 2, 3, 4]])
    np.testing.assert_allclose(back[..., 1], 1 - phi[..., 1])


def test_a_line_has_features() -> None:
    """A maze of one row has no division by zero."""
    phi = features(Maze(("S.G",)))
    assert (phi[..., 0] == 0).all()
    assert phi[0, RIGHT].tolist() == [0, 0.5, 0.5, 0, 1]


def test_beside_is_across() -> None:
    """A move and those beside it stand at right angles."""
    moves = np.array([(-1, 0), (1, 0), (0, 1), (0, -1)])
    assert all(moves[a] @ moves[b] == 0 for a in range(4) for b in BESIDE[a])
    assert all(set(pair) | {a} != set(pair) for a, pair in enumerate(BESIDE))
    assert all(pair[0] != pair[1] for pair in BESIDE)


def test_first_best_takes_the_first_of_equals() -> None:
    """Values that differ by rounding tie, whatever their sign; others do not."""
    q = np.array([[0, 0, 0], [-1, 0, 0], [1, 1 + 1e-12, 0], [-1 - 1e-12, -1, -2], [1, 1.001, 0]])
    assert first_best(q).tolist() == np.eye(3)[[0, 1, 0, 0, 1]].tolist()


def test_it_learns_a_corridor() -> None:
    """The error reaches 0, and the greedy policy of the reward is the expert's way."""
    maze = Maze(("S.....G",))
    problem = problem_of(maze, [RIGHT] * 6)
    phi = features(maze)
    found = perceptron(problem, phi)
    assert found.error == 0
    assert 0 < found.iterations == problem.plans < ITERATIONS
    q = problem.plan(phi @ found.theta)
    assert q.argmax(axis=1)[:6].tolist() == [RIGHT] * 6


def test_the_first_update_by_hand() -> None:
    """At first all values are 0 and the agent bumps upwards for ever: theta is what differs."""
    maze = Maze(("SG",))
    phi = features(maze)
    problem = problem_of(maze, [RIGHT])
    bumping = 10 * phi[0, UP]  # 1 + 0.9 + 0.9^2 + ...
    found = perceptron(problem, phi)
    np.testing.assert_allclose(found.theta, phi[0, RIGHT] - bumping, rtol=1e-9)
    assert found.iterations == 1


def test_without_an_answer_the_least_error_is_returned() -> None:
    """Two ways at once cannot be matched: the updates end, and the theta of least error is kept."""
    maze = Maze.from_text("""
        ..G
        ...
        S..
    """)
    problem = problem_of(maze, [UP, UP, RIGHT, RIGHT], [RIGHT, RIGHT, UP, UP])
    phi = features(maze)
    found = perceptron(problem, phi)
    assert found.iterations == ITERATIONS
    assert found.error == pytest.approx(_slow(problem, phi).error, rel=1e-9)
    np.testing.assert_allclose(found.theta, _slow(problem, phi).theta, atol=1e-9)
    q = problem.plan(phi @ found.theta)
    residual = np.tensordot(problem.mu_e - problem.visits(first_best(q)), phi, 2)
    assert norm(residual) == pytest.approx(found.error)


def _slow(problem: Problem, phi: np.ndarray) -> Found:
    """Return the same with plain loops: every theta first, then the first of the least errors."""
    theta = np.zeros(5)
    every = []
    for number in range(ITERATIONS + 1):
        q = problem.plan(phi @ theta) if number else np.zeros(phi.shape[:2])
        ahead = problem.mu_e - problem.visits(first_best(q))
        residual = sum(
            ahead[s, a] * phi[s, a] for s in range(len(phi)) for a in range(phi.shape[1])
        )
        every.append(Found(theta, float(np.sqrt((residual**2).sum())), number))
        theta = theta + residual
    return min(every, key=lambda found: round(found.error, 9))
