"""Tables as a reader wants them: labels for keys, numbers with their intervals, Markdown."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from replication.evidence.claims import LABELS
from replication.evidence.verdicts import NOT_TESTABLE, REPRODUCED, overall
from replication.irl import READINGS, get_method

F_LABELS = {"": "–", "printed": "Fᵢ (printed)", "updated": "Fᵢ₊₁ (updated)"}
"""How a reading of Eq. 9 is called in tables and figures; a method without a trace has none."""

Form = Callable[[Any], object]
"""What a reader sees of a row, which is a named tuple."""


def readable(table: pd.DataFrame, columns: Mapping[str, Form]) -> pd.DataFrame:
    """Return a table with a column for each heading, each made from the rows by a form."""
    rows = [[form(row) for form in columns.values()] for row in table.itertuples(index=False)]
    return pd.DataFrame(rows, columns=list(columns))


def markdown(table: pd.DataFrame) -> str:
    """Return a table as Markdown, with columns that line up as text, too."""
    rows = [list(map(str, row)) for row in (table.columns, *table.itertuples(index=False))]
    widths = [max(3, *map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, ["-" * width for width in widths])
    lines = (" | ".join(map(str.ljust, row, widths)) for row in rows)
    return "".join(f"| {line} |\n" for line in lines)


# --- forms -----------------------------------------------------------------------------------


def full_label(method: str, reading: str) -> str:
    """Return a method's label, with the reading of Eq. 9 if it has one."""
    label = get_method(method).label
    return f"{label}, {F_LABELS[reading]}" if reading else label


def number(x: float) -> str:
    """Return a number with two decimals, or a dash if there is none."""
    return "–" if np.isnan(x) else f"{x:.2f}"


def interval(middle: float, low: float, high: float) -> str:
    """Return a number with its interval, if it has one."""
    return number(middle) if np.isnan(low) else f"{middle:.2f} [{low:.2f}, {high:.2f}]"


def p_value(p: float) -> str:
    """Return a p-value, a small one without false digits."""
    return "–" if np.isnan(p) else "< 0.001" if p < 0.001 else f"{p:.3f}"


METHOD: dict[str, Form] = {
    "Method": lambda row: get_method(row.method).label,
    "Reading": lambda row: F_LABELS[row.reading],
}
MEAN: dict[str, Form] = {
    "Mean [95 %]": lambda row: interval(row.mean, row.low, row.high),
    "SD": lambda row: number(row.sd),
}
CAPPED: dict[str, Form] = {"At the cap": lambda row: f"{row.capped} of {row.n}"}


# --- tables of the experiments ---------------------------------------------------------------


def readable_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return a summary of methods: mean (SD) beside the paper's."""
    columns = METHOD | MEAN
    columns["Median (quartiles)"] = lambda row: (
        f"{row.median:g} ({row.quartile_1:g}–{row.quartile_3:g})"
    )
    columns |= CAPPED
    if "paper_mean" in table:
        columns["Paper: mean (SD)"] = lambda row: (
            "–" if np.isnan(row.paper_mean) else f"{row.paper_mean:.2f} ({number(row.paper_sd)})"
        )
    if "predicted_low" in table:
        columns["Predicted mean"] = lambda row: (
            "–"
            if np.isnan(row.predicted_low)
            else f"{row.predicted_low:.1f} to {row.predicted_high:.1f}"
        )
    return readable(table, columns)


def readable_contrasts(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of contrasts: differences and ratios with their intervals."""
    return readable(
        table,
        {
            "Compared": lambda row: f"{get_method(row.x).label} against {get_method(row.y).label}",
            "Reading": METHOD["Reading"],
            "Iterations [95 %]": lambda row: interval(row.difference, row.low, row.high),
            "SD × [95 %]": lambda row: interval(row.sd_ratio, row.sd_low, row.sd_high),
            "P(fewer)": lambda row: number(row.fewer),
            "p": lambda row: p_value(row.p),
            "p, spread": lambda row: p_value(row.p_spread),
        },
    )


def readable_sets(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of sets, both readings of Eq. 9 in one row."""
    keys = ["set", "demonstrations", "pairs", "leaving", "beside"]
    parts = [table[keys].drop_duplicates().rename(columns=str.capitalize).reset_index(drop=True)]
    for reading, rows in table.groupby("reading", sort=False):
        label = F_LABELS[reading]
        columns: dict[str, Form] = {
            f"{label}: mean (SD)": lambda row: f"{number(row.mean)} ({number(row.sd)})",
            f"{label}: saves": lambda row: (
                "–"
                if row.set == "none"
                else interval(0 - row.difference, 0 - row.high, 0 - row.low)
            ),
        }
        parts.append(readable(rows, columns))
    return pd.concat(parts, axis=1)


# --- judged claims ---------------------------------------------------------------------------


def readable_verdicts(table: pd.DataFrame) -> pd.DataFrame:
    """Return judged claims: one row a claim, both readings side by side."""
    rows = []
    for _, part in table.groupby("id", sort=False):
        first = part.iloc[0]
        paper = number(first["paper"])
        if first["statistic"] == "sd-ratio":
            paper = f"× {paper}"
        # A method without a trace has its effect in the first column only.
        effects = {row.reading or READINGS[0]: _effect(row) for row in part.itertuples()}
        row = {"Claim": first["claim"], "Place": first["place"], "Paper": paper}
        row |= {F_LABELS[reading]: effects.get(reading, "–") for reading in READINGS}
        rows.append({**row, "Verdict": _verdict(part)})
    return pd.DataFrame(rows)


def verdict_lines(table: pd.DataFrame) -> list[str]:
    """Return judged claims for a terminal, below a head: a line each, the verdict first."""
    lines = [("verdict", "paper", *(F_LABELS[reading] for reading in READINGS), "claim")]
    shown = readable_verdicts(table).to_dict("records")
    for (id, part), row in zip(table.groupby("id", sort=False), shown, strict=True):
        effects = (row[F_LABELS[reading]] for reading in READINGS)
        verdict, claim = overall(part["verdict"].tolist()), LABELS.get(str(id), str(id))
        lines.append((verdict, row["Paper"], *effects, claim))
    return ["{:<16}{:<8}{:<23}{:<23}{}".format(*line) for line in lines]


def _verdict(part: pd.DataFrame) -> str:
    """Return the verdict on a claim; why there is none, or what each reading gives."""
    verdict = overall(part["verdict"].tolist())
    if verdict == NOT_TESTABLE:
        verdict = f"{verdict}: {part['why'][part['verdict'] == NOT_TESTABLE].iloc[0]}"
    elif part["verdict"].nunique() > 1:
        each = (f"{F_LABELS[row.reading].split()[0]} {row.verdict}" for row in part.itertuples())
        verdict = f"{verdict} ({', '.join(each)})"
    return f"**{verdict}**" if verdict == REPRODUCED else verdict


def _effect(row: Any) -> str:
    """Return an effect with its interval, in the unit of its statistic."""
    if np.isnan(row.effect):
        return "–"
    if row.statistic == "published-run":
        return f"median {row.effect:g}; {row.low:.0f} to {row.high:.0f}"
    text = interval(row.effect, row.low, row.high)
    return f"× {text}" if row.statistic == "sd-ratio" else text


# --- specifications --------------------------------------------------------------------------


def readable_outcomes(table: pd.DataFrame) -> pd.DataFrame:
    """Return in how many specifications each claim holds."""
    groups = {"single": "one at a time", "factorial": "all at once"}
    return readable(
        table,
        {
            "Claim": lambda row: row.claim,
            "Choices": lambda row: groups[row.group],
            "Specifications": lambda row: row.specifications,
            "Holds": lambda row: row.holds,
            "Open": lambda row: row.open,
            "Reversed": lambda row: row.reversed,
            "Undefined": lambda row: row.undefined,
            "With capped trials": lambda row: row.with_caps,
            "Holds in the others": lambda row: f"{row.holds_uncapped} of {row.uncapped}",
            "As the default": lambda row: row.unchanged,
            "Effect: median (least, largest)": lambda row: (
                f"{row.median:.2f} ({row.lowest:.2f}, {row.highest:.2f})"
            ),
        },
    )


def readable_levels(table: pd.DataFrame, claim: str) -> pd.DataFrame:
    """Return what goes with each value of each choice for one claim."""
    return readable(
        table[table["claim"] == claim],
        {
            "Choice": lambda row: row.choice,
            "Value": lambda row: f"{row.value} (default)" if row.default else str(row.value),
            "Mean effect": lambda row: number(row.mean_effect),
            "Holds": lambda row: f"{row.holds:.0%}",
            "Reversed": lambda row: f"{row.reversed:.0%}",
        },
    )


def readable_ablations(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of ablations: each setting, and how many more iterations than the first."""
    more: dict[str, Form] = {
        "More than the first [95 %]": lambda row: interval(row.more, row.more_low, row.more_high)
    }
    choices: dict[str, Form] = {"Choices": lambda row: row.choices}
    median: dict[str, Form] = {"Median": lambda row: f"{row.median:g}"}
    return readable(table, METHOD | choices | MEAN | median | CAPPED | more)
