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


def test_markdown_is_a_table() -> None:
    """Columns become the head, rows become lines, and the cells line up."""
    assert markdown(pd.DataFrame({"a": [1, 2], "b": ["x", "long"]})) == (
        "| a   | b    |\n| --- | ---- |\n| 1   | x    |\n| 2   | long |\n"
    )


# --- tables of the experiments ---------------------------------------------------------------


def test_readable_summary_by_hand() -> None:
    """Means have their intervals, and what the paper does not give is a dash."""
    table = pd.DataFrame(
        {
            "method": ["adaboost", "unified"],
            "reading": ["", "updated"],
            "n": 30,
            "capped": [0, 2],
            "mean": [44.0, np.nan],
            "low": [43.0, np.nan],
            "high": [45.5, np.nan],
            "sd": [6.789, np.nan],
            "median": [44.0, 41.5],
            "quartile_1": [40.0, 38.25],
            "quartile_3": [47.0, 45.0],
            "paper_mean": [44.94, np.nan],
            "paper_sd": [10.27, np.nan],
            "predicted_low": [42.06, np.nan],
            "predicted_high": [47.82, np.nan],
        }
    )
    assert readable_summary(table).to_numpy().tolist() == [
        [
            "AdaBoost-IRL (R1)",
            "–",
            "44.00 [43.00, 45.50]",
            "6.79",
            "44 (40–47)",
            "0 of 30",
            "44.94 (10.27)",
            "42.1 to 47.8",
        ],
        [
            "Unified, without incorrect",
            "Fᵢ₊₁ (updated)",
            "–",
            "–",
            "41.5 (38.25–45)",
            "2 of 30",
            "–",
            "–",
        ],
    ]


def test_readable_contrasts_by_hand() -> None:
    """Methods have their labels, numbers their intervals, and small p-values no false digits."""
    table = pd.DataFrame(
        {
            "x": ["unified"],
            "y": ["adaboost"],
            "reading": ["printed"],
            "difference": [-4.0],
            "low": [-6.5],
            "high": [-1.255],
            "sd_ratio": [0.5],
            "sd_low": [0.25],
            "sd_high": [0.751],
            "fewer": [0.8],
            "p_wilcoxon": [0.00099],
            "p_spread": [0.04],
        }
    )
    assert readable_contrasts(table).iloc[0].tolist() == [
        "Unified, without incorrect against AdaBoost-IRL (R1)",
        "Fᵢ (printed)",
        "-4.00 [-6.50, -1.25]",
        "0.50 [0.25, 0.75]",
        "0.80",
        "< 0.001",
        "0.040",
    ]


def test_readable_sets_by_hand() -> None:
    """A set has one row: its pairs, and what it saves under both readings of Eq. 9."""
    table = pd.DataFrame(
        {
            "set": ["none", "none", "hit", "hit"],
            "reading": ["printed", "updated"] * 2,
            "demonstrations": [0, 0, 3, 3],
            "pairs": [0, 0, 20, 20],
            "leaving": [0, 0, 4, 4],
            "beside": [0, 0, 6, 6],
            "mean": [40.0, 38.0, 36.0, np.nan],
            "sd": [4.0, 5.0, 3.0, np.nan],
            "difference": [0.0, 0.0, -4.0, np.nan],
            "low": [0.0, 0.0, -6.0, np.nan],
            "high": [0.0, 0.0, -2.5, np.nan],
        }
    )
    shown = readable_sets(table)
    assert shown.columns.tolist()[:5] == ["Set", "Demonstrations", "Pairs", "Leaving", "Beside"]
    assert shown.to_numpy().tolist() == [
        ["none", 0, 0, 0, 0, "40.00 (4.00)", "–", "38.00 (5.00)", "–"],
        ["hit", 3, 20, 4, 6, "36.00 (3.00)", "4.00 [2.50, 6.00]", "– (–)", "–"],
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
    found = readable_verdicts(JUDGED)
    assert found.columns.tolist() == [
        "Claim",
        "Place",
        "Paper",
        "Fᵢ (printed)",
        "Fᵢ₊₁ (updated)",
        "Verdict",
    ]
    assert found.drop(columns="Place").to_numpy().tolist() == [
        [
            "It is faster",
            "-4.84",
            "-4.00 [-5.00, -3.00]",
            "-3.00 [-4.00, -2.00]",
            "**reproduced**",
        ],
        [
            "It is steadier",
            "× 0.46",
            "× 0.50 [0.40, 0.60]",
            "× 0.90 [0.80, 1.10]",
            "partly (Fᵢ reproduced, Fᵢ₊₁ undecided)",
        ],
        ["Q grows", "–", "0.10 [-0.10, 0.30]", "0.20 [-0.10, 0.50]", "not reproduced"],
        ["Mean", "44.94", "44.00 [43.00, 45.00]", "–", "not testable: it was used"],
        ["A run", "47.00", "median 41; 30 to 55", "–", "not testable: two capped"],
        ["SD", "4.73", "6.80 [6.00, 7.70]", "5.50 [4.80, 6.30]", "not testable: calibrated"],
    ]


def test_verdict_lines_have_the_verdict_first() -> None:
    """On a terminal there is a line a claim: verdict, the paper's value, ours, and the claim."""
    head, *found = verdict_lines(JUDGED.replace({"id": {"B": "STEADIER"}}))
    assert head.split() == ["verdict", "paper", "Fᵢ", "(printed)", "Fᵢ₊₁", "(updated)", "claim"]
    assert re.split(r"  +", found[1]) == [
        "partly",
        "× 0.46",
        "× 0.50 [0.40, 0.60]",
        "× 0.90 [0.80, 1.10]",
        "steadier than AdaBoost-IRL",
    ]
    for line, (id, part) in zip(found, JUDGED.groupby("id"), strict=True):
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
    table = pd.DataFrame(
        {
            "claim": ["FASTER", "FASTER"],
            "group": ["single", "factorial"],
            "specifications": [44, 240],
            "holds": [40, 200],
            "open": [3, 30],
            "reversed": [1, 9],
            "undefined": [0, 1],
            "share": [0.9, 0.8],
            "with_caps": [0, 7],
            "uncapped": [44, 232],
            "holds_uncapped": [40, 194],
            "unchanged": [5, 0],
            "median": [-4.0, -3.456],
            "lowest": [-9.0, -20.0],
            "highest": [1.0, 2.5],
        }
    )
    assert readable_outcomes(table).to_numpy().tolist() == [
        ["FASTER", "one at a time", 44, 40, 3, 1, 0, 0, "40 of 44", 5, "-4.00 (-9.00, 1.00)"],
        ["FASTER", "all at once", 240, 200, 30, 9, 1, 7, "194 of 232", 0, "-3.46 (-20.00, 2.50)"],
    ]


def test_readable_levels_are_of_one_claim() -> None:
    """The default value is marked, shares are in percent, a missing effect is a dash."""
    table = pd.DataFrame(
        {
            "claim": ["FASTER", "FASTER", "STEADIER"],
            "choice": "ALPHA",
            "value": [0.1, 0.3, 0.3],
            "default": [False, True, True],
            "specifications": 60,
            "mean_effect": [-4.0, np.nan, 1.0],
            "holds": [0.8, 0.05, 1.0],
            "reversed": [0.0, 0.111, 0.0],
        }
    )
    assert readable_levels(table, "FASTER").to_numpy().tolist() == [
        ["ALPHA", "0.1", "-4.00", "80%", "0%"],
        ["ALPHA", "0.3 (default)", "–", "5%", "11%"],
    ]


def test_readable_ablations_by_hand() -> None:
    """A row a condition: mean with its interval, SD, median and how many trials are at the cap."""
    table = pd.DataFrame(
        {
            "method": ["unified"],
            "reading": ["printed"],
            "choices": ["TRACE=none"],
            "n": [30],
            "capped": [2],
            "mean": [40.0],
            "low": [38.0],
            "high": [42.0],
            "sd": [4.5],
            "median": [39.5],
            "more": [1.0],
            "more_low": [-0.5],
            "more_high": [2.5],
        }
    )
    assert readable_ablations(table).iloc[0].tolist() == [
        "Unified, without incorrect",
        "Fᵢ (printed)",
        "TRACE=none",
        "40.00 [38.00, 42.00]",
        "4.50",
        "39.5",
        "2 of 30",
        "1.00 [-0.50, 2.50]",
    ]
