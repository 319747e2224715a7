from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from replication.baselines import BASELINES, find_method
from replication.baselines.baseline import Baseline
from replication.evidence import comparison
from replication.evidence.comparison import (
    IN_SOCCER,
    Setting,
    comparison_table,
    conditions,
    noise_table,
    start_table,
)
from replication.evidence.experiments import GENERAL, NONE
from replication.evidence.specifications import MAPS
from replication.evidence.statistics import mean_interval
from replication.irl import METHODS
from replication.irl.methods import TRACES
from replication.paper.published import SOCCER
from replication.trials.table import planned_table

N = 4


def counts(number: Any, trial: Any) -> Any:
    """Return made-up iterations, which spread more in some conditions than in others."""
    return number + (1 + number % 4) * trial**2


def made_up() -> pd.DataFrame:
    """Make up trials in any order, and some of another part; every fifth condition ends at d = 2.

    Of each condition the last trial begins with a greater d than the others.
    """
    trials = planned_table(comparison.plan(N), seed=1)
    number, trial = trials["number"].to_numpy(), trials["trial"].to_numpy()
    last, first = np.where(number % 5 == 0, 2, 0), np.where(trial == N - 1, 9, 3)
    own = trials.assign(
        iterations=counts(number, trial),
        converged=(last == 0).astype(int),
        steps=1000 * number + trial,
        errors=[f"{d} 1 {end}" for d, end in zip(first, last, strict=True)],
        early_collisions=10 * number + trial,
        early_errors=number,
    )
    other = own.assign(part="another", iterations=10**6, early_errors=10**6)
    return pd.concat([own, other]).sample(frac=1.0, random_state=1)


TRIALS = made_up()
COUNTS = {
    setting: counts(float(number), np.arange(N)) for number, setting in enumerate(conditions())
}
TABLE = comparison_table(TRIALS)


def row(setting: Setting) -> Any:
    """Return a row of the table."""
    (found,) = TABLE[(TABLE[list(setting._fields)] == list(setting)).all(axis=1)].itertuples()
    return found


def test_every_method_meets_every_maze() -> None:
    """Each is there with both solvers, under both traces, and with the list if it takes any."""
    for name in (*METHODS, *BASELINES):
        method = find_method(name)
        own = [setting for setting in conditions() if setting.method == name]
        mazes = {setting.task for setting in own} - {"soccer"}
        assert len(mazes) == len(MAPS)
        assert {setting.solver for setting in own} == {"q-learning", "planning"}
        traces = [reading for reading in method.readings if reading in ("", *TRACES)]
        assert {setting.reading for setting in own} == set(traces)
        sets = {setting.set for setting in own if setting.task in mazes}
        assert (GENERAL in sets) == method.uses_incorrect
        alone = isinstance(method, Baseline) and method.needs_incorrect
        assert (NONE in sets) == (not alone and not (method.uses_incorrect and method.baseline))
    soccer = {setting.method for setting in conditions() if setting.task == "soccer"}
    assert soccer == set(IN_SOCCER)


def test_soccer_is_that_of_the_paper() -> None:
    """It has the published parameters, and all incorrect demonstrations or none."""
    for setting, condition in conditions().items():
        if setting.task == "soccer":
            values = condition.params.values()
            assert {name: values[name] for name in SOCCER} == SOCCER
            assert setting.set == ("all" if condition.named.uses_incorrect else NONE)


def test_the_table_is_of_the_trials() -> None:
    """Means and intervals by hand: of d at the end, iterations and steps; the share at zero."""
    for number, setting in enumerate(conditions()):
        found = row(setting)
        low, high = map(float, mean_interval(COUNTS[setting]))
        assert found.iterations == pytest.approx(COUNTS[setting].mean())
        assert (found.iterations_low, found.iterations_high) == pytest.approx((low, high))
        assert found.d == (2.0 if number % 5 == 0 else 0.0)
        assert found.reached == (number % 5 != 0)
        assert found.steps == pytest.approx(1000 * number + 1.5)


def test_savings_are_against_the_method_without() -> None:
    """What is saved has the sign of fewer, against the method that it is without incorrect ones."""
    with_ = Setting("open-maze", "unified-incorrect", "updated", GENERAL, "q-learning")
    without = with_._replace(method="unified", set=NONE)
    for setting in (with_, with_._replace(method="wary")):
        saved, found = COUNTS[without] - COUNTS[setting], row(setting)
        assert found.saved == saved.mean()
        low, high = map(float, mean_interval(saved))
        assert (found.saved_low, found.saved_high) == pytest.approx((low, high))
    assert np.isnan(row(without).saved)


def test_each_method_is_held_to_the_unified_one() -> None:
    """What it needs more is against the unified method under either trace, with the same solver."""
    for solver in ("q-learning", "planning"):
        for method in ("perceptron", "adaboost"):
            setting = Setting("open-maze", method, "", NONE, solver)
            found = row(setting)
            for trace in ("printed", "updated"):
                unified = Setting("open-maze", "unified", trace, NONE, solver)
                more = COUNTS[setting] - COUNTS[unified]
                low, high = map(float, mean_interval(more))
                names = (f"over_{trace}{end}" for end in ("", "_low", "_high"))
                given = [getattr(found, name) for name in names]
                assert given == pytest.approx([more.mean(), low, high])


def test_plans_are_counted() -> None:
    """Planning inside takes a plan an iteration; what plans beforehand has these besides."""
    learned = Setting("open-maze", "unified", "printed", NONE, "q-learning")
    assert row(learned).plans == 0
    planned = row(learned._replace(solver="planning"))
    assert planned.plans == planned.iterations
    for name, method in BASELINES.items():
        if method.find is not None and not method.needs_incorrect:
            setting = Setting("open-maze", name, "", NONE, "q-learning")
            plans = conditions()[setting].found.plans
            assert row(setting).plans == plans
            planned = row(setting._replace(solver="planning"))
            assert planned.plans == plans + planned.iterations


def test_the_learners_noise_is_paired() -> None:
    """Its table has both solvers and their difference, the paper's methods and its mazes only."""
    table = noise_table(TRIALS)
    assert set(table["method"]) == set(METHODS)
    assert set(table["task"]) == {"open-maze", "obstacle-maze"}
    for found in table.itertuples():
        setting = Setting(found.task, found.method, found.reading, found.set, "q-learning")
        learned, planned = COUNTS[setting], COUNTS[setting._replace(solver="planning")]
        assert (found.learned, found.planned) == (learned.mean(), planned.mean())
        assert (found.learned_sd, found.planned_sd) == pytest.approx(
            (learned.std(ddof=1), planned.std(ddof=1))
        )
        assert found.noise == (learned - planned).mean()
        low, high = map(float, mean_interval(learned - planned))
        assert (found.noise_low, found.noise_high) == pytest.approx((low, high))
        assert [*map(float, found.iterations_learned.split())] == learned.tolist()
        assert [*map(float, found.iterations_planned.split())] == planned.tolist()


def test_the_beginning_is_that_of_the_printed_reading() -> None:
    """Means of the initial phase, and the median of d before each iteration."""
    table = start_table(TRIALS)
    numbers = {setting: number for number, setting in enumerate(conditions())}
    assert set(table["method"]) == {"perceptron", "unified", "unified-incorrect", "wary"}
    for found in table.itertuples():
        assert found.reading in ("", "printed")
        setting = Setting(found.task, found.method, found.reading, found.set, "q-learning")
        assert found.errors == numbers[setting]
        assert found.collisions == 10 * numbers[setting] + 1.5
        assert found.d in ("3 1 0", "3 1 2")
