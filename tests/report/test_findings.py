from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from replication.evidence.calibration import CALIBRATED, PAIR, TRIALS, chosen, grid, kl_divergence
from replication.evidence.claims import criteria_hash, load_claims
from replication.evidence.sensitivity import HOLDS, OPEN, REVERSED, UNDEFINED
from replication.evidence.specifications import Specification, load_specifications
from replication.evidence.tables import read_table
from replication.files import PROJECT
from replication.report.findings import (
    NAMES,
    at_once,
    calibrated,
    caveats,
    chance,
    dependence,
    one_at_a_time,
    rechecked,
)

FIGURES = PROJECT / "figures"
RULES: dict[str, tuple[Any, ...]] = {
    "ADABOOST-RULE": ("mismatch", "graded"),
    "TIES": ("random", "first"),
}


# --- verdicts --------------------------------------------------------------------------------


def test_caveats_name_seeds_notes_and_criteria() -> None:
    """Below the verdicts stand every note, the seeds judged and explored, and the hash."""
    text = caveats(load_claims(), pd.DataFrame({"seed": [3, 3, 4]}))
    assert "these trials have root seed 3, 4." in text
    assert criteria_hash()[:16] in text
    for claim in load_claims().claim:
        assert claim.note in text
    for run in load_claims().explored:
        assert f"{', '.join(map(str, run.root_seeds))}: {run.what}" in text


# --- calibration -----------------------------------------------------------------------------


def near(table: pd.DataFrame) -> pd.Series:
    """Return which points have both numbers where those of a sample of the paper's would lie."""
    n = int(table["n"].iloc[0])
    half = stats.t.ppf(0.975, PAIR.n - 1) * PAIR.sd * (1 / n + 1 / PAIR.n) ** 0.5
    ratio = (table["sd"] / PAIR.sd) ** 2  # of variances: F with n - 1 and 99 degrees of freedom
    inside = ratio.between(*stats.f(n - 1, PAIR.n - 1).interval(0.95))
    return ((table["mean"] - PAIR.mean).abs() <= half) & inside & (table["capped"] == 0)


def made_up() -> pd.DataFrame:
    """Make a table of the grid up."""
    rng = np.random.default_rng(4)
    table = pd.DataFrame(grid(), columns=list(CALIBRATED))
    table["n"], table["capped"] = TRIALS, 0
    table["mean"], table["sd"] = rng.normal(40, 3, 120), rng.uniform(2, 8, 120)
    capped = table.index % 7 == 0
    table.loc[capped, ["mean", "sd"]] = np.nan
    table.loc[capped, "capped"] = 2
    table["kl_divergence"] = [
        kl_divergence(*row, PAIR) for row in zip(table["mean"], table["sd"], strict=True)
    ]
    table["default"] = [point == chosen() for point in grid()]
    return table.sort_values("kl_divergence", ignore_index=True)


def test_points_that_would_do_are_counted() -> None:
    """The number of points and their values are those of a recount; the best one is named."""
    table = made_up()
    text = calibrated(table)
    assert 0 < near(table).sum() < 120
    assert f"But {near(table).sum()} of the 120 points" in text
    best = table.iloc[0]
    assert f"mean of {best['mean']:.2f} (SD {best['sd']:.2f}) in {TRIALS} trials" in text
    assert ", ".join(f"{id} = {best[id]}" for id in CALIBRATED) in text
    for id in CALIBRATED:
        values = sorted(table[near(table)][id].unique())
        assert f"{id}: {', '.join(map(str, values))}" in text


def test_nearest_point_is_said_to_be_the_default_or_not() -> None:
    """The text says so if the nearest point is not what the register has."""
    table = made_up()
    table["default"] = False
    assert calibrated(table).startswith("The nearest point is NOT our default: ")
    table.loc[0, "default"] = True
    assert calibrated(table).startswith("The nearest point is our default: ")


def test_published_grid_is_recounted() -> None:
    """What the notebook says of the grid counts the points of the published table."""
    if not (FIGURES / "calibration").exists():
        pytest.skip("figures/calibration is not published yet")
    stored = read_table(FIGURES / "calibration" / "grid.csv")
    assert f"But {near(stored).sum()} of the 120 points" in calibrated(stored)


@pytest.mark.parametrize(
    ("mean", "sd", "text"),
    [
        (40.0, 4.7, "both are inside"),
        (40.0, 9.4, "the mean is inside"),
        (43.0, 4.7, "the SD is inside"),
        (37.0, 9.4, "neither is inside"),
    ],
)
def test_new_trials_are_held_against_the_prediction(mean: float, sd: float, text: str) -> None:
    """Mean and SD of new trials are each held against where they would lie."""
    check = pd.DataFrame(
        {"n": [30, 100, 100], "reading": ["printed", "printed", "updated"]}
        | {"mean": [40.0, mean, 33.0], "sd": [5.0, sd, 6.0]}
        | {"predicted_low": 38.8, "predicted_high": 41.4}
        | {"sd_predicted_low": 3.9, "sd_predicted_high": 5.7}
    )
    assert text in rechecked(check)
    assert "best of 120 noisy points, each known from 30 trials" in rechecked(check)
    assert "Fᵢ₊₁ (updated) inherits the point, and has 33.00 (6.00)" in rechecked(check)


# --- specifications --------------------------------------------------------------------------


def ruled(claim: str, statistic: str, by_rule: dict[str, float]) -> pd.DataFrame:
    """Make effects up that the rule of AdaBoost-IRL decides, all trials of "graded" at the cap."""
    values = list(product(*RULES.values())) * 20
    made = [Specification("factorial", tuple(zip(RULES, row, strict=True))) for row in values]
    effect = np.array([by_rule[rule] for rule, _ in values])
    outcome = [HOLDS if x + 0.5 < 0 else REVERSED if x - 0.5 > 0 else OPEN for x in effect]
    return pd.DataFrame(
        {"claim": claim, "statistic": statistic, "group": "factorial"}
        | {"specification": [one.name for one in made], "n": 10, "capped_x": 0}
        | {"capped": [10 if rule == "graded" else 0 for rule, _ in values]}
        | {"effect": effect, "low": effect - 0.5, "high": effect + 0.5, "outcome": outcome}
    )


def test_claims_are_counted_with_and_without_caps() -> None:
    """Each claim has its counts, whose trials are at the cap, and what is left without them."""
    table = ruled("FASTER", "mean-difference", {"mismatch": 0.0, "graded": -150.0})
    table.loc[0, ["effect", "low", "high", "outcome"]] = [-4.0, -5.0, -3.0, HOLDS]
    zero = ruled("ZERO-OPEN", "share", {"mismatch": 1.0, "graded": 0.0})
    zero["outcome"] = np.where(zero["effect"] > 0.9, HOLDS, REVERSED)
    faster, reaches = at_once(pd.concat([table, zero], ignore_index=True))
    assert faster.startswith(
        "**Faster than AdaBoost-IRL**: holds in 41 of 80 specifications (51%), is open in 39 and "
        "reversed in 0. In 40 of them trials end at the iteration cap, all of them of "
        "AdaBoost-IRL; it holds in 1 of the 40 others. It depends most on the rule of "
        "AdaBoost-IRL: 100% of the variance of the effect, "
    )
    assert faster.endswith("It holds with graded 100% (always at the cap), mismatch 2%.")
    assert "; every trial of the other method reaches zero, in every specification." in reaches


def test_caps_of_the_first_method_are_not_put_on_the_other() -> None:
    """If the claim's own method has trials at the cap nothing is said of whose they are."""
    table = ruled("FASTER", "mean-difference", {"mismatch": 0.0, "graded": -150.0})
    table.loc[table["capped"] > 0, "capped_x"] = 1
    (text,) = at_once(table)
    assert "end at the iteration cap; it holds in 0 of the 40 others." in text
    assert "AdaBoost-IRL; " not in text


def test_claim_that_depends_on_nothing_is_counted_alone() -> None:
    """Where no choice has a share of the variance none is named; missing effects are counted."""
    table = ruled("STEADIER", "mean-difference", {"mismatch": 1.0, "graded": 1.0})
    table["capped"] = 0
    table.loc[:19, ["effect", "low", "high", "outcome"]] = [np.nan, np.nan, np.nan, UNDEFINED]
    assert at_once(table) == [
        "**Steadier than AdaBoost-IRL**: holds in 0 of 60 specifications (0%) that have an "
        "effect (20 do not), is open in 0 and reversed in 60."
    ]


def single() -> pd.DataFrame:
    """Make the effects of single changes up."""
    names = ["default", "ALPHA=0.1", "ADABOOST-RULE=vote", "TIES=first"]
    return pd.DataFrame(
        {
            "claim": ["FASTER"] * 4 + ["STEADIER"] * 2 + ["SAVES-SOCCER"],
            "group": "single",
            "specification": [*names, *names[:2], "default"],
            "effect": [-2.0, -1.0, -2.0, 2.0, 1.0, 1.1, -2.0],
            "low": [-3.0, -2.0, -3.0, 1.0, 0.5, 0.6, -3.0],
            "high": [-1.0, 1.0, -1.0, 3.0, 1.5, 1.6, -1.0],
            "outcome": [HOLDS, OPEN, HOLDS, REVERSED, OPEN, OPEN, HOLDS],
        }
    )


def test_single_changes_that_move_a_claim_are_named() -> None:
    """With one choice changed it is said what moves a claim, and how many changes cannot."""
    faster, steadier, soccer = one_at_a_time(single())
    assert faster == (
        "**Faster than AdaBoost-IRL**: holds with the defaults; reversed under TIES=first; open "
        "under ALPHA=0.1. 1 of the 3 changes leave its numbers as they are."
    )
    assert "open with the defaults; the same under every other value. 0 of the 1" in steadier
    assert soccer.startswith("**Saves iterations**: holds with the defaults; the same")


def test_dependence_lists_mazes_and_soccer_apart() -> None:
    """The Markdown has three lists, and how far chance goes."""
    table = ruled("SAVES-OPEN", "mean-difference", {"mismatch": 0.0, "graded": -150.0})
    lines = dependence(pd.concat([table, single()], ignore_index=True)).splitlines()
    assert [line for line in lines if line.endswith(":")] == [
        "All choices at once:",
        "One choice at a time, mazes:",
        "One choice at a time, soccer:",
    ]
    assert [line[:10] for line in lines if line.startswith("-")] == [
        "- **Saves ",
        "- **Faster",
        "- **Steadi",
        "- **Saves ",
    ]
    assert lines[-1].startswith("How far chance goes: the rule of AdaBoost-IRL cannot act on")


def test_every_choice_of_the_factorial_has_a_name() -> None:
    """A choice that is added to the factorial has to be named in words, too."""
    assert set(NAMES) == set(load_specifications().mazes.factorial.choices)


def test_chance_is_read_from_a_choice_that_cannot_act() -> None:
    """The rule of AdaBoost-IRL does not act on savings: its shares differ by chance alone."""
    table = ruled("SAVES-OPEN", "mean-difference", {"mismatch": 0.0, "graded": 0.0})
    table.loc[[0, 1, 2, 3], "outcome"] = HOLDS
    held = table[table["outcome"] == HOLDS]["capped"].eq(10)
    few, most = sorted((held.sum() / 40, (~held).sum() / 40))
    assert f"with its 2 values in {few:.0%} to {most:.0%} of the specifications" in chance(table)
