from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from replication import Demos, Fit, Params, fit
from replication.fitting import FitError
from replication.trials.condition import Condition
from replication.trials.run import run_trials
from replication.trials.store import Store
from tests.conftest import Spoil

FEW = Params.of(incorrect="all", episodes=300, horizon=50)


@pytest.fixture(scope="module")
def fitted(small_demos: Demos) -> Fit:
    """Learn once for all tests."""
    return fit(small_demos, params=FEW, seed=3)


def test_fit_repeats_the_demonstration(fitted: Fit) -> None:
    """A converged fit walks the expert's path, and its last error is within the threshold."""
    assert fitted.converged
    np.testing.assert_array_equal(fitted.states, fitted.demos.correct[0].states)
    assert fitted.errors[-1] <= fitted.params.loop.threshold
    assert fitted.iterations == len(fitted.errors) - 1


def test_fit_is_trial_0_of_the_same_root(fitted: Fit, small_demos: Demos, store_path: Path) -> None:
    """The front door and the batch compute the same bits."""
    condition = Condition(small_demos, "unified-incorrect", FEW)
    trial = run_trials([condition], trials=1, store=Store(store_path), seed=3).trial(condition, 0)
    np.testing.assert_array_equal(fitted.weights, trial.weights)
    np.testing.assert_array_equal(fitted.q, trial.q)
    np.testing.assert_array_equal(fitted.errors, trial.errors)
    np.testing.assert_array_equal(fitted.states, trial.episodes[-1].states)
    np.testing.assert_array_equal(fitted.actions, trial.episodes[-1].actions)


def test_saved_fit_loads_with_every_bit(fitted: Fit, tmp_path: Path) -> None:
    """Save and load are inverse, and saving again writes the same bytes."""
    path = fitted.save(tmp_path / "fit.json")
    loaded = Fit.load(path)
    for name in ("weights", "q", "states", "actions", "errors"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(fitted, name))
    assert (loaded.method, loaded.params, loaded.seed, loaded.converged) == (
        fitted.method,
        fitted.params,
        fitted.seed,
        fitted.converged,
    )
    assert loaded.demos == fitted.demos
    assert loaded.save(tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_saved_fit_is_plain_json(fitted: Fit, tmp_path: Path) -> None:
    """Other programs can read the file without this package."""
    document = json.loads(fitted.save(tmp_path / "fit.json").read_text(encoding="utf-8"))
    assert document["format"] == "replication-fit"
    assert np.array(document["weights"]).shape == (fitted.demos.environment.n_states, 4)


@pytest.mark.parametrize(
    "text", ["", "{}", "[]", '{"format": "replication-fit", "version": 9}', '{"format": "other"}']
)
def test_other_files_are_refused_in_one_line(text: str, tmp_path: Path) -> None:
    """A file that holds no fit gives one clear error with its name."""
    path = tmp_path / "broken.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FitError, match=r"broken\.json") as caught:
        Fit.load(path)
    assert "\n" not in str(caught.value)


def test_whatever_is_in_the_place_of_a_fit(tmp_path: Path, spoil: Spoil) -> None:
    """A pipe, a device, a folder, a huge file and JSON that is none are refused in one line."""
    spoil(tmp_path / "fit.json")
    with pytest.raises(FitError, match=r"fit\.json: is [^\n]+$"):
        Fit.load(tmp_path / "fit.json")


def test_truncated_fit_is_refused(fitted: Fit, tmp_path: Path) -> None:
    """Half a file is not taken for a whole one."""
    path = fitted.save(tmp_path / "fit.json")
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(FitError):
        Fit.load(path)


def test_another_seed_gives_another_course(fitted: Fit, small_demos: Demos) -> None:
    """The seed matters, and the same seed gives the same bits."""
    again, other = (fit(small_demos, params=FEW, seed=seed) for seed in (3, 4))
    np.testing.assert_array_equal(again.q, fitted.q)
    assert not np.array_equal(other.q, fitted.q)


def test_each_update_is_reported(fitted: Fit, small_demos: Demos) -> None:
    """A report gets the error before each weight update, and changes nothing."""
    told: list[tuple[int, float]] = []
    again = fit(small_demos, params=FEW, seed=3, report=lambda *news: told.append(news))
    assert told == list(enumerate(fitted.errors[:-1], start=1))
    np.testing.assert_array_equal(again.q, fitted.q)
