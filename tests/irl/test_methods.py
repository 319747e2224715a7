from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from replication import METHODS, Demos, fit
from replication.evidence.experiments import conditions_of
from replication.evidence.tables import contrasts_table, summary_table
from replication.irl import READINGS, get_method
from replication.irl.methods import TRACES
from replication.paper.register import ChoiceError
from replication.report import errors, iterations
from replication.trials.measures import measure_trials
from replication.trials.run import run_trials
from replication.trials.store import Store
from tests.report.legible import shown_texts


def test_names_are_keys_and_labels_are_distinct() -> None:
    """A method is found under its own name, and no two look alike in a table."""
    assert all(name == method.name for name, method in METHODS.items())
    assert len({method.label for method in METHODS.values()}) == len(METHODS)


def test_reconstruction_is_labelled() -> None:
    """Wherever AdaBoost-IRL's label appears, it says which reconstruction it is."""
    assert "R1" in METHODS["adaboost"].label


def test_misspelt_method_is_refused_with_the_list() -> None:
    """An unknown name raises, suggests the nearest and lists the rest."""
    with pytest.raises(ChoiceError, match=r"^unknown method .*did you mean 'unified'.*adaboost"):
        get_method("unifed")


def test_every_reading_has_a_run_of_each_method() -> None:
    """Under a reading that a method does not have it is run as printed; without a trace, as is."""
    found = {name: [method.under(f) for f in READINGS] for name, method in METHODS.items()}
    assert READINGS == (*TRACES, "at-once") == ("printed", "updated", "at-once")
    assert found == {
        "adaboost": ["", "", ""],
        "unified": ["printed", "updated", "printed"],
        "unified-incorrect": ["printed", "updated", "at-once"],
    }
    for method in METHODS.values():
        assert {method.under(f) for f in READINGS} == set(method.readings)


def test_incorrect_demonstrations_are_for_algorithm_2_alone() -> None:
    """One method uses them; its baseline is the same method without, whose is AdaBoost-IRL."""
    assert [name for name, method in METHODS.items() if method.uses_incorrect] == [
        "unified-incorrect"
    ]
    baselines = {name: method.baseline for name, method in METHODS.items()}
    assert baselines == {"adaboost": "", "unified": "adaboost", "unified-incorrect": "unified"}
    with_, without = METHODS["unified-incorrect"], METHODS["unified"]
    assert (with_.start, with_.update) == (without.start, without.update)


def test_a_new_method_is_one_row(
    small_demos: Demos, store_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A perceptron, which moves each weight by its residual, is in every table and picture."""
    another = replace(
        METHODS["adaboost"],
        name="another",
        label="Another",
        colour="#009E73",
        baseline="adaboost",
        start=lambda shape, params: np.ones(shape),
        update=lambda w, f, mu_e, mu_i, mu_b, params: (w + f * (mu_e - mu_i), f),
    )
    monkeypatch.setitem(METHODS, another.name, another)
    assert fit(small_demos, method="another", seed=1).errors[-1] == 0

    conditions = conditions_of(small_demos, {"episodes": 60, "horizon": 40}, METHODS)
    every = list(conditions.values())
    results = run_trials(every, trials=3, store=Store(store_path), seed=1)
    trials = measure_trials(results, every, errors=True)
    assert (trials["method"] == "another").sum() == 3
    summary = summary_table(trials, {}).set_index("method")
    assert summary.loc["another", "n"] == 3
    (compared,) = contrasts_table(trials).query("x == 'another'").itertuples()
    assert (compared.reading, compared.set) == ("", "none")
    assert (compared.y, compared.n) == ("adaboost", 3)
    for picture in (
        errors.falling(trials, {}),
        iterations.per_trial(trials, {}),
    ):
        assert "Another: " in picture.words
        texts = shown_texts(picture.draw(picture.numbers))
        assert "Another" in [text.get_text() for text in texts]
