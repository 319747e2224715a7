from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from replication import Demos, Maze, Params, demonstrate
from replication.baselines import BaselineCondition, one_line
from replication.demos.model import state_action_pairs
from replication.learning.seeds import trial_seeds
from replication.paper.params import Update

NONE = np.zeros((6, 4), bool)


def test_of_all_policies_only_the_experts_way_is_best() -> None:
    """In a maze of six cells the expert's way costs nothing, that of each other policy does."""
    maze = Maze.from_text("""
        ..G
        S..
    """)
    demos = demonstrate("tiny", maze)
    pairs = state_action_pairs(*demos.correct)
    mu_e = np.zeros((6, 4))
    for t, pair in enumerate(sorted(pairs)):
        mu_e[pair] = 0.9**t
    reward, _ = one_line.update(np.ones((6, 4)), NONE, mu_e, mu_e, NONE, Update())
    cells = [state for state in range(6) if state != maze.goal]
    best = set()
    for actions in product(range(4), repeat=len(cells)):
        policy = dict(zip(cells, actions, strict=True))
        state, value, way = maze.start, 0.0, []
        for t in range(20):
            if state == maze.goal:
                break
            way.append((state, policy[state]))
            value += 0.9**t * reward[way[-1]]
            state = int(maze.next_state[way[-1]])
        assert value <= 0
        if value == 0:
            best.add(frozenset(way))
    assert best == {frozenset(pairs)}


@pytest.mark.parametrize("solver", ["q-learning", "planning"])
def test_one_iteration_is_enough(stored_demos: Demos, solver: str) -> None:
    """In both of the paper's mazes d = 0 follows the first reward, with either solver."""
    asked = BaselineCondition(stored_demos, "one-line", Params.of(solver=solver))
    for seed in trial_seeds(6, 3):
        trial = asked.trial(seed=seed)
        assert (trial.iterations, trial.errors[-1], trial.converged) == (1, 0.0, True)
        assert set(np.unique(trial.weights)) == {-1.0, 0.0}


def test_the_reward_does_not_depend_on_the_agent() -> None:
    """It is 0 where the expert acts, however late, and -1 elsewhere; what was before is gone."""
    mu_e = np.array([[1.0, 0.0, 1e-12, 0.0]])
    for mu_i in (np.zeros((1, 4)), np.ones((1, 4))):
        w, _ = one_line.update(np.full((1, 4), 7.0), mu_i, mu_e, mu_i, NONE[:1], Update())
        np.testing.assert_array_equal(w, [[0.0, -1.0, 0.0, -1.0]])
