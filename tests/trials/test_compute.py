from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numba
import numpy as np
import pytest

from replication import Demos, source
from replication.irl import METHODS, Trial
from replication.paper.params import Params
from replication.paper.register import load_choices
from replication.trials import compute
from replication.trials.compute import TRACED_TRIAL, trial_key
from replication.trials.condition import Condition

FEW = {"episodes": 60, "horizon": 40, "max_iterations": 20}


@pytest.fixture
def condition(small_demos: Demos) -> Condition:
    """Return a condition that uses incorrect demonstrations."""
    return Condition(small_demos, "unified-incorrect", Params.of(**FEW, incorrect="all"))


def other_value(id: str) -> Any:
    """Return a value of a choice that is accepted and not the default."""
    entry = load_choices()[id]
    if entry.range is None:
        return entry.alternatives[0]
    low, high = entry.range
    return type(entry.default)(low if entry.default != low else high)


PARAMETERS = {
    entry.field.split(".")[1]: entry.id
    for entry in load_choices().values()
    if entry.field and entry.field.split(".")[1] in Params().values()
}


def test_every_parameter_is_tried() -> None:
    """The cases below are all parameters of a trial."""
    assert PARAMETERS.keys() == Params().values().keys()


@pytest.mark.parametrize("name", sorted(set(PARAMETERS) - {"incorrect"}))
def test_every_parameter_gives_another_key(small_demos: Demos, name: str) -> None:
    """Each parameter of a trial is part of its key."""
    default = Condition(small_demos, "unified-incorrect", Params.of(incorrect="all"))
    params = Params.of(incorrect="all", **{name: other_value(PARAMETERS[name])})
    assert params != default.params
    assert trial_key(replace(default, params=params), 1, 0) != trial_key(default, 1, 0)


def test_method_demos_and_seed_give_another_key(condition: Condition) -> None:
    """Whatever else determines a trial is part of its key, one by one."""
    demos = condition.demos
    twin = replace(demos.correct[0], name="twin")
    others = [
        *(replace(condition, method=name) for name in METHODS if name != condition.method),
        replace(condition, params=Params.of(**FEW, incorrect="hit")),
        replace(condition, demos=replace(demos, correct=(*demos.correct, twin))),
        replace(condition, demos=replace(demos, incorrect=demos.incorrect[1:])),
    ]
    keys = [trial_key(one, 1, 3) for one in (condition, *others)]
    keys += [trial_key(condition, 1, 4), trial_key(condition, 2, 3)]
    assert len(set(keys)) == len(keys)


def test_traced_trials_have_a_key_of_their_own(condition: Condition) -> None:
    """A trial with its snapshots is not one without; others never have any."""
    assert trial_key(condition, 1, TRACED_TRIAL) != trial_key(
        condition, 1, TRACED_TRIAL, traced=False
    )
    after = TRACED_TRIAL + 1
    assert trial_key(condition, 1, after) == trial_key(condition, 1, after, traced=False)


@pytest.mark.parametrize(
    ("owner", "name", "value"),
    [
        (compute, "source_hash", lambda _: "other"),
        (numba, "__version__", "0"),
        (np, "__version__", "0"),
    ],
)
def test_code_and_versions_give_another_key(
    condition: Condition, monkeypatch: pytest.MonkeyPatch, owner: Any, name: str, value: Any
) -> None:
    """What computes a trial is part of its key: our code, numpy and numba."""
    before = trial_key(condition, 1, 0)
    monkeypatch.setattr(owner, name, value)
    assert trial_key(condition, 1, 0) != before


def test_nothing_else_gives_another_key(
    condition: Condition, monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    """Neither prose, nor the task's name, nor the working folder or environment is in the key."""
    before = trial_key(condition, 1, 0)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("REPLICATION_SCHEDULER", "tcp://nowhere:1")
    described = replace(condition.demos, description="other words")
    assert trial_key(replace(condition, demos=described), 1, 0) == before
    unseen = replace(condition, method="unified")
    chosen = replace(unseen, params=Params.of(**FEW, incorrect="none"))
    assert trial_key(unseen, 1, 0) == trial_key(chosen, 1, 0)


def test_key_is_the_same_in_another_process(condition: Condition) -> None:
    """Keys are hex digits that depend on no object's identity or hash."""
    twin = Condition(replace(condition.demos), condition.method, Params.of(**FEW, incorrect="all"))
    assert trial_key(twin, 1, 0) == trial_key(condition, 1, 0)
    assert set(trial_key(condition, 1, 0)) <= set("0123456789abcdef")


def test_source_of_a_trial_is_what_computes_it() -> None:
    """The hash covers learning, tasks and updates, and not what schedules, stores or draws."""
    covered = source.module_hashes(["replication.trials.compute"])
    for name in ("compute", "irl", "irl.loop", "irl.unified", "irl.adaboost", "tasks", "kernel"):
        assert f"replication.{name}" in covered
    for name in ("qlearning", "expectations", "setting", "params", "seeds", "demos", "envs.maze"):
        assert f"replication.{name}" in covered
    for name in (
        *("store", "trials", "progress", "figures", "panels", "tables", "notebooks", "cli"),
        *("regenerate", "execution", "provenance", "status", "verification", "statistics"),
    ):
        assert find_spec(f"replication.{name}") is not None
        assert f"replication.{name}" not in covered


def test_trials_come_with_their_keys_and_own_bits(condition: Condition) -> None:
    """Side by side or alone, in any order, a trial has the same bits under the same key."""
    wanted = [(condition, 2), (replace(condition, method="unified"), 0), (condition, 0)]
    together = dict(compute.compute(condition.agent, wanted, 7))
    assert set(together) == {trial_key(one, 7, k) for one, k in wanted}
    for one in wanted:
        ((key, alone),) = compute.compute(condition.agent, [one], 7)
        assert bits(together[key]) == bits(alone)


@pytest.mark.parametrize("traced", [True, False])
def test_only_the_traced_trial_keeps_snapshots(condition: Condition, traced: bool) -> None:
    """The declared trial keeps every iteration, if asked for; its result is the same without."""
    found = dict(
        compute.compute(condition.agent, [(condition, 0), (condition, 1)], 7, traced=traced)
    )
    first, second = (found[trial_key(condition, 7, k, traced=traced)] for k in (0, 1))
    assert (first.snapshots is not None) == traced
    assert second.snapshots is None
    plain: Callable[..., list[tuple[str, Trial]]] = compute.compute
    ((_, other),) = plain(condition.agent, [(condition, 0)], 7, traced=not traced)
    assert bits(other) == bits(first)


def bits(trial: Trial) -> tuple[object, ...]:
    """Return all of a trial but its snapshots."""
    arrays = (trial.errors, trial.weights, trial.q, trial.values, *sum(trial.episodes, ()))
    return trial.converged, trial.steps, *(array.tobytes() for array in arrays)
