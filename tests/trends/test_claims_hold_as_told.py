"""The words of ``docs/findings.md.jinja`` hold for the published numbers."""

from __future__ import annotations

from functools import cache

import pandas as pd
import pytest

from replication import load_demos
from replication.envs.maze import as_maze
from replication.evidence.claims import load_claims
from replication.evidence.experiments import EXPERIMENTS
from replication.evidence.specifications import named_choices
from replication.evidence.tables import read_table
from replication.evidence.verdicts import judged_trials, read_trials
from replication.files import PROJECT, resolve

FIGURES = PROJECT / "figures"

pytestmark = pytest.mark.skipif(
    not (FIGURES / "claims" / "verdicts.csv").exists(), reason="figures/claims is not published yet"
)


@cache
def read(name: str) -> pd.DataFrame:
    """Return a published table."""
    return read_table(FIGURES / f"{name}.csv")


@cache
def judged(id: str) -> pd.DataFrame:
    """Return the rows of a claim."""
    table = read("claims/verdicts")
    return table[table["id"] == id]


@cache
def trials(task: str) -> pd.DataFrame:
    """Return the judged trials of a task."""
    table = judged_trials(read_trials(FIGURES), load_claims().judging)
    return table[table["task"] == task]


def ablations(method: str, reading: str) -> pd.DataFrame:
    """Return the ablations of a method, by the choices that are changed."""
    table = read("sensitivity/ablations")
    rows = table[(table["method"] == method) & (table["reading"] == reading)]
    return rows.drop(columns=["method", "reading"]).set_index("choices")


def test_every_trial_of_the_unified_method_reaches_zero() -> None:
    """No trial of it ends at the cap: in the judging run, in soccer, with any other choice."""
    for id in ("ZERO-OPEN", "ZERO-OBSTACLES", "ZERO-SOCCER"):
        assert (judged(id)["effect"] == 1).all()
        assert (judged(id)["verdict"] == "reproduced").all()
    effects = read("sensitivity/effects")
    saves = effects[effects["claim"].str.startswith("SAVES")]
    assert set(saves["claim"]) == {"SAVES-OPEN", "SAVES-SOCCER"}
    assert set(saves["group"]) == {"single", "factorial"}
    assert (saves["capped"] == 0).all()


def test_r1_is_below_the_published_mean_and_nearest_to_it() -> None:
    """R1's interval in the judging run lies below it; the mean of any other rule is farther off."""
    paper = load_claims().by_id("FASTER").paper["adaboost"][0]
    rules = ablations("adaboost", "")
    (r1,) = judged("MEAN-ADABOOST-OPEN").itertuples()
    assert r1.high < paper
    distances = (rules["mean"] - paper).abs()
    assert distances.idxmin() == "ADABOOST-RULE=mismatch"
    others = rules.drop("ADABOOST-RULE=mismatch")
    assert abs(r1.effect - paper) < distances[others.index].min()
    around = others[(others["low"] <= paper) & (paper <= others["high"])]
    assert set(around.index) <= {"ADABOOST-RULE=vote"}
    assert rules.loc["ADABOOST-RULE=vote", "median"] < paper / 2
    graded = rules.loc["ADABOOST-RULE=graded"]
    assert graded["capped"] == graded["n"]


def test_the_answer_on_the_baseline_depends_on_its_rule() -> None:
    """Faster than R1; one SD test of two rejects; with two other rules it is mostly slower."""
    assert (judged("FASTER")["high"] < 0).all()
    assert (judged("STEADIER")["p_holm"] < load_claims().judging.level).tolist() == [False, True]
    effects = read("sensitivity/effects")
    faster = effects[(effects["claim"] == "FASTER") & (effects["group"] == "factorial")]
    rule = faster["specification"].map(lambda name: named_choices(name)["ADABOOST-RULE"])
    assert (faster[rule == "graded"]["capped"] == 10).all()
    for slower in ("vote", "log-odds"):
        assert (faster[rule == slower]["outcome"] == "reversed").mean() > 0.5


def test_named_kinds_save_nothing_and_the_opposite_saves() -> None:
    """Intervals exclude the published savings; with the opposite direction all lie below zero."""
    for id in ("SAVES-OPEN", "SAVES-OBSTACLES"):
        assert (judged(id)["low"] > judged(id)["paper"]).all()
    for maze in ("open_maze", "obstacle_maze"):
        sets = read(f"{maze}/sets").set_index("set")
        assert (sets.loc["hit+detour+opposite", "high"] < 0).all()
        assert (sets.loc["hit+detour+opposite", "p_holm"] < 0.05).all()


def test_soccer_leaves_room_for_a_small_saving() -> None:
    """No saving and a small one lie within; of the paper's runs one is in the middle, one low."""
    saves = judged("SAVES-SOCCER")
    assert ((saves["low"] < 0) & (saves["high"] > 0) & (saves["low"] > saves["paper"])).all()
    for (method, _), rows in trials("soccer").groupby(["method", "reading"]):
        if method == "unified":
            assert rows["iterations"].quantile(0.1) < 15 < rows["iterations"].quantile(0.9)
        else:
            assert 0.025 < (rows["iterations"] <= 7).mean() < 0.25


@pytest.mark.parametrize("id", ["AVOIDS-OPEN", "AVOIDS-OBSTACLES", "AVOIDS-SOCCER"])
def test_early_motions_show_no_sign_of_fewer_errors(id: str) -> None:
    """No interval excludes zero, and under F_i most trials have equally many errors."""
    assert ((judged(id)["low"] <= 0) & (judged(id)["high"] >= 0)).all()
    rows = trials(load_claims().by_id(id).task)
    printed = rows[rows["reading"] == "printed"]
    errors = printed.pivot(index="trial", columns="method", values="early_errors")
    assert (errors["unified"] == errors["unified-incorrect"]).mean() > 0.5


def test_q_falls_and_the_reward_has_no_trend() -> None:
    """Q falls clearly; the reward's slope is within one SD of zero, its maximum by the goal."""
    assert (judged("Q-TO-GOAL")["high"] < -0.8).all()
    assert (judged("REWARD-TO-GOAL")["verdict"] == "reversed").all()
    rows = trials("open-maze")
    slopes = rows[rows["method"] == "unified"].groupby("reading")["reward_slope"]
    assert (slopes.mean().abs() < slopes.std()).all()
    surface = read("open_maze/fig07")
    maze = as_maze(load_demos(resolve(EXPERIMENTS["open-maze"].demos)).environment)
    row, column = divmod(maze.goal, maze.shape[1])
    reward = surface[surface["surface"] == "reward_end"]
    highest = reward.loc[reward["value"].idxmax()]
    assert abs(highest["x"] - column) + abs(highest["y"] - (maze.shape[0] - 1 - row)) == 1


def test_calibration_does_not_hold_up() -> None:
    """In new trials neither mean nor SD lies where the published distribution would put it."""
    new = read("calibration/check").iloc[1]
    assert not new["predicted_low"] <= new["mean"] <= new["predicted_high"]
    assert not new["sd_predicted_low"] <= new["sd"] <= new["sd_predicted_high"]


def test_the_trace_contributes_little() -> None:
    """A trace that stays at its start is one that is 1; what it costs may be nothing."""
    table = ablations("unified", "printed")
    ones, start = table.loc["ALPHA=0.0 F-START=1.0"], table.loc["ALPHA=0.0"]
    assert ones.tolist() == start.tolist()
    assert ones["more_low"] < 0 < ones["more"]
