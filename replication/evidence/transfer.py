"""What the reward is worth elsewhere: learned in one world, used in another.

The rule and the predictions below were written down before any number was computed.

Learned is in five mazes whose right answer is known: the demonstration is a shortest path, hence
optimal for a reward of -1 a step. A learned reward is planned on exactly in each changed world, and
its greedy policy is judged by the true reward, see :mod:`replication.evidence.elsewhere`. Weights
of one-hot features go with the number of the cell; other features are computed anew, from the map
and for the move that is meant, whatever chance makes of it. The expert's copier has no reward: it
does in each cell what the expert does there, and where the expert never was the first move, up.

Rule
----
The reward of a method **transfers** to a kind of change if the value lost is small in every one of
the five tasks: the upper end of the 95 % interval of its mean over trials is at most `LIMIT`. A
method without chance is run once, and its value stands for both ends. The value lost is a share of
what an optimal policy has over random moves. From the start, two moves more than needed lose about
1 - 0.9^2 = 0.19 of it; so `LIMIT` means less than one move more on average.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.baselines import BaselineCondition, Problem, table_of
from replication.baselines.features import features, first_best, perceptron
from replication.demos.maze_expert import Expert
from replication.demos.model import Demos
from replication.envs.maze import as_maze
from replication.evidence.elsewhere import CHANGES, GAMMA, World, worlds
from replication.evidence.experiments import GENERAL
from replication.evidence.specifications import MAPS
from replication.evidence.statistics import mean_interval
from replication.evidence.variations import maze_demos
from replication.irl.expectations import mean_expectations, norm
from replication.learning.seeds import trial_seeds
from replication.paper.params import Params

Array = NDArray[np.float64]

Learned = Callable[[World], Array]
"""What was learned: returns the policy [state, action] that follows from it in a world."""

LIMIT = 0.1
"""The value lost up to which a reward transfers."""

FEATURES = "features"
"""The name of the perceptron whose features mean the same in any maze."""

PREDICTED: dict[str, tuple[str, ...]] = {
    "unified-incorrect": (),
    "perceptron": (),
    "one-line": ("none",),
    "cloning": ("none",),
    "max-entropy": ("none",),
    FEATURES: ("none", "other starts", "slip 0.1", "slip 0.2", "slip 0.3", "another map"),
}
"""The changes to which we expect each method's reward to transfer; to no other.

Where the change is none, the reward is planned on exactly where it was learned. One-hot rewards
that stop as soon as Q-learning follows the expert need not have the expert's path as their optimum:
we expect that even this fails. The one-line reward has it by construction, but off the path it
knows only how to get back to it; each slip off the path then costs more than an optimal policy
loses. Maximum entropy matches the expert softly, and we expect its optimum to be the path, no more.
Features that mean the same anywhere should transfer, except that row and column were learned beside
the distance: they point to where the goal has been.
"""

ANOTHER = "random-4"
"""The other map; it is none of those in which is learned."""

LOOPS = ("unified-incorrect", "perceptron")
"""The methods with chance: Q-learning in the paper's loop."""


def transfer_table(tasks: tuple[str, ...] = MAPS, *, trials: int, seed: int) -> pd.DataFrame:
    """Return the value lost by each method in each changed world of each task.

    Parameters
    ----------
    tasks
        The names of the mazes.
    trials
        Of each method that learns by Q-learning, at least 2.
    seed
        Root seed of these.

    Returns
    -------
    DataFrame
        With the columns task, method, features ("pairs" or "few"), change, n (trials), lost (mean),
        low, high (95 % interval), and d: the mean distance (Eq. 6, one-hot features) between the
        expert and the policy that is planned exactly where was learned.
    """
    rows = []
    for task in tasks:
        demos = maze_demos(task, Expert())
        maze = as_maze(demos.environment)
        changed = worlds(maze, as_maze(maze_demos(ANOTHER, Expert()).environment))
        for method in PREDICTED:
            seeds = trial_seeds(seed, trials if method in LOOPS else 1)
            learned = [learn(demos, method, seed=each) for each in seeds]
            d = np.mean([_distance(demos, changed["none"], each) for each in learned])
            for change in CHANGES:
                world = changed[change]
                lost = np.array([world.lost(policy(world)) for policy in learned])
                low, high = mean_interval(lost) if len(lost) > 1 else (lost[0], lost[0])
                rows.append(
                    {
                        "task": task,
                        "method": method,
                        "features": "few" if method == FEATURES else "pairs",
                        "change": change,
                        "n": len(lost),
                        "lost": lost.mean(),
                        "low": float(low),
                        "high": float(high),
                        "d": d,
                    }
                )
    return pd.DataFrame(rows)


def verdict_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return whether each method's reward transfers to each change, by the rule.

    Parameters
    ----------
    table
        That of `transfer_table`.

    Returns
    -------
    DataFrame
        With the columns method, change, transfers, predicted (likewise), worst (the task whose
        interval ends highest), and its lost, low and high.
    """
    rows = []
    for (method, change), own in table.groupby(["method", "change"], sort=False):
        worst = own.loc[own["high"].idxmax()]
        rows.append(
            {
                "method": method,
                "change": change,
                "transfers": bool((own["high"] <= LIMIT).all()),
                "predicted": change in PREDICTED[str(method)],
                "worst": worst["task"],
                **worst[["lost", "low", "high"]],
            }
        )
    return pd.DataFrame(rows)


def learn(demos: Demos, method: str, *, seed: np.random.SeedSequence) -> Learned:
    """Return what a method learns, as a policy for any world.

    Methods of the paper's loop learn by Q-learning, with the paper's defaults, F_i, and the general
    list of incorrect demonstrations if they use them.
    """
    moves = table_of(demos.environment)
    assert moves is not None
    if method == "cloning":
        preferences = mean_expectations(demos.correct, gamma=GAMMA, shape=moves.shape)
        return lambda world: first_best(preferences)
    if method == FEATURES:
        problem = Problem(moves, demos.correct, (), GAMMA)
        theta = perceptron(problem, features(as_maze(demos.environment))).theta
        return lambda world: world.follow(features(world.maze) @ theta)
    choices = {} if method in LOOPS else {"solver": "planning", "max_iterations": 1}
    condition = BaselineCondition(demos, method, Params.of(incorrect=GENERAL, **choices))
    weights = condition.trial(seed=seed).weights
    return lambda world: world.follow(weights)


def _distance(demos: Demos, world: World, learned: Learned) -> float:
    """Return d (Eq. 6) of the policy in the world in which it was learned."""
    mu_e = mean_expectations(demos.correct, gamma=GAMMA, shape=world.moves.shape)
    return norm(mu_e - world.visits(learned(world)))
