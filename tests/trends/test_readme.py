from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from replication import check_demos, fit, load_demos
from replication.envs.maze import as_maze
from replication.evidence.claims import load_claims
from replication.evidence.specifications import named_choices
from replication.evidence.tables import read_table
from replication.files import PROJECT

README = (PROJECT / "README.md").read_text(encoding="utf-8")
PAGES = {
    path.relative_to(PROJECT).as_posix(): path.read_text(encoding="utf-8")
    for path in (PROJECT / "README.md", PROJECT / "CONTRIBUTING.md", *PROJECT.glob("docs/*.md"))
    if path.name != "index.md"  # its links are those of the site
}


@pytest.fixture(scope="module")
def tool() -> Any:
    """Import the tool that writes the README."""
    spec = importlib.util.spec_from_file_location("readme", PROJECT / "tools" / "readme.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# --- the front door --------------------------------------------------------------------------


def test_readme_and_findings_are_up_to_date() -> None:
    """The answer and the findings are those that the published results give."""
    command = [sys.executable, str(PROJECT / "tools" / "readme.py"), "--check"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


def test_readme_is_read_in_a_minute() -> None:
    """It has at most 120 lines and 900 words."""
    assert len(README.splitlines()) <= 120
    assert len(README.split()) <= 900


@pytest.mark.parametrize("marks", ["{0}{0}{1}", "{0}{1}{1}", "{0}", "{1}", "{1}{0}", ""])
def test_a_mark_that_is_not_there_once_is_refused(tool: Any, marks: str) -> None:
    """A second or missing mark is an error: the text behind it would become stale unseen."""
    with pytest.raises(tool.MarkError, match=r"README\.md: "):
        tool.fill(marks.format(tool.BEGIN, tool.END), "answer")


def test_the_answer_stands_between_the_marks(tool: Any) -> None:
    """What was there is replaced, and the text around it stays."""
    text = f"before{tool.BEGIN}old{tool.END}after"
    assert tool.fill(text, "new") == f"before{tool.BEGIN}\n\nnew\n\n{tool.END}after"


@pytest.mark.parametrize("name", PAGES)
def test_links_lead_to_files(name: str) -> None:
    """Every relative link and picture of a page leads to a file or folder of the project."""
    targets = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", PAGES[name])
    folder = (PROJECT / name).parent
    assert [target for target in targets if not (folder / target).exists()] == []


@pytest.mark.parametrize("name", PAGES)
def test_make_targets_that_are_named_exist(name: str) -> None:
    """Every `make` command of a page is a target of the Makefile."""
    named = re.findall(r"(?:^ +|`)make ([a-z-]+)\b", PAGES[name], flags=re.MULTILINE)
    makefile = (PROJECT / "Makefile").read_text(encoding="utf-8")
    assert set(named) <= set(re.findall(r"^([a-z-]+):", makefile, flags=re.MULTILINE))


def test_example_of_the_readme_runs() -> None:
    """Its lines of Python learn the path of the demonstration."""
    example = re.search(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert example is not None
    names: dict[str, Any] = {}
    exec(example[1], names)
    assert names["result"].converged


def test_example_demonstration_can_be_learned(tmp_path: Path) -> None:
    """The example of a file loads without a warning and the Python beside it does what it says."""
    page = PAGES["docs/demonstrations.md"]
    example = re.search(r"```json\n(.*?)```", page, flags=re.DOTALL)
    assert example is not None
    path = tmp_path / "mine.json"
    path.write_text(example[1], encoding="utf-8")
    assert check_demos(path) == []
    result = fit(load_demos(path), method="unified-incorrect", seed=1)
    assert result.converged
    result.save(tmp_path / "result.json")


# --- the words fit the numbers ---------------------------------------------------------------


def read(name: str) -> pd.DataFrame:
    """Return a published table."""
    return read_table(PROJECT / "figures" / f"{name}.csv")


def judged(id: str) -> pd.DataFrame:
    """Return the rows of a claim."""
    table = read("claims/verdicts")
    return table[table["id"] == id]


def factorial(id: str) -> pd.DataFrame:
    """Return the effects of a claim under all choices at once, with the rule of AdaBoost-IRL."""
    table = read("sensitivity/effects")
    rows = table[(table["claim"] == id) & (table["group"] == "factorial")]
    rules = [named_choices(name)["ADABOOST-RULE"] for name in rows["specification"]]
    return rows.assign(rule=rules)


def main_trials(task: str) -> pd.DataFrame:
    """Return the trials that an experiment's claims are judged on."""
    trials = read(f"{task}/trials")
    kinds = "all" if task == "soccer" else "hit+detour"
    return trials[trials["set"].isin(["none", kinds])]


def ablations(**known: str) -> pd.DataFrame:
    """Return the ablations of a method, a reading or choices."""
    table = read("sensitivity/ablations")
    for name, value in known.items():
        table = table[table[name] == value]
    return table


def test_every_trial_of_the_unified_method_reaches_zero() -> None:
    """No trial of it ends at the cap: in the judging run, in soccer, with any other choice."""
    for id in ("ZERO-OPEN", "ZERO-OBSTACLES", "ZERO-SOCCER"):
        assert (judged(id)["effect"] == 1).all()
        assert (judged(id)["verdict"] == "reproduced").all()
    for name in ("effects", "single", "soccer"):
        table = read(f"sensitivity/{name}")
        unified = table["claim"].str.match("SAVES")
        assert unified.any()
        assert (table[unified]["capped"] == 0).all()


def test_r1_is_below_the_published_mean_and_nearest_to_it() -> None:
    """R1's interval in the judging run lies below it; every other reading's mean is farther off."""
    paper = load_claims().by_id("FASTER").paper["adaboost"][0]
    (r1,) = judged("MEAN-ADABOOST-OPEN").itertuples()
    assert r1.high < paper
    for rule in ("vote", "confidence", "log-odds", "graded"):
        (row,) = ablations(method="adaboost", choices=f"ADABOOST-RULE={rule}").itertuples()
        assert abs(row.mean - paper) > abs(r1.effect - paper)
        assert not row.low <= paper <= row.high or rule == "vote"
        assert rule != "vote" or row.median < paper / 2
        assert rule != "graded" or row.capped == row.n


def test_the_answer_on_the_baseline_depends_on_its_rule() -> None:
    """Faster than R1; one SD test of two rejects; with two other rules it is mostly slower."""
    assert (judged("FASTER")["high"] < 0).all()
    assert (judged("STEADIER")["p_holm"] < load_claims().judging.level).tolist() == [False, True]
    effects = factorial("FASTER")
    assert (effects[effects["rule"] == "graded"]["capped"] == 10).all()
    for rule in ("vote", "log-odds"):
        outcomes = effects[effects["rule"] == rule]["outcome"]
        assert (outcomes == "reversed").mean() > 0.5


def test_named_kinds_save_nothing_and_the_opposite_saves() -> None:
    """Intervals exclude the published savings; with the opposite direction all lie below zero."""
    for id in ("SAVES-OPEN", "SAVES-OBSTACLES"):
        assert (judged(id)["low"] > judged(id)["paper"]).all()
    for maze in ("open", "obstacle"):
        sets = read(f"{maze}_maze/sets").set_index("set")
        assert (sets.loc["hit+detour+opposite", "high"] < 0).all()
        assert (sets.loc["hit+detour+opposite", "p_holm"] < 0.05).all()


def test_soccer_leaves_room_for_a_small_saving() -> None:
    """No saving and a small one lie within; of the paper's runs one is in the middle, one low."""
    saves = judged("SAVES-SOCCER")
    assert ((saves["low"] < 0) & (saves["high"] > 0) & (saves["low"] > saves["paper"])).all()
    for (method, _), rows in main_trials("soccer").groupby(["method", "reading"]):
        if method == "unified":
            assert rows["iterations"].quantile(0.1) < 15 < rows["iterations"].quantile(0.9)
        else:
            assert 0.025 < (rows["iterations"] <= 7).mean() < 0.25


def test_early_motions_show_no_difference() -> None:
    """All intervals include zero, and under the printed reading most trials do not differ."""
    for id in ("AVOIDS-OPEN", "AVOIDS-OBSTACLES", "AVOIDS-SOCCER"):
        assert ((judged(id)["low"] <= 0) & (judged(id)["high"] >= 0)).all()
    for task in ("open_maze", "obstacle_maze", "soccer"):
        trials = main_trials(task)
        table = trials[trials["reading"] == "printed"].pivot(
            index="trial", columns="method", values="early_errors"
        )
        assert (table["unified"] == table["unified-incorrect"]).mean() > 0.5


def test_q_falls_and_the_reward_has_no_trend() -> None:
    """Q falls clearly; the reward's slope is within one SD of zero, its maximum near the goal."""
    assert (judged("Q-TO-GOAL")["high"] < -0.8).all()
    assert (judged("REWARD-TO-GOAL")["verdict"] == "reversed").all()
    trials = main_trials("open_maze")
    slopes = trials[trials["method"] == "unified"].groupby("reading")["reward_slope"]
    assert (slopes.mean().abs() < slopes.std()).all()
    surface = read("open_maze/fig07")
    highest = surface.loc[surface["(c) reward at the end"].idxmax()]
    maze = as_maze(load_demos(PROJECT / "data" / "demos" / "open_maze.json").environment)
    row, column = divmod(maze.goal, 20)
    assert abs(highest["x"] - column) + abs(highest["y"] - (19 - row)) == 1


def test_calibration_does_not_hold_up() -> None:
    """In new trials neither mean nor SD lies where the published distribution would put it."""
    new = read("calibration/check").iloc[1]
    assert not new["predicted_low"] <= new["mean"] <= new["predicted_high"]
    assert not new["sd_predicted_low"] <= new["sd"] <= new["sd_predicted_high"]


def test_the_trace_contributes_little() -> None:
    """A trace that stays at its start is one that is 1; what it costs may be nothing."""
    table = ablations(method="unified", reading="printed").set_index("choices")
    table = table.drop(columns=["method", "reading"])
    ones, start = table.loc["ALPHA=0.0 F-START=1.0"], table.loc["ALPHA=0.0"]
    assert ones.tolist() == start.tolist()
    assert ones["more_low"] < 0 < ones["more"]
