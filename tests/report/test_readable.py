from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from replication.evidence.claims import label, load_claims
from replication.evidence.experiments import EXPERIMENTS, GENERAL, NAMED, NONE
from replication.evidence.tables import read_table, write_csv
from replication.evidence.verdicts import (
    ABSENT,
    CONSISTENT,
    INCONCLUSIVE,
    INCONSISTENT,
    NOT_TESTABLE,
    REVERSED,
    SHOWN,
)
from replication.irl import READINGS
from replication.report.readable import (
    F_LABELS,
    MEASURES,
    SET_LABELS,
    consistency,
    full_label,
    markdown,
    readable_ablations,
    readable_contrasts,
    readable_kinds,
    readable_levels,
    readable_means,
    readable_outcomes,
    readable_predictions,
    readable_sets,
    readable_summary,
    readable_verdicts,
    sentence,
    verdict_lines,
)

NAN = np.nan


def table(columns: str, *rows: tuple[object, ...]) -> pd.DataFrame:
    """Make a table of named columns."""
    return pd.DataFrame(list(rows), columns=columns.split())


def shown(readable: pd.DataFrame) -> list[str]:
    """Return the rows of a table as one reads them."""
    return [" | ".join(map(str, row)) for row in readable.to_numpy()]


def test_markdown_is_a_table() -> None:
    """Columns become the head, rows become lines, and the cells line up."""
    assert markdown(pd.DataFrame({"a": [1, 2], "b": ["x", "long"]})) == (
        "| a   | b    |\n| --- | ---- |\n| 1   | x    |\n| 2   | long |\n"
    )


# --- tables of the experiments ---------------------------------------------------------------


def test_full_labels() -> None:
    """A label has the set and the reading, where there is one."""
    assert full_label("adaboost", "") == "AdaBoost-IRL (R1)"
    assert full_label("unified", "printed") == "Unified, without incorrect, Fᵢ (printed)"
    given = "Unified, with incorrect"
    assert full_label("unified-incorrect", "updated", GENERAL) == (
        f"{given} (general list), Fᵢ₊₁ (updated)"
    )
    assert full_label("unified-incorrect", "at-once", "opposite") == (
        f"{given} (opposite), Fᵢ, maximum at once"
    )


def test_all_readings_and_judged_sets_have_a_label() -> None:
    """What stands in tables and figures is a word for each, and none twice."""
    assert [*F_LABELS] == ["", *READINGS]
    assert {set for each in EXPERIMENTS.values() for set in (NONE, *each.sets)} == {*SET_LABELS}
    for labels in (F_LABELS, SET_LABELS):
        assert len({*labels.values()}) == len(labels)


def test_readable_summary_by_hand() -> None:
    """Means have their intervals, and what the paper does not give is a dash."""
    summary = table(
        "method reading set n capped mean low high sd median quartile_1 quartile_3 first_mean "
        "first_sd paper_mean paper_sd predicted_low predicted_high",
        (
            *("adaboost", "", NONE, 30, 0, 44.0, 43.0, 45.5, 6.789, 44.0, 40.0, 47.0),
            *(43.5, 7.0, 44.94, 10.27, 42.06, 47.82),
        ),
        (
            *("unified-incorrect", "at-once", NAMED, 30, 2, NAN, NAN, NAN, NAN, 41.5, 38.25, 45.0),
            *[NAN] * 6,
        ),
    )
    readable = readable_summary(summary)
    assert readable.columns.tolist()[:3] == ["Method", "Reading", "Incorrect"]
    assert shown(readable) == [
        "AdaBoost-IRL (R1) | – | – | 44.00 [43.00, 45.50] | 6.79 | 44 (40–47) | 0 of 30 | "
        "43.50 (7.00) | 44.94 (10.27) | 42.1 to 47.8",
        "Unified, with incorrect | Fᵢ, maximum at once | named kinds | – | – | 41.5 (38.25–45) | "
        "2 of 30 | – (–) | – | –",
    ]


def test_readable_contrasts_by_hand() -> None:
    """Methods have their labels, numbers their intervals, and small p-values no false digits."""
    contrasts = table(
        "x y reading set saved low high steps_saved sd_ratio sd_low sd_high fewer p p_spread",
        (
            *("unified", "adaboost", "printed", NONE, 4.0, 1.255, 6.5),
            *(0.0712, 0.5, 0.25, 0.751, 0.8, 0.00099, 0.04),
        ),
        (
            *("unified-incorrect", "unified", "updated", GENERAL, -1.0, NAN, NAN),
            *(-0.002, 1.0, NAN, NAN, 0.5, NAN, 1.0),
        ),
    )
    assert shown(readable_contrasts(contrasts)) == [
        "Unified, without incorrect against AdaBoost-IRL (R1) | Fᵢ (printed) | – | "
        "4.00 [1.25, 6.50] | 7.1% | 0.50 [0.25, 0.75] | 0.80 | < 0.001 | 0.040",
        "Unified, with incorrect against Unified, without incorrect | Fᵢ₊₁ (updated) | "
        "general list | -1.00 | -0.2% | 1.00 | 0.50 | – | 1.000",
    ]


def test_readable_sets_by_hand() -> None:
    """A set has one row: its pairs, and what it saves and how often it acts under each reading."""
    sets = table(
        "set reading demonstrations pairs leaving beside saved low high acted",
        ("hit", "printed", 3, 20, 4, 6, 4.0, 2.5, 6.0, 0.0),
        ("hit", "updated", 3, 20, 4, 6, NAN, NAN, NAN, 1.25),
        ("opposite", "printed", 9, 30, 30, 0, -0.5, -1.0, 0.25, 40.0),
    )
    readable = readable_sets(sets)
    assert readable.columns.tolist() == [
        *("Set", "Demonstrations", "Pairs", "Leaving", "Beside"),
        *("Fᵢ (printed): saves", "Fᵢ (printed): acts"),
        *("Fᵢ₊₁ (updated): saves", "Fᵢ₊₁ (updated): acts"),
    ]
    assert shown(readable) == [
        "hit | 3 | 20 | 4 | 6 | 4.00 [2.50, 6.00] | 0.00 | – | 1.25",
        "opposite | 9 | 30 | 30 | 0 | -0.50 [-1.00, 0.25] | 40.00 | – | –",
    ]


def test_readable_kinds_by_hand() -> None:
    """A kind has one row: its share of the wrong trajectories, and of the wrong visits."""
    kinds = table(
        "reading kind trajectories share weight",
        ("printed", "hit", 200, 0.005, 0.001),
        ("printed", "opposite", 200, 0.6, 0.9),
        ("updated", "hit", 100, 0.0, 0.0),
        ("updated", "opposite", 100, 0.5, 0.8),
    )
    readable = readable_kinds(kinds)
    assert readable.columns.tolist() == [
        *("Kind", "Fᵢ (printed): of trajectories", "Fᵢ (printed): of wrong visits"),
        *("Fᵢ₊₁ (updated): of trajectories", "Fᵢ₊₁ (updated): of wrong visits"),
    ]
    assert shown(readable) == [
        "hit | 0.5% | 0.1% | 0.0% | 0.0%",
        "opposite | 60.0% | 90.0% | 50.0% | 80.0%",
    ]


# --- judged claims ---------------------------------------------------------------------------

CELLS = "id claim statistic set reading effect low high p paper verdict why"
JUDGED = table(
    CELLS,
    ("A", "It is faster", "saved", NONE, "printed", 4.0, 3.0, 5.0, 0.0, 4.84, SHOWN, ""),
    ("A", "It is faster", "saved", NONE, "updated", 3.0, 2.0, 4.0, 0.0, 4.84, SHOWN, ""),
    ("B", "It is steadier", "sd-ratio", NONE, "printed", 0.5, 0.4, 0.6, 0.0, 0.46, SHOWN, ""),
    ("B", "It is steadier", "sd-ratio", NONE, "updated", 0.9, 0.8, 1.1, 0.2, 0.46, ABSENT, ""),
    ("C", "It saves", "saved", NAMED, "printed", 0.1, -0.1, 0.3, 0.5, 3.62, ABSENT, ""),
    ("C", "It saves", "saved", NAMED, "updated", 0.2, -0.1, 0.5, 0.4, 3.62, ABSENT, ""),
    ("C", "It saves", "saved", NAMED, "at-once", 0.3, -0.1, 0.7, 0.3, 3.62, ABSENT, ""),
    ("C", "It saves", "saved", GENERAL, "printed", 2.0, 1.0, 3.0, 0.0, 3.62, SHOWN, ""),
    ("C", "It saves", "saved", GENERAL, "updated", 0.9, -1.0, 3.0, 0.3, 3.62, INCONCLUSIVE, ""),
    ("C", "It saves", "saved", GENERAL, "at-once", -2.0, -3.0, -1.0, 0.0, 3.62, REVERSED, ""),
    ("D", "Mean", "published-mean", NONE, "", 44.0, 43.0, 45.0, NAN, 44.94, NOT_TESTABLE, "used"),
    ("E", "A run", "published-run", NONE, "printed", 41.0, 30.5, 55.0, 0.25, 47.0, "", "single"),
    ("E", "A run", "published-run", NONE, "updated", 38.5, 28.0, 51.0, 0.0004, 47.0, "", "single"),
    ("F", "SD", "published-sd", NONE, "printed", 6.8, 6.0, 7.7, NAN, 4.73, INCONSISTENT, ""),
    ("F", "SD", "published-sd", NONE, "updated", 5.0, 4.8, 5.3, NAN, 4.73, CONSISTENT, ""),
    ("G", "Growth", "mean", NONE, "printed", NAN, NAN, NAN, NAN, NAN, NOT_TESTABLE, "2 at the cap"),
    ("G", "Growth", "mean", NONE, "updated", 0.1, 0.05, 0.2, 0.01, NAN, SHOWN, ""),
).assign(place="Fig. 6")
SENTENCES = {
    "A": "shown under every reading",
    "B": "shown under Fᵢ (printed), absent under Fᵢ₊₁ (updated)",
    "C": "named kinds: absent under every reading; general list: shown under Fᵢ (printed), "
    "inconclusive under Fᵢ₊₁ (updated), reversed under Fᵢ, maximum at once",
    "D": "not testable: used",
    "E": "p = 0.250, p < 0.001",
    "F": "inconsistent under Fᵢ (printed), consistent under Fᵢ₊₁ (updated)",
    "G": "not testable under Fᵢ (printed), shown under Fᵢ₊₁ (updated)",
}


def test_readable_verdicts_by_hand() -> None:
    """A row for each claim and set; the cells of its readings have verdict, effect and interval."""
    readable = readable_verdicts(JUDGED)
    assert " | ".join(readable.columns) == (
        "Claim | Place | Paper | Incorrect | Fᵢ (printed) | Fᵢ₊₁ (updated) | Fᵢ, maximum at once"
    )
    assert shown(readable.drop(columns="Place")) == [
        "It is faster | 4.84 | – | **shown** 4.00 [3.00, 5.00] | **shown** 3.00 [2.00, 4.00] | –",
        "It is steadier | × 0.46 | – | **shown** × 0.50 [0.40, 0.60] | "
        "absent × 0.90 [0.80, 1.10] | –",
        "It saves | 3.62 | named kinds | absent 0.10 [-0.10, 0.30] | absent 0.20 [-0.10, 0.50] | "
        "absent 0.30 [-0.10, 0.70]",
        " | 3.62 | general list | **shown** 2.00 [1.00, 3.00] | inconclusive 0.90 [-1.00, 3.00] | "
        "reversed -2.00 [-3.00, -1.00]",
        "Mean | 44.94 | – | not testable 44.00 [43.00, 45.00] | – | –",
        "A run | 47.00 | – | median 41; p = 0.250 | median 38.5; p < 0.001 | –",
        "SD | 4.73 | – | inconsistent 6.80 [6.00, 7.70] | consistent 5.00 [4.80, 5.30] | –",
        "Growth | – | – | not testable: 2 at the cap | **shown** 0.10 [0.05, 0.20] | –",
    ]


@pytest.mark.parametrize("id", SENTENCES)
def test_a_sentence_has_the_verdict_of_every_cell(id: str) -> None:
    """What cells have in common is said once, and each that differs is named."""
    assert sentence(JUDGED[JUDGED["id"] == id]) == SENTENCES[id]


def test_a_run_that_is_not_testable_in_a_cell_has_no_probability_there() -> None:
    """Single runs have a probability for each cell, in order, or the reason why there is none."""
    runs = JUDGED[JUDGED["id"] == "E"].copy()
    runs.iloc[1, runs.columns.get_indexer(["verdict", "p"])] = NOT_TESTABLE, NAN
    assert sentence(runs) == "p = 0.250, not testable"
    runs["verdict"] = NOT_TESTABLE
    assert sentence(runs) == "not testable: single"


def test_a_single_cell_is_its_verdict() -> None:
    """A claim with one cell is not said to hold in every one; one with two sets in both."""
    assert sentence(JUDGED.head(1)) == "shown"
    both = JUDGED[JUDGED["id"] == "C"].assign(verdict=ABSENT)
    assert sentence(both) == "absent under every reading and with both sets"


def test_readable_predictions_set_what_was_said_beside_what_came_out() -> None:
    """Each claim that was predicted has a row; one whose number was used up has none."""
    ids = {"A": "FASTER", "B": "STEADIER", "D": "MEAN-ADABOOST-OPEN"}
    judged = JUDGED[JUDGED["id"].isin([*ids])].replace({"id": ids})
    judged = judged.assign(consistent=["yes", "no", "no", "no", ""])
    judged["predicted_high"] = [5.0, 2.0, 0.8, 0.8, NAN]
    beside = {
        "A": "consistent with it under Fᵢ, and larger under Fᵢ₊₁",
        "B": "larger under Fᵢ, and smaller under Fᵢ₊₁",
    }
    assert shown(readable_predictions(judged)) == [
        f"{label(ids[id])} | {load_claims().by_id(ids[id]).prediction} | {SENTENCES[id]} | {text}"
        for id, text in beside.items()
    ]
    unknown = readable_predictions(judged.assign(consistent=""))
    assert unknown["Beside the paper's"].tolist() == ["–", "–"]


def test_an_effect_is_beside_the_papers_in_every_cell_or_in_some() -> None:
    """What all cells have in common is said once; with two claims the place is named."""
    cells = JUDGED[JUDGED["id"] == "A"].assign(consistent="no", predicted_high=2.0)
    assert consistency(cells) == "larger under every reading"
    assert consistency(cells.head(1)) == "larger"
    two = cells.assign(id=["SAVES-OPEN", "SAVES-OBSTACLES"], consistent=["yes", "no"])
    assert consistency(two) == (
        "consistent with it under Fᵢ (open), and larger under Fᵢ₊₁ (obstacles)"
    )


def test_verdict_lines_have_the_claim_and_its_sentence() -> None:
    """On a terminal each claim has its verdicts beside it, in lines of at most 100 columns."""
    lines = verdict_lines(JUDGED.replace({"id": {"B": "STEADIER"}}))
    width = len("steadier than AdaBoost-IRL") + 2
    assert all(len(line) <= 100 for line in lines)
    said: dict[str, list[str]] = {}
    for line in lines:  # a long sentence goes on below itself
        name = line[:width].rstrip() or list(said)[-1]
        said.setdefault(name, []).append(line[width:])
    found = [" ".join(parts) for parts in said.values()]
    assert found == list(SENTENCES.values())
    assert list(said) == ["steadier than AdaBoost-IRL" if id == "B" else id for id in SENTENCES]


def test_verdicts_read_the_same_from_a_file(tmp_path: Path) -> None:
    """What readers see of judged claims follows from the file alone."""
    stored = read_table(write_csv(JUDGED, tmp_path / "claims.csv"))
    pd.testing.assert_frame_equal(readable_verdicts(stored), readable_verdicts(JUDGED))
    assert verdict_lines(stored) == verdict_lines(JUDGED)


# --- specifications --------------------------------------------------------------------------


def test_readable_outcomes_by_hand() -> None:
    """Each claim and group has its counts and the range of its effects."""
    outcomes = table(
        "claim group specifications holds open reversed undefined with_caps uncapped "
        "holds_uncapped unchanged median lowest highest p_median p_holds alone",
        ("FASTER", "single", 44, 40, 3, 1, 0, 0, 44, 40, 5, 4.0, -1.0, 9.0, 0.0002, 0.041, 12),
        ("FASTER", "factorial", 240, 20, 30, 9, 1, 7, 32, 19, 0, 3.456, -2.5, 9.0, NAN, NAN, 0),
    )
    assert shown(readable_outcomes(outcomes)) == [
        "faster than AdaBoost-IRL | one at a time | 44 | 40 | 3 | 1 | 0 | 0 | 40 of 44 | 5 | 12 | "
        "< 0.001, 0.041 | 4.00 (-1.00, 9.00)",
        "faster than AdaBoost-IRL | all at once | 240 | 20 | 30 | 9 | 1 | 7 | 19 of 32 | 0 | – | "
        "–, – | 3.46 (-2.50, 9.00)",
    ]


def test_readable_levels_are_of_one_claim() -> None:
    """The default value is marked, shares are in percent, a missing effect is a dash."""
    levels = table(
        "claim choice value default mean_effect holds reversed",
        ("FASTER", "ALPHA", 0.1, False, -4.0, 0.8, 0.0),
        ("FASTER", "ALPHA", 0.3, True, NAN, 0.05, 0.111),
        ("STEADIER", "ALPHA", 0.3, True, 1.0, 1.0, 0.0),
    )
    lines = ["ALPHA | 0.1 | -4.00 | 80% | 0%", "ALPHA | 0.3 (default) | – | 5% | 11%"]
    assert shown(readable_levels(levels, "FASTER")) == lines


def test_readable_ablations_by_hand() -> None:
    """A row a condition: mean with its interval, SD, median and how many trials are at the cap."""
    ablations = table(
        "method reading choices n capped mean low high sd median more more_low more_high",
        ("unified", "printed", "TRACE=none", 30, 2, 40.0, 38.0, 42.0, 4.5, 39.5, 1.0, -0.5, 2.5),
    )
    assert shown(readable_ablations(ablations)) == [
        "Unified, without incorrect | Fᵢ (printed) | TRACE=none | 40.00 [38.00, 42.00] | 4.50 | "
        "39.5 | 2 of 30 | 1.00 [-0.50, 2.50]"
    ]


def test_readable_means_by_hand() -> None:
    """Keys have their names, counts a comma at the thousands, and what is missing is a dash."""
    means = table(
        "task method reading set iterations converged steps q_growth",
        ("open-maze", "unified-incorrect", "updated", NAMED, 32.851, 1.0, 26832732.0, -0.0004),
        ("soccer", "unified", "printed", NONE, 9.0, 0.5, NAN, 0.01),
    )
    readable = readable_means(means)
    assert not any("_" in name for name in readable)
    assert shown(readable) == [
        "open maze | Unified, with incorrect | Fᵢ₊₁ (updated) | named kinds | 32.85 | 100% | "
        "26,832,732 | 0.000",
        "soccer | Unified, without incorrect | Fᵢ (printed) | – | 9.00 | 50% | – | 0.010",
    ]


def test_every_measure_has_a_name() -> None:
    """What the claims are judged by, and what is shown of a trial, can be shown as means."""
    assert {claim.measure for claim in load_claims().claim} <= set(MEASURES)


def test_a_column_that_says_nothing_is_left_out() -> None:
    """Where no trial is at the cap, no column says so."""
    columns = "method reading choices n capped mean low high sd median more more_low more_high"
    row = ("unified", "printed", "default", 30, 0, 40.0, 38.0, 42.0, 4.5, 39.5, 1.0, -0.5, 2.5)
    assert "At the cap" not in readable_ablations(table(columns, row))
