from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd

from replication.evidence.tables import read_table, write_csv
from replication.evidence.verdicts import overall
from replication.files import PROJECT
from replication.report.readable import (
    markdown,
    readable_ablations,
    readable_contrasts,
    readable_levels,
    readable_outcomes,
    readable_sets,
    readable_summary,
    readable_verdicts,
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


def test_readable_summary_by_hand() -> None:
    """Means have their intervals, and what the paper does not give is a dash."""
    summary = table(
        "method reading n capped mean low high sd median quartile_1 quartile_3 paper_mean paper_sd",
        ("adaboost", "", 30, 0, 44.0, 43.0, 45.5, 6.789, 44.0, 40.0, 47.0, 44.94, 10.27),
        ("unified", "updated", 30, 2, NAN, NAN, NAN, NAN, 41.5, 38.25, 45.0, NAN, NAN),
    ).assign(predicted_low=[42.06, NAN], predicted_high=[47.82, NAN])
    assert shown(readable_summary(summary)) == [
        "AdaBoost-IRL (R1) | – | 44.00 [43.00, 45.50] | 6.79 | 44 (40–47) | 0 of 30 | "
        "44.94 (10.27) | 42.1 to 47.8",
        "Unified, without incorrect | Fᵢ₊₁ (updated) | – | – | 41.5 (38.25–45) | 2 of 30 | – | –",
    ]


def test_readable_contrasts_by_hand() -> None:
    """Methods have their labels, numbers their intervals, and small p-values no false digits."""
    contrasts = table(
        "x y reading difference low high sd_ratio sd_low sd_high fewer p p_spread",
        (
            "unified",
            "adaboost",
            "printed",
            -4.0,
            -6.5,
            -1.255,
            0.5,
            0.25,
            0.751,
            0.8,
            0.00099,
            0.04,
        ),
    )
    assert shown(readable_contrasts(contrasts)) == [
        "Unified, without incorrect against AdaBoost-IRL (R1) | Fᵢ (printed) | "
        "-4.00 [-6.50, -1.25] | 0.50 [0.25, 0.75] | 0.80 | < 0.001 | 0.040"
    ]


def test_readable_sets_by_hand() -> None:
    """A set has one row: its pairs, and what it saves under both readings of Eq. 9."""
    sets = table(
        "set reading demonstrations pairs leaving beside mean sd difference low high",
        ("none", "printed", 0, 0, 0, 0, 40.0, 4.0, 0.0, 0.0, 0.0),
        ("none", "updated", 0, 0, 0, 0, 38.0, 5.0, 0.0, 0.0, 0.0),
        ("hit", "printed", 3, 20, 4, 6, 36.0, 3.0, -4.0, -6.0, -2.5),
        ("hit", "updated", 3, 20, 4, 6, NAN, NAN, NAN, NAN, NAN),
    )
    readable = readable_sets(sets)
    assert readable.columns.tolist()[:5] == ["Set", "Demonstrations", "Pairs", "Leaving", "Beside"]
    assert shown(readable) == [
        "none | 0 | 0 | 0 | 0 | 40.00 (4.00) | – | 38.00 (5.00) | –",
        "hit | 3 | 20 | 4 | 6 | 36.00 (3.00) | 4.00 [2.50, 6.00] | – (–) | –",
    ]


# --- judged claims ---------------------------------------------------------------------------

JUDGED = pd.DataFrame(
    [
        ("A", "It is faster", "mean-difference", "printed", -4.0, -5.0, -3.0, -4.84, "reproduced"),
        ("A", "It is faster", "mean-difference", "updated", -3.0, -4.0, -2.0, -4.84, "reproduced"),
        ("B", "It is steadier", "sd-ratio", "printed", 0.5, 0.4, 0.6, 0.46, "reproduced"),
        ("B", "It is steadier", "sd-ratio", "updated", 0.9, 0.8, 1.1, 0.46, "undecided"),
        ("C", "Q grows", "mean", "printed", 0.1, -0.1, 0.3, np.nan, "not reproduced"),
        ("C", "Q grows", "mean", "updated", 0.2, -0.1, 0.5, np.nan, "not reproduced"),
        ("D", "Mean", "published-mean", "", 44.0, 43.0, 45.0, 44.94, "not testable"),
        ("E", "A run", "published-run", "printed", 41.0, 30.5, 55.0, 47.0, "not testable"),
        ("E", "A run", "published-run", "updated", np.nan, np.nan, np.nan, 47.0, "not testable"),
        ("F", "SD", "published-sd", "printed", 6.8, 6.0, 7.7, 4.73, "not testable"),
        ("F", "SD", "published-sd", "updated", 5.5, 4.8, 6.3, 4.73, "reproduced"),
    ],
    columns=["id", "claim", "statistic", "reading", "effect", "low", "high", "paper", "verdict"],
).assign(
    place="Fig. 6",
    why=["", "", "", "a", "", "", "it was used", "two capped", "all capped", "calibrated", ""],
)


def test_readable_verdicts_by_hand() -> None:
    """One row a claim: effects of both readings in their own unit, and the verdict of both."""
    readable = readable_verdicts(JUDGED)
    head = "Claim | Place | Paper | Fᵢ (printed) | Fᵢ₊₁ (updated) | Verdict"
    assert " | ".join(readable.columns) == head
    assert shown(readable.drop(columns="Place")) == [
        "It is faster | -4.84 | -4.00 [-5.00, -3.00] | -3.00 [-4.00, -2.00] | **reproduced**",
        "It is steadier | × 0.46 | × 0.50 [0.40, 0.60] | × 0.90 [0.80, 1.10] | "
        "partly (Fᵢ reproduced, Fᵢ₊₁ undecided)",
        "Q grows | – | 0.10 [-0.10, 0.30] | 0.20 [-0.10, 0.50] | not reproduced",
        "Mean | 44.94 | 44.00 [43.00, 45.00] | – | not testable: it was used",
        "A run | 47.00 | median 41; 30 to 55 | – | not testable: two capped",
        "SD | 4.73 | 6.80 [6.00, 7.70] | 5.50 [4.80, 6.30] | not testable: calibrated",
    ]


def test_verdict_lines_have_the_verdict_first() -> None:
    """On a terminal there is a line a claim: verdict, the paper's value, ours, and the claim."""
    head, *lines = verdict_lines(JUDGED.replace({"id": {"B": "STEADIER"}}))
    assert head.split() == ["verdict", "paper", "Fᵢ", "(printed)", "Fᵢ₊₁", "(updated)", "claim"]
    cells = ["partly", "× 0.46", "× 0.50 [0.40, 0.60]", "× 0.90 [0.80, 1.10]"]
    assert re.split(r"  +", lines[1]) == [*cells, "steadier than AdaBoost-IRL"]
    for line, (id, part) in zip(lines, JUDGED.groupby("id"), strict=True):
        assert line[:16].rstrip() == overall(part["verdict"].tolist())
        assert line.endswith(str(id)) or id == "B"


def test_published_verdicts_fit_on_a_terminal() -> None:
    """No line of the published verdicts is longer than 100 columns, and no two columns touch."""
    for line in verdict_lines(read_table(PROJECT / "figures" / "claims" / "verdicts.csv")):
        assert len(line) <= 100
        assert len(re.split(r"  +", line)) == 5


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
        "holds_uncapped unchanged median lowest highest",
        ("FASTER", "single", 44, 40, 3, 1, 0, 0, 44, 40, 5, -4.0, -9.0, 1.0),
        ("FASTER", "factorial", 240, 200, 30, 9, 1, 7, 232, 194, 0, -3.456, -20.0, 2.5),
    )
    assert shown(readable_outcomes(outcomes)) == [
        "FASTER | one at a time | 44 | 40 | 3 | 1 | 0 | 0 | 40 of 44 | 5 | -4.00 (-9.00, 1.00)",
        "FASTER | all at once | 240 | 200 | 30 | 9 | 1 | 7 | 194 of 232 | 0 | -3.46 (-20.00, 2.50)",
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
