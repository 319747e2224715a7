"""The words of ``docs/findings.md.jinja`` hold for the published numbers."""

from __future__ import annotations

from functools import cache

import numpy as np
import pandas as pd
import pytest
from scipy.stats import spearmanr

from replication import load_demos
from replication.envs.maze import as_maze
from replication.evidence.calibration import rule_follows
from replication.evidence.experiments import EXPERIMENTS, GENERAL, NAMED
from replication.evidence.rounding import chosen_tolerance
from replication.evidence.specifications import named_choices
from replication.evidence.tables import read_table
from replication.evidence.verdicts import ABSENT, REVERSED, SHOWN
from replication.files import PROJECT
from replication.paper.register import load_choices
from replication.report.maze import places

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


def ablations(method: str, reading: str) -> pd.DataFrame:
    """Return the ablations of a method, by the choices that are changed."""
    table = read("sensitivity/ablations")
    rows = table[(table["method"] == method) & (table["reading"] == reading)]
    return rows.drop(columns=["method", "reading"]).set_index("choices")


def cells(id: str, set: str) -> pd.DataFrame:
    """Return the rows of a claim with a set of incorrect demonstrations."""
    table = judged(id)
    return table[table["set"] == set]


def test_every_trial_of_the_unified_method_reaches_zero() -> None:
    """No trial of it ends at the cap: in the judging run, in soccer, with any other choice."""
    for id in ("ZERO-OPEN", "ZERO-OBSTACLES", "ZERO-SOCCER"):
        assert (judged(id)["effect"] == 1).all()
        assert (judged(id)["verdict"] == SHOWN).all()
    effects = read("sensitivity/effects")
    saves = effects[effects["claim"].str.startswith("SAVES")]
    assert set(saves["claim"]) == {"SAVES-OPEN", "SAVES-SOCCER"}
    assert set(saves["group"]) == {"single", "factorial"}
    assert (saves["capped"] == 0).all()


@pytest.mark.parametrize("id", ["SAVES-OPEN", "SAVES-OBSTACLES"])
def test_the_sets_give_opposite_answers(id: str) -> None:
    """With the named kinds a saving is absent in every cell; with the general list it is shown."""
    named, general = cells(id, NAMED), cells(id, GENERAL)
    assert (named["verdict"] == ABSENT).all()
    assert (named["low"] > -named["margin"]).all()
    assert (named["high"] < named["margin"]).all()
    assert (general["verdict"] == SHOWN).all()
    assert general.set_index("reading")["effect"].idxmax() == "at-once"


def test_turning_back_is_what_goes_wrong() -> None:
    """Most wrong visits turn back, and so do most trajectories; detours are met in some of them."""
    table = read("open_maze/kinds").set_index(["kind", "reading"])
    weight, share = table["weight"], table["share"]
    assert (share["opposite"] > 0.5).all()
    assert (weight["opposite"] > 0.5).all()
    assert (weight["hit"] < 0.01).all()
    assert (share["hit"] < 0.01).all()
    assert (weight["detour"] < weight["opposite"] / 4).all()


def test_the_answer_on_the_baseline_depends_on_its_rule() -> None:
    """Faster than R1, steadier under F_(i+1); `graded` never ends; others are often faster."""
    assert (judged("FASTER")["verdict"] == SHOWN).all()
    assert judged("STEADIER")["verdict"].tolist() == [ABSENT, SHOWN]
    effects = read("sensitivity/effects")
    faster = effects[(effects["claim"] == "FASTER") & (effects["group"] == "factorial")]
    rule = faster["specification"].map(lambda name: named_choices(name)["ADABOOST-RULE"])
    assert (faster[rule == "graded"]["capped"] == 10).all()
    for slower in ("vote", "log-odds"):
        assert (faster[rule == slower]["outcome"] == "reversed").mean() >= 0.5
    rules = ablations("adaboost", "")
    graded = rules.loc["ADABOOST-RULE=graded"]
    assert graded["capped"] == graded["n"]


def test_no_errors_are_spared_at_first() -> None:
    """While learning, in every cell; of the greedy agent in the mazes."""
    for id in ("AVOIDS-OPEN", "AVOIDS-OBSTACLES", "AVOIDS-SOCCER", "ERRS-OPEN", "ERRS-OBSTACLES"):
        assert (judged(id)["verdict"] == ABSENT).all()


def test_soccer_shows_no_saving() -> None:
    """No cell shows one, nor a cost, and none is as large as the paper's."""
    saves = judged("SAVES-SOCCER")
    assert not saves["verdict"].isin([SHOWN, REVERSED]).any()
    assert (saves["high"] < saves["paper"]).all()


def test_a_difference_of_single_runs_says_little() -> None:
    """The paper's runs in soccer are not improbable among ours."""
    for id in ("RUN-UNIFIED-SOCCER", "RUN-INCORRECT-SOCCER"):
        assert (judged(id)["p"] > 0.05).all()


def test_the_reward_grows_with_time() -> None:
    """The reward is larger at the end than in the mid-term, Q by little or less; it falls."""
    assert (judged("REWARD-GROWS")["verdict"] == SHOWN).all()
    assert judged("Q-GROWS")["verdict"].tolist() == [REVERSED, SHOWN]
    surface = read("open_maze/fig07")
    end = surface[surface["surface"] == "q_end"].set_index(["x", "y"])["value"]
    demos = load_demos(EXPERIMENTS["open-maze"].demos)
    path = places(as_maze(demos.environment), demos.correct[0].states[:-1])
    values = [end[place] for place in zip(*path, strict=True)]
    assert spearmanr(np.arange(len(values)), values).statistic < -0.8


def test_rounding_decides_without_a_tolerance() -> None:
    """At 0, means differ between arithmetics; from 1e-12 on, double and fused never do."""
    table = read("rounding/rounding")
    printed = table[(table["reading"] == "printed") & (table["tolerance"] == 0)]
    others = printed[printed["arithmetic"] != "double"]
    assert (others["p_holm"] < 0.05).all()
    fused = table[(table["arithmetic"] == "fused") & (table["tolerance"] > 0)]
    assert (fused["equal"] == 1).all()
    assert chosen_tolerance(table) == load_choices()["TIE-TOLERANCE"].default
    effects = read("sensitivity/effects")
    single = effects[effects["group"] == "single"].set_index("specification").sort_index()
    columns = ["claim", "effect", "low", "high"]
    default = single.loc["default", columns].set_index("claim")
    changed = single.loc["ARITHMETIC=fused", columns].set_index("claim")
    pd.testing.assert_frame_equal(changed, default.loc[changed.index])


def test_ties_at_random_let_a_trajectory_meet_more_wrong_pairs() -> None:
    """With the tolerance a wrong trajectory takes more wrong pairs than without it."""
    table = read("rounding/rounding")
    double = table[table["arithmetic"] == "double"]
    keys = ["task", "method", "reading"]
    none, some = (
        double[double["tolerance"] == value].set_index(keys)["wrong"] for value in (0, 1e-12)
    )
    assert (some > 1.1 * none).all()


def test_no_point_fits_the_published_pair() -> None:
    """None of the finalists has both numbers, and the defaults are those of the plainest point."""
    final = read("calibration/final")
    assert not final["fits"].any()
    assert rule_follows(final)


def test_the_trace_contributes_little() -> None:
    """A trace that stays at its start is one that is 1."""
    table = ablations("unified", "printed")
    ones, start = table.loc["ALPHA=0.0 F-START=1.0"], table.loc["ALPHA=0.0"]
    assert ones.tolist() == start.tolist()
