"""The margin: by how much the best weights prefer a demonstration to every other trajectory.

For a demonstration with feature expectations mu_E it is the largest delta for which some unit u has

    u . (mu_E - mu) >= delta    for the mu of every other trajectory,

which is the distance of mu_E from the convex hull of all other mu. It is delta = 1 / ‖w*‖, where w*
has the least norm among all w with w . (mu_E - mu) >= 1. There are more trajectories than can be
listed, so this quadratic program is solved by constraint generation: each other trajectory leaves
the demonstrated one at some step t by some other action, and is free from then on. Of those that
leave there, the best under the present weights is found by planning. What is violated is added, and
the weights of least norm are found again, until nothing is violated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from replication.baselines.problem import Problem, certain
from replication.errors import UserError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

TOLERANCE = 1e-4
"""How far below 1 a constraint may stay: there can be ever more ways to loop, each a little better.

It lowers delta, which so stays safe.
"""

ROUNDING = 1e-9
"""By what share delta is lowered for rounding, which is some 1e-13 of the largest value planned."""


class MarginError(UserError):
    """A demonstration whose margin cannot be computed."""


@dataclass(frozen=True)
class Margin:
    """The margin of a demonstration.

    Attributes
    ----------
    delta
        A lower bound of the margin, by at most TOLERANCE of it.
    weights
        w*, [state, action].
    constraints
        The number of trajectories that decide it.
    """

    delta: float
    weights: Array
    constraints: int


class Deviations(NamedTuple):
    """All ways to leave a path, a step and another action each, [way].

    Attributes
    ----------
    states, actions, after
        Where it is left, by which action, and where that leads.
    discounts
        gamma^t.
    before
        The discounted visits until then, [way, state, action].
    """

    states: Indices
    actions: Indices
    after: Indices
    discounts: Array
    before: Array


def margin(problem: Problem) -> Margin:
    """Return the margin of a problem's correct demonstration.

    Raises
    ------
    MarginError
        Unless there is one correct demonstration, which visits no state twice and ends where
        episodes end, in a task without chance, with a discount between 0 and 1.

    Notes
    -----
    `delta` is a lower bound whatever the quadratic program is worth: any weights w have it as
    min w . (mu_E - mu) / ‖w‖, and the minimum is found by planning. The program without the
    constraints that are missing has a larger margin, so the two enclose it.

    The least norm is a least-distance problem, and is solved as nonnegative least squares (Lawson &
    Hanson 1974, chapter 23); a constraint whose multiplier is 0 is dropped, and comes back if it is
    violated again. Each round raises the norm, so that none is for ever.
    """
    ways = deviations(problem)
    shape = problem.moves.shape
    w, q = np.zeros(shape), np.zeros(shape)
    rows = np.zeros((0, w.size))
    while True:
        q = problem.plan(w, q)
        values = (ways.before * w).sum(axis=(1, 2)) + ways.discounts * q[ways.states, ways.actions]
        slack = (w * problem.mu_e).sum() - values
        if slack.min() >= 1 - TOLERANCE:
            break
        violated = Deviations(*(part[slack < 1 - TOLERANCE] for part in ways))
        new = problem.mu_e - best_visits(problem, q, violated)
        rows = np.concatenate([rows, new.reshape(len(new), -1)])
        least, multipliers = least_norm(rows)
        w, rows = least.reshape(shape), rows[multipliers > 0]
    delta = float(slack.min() / np.linalg.norm(w))
    return Margin(delta * (1 - ROUNDING), w, len(rows))


def deviations(problem: Problem) -> Deviations:
    """Return all ways to leave the demonstrated path; refuse what has no margin."""
    moves, demos = problem.moves, problem.correct
    next_state = certain(moves)
    if next_state is None or len(moves.starts) > 1:
        raise MarginError("a margin needs a task without chance, and this one has moves by chance")
    if len(demos) != 1:
        raise MarginError(f"a margin is that of one correct demonstration, not of {len(demos)}")
    if not 0 < problem.gamma < 1:
        raise MarginError(f"a margin needs a discount between 0 and 1, not {problem.gamma}")
    (demo,) = demos
    if len(np.unique(demo.states)) < len(demo.states) or not moves.ends[demo.states[-1]]:
        raise MarginError(
            f"the demonstration {demo.name!r} has no margin: "
            "give one that visits no state twice and ends at the goal"
        )
    n_actions = moves.shape[1]
    steps, others = np.nonzero(np.arange(n_actions) != demo.actions[:, None])
    discounts = problem.mu_e[demo.states[:-1], demo.actions]
    before = np.zeros((len(discounts), *moves.shape))
    for t in range(1, len(discounts)):
        before[t:, demo.states[t - 1], demo.actions[t - 1]] = discounts[t - 1]
    states = demo.states[steps]
    return Deviations(states, others, next_state[states, others], discounts[steps], before[steps])


def best_visits(problem: Problem, q: Array, ways: Deviations) -> Array:
    """Return mu of the best trajectory that leaves the path in each way, [way, state, action].

    Behind the first move it follows the greedy policy of `q`, the first of equals, for ever.
    """
    n_states = len(q)
    policy, ends = q.argmax(axis=1), problem.moves.ends
    next_state = certain(problem.moves)
    assert next_state is not None  # the deviations are there
    there = next_state[np.arange(n_states), policy]
    goes_on = np.flatnonzero(~ends & ~ends[there])
    visits = np.eye(n_states)
    visits[there[goes_on], goes_on] -= problem.gamma
    begin = np.zeros((n_states, len(ways.after)))
    begin[ways.after, np.arange(len(ways.after))] = ~ends[ways.after]
    later = np.linalg.solve(visits, begin).T  # discounted visits of states
    mu = ways.before.copy()
    mu[np.arange(len(mu)), ways.states, ways.actions] += ways.discounts
    mu[:, np.arange(n_states), policy] += problem.gamma * ways.discounts[:, None] * later
    return mu


def least_norm(rows: Array) -> tuple[Array, Array]:
    """Return the x of least norm with rows @ x >= 1, and the multiplier of each row.

    Examples
    --------
    >>> x, multipliers = least_norm(np.array([[1.0, 1.0], [1.0, 0.0], [3.0, 3.0]]))
    >>> x.round(9).tolist(), (multipliers > 0).tolist()
    ([1.0, 0.0], [False, True, False])
    """
    used = np.flatnonzero(rows.any(axis=0))
    system = np.vstack([rows[:, used].T, np.ones(len(rows))])
    right = np.zeros(len(system))
    right[-1] = 1.0
    # An orthogonal change of coordinates leaves the problem as it is, and makes it small.
    orthogonal, triangle = np.linalg.qr(system)
    multipliers, _ = nnls(triangle, orthogonal.T @ right)
    residual = system @ multipliers - right
    x = np.zeros(rows.shape[1])
    x[used] = -residual[:-1] / residual[-1]
    return x, multipliers
