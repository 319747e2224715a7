from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from replication import Demos, Maze
from replication.baselines import BaselineCondition
from replication.demos.maze_expert import random_actions
from replication.demos.model import Demo
from replication.evidence import limit_demos, limits
from replication.evidence.claims import load_claims
from replication.evidence.limit_demos import nearest, nearest_demo, noisy_demos, path_demos
from replication.evidence.limits import (
    LEVELS,
    METHODS,
    NUMBERS,
    PART,
    ROLLOUTS,
    SIDES,
    Setting,
    condition_of,
    noise_table,
    paths_table,
    plan,
    settings,
    sizes_table,
)
from replication.evidence.statistics import mean_interval, share_interval
from replication.learning.seeds import child
from replication.paper.params import Params
from replication.trials.table import planned_table

N = 3

CHANGES: dict[str, dict[str, Any]] = {
    "sizes": {"INCORRECT-KINDS": "none"},
    "noise": {"INCORRECT-KINDS": "none"},
    "paths": {"INCORRECT-KINDS": "none", "PLATEAU": 50},
}


def test_the_design() -> None:
    """The points are those asked for, and their rules the registered ones but for a plateau."""
    assert SIDES == (5, 10, 20, 30, 50, 70, 100)
    assert (NUMBERS, ROLLOUTS) == ((1, 2, 3, 5), (1, 100))
    assert (limits.PLAIN, *LEVELS) == (0, 0.05, 0.1, 0.2)
    known = [seed for run in load_claims().known for seed in run.root_seeds]
    assert limit_demos.DEMO_ROOT not in {*known, load_claims().judging.root_seed}
    for setting in settings(2):
        own = condition_of(setting)
        changed = CHANGES[setting.design] | ({"ROLLOUTS": 100} if setting.rollouts > 1 else {})
        assert own.params.differences() == changed
        assert own.params.loop.max_iterations == 300
        assert own.method == setting.method
        assert own.selected.incorrect == ()
        match setting.design:
            case "sizes":
                assert own.demos.environment.n_states == setting.value**2
            case "paths":
                assert own.demos == path_demos(int(setting.value), setting.draw)
                assert len(own.demos.correct) == setting.value
            case "noise":
                assert own.demos == noisy_demos(setting.value, setting.draw)


def test_the_points_keep_their_places() -> None:
    """More draws go behind the others; each point is there once, the plain one without draws."""
    few, many = settings(2), settings(5)
    assert many[: len(few)] == few
    assert len(set(many)) == len(many) == 7 * 3 + 1 + 5 * (4 * 2 + 3)


def test_the_last_move_of_the_longest_path_counts() -> None:
    """Another move in its place keeps d above the threshold; a little later it would not."""
    params = Params()
    gamma, threshold = params.learner.gamma, params.loop.threshold
    moves = 2 * (max(SIDES) - 1)
    assert np.sqrt(2) * gamma ** (moves - 1) > threshold
    assert gamma ** (moves - 1) == pytest.approx(threshold, rel=0.05)


def test_plan_has_a_trial_for_each_draw() -> None:
    """The plain demonstration has as many trials as there are draws, a size at most five."""
    groups = plan(7)
    numbered = settings(7)
    assert [group.labels for group in groups] == [
        {"part": PART, "number": number} for number in range(len(numbered))
    ]
    for group, setting in zip(groups, numbered, strict=True):
        plain = setting.value == 0
        assert group.trials == {"sizes": 5, "paths": 1, "noise": 7 if plain else 1}[setting.design]
        assert len(group.conditions) == 1
    sizes = [setting.design == "sizes" for setting in settings(2)]
    assert [group.trials for group in plan(2)][: sum(sizes)] == [2] * sum(sizes)


# --- the tables ------------------------------------------------------------------------------


def made_up() -> pd.DataFrame:
    """Make up trials in any order: d falls to 0.5 or zero; some begin with the least."""
    trials = planned_table(plan(N), seed=1)
    number, trial = trials["number"].to_numpy(), trials["trial"].to_numpy()
    done = (number + trial) % 4 == 0
    histories = [
        " ".join(
            [
                "0.1" if at % 11 == 0 and not zero else "4",
                "0.3" if at % 7 == 0 and not zero else "2",
                *["3"] * (at % 5),
                "0" if zero else "0.5",
                *([] if zero else ["0.5", "1"]),
            ]
        )
        for at, zero in zip(number, done, strict=True)
    ]
    trials = trials.assign(
        iterations=[len(history.split()) - 1 for history in histories],
        converged=done.astype(int),
        steps=1000 * (number + 1) + trial**2,
        errors=histories,
    )
    other = trials.assign(part="another", iterations=1e6, steps=1e12)
    return pd.concat([trials, other]).sample(frac=1.0, random_state=1)


@pytest.fixture(scope="module")
def trials() -> pd.DataFrame:
    """Return made-up trials, with some of another part among them."""
    return made_up()


def of(trials: pd.DataFrame, **wanted: Any) -> pd.DataFrame:
    """Return the trials of a point."""
    numbers = [
        number
        for number, setting in enumerate(settings(N))
        if all(getattr(setting, name) == value for name, value in wanted.items())
    ]
    own = trials[(trials["part"] == PART) & trials["number"].isin(numbers)]
    return own.sort_values(["number", "trial"])


def test_paths_by_hand(trials: pd.DataFrame) -> None:
    """Least d and its iteration, beside what one path can reach for the same demonstrations."""
    table = paths_table(trials)
    keys = [(row.number, row.rollouts) for row in table.itertuples()]
    assert keys == [(number, rollouts) for number in NUMBERS for rollouts in ROLLOUTS]
    for row in table.itertuples():
        own = of(trials, design="paths", value=row.number, rollouts=row.rollouts)
        assert row.n == len(own) == N
        least, at = [], []
        for text in own["errors"]:
            d = [float(word) for word in text.split()]
            least.append(min(d))
            at.append(d.index(min(d)))
        assert (row.d, row.at) == pytest.approx((np.mean(least), np.median(at)))
        assert (row.d_low, row.d_high) == pytest.approx(
            tuple(map(float, mean_interval(np.array(least))))
        )
        low, high = np.percentile(at, [25, 75])
        assert (row.at_low, row.at_high) == pytest.approx((low, high))
        later = [min(map(float, text.split()[1:])) for text in own["errors"]]
        assert row.learned == pytest.approx(np.mean(later))
        demos = [path_demos(row.number, draw) for draw in range(N)]
        bounds = np.array([nearest(one, gamma=0.9) for one in demos])
        assert row.shortest == pytest.approx(bounds.mean())
        assert row.demo == pytest.approx(np.mean([nearest_demo(one, gamma=0.9) for one in demos]))
        assert row.reached == pytest.approx(np.mean(least <= bounds + 1e-9))
        assert row.nearer == pytest.approx(np.mean(least < bounds - 1e-9))
        assert row.zero == own["converged"].mean()
        assert row.untrained == np.mean(np.array(at) == 0)
    assert 0 < table["untrained"].mean() < 1
    assert (table.loc[table["number"] == 1, "shortest"] == 0).all()
    assert table["nearer"].nunique() > 1


def test_what_comes_as_near_but_for_rounding_has_reached_it(trials: pd.DataFrame) -> None:
    """Distances are written with ten digits, which are a little more or less than what they say."""

    def history(setting: Setting) -> str:
        demos = path_demos(int(setting.value), setting.draw)
        return f"4 {nearest(demos, gamma=0.9):.10g} 3"

    numbered = settings(N)
    own = trials[(trials["part"] == PART) & (trials["trial"] == 0)]
    own = own[[numbered[number].design == "paths" for number in own["number"]]]
    table = paths_table(own.assign(errors=[history(numbered[n]) for n in own["number"]]))
    assert set(table["reached"]) == {1}
    assert set(table["nearer"]) == {0}


def test_noise_by_hand(trials: pd.DataFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    """Shares with their intervals; those against themselves are told apart."""
    monkeypatch.setattr(limits, "contradictory", lambda level: round(1000 * level))
    table = noise_table(trials)
    assert table["level"].tolist() == [0, 0.05, 0.1, 0.2]
    for row in table.itertuples():
        own = of(trials, design="noise", value=row.level)
        done = own["converged"].to_numpy(bool)
        assert row.n == len(own) == N
        assert (row.share_low, row.share_high) == share_interval(done.sum(), N)
        assert row.share == done.mean()
        assert row.iterations == np.median(own["iterations"])
        assert row.d == pytest.approx(
            np.mean([min(map(float, text.split())) for text in own["errors"]])
        )
        draws = range(N) if row.level else [0] * N
        against = [bool(noisy_demos(row.level, draw).conflicts()) for draw in draws]
        assert (row.against, row.against_zero) == (sum(against), (np.array(against) & done).sum())
        assert row.contradictory == row.level
    assert table["against"].sum() > 0


def test_sizes_by_hand(trials: pd.DataFrame) -> None:
    """Means over the trials of a side and method, with what an episode takes of them."""
    table = sizes_table(trials)
    keys = [(row.side, row.method) for row in table.itertuples()]
    assert keys == [(side, method) for side in SIDES for method in METHODS]
    for row in table.itertuples():
        own = of(trials, design="sizes", value=row.side, method=row.method)
        assert (row.cells, row.moves, row.n) == (row.side**2, 2 * row.side - 2, N)
        assert (row.iterations, row.steps) == (own["iterations"].mean(), own["steps"].mean())
        low, high = map(float, mean_interval(own["steps"].to_numpy(float)))
        assert (row.steps_low, row.steps_high) == pytest.approx((low, high))
        assert row.zero == own["converged"].mean()
        assert row.episode == pytest.approx(own["steps"].sum() / own["iterations"].sum() / 2000)


def test_one_trial_of_each_has_no_interval(monkeypatch: pytest.MonkeyPatch) -> None:
    """A quick run has tables, too."""
    monkeypatch.setattr(limits, "contradictory", lambda level: 0)
    trials = made_up()
    one = trials[(trials["part"] == PART) & (trials["trial"] == 0)]
    one = one[one["number"] < len(settings(1))]
    for table in (paths_table(one), sizes_table(one)):
        assert set(table["n"]) == {1}
        assert table.notna().all(axis=None)
    assert noise_table(one).notna().all(axis=None)


# --- what is known beforehand ----------------------------------------------------------------

SMALL = Maze.from_text("...G\n....\n.#..\nS...")
FEW = {"incorrect": "none", "episodes": 100, "horizon": 30}


@pytest.mark.parametrize("method", ["unified", "perceptron", "one-line"])
@pytest.mark.parametrize("pair", range(4))
def test_two_different_demonstrations_never_converge(method: str, pair: int) -> None:
    """With one trajectory an iteration d stays above what one trajectory can reach; alone not."""
    ways = [random_actions(SMALL, seed=np.random.SeedSequence((pair, k))) for k in range(30)]
    first = ways[0]
    other = next(way for way in ways if way != first)
    parted = next(t for t, (a, b) in enumerate(zip(first, other, strict=True)) if a != b)
    for chosen in ([first, other], [first]):
        demos = Demos(
            "small",
            SMALL,
            tuple(
                Demo(str(k), "correct", SMALL.replay(way), np.array(way))
                for k, way in enumerate(chosen)
            ),
        )
        params = Params.of(**FEW, max_iterations=60)
        condition = BaselineCondition(demos, method, params)
        trial = condition.trial(seed=child(np.random.SeedSequence(3), pair))
        if len(chosen) == 2:
            assert not trial.converged
            assert trial.iterations == 60
            assert trial.errors.min() >= 0.9**parted / 2
        else:
            assert trial.converged


def test_a_point_can_be_run() -> None:
    """A trial of the smallest size ends at zero."""
    condition = condition_of(Setting("sizes", 5, "one-line", 1, 0))
    trial = condition.trial(seed=child(np.random.SeedSequence(17), 0))
    assert (trial.converged, trial.iterations) == (True, 1)
