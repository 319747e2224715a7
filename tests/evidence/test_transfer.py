from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from replication.baselines import BaselineCondition
from replication.demos.maze_expert import Expert, demonstrate
from replication.envs.maze import Maze, as_maze
from replication.evidence import transfer
from replication.evidence.elsewhere import CHANGES, World, moves_of, worlds
from replication.evidence.experiments import GENERAL
from replication.evidence.statistics import mean_interval
from replication.evidence.transfer import (
    ANOTHER,
    FEATURES,
    LIMIT,
    PREDICTED,
    learn,
    transfer_table,
    verdict_table,
)
from replication.evidence.variations import maze_demos
from replication.irl.expectations import mean_expectations
from replication.learning.seeds import trial_seeds
from replication.paper.params import Params

UP, RIGHT = 0, 2
SEED = np.random.SeedSequence(1)


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    """Compute one task with three trials."""
    return transfer_table(("open",), trials=3, seed=16)


def row(task: str, method: str, change: str, lost: float, high: float) -> dict[str, object]:
    """Make up a row of the table."""
    return {
        "task": task,
        "method": method,
        "features": "pairs",
        "change": change,
        "n": 20,
        "lost": lost,
        "low": 2 * lost - high,
        "high": high,
        "d": 0.0,
    }


def test_the_rule_by_hand() -> None:
    """A reward transfers if no interval ends above the limit; one task that does is enough."""
    verdicts = verdict_table(
        pd.DataFrame(
            [
                row("open", "one-line", "none", 0.0, 0.0),
                row("random-1", "one-line", "none", 0.05, LIMIT),
                row("open", "one-line", "slip 0.1", 0.05, 0.09),
                row("random-1", "one-line", "slip 0.1", 0.04, 0.1001),  # the mean is below
                row("open", "cloning", "slip 0.1", 0.9, 0.95),
                row("random-1", "cloning", "slip 0.1", 0.01, 0.02),
                row("open", FEATURES, "slip 0.1", -0.2, -0.1),
                row("random-1", FEATURES, "slip 0.1", 0.0, 0.0),
                row("open", "one-line", "moved goal", np.nan, np.nan),
                row("random-1", "one-line", "moved goal", 0.0, 0.01),
            ]
        )
    ).set_index(["method", "change"])
    assert verdicts["transfers"].to_dict() == {
        ("one-line", "none"): True,
        ("one-line", "slip 0.1"): False,
        ("one-line", "moved goal"): False,
        ("cloning", "slip 0.1"): False,
        (FEATURES, "slip 0.1"): True,
    }
    assert verdicts["worst"].tolist()[:2] == ["random-1", "random-1"]
    assert verdicts.loc[("cloning", "slip 0.1"), ["worst", "lost", "high"]].tolist() == [
        "open",
        0.9,
        0.95,
    ]
    predicted = verdicts.index[verdicts["predicted"]].tolist()
    assert predicted == [("one-line", "none"), (FEATURES, "slip 0.1")]


def test_the_rule_is_the_frozen_one() -> None:
    """Limit and predictions are those that were written down before the run."""
    assert transfer.LIMIT == 0.1
    assert {name: len(changes) for name, changes in PREDICTED.items()} == {
        "unified-incorrect": 0,
        "perceptron": 0,
        "one-line": 1,
        "cloning": 1,
        "max-entropy": 1,
        FEATURES: 6,
    }
    assert all(set(changes) <= set(CHANGES) for changes in PREDICTED.values())


def test_the_table_is_tidy(table: pd.DataFrame) -> None:
    """One row a method and change; methods without chance are run once, and are their interval."""
    assert [*zip(table["method"], table["change"], strict=True)] == [
        (method, change) for method in PREDICTED for change in CHANGES
    ]
    once = table[~table["method"].isin(transfer.LOOPS)]
    assert set(once["n"]) == {1}
    assert (once["low"] == once["lost"]).all()
    assert (once["high"] == once["lost"]).all()
    assert set(table["n"][table["method"].isin(transfer.LOOPS)]) == {3}
    assert set(table["method"][table["features"] == "few"]) == {FEATURES}
    assert (table["low"] <= table["lost"]).all()
    assert (table["lost"] <= table["high"]).all()


def test_the_table_is_the_same_again(table: pd.DataFrame) -> None:
    """Nothing is drawn but from the root seed."""
    again = transfer_table(("open",), trials=3, seed=16)
    pd.testing.assert_frame_equal(again, table, check_exact=True)


@pytest.mark.parametrize("method", transfer.LOOPS)
def test_the_table_is_of_what_was_learned(table: pd.DataFrame, method: str) -> None:
    """Each trial learns by the defaults and the general list, and loses what it loses elsewhere."""
    demos = maze_demos("open", Expert())
    maze, another = (as_maze(one.environment) for one in (demos, maze_demos(ANOTHER, Expert())))
    condition = BaselineCondition(demos, method, Params.of(incorrect=GENERAL))
    rewards = [condition.trial(seed=seed).weights for seed in trial_seeds(16, 3)]
    own = table[table["method"] == method].set_index("change")
    for change, world in worlds(maze, another).items():
        lost = np.array([world.lost(world.follow(reward)) for reward in rewards])
        expected = lost.mean(), *map(float, mean_interval(lost))
        assert own.loc[change, ["lost", "low", "high"]].tolist() == pytest.approx(expected)
    world = World(maze, moves_of(maze))
    mu_e = mean_expectations(demos.correct, gamma=0.9, shape=world.moves.shape)
    d = [np.linalg.norm(mu_e - world.visits(world.follow(reward))) for reward in rewards]
    assert own["d"].tolist() == pytest.approx([np.mean(d)] * len(CHANGES))


def test_a_copier_knows_the_path_alone(table: pd.DataFrame) -> None:
    """It loses nothing on the path, and all where the path leads nowhere."""
    own = table[table["method"] == "cloning"].set_index("change")
    assert own.loc["none", ["lost", "d"]].tolist() == pytest.approx([0, 0], abs=1e-12)
    assert own.loc[["mirrored map", "moved goal"], "lost"].tolist() == pytest.approx([1, 1], 1e-3)


def test_no_trial_is_like_another() -> None:
    """Each trial of Q-learning has a seed of its own, and learns another reward."""
    demos = maze_demos("open", Expert())
    maze = as_maze(demos.environment)
    world = World(maze, moves_of(maze))
    first, second = (learn(demos, "perceptron", seed=seed)(world) for seed in trial_seeds(16, 2))
    assert not np.array_equal(first, second)


def test_learned_by_hand_in_a_corridor() -> None:
    """The copier goes up where the expert never was; the one-line reward leads back to the path."""
    maze = Maze.from_text("""
        S..G
        ....
    """)
    demos, world = demonstrate("corridor", maze), World(maze, moves_of(maze))
    copied = learn(demos, "cloning", seed=SEED)(world).argmax(axis=1)
    assert copied.tolist() == [RIGHT] * 3 + [UP] * 5
    line = learn(demos, "one-line", seed=SEED)(world).argmax(axis=1)
    assert line[:3].tolist() == [RIGHT] * 3
    assert line[4:7].tolist() == [UP] * 3


def test_features_are_those_of_the_world_where_they_are_used() -> None:
    """What was learned in a corridor to the right leads to a goal at the left."""
    there, back = Maze(("S....G",)), Maze(("G....S",))
    learned = learn(demonstrate("corridor", there), FEATURES, seed=SEED)
    policy = learned(World(back, moves_of(back)))
    assert policy.shape == (6, 4)
    assert World(there, moves_of(there)).lost(learned(World(there, moves_of(there)))) == 0
    assert not np.array_equal(policy, learned(World(there, moves_of(there))))
