"""The paper's comparisons, recomputed and held against what is published in figures/."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd
import pytest

from replication import Demos, load_demos
from replication.choices import ChoiceError
from replication.comparisons import (
    F_INDICES,
    SETS,
    SOCCER_CLAIMS,
    TABLE_1_CLAIMS,
    TABLE_2_CLAIMS,
    Claim,
    Key,
    method_settings,
    rule_settings,
    set_settings,
    soccer_readings,
)
from replication.paper import SOCCER, SOCCER_CURVES, TABLE_1, TABLE_2, Published
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
    """Row by row, figures/trials.csv holds the iterations that the code gives now."""
    stored = pd.read_csv(FIGURES / "trials.csv", keep_default_na=False)
    for setting in experiment.settings.values():
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
    """With 100 trials an effect as large as the paper's would be found in four cases of five."""
    ours = claims_table(
        experiment.trials, experiment.settings, experiment.claims, experiment.published
    )
    compared = ours[(ours["judged"] == "fewer") & ours["paper_effect"].notna()]
    assert not compared.empty
    assert (compared["power"] > 0.8).all()


def _assert_same(stored: pd.DataFrame, computed: pd.DataFrame) -> None:
    """Compare all columns; the file has ten significant digits and writes nothing for NaN."""
    assert stored.columns.tolist() == computed.columns.tolist()
    for name in computed:
        if computed[name].dtype.kind in "fiu":
            expected = computed[name].astype(float).tolist()
            found = pd.to_numeric(stored[name]).astype(float).tolist()
            assert found == pytest.approx(expected, nan_ok=True, rel=1e-8), name
        else:
            assert stored[name].fillna("").tolist() == computed[name].tolist(), name


def test_published_tables_follow_from_published_trials(experiment: Experiment) -> None:
    """Every column of the tables, p-values and verdicts included, follows from trials.csv."""
    trials = pd.read_csv(FIGURES / "trials.csv", keep_default_na=False)
    main = trials[trials["trial"] < TRIALS]
    name, published = experiment.table, experiment.published
    _assert_same(_stored(f"{name}.csv"), summary_table(main, experiment.settings, published))
    claims = claims_table(main, experiment.settings, experiment.claims, published)
    _assert_same(_stored(f"{name}_claims.csv"), claims)
    task = experiment.trials["task"].iloc[0].replace("-", "_")
    few = trials[trials["trial"] < len(rows_of(trials, experiment.sets["opposite", "printed"]))]
    _assert_same(_stored(f"{task}_sets.csv"), sets_table(few, experiment.sets))


@pytest.fixture(scope="module")
def soccer() -> dict[Key, Setting]:
    """Return the settings of Fig. 12."""
    demos = load_demos(PROJECT / "data" / "demos" / "soccer.json")
    return method_settings(demos, {**SOCCER, "incorrect": "all"}, ["unified", "unified-incorrect"])


def test_published_soccer_trials_are_what_the_code_computes(
    soccer: dict[Key, Setting], tmp_path: Path
) -> None:
    """Robot soccer, 30 trials of each setting: every error reaches zero, in the stored number."""
    stored = pd.read_csv(FIGURES / "trials.csv", keep_default_na=False)
    jobs = os.cpu_count() or 1
    results = run_trials(
        list(soccer.values()), trials=30, store=Store(tmp_path / "s"), jobs=jobs, seed=ROOT
    )
    assert results.frame()["converged"].all()
    for setting in soccer.values():
        ours = results.iterations(setting).tolist()
        assert rows_of(stored, setting)["iterations"].tolist()[:30] == ours


def test_verdict_on_fig_12_follows_from_published_trials(soccer: dict[Key, Setting]) -> None:
    """The soccer tables follow from trials.csv, and the effect of the paper would be found."""
    trials = pd.read_csv(FIGURES / "trials.csv", keep_default_na=False)
    claims = claims_table(trials, soccer, SOCCER_CLAIMS, SOCCER_CURVES)
    _assert_same(_stored("soccer_claims.csv"), claims)
    _assert_same(_stored("soccer.csv"), summary_table(trials, soccer, SOCCER_CURVES))
    assert (claims["power"] > 0.8).all()
    assert "not testable" not in set(claims["verdict"])


def test_soccer_readings_change_one_choice_each(soccer: dict[Key, Setting]) -> None:
    """Each reading differs from the default in what its name says, and in nothing else."""
    setting = soccer["unified-incorrect", "printed"]
    readings = soccer_readings(setting.demos, {**SOCCER, "incorrect": "all"})
    base = readings.pop("default")[1]
    assert base == setting
    for name, (without, with_them) in readings.items():
        assert without.params == with_them.params
        id, _, value = name.partition("=")
        changed = {
            key: new
            for key, new in with_them.params.values().items()
            if new != base.params.values()[key]
        }
        if id.startswith("SOCCER"):
            assert changed == {}
            assert with_them.demos != base.demos
        else:
            (new,) = changed.values()
            assert str(new) == value
            assert with_them.demos == base.demos


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
    own = replace(small_demos, incorrect=(replace(small_demos.incorrect[0], kind="late"),))
    assert {kinds for kinds, _ in set_settings(own, {})} == {"none", "all"}
    assert {kinds for kinds, _ in set_settings(small_demos.select("none"), {})} == {"none"}


def test_default_set_shares_its_trials_with_the_table(small_demos: Demos) -> None:
    """The default set and the empty set are the table's own settings, not computed twice."""
    settings, sets = method_settings(small_demos, {}), set_settings(small_demos, {})
    for f in F_INDICES:
        assert sets["hit+detour", f] == settings["unified-incorrect", f]
        assert sets["none", f] == settings["unified", f]


def test_every_reading_of_adaboost_is_a_setting(small_demos: Demos) -> None:
    """The registered readings are all there, the default among them, and differ only in that."""
    rules = rule_settings(small_demos, {"alpha": 0.1})
    assert rules["mismatch"] == method_settings(small_demos, {"alpha": 0.1})["adaboost", ""]
    assert {name: setting.params.update.adaboost_rule for name, setting in rules.items()} == {
        name: name for name in rules
    }
    assert len(rules) == 5


def test_figures_are_complete() -> None:
    """Every output that the notebooks declare lies in figures/, and nothing else of theirs."""
    import nbformat

    declared = set()
    for path in sorted(Path(PROJECT / "notebooks").glob("*.ipynb")):
        metadata = nbformat.read(path, as_version=4).metadata["replication"]
        declared |= {*metadata["outputs"], *metadata.get("merged", [])}
    assert declared == {path.name for path in FIGURES.iterdir()}
