"""From tidy trials to the tables of the paper: computing only, no drawing and no running."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from replication.demos.model import Demos
from replication.envs.maze import Maze
from replication.evidence.claims import LABELS
from replication.evidence.experiments import F_LABELS, Key
from replication.evidence.statistics import Comparison, compare, holm, mean_prediction, summarise
from replication.evidence.verdicts import NOT_TESTABLE, REPRODUCED, overall
from replication.files import write_file
from replication.irl import READINGS, get_method
from replication.irl.expectations import visited
from replication.paper.published import Published
from replication.trials.condition import Condition


def rows_of(trials: pd.DataFrame, condition: Condition) -> pd.DataFrame:
    """Return the rows of one condition in tidy trials, in the order of the trials.

    Raises
    ------
    KeyError
        If there are none.
    """
    chosen = trials[
        (trials["task"] == condition.demos.task)
        & (trials["method"] == condition.method)
        & (trials["choices"].fillna("") == condition.choices)
    ]
    if chosen.empty:
        raise KeyError(f"no trials of {condition.method} with choices {condition.choices!r}")
    return chosen.sort_values("trial")


def comparison(
    trials: pd.DataFrame, x: Condition, y: Condition, *, published: float = np.nan
) -> Comparison:
    """Compare the iterations of two conditions, trial by trial."""
    a, b = rows_of(trials, x), rows_of(trials, y)
    capped = not (a["converged"].all() and b["converged"].all())
    return compare(a["iterations"], b["iterations"], capped=capped, published=published)


def summary_table(
    trials: pd.DataFrame, conditions: Mapping[Key, Condition], published: Mapping[str, Published]
) -> pd.DataFrame:
    """Return one row a condition: our iterations beside the published ones (Tables I and II).

    The prediction interval says where the mean of a replication with as many trials as ours should
    lie if it drew from the paper's distribution; `p_paper` is Welch's test of equal means.
    """
    rows = []
    for (method, f), condition in conditions.items():
        own = rows_of(trials, condition)
        ours = summarise(own["iterations"], own["converged"])
        row = {"method": get_method(method).label, "F": f, **asdict(ours)}
        if method in published:
            paper = published[method]
            row |= {"paper_mean": paper.mean, "paper_sd": paper.sd}
            if paper.n > 1:
                low, high = mean_prediction(paper.mean, paper.sd, paper.n, ours.n)
                test = stats.ttest_ind_from_stats(
                    ours.mean, ours.sd, ours.n, paper.mean, paper.sd, paper.n, equal_var=False
                )
                row |= {"predicted_low": low, "predicted_high": high, "p_paper": test.pvalue}
        rows.append(row)
    return pd.DataFrame(rows)


PAIRS = (("unified", "adaboost"), ("unified-incorrect", "unified"))
"""What is compared: the first method of each with the second."""


def contrasts_table(trials: pd.DataFrame, conditions: Mapping[Key, Condition]) -> pd.DataFrame:
    """Return the methods compared in pairs, trial by trial, under both readings of Eq. 9.

    One row a pair and reading, with everything in :class:`replication.evidence.statistics.Comparison`. These
    are effects with their intervals; the verdicts on the paper's claims are those of
    :mod:`replication.evidence.verdicts`, which also adjusts for the number of tests.
    """
    rows = []
    for one, other in PAIRS:
        for f in dict.fromkeys(f for method, f in conditions if method == one):
            y = conditions.get((other, f), conditions.get((other, "")))
            if y is not None:
                found = asdict(comparison(trials, conditions[one, f], y))
                del found["power"]
                rows.append({"x": one, "y": other, "F": f, **found})
    return pd.DataFrame(rows)


def readable_contrasts(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of contrasts as a reader wants it."""
    labels = [
        f"{get_method(x).label} against {get_method(y).label}"
        for x, y in zip(table["x"], table["y"], strict=True)
    ]
    readable = pd.DataFrame({"Compared": labels, "F": table["F"].map(F_LABELS)})
    readable["Iterations [95 %]"] = [
        _interval(*row)
        for row in zip(table["difference"], table["low"], table["high"], strict=True)
    ]
    readable["SD × [95 %]"] = [
        _interval(*row)
        for row in zip(table["sd_ratio"], table["sd_low"], table["sd_high"], strict=True)
    ]
    readable["P(fewer)"] = table["fewer"].map(_number)
    readable["p, signed rank"] = table["p_wilcoxon"].map(_p)
    readable["p, spread"] = table["p_spread"].map(_p)
    return readable


def sets_table(trials: pd.DataFrame, conditions: Mapping[Key, Condition]) -> pd.DataFrame:
    """Return one row for each set of incorrect demonstrations and reading of Eq. 9.

    Beside the difference from no incorrect demonstrations stand the numbers of pairs by their
    distance from the correct path, see :func:`pairs_near`. P-values are adjusted over all rows.
    """
    rows = []
    for (kinds, f), condition in conditions.items():
        found = comparison(trials, condition, conditions["none", f])
        own = rows_of(trials, condition)
        ours = summarise(own["iterations"], own["converged"])
        rows.append(
            {
                "set": kinds,
                "F": f,
                "demonstrations": len(condition.selected.incorrect),
                **pairs_near(condition.selected),
                "mean": ours.mean,
                "sd": ours.sd,
                "difference": found.difference,
                "low": found.low,
                "high": found.high,
                "p": np.nan if kinds == "none" else found.p_wilcoxon,
            }
        )
    table = pd.DataFrame(rows)
    table["p_holm"] = np.nan
    judged = table["set"] != "none"
    table.loc[judged, "p_holm"] = holm(table.loc[judged, "p"].tolist())
    return table


def pairs_near(demos: Demos) -> dict[str, int]:
    """Count the pairs that incorrect demonstrations mark, by distance from the correct path.

    A pair that a correct demonstration visits as well is not marked (Algorithm 2, line 11).

    Returns
    -------
    dict
        `pairs`: all marked pairs; `leaving`: those whose state lies on the correct path, so that
        the pair leaves it; in a maze also `beside`: those one move away from it.
    """
    world = demos.environment
    shape = world.n_states, world.n_actions
    marked = visited(demos.incorrect, shape=shape) & ~visited(demos.correct, shape=shape)
    on_path = np.zeros(world.n_states, dtype=bool)
    for demo in demos.correct:
        on_path[demo.states] = True
    counts = {"pairs": int(marked.sum()), "leaving": int(marked[on_path].sum())}
    if isinstance(world, Maze):
        beside = on_path[world.next_state].any(axis=1) & ~on_path
        counts["beside"] = int(marked[beside].sum())
    return counts


def readable_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return a summary table as a reader wants it: mean (SD) beside the paper's."""
    readable = table[["method"]].rename(columns={"method": "Method"})
    readable["F"] = table["F"].map(F_LABELS)
    readable["Mean [95 %]"] = [
        _interval(*row) for row in zip(table["mean"], table["low"], table["high"], strict=True)
    ]
    readable["SD"] = table["sd"].map(_number)
    readable["Median (quartiles)"] = _quartiles(table)
    readable["At the cap"] = [
        f"{c} of {n}" for c, n in zip(table["capped"], table["n"], strict=True)
    ]
    if "paper_mean" in table:
        readable["Paper: mean (SD)"] = [
            "–" if np.isnan(mean) else f"{mean:.2f} ({_number(sd)})"
            for mean, sd in zip(table["paper_mean"], table["paper_sd"], strict=True)
        ]
    if "predicted_low" in table:
        readable["Predicted mean"] = [
            "–" if np.isnan(low) else f"{low:.1f} to {high:.1f}"
            for low, high in zip(table["predicted_low"], table["predicted_high"], strict=True)
        ]
    return readable


def readable_sets(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of sets as a reader wants it, both readings of Eq. 9 in one row."""
    keys = ["set", "demonstrations", "pairs", "leaving", "beside"]
    readable = table[keys].drop_duplicates().reset_index(drop=True)
    for f, part in table.groupby("F", sort=False):
        label = F_LABELS[f]
        readable[f"{label}: mean (SD)"] = [
            f"{_number(mean)} ({_number(sd)})"
            for mean, sd in zip(part["mean"], part["sd"], strict=True)
        ]
        readable[f"{label}: saves"] = [
            "–" if kinds == "none" else _interval(0 - difference, 0 - high, 0 - low)
            for kinds, difference, low, high in zip(
                part["set"], part["difference"], part["low"], part["high"], strict=True
            )
        ]
    return readable.rename(columns={key: key.capitalize() for key in keys})


def readable_verdicts(table: pd.DataFrame) -> pd.DataFrame:
    """Return judged claims as a reader wants them: one row a claim, both readings side by side."""
    rows = []
    for _, part in table.groupby("id", sort=False):
        first = part.iloc[0]
        own = {row.F: row for row in part.itertuples()}
        row = {"Claim": first["claim"], "Place": first["place"], "Paper": _paper(first)}
        for f in READINGS:
            one = own.get(f, own.get("") if f == READINGS[0] else None)
            row[F_LABELS[f]] = "–" if one is None else _effect(one)
        rows.append({**row, "Verdict": _verdict(part)})
    return pd.DataFrame(rows)


def verdict_lines(table: pd.DataFrame) -> list[str]:
    """Return judged claims for a terminal, below a head: a line each, the verdict first."""
    head = {"Verdict": "verdict", "Paper": "paper"} | {F_LABELS[f]: F_LABELS[f] for f in READINGS}
    rows = [head | {"Claim": "claim"}]
    for (id, part), row in zip(
        table.groupby("id", sort=False), readable_verdicts(table).to_dict("records"), strict=True
    ):
        verdict = overall(part["verdict"].tolist())
        rows.append(row | {"Verdict": verdict, "Claim": LABELS.get(str(id), str(id))})
    return [
        f"{row['Verdict']:<16}{row['Paper']:<8}"
        + "".join(f"{row[F_LABELS[f]]:<23}" for f in READINGS)
        + row["Claim"]
        for row in rows
    ]


def _verdict(part: pd.DataFrame) -> str:
    """Return the verdict on a claim; why there is none, or what each reading gives."""
    verdict = overall(part["verdict"].tolist())
    if verdict == NOT_TESTABLE:
        verdict = f"{verdict}: {part['why'][part['verdict'] == NOT_TESTABLE].iloc[0]}"
    elif part["verdict"].nunique() > 1:
        each = (f"{F_LABELS[row.F].split()[0]} {row.verdict}" for row in part.itertuples())
        verdict = f"{verdict} ({', '.join(each)})"
    return f"**{verdict}**" if verdict == REPRODUCED else verdict


def _paper(row: pd.Series) -> str:
    if np.isnan(row["paper"]):
        return "–"
    return f"× {row['paper']:.2f}" if row["statistic"] == "sd-ratio" else f"{row['paper']:.2f}"


def _effect(row: Any) -> str:
    """Return an effect with its interval, in the unit of its statistic."""
    if np.isnan(row.effect):
        return "–"
    if row.statistic == "published-run":
        return f"median {row.effect:g}; {row.low:.0f} to {row.high:.0f}"
    text = _interval(row.effect, row.low, row.high)
    return f"× {text}" if row.statistic == "sd-ratio" else text


def readable_outcomes(table: pd.DataFrame) -> pd.DataFrame:
    """Return in how many specifications each claim holds, as a reader wants it."""
    groups = {"single": "one at a time", "factorial": "all at once"}
    readable = pd.DataFrame({"Claim": table["claim"], "Choices": table["group"].map(groups)})
    for name in ("specifications", "holds", "open", "reversed", "undefined"):
        readable[name.capitalize()] = table[name]
    readable["With capped trials"] = table["with_caps"]
    readable["Holds in the others"] = [
        f"{row.holds_uncapped} of {row.uncapped}" for row in table.itertuples()
    ]
    readable["As the default"] = table["unchanged"]
    readable["Effect: median (least, largest)"] = [
        f"{row.median:.2f} ({row.lowest:.2f}, {row.highest:.2f})" for row in table.itertuples()
    ]
    return readable


def readable_levels(table: pd.DataFrame, claim: str) -> pd.DataFrame:
    """Return what goes with each value of each choice for one claim, as a reader wants it."""
    own = table[table["claim"] == claim]
    return pd.DataFrame(
        {
            "Choice": own["choice"],
            "Value": [
                f"{row.value} (default)" if row.default else str(row.value)
                for row in own.itertuples()
            ],
            "Mean effect": own["mean_effect"].map(_number),
            "Holds": own["holds"].map("{:.0%}".format),
            "Reversed": own["reversed"].map("{:.0%}".format),
        }
    )


def readable_ablations(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table of ablations as a reader wants it."""
    readable = pd.DataFrame({"Setting": table["setting"]})
    readable["Mean [95 %]"] = [
        _interval(*row) for row in zip(table["mean"], table["low"], table["high"], strict=True)
    ]
    readable["SD"] = table["sd"].map(_number)
    readable["Median"] = table["median"].map("{:g}".format)
    readable["At the cap"] = [
        f"{c} of {n}" for c, n in zip(table["capped"], table["n"], strict=True)
    ]
    readable["More than the first [95 %]"] = [
        _interval(*row)
        for row in zip(table["more"], table["more_low"], table["more_high"], strict=True)
    ]
    return readable


def markdown(table: pd.DataFrame) -> str:
    """Return a table as Markdown, with columns that line up as text, too."""
    rows = [list(map(str, row)) for row in (table.columns, *table.itertuples(index=False))]
    widths = [max(3, *map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, ["-" * width for width in widths])
    lines = (" | ".join(map(str.ljust, row, widths)) for row in rows)
    return "".join(f"| {line} |\n" for line in lines)


def write_csv(table: pd.DataFrame, path: Path) -> Path:
    """Write a table as CSV: ten significant digits, the same on every platform."""
    return write_file(path, table.to_csv(index=False, float_format="%.10g", lineterminator="\n"))


def read_table(path: Path) -> pd.DataFrame:
    """Read a table that was written as CSV; what is empty is NaN in columns of numbers only."""
    table = pd.read_csv(path, keep_default_na=False, na_values=[""])
    for name in table:
        if table[name].dtype.kind not in "fiub" or name in ("F", "reading"):
            table[name] = table[name].astype(object).where(table[name].notna(), "")
    return table


def write_trials(trials: pd.DataFrame, path: Path) -> Path:
    """Write tidy trials, keeping the rows of other tasks that the file already has."""
    if path.exists():
        others = pd.read_csv(path, keep_default_na=False)
        others = others[~others["task"].isin(trials["task"].unique())]
        trials = pd.concat([others, trials])
    return write_csv(trials.sort_values(["task", "method", "choices", "trial"]), path)


def _interval(middle: float, low: float, high: float) -> str:
    if np.isnan(low):
        return _number(middle)
    return f"{middle:.2f} [{low:.2f}, {high:.2f}]"


def _quartiles(table: pd.DataFrame) -> list[str]:
    return [
        f"{m:g} ({a:g}–{b:g})"
        for m, a, b in zip(table["median"], table["quartile_1"], table["quartile_3"], strict=True)
    ]


def _number(x: float) -> str:
    return "–" if np.isnan(x) else f"{x:.2f}"


def _p(p: float) -> str:
    if np.isnan(p):
        return "–"
    return "< 0.001" if p < 0.001 else f"{p:.3f}"
