"""Tables as a reader wants them: labels for keys, numbers with their intervals, Markdown.

One file because all tables share their labels and the way in which numbers are written.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from replication.evidence.claims import LABELS, label, load_claims
from replication.evidence.experiments import GENERAL, NAMED, NONE
from replication.evidence.verdicts import NOT_TESTABLE, SHOWN
from replication.irl import READINGS, get_method

F_LABELS = {
    "": "–",
    "printed": "Fᵢ (printed)",
    "updated": "Fᵢ₊₁ (updated)",
    "at-once": "Fᵢ, maximum at once",
}
"""How a reading of Eq. 9 is called in tables and figures; a method without a trace has none."""

SET_LABELS = {NONE: "–", NAMED: "named kinds", GENERAL: "general list", "all": "all kinds"}
"""How the judged sets of incorrect demonstrations are called; others have their kinds as name."""

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


def full_label(method: str, reading: str, set: str = NONE) -> str:
    """Return a method's label, with its incorrect demonstrations and reading of Eq. 9, if any."""
    label = get_method(method).label
    label = label if set == NONE else f"{label} ({SET_LABELS.get(set, set)})"
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


def p_is(p: float) -> str:
    """Return what a p-value is, as a part of a sentence."""
    return f"p {p_value(p)}" if p < 0.001 else f"p = {p_value(p)}"


METHOD: dict[str, Form] = {
    "Method": lambda row: get_method(row.method).label,
    "Reading": lambda row: F_LABELS[row.reading],
}
SET: dict[str, Form] = {"Incorrect": lambda row: SET_LABELS.get(row.set, row.set)}
MEAN: dict[str, Form] = {
    "Mean [95 %]": lambda row: interval(row.mean, row.low, row.high),
    "SD": lambda row: number(row.sd),
}


def _capped(table: pd.DataFrame) -> dict[str, Form]:
    """Return the column of the trials at the iteration cap, if there are any."""
    if not table["capped"].any():
        return {}
    return {"At the cap": lambda row: f"{row.capped} of {row.n}"}


# --- tables of the experiments ---------------------------------------------------------------

MEASURES: dict[str, tuple[str, Callable[[Any], str]]] = {
    "task": ("Task", lambda task: task.replace("-", " ")),
    "method": ("Method", lambda method: get_method(method).label),
    "reading": ("Reading", F_LABELS.__getitem__),
    "set": ("Incorrect", lambda set: SET_LABELS.get(set, set)),
    "iterations": ("Iterations", "{:.2f}".format),
    "converged": ("Reach zero", "{:.0%}".format),
    "steps": ("Steps", "{:,.0f}".format),
    "early_collisions": ("Collisions at first", "{:,.0f}".format),
    "early_errors": ("Errors at first", "{:,.0f}".format),
    "q_growth": ("Growth of Q", "{:z.3f}".format),
    "reward_growth": ("Growth of the reward", "{:z.3f}".format),
}
"""Heading and form of each key and measure of a trial."""


def readable_means(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of means by method, with names for keys and rounded numbers."""
    shown = {}
    for name, values in table.items():
        heading, form = MEASURES[str(name)]
        shown[heading] = ["–" if value != value else form(value) for value in values]
    return pd.DataFrame(shown)


def readable_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return a summary of methods: mean (SD) beside the paper's."""
    columns = METHOD | SET | MEAN
    columns["Median (quartiles)"] = lambda row: (
        f"{row.median:g} ({row.quartile_1:g}–{row.quartile_3:g})"
    )
    columns |= _capped(table)
    columns["First 100: mean (SD)"] = lambda row: (
        f"{number(row.first_mean)} ({number(row.first_sd)})"
    )
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
    """Return a table of contrasts: what the first method saves, with intervals."""
    return readable(
        table,
        {
            "Compared": lambda row: f"{get_method(row.x).label} against {get_method(row.y).label}",
            "Reading": METHOD["Reading"],
            **SET,
            "Iterations saved [95 %]": lambda row: interval(row.saved, row.low, row.high),
            "Steps saved": lambda row: f"{row.steps_saved:.1%}",
            "SD × [95 %]": lambda row: interval(row.sd_ratio, row.sd_low, row.sd_high),
            "P(fewer)": lambda row: number(row.fewer),
            "p": lambda row: p_value(row.p),
            "p, spread": lambda row: p_value(row.p_spread),
        },
    )


def readable_sets(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of sets, all readings of Eq. 9 in one row."""
    keys = ["set", "demonstrations", "pairs", "leaving", "beside"]
    keys = [key for key in keys if key in table]
    shown = table[keys].drop_duplicates().rename(columns=str.capitalize).set_index("Set")
    for reading, rows in table.groupby("reading", sort=False):
        cells = readable(
            rows,
            {
                "Set": lambda row: row.set,
                f"{F_LABELS[reading]}: saves": lambda row: interval(row.saved, row.low, row.high),
                f"{F_LABELS[reading]}: acts": lambda row: number(row.acted),
            },
        )
        shown = shown.join(cells.set_index("Set"))
    return shown.fillna("–").reset_index()


def readable_kinds(table: pd.DataFrame) -> pd.DataFrame:
    """Return how much of what goes wrong each kind marks, a row for each kind."""
    shown = table[["kind"]].drop_duplicates().rename(columns=str.capitalize).set_index("Kind")
    for reading, rows in table.groupby("reading", sort=False):
        for name, text in (("share", "of trajectories"), ("weight", "of wrong visits")):
            values = [f"{value:.1%}" for value in rows[name]]
            column = f"{F_LABELS[str(reading)]}: {text}"
            shown = shown.join(pd.Series(values, index=rows["kind"], name=column))
    return shown.reset_index()


# --- judged claims ---------------------------------------------------------------------------


def readable_verdicts(table: pd.DataFrame) -> pd.DataFrame:
    """Return judged claims: a row for each claim and set, the readings side by side."""
    rows = []
    for _, part in table.groupby("id", sort=False):
        for place, (set, cells) in enumerate(part.groupby("set", sort=False)):
            first = cells.iloc[0]
            shown = {row.reading or READINGS[0]: cell(row) for row in cells.itertuples()}
            row = {"Claim": first["claim"] if place == 0 else "", "Place": first["place"]}
            row |= {"Paper": _paper(first), "Incorrect": SET_LABELS[set]}
            rows.append(row | {F_LABELS[name]: shown.get(name, "–") for name in READINGS})
    return pd.DataFrame(rows)


def cell(row: Any) -> str:
    """Return the verdict in a cell with its effect and interval, in the unit of its statistic."""
    if row.verdict == NOT_TESTABLE and np.isnan(row.effect):
        return f"{NOT_TESTABLE}: {row.why}"
    if row.statistic == "published-run":
        return f"median {row.effect:g}; {p_is(row.p)}"
    text = interval(row.effect, row.low, row.high)
    text = f"× {text}" if row.statistic == "sd-ratio" else text
    verdict = f"**{row.verdict}**" if row.verdict == SHOWN else row.verdict
    return f"{verdict} {text}"


def _paper(row: pd.Series) -> str:
    text = number(row["paper"])
    return f"× {text}" if row["statistic"] == "sd-ratio" else text


def sentence(part: pd.DataFrame) -> str:
    """Return the verdicts on a claim in all its cells, in one sentence.

    `part` has the rows of one claim in a table of verdicts.
    """
    testable = part["verdict"] != NOT_TESTABLE
    if part["statistic"].iloc[0] == "published-run" and testable.any():
        cells = zip(testable, part["p"], strict=True)
        return ", ".join(p_is(p) if known else NOT_TESTABLE for known, p in cells)
    if part["verdict"].nunique() == 1:
        verdict = str(part["verdict"].iloc[0])
        if verdict == NOT_TESTABLE:
            return f"{verdict}: {part['why'].iloc[0]}"
        if part["set"].nunique() > 1:
            return f"{verdict} under every reading and with both sets"
        return f"{verdict} under every reading" if len(part) > 1 else verdict
    texts = [_of_set(rows) for _, rows in part.groupby("set", sort=False)]
    names = [SET_LABELS[set] for set in part["set"].unique()]
    if len(texts) == 1:
        return texts[0]
    return "; ".join(f"{name}: {text}" for name, text in zip(names, texts, strict=True))


def _of_set(rows: pd.DataFrame) -> str:
    """Return the verdicts with one set: a single one, or by reading."""
    if rows["verdict"].nunique() == 1:
        return f"{rows['verdict'].iloc[0]}{' under every reading' if len(rows) > 1 else ''}"
    parts = []
    for verdict, some in rows.groupby("verdict", sort=False):
        labels = " and ".join(F_LABELS[reading] for reading in some["reading"])
        parts.append(f"{verdict} under {labels}")
    return ", ".join(parts)


def consistency(rows: pd.DataFrame) -> str:
    """Say in which cells an effect is consistent with the paper's; where not, on which side."""
    names = {"yes": "consistent with it", "larger": "larger", "smaller": "smaller"}
    cells: dict[str, list[str]] = {}
    for row in rows.itertuples():
        reading = F_LABELS[row.reading].split(" (")[0]
        place = PLACES.get(row.id, "") if rows["id"].nunique() > 1 else ""
        cells.setdefault(_size(row), []).append(f"{reading}{place}")
    if len(cells) == 1:
        return names[next(iter(cells))] + (" under every reading" if len(rows) > 1 else "")
    parts = [f"{text} under {_listed(cells[key])}" for key, text in names.items() if key in cells]
    return ", and ".join(parts)


def _listed(words: list[str]) -> str:
    *most, last = words
    return f"{'; '.join(most)} and {last}" if most else last


PLACES = {"SAVES-OPEN": " (open)", "SAVES-OBSTACLES": " (obstacles)"}


def _size(row: Any) -> str:
    """Return "yes" if an effect is consistent with the paper's, or else what it is beside it.

    A ratio of SDs is an effect the larger the farther it is below 1.
    """
    if row.consistent != "no":
        return str(row.consistent)
    beyond = row.effect > row.predicted_high
    return "larger" if beyond != (row.statistic == "sd-ratio") else "smaller"


def readable_predictions(table: pd.DataFrame) -> pd.DataFrame:
    """Return what was predicted for each claim, beside what came out.

    An effect that the paper reports, too, is also held against the paper's.
    """
    rows = []
    for id, part in table.groupby("id", sort=False):
        claim = load_claims().by_id(str(id))
        if claim.prediction:
            like = claim.prediction.removeprefix("as ")
            predicted = f"as for: {LABELS[like]}" if like in LABELS else claim.prediction
            row = {"Claim": LABELS.get(claim.id, claim.claim), "Predicted": predicted}
            row |= {"Came out": sentence(part), "Beside the paper's": "–"}
            if (part["consistent"] != "").all():
                texts = [
                    f"{SET_LABELS[set]}: ".removeprefix("–: ") + consistency(own)
                    for set, own in part.groupby("set", sort=False)
                ]
                row["Beside the paper's"] = "; ".join(texts)
            rows.append(row)
    return pd.DataFrame(rows)


def verdict_lines(table: pd.DataFrame, terminal: int = 100) -> list[str]:
    """Return judged claims for a terminal of some width: what each says, and its verdicts."""
    names = [LABELS.get(id, id) for id in table["id"].unique()]
    width = max(map(len, names)) + 2
    lines = []
    for name, (_, part) in zip(names, table.groupby("id", sort=False), strict=True):
        first, *rest = textwrap.wrap(sentence(part), max(terminal - width, 20))
        lines += [name.ljust(width) + first, *(" " * width + line for line in rest)]
    return lines


# --- specifications --------------------------------------------------------------------------


def readable_outcomes(table: pd.DataFrame) -> pd.DataFrame:
    """Return in how many specifications each claim holds."""
    groups = {"single": "one at a time", "factorial": "all at once"}
    return readable(
        table,
        {
            "Claim": lambda row: label(row.claim),
            "Choices": lambda row: groups[row.group],
            "Specifications": lambda row: row.specifications,
            "Holds": lambda row: row.holds,
            "Open": lambda row: row.open,
            "Reversed": lambda row: row.reversed,
            "Undefined": lambda row: row.undefined,
            "With capped trials": lambda row: row.with_caps,
            "Holds in the others": lambda row: f"{row.holds_uncapped} of {row.uncapped}",
            "As the default": lambda row: row.unchanged,
            "Shown by itself": lambda row: "–" if np.isnan(row.p_holds) else row.alone,
            "Joint p: median, number": lambda row: (
                f"{p_value(row.p_median)}, {p_value(row.p_holds)}"
            ),
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
    return readable(table, METHOD | choices | MEAN | median | _capped(table) | more)
