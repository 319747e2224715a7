from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pandas as pd

from replication import check_demos, fit, load_demos
from replication.envs.maze import as_maze
from replication.evidence.claims import load_claims
from replication.evidence.tables import read_table
from replication.files import PROJECT

README = (PROJECT / "README.md").read_text(encoding="utf-8")


def test_claims_are_those_in_figures() -> None:
    """The table of claims is the one that the stored results give."""
    command = [sys.executable, str(PROJECT / "tools" / "readme.py"), "--check"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


# --- what a reviewer would say: the words fit the numbers -----------------------------------


def read(name: str) -> pd.DataFrame:
    """Return a published table."""
    return read_table(PROJECT / "figures" / f"{name}.csv")


def judged(id: str) -> pd.DataFrame:
    """Return the rows of a claim."""
    table = read("claims")
    return table[table["id"] == id]


def test_every_trial_of_the_unified_method_reaches_zero() -> None:
    """No trial of it ends at the cap: in the judging run, in soccer, with any other choice."""
    for id in ("ZERO-OPEN", "ZERO-OBSTACLES", "ZERO-SOCCER"):
        assert (judged(id)["effect"] == 1).all()
    for name in ("factorial", "single", "soccer"):
        effects = read(f"sensitivity_{name}")
        unified = effects["claim"].str.match("SAVES")
        assert unified.any()
        assert (effects[unified]["capped"] == 0).all()


def test_baseline_is_said_to_contradict_the_paper_where_it_does() -> None:
    """R1 alone has a mean whose interval holds the published one; only one SD test rejects."""
    rules = read("ablations").set_index("setting")
    paper = load_claims().by_id("FASTER").paper["adaboost"][0]
    for rule, fits in (("mismatch", True), ("confidence", False), ("log-odds", False)):
        one = rules.loc[f"AdaBoost-IRL, {rule}"]
        assert (one["low"] <= paper <= one["high"]) == fits
    assert rules.loc["AdaBoost-IRL, vote", "median"] < paper / 2
    graded = rules.loc["AdaBoost-IRL, graded"]
    assert graded["capped"] == graded["n"]
    assert (judged("FASTER")["high"] < 0).all()
    assert (judged("STEADIER")["p_holm"] < load_claims().judging.level).tolist() == [False, True]
    effects = read("sensitivity_factorial")
    graded = effects[effects["specification"].str.endswith("ADABOOST-RULE=graded")]
    assert (graded[graded["claim"] == "FASTER"]["capped"] == 10).all()


def test_named_kinds_are_said_to_save_nothing_and_the_opposite_to_save() -> None:
    """Intervals exclude the published savings; with the opposite direction all lie below zero."""
    for id in ("SAVES-OPEN", "SAVES-OBSTACLES"):
        assert (judged(id)["low"] > judged(id)["paper"]).all()
    for maze in ("open", "obstacle"):
        sets = read(f"{maze}_maze_sets").set_index("set")
        assert (sets.loc["hit+detour+opposite", "high"] < 0).all()
        assert (sets.loc["hit+detour+opposite", "p_holm"] < 0.05).all()


def test_soccer_is_said_to_leave_room_for_a_small_saving() -> None:
    """No saving and a small one lie within; of the paper's runs one is in the middle, one low."""
    saves = judged("SAVES-SOCCER")
    assert ((saves["low"] < 0) & (saves["high"] > 0) & (saves["low"] > saves["paper"])).all()
    trials = read("claims_trials")
    trials = trials[trials["task"] == "soccer"]
    for (method, _), own in trials.groupby(["method", "F"]):
        if method == "unified":
            assert own["iterations"].quantile(0.1) < 15 < own["iterations"].quantile(0.9)
        else:
            assert 0.025 < (own["iterations"] <= 7).mean() < 0.25
    for id in ("AVOIDS-OPEN", "AVOIDS-OBSTACLES", "AVOIDS-SOCCER"):
        assert ((judged(id)["low"] <= 0) & (judged(id)["high"] >= 0)).all()


def test_q_is_said_to_fall_and_the_reward_to_have_no_trend() -> None:
    """Q falls clearly; the reward's slope is within one SD of zero, its maximum near the goal."""
    assert (judged("Q-TO-GOAL")["high"] < -0.8).all()
    trials = read("claims_trials")
    own = trials[(trials["task"] == "open-maze") & (trials["method"] == "unified")]
    slopes = own.groupby("F")["reward_slope"]
    assert (slopes.mean().abs() < slopes.std()).all()
    surface = read("fig07")
    highest = surface.loc[surface["(c) reward at the end"].idxmax()]
    maze = as_maze(load_demos(PROJECT / "data" / "demos" / "open_maze.json").environment)
    row, column = divmod(maze.goal, 20)
    assert abs(highest["x"] - column) + abs(highest["y"] - (19 - row)) == 1


def test_calibration_is_said_not_to_hold_up() -> None:
    """In new trials neither mean nor SD lies where the published distribution would put it."""
    new = read("calibration_check").iloc[1]
    assert not new["predicted_low"] <= new["mean"] <= new["predicted_high"]
    assert not new["sd_predicted_low"] <= new["sd"] <= new["sd_predicted_high"]


def test_trace_is_said_to_contribute_little() -> None:
    """A trace that stays at its start is one that is 1; what it costs may be nothing."""
    table = read("ablations").set_index("setting")
    label = "Unified, without incorrect, Fᵢ (printed), "
    ones, start = table.loc[f"{label}ALPHA=0.0 F-START=1.0"], table.loc[f"{label}ALPHA=0.0"]
    assert ones.tolist() == start.tolist()
    assert ones["more_low"] < 0 < ones["more"]


# --- the rest --------------------------------------------------------------------------------


def test_files_that_are_named_exist() -> None:
    """Every link and picture of the README leads to a file of the project."""
    targets = re.findall(r"\]\(([^)#:]+)\)", README)
    assert targets
    assert [target for target in targets if not (PROJECT / target).exists()] == []


def test_make_targets_that_are_named_exist() -> None:
    """Every `make` command of the README is a target of the Makefile."""
    named = set(re.findall(r"make ([a-z]+)\b", README)) - {"and"}
    makefile = (PROJECT / "Makefile").read_text(encoding="utf-8")
    assert named <= set(re.findall(r"^([a-z]+):", makefile, flags=re.MULTILINE))


def test_example_demonstration_can_be_learned(tmp_path: Path) -> None:
    """The JSON example loads without a warning and both Python lines do what they say."""
    example = re.search(r"```json\n(.*?)```", README, flags=re.DOTALL)
    assert example is not None
    path = tmp_path / "mine.json"
    path.write_text(example[1], encoding="utf-8")
    assert check_demos(path) == []
    result = fit(load_demos(path), method="unified-incorrect", seed=1)
    assert result.converged
    result.save(tmp_path / "result.json")
