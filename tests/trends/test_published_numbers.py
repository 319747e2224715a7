"""The paper's comparisons, recomputed and held against what is published in figures/."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import pytest

from replication.evidence.claims import criteria_hash, load_claims
from replication.evidence.experiments import EXPERIMENTS, Key, main_trials, set_conditions
from replication.evidence.sensitivity import effects_table
from replication.evidence.specifications import load_specifications, single_specifications
from replication.evidence.tables import contrasts_table, read_table, sets_table, summary_table
from replication.evidence.variations import maze_conditions
from replication.evidence.verdicts import judge_claims, judged_trials, read_trials
from replication.files import PROJECT
from replication.paper.published import PUBLISHED
from replication.pipeline.declaration import MANIFEST
from replication.pipeline.notebook import read_notebook
from replication.pipeline.plan import prepare
from replication.report.readable import markdown, readable_verdicts
from replication.trials.condition import Condition
from replication.trials.measures import measure_trials
from replication.trials.run import run_trials
from replication.trials.store import Store

FIGURES = PROJECT / "figures"
NOTEBOOKS = sorted((PROJECT / "notebooks").glob("*.ipynb"))
ROOT = load_claims().judging.root_seed
JOBS = os.cpu_count() or 1
TRIALS = {"open-maze": 100, "obstacle-maze": 100, "soccer": 12}
"""Recomputed here; soccer, which takes longest, has 60 published ones."""

SUMMARIES = {"open-maze": "table1", "obstacle-maze": "table2", "soccer": "summary"}


@dataclass(frozen=True)
class Recomputed:
    """The trials of one experiment, computed from nothing, and the published table of its task."""

    task: str
    conditions: dict[Key, Condition]
    trials: pd.DataFrame
    published: pd.DataFrame

    def read(self, name: str) -> pd.DataFrame:
        """Return a published table of the task."""
        return read_table(FIGURES / self.task.replace("-", "_") / f"{name}.csv")


@pytest.fixture(scope="module", params=list(EXPERIMENTS))
def recomputed(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Recomputed:
    """Run the trials of one experiment from nothing."""
    task = request.param
    conditions = EXPERIMENTS[task].conditions()
    store = Store(tmp_path_factory.mktemp("store") / "trials.sqlite")
    every = list(conditions.values())
    results = run_trials(every, trials=TRIALS[task], store=store, jobs=JOBS, seed=ROOT)
    stored = read_table(FIGURES / task.replace("-", "_") / "trials.csv")
    return Recomputed(task, conditions, measure_trials(results, every), stored)


def assert_same(stored: pd.DataFrame, computed: pd.DataFrame) -> None:
    """Compare all columns; the file has ten significant digits and writes nothing for NaN."""
    assert stored.columns.tolist() == computed.columns.tolist()
    for name in computed:
        if computed[name].dtype.kind in "fiu":
            expected = computed[name].astype(float).tolist()
            numbers = pd.to_numeric(stored[name]).astype(float).tolist()
            assert numbers == pytest.approx(expected, nan_ok=True, rel=1e-8, abs=1e-12), name
        else:
            assert stored[name].fillna("").tolist() == computed[name].tolist(), name


# --- trials and tables -----------------------------------------------------------------------


def test_published_trials_are_what_the_code_computes(recomputed: Recomputed) -> None:
    """Row by row, trials.csv holds the iterations, measures and steps that the code gives now."""
    main = main_trials(recomputed.published)
    rows = main[main["trial"] < TRIALS[recomputed.task]]
    assert_same(rows.drop(columns="digest"), recomputed.trials.drop(columns="digest"))


def test_published_tables_follow_from_published_trials(recomputed: Recomputed) -> None:
    """Every column of the tables follows from trials.csv."""
    task, main = recomputed.task, main_trials(recomputed.published)
    assert_same(recomputed.read(SUMMARIES[task]), summary_table(main, PUBLISHED[task]))
    assert_same(recomputed.read("contrasts"), contrasts_table(main))
    if task != "soccer":
        sets = set_conditions(next(iter(recomputed.conditions.values())).demos, {})
        assert_same(recomputed.read("sets"), sets_table(recomputed.published, sets))


def test_the_baseline_is_slower_and_varies_more(recomputed: Recomputed) -> None:
    """In both mazes, under both readings of Eq. 9, the intervals exclude the opposite."""
    table = contrasts_table(recomputed.trials)
    against = table[table["y"] == "adaboost"]
    assert len(against) == (0 if recomputed.task == "soccer" else 2)
    assert (against["high"] < 0).all()
    assert (against["sd_high"] < 1).all()


def test_every_error_falls_to_zero(recomputed: Recomputed) -> None:
    """Figs. 5, 9 and 12: every trial of every method ends on the expert's path."""
    assert (recomputed.trials["converged"] == 1).all()
    assert (main_trials(recomputed.published)["converged"] == 1).all()


# --- verdicts --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def verdicts() -> pd.DataFrame:
    """Read the published verdicts."""
    return read_table(FIGURES / "claims" / "verdicts.csv")


def test_verdicts_follow_from_published_trials(verdicts: pd.DataFrame) -> None:
    """Every verdict, and every number beside it, follows from the three tables of trials."""
    claims = load_claims()
    judged = judge_claims(judged_trials(read_trials(FIGURES), claims.judging), claims)
    assert_same(verdicts, judged)
    text = (FIGURES / "claims" / "verdicts.md").read_text(encoding="utf-8")
    assert text == markdown(readable_verdicts(judged))


def test_verdicts_are_by_the_frozen_criteria(verdicts: pd.DataFrame) -> None:
    """The hash of the frozen file stands beside every verdict."""
    assert set(verdicts["criteria"]) == {criteria_hash()}


def test_claims_and_tables_agree(verdicts: pd.DataFrame) -> None:
    """An effect is the same number among the claims and in the contrasts of its task."""
    columns = {"mean-difference": "difference", "sd-ratio": "sd_ratio"}
    compared = 0
    for row in verdicts.itertuples():
        if row.measure == "iterations" and row.statistic in columns:
            table = read_table(FIGURES / row.task.replace("-", "_") / "contrasts.csv")
            key = (table["x"] == row.x) & (table["y"] == row.y) & (table["reading"] == row.reading)
            effect = table.loc[key, columns[row.statistic]].item()
            assert effect == pytest.approx(row.effect, rel=1e-8)
            compared += 1
    assert compared == 10


def test_published_comparisons_have_power(verdicts: pd.DataFrame) -> None:
    """An effect as large as the paper's would be found in four cases of five."""
    compared = verdicts[(verdicts["statistic"] == "mean-difference") & verdicts["paper"].notna()]
    assert len(compared) == 8
    assert (compared["power"] > 0.8).all()


def test_notebooks_judge_by_the_declared_seed() -> None:
    """Every notebook of an experiment runs from the judging root seed; the calibration does not."""
    seeds = {path.stem: read_notebook(path).literals.get("seed") for path in NOTEBOOKS}
    assert {seeds[task.replace("-", "_")] for task in EXPERIMENTS} == {ROOT}
    assert seeds["sensitivity"] == ROOT != seeds["calibration"]


@pytest.mark.parametrize("name", ["default", "MAP=random-1"])
def test_published_sensitivity_is_what_the_code_computes(name: str, tmp_path: Path) -> None:
    """A specification computed from nothing gives the stored effects and intervals."""
    plan = load_specifications()
    specifications = single_specifications(plan.mazes.single.choices)
    specification = next(each for each in specifications if each.name == name)
    conditions = {specification: maze_conditions(specification, plan.iteration_cap)}
    results = run_trials(
        list(conditions[specification].values()),
        trials=plan.mazes.single.trials,
        store=Store(tmp_path / "s"),
        jobs=JOBS,
        seed=plan.root_seed,
    )
    claims = [load_claims().by_id(id) for id in plan.mazes.claims]
    stored = read_table(FIGURES / "sensitivity" / "effects.csv")
    rows = stored[
        (stored["specification"] == name)
        & (stored["group"] == "single")
        & stored["claim"].isin(plan.mazes.claims)
    ]
    assert_same(rows, effects_table(results, conditions, claims))


# --- the folder ------------------------------------------------------------------------------


def test_figures_are_complete() -> None:
    """Each notebook's folder has what a run publishes, and nothing else is there but the index."""
    folders = {path.name for path in FIGURES.iterdir() if path.is_dir()}
    assert folders == {path.stem for path in NOTEBOOKS}
    assert {path.name for path in FIGURES.iterdir() if path.name[0] != "."} == {
        *folders,
        "README.md",
    }
    for path in NOTEBOOKS:
        files = {file.name for file in (FIGURES / path.stem).iterdir()}
        assert files == {*read_notebook(path).published, MANIFEST}


def test_figures_are_up_to_date() -> None:
    """The published outputs are whole, and came from what stands in the project now."""
    for run in prepare(NOTEBOOKS, profile="paper", out=FIGURES):
        assert run.state.kind == "fresh", (run.name, run.state.why)
