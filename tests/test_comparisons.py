"""The paper's comparisons at its own 100 trials, recomputed and held against what is published."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import pytest

from replication import Demos, load_demos
from replication.choices import ChoiceError
from replication.comparisons import (
    F_INDICES,
    SETS,
    TABLE_1_CLAIMS,
    TABLE_2_CLAIMS,
    Claim,
    Key,
    method_settings,
    set_settings,
)
from replication.paper import TABLE_1, TABLE_2, Published
from replication.paths import PROJECT
from replication.setting import Setting
from replication.store import Store
from replication.tables import claims_table, rows_of, sets_table, summary_table
from replication.trials import run_trials

FIGURES = PROJECT / "figures"
TRIALS = 100
ROOT = 1


@dataclass(frozen=True)
class Experiment:
    """One maze: its settings, recomputed trials, and the files that hold its results."""

    settings: dict[Key, Setting]
    sets: dict[Key, Setting]
    trials: pd.DataFrame
    table: str
    claims: tuple[Claim, ...]
    published: dict[str, Published]


@pytest.fixture(scope="module", params=["open_maze", "obstacle_maze"])
def experiment(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Experiment:
    """Run 100 trials of every method of Tables I and II, from nothing."""
    demos = load_demos(PROJECT / "data" / "demos" / f"{request.param}.json")
    settings = method_settings(demos, {})
    store = Store(tmp_path_factory.mktemp("store") / "trials.sqlite")
    results = run_trials(
        list(settings.values()), trials=TRIALS, store=store, jobs=os.cpu_count() or 1, seed=ROOT
    )
    number, claims, published = {
        "open_maze": ("1", TABLE_1_CLAIMS, TABLE_1),
        "obstacle_maze": ("2", TABLE_2_CLAIMS, TABLE_2),
    }[request.param]
    sets = set_settings(demos, {})
    return Experiment(settings, sets, results.frame(), f"table{number}", claims, published)


def _stored(name: str) -> pd.DataFrame:
    return pd.read_csv(FIGURES / name, keep_default_na=False, na_values=[""], dtype={"F": str})


def test_every_trial_reaches_zero(experiment: Experiment) -> None:
    """Figs. 5 and 9: the error of every one of the 100 trials falls to zero, in every method."""
    assert experiment.trials["converged"].all()


def test_published_trials_are_what_the_code_computes(experiment: Experiment) -> None:
    """Row by row, figures/trials.csv holds the iterations that the code gives now.

    AdaBoost-IRL takes exponentials, whose last bit depends on the processor, so that its
    trials may differ from machine to machine; its verdicts are compared below all the same.
    """
    stored = pd.read_csv(FIGURES / "trials.csv", keep_default_na=False)
    for (method, _), setting in experiment.settings.items():
        if method != "adaboost":
            ours = rows_of(experiment.trials, setting)["iterations"].tolist()
            assert rows_of(stored, setting)["iterations"].tolist()[:TRIALS] == ours


def test_verdicts_are_those_published(experiment: Experiment) -> None:
    """Tables I and II, Figs. 6 and 9: each recomputed verdict equals the stored one."""
    ours = claims_table(
        experiment.trials, experiment.settings, experiment.claims, experiment.published
    )
    stored = _stored(f"{experiment.table}_claims.csv")
    assert ours["claim"].tolist() == stored["claim"].tolist()
    assert ours["verdict"].tolist() == stored["verdict"].tolist()
    assert "not testable" not in set(ours["verdict"])


def test_published_comparisons_have_power(experiment: Experiment) -> None:
    """With 100 trials an effect as large as the paper's would be found in nine cases of ten."""
    stored = _stored(f"{experiment.table}_claims.csv")
    compared = stored[(stored["judged"] == "fewer") & stored["paper_difference"].notna()]
    assert not compared.empty
    assert (compared["power"] > 0.9).all()


def test_published_tables_follow_from_published_trials(experiment: Experiment) -> None:
    """Means, SDs and sets in the tables are those of the rows in trials.csv."""
    stored = pd.read_csv(FIGURES / "trials.csv", keep_default_na=False)
    main = stored[stored["trial"] < TRIALS]
    table = summary_table(main, experiment.settings, experiment.published)
    published = _stored(f"{experiment.table}.csv")
    for column in ("mean", "sd", "median", "low", "high"):
        assert published[column].tolist() == pytest.approx(table[column].tolist())
    task = experiment.trials["task"].iloc[0].replace("-", "_")
    n = _sets_trials(stored, experiment)
    sets = sets_table(stored[stored["trial"] < n], experiment.sets)
    published = _stored(f"{task}_sets.csv")
    assert published["set"].tolist() == sets["set"].tolist()
    assert published["mean"].tolist() == pytest.approx(sets["mean"].tolist())
    assert published["leaving"].tolist() == sets["leaving"].tolist()


def _sets_trials(stored: pd.DataFrame, experiment: Experiment) -> int:
    """Return how many trials stand behind each alternative set."""
    return len(rows_of(stored, experiment.sets["opposite", "printed"]))


def test_both_readings_stand_side_by_side(small_demos: Demos) -> None:
    """Every method with a trace is there under F_i and F_(i+1), AdaBoost-IRL once."""
    keys = set(method_settings(small_demos, {}))
    assert keys == {("adaboost", "")} | {
        (method, f) for method in ("unified", "unified-incorrect") for f in F_INDICES
    }


def test_choices_reach_every_setting(small_demos: Demos) -> None:
    """A notebook's choices apply to all methods; the reading of Eq. 9 is not one of them."""
    settings = method_settings(small_demos, {"alpha": 0.1})
    assert {setting.params.update.alpha for setting in settings.values()} == {0.1}
    with pytest.raises(ChoiceError, match="f_index"):
        method_settings(small_demos, {"f_index": "updated"})


def test_sets_without_their_kinds_are_left_out(small_demos: Demos) -> None:
    """A user's file with fewer kinds gets the sets that it can form, the empty one always."""
    found = {kinds for kinds, _ in set_settings(small_demos.select("hit"), {})}
    assert found == {"none", "hit"}
    assert {kinds for kinds, _ in set_settings(small_demos, {})} == set(SETS)


def test_default_set_shares_its_trials_with_the_table(small_demos: Demos) -> None:
    """The default set and the empty set are the table's own settings, not computed twice."""
    settings, sets = method_settings(small_demos, {}), set_settings(small_demos, {})
    for f in F_INDICES:
        assert sets["hit+detour", f] == settings["unified-incorrect", f]
        assert sets["none", f] == settings["unified", f]


def test_figures_are_complete() -> None:
    """Every output that the notebooks declare lies in figures/, and nothing else of theirs."""
    import nbformat

    declared = set()
    for path in sorted(Path(PROJECT / "notebooks").glob("*.ipynb")):
        metadata = nbformat.read(path, as_version=4).metadata["replication"]
        declared |= {*metadata["outputs"], *metadata.get("merged", [])}
    assert declared == {path.name for path in FIGURES.iterdir()}
