from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest

from replication.evidence.calibration import PLAINEST, TRACE, WORLD, chosen, points
from replication.evidence.claims import criteria_hash, load_claims
from replication.evidence.rounding import settings, variants
from replication.evidence.sensitivity import (
    HOLDS,
    JOINT,
    NOISE,
    OPEN,
    REVERSED,
    UNDEFINED,
    shares_table,
)
from replication.evidence.specifications import Specification, load_specifications
from replication.evidence.verdicts import ABSENT, INCONCLUSIVE, NOT_TESTABLE, SHOWN
from replication.irl.methods import TRACES
from replication.paper.register import load_choices
from replication.report import findings
from replication.report.choices import NAMES
from replication.report.findings import (
    at_once,
    calibrated,
    caveats,
    chance,
    counted,
    dependence,
    held,
    holding,
    one_at_a_time,
    robustness,
    rounded,
    shows_opposite,
)
from replication.report.readable import F_LABELS

RULES: dict[str, tuple[Any, ...]] = {
    "ADABOOST-RULE": ("mismatch", "graded"),
    "TIES": ("random", "first"),
}


# --- verdicts --------------------------------------------------------------------------------


def test_caveats_name_seeds_notes_and_criteria() -> None:
    """Below the verdicts stand every note, the seeds judged and known before, and the hash."""
    text = caveats(load_claims(), pd.DataFrame({"seed": [3, 3, 4]}))
    assert "these trials have root seed 3, 4." in text
    assert criteria_hash()[:16] in text
    for claim in load_claims().claim:
        assert not claim.note or f"- {claim.id}: {claim.note}" in text
    for run in load_claims().known:
        seeds = ", ".join(map(str, run.root_seeds))
        assert f"- {run.what}" in text
        assert not seeds or f"{seeds})" in text


# --- rounding --------------------------------------------------------------------------------

LEAST = load_choices()["TIE-TOLERANCE"].default


def some_rounding(**p_values: float) -> pd.DataFrame:
    """Make up how the iterations depend on rounding, given the p-value at each tolerance."""
    rows = []
    for (task, method, reading), (tolerance, arithmetic) in product(settings(), variants()):
        row = {"task": task, "method": method, "reading": reading, "tolerance": tolerance}
        none = tolerance == 0
        row |= {"arithmetic": arithmetic, "difference": -6.25 if none else 0.5}
        row["equal"] = {"double": 1.0, "fused": 0.97, "single": 0.4}[str(arithmetic)]
        row["p_holm"] = p_values.get(f"{tolerance:g}", 1.0) if arithmetic == "single" else 1.0
        rows.append(row)
    return pd.DataFrame(rows)


def test_the_tolerance_of_the_rule_is_held_against_the_default() -> None:
    """The least tolerance without a difference is named, and whether it is ours."""
    text = rounded(some_rounding(**{"0": 0.001}))
    assert "changes by up to 6.2 iterations (AdaBoost-IRL (R1), fused, open-maze)" in text
    assert "at least 97% of the trials of a setting" in text
    assert "A difference is shown at a tolerance of 0. The least tolerance" in text
    assert f"is {LEAST:g}, which is our default." in text
    assert "the same number: 40% at 1e-12, 40% at 1e-09, 40% at 1e-06, 40% at 0.001." in text
    text = rounded(some_rounding(**{"0": 0.001, "1e-12": 0.04}))
    assert "shown at a tolerance of 0, 1e-12. The least" in text
    assert f"is 1e-09, NOT our default of {LEAST:g}." in text


def test_no_tolerance_may_do() -> None:
    """If a difference is shown at each tolerance the text says so."""
    text = rounded(some_rounding(**{f"{t:g}": 0.0 for t, _ in variants()}))
    assert "At none of them is there no difference." in text


# --- calibration -----------------------------------------------------------------------------

COLUMNS = [*WORLD, *TRACE, "F-INDEX"]


def made_up(*, fitting: int) -> pd.DataFrame:
    """Make up finalists of two worlds, the nearest first, of which some fit.

    The first world is that of the default, with the default of each trace.
    """
    default = [chosen(trace) for trace in TRACES]
    other = next(point[:3] for point in points() if point[:3] != default[0][:3])
    rest = [(*other, *point[3:]) for point in default]
    order = np.arange(4)
    return (
        pd.DataFrame([*default, *rest], columns=[*WORLD, *TRACE, "F-INDEX"])
        .assign(n=200, mean=40 + order, sd=5.0, kl_divergence=order / 10, fits=order < fitting)
        .assign(paper_mean=40.10, paper_sd=4.73)
    )


def taken(text: str) -> list[str]:
    """Return the values that the text says the rule takes for each trace."""
    _, _, rest = text.partition("The rule takes ")
    return rest.partition(". These")[0].split("; ")


@pytest.mark.parametrize(
    ("fitting", "words"), [(3, "**3 of them** fit"), (1, "**1 of them** fits")]
)
def test_what_the_rule_takes_is_named(fitting: int, words: str) -> None:
    """The number of points, those that fit, the nearest one's numbers, and each trace's point."""
    text = calibrated(pd.DataFrame(index=range(240)), made_up(fitting=fitting))
    assert text.startswith(f"Of 240 points 4 went on to the second stage, and {words} the pair.")
    assert "mean of 40.00 (SD 5.00) in 200 trials; the paper has 40.10 (4.73)." in text
    for trace, said in zip(TRACES, taken(text), strict=True):
        values = zip((*WORLD, *TRACE), chosen(trace), strict=False)
        named = ", ".join(f"{id} = {value}" for id, value in values)
        assert said == f"under {F_LABELS[trace]}: {named}"
    assert text.endswith("These are our defaults.")


def test_another_nearest_point_is_not_said_to_be_the_default() -> None:
    """If the nearest world is another, the text says that it is not ours."""
    final = made_up(fitting=4)
    final["kl_divergence"] = final["kl_divergence"].to_numpy()[::-1]
    assert calibrated(final, final).endswith("These are NOT our defaults.")


def test_without_a_fit_the_plainest_point_is_taken() -> None:
    """If nothing fits, the text says so, and that the rule takes the middle of each range."""
    text = calibrated(made_up(fitting=0), made_up(fitting=0))
    assert "**none of them** fits the pair" in text
    named = ", ".join(f"{id} = {v}" for id, v in zip((*WORLD, *TRACE), PLAINEST, strict=True))
    assert taken(text) == [f"under {F_LABELS[trace]}: {named}" for trace in TRACES]


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
        | dict.fromkeys(JOINT, np.nan)
    )


def test_claims_are_counted_with_and_without_caps() -> None:
    """Each claim has its counts, whose trials are at the cap, and what is left without them."""
    table = ruled("FASTER", "saved", {"mismatch": 0.0, "graded": -150.0})
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
    assert faster.endswith("It holds with graded: 100% (always at the cap); mismatch: 2%.")
    assert "; every trial of the other method reaches zero, in every specification." in reaches


def test_caps_of_the_first_method_are_not_put_on_the_other() -> None:
    """If the claim's own method has trials at the cap nothing is said of whose they are."""
    table = ruled("FASTER", "saved", {"mismatch": 0.0, "graded": -150.0})
    table.loc[table["capped"] > 0, "capped_x"] = 1
    (text,) = at_once(table)
    assert "end at the iteration cap; it holds in 0 of the 40 others." in text
    assert "AdaBoost-IRL; " not in text


def test_no_choice_is_named_where_chance_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    """If most of the variance is sampling error, this is said instead of the largest share."""
    table = ruled("FASTER", "saved", {"mismatch": 0.0, "graded": -2.0}).assign(capped=0)
    for share, named in ((0.4, True), (0.75, False)):

        def shares(effects: pd.DataFrame, share: float = share) -> pd.DataFrame:
            found = shares_table(effects)
            found.loc[found["choice"] == NOISE, "share"] = share
            return found

        monkeypatch.setattr(findings, "shares_table", shares)
        (text,) = at_once(table)
        assert ("It depends most on" in text) == named
        assert text.endswith(" No choice stands out: 75% of the variance is chance.") != named


def test_claim_that_depends_on_nothing_is_counted_alone() -> None:
    """Where no choice has a share of the variance none is named; missing effects are counted."""
    table = ruled("STEADIER", "saved", {"mismatch": 1.0, "graded": 1.0})
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
    table = ruled("SAVES-OPEN", "saved", {"mismatch": 0.0, "graded": -150.0})
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


def test_every_choice_that_is_varied_has_a_name() -> None:
    """A choice that is added to the specifications has to be named in words, too."""
    plan = load_specifications()
    parts = (plan.mazes.factorial, plan.mazes.single, plan.soccer.single)
    assert set(NAMES) == {id for part in parts for id in part.choices}


def test_chance_is_read_from_a_choice_that_cannot_act() -> None:
    """The rule of AdaBoost-IRL does not act on savings: its shares differ by chance alone."""
    table = ruled("SAVES-OPEN", "saved", {"mismatch": 0.0, "graded": 0.0})
    table.loc[[0, 1, 2, 3], "outcome"] = HOLDS
    held = table[table["outcome"] == HOLDS]["capped"].eq(10)
    few, most = sorted((held.sum() / 40, (~held).sum() / 40))
    assert f"with its 2 values in {few:.0%} to {most:.0%} of the specifications" in chance(table)


# --- beside the verdicts ---------------------------------------------------------------------


def specified(claim: str, *specifications: tuple[str, str, int]) -> pd.DataFrame:
    """Make up effects of the factorial: specification, outcome and trials at the cap."""
    return pd.DataFrame(specifications, columns=["specification", "outcome", "capped"]).assign(
        claim=claim, group="factorial"
    )


EFFECTS = pd.concat(
    [
        specified(
            "SAVES-OPEN",
            ("MAP=open INCORRECT-KINDS=hit", OPEN, 0),
            ("MAP=open INCORRECT-KINDS=hit+detour", HOLDS, 1),
            ("MAP=open INCORRECT-KINDS=all", HOLDS, 0),
            ("MAP=open INCORRECT-KINDS=hit+detour+opposite", HOLDS, 0),
            ("MAP=open INCORRECT-KINDS=opposite", REVERSED, 0),
            ("MAP=obstacles INCORRECT-KINDS=opposite", HOLDS, 0),
            ("MAP=random-1 INCORRECT-KINDS=opposite", OPEN, 0),
        ),
        specified(
            "FASTER",
            ("MAP=open INCORRECT-KINDS=all", HOLDS, 0),
            ("MAP=open INCORRECT-KINDS=hit", UNDEFINED, 0),
            ("MAP=open INCORRECT-KINDS=hit", OPEN, 2),
        ),
        specified("SAVES-SOCCER", ("default", OPEN, 0), ("ALPHA=0.9", HOLDS, 0)).assign(
            group="single"
        ),
    ]
)


@pytest.mark.parametrize(
    ("id", "text"),
    [
        (
            "SAVES-OPEN",
            "with moves in the opposite direction 2 of 3; without 1 of 2 (uncapped 0 of 1)",
        ),
        ("SAVES-OBSTACLES", "with moves in the opposite direction 1 of 1; without 0 of 0"),
        ("FASTER", "1 of 2 (uncapped 1 of 1)"),
        ("SAVES-SOCCER", "1 of 2"),
        ("Q-GROWS", "–"),
    ],
)
def test_specifications_in_which_a_claim_holds_are_counted(id: str, text: str) -> None:
    """A claim is counted on its own map, apart for whether the opposite direction is shown."""
    assert holding(EFFECTS, id) == text


def test_the_opposite_direction_is_in_a_set_or_not() -> None:
    """All kinds together have it, and so does a set that names it."""
    sets = ["all", "opposite", "hit+detour+opposite", "hit", "hit+near-detour"]
    found = [shows_opposite({"INCORRECT-KINDS": name}) for name in sets]
    assert found == [True, True, True, False, False]


@pytest.mark.parametrize(
    ("verdicts", "holds", "word"),
    [
        ((SHOWN, SHOWN), 9, "robust"),
        ((SHOWN, SHOWN), 8, "fragile"),
        ((ABSENT, ABSENT), 1, "not contradicted"),
        ((ABSENT, ABSENT), 2, "fragile"),
        ((REVERSED,), 0, "not contradicted"),
        ((SHOWN, ABSENT), 10, "fragile"),
        ((SHOWN, ABSENT), 0, "fragile"),
        ((INCONCLUSIVE, INCONCLUSIVE), 0, "fragile"),
        ((NOT_TESTABLE,), 10, "fragile"),
    ],
)
def test_robust_is_what_stays_the_same(verdicts: tuple[str, ...], holds: int, word: str) -> None:
    """All cells are settled and alike, and of ten specifications nine do not speak against them."""
    assert robustness(pd.DataFrame({"verdict": verdicts}), holds, 10) == word


@pytest.mark.parametrize(("id", "held_in"), [("SAVES-OPEN", (3, 5)), ("FASTER", (1, 2))])
def test_specifications_are_counted_on_the_claims_own_map(
    id: str, held_in: tuple[int, int]
) -> None:
    """The count is that of the words, of all kinds of demonstrations together."""
    assert held(EFFECTS, id) == held_in


def test_the_error_falls_to_zero_whatever_the_other_method_does() -> None:
    """A trial at the cap counts if it is one of the unified method."""
    rows = pd.DataFrame({"capped_x": [0, 0, 3], "capped": [0, 10, 3], "outcome": ["open"] * 3})
    assert counted(rows, "ZERO-OPEN") == (2, 3)
    assert counted(rows, "FASTER") == (0, 3)
