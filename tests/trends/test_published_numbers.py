"""The paper's comparisons, recomputed and held against what is published in figures/."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from replication import Demos
from replication.evidence.claims import criteria_hash, load_claims
from replication.evidence.experiments import (
    EXPERIMENTS,
    SETS,
    Key,
    method_conditions,
    rule_conditions,
    set_conditions,
)
from replication.evidence.sensitivity import effects_table
from replication.evidence.specifications import (
    load_specifications,
    maze_conditions,
    single_specifications,
)
from replication.evidence.tables import (
    contrasts_table,
    markdown,
    read_table,
    readable_verdicts,
    rows_of,
    sets_table,
    summary_table,
)
from replication.evidence.verdicts import judge_claims
from replication.files import PROJECT
from replication.irl import READINGS
from replication.paper.published import SOCCER_CURVES, TABLE_1, TABLE_2
from replication.paper.register import ChoiceError
from replication.pipeline import provenance
from replication.pipeline.notebook import read_notebook
from replication.pipeline.plan import prepare
from replication.trials.condition import Condition
from replication.trials.measures import measure_trials
from replication.trials.results import Results
from replication.trials.run import run_trials
from replication.trials.store import Store

FIGURES = PROJECT / "figures"
ROOT = load_claims().judging.root_seed
JOBS = os.cpu_count() or 1
TRIALS = {"open-maze": 100, "obstacle-maze": 100, "soccer": 12}
"""Recomputed here; soccer, which takes longest, has 60 published ones."""

TABLES = {"open-maze": "table1", "obstacle-maze": "table2", "soccer": "soccer"}
PUBLISHED = {"open-maze": TABLE_1, "obstacle-maze": TABLE_2, "soccer": SOCCER_CURVES}

Recomputed = tuple[str, dict[Key, Condition], Results]


@pytest.fixture(scope="module", params=list(EXPERIMENTS))
def recomputed(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Recomputed:
    """Run the trials of one experiment from nothing."""
    conditions = EXPERIMENTS[request.param].conditions()
    store = Store(tmp_path_factory.mktemp("store") / "trials.sqlite")
    trials = TRIALS[request.param]
    results = run_trials(
        list(conditions.values()), trials=trials, store=store, jobs=JOBS, seed=ROOT
    )
    return request.param, conditions, results


def assert_same(stored: pd.DataFrame, computed: pd.DataFrame) -> None:
    """Compare all columns; the file has ten significant digits and writes nothing for NaN."""
    assert stored.columns.tolist() == computed.columns.tolist()
    for name in computed:
        if computed[name].dtype.kind in "fiu":
            expected = computed[name].astype(float).tolist()
            found = pd.to_numeric(stored[name]).astype(float).tolist()
            assert found == pytest.approx(expected, nan_ok=True, rel=1e-8, abs=1e-12), name
        else:
            assert stored[name].fillna("").tolist() == computed[name].tolist(), name


def test_published_trials_are_what_the_code_computes(recomputed: Recomputed) -> None:
    """Row by row, figures/trials.csv holds the iterations that the code gives now."""
    task, conditions, results = recomputed
    stored = read_table(FIGURES / "trials.csv")
    for condition in conditions.values():
        ours = results.iterations(condition).tolist()
        assert rows_of(stored, condition)["iterations"].tolist()[: TRIALS[task]] == ours


def test_published_measures_are_what_the_code_computes(recomputed: Recomputed) -> None:
    """Row by row, figures/claims_trials.csv holds the measures that the code gives now."""
    task, conditions, results = recomputed
    stored = read_table(FIGURES / "claims_trials.csv")
    own = stored[(stored["task"] == task) & (stored["trial"] < TRIALS[task])]
    assert_same(own, measure_trials(results, conditions))


def test_published_tables_follow_from_published_trials(recomputed: Recomputed) -> None:
    """Every column of the tables follows from trials.csv."""
    task, conditions, _ = recomputed
    trials = read_table(FIGURES / "trials.csv")
    main = trials[trials["trial"] < load_claims().judging.trials[task]]  # type: ignore[index]
    name = TABLES[task]
    assert_same(
        read_table(FIGURES / f"{name}.csv"), summary_table(main, conditions, PUBLISHED[task])
    )
    assert_same(read_table(FIGURES / f"{name}_contrasts.csv"), contrasts_table(main, conditions))
    if task != "soccer":
        sets = set_conditions(next(iter(conditions.values())).demos, {})
        few = trials[trials["trial"] < len(rows_of(trials, sets["opposite", "printed"]))]
        stored = read_table(FIGURES / f"{task.replace('-', '_')}_sets.csv")
        assert_same(stored, sets_table(few, sets))


def test_verdicts_follow_from_published_measures() -> None:
    """Every verdict, and every number beside it, follows from claims_trials.csv."""
    judged = judge_claims(read_table(FIGURES / "claims_trials.csv"), load_claims())
    assert_same(read_table(FIGURES / "claims.csv"), judged)
    text = (FIGURES / "claims.md").read_text(encoding="utf-8")
    assert text == markdown(readable_verdicts(judged))


def test_verdicts_are_by_the_frozen_criteria() -> None:
    """The hash of the frozen file stands beside every verdict."""
    assert set(read_table(FIGURES / "claims.csv")["criteria"]) == {criteria_hash()}


def test_claims_tables_and_figures_agree() -> None:
    """An effect is the same number in the claims, in the tables of its task and in the figure."""
    judged = read_table(FIGURES / "claims.csv")
    drawn = read_table(FIGURES / "claims_figure.csv")
    assert_same(drawn, judged[judged["direction"] != "inside"])
    columns = {"mean-difference": "difference", "sd-ratio": "sd_ratio"}
    compared = 0
    for row in judged.itertuples():
        if row.measure == "iterations" and row.statistic in columns:
            table = read_table(FIGURES / f"{TABLES[row.task]}_contrasts.csv")
            own = table[(table["x"] == row.x) & (table["y"] == row.y) & (table["F"] == row.F)]
            assert own[columns[row.statistic]].item() == pytest.approx(row.effect, rel=1e-8)
            compared += 1
    assert compared == 10


def test_published_comparisons_have_power() -> None:
    """An effect as large as the paper's would be found in four cases of five."""
    judged = read_table(FIGURES / "claims.csv")
    compared = judged[(judged["statistic"] == "mean-difference") & judged["paper"].notna()]
    assert len(compared) == 8
    assert (compared["power"] > 0.8).all()


def test_every_published_trial_reaches_zero() -> None:
    """Figs. 5, 9 and 12: the error of every trial of the defaults falls to zero."""
    assert (read_table(FIGURES / "claims_trials.csv")["converged"] == 1).all()


def test_notebooks_judge_by_the_declared_seed() -> None:
    """The paper profile of every notebook but the calibration runs from the judging root seed."""
    from replication.pipeline.notebook import read_notebook

    for path in sorted((PROJECT / "notebooks").glob("*.ipynb")):
        seed = read_notebook(path).literals["seed"]
        assert (seed == ROOT) == (path.stem != "calibration"), path.stem


@pytest.mark.parametrize("name", ["default", "MAP=random-1"])
def test_published_sensitivity_is_what_the_code_computes(name: str, tmp_path: Path) -> None:
    """A specification computed from nothing gives the stored effects and intervals."""
    plan = load_specifications()
    one = next(s for s in single_specifications(plan.mazes.single.choices) if s.name == name)
    conditions = {one: maze_conditions(one, plan.iteration_cap)}
    results = run_trials(
        list(conditions[one].values()),
        trials=plan.mazes.single.trials,
        store=Store(tmp_path / "s"),
        jobs=JOBS,
        seed=plan.root_seed,
    )
    ours = effects_table(results, conditions, [load_claims().by_id(id) for id in plan.mazes.claims])
    stored = read_table(FIGURES / "sensitivity_single.csv")
    assert_same(stored[stored["specification"] == name], ours)


def test_both_readings_stand_side_by_side(small_demos: Demos) -> None:
    """Every method with a trace is there under F_i and F_(i+1), AdaBoost-IRL once."""
    keys = set(method_conditions(small_demos, {}))
    assert keys == {("adaboost", "")} | {
        (method, f) for method in ("unified", "unified-incorrect") for f in READINGS
    }


def test_choices_reach_every_setting(small_demos: Demos) -> None:
    """A notebook's choices apply to all methods; the reading of Eq. 9 is not one of them."""
    conditions = method_conditions(small_demos, {"alpha": 0.1})
    assert {condition.params.update.alpha for condition in conditions.values()} == {0.1}
    with pytest.raises(ChoiceError, match="f_index"):
        method_conditions(small_demos, {"f_index": "updated"})


def test_sets_without_their_kinds_are_left_out(small_demos: Demos) -> None:
    """A user's file with fewer kinds gets the sets that it can form, the empty one always."""
    found = {kinds for kinds, _ in set_conditions(small_demos.select("hit"), {})}
    assert found == {"none", "hit"}
    assert {kinds for kinds, _ in set_conditions(small_demos, {})} == set(SETS)
    own = replace(small_demos, incorrect=(replace(small_demos.incorrect[0], kind="late"),))
    assert {kinds for kinds, _ in set_conditions(own, {})} == {"none", "all"}
    assert {kinds for kinds, _ in set_conditions(small_demos.select("none"), {})} == {"none"}


def test_default_set_shares_its_trials_with_the_table(small_demos: Demos) -> None:
    """The default set and the empty set are the table's own conditions, not computed twice."""
    conditions, sets = method_conditions(small_demos, {}), set_conditions(small_demos, {})
    for f in READINGS:
        assert sets["hit+detour", f] == conditions["unified-incorrect", f]
        assert sets["none", f] == conditions["unified", f]


def test_every_reading_of_adaboost_is_a_setting(small_demos: Demos) -> None:
    """The registered readings are all there, the default among them, and differ only in that."""
    rules = rule_conditions(small_demos, {"alpha": 0.1})
    assert rules["mismatch"] == method_conditions(small_demos, {"alpha": 0.1})["adaboost", ""]
    assert {name: condition.params.update.adaboost_rule for name, condition in rules.items()} == {
        name: name for name in rules
    }
    assert len(rules) == 5


def test_figures_are_complete() -> None:
    """Whatever a run publishes lies in figures/, and nothing else does but the manifest."""
    published = {"provenance.json"}
    for path in (PROJECT / "notebooks").glob("*.ipynb"):
        published.update(read_notebook(path).published)
    assert published == {path.name for path in FIGURES.iterdir()} - {".lock"}


def test_figures_are_up_to_date() -> None:
    """The published outputs are whole, and came from what stands in the project now."""
    manifest = provenance.read_manifest(FIGURES)
    runs = prepare(sorted((PROJECT / "notebooks").glob("*.ipynb")), profile="paper")
    assert set(manifest) == {run.notebook.name for run in runs}
    for run in runs:
        entry = manifest[run.notebook.name]
        assert provenance.changes(entry["inputs"], run.inputs) == [], run.notebook.name
        assert provenance.damaged(FIGURES, entry) == {}
