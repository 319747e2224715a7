from __future__ import annotations

import sqlite3
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from replication import Demos
from replication.demos.model import content_hash
from replication.irl import Trial
from replication.learning.seeds import trial_seeds
from replication.paper.params import Params
from replication.trials import compute as compute_module
from replication.trials import run as run_module
from replication.trials.compute import TRACED_TRIAL, compute, trial_key
from replication.trials.condition import Condition
from replication.trials.results import Results, digest
from replication.trials.run import WorkerError, run_trials
from replication.trials.store import Store

FEW = {"episodes": 60, "horizon": 40, "max_iterations": 40}


def _conditions(demos: Demos) -> list[Condition]:
    return [
        Condition(demos, method, Params.of(**FEW))
        for method in ("adaboost", "unified", "unified-incorrect")
    ]


def _run(demos: Demos, path: Path, *, jobs: int = 1, trials: int = 4, seed: int = 5) -> Results:
    return run_trials(_conditions(demos), trials=trials, store=Store(path), jobs=jobs, seed=seed)


def _bits(results: Results) -> list[bytes]:
    return [
        array.tobytes()
        for condition in results.conditions
        for k in range(results.trials)
        for trial in [results.trial(condition, k)]
        for array in (
            *(trial.errors, trial.weights, trial.q, trial.collisions, trial.values, trial.rewards),
            *sum(trial.episodes, ()),
        )
    ]


@pytest.mark.parametrize("jobs", [2, 4])
def test_workers_do_not_change_a_bit(small_demos: Demos, tmp_path: Path, jobs: int) -> None:
    """One, two and four workers give the same bits."""
    alone = _run(small_demos, tmp_path / "one.sqlite", trials=28)
    shared = _run(small_demos, tmp_path / "many.sqlite", jobs=jobs, trials=28)
    assert _bits(alone) == _bits(shared)


def test_a_trial_does_not_depend_on_how_many_there_are(small_demos: Demos, tmp_path: Path) -> None:
    """The first trials of a long run are those of a short one."""
    short = _run(small_demos, tmp_path / "short.sqlite", trials=2)
    long = _run(small_demos, tmp_path / "long.sqlite", trials=6)
    assert set(_bits(short)) <= set(_bits(long))


def test_conditions_know_the_hash_of_what_they_select(small_demos: Demos) -> None:
    """The hash in a trial's key is that of the demonstrations that the method is given."""
    for incorrect in ("none", "hit", "all"):
        for method in ("adaboost", "unified", "unified-incorrect"):
            condition = Condition(small_demos, method, Params.of(incorrect=incorrect))
            assert condition.selected_hash == content_hash(condition.selected)


def test_finished_trials_are_not_computed_again(
    small_demos: Demos, store_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second run reads the store only, and more trials compute just the new ones."""
    first = _run(small_demos, store_path)
    computed: list[list[int]] = []

    def spy(self: Condition, *, seed: np.random.SeedSequence, keep: bool = False) -> None:
        computed.append(list(seed.spawn_key))
        raise AssertionError("a finished trial was computed again")

    monkeypatch.setattr(Condition, "trial", spy)
    assert _bits(_run(small_demos, store_path)) == _bits(first)
    assert computed == []
    with pytest.raises(AssertionError):
        _run(small_demos, store_path, trials=5)
    assert computed == [[4]]


def test_a_capped_trial_is_marked(small_demos: Demos, store_path: Path) -> None:
    """A trial that ended at the cap has as many iterations, and has not converged."""
    capped = Condition(small_demos, "unified", Params.of(**{**FEW, "max_iterations": 2}))
    results = run_trials([capped], trials=2, store=Store(store_path), seed=5)
    trials = [results.trial(capped, k) for k in range(2)]
    assert [(trial.iterations, trial.converged) for trial in trials] == [(2, False)] * 2


def test_only_the_declared_trial_keeps_snapshots(small_demos: Demos, store_path: Path) -> None:
    """FIG5-TRIAL: one trial of a condition keeps every iteration, the others their result."""
    results = _run(small_demos, store_path)
    for k in range(results.trials):
        trial = results.trial(results.conditions[0], k, snapshots=True)
        assert (trial.snapshots is not None) == (k == TRACED_TRIAL)


def test_key_changes_with_everything_that_matters(small_demos: Demos) -> None:
    """Method, parameters, used demonstrations, root and trial each give another key."""
    condition = Condition(small_demos, "unified-incorrect", Params.of(incorrect="all"))
    shorter = replace(small_demos, incorrect=small_demos.incorrect[1:])
    keys = [
        trial_key(condition, 1, 0),
        trial_key(condition, 1, 1),
        trial_key(condition, 2, 0),
        trial_key(replace(condition, method="unified"), 1, 0),
        trial_key(replace(condition, params=Params.of(alpha=0.1)), 1, 0),
        trial_key(replace(condition, params=Params.of(incorrect="opposite")), 1, 0),
        trial_key(replace(condition, demos=shorter), 1, 0),
    ]
    assert len(set(keys)) == len(keys)


def test_key_ignores_what_does_not_matter(small_demos: Demos) -> None:
    """A new description, or incorrect demonstrations that the method never sees, change nothing."""
    condition = Condition(small_demos, "unified", Params())
    described = replace(small_demos, description="other words", incorrect=())
    same = Condition(described, "unified", Params.of(incorrect="none"))
    assert trial_key(condition, 1, 0) == trial_key(same, 1, 0)


def test_methods_share_their_seeds(small_demos: Demos, store_path: Path) -> None:
    """Paired comparison: trial k of every method starts from the same first trajectory."""
    results = _run(small_demos, store_path)
    first = {
        tuple(results.trial(condition, k).errors[0] for k in range(results.trials))
        for condition in results.conditions
    }
    assert len(first) == 1
    assert len(set(next(iter(first)))) > 1


def test_equal_conditions_are_run_once(small_demos: Demos, store_path: Path) -> None:
    """A condition that is given twice appears once in the results."""
    condition = Condition(small_demos, "unified", Params.of(**FEW))
    results = run_trials([condition, condition], trials=2, store=Store(store_path), seed=1)
    assert results.conditions == [condition]


def test_a_damaged_trial_is_computed_again(small_demos: Demos, store_path: Path) -> None:
    """What cannot be read from the store is replaced by the same bits."""
    results = _run(small_demos, store_path, trials=2)
    due = _bits(results)
    connection = sqlite3.connect(store_path)
    with connection:
        connection.execute("UPDATE trials SET record = substr(record, 1, 40)")
    connection.close()
    assert _bits(results) == due
    assert _bits(_run(small_demos, store_path, trials=2)) == due


def test_a_killed_run_goes_on_from_the_store(
    small_demos: Demos, store_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a run that broke off had finished is not computed again."""
    condition = Condition(small_demos, "unified", Params.of(**FEW))
    put = Store.put

    def put_once(self: Store, trials: list[tuple[str, Trial]]) -> None:
        put(self, trials)
        monkeypatch.setattr(Store, "put", lambda *_: interrupt())

    def interrupt() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Store, "put", put_once)
    with pytest.raises(KeyboardInterrupt):
        run_trials([condition], trials=3, store=Store(store_path), seed=5)
    monkeypatch.setattr(Store, "put", put)
    keys = [trial_key(condition, 5, k) for k in range(3)]
    assert Store(store_path).known(keys) == {keys[0]}
    computed: list[int] = []

    def spy(condition: Condition, k: int, *given: Any, **options: Any) -> tuple[str, Trial]:
        computed.append(k)
        return compute(condition, k, *given, **options)

    monkeypatch.setattr(run_module, "compute", spy)
    run_trials([condition], trials=3, store=Store(store_path), seed=5)
    assert computed == [1, 2]


def test_a_worker_with_other_code_is_refused(
    small_demos: Demos, store_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Trials whose keys nobody asked for are not stored."""
    condition = Condition(small_demos, "unified", Params.of(**FEW))
    key = trial_key(condition, 5, 0)
    monkeypatch.setattr(compute_module, "trial_key", lambda *_, **__: "other")
    with pytest.raises(WorkerError, match=r"environment\.lock"):
        run_trials([condition], trials=1, store=Store(store_path), seed=5)
    assert not Store(store_path).known(["other", key])


def test_trial_seeds_are_the_children_of_the_root() -> None:
    """The seeds are numpy's own spawned children."""
    ours = [seed.generate_state(2).tolist() for seed in trial_seeds(3, 4)]
    assert ours == [s.generate_state(2).tolist() for s in np.random.SeedSequence(3).spawn(4)]


def test_digest_sees_every_part(small_demos: Demos, store_path: Path) -> None:
    """Trials that differ in any of their parts but the snapshots have other digests."""
    trial = _run(small_demos, store_path).trial(_conditions(small_demos)[1], 0)
    states, actions, hits = trial.episodes[0]
    turned = (type(trial.episodes[0])(states, actions, ~hits), *trial.episodes[1:])
    others = [
        replace(trial, errors=np.nextafter(trial.errors, 9)),
        replace(trial, weights=-trial.weights),
        replace(trial, q=trial.q + 1),
        replace(trial, values=trial.values + 1),
        replace(trial, values=trial.values.T),
        replace(trial, rewards=trial.rewards + 1),
        replace(trial, collisions=trial.collisions + 1),
        replace(trial, collisions=trial.collisions[:-1]),
        replace(trial, converged=not trial.converged),
        replace(trial, steps=trial.steps + 1),
        replace(trial, episodes=trial.episodes[1:]),
        replace(trial, episodes=turned),
    ]
    same = replace(trial, errors=trial.errors.copy(), snapshots=None)
    assert digest(same) == digest(trial)
    assert len({digest(one) for one in (trial, *others)}) == 1 + len(others)


def test_digests_are_those_of_the_store(small_demos: Demos, store_path: Path) -> None:
    """What was computed and what is read back have one digest, so either can be verified."""
    condition = _conditions(small_demos)[1]
    key, trial = compute(condition, 1, 5)
    _run(small_demos, store_path)
    assert digest(Store(store_path).get(key)) == digest(trial)
