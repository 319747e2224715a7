from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, stats

from replication import Demos
from replication.envs.maze import as_maze
from replication.evidence.calibration import (
    CALIBRATED,
    PAIR,
    ROOT,
    TRIALS,
    calibration_table,
    check_table,
    chosen,
    grid,
    grid_conditions,
    kl_divergence,
    plan,
)
from replication.evidence.claims import load_claims
from replication.evidence.statistics import mean_prediction
from replication.evidence.tables import read_table
from replication.files import PROJECT
from replication.paper.published import Published
from replication.paper.register import load_choices
from replication.trials.store import Store
from replication.trials.table import computed_table

FIGURES = PROJECT / "figures"


@pytest.fixture(scope="module")
def stored() -> pd.DataFrame:
    """Read the published grid."""
    path = FIGURES / "calibration" / "grid.csv"
    if not path.exists():
        pytest.skip("figures/calibration is not published yet")
    return read_table(path)


# --- the criterion ---------------------------------------------------------------------------


@pytest.mark.parametrize(("mean", "sd"), [(40.1, 4.73), (39.1, 5.2), (45.0, 3.0), (30.0, 9.0)])
def test_kl_divergence_by_integration(mean: float, sd: float) -> None:
    """It is the integral of p log(p / q), p being the published one; infinite with no spread."""
    p, q = stats.norm(PAIR.mean, PAIR.sd), stats.norm(mean, sd)
    expected, _ = integrate.quad(
        lambda x: p.pdf(x) * (p.logpdf(x) - q.logpdf(x)),
        PAIR.mean - 12 * PAIR.sd,
        PAIR.mean + 12 * PAIR.sd,
    )
    assert kl_divergence(mean, sd, PAIR) == pytest.approx(expected, abs=1e-7)
    for out in ((mean, 0.0), (np.nan, np.nan), (mean, np.nan)):
        assert kl_divergence(*out, PAIR) == np.inf


@given(st.floats(1, 100), st.floats(0.1, 50), st.floats(1, 100), st.floats(0.1, 50))
def test_kl_divergence_is_least_at_the_published_pair(
    mean: float, sd: float, paper_mean: float, paper_sd: float
) -> None:
    """It is zero at the pair itself, nowhere below, and grows with the distance of the means."""
    paper = Published("here", paper_mean, paper_sd)
    assert kl_divergence(paper_mean, paper_sd, paper) == pytest.approx(0.0, abs=1e-12)
    assert kl_divergence(mean, sd, paper) >= -1e-12
    further = paper_mean + 2 * (mean - paper_mean)
    assert kl_divergence(further, sd, paper) >= kl_divergence(mean, sd, paper)


def test_kl_divergence_is_the_likelihood_of_the_published_sample() -> None:
    """Of two points the nearer one makes a sample with the published mean and SD likelier."""
    sample = stats.zscore(np.random.default_rng(1).normal(size=100)) * PAIR.sd + PAIR.mean
    points = [(39.1, 5.2), (41.0, 4.0), (36.0, 4.7), (40.1, 9.0)]
    likelihoods = [stats.norm(*point).logpdf(sample).mean() for point in points]
    kl_divergences = [kl_divergence(*point, PAIR) for point in points]
    for (a, one), (b, other) in itertools.combinations(
        zip(likelihoods, kl_divergences, strict=True), 2
    ):
        assert a - b == pytest.approx(other - one)


# --- the grid --------------------------------------------------------------------------------


def test_grid_has_all_registered_values() -> None:
    """The declared 120 points: every value of four choices, but for the ablation ALPHA = 0."""
    points = grid()
    assert len(points) == len(set(points)) == 120
    for at, id in enumerate(CALIBRATED):
        entry = load_choices()[id]
        values = {entry.default, *entry.alternatives} - ({0.0} if id == "ALPHA" else set())
        assert {point[at] for point in points} == values
    assert chosen() in points
    assert all(load_choices()[id].rule.startswith("Calibrated") for id in CALIBRATED)
    assert {id for id, one in load_choices().items() if one.rule.startswith("Calibrated")} == set(
        CALIBRATED
    )


def test_calibration_is_apart_from_the_judging_run() -> None:
    """Its root seed is among the explored ones, and what it used gets no verdict."""
    assert load_claims().judging.root_seed != ROOT
    assert any(ROOT in run.root_seeds for run in load_claims().explored)
    for id in ("MEAN-UNIFIED-OPEN", "SD-UNIFIED-OPEN"):
        claim = load_claims().by_id(id)
        assert "printed" in claim.used
        assert claim.published("unified").mean == PAIR.mean


def test_conditions_differ_in_the_grid_alone(small_demos: Demos) -> None:
    """Each point is the unified method with its four values, and all else at defaults."""
    conditions = grid_conditions(as_maze(small_demos.environment))
    assert list(conditions) == grid()
    for (leg, alpha, f_start, ties), condition in conditions.items():
        params = condition.params
        assert condition.method == "unified"
        assert (params.update.alpha, params.update.f_start) == (alpha, f_start)
        assert params.learner.ties == ties
        assert set(params.differences()) <= set(CALIBRATED)
        other = conditions[leg, *chosen()[1:]]
        assert condition.demos == other.demos
    assert conditions[chosen()].params.differences() == {}


def test_table_of_a_run(small_demos: Demos, tmp_path: object) -> None:
    """The table has the trials' own numbers, the nearest point first, and one default."""
    points = [chosen(), (2, 0.9, 0.5, "random"), (2, 0.1, 1.0, "first")]
    numbers = [grid().index(point) for point in points]
    every = plan(as_maze(small_demos.environment), 4)
    groups = [every[number] for number in numbers]
    store = Store(tmp_path / "trials.sqlite")  # type: ignore[operator]
    trials = computed_table(groups, store=store, seed=ROOT)
    table = calibration_table(trials)
    assert len(table) == 3
    assert table["default"].sum() == 1
    assert table["kl_divergence"].is_monotonic_increasing
    for row in table.to_dict("records"):
        point = tuple(row[id] for id in CALIBRATED)
        counts = trials.loc[trials["number"] == grid().index(point), "iterations"]
        assert (row["n"], row["capped"]) == (4, 0)
        assert row["mean"] == pytest.approx(counts.mean())
        assert row["sd"] == pytest.approx(counts.std(ddof=1))
        assert row["kl_divergence"] == kl_divergence(row["mean"], row["sd"], PAIR)
        assert row["default"] == (point == chosen())


# --- the check -------------------------------------------------------------------------------


def test_check_holds_new_trials_against_the_published_distribution() -> None:
    """The grid's trials have a row, and the new ones of the method one for each reading."""
    draw = np.random.default_rng(1).normal(size=100)
    draw = PAIR.mean + PAIR.sd * (draw - draw.mean()) / draw.std(ddof=1)
    trials = pd.DataFrame(
        {
            "method": ["unified"] * 200 + ["unified-incorrect"] * 100,
            "reading": ["printed"] * 100 + ["updated"] * 100 + ["printed"] * 100,
            "iterations": [*draw, *(draw + 3), *(draw + 9)],
        }
    )
    number = grid().index(chosen())
    others = pd.DataFrame({"number": [number + 1] * 30, "iterations": draw[30:60].astype(int)})
    own = pd.DataFrame({"number": [number] * 30, "iterations": draw[:30].astype(int)})
    check = check_table(pd.concat([others, own]), trials)
    assert check.loc[0, "mean"] == own["iterations"].mean()
    assert check["trials"].tolist() == ["grid", "new", "new"]
    assert check["reading"].tolist() == ["printed", "printed", "updated"]
    assert check["n"].tolist() == [30, 100, 100]
    assert check["mean"].tolist()[1:] == pytest.approx([PAIR.mean, PAIR.mean + 3])
    assert check["sd"].tolist()[1:] == pytest.approx([PAIR.sd] * 2)
    for name, low, high in (("mean", "low", "high"), ("sd", "sd_low", "sd_high")):
        assert ((check[low] < check[name]) & (check[name] < check[high])).all()
    expected = mean_prediction(PAIR.mean, PAIR.sd, PAIR.n, 100)
    assert check.loc[1, ["predicted_low", "predicted_high"]].tolist() == pytest.approx(expected)


# --- the published grid ----------------------------------------------------------------------


def test_published_grid_is_whole_and_sorted(stored: pd.DataFrame) -> None:
    """Each point is there once with the declared trials, the nearest first: the only default."""
    assert tuple(stored.loc[0, list(CALIBRATED)]) == chosen()
    assert stored["default"].tolist() == [True] + [False] * 119
    points = set(stored[list(CALIBRATED)].itertuples(index=False, name=None))
    assert points == set(grid())
    assert set(stored["n"]) == {TRIALS}
    assert stored["kl_divergence"].is_monotonic_increasing
    expected = [kl_divergence(*row, PAIR) for row in zip(stored["mean"], stored["sd"], strict=True)]
    assert stored["kl_divergence"].tolist() == pytest.approx(expected)


def test_published_check_is_that_of_the_judging_run(stored: pd.DataFrame) -> None:
    """The new trials are those that the claims are judged by, the others those of the grid."""
    check = read_table(FIGURES / "calibration" / "check.csv")
    judged = read_table(FIGURES / "claims" / "verdicts.csv")
    assert check["n"].tolist() == [TRIALS, *[load_claims().judging.trials["open-maze"]] * 2]
    assert check.loc[0, ["mean", "sd"]].tolist() == stored.loc[0, ["mean", "sd"]].tolist()
    names = ["effect", "low", "high", "predicted_low", "predicted_high"]
    for id, own in (
        ("MEAN-UNIFIED-OPEN", ["mean", "low", "high", "predicted_low", "predicted_high"]),
        ("SD-UNIFIED-OPEN", ["sd", "sd_low", "sd_high", "sd_predicted_low", "sd_predicted_high"]),
    ):
        expected = judged[judged["id"] == id][names].to_numpy(float)
        np.testing.assert_allclose(check.loc[1:, own].to_numpy(float), expected, rtol=1e-8)
