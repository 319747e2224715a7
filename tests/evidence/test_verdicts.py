from __future__ import annotations

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
from replication.evidence.claims import (
    MEASURES,
    Claim,
    ClaimError,
    Claims,
    Judging,
    criteria_hash,
    load_claims,
)
from replication.evidence.experiments import EXPERIMENTS
from replication.evidence.statistics import (
    compare,
    holm,
    mean_prediction,
    sd_prediction,
    share_interval,
)
from replication.evidence.tables import write_csv
from replication.evidence.verdicts import (
    NOT_REPRODUCED,
    NOT_TESTABLE,
    PARTLY,
    REPRODUCED,
    REVERSED,
    UNDECIDED,
    by_claim,
    decide,
    judge_claims,
    judged_trials,
    overall,
    read_trials,
)
from replication.irl import READINGS, get_method

N = 40
VERDICTS = [REPRODUCED, REVERSED, UNDECIDED, NOT_REPRODUCED, NOT_TESTABLE]
RNG = np.random.default_rng(11)
NOISE = RNG.permutation(np.tile([-3.0, -2.0, -1.0, 0.0, 0.0, 1.0, 2.0, 3.0], N // 8))
WIDE = 4 * RNG.permutation(NOISE)


def faster(**changed: Any) -> Claim:
    """Return the claim that x needs fewer iterations than y, or a changed one."""
    usual = {"id": "C", "claim": "c", "place": "p", "task": "open-maze", "measure": "iterations"}
    usual |= {"statistic": "mean-difference", "x": "unified-incorrect", "y": "unified"}
    usual |= {"direction": "less", "test": "signed-rank"}
    return Claim.model_validate({**usual, **changed})


def steadier(**changed: Any) -> Claim:
    """Return the claim that the SD of x is below that of y, or a changed one."""
    usual = {"statistic": "sd-ratio", "test": "brown-forsythe", "margin": 1.0}
    return faster(**usual | changed)


def published(statistic: str, numbers: Sequence[float], **changed: Any) -> Claim:
    """Return a claim about a published number of x."""
    return faster(
        statistic=statistic,
        y="",
        direction="inside",
        test="none",
        paper={"unified-incorrect": numbers},
        **changed,
    )


def rows(method: str, reading: str = "printed", **measured: Any) -> pd.DataFrame:
    """Make trials of one method up, all converged unless it is said."""
    n = len(np.atleast_1d(np.asarray(next(iter(measured.values())))))
    usual: dict[str, Any] = dict.fromkeys(MEASURES, 1.0)
    key = {"task": "open-maze", "method": method, "reading": reading, "trial": np.arange(n)}
    return pd.DataFrame({**key, **usual, **measured})


def pair(x: ArrayLike, y: ArrayLike, measure: str = "iterations") -> pd.DataFrame:
    """Make trials of both methods up under one reading of Eq. 9."""
    both = (("unified-incorrect", x), ("unified", y))
    return pd.concat([rows(method, "printed", **{measure: counts}) for method, counts in both])


def judge(measures: pd.DataFrame, *judged: Claim) -> pd.DataFrame:
    """Judge claims by the numbers of the frozen file."""
    judging = load_claims().judging
    return judge_claims(measures, Claims(judging=judging, explored=(), claim=judged))


def verdict(measures: pd.DataFrame, claim: Claim) -> tuple[str, str]:
    """Return the verdict on one claim alone, and why."""
    row = judge(measures, claim).iloc[0]
    return row["verdict"], row["why"]


# --- each verdict ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shift", "expected"), [(-3.0, REPRODUCED), (3.0, REVERSED), (0.0, NOT_REPRODUCED)]
)
def test_difference(shift: float, expected: str) -> None:
    """Trials that are clearly fewer, clearly more, or as many."""
    y = 40 + WIDE
    why = "the interval includes the margin" if expected == NOT_REPRODUCED else ""
    assert verdict(pair(y + NOISE + shift, y), faster()) == (expected, why)


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [(NOISE, WIDE, REPRODUCED), (WIDE, NOISE, REVERSED), (NOISE, NOISE[::-1], NOT_REPRODUCED)],
)
def test_spread(x: NDArray[np.float64], y: NDArray[np.float64], expected: str) -> None:
    """Trials that scatter clearly less, clearly more, or as much."""
    assert verdict(pair(40 + x, 40 + y), steadier())[0] == expected


@pytest.mark.parametrize(
    ("mean", "expected"), [(2, REPRODUCED), (-2, REVERSED), (0, NOT_REPRODUCED)]
)
def test_mean_against_its_margin(mean: float, expected: str) -> None:
    """A mean that should be above its margin, whatever the margin is."""
    for margin in (0.0, 7.0):
        claim = faster(
            measure="q_growth", statistic="mean", y="", direction="greater", margin=margin
        )
        table = judge(rows("unified-incorrect", q_growth=NOISE + mean + margin), claim)
        assert table["verdict"].item() == expected
        assert table["effect"].item() == pytest.approx(mean + margin)
        assert table["low"].item() < mean + margin < table["high"].item()
        assert np.isnan(table["fewer"].item())


@pytest.mark.parametrize(
    ("done", "margin", "expected"),
    [(40, 0.9, REPRODUCED), (39, 0.9, NOT_REPRODUCED), (20, 0.9, REVERSED), (20, 0.2, REPRODUCED)],
)
def test_share(done: int, margin: float, expected: str) -> None:
    """The smaller share is judged by its interval alone, and may have trials at the cap."""
    claim = faster(
        measure="converged", statistic="share", direction="greater", margin=margin, test="none"
    )
    some = (np.arange(N) < done).astype(float)
    for x, y in ((some, np.ones(N)), (np.ones(N), some)):
        row = judge(pair(x, y, "converged"), claim).iloc[0]
        assert (row["verdict"], row["effect"], row["capped"]) == (expected, done / N, N - done)
        assert (row["low"], row["high"]) == share_interval(done, N)
        assert np.isnan(row["p"])


@pytest.mark.parametrize(("saved", "word"), [(0.2, "and"), (5.0, "but not")])
def test_why_a_published_effect_is_not_reproduced(saved: float, word: str) -> None:
    """It is said whether the interval leaves room for the published effect, too."""
    paper = {"unified-incorrect": (40 - saved, 3.0, 100), "unified": (40.0, 3.0, 100)}
    found = verdict(pair(40 + NOISE + WIDE, 40 + WIDE), faster(paper=paper))
    said = f"the interval includes the margin, {word} the published effect"
    assert found == (NOT_REPRODUCED, said)


@pytest.mark.parametrize(
    ("difference", "expected"),
    [
        ([-1.0] * 36 + [12.0] * 4, "the test rejects, but the interval includes the margin"),
        (
            [1.0] * 18 + [-1.0] * 17 + [-10.0] * 5,
            "the interval excludes the margin, but the test does not reject",
        ),
    ],
)
def test_undecided_where_interval_and_test_disagree(difference: list[float], expected: str) -> None:
    """A few trials that are far off move the mean but not the ranks, or hide their difference."""
    found = verdict(pair(40 + np.array(difference), np.full(N, 40.0)), faster())
    assert found == (UNDECIDED, expected)


def test_undecided_by_the_number_of_claims() -> None:
    """What is reproduced alone is undecided among many claims, by Holm's adjustment."""
    measures = pair(40 + 1.3 * NOISE - 0.9, np.full(N, 40.0))
    assert 0.01 < judge(measures, faster())["p"].item() < 0.05
    assert verdict(measures, faster())[0] == REPRODUCED
    many = judge(measures, *(faster(id=f"C{n}") for n in range(10)))
    assert set(many["verdict"]) == {UNDECIDED}
    assert many["p_holm"].tolist() == pytest.approx([min(1.0, 10 * many["p"].iloc[0])] * 10)


def test_few_trials_get_no_verdict() -> None:
    """Below 30 trials nothing is judged, however clear it looks."""
    few, enough = (verdict(pair(40 + NOISE[:n], 60 + NOISE[:n]), faster()) for n in (29, 30))
    assert few == (NOT_TESTABLE, "29 trials; 30 are needed")
    assert enough == (REPRODUCED, "")


@pytest.mark.parametrize("claim", [faster(), steadier(), published("published-mean", (40, 3, 100))])
def test_trials_at_the_cap_get_no_verdict(claim: Claim) -> None:
    """With one trial at the cap there is no effect, no interval and no verdict; it is counted."""
    measures = pair(40 + NOISE, 60 + WIDE)
    at = (measures["method"] == "unified-incorrect") & (measures["trial"] == 3)
    measures.loc[at, "converged"] = 0.0
    row = judge(measures, claim).iloc[0]
    assert (row["verdict"], row["why"]) == (NOT_TESTABLE, "1 trials at the iteration cap")
    assert row["capped"] == 1
    assert np.isnan(row[["effect", "low", "high", "p", "p_holm"]].astype(float)).all()


def test_caps_of_the_other_method_count_only_where_it_is_compared() -> None:
    """A trial of another method at the cap takes nothing from a claim about x alone."""
    measures = pair(40 + NOISE, 60 + WIDE)
    measures.loc[measures["method"] == "unified", "converged"] = 0.0
    table = judge(measures, faster(), published("published-run", (40, np.nan, 1), id="RUN"))
    assert table["capped"].tolist() == [N, 0]
    assert table["verdict"].tolist() == [NOT_TESTABLE, REPRODUCED]


@pytest.mark.parametrize("claim", [steadier(), published("published-sd", (40, 3, 100))])
def test_trials_that_do_not_vary_have_no_spread_to_judge(claim: Claim) -> None:
    """Constant samples have no ratio of SDs and no interval of an SD."""
    for y in (np.full(N, 40.0), 60 + WIDE):
        found = verdict(pair(np.full(N, 30.0), y), claim)
        assert found == (NOT_TESTABLE, "the trials do not vary")


def test_constant_difference_is_judged() -> None:
    """If every trial is one fewer the difference is its own interval."""
    assert verdict(pair(39 + WIDE, 40 + WIDE), faster())[0] == REPRODUCED
    assert verdict(pair(40 + WIDE, 40 + WIDE), faster())[0] == NOT_REPRODUCED


@pytest.mark.parametrize(
    ("used", "judged"),
    [
        ({"printed": "why"}, [False, True]),
        ({"updated": "why"}, [True, False]),
        ({"all": "why"}, [False, False]),
        ({}, [True, True]),
    ],
)
def test_used_numbers_get_no_verdict(used: dict[str, str], judged: list[bool]) -> None:
    """A number that made a choice is not judged: under one reading, or under all."""
    measures = pd.concat([rows("unified-incorrect", f, iterations=40 + NOISE) for f in READINGS])
    table = judge(measures, published("published-mean", (40.0, 3.0, 100), used=used))
    assert table["reading"].tolist() == list(READINGS)
    assert table["verdict"].tolist() == [REPRODUCED if each else NOT_TESTABLE for each in judged]
    assert table["why"].tolist() == ["" if each else "why" for each in judged]
    assert table["effect"].notna().all()


# --- published numbers -----------------------------------------------------------------------


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(("off", "expected"), [(-1e-6, REPRODUCED), (1e-6, NOT_REPRODUCED)])
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
    claim = published(statistic, (40.0, 5.0, 100))
    row = judge(rows("unified-incorrect", iterations=sample), claim).iloc[0]
    assert row["verdict"] == expected
    assert (row["predicted_low"], row["predicted_high"]) == pytest.approx(borders)
    assert row["effect"] == pytest.approx(ours)
    assert row["low"] < ours < row["high"]
    assert np.isnan(row["p"])


@pytest.mark.parametrize(
    ("run", "expected"),
    [(37, REPRODUCED), (43, REPRODUCED), (36, NOT_REPRODUCED), (44, NOT_REPRODUCED)],
)
def test_border_of_a_published_run(run: float, expected: str) -> None:
    """A single run of the paper's should lie in the central 95 % of our trials."""
    table = judge(
        rows("unified-incorrect", iterations=40 + NOISE), published("published-run", (run, 0.0, 1))
    )
    assert (table["low"].item(), table["high"].item()) == (37.0, 43.0)
    assert (table["verdict"].item(), table["paper"].item()) == (expected, run)
    assert table["effect"].item() == 40.0


# --- the table -------------------------------------------------------------------------------


def test_main_conditions_are_judged() -> None:
    """Of tables of trials only the default sets count, and as many trials as are declared."""
    judging = load_claims().judging
    default = {"open-maze": "hit+detour", "obstacle-maze": "hit+detour", "soccer": "all"}
    parts = [
        rows(method, iterations=np.ones(n + 5)).assign(task=task, set=kinds)
        for task, n in judging.trials.items()
        for method, sets in (("unified", ["none"]), ("unified-incorrect", ["hit", default[task]]))
        for kinds in sets
    ]
    trials = judged_trials(pd.concat(parts), judging)
    for (task, method), part in trials.groupby(["task", "method"]):
        assert part["trial"].tolist() == list(range(judging.trials[task]))
        assert set(part["set"]) == {"none" if method == "unified" else default[str(task)]}


@pytest.fixture(scope="module")
def whole() -> pd.DataFrame:
    """Make measures of all tasks, methods and readings up."""
    rng = np.random.default_rng(5)
    parts = []
    means = {"adaboost": 45, "unified": 40, "unified-incorrect": 36}
    for task, n in load_claims().judging.trials.items():
        for method, mean in means.items():
            for reading in get_method(method).readings:
                measured: dict[str, Any] = {name: rng.normal(0.5, 1.0, n) for name in MEASURES}
                measured["iterations"] = mean + rng.integers(-6, 7, n)
                measured["converged"] = np.ones(n)
                parts.append(rows(method, reading, **measured).assign(task=task))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(scope="module")
def judged(whole: pd.DataFrame) -> pd.DataFrame:
    """Judge all claims of the frozen file by made-up measures."""
    return judge_claims(whole, load_claims())


def test_every_claim_has_a_row_for_each_reading(judged: pd.DataFrame) -> None:
    """Rows stand in the order of the file; a method without a trace has one."""
    expected = [
        (one.id, reading) for one in load_claims().claim for reading in get_method(one.x).readings
    ]
    assert list(judged[["id", "reading"]].itertuples(index=False, name=None)) == expected
    assert [id for id, _ in by_claim(judged)] == [one.id for one in load_claims().claim]
    assert set(judged["verdict"]) <= set(VERDICTS)
    assert set(judged["criteria"]) == {criteria_hash()}
    assert set(judged[judged["id"] == "MEAN-ADABOOST-OPEN"]["verdict"]) == {NOT_TESTABLE}


def test_holm_is_over_all_tests_of_the_table(judged: pd.DataFrame) -> None:
    """The adjusted p-values are Holm's of all p-values; where there is no test there is none."""
    tested = judged["p"].notna()
    assert tested.sum() == 22
    assert (judged["test"] != "none").tolist() == tested.tolist()
    assert judged.loc[tested, "p_holm"].tolist() == holm(judged.loc[tested, "p"].tolist()).tolist()
    assert judged.loc[~tested, "p_holm"].isna().all()


def test_effects_are_those_of_the_comparison(judged: pd.DataFrame, whole: pd.DataFrame) -> None:
    """Differences, ratios of SDs, intervals and p-values are those of statistics.compare."""
    compared = judged[judged["statistic"].isin(["mean-difference", "sd-ratio"])]
    assert len(compared) == 16
    for row in compared.itertuples():
        own = whole[whole["task"] == row.task]
        x, y = (
            own[(own["method"] == name) & own["reading"].isin([row.reading, ""])][row.measure]
            for name in (row.x, row.y)
        )
        found = compare(x, y)
        if row.statistic == "sd-ratio":
            expected = found.sd_ratio, found.sd_low, found.sd_high, found.p_spread
        else:
            expected = found.difference, found.low, found.high, found.p
            assert row.fewer == found.fewer
        assert (row.effect, row.low, row.high, row.p) == expected


def test_order_of_the_rows_changes_nothing(judged: pd.DataFrame, whole: pd.DataFrame) -> None:
    """The measures may stand in any order: trials are paired by their number."""
    shuffled = whole.sample(frac=1.0, random_state=3)
    pd.testing.assert_frame_equal(judge_claims(shuffled, load_claims()), judged)


def test_trials_may_be_exchanged_together(whole: pd.DataFrame) -> None:
    """If all methods' trials are numbered anew in the same way, no effect and no test changes."""
    one = load_claims().by_id
    some = [one("SAVES-OPEN"), one("STEADIER"), one("MEAN-INCORRECT-OPEN"), one("ZERO-OPEN")]
    own = whole[whole["task"] == "open-maze"]
    order = np.random.default_rng(8).permutation(100)
    other = own.assign(trial=order[own["trial"].to_numpy()])
    names = ["effect", "p", "p_holm", "fewer"]
    first, second = judge(own, *some), judge(other, *some)
    exact = first["statistic"] != "sd-ratio"
    pd.testing.assert_frame_equal(first.loc[exact, names], second.loc[exact, names])
    np.testing.assert_allclose(
        first[names].to_numpy(float), second[names].to_numpy(float), rtol=1e-12
    )


@pytest.mark.parametrize("shift", [-3.0, -0.5, 0.0, 0.5, 3.0])
def test_exchanged_methods_have_the_opposite_verdict(shift: float) -> None:
    """With x and y exchanged what was reproduced is reversed, and all else stays."""
    mirrored = {REPRODUCED: REVERSED, REVERSED: REPRODUCED}
    x, y = 40 + WIDE + NOISE + shift, 40 + WIDE
    one, other = judge(pair(x, y), faster()).iloc[0], judge(pair(y, x), faster()).iloc[0]
    assert other["verdict"] == mirrored.get(one["verdict"], one["verdict"])
    assert (other["effect"], other["p"]) == pytest.approx((-one["effect"], one["p"]))
    assert one["fewer"] == pytest.approx(1 - other["fewer"])
    greater = judge(pair(y, x), faster(direction="greater")).iloc[0]
    assert greater["verdict"] == one["verdict"]


def test_method_without_a_trace_stands_beside_both_readings() -> None:
    """AdaBoost-IRL has one set of trials, against which both readings of Eq. 9 are compared."""
    measures = pd.concat(
        [
            rows("unified", "printed", iterations=40 + NOISE),
            rows("unified", "updated", iterations=50 + NOISE),
            rows("adaboost", "", iterations=45 + NOISE[::-1]),
        ]
    )
    table = judge(measures, faster(x="unified", y="adaboost"))
    assert table["effect"].tolist() == pytest.approx([-5.0, 5.0])
    assert table["verdict"].tolist() == [REPRODUCED, REVERSED]


def test_missing_trials_are_an_error() -> None:
    """A claim whose methods were not run cannot be judged: one line names the notebook to run."""
    with pytest.raises(ClaimError, match=r"open-maze: run the notebook open_maze first$"):
        judge(rows("unified", iterations=40 + NOISE).assign(task="soccer"), faster())
    with pytest.raises(ClaimError, match="no trials of unified on open-maze"):
        judge(rows("unified-incorrect", iterations=40 + NOISE), faster())
    with pytest.raises(ClaimError, match="no trials of unified-incorrect on open-maze"):
        judge(rows("unified", iterations=40 + NOISE), faster())


# --- both readings together ------------------------------------------------------------------


def test_calibrated_pair_gets_no_verdict(judged: pd.DataFrame) -> None:
    """What the defaults were calibrated on is not judged, not even by the other reading."""
    for id in ("MEAN-UNIFIED-OPEN", "SD-UNIFIED-OPEN"):
        own = judged[judged["id"] == id]
        assert own["verdict"].tolist()[0] == NOT_TESTABLE != own["verdict"].tolist()[1]
        assert overall(own["verdict"].tolist()) == NOT_TESTABLE


@given(st.lists(st.sampled_from(VERDICTS), min_size=1, max_size=2))
def test_verdict_on_the_claim_as_a_whole(verdicts: list[str]) -> None:
    """What all readings agree on stays; one that cannot be tested leaves no verdict at all."""
    found, distinct = overall(verdicts), set(verdicts)
    assert found == overall(verdicts[::-1]) == overall(verdicts * 2)
    if NOT_TESTABLE in distinct:
        assert found == NOT_TESTABLE
    elif len(distinct) == 1:
        assert found == verdicts[0]
    else:
        assert (found == PARTLY) == (REPRODUCED in distinct)
        assert (found == UNDECIDED) == (UNDECIDED in distinct and REPRODUCED not in distinct)
        assert found in (PARTLY, UNDECIDED, NOT_REPRODUCED)


NUMBERS = st.floats(-5, 5)


@given(NUMBERS, NUMBERS, st.sampled_from([0.001, 0.0499, 0.0501, 0.9, np.nan]))
def test_decision_mirrors(one: float, other: float, p: float) -> None:
    """The interval on the other side of the margin, or the other direction, turns the verdict."""
    low, high = sorted((one, other))
    mirrored = {REPRODUCED: REVERSED, REVERSED: REPRODUCED}
    found = decide(low, high, 0.0, "less", p, 0.05)
    turned = mirrored.get(found, found)
    assert decide(-high, -low, 0.0, "less", p, 0.05) == turned
    assert decide(low, high, 0.0, "greater", p, 0.05) == turned
    assert (found == UNDECIDED) == (not np.isnan(p) and (low <= 0 <= high) == (p < 0.05))


def test_frozen_numbers_judge() -> None:
    """The level and the fewest trials are those of the file that is given, not fixed."""
    lax = Judging.model_validate({**load_claims().judging.model_dump(), "fewest": 5, "level": 0.5})
    difference = np.array([-1.0] * 6 + [0.5] * 2)
    measures = pair(40 + difference, np.full(8, 40.0))
    one = Claims(judging=lax, explored=(), claim=(faster(),))
    assert judge_claims(measures, one)["verdict"].item() == REPRODUCED
    assert verdict(measures, faster())[0] == NOT_TESTABLE


def test_trials_of_one_seed_are_judged_together(tmp_path: Path) -> None:
    """Experiments that were run with different root seeds are refused, each with its seed."""
    for number, task in enumerate(EXPERIMENTS):
        table = pd.DataFrame({"task": [task], "seed": 5, "iterations": number})
        write_csv(table, tmp_path / task.replace("-", "_") / "trials.csv")
    assert read_trials(tmp_path)["iterations"].tolist() == [0, 1, 2]
    write_csv(table.assign(seed=6), tmp_path / "soccer" / "trials.csv")
    with pytest.raises(UserError, match=r"open_maze 5, obstacle_maze 5, soccer 6\); use one"):
        read_trials(tmp_path)
