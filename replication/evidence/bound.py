"""Why some 40 iterations? A bound on the mistakes of the perceptron, held against what is measured.

With F = 1 and exact planning the loop of Algorithm 1 is the structured perceptron (Collins 2002):
w_0 = 0, and while the agent's trajectory is not the expert's, w_(i+1) = w_i + mu_E - mu_i, where
mu_i has the greatest w_i . mu of all trajectories.

Theorem (Novikoff 1962; Collins 2002, theorem 1). If for every other trajectory
‖mu_E - mu‖ <= R, and u . (mu_E - mu) >= delta > 0 with some u of norm 1, then there are at most
(R / delta)^2 updates, whatever is taken among equals.

Proof. Let r_i = mu_E - mu_i. Each update moves the weights along u by u . r_i >= delta, so after n
of them ‖w_n‖ >= u . w_n >= n delta. As mu_i is best under w_i, w_i . r_i <= 0, so
‖w_(i+1)‖^2 = ‖w_i‖^2 + 2 w_i . r_i + ‖r_i‖^2 <= ‖w_i‖^2 + R^2, and ‖w_n‖^2 <= n R^2. Together
n^2 delta^2 <= n R^2. QED

The largest delta is the margin, see :mod:`replication.evidence.margin`. R^2 is
‖mu_E‖^2 + 1 / (1 - gamma)^2: visits are not negative and sum to at most 1 / (1 - gamma), so
‖mu_E - mu‖^2 <= ‖mu_E‖^2 + ‖mu‖^2 <= R^2; an agent that runs into a wall beside the start for ever
reaches it.

Three things keep the agent from being exactly best. Its episode is cut at the horizon: what is
behind it is worth at most gamma^500 = 1e-23 of what is before. Actions tie within a relative
1e-12, and values are planned to some 1e-14 of the largest. All of it adds e to w_i . r_i <= 0, with
2 e some 1e-10 of R^2 here, which moves no bound by a whole number unless it lies that close to one.

The unified method has no such theorem: with a trace, w_i . (F_i r_i) may be positive. Nor has
Q-learning, whose greedy trajectory need not be best under the weights.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
import pandas as pd

from replication.baselines import BaselineCondition, Problem, table_of
from replication.demos.maze_expert import Expert, demonstrate
from replication.demos.model import Demos
from replication.envs.maze import Maze, as_maze
from replication.evidence.experiments import NONE
from replication.evidence.margin import margin
from replication.evidence.specifications import MAPS
from replication.evidence.statistics import mean_interval
from replication.evidence.variations import maze_demos
from replication.paper.params import Params
from replication.paper.register import load_choices
from replication.trials.table import Group

PART = "bound"
"""What the column `part` of the table of trials has."""

GAMMA = Params().learner.gamma

RUNS = (
    ("perceptron", "", "planning"),
    ("unified", "printed", "planning"),
    ("unified", "updated", "planning"),
    ("unified", "printed", "q-learning"),
)
"""Method, reading of Eq. 9 and inner solver; the theorem is about the first."""

LENGTHS = (4, 8, 16, 24)
"""Moves from a nearer start to the goal, about a factor of 2 apart, on the paper's two mazes.

The shapes of a maze have equal lengths, so that without these length could not explain anything.
"""


class Case(NamedTuple):
    """A demonstration: `vary` says what it differs in from others, "shape" or "length"."""

    world: str
    vary: str
    shape: str
    demos: Demos


@cache
def cases() -> tuple[Case, ...]:
    """Return all demonstrations; of equal paths in one maze the first."""
    found: dict[tuple[str, bytes, bytes], Case] = {}
    for case in _shapes():
        (demo,) = case.demos.correct
        found.setdefault((case.world, demo.states.tobytes(), demo.actions.tobytes()), case)
    return (*found.values(), *_lengths())


def _shapes() -> Iterator[Case]:
    """Yield every registered shape, and a random path, on every maze."""
    entry = load_choices()["DEMO-SHAPE"]
    experts = {
        f"legs of {leg}": Expert(leg=int(leg)) for leg in (entry.default, *entry.alternatives)
    }
    experts["random"] = Expert(path="random-1")
    for world in MAPS:
        for shape, expert in experts.items():
            yield Case(world, "shape", shape, maze_demos(world, expert))


def _lengths() -> Iterator[Case]:
    """Yield the default shape from starts that lie on it, nearer to the goal."""
    for world in MAPS[:2]:
        demos = maze_demos(world, Expert())
        maze, states = as_maze(demos.environment), demos.correct[0].states
        for length in LENGTHS:
            cells = list("".join(maze.rows))
            cells[maze.start], cells[states[-1 - length]] = ".", "S"
            width = maze.shape[1]
            rows = ("".join(cells[i : i + width]) for i in range(0, len(cells), width))
            nearer = demonstrate(f"{demos.task}-{length}", Maze(tuple(rows)))
            yield Case(world, "length", f"legs of {Expert().leg}", nearer)


def conditions() -> Iterator[BaselineCondition]:
    """Yield a condition for each case and run, all runs of a case in a row."""
    for case in cases():
        for method, reading, solver in RUNS:
            chosen = {"f_index": reading} if reading else {}
            params = Params.of(solver=solver, incorrect=NONE, **chosen)
            yield BaselineCondition(case.demos, method, params)


def plan(trials: int) -> list[Group]:
    """Return what is run: a group for each condition, with its place as the column `number`."""
    return [
        Group([condition], trials, {"part": PART, "number": number})
        for number, condition in enumerate(conditions())
    ]


def problem_of(demos: Demos) -> Problem:
    """Return what the margin is computed from: the correct demonstrations and the table."""
    moves = table_of(demos.environment)
    assert moves is not None
    return Problem(moves, demos.correct, (), GAMMA)


def radius(problem: Problem) -> float:
    """Return R, which no ‖mu_E - mu‖ exceeds."""
    return float(np.sqrt((problem.mu_e**2).sum() + (1 - problem.gamma) ** -2.0))


def bound_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Return the bound of each demonstration beside the iterations of each method.

    Returns
    -------
    DataFrame
        One row for each case and run: `world`, `vary` and `shape` of the :class:`Case`; `length` of
        the path in moves; `radius`, `delta` and `bound`, (R / delta)^2; `method`, `reading` and
        `solver`; `n` trials; `converged`, the share of them that reached d = 0; the `mean` of their
        iterations with its 95 % interval `low` to `high`, and the `most`.
    """
    own = dict(list(trials[trials["part"] == PART].groupby("number")))
    rows = []
    for place, case in enumerate(cases()):
        problem = problem_of(case.demos)
        r, delta = radius(problem), margin(problem).delta
        for run, (method, reading, solver) in enumerate(RUNS):
            measured = own[place * len(RUNS) + run]
            counts = measured["iterations"].to_numpy(float)
            low, high = mean_interval(counts)
            rows.append(
                {
                    "world": case.world,
                    "vary": case.vary,
                    "shape": case.shape,
                    "length": len(case.demos.correct[0].actions),
                    "radius": r,
                    "delta": delta,
                    "bound": (r / delta) ** 2,
                    "method": method,
                    "reading": reading,
                    "solver": solver,
                    "n": len(counts),
                    "converged": float(measured["converged"].mean()),
                    "mean": counts.mean(),
                    "low": float(low),
                    "high": float(high),
                    "most": counts.max(),
                }
            )
    return pd.DataFrame(rows)
