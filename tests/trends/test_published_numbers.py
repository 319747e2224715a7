"""What is published in figures/: bits that the code computes again, tables, trends, verdicts."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from replication.evidence import statistics
from replication.evidence.claims import criteria_hash, load_claims
from replication.evidence.experiments import (
    EXPERIMENTS,
    GENERAL,
    NAMED,
    NONE,
    SETS,
    condition_of,
    conditions_of,
    main_trials,
)
from replication.evidence.sensitivity import JOINT, effects_table
from replication.evidence.specifications import load_specifications, single_specifications
from replication.evidence.tables import (
    contrasts_table,
    kinds_table,
    read_table,
    sets_table,
    summary_table,
)
from replication.evidence.variations import maze_conditions
from replication.evidence.verdicts import judge_claims, judged_trials, read_trials
from replication.files import PROJECT
from replication.irl import READINGS, get_method
from replication.irl.methods import TRACES
from replication.paper.published import PUBLISHED
from replication.pipeline.declaration import MANIFEST
from replication.pipeline.notebook import read_notebook
from replication.pipeline.plan import prepare
from replication.report.readable import markdown, readable_verdicts
from replication.trials.measures import ALONG, measure_trials
from replication.trials.run import run_trials
from replication.trials.store import Store
from replication.trials.table import Group, computed_table

FIGURES = PROJECT / "figures"
NOTEBOOKS = sorted((PROJECT / "notebooks").glob("*.ipynb"))
ROOT = load_claims().judging.root_seed
JOBS = os.cpu_count() or 1
MAZES = ("open-maze", "obstacle-maze")
SUMMARIES = {"open-maze": "table1", "obstacle-maze": "table2", "soccer": "summary"}
FEW = {"open-maze": 4, "obstacle-maze": 4, "soccer": 2}
"""Trials of each main condition that every run of the tests recomputes, beside one of each set."""

FACTORS = ["task", "method", "reading", "set"]


def read(task: str, name: str = "trials") -> pd.DataFrame:
    """Return a published table of a task."""
    return read_table(FIGURES / task.replace("-", "_") / f"{name}.csv")


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


@pytest.mark.parametrize("task", EXPERIMENTS)
def test_published_trials_are_what_the_code_computes(task: str, tmp_path: Path) -> None:
    """Computed from nothing, a trial of any condition has the published measures, steps and bits.

    The digest covers every bit: so a few trials of each condition speak for all. `make reproduce`
    computes all of them.
    """
    rows = read(task)
    main = rows.index.isin(main_trials(rows).index)
    rows = rows[rows["trial"] < np.where(main, FEW[task], 1)]
    store = Store(tmp_path / "trials.sqlite")
    for n, part in rows.groupby(rows.groupby(FACTORS)["trial"].transform("size")):
        keys = part[FACTORS].drop_duplicates()
        conditions = [condition_of(*key) for key in keys.itertuples(index=False)]
        results = run_trials(conditions, trials=n, store=store, jobs=JOBS, seed=ROOT)
        path = ALONG[0] in rows
        assert_same(part, measure_trials(results, conditions, errors=True, path=path))


@pytest.mark.parametrize("task", EXPERIMENTS)
def test_published_tables_follow_from_published_trials(task: str) -> None:
    """Every column of the tables follows from trials.csv."""
    trials = read(task)
    main = main_trials(trials)
    assert_same(read(task, SUMMARIES[task]), summary_table(main, PUBLISHED[task]))
    assert_same(read(task, "contrasts"), contrasts_table(main))
    assert_same(read(task, "kinds"), kinds_table(main))
    if task in MAZES:
        own = EXPERIMENTS[task].conditions()
        demos = next(iter(own.values())).demos
        conditions = own | conditions_of(demos, {}, sets=SETS)
        saved = read(task, "sets").drop(columns="paper")  # which the figure of the name adds
        assert_same(saved, sets_table(trials, conditions))


# --- trends ----------------------------------------------------------------------------------
# Bounds leave several standard errors between them and what was found.


def iterations(task: str, method: str, reading: str, set: str = NONE) -> pd.Series:
    """Return the iterations of a main condition by trial, under a reading of Eq. 9."""
    own = get_method(method).under(reading)
    rows = read(task)
    rows = rows[(rows["method"] == method) & (rows["reading"] == own) & (rows["set"] == set)]
    return rows.set_index("trial")["iterations"]


def margin(differences: pd.Series) -> float:
    """Return three standard errors of the mean."""
    return float(3 * differences.std() / np.sqrt(len(differences)))


@pytest.mark.parametrize("task", EXPERIMENTS)
def test_every_error_falls_to_zero(task: str) -> None:
    """Figs. 5, 9 and 12: every trial of every method ends on the expert's path, with every set."""
    assert (read(task)["converged"] == 1).all()


@pytest.mark.parametrize("reading", TRACES)
@pytest.mark.parametrize("task", MAZES)
def test_the_baseline_is_slower_and_varies_more(task: str, reading: str) -> None:
    """AdaBoost-IRL takes more iterations, by less than 60 %, and their SD is larger."""
    baseline, unified = (iterations(task, name, reading) for name in ("adaboost", "unified"))
    slower = baseline - unified
    assert margin(slower) < slower.mean() < 0.6 * unified.mean()
    assert baseline.std() > 1.05 * unified.std()


def saved(task: str, reading: str, set: str) -> pd.Series:
    """Return what a set of incorrect demonstrations saves, as a share of what the paper's save."""
    paper = PUBLISHED[task]
    published = paper["unified"].mean - paper["unified-incorrect"].mean
    without, given = iterations(task, "unified", reading), "unified-incorrect"
    return (without - iterations(task, given, reading, set)).dropna() / published


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("task", MAZES)
def test_hits_and_detours_save_next_to_nothing(task: str, reading: str) -> None:
    """In a maze, less than a quarter of what the paper saves."""
    shares = saved(task, reading, NAMED)
    assert abs(shares.mean()) + margin(shares) < 0.25


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("task", MAZES)
def test_the_opposite_direction_saves(task: str, reading: str) -> None:
    """With moves in the opposite direction, more than a quarter of what the paper saves."""
    shares = saved(task, reading, GENERAL)
    assert shares.mean() - margin(shares) > 0.25


@pytest.mark.parametrize("reading", READINGS)
def test_soccer_saves_less_than_published(reading: str) -> None:
    """In soccer less than the paper saves, with all four kinds."""
    shares = saved("soccer", reading, "all")
    assert shares.mean() + margin(shares) < 1


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


def test_no_verdict_hangs_on_the_seed_of_the_permutations(
    verdicts: pd.DataFrame, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With other random flips and swaps, every verdict is the same."""
    monkeypatch.setattr(statistics, "FLIP_SEED", statistics.FLIP_SEED + 1)
    claims = load_claims()
    again = judge_claims(judged_trials(read_trials(FIGURES), claims.judging), claims)
    assert again["verdict"].tolist() == verdicts["verdict"].tolist()
    assert not np.array_equal(again["p"], verdicts["p"], equal_nan=True)


def test_claims_and_tables_agree(verdicts: pd.DataFrame) -> None:
    """An effect is the same number among the claims and in the contrasts of its task."""
    columns = {"saved": "saved", "sd-ratio": "sd_ratio"}
    compared = 0
    for row in verdicts.itertuples():
        if row.measure == "iterations" and row.statistic in columns:
            table = read(row.task, "contrasts")
            for name in ("x", "y", "reading", "set"):
                table = table[table[name] == getattr(row, name)]
            if len(table):
                effect = table[columns[row.statistic]].item()
                assert effect == pytest.approx(row.effect, rel=1e-8)
                compared += 1
    assert compared == 2 + 2 + 6 + 6 + 3


def test_intervals_are_as_narrow_as_they_were_to_be(verdicts: pd.DataFrame) -> None:
    """In the mazes the half-widths of what is saved are what claims.toml expects of 1000 trials."""
    rows = verdicts[(verdicts["statistic"] == "saved") & (verdicts["measure"] == "iterations")]
    half = (rows["high"] - rows["low"]) / 2
    mazes = rows["task"].isin(MAZES)
    assert half[mazes & (rows["set"] == NAMED) & (rows["y"] == "unified")].max() < 0.25
    assert half[mazes].max() < 0.8


def test_notebooks_judge_by_the_declared_seed() -> None:
    """Every notebook of an experiment runs from the judging root seed; no other one does."""
    seeds = {path.stem: read_notebook(path).literals.get("seed") for path in NOTEBOOKS}
    experiments = {task.replace("-", "_") for task in EXPERIMENTS}
    assert {name for name, seed in seeds.items() if seed == ROOT} == experiments


@pytest.mark.long
@pytest.mark.parametrize("name", ["default", "MAP=random-1"])
def test_published_sensitivity_is_what_the_code_computes(name: str, tmp_path: Path) -> None:
    """A specification computed from nothing gives the stored effects, intervals and outcomes.

    The joint test, which needs all specifications, is what `verify` computes again.
    """
    plan = load_specifications()
    specifications = single_specifications(plan.mazes.single.choices)
    specification = next(each for each in specifications if each.name == name)
    conditions = list(maze_conditions(specification, plan.iteration_cap).values())
    group = Group(conditions, plan.mazes.single.trials, {"number": 0})
    trials = computed_table([group], store=Store(tmp_path / "s"), jobs=JOBS, seed=plan.root_seed)
    claims = [load_claims().by_id(id) for id in plan.mazes.claims]
    stored = read_table(FIGURES / "sensitivity" / "effects.csv")
    rows = stored[
        (stored["specification"] == name)
        & (stored["group"] == "single")
        & stored["claim"].isin(plan.mazes.claims)
    ]
    computed = effects_table(trials, [specification], claims)
    assert_same(rows.drop(columns=list(JOINT)), computed.drop(columns=list(JOINT)))


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
