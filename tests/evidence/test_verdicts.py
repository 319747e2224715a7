from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from replication.errors import UserError
from replication.evidence import statistics
from replication.evidence.claims import (
    TESTED,
    Claim,
    ClaimError,
    Claims,
    Judging,
    criteria_hash,
    load_claims,
)
from replication.evidence.experiments import EXPERIMENTS, GENERAL, NAMED, NONE
from replication.evidence.statistics import (
    DETECTABLE,
    equivalence_p,
    holm,
    log_sd_ratio,
    mean_interval,
    mean_prediction,
    relative_equivalence_p,
    run_p,
    sd_prediction,
    sd_ratio_interval,
    share_interval,
    sign_flip_p,
    spread_equivalence_p,
    spread_p,
)
from replication.evidence.tables import write_csv
from replication.evidence.verdicts import (
    ABSENT,
    CONSISTENT,
    INCONCLUSIVE,
    INCONSISTENT,
    NOT_TESTABLE,
    REVERSED,
    SHOWN,
    by_claim,
    decide,
    judge_claims,
    judged_trials,
    read_trials,
    trials_of,
)
from replication.irl import READINGS, get_method

Array = NDArray[np.float64]

N = 40
MEASURES = (
    *("iterations", "converged", "early_collisions", "early_errors", "q_growth", "reward_growth"),
)
JUDGING = load_claims().judging
RNG = np.random.default_rng(11)
NOISE = RNG.permutation(np.tile([-3.0, -2.0, -1.0, 0.0, 0.0, 1.0, 2.0, 3.0], N // 8))
WIDE = 4 * RNG.permutation(NOISE)
WITHOUT = ("unified", "printed", NONE)
PAPER = {"unified-incorrect": (36.0, 4.0, 100), "unified": (40.0, 4.0, 100)}
MARGIN = DETECTABLE * math.sqrt(2 * 16 / 100)
"""Of a saving beside these published numbers: 0.87 iterations."""


def saves(**changed: Any) -> Claim:
    """Return the claim that x needs fewer iterations than y, or a changed one."""
    usual = {"id": "C", "claim": "c", "place": "p", "task": "open-maze", "measure": "iterations"}
    usual |= {"statistic": "saved", "x": "unified-incorrect", "y": "unified", "prediction": "any"}
    return Claim.model_validate({**usual, "paper": PAPER, **changed})


def steadier(**changed: Any) -> Claim:
    """Return the claim that the SD of x is below that of y, or a changed one."""
    return saves(**{"statistic": "sd-ratio", **changed})


def published(statistic: str, numbers: Sequence[float], **changed: Any) -> Claim:
    """Return a claim about a published number of x."""
    return saves(statistic=statistic, y="", paper={"unified-incorrect": numbers}, **changed)


def grows(**changed: Any) -> Claim:
    """Return the claim that a mean is above zero."""
    return saves(
        **{"measure": "q_growth", "statistic": "mean", "x": "unified", "y": "", "paper": {}}
        | changed
    )


def reaches_zero(**changed: Any) -> Claim:
    """Return the claim that nearly all trials converge."""
    usual = {"measure": "converged", "statistic": "share", "margin": 0.9, "paper": {}}
    return saves(**usual | changed)


def rows(key: tuple[str, str, str], **measured: Any) -> pd.DataFrame:
    """Make trials of one condition up, all converged unless it is said."""
    n = len(np.atleast_1d(np.asarray(next(iter(measured.values())))))
    usual: dict[str, Any] = dict.fromkeys(MEASURES, 1.0)
    names = dict(zip(("method", "reading", "set"), key, strict=True))
    return pd.DataFrame({"task": "open-maze", **names, "trial": np.arange(n), **usual, **measured})


def cells(x: ArrayLike | dict[tuple[str, str], Any], y: ArrayLike, **named: str) -> pd.DataFrame:
    """Make trials up: those of x, the same in all cells or by reading and set, and those of y."""
    measure = named.get("measure", "iterations")
    of = x if isinstance(x, dict) else {}
    parts = [
        rows(("unified-incorrect", f, set), **{measure: of.get((f, set), x if not of else y)})
        for set in (NAMED, GENERAL)
        for f in READINGS
    ]
    parts += [rows(("unified", f, NONE), **{measure: y}) for f in ("printed", "updated")]
    return pd.concat(parts, ignore_index=True)


def judge(measures: pd.DataFrame, *judged: Claim, **numbers: Any) -> pd.DataFrame:
    """Judge claims by the numbers of the frozen file, but for those that are given."""
    judging = Judging.model_validate({**JUDGING.model_dump(), **numbers})
    return judge_claims(measures, Claims(version=2, judging=judging, known=(), claim=judged))


def verdicts(measures: pd.DataFrame, claim: Claim) -> set[tuple[str, str]]:
    """Return the verdicts on one claim in all of its cells, and why."""
    table = judge(measures, claim)
    return {*zip(table["verdict"], table["why"], strict=True)}


# --- the rule --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("p", "p_absent", "effect", "expected"),
    [
        (0.01, 1.0, 3.0, SHOWN),
        (0.01, 1.0, -3.0, REVERSED),
        (0.01, 0.01, 0.3, ABSENT),  # different from nothing, but by less than matters
        (0.01, 0.01, -0.3, ABSENT),
        (0.90, 0.01, 0.1, ABSENT),
        (0.90, 0.90, 1.0, INCONCLUSIVE),
        (0.05, 0.05, 1.0, INCONCLUSIVE),  # below the level, not at it
        (0.01, math.nan, 1.0, SHOWN),  # a claim without a margin is never absent
        (0.90, math.nan, 1.0, INCONCLUSIVE),
        (math.nan, math.nan, 1.0, INCONCLUSIVE),
    ],
)
def test_rule_by_hand(p: float, p_absent: float, effect: float, expected: str) -> None:
    """Absent goes before shown and reversed, and inconclusive is what remains."""
    assert decide(effect, neutral=0.0, p=p, p_absent=p_absent, level=0.05) == expected


probability = st.floats(0, 1)


@given(st.floats(-9, 9), probability, probability, st.floats(0.01, 0.5))
def test_rule_is_symmetric(effect: float, p: float, p_absent: float, level: float) -> None:
    """Mirrored effects and exchanged sides turn shown into reversed, and nothing else."""
    turned = {SHOWN: REVERSED, REVERSED: SHOWN}
    numbers: dict[str, Any] = {"p": p, "p_absent": p_absent, "level": level}
    found = decide(effect, neutral=0.0, **numbers)
    if effect:
        assert decide(-effect, neutral=0.0, **numbers) == turned.get(found, found)
        other = decide(effect, neutral=0.0, less=True, **numbers)
        assert other == turned.get(found, found)
    assert (found == ABSENT) == (p_absent < level)
    assert (found in turned) == (p_absent >= level and p < level)


# --- what is saved ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("saved", "noise", "expected"),
    [
        (3.0, NOISE, SHOWN),
        (-3.0, NOISE, REVERSED),
        (0.0, NOISE / 4, ABSENT),
        (0.4, NOISE / 8, ABSENT),  # surely above zero, and surely below the margin of 0.87
        (-0.4, NOISE / 8, ABSENT),
        (0.0, WIDE, INCONCLUSIVE),
        (0.8, NOISE, INCONCLUSIVE),
    ],
)
def test_each_verdict_on_a_saving(saved: float, noise: Array, expected: str) -> None:
    """Trials that need clearly fewer, clearly more, as many, or nobody knows."""
    y = 40 + WIDE
    table = judge(cells(y + noise - saved, y), saves())
    assert set(table["verdict"]) == {expected}
    assert set(table["why"]) == {""}
    assert table["effect"].tolist() == pytest.approx([saved] * 6)
    assert table["margin"].tolist() == pytest.approx([MARGIN] * 6)
    if abs(saved) == 0.4:
        assert (table["p_holm"] < 0.05).all()


def test_a_saving_is_positive_where_x_needs_fewer() -> None:
    """Ten iterations fewer are plus ten, ours as the paper's, with their interval and tests."""
    x, y = 30 + NOISE, 40 + WIDE
    row = judge(cells(x, y), saves()).iloc[0]
    assert (row["effect"], row["paper"]) == (pytest.approx((y - x).mean()), 4.0)
    assert (row["low"], row["high"]) == pytest.approx([float(e) for e in mean_interval(y - x)])
    assert row["low"] < 10 < row["high"]
    assert (row["p"], row["p_absent"]) == (sign_flip_p(y - x), equivalence_p(y - x, MARGIN))
    assert row["verdict"] == SHOWN


@pytest.mark.parametrize("shift", [-3.0, -0.5, 0.0, 0.5, 3.0])
def test_exchanged_methods_have_the_opposite_verdict(shift: float) -> None:
    """With x and y exchanged what was shown is reversed, and all else stays."""
    turned = {SHOWN: REVERSED, REVERSED: SHOWN}
    x, y = 40 + WIDE + NOISE + shift, 40 + WIDE
    one, other = (judge(cells(*both), saves()) for both in ((x, y), (y, x)))
    assert other["verdict"].tolist() == [turned.get(v, v) for v in one["verdict"]]
    assert other["effect"].tolist() == pytest.approx((-one["effect"]).tolist())
    for name in ("p", "p_absent", "margin"):
        assert other[name].tolist() == pytest.approx(one[name].tolist())


def test_margin_may_be_given() -> None:
    """Where the paper has no SD the margin is that of the file, and no prediction is made."""
    paper = {"unified-incorrect": (7.0, math.nan, 1), "unified": (15.0, math.nan, 1)}
    x, y = 38.5 + NOISE / 4 + WIDE, 40 + WIDE
    for margin, expected in ((2.0, ABSENT), (1.0, SHOWN)):
        table = judge(cells(x, y), saves(margin=margin, paper=paper))
        assert set(table["verdict"]) == {expected}
        assert set(table["margin"]) == {margin}
        assert set(table["paper"]) == {8.0}
        assert table[["predicted_low", "predicted_high"]].isna().all(axis=None)
        assert set(table["consistent"]) == {""}


def test_margin_may_be_a_fraction_of_the_other_methods_mean() -> None:
    """A tenth of 40 is 4: a saving of 1 is absent, one of 8 shown; a tenth of 5 is less than 1."""
    claim = saves(measure="early_errors", fraction=0.1, paper={})
    for mean, saved, expected in ((40, 1.0, ABSENT), (40, 8.0, SHOWN), (5, 1.0, SHOWN)):
        y = mean + NOISE
        x = y - saved + NOISE[::-1] / 4
        table = judge(cells(x, y, measure="early_errors"), claim)
        assert set(table["verdict"]) == {expected}
        assert table["margin"].tolist() == pytest.approx([mean / 10] * 6)
        assert table["p_absent"].tolist() == [relative_equivalence_p(x, y, 0.1)] * 6
        assert table["paper"].isna().all()
        assert set(table["consistent"]) == {""}


@pytest.mark.parametrize(("off", "expected"), [(-1e-6, "yes"), (1e-6, "no")])
@pytest.mark.parametrize("side", [-1, 1])
def test_consistency_by_hand(side: int, off: float, expected: str) -> None:
    """Ours lies where it should if it is within 1.96 standard errors, the paper's and ours."""
    noise = (NOISE - NOISE.mean()) / NOISE.std(ddof=1)
    ours = 1 / math.sqrt(N)
    paper = math.sqrt(4.0**2 / 100 + 4.0**2 / 100)
    half = 1.959963984540054 * math.hypot(ours, paper)
    saved = 4.0 + side * (half + off)
    y = np.full(N, 40.0)
    row = judge(cells(y - saved + noise, y), saves()).iloc[0]
    assert (row["predicted_low"], row["predicted_high"]) == pytest.approx((4 - half, 4 + half))
    assert row["consistent"] == expected
    assert row["verdict"] == SHOWN  # consistency is no part of it


def test_consistency_hangs_on_the_papers_precision() -> None:
    """With the paper's SDs ten times as large, the same effect becomes consistent."""
    y = 40 + WIDE
    measures = cells(y - 1 + NOISE / 8, y)
    wide = {method: (mean, 40.0, n) for method, (mean, _, n) in PAPER.items()}
    found = [judge(measures, saves(paper=paper))["consistent"].iloc[0] for paper in (PAPER, wide)]
    assert found == ["no", "yes"]


# --- spread ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (NOISE, WIDE, SHOWN),
        (WIDE, NOISE, REVERSED),
        (NOISE, NOISE + 1, ABSENT),
        (NOISE, 1.3 * NOISE[::-1], INCONCLUSIVE),
    ],
)
def test_each_verdict_on_a_spread(x: Array, y: Array, expected: str) -> None:
    """Below one is the claimed side: x scatters clearly less, more, as much, or nobody knows."""
    table = judge(cells(40 + x, 40 + y), steadier())
    assert set(table["verdict"]) == {expected}
    ratio, low, high = map(float, sd_ratio_interval(x, y))
    row = table.iloc[0]
    assert (row["effect"], row["low"], row["high"]) == pytest.approx((ratio, low, high))
    assert row["effect"] == pytest.approx(x.std() / y.std())
    assert row["p"] == pytest.approx(spread_p(x, y))
    margin = math.exp(-DETECTABLE * math.sqrt(2 / (2 * 99)))
    assert row["margin"] == pytest.approx(margin)
    assert row["p_absent"] == pytest.approx(spread_equivalence_p(x, y, 1 / margin))


def test_consistency_of_a_spread() -> None:
    """The ratio of SDs is held against the paper's by its logarithm, normal as that is."""
    paper = {"unified-incorrect": (36.0, 3.0, 100), "unified": (40.0, 4.0, 100)}
    for scale, expected in ((0.75, "yes"), (0.4, "no"), (1.6, "no")):
        x, y = scale * RNG.permutation(NOISE), NOISE
        row = judge(cells(40 + x, 40 + y), steadier(paper=paper)).iloc[0]
        se = math.hypot(float(log_sd_ratio(x, y)[1]), math.sqrt(2 / (2 * 99)))
        half = 1.959963984540054 * se
        assert row["paper"] == 0.75
        assert math.log(row["predicted_low"]) == pytest.approx(math.log(0.75) - half)
        assert math.log(row["predicted_high"]) == pytest.approx(math.log(0.75) + half)
        assert row["consistent"] == expected


# --- means and shares ------------------------------------------------------------------------


@pytest.mark.parametrize(("mean", "expected"), [(2, SHOWN), (-2, REVERSED), (0, INCONCLUSIVE)])
def test_each_verdict_on_a_mean(mean: float, expected: str) -> None:
    """A mean that should be above zero; without a margin it is never absent."""
    measures = cells(np.ones(N), NOISE + mean, measure="q_growth")
    table = judge(measures, grows())
    assert table[["reading", "set"]].values.tolist() == [["printed", NONE], ["updated", NONE]]
    assert set(table["verdict"]) == {expected}
    assert table["effect"].tolist() == pytest.approx([mean, mean])
    assert table["p"].tolist() == [sign_flip_p(NOISE + mean)] * 2
    assert table[["margin", "p_absent", "paper", "predicted_low"]].isna().all(axis=None)


@pytest.mark.parametrize(
    ("done", "margin", "expected"),
    [
        (40, 0.9, SHOWN),
        (39, 0.9, INCONCLUSIVE),
        (36, 0.9, INCONCLUSIVE),
        (20, 0.9, ABSENT),
        (20, 0.2, SHOWN),
    ],
)
def test_each_verdict_on_a_share(done: int, margin: float, expected: str) -> None:
    """The smaller share is judged by its interval alone, and may have trials at the cap."""
    some = (np.arange(N) < done).astype(float)
    for x, y in ((some, np.ones(N)), (np.ones(N), some)):
        table = judge(cells(x, y, measure="converged"), reaches_zero(margin=margin))
        for row in table.to_dict("records"):
            assert (row["verdict"], row["effect"], row["capped"]) == (expected, done / N, N - done)
            assert (row["low"], row["high"]) == share_interval(done, N)
            assert math.isnan(row["p"])
            assert math.isnan(row["p_holm"])


# --- published numbers -----------------------------------------------------------------------


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(("off", "expected"), [(-1e-6, CONSISTENT), (1e-6, INCONSISTENT)])
@pytest.mark.parametrize("statistic", ["published-mean", "published-sd"])
def test_border_of_a_published_moment(statistic: str, off: float, expected: str, side: int) -> None:
    """Ours is held against where that of a new sample from the paper would lie."""
    if statistic == "published-mean":
        borders = mean_prediction(40.0, 5.0, 100, N)
        ours = borders[side] + (off if side else -off)
        sample = NOISE + ours
    else:
        borders = sd_prediction(5.0, 100, NOISE)  # depends on the kurtosis, not on the scale
        ours = borders[side] * (1 + (off if side else -off))
        sample = 40 + NOISE * ours / NOISE.std(ddof=1)
    table = judge(cells(sample, NOISE), published(statistic, (40.0, 5.0, 100)))
    assert set(table["verdict"]) == {expected}
    row = table.iloc[0]
    assert (row["predicted_low"], row["predicted_high"]) == pytest.approx(borders)
    assert row["effect"] == pytest.approx(ours)
    assert row["paper"] == (40.0 if statistic == "published-mean" else 5.0)
    assert row["low"] < ours < row["high"]
    assert math.isnan(row["p"])


@pytest.mark.parametrize("run", [20, 37, 40, 44, 73])
def test_a_single_run_gets_a_probability_and_no_verdict(run: float) -> None:
    """However far out the paper's run is among ours, it is only said how probable that is."""
    table = judge(cells(40 + NOISE, NOISE), published("published-run", (run, math.nan, 1)))
    assert len(table) == 6
    for row in table.to_dict("records"):
        assert (row["verdict"], row["why"]) == ("", "a single run: only how probable it is")
        assert row["p"] == run_p(40 + NOISE, run)
        assert math.isnan(row["p_holm"])
        assert (row["effect"], row["paper"], row["consistent"]) == (40.0, run, "")
        assert (row["low"], row["high"]) == (37.0, 43.0)
    assert (run_p(40 + NOISE, run) < 0.05) == (run not in (37, 40))


# --- what cannot be judged -------------------------------------------------------------------


def test_used_numbers_get_no_verdict() -> None:
    """A number that made a choice is shown in every cell and judged in none."""
    claim = published("published-mean", (40.0, 3.0, 100), used="it chose", prediction="")
    table = judge(cells(40 + NOISE, NOISE), claim)
    assert {*zip(table["verdict"], table["why"], strict=True)} == {(NOT_TESTABLE, "it chose")}
    assert len(table) == 6
    assert table["effect"].notna().all()
    assert set(table["consistent"]) == {"yes"}


def test_few_trials_get_no_verdict() -> None:
    """Below 30 trials nothing is judged, however clear it looks; the numbers are there."""
    few, enough = (cells(40 + NOISE[:n], 60 + NOISE[:n]) for n in (29, 30))
    assert verdicts(few, saves()) == {(NOT_TESTABLE, "29 trials; 30 are needed")}
    assert verdicts(enough, saves()) == {(SHOWN, "")}
    assert judge(few, saves())["effect"].tolist() == [20.0] * 6
    assert set(judge(few, saves(), fewest=5)["verdict"]) == {SHOWN}


@pytest.mark.parametrize("claim", [saves(), steadier(), published("published-mean", (40, 3, 100))])
def test_trials_at_the_cap_get_no_verdict(claim: Claim) -> None:
    """With one trial at the cap its cell has no effect and no verdict; the others have."""
    measures = cells(40 + NOISE, 60 + WIDE)
    own = (measures["reading"] == "updated") & (measures["set"] == GENERAL)
    measures.loc[own & (measures["trial"] == 3), "converged"] = 0.0
    table = judge(measures, claim).set_index(["reading", "set"])
    row = table.loc["updated", GENERAL]
    assert (row["verdict"], row["why"]) == (NOT_TESTABLE, "1 trials at the iteration cap")
    assert table["capped"].tolist() == [0, 0, 0, 0, 1, 0]
    empty = ["effect", "low", "high", "p", "p_absent", "p_holm", "p_absent_holm"]
    assert row[empty].astype(float).isna().all()
    others = table.drop(index=("updated", GENERAL))
    assert others["effect"].notna().all()
    assert NOT_TESTABLE not in set(others["verdict"])
    if claim.statistic in TESTED:  # five cells are five tests
        assert others["p_holm"].tolist() == holm(others["p"].tolist()).tolist()


def test_caps_of_the_other_method_count_only_where_it_is_compared() -> None:
    """A trial of another method at the cap takes nothing from a claim about x alone."""
    measures = cells(40 + NOISE, 60 + WIDE)
    measures.loc[measures["method"] == "unified", "converged"] = 0.0
    table = judge(measures, saves(), published("published-mean", (40, 3, 100), id="MEAN"))
    assert table["capped"].tolist() == [N] * 6 + [0] * 6
    assert table["verdict"].tolist() == [NOT_TESTABLE] * 6 + [CONSISTENT] * 6


@pytest.mark.parametrize("claim", [steadier(), published("published-sd", (40, 3, 100))])
def test_trials_that_do_not_vary_have_no_spread_to_judge(claim: Claim) -> None:
    """Constant samples have no ratio of SDs and no interval of an SD."""
    for y in (np.full(N, 40.0), 60 + WIDE):
        found = verdicts(cells(np.full(N, 30.0), y), claim)
        assert found == {(NOT_TESTABLE, "the trials do not vary")}


def test_constant_difference_is_judged() -> None:
    """If every trial saves one, or none, the difference is its own interval."""
    assert verdicts(cells(39 + WIDE, 40 + WIDE), saves()) == {(SHOWN, "")}
    assert verdicts(cells(40 + WIDE, 40 + WIDE), saves()) == {(ABSENT, "")}


def test_missing_method_is_an_error() -> None:
    """A claim about a method without trials says which notebook to run."""
    with pytest.raises(ClaimError, match="no trials of adaboost on open-maze: run the notebook op"):
        judge(cells(NOISE, NOISE), saves(y="adaboost", paper={}, fraction=0.1))


# --- cells -----------------------------------------------------------------------------------


def test_cells_are_judged_by_their_own_trials() -> None:
    """Each reading and set has its own trials of x; the printed ones of y stand beside at-once."""
    y = {"printed": 50 + NOISE, "updated": 70 + WIDE}
    saved = {
        (f, set): 2.0 + 3 * i + 10 * j
        for j, set in enumerate((NAMED, GENERAL))
        for i, f in enumerate(READINGS)
    }
    parts = [rows(("unified", f, NONE), iterations=counts) for f, counts in y.items()]
    for (f, set), mean in saved.items():
        base = y["updated" if f == "updated" else "printed"]
        parts.append(rows(("unified-incorrect", f, set), iterations=base - mean + NOISE[::-1]))
    parts.append(rows(("unified-incorrect", "printed", "hit"), iterations=0 * NOISE))
    table = judge(pd.concat(parts), saves())
    assert list(zip(table["reading"], table["set"], strict=True)) == list(saved)
    assert table["effect"].tolist() == pytest.approx(list(saved.values()))


def test_method_without_a_trace_stands_beside_each_cell() -> None:
    """AdaBoost-IRL has one set of trials, against which all cells are compared."""
    measures = pd.concat(
        [cells(40 + NOISE, 45 + NOISE), rows(("adaboost", "", NONE), iterations=WIDE + 50)]
    )
    paper = {"adaboost": (45.0, 10.0, 100)}
    for x, shift, n in (("unified-incorrect", 10, 6), ("unified", 5, 2)):
        claim = saves(x=x, y="adaboost", paper=paper | {x: (40.0, 4.0, 100)})
        table = judge(measures, claim)
        assert table["effect"].tolist() == pytest.approx([shift] * n)


@pytest.mark.parametrize("method", ["adaboost", "unified", "unified-incorrect"])
@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("set", [NAMED, GENERAL])
def test_trials_of_a_cell(method: str, reading: str, set: str) -> None:
    """A reading or set that a method does not have is replaced as Method.under says, or by none."""
    keys = [("adaboost", "", NONE), *(("unified", f, NONE) for f in ("printed", "updated"))]
    keys += [("unified-incorrect", f, each) for f in READINGS for each in (NAMED, GENERAL, "hit")]
    every = pd.concat([rows(key, iterations=NOISE) for key in keys])
    every = pd.concat([every.assign(task="obstacle-maze"), every]).sample(frac=1, random_state=1)
    own = trials_of(every, "open-maze", method, reading, set)
    used = get_method(method)
    expected = (used.under(reading), set if used.uses_incorrect else NONE)
    assert {*zip(own["reading"], own["set"], strict=True)} == {expected}
    assert own["trial"].tolist() == list(range(N))
    assert {*own["task"]} == {"open-maze"}


def test_trials_are_paired_by_their_number() -> None:
    """Only trials of both methods count, each against the one with its own seed."""
    y = 40 + WIDE
    x = y - 5 + NOISE / 8
    measures = cells(x, y)
    paired = judge(measures, saves())
    shuffled = measures.sample(frac=1.0, random_state=3)
    pd.testing.assert_frame_equal(judge(shuffled, saves()), paired)
    some = measures[(measures["method"] != "unified") | (measures["trial"] >= 7)]
    more = pd.concat([some, rows(("unified", "printed", NONE), iterations=[999.0]).assign(trial=N)])
    table = judge(more, saves())
    assert set(table["n"]) == {N - 7}
    assert table["effect"].tolist() == pytest.approx([(y - x)[7:].mean()] * 6)
    apart = measures.copy()
    apart.loc[apart["method"] == "unified", "trial"] = np.tile(RNG.permutation(N), 2)
    assert judge(apart, saves())["p"].iloc[0] != paired["p"].iloc[0]


# --- several tests ---------------------------------------------------------------------------


def test_holm_is_over_the_cells_of_a_claim() -> None:
    """Both p-values are adjusted over the cells of their claim, apart, and over no other claim."""
    rng = np.random.default_rng(3)
    y = 40 + WIDE
    keys = [(f, set) for set in (NAMED, GENERAL) for f in READINGS]
    x = {key: y - k / 6 + rng.normal(0, 2, N) for k, key in enumerate(keys)}
    alone = judge(cells(x, y), saves())
    for name in ("p", "p_absent"):
        expected = holm(alone[name].tolist())
        assert alone[f"{name}_holm"].tolist() == pytest.approx(expected.tolist())
        assert (alone[f"{name}_holm"] > alone[name]).any()
    assert alone["p_holm"].nunique() > 1
    many = judge(cells(x, y), *(saves(id=f"C{n}") for n in range(3)))
    for _, part in by_claim(many):
        assert part["p_holm"].tolist() == alone["p_holm"].tolist()
        assert part["p_absent_holm"].tolist() == alone["p_absent_holm"].tolist()
        assert part["verdict"].tolist() == alone["verdict"].tolist()


def test_one_cell_of_six_needs_more() -> None:
    """What one test would show, or call absent, is inconclusive as one of six chances."""
    y = 40 + WIDE
    keys = [(f, set) for set in (NAMED, GENERAL) for f in READINGS]
    alike = dict.fromkeys(keys, y - 0.95 + 2.2 * NOISE[::-1])
    row = judge(cells(alike, y), saves()).iloc[0]
    assert min(row["p"], row["p_absent"]) > 0.05  # and so in the other five
    for saved, noise, name, alone in ((1.1, 1.4, "p", SHOWN), (0.3, 0.95, "p_absent", ABSENT)):
        x = alike | {("printed", NAMED): y - saved + noise * NOISE}
        row = judge(cells(x, y), saves()).iloc[0]
        assert 0.05 / 6 < row[name] < 0.05
        assert row["verdict"] == INCONCLUSIVE
        numbers = {"p": row["p"], "p_absent": row["p_absent"]}
        assert decide(row["effect"], neutral=0.0, level=0.05, **numbers) == alone


# --- the table -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def whole() -> pd.DataFrame:
    """Make measures of all tasks, methods, readings and sets up."""
    rng = np.random.default_rng(5)
    parts = []
    means = {"adaboost": 45, "unified": 40, "unified-incorrect": 36}
    for task, experiment in EXPERIMENTS.items():
        n = {"soccer": 50}.get(task, 100)
        for method in experiment.methods:
            uses = get_method(method).uses_incorrect
            for reading in get_method(method).readings:
                for set in experiment.sets if uses else [NONE]:
                    measured: dict[str, Any] = {name: rng.normal(5, 1.0, n) for name in MEASURES}
                    measured["iterations"] = means[method] + rng.integers(-6, 7, n)
                    measured["converged"] = np.ones(n)
                    parts.append(rows((method, reading, set), **measured).assign(task=task))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(scope="module")
def judged(whole: pd.DataFrame) -> pd.DataFrame:
    """Judge all claims of the frozen file by made-up measures."""
    return judge_claims(whole, load_claims())


def test_every_claim_has_a_row_for_each_cell(judged: pd.DataFrame) -> None:
    """Rows stand in the order of the file and of its claims' cells."""
    expected = [(one.id, *cell) for one in load_claims().claim for cell in one.cells()]
    found = judged[["id", "reading", "set"]].itertuples(index=False, name=None)
    assert list(found) == expected
    assert [id for id, _ in by_claim(judged)] == [one.id for one in load_claims().claim]
    assert set(judged["criteria"]) == {criteria_hash()}
    for one in load_claims().claim:
        own = judged[judged["id"] == one.id]
        if one.used:
            possible = {NOT_TESTABLE}
        elif one.statistic == "published-run":
            possible = {""}
        elif one.is_published:
            possible = {CONSISTENT, INCONSISTENT}
        else:
            possible = {SHOWN, ABSENT, REVERSED, INCONCLUSIVE}
        assert set(own["verdict"]) <= possible
        assert set(own["task"]) == {one.task}
        assert set(own["place"]) == {one.place}


def test_p_values_stand_where_there_is_a_test(judged: pd.DataFrame) -> None:
    """Only what is tested has adjusted p-values; absence is tested where there is a margin."""
    tested = judged["statistic"].isin(TESTED)
    assert judged["p_holm"].notna().tolist() == tested.tolist()
    assert (
        judged["p_absent_holm"].notna().tolist()
        == (tested & (judged["statistic"] != "mean")).tolist()
    )
    for _, part in by_claim(judged[tested]):
        assert part["p_holm"].tolist() == pytest.approx(holm(part["p"].tolist()).tolist())
    assert judged["margin"].notna().tolist() == (
        judged["statistic"].isin(["saved", "sd-ratio", "share"]).tolist()
    )


SOME = ["SAVES-OPEN", "STEADIER", "ERRS-SOCCER", "Q-GROWS", "ZERO-OBSTACLES", "SD-INCORRECT-OPEN"]
"""A claim of each kind."""


def some_of(judged: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of some claims."""
    return judged[judged["id"].isin(SOME)].reset_index(drop=True)


def judge_some(whole: pd.DataFrame) -> pd.DataFrame:
    """Judge some claims of the frozen file."""
    return some_of(judge(whole, *(one for one in load_claims().claim if one.id in SOME)))


def test_order_of_the_rows_changes_nothing(judged: pd.DataFrame, whole: pd.DataFrame) -> None:
    """The measures may stand in any order, and other claims beside: trials have their numbers."""
    shuffled = whole.sample(frac=1.0, random_state=3)
    pd.testing.assert_frame_equal(judge_some(shuffled), some_of(judged))


def test_trials_may_be_exchanged_together(judged: pd.DataFrame, whole: pd.DataFrame) -> None:
    """If all methods' trials are numbered anew in the same way, no number changes."""
    order = np.random.default_rng(8).permutation(1000)
    due, found = some_of(judged), judge_some(whole.assign(trial=order[whole["trial"]]))
    names = ["effect", "low", "high", "p", "p_absent", "p_holm", "predicted_low"]
    np.testing.assert_allclose(
        found[names].to_numpy(float), due[names].to_numpy(float), rtol=1e-9, atol=1e-12
    )
    assert found["verdict"].tolist() == due["verdict"].tolist()


def test_no_verdict_hangs_on_the_permutations(
    judged: pd.DataFrame, whole: pd.DataFrame, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another seed of the sign flips moves p-values by less than 0.01, and no verdict here."""
    monkeypatch.setattr(statistics, "FLIP_SEED", statistics.FLIP_SEED + 1)
    other = judge_claims(whole, load_claims())
    moved = (judged["p"] - other["p"]).abs().dropna()
    assert 0 < moved.max() < 0.01
    assert other["verdict"].tolist() == judged["verdict"].tolist()
    for name in ("effect", "low", "high", "p_absent", "margin", "predicted_low", "consistent"):
        assert other[name].equals(judged[name])  # nothing else is random


# --- what is read ----------------------------------------------------------------------------


def test_judged_trials_are_those_of_the_file() -> None:
    """Of tables of trials only the judged sets count, and as many trials as are declared."""
    parts = []
    for task, n in JUDGING.trials.items():
        sets = EXPERIMENTS[task].sets
        keys = [WITHOUT, *(("unified-incorrect", "printed", set) for set in (*sets, "hit"))]
        parts += [rows(key, iterations=np.ones(n + 5)).assign(task=task) for key in keys]
    trials = judged_trials(pd.concat(parts), JUDGING)
    for (task, set), part in trials.groupby(["task", "set"]):
        assert part["trial"].tolist() == list(range(JUDGING.trials[task]))
        assert set in (NONE, *EXPERIMENTS[str(task)].sets)
    assert len(trials.groupby(["task", "set"])) == 3 + 3 + 2


def test_trials_of_one_seed_are_judged_together(tmp_path: Path) -> None:
    """Experiments that were run with different root seeds are refused, each with its seed."""
    for number, task in enumerate(EXPERIMENTS):
        table = pd.DataFrame({"task": [task], "seed": 5, "iterations": number})
        write_csv(table, tmp_path / task.replace("-", "_") / "trials.csv")
    assert read_trials(tmp_path)["iterations"].tolist() == [0, 1, 2]
    write_csv(table.assign(seed=6), tmp_path / "soccer" / "trials.csv")
    with pytest.raises(UserError, match=r"open_maze 5, obstacle_maze 5, soccer 6\); use one"):
        read_trials(tmp_path)
