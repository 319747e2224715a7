"""The findings in words: ``docs/findings.md.jinja`` with the numbers of the published tables.

The template picks rows of tables by their keys, and rounds by the filters at the end of this file.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd

from replication import files
from replication.evidence.calibration import grid
from replication.evidence.claims import load_claims
from replication.evidence.experiments import EXPERIMENTS
from replication.evidence.tables import read_table
from replication.evidence.verdicts import (
    NOT_TESTABLE,
    REPRODUCED,
    by_claim,
    judged_trials,
    overall,
    read_trials,
)
from replication.report.findings import at_once, chance, holding
from replication.report.readable import markdown, readable_verdicts

TEMPLATE = "findings.md.jinja"

OPPOSITE = ("opposite", "hit+detour+opposite", "all")
"""The values of INCORRECT-KINDS that include the opposite direction."""


def render_findings(figures: Path) -> tuple[str, str]:
    """Return the page of findings, and the rows of its answer, as Markdown.

    A name that the template uses and the numbers lack raises `jinja2.UndefinedError`.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(files.PROJECT / "docs"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,
    )
    environment.filters |= {
        "fixed": fixed,
        "percent": "{:.0%}".format,
        "interval": interval,
        "saving": saving,
    }
    template = environment.get_template(TEMPLATE)
    context = numbers(figures)
    answer = "".join(template.blocks["answer"](template.new_context(context)))
    return template.render(context), answer


def numbers(figures: Path) -> dict[str, Any]:
    """Return what the template is given: rows of the tables below `figures`, and a few sums."""

    def read(name: str) -> pd.DataFrame:
        return read_table(figures / f"{name}.csv")

    judged, effects = read("claims/verdicts"), read("sensitivity/effects")
    factorial = effects[effects["group"] == "factorial"]
    outcomes, levels = read("sensitivity/outcomes"), read("sensitivity/levels")
    pairs = read("sensitivity/numbers")
    trials = judged_trials(read_trials(figures), load_claims().judging)
    compared = judged[judged["direction"] != "inside"]
    holds = [holding(effects, id) for id, _ in by_claim(compared)]
    verdict = {id: overall(rows["verdict"].tolist()) for id, rows in by_claim(judged)}
    published = [verdict[claim.id] for claim in load_claims().claim if claim.direction == "inside"]
    kinds = levels[(levels["claim"] == "SAVES-OPEN") & (levels["choice"] == "INCORRECT-KINDS")]
    opposite = kinds["value"].isin(OPPOSITE)
    check = read("calibration/check").to_dict("records")
    return {
        "judging": load_claims().judging,
        "verdict": verdict,
        "verdicts": markdown(
            readable_verdicts(compared).assign(**{"Holds with other choices": holds})
        ),
        "tested": len(published) - published.count(NOT_TESTABLE),
        "reproduced": published.count(REPRODUCED),
        "claim": by_key(judged, "id", "reading"),
        "outcomes": by_key(outcomes[outcomes["group"] == "factorial"], "claim"),
        "levels": by_key(levels, "claim", "choice", "value"),
        "variance": by_key(read("sensitivity/shares"), "claim", "choice"),
        "kinds": {
            "opposite": kinds.loc[opposite, "holds"].tolist(),
            "other": kinds.loc[~opposite, "holds"].tolist(),
        },
        "ablations": by_key(read("sensitivity/ablations"), "method", "reading", "choices"),
        "every_pair": by_key(pairs[pairs["pairs"] == pairs["pairs"].max()], "reading"),
        "sets": {
            place: by_key(read(f"{place}_maze/sets"), "set", "reading")
            for place in ("open", "obstacle")
        },
        "equal": {task: _equal_errors(trials[trials["task"] == task]) for task in EXPERIMENTS},
        "few": _share_below(trials, judged),
        "reward_sd": _reward_sd(trials),
        "points": len(grid()),
        **dict(zip(("grid", "new", "other"), check, strict=True)),
        "depends": at_once(factorial),
        "chance": chance(factorial),
    }


def _equal_errors(trials: pd.DataFrame) -> dict[str, int]:
    """Return by reading how many trials have as many early errors with incorrect demonstrations."""
    errors = trials.pivot(index="trial", columns=["method", "reading"], values="early_errors")
    same = errors["unified"] == errors["unified-incorrect"]
    return {**same.sum().to_dict(), "trials": len(same)}


def _share_below(trials: pd.DataFrame, judged: pd.DataFrame) -> dict[Any, float]:
    """Return by reading in which share of soccer trials no more are needed than in the paper's."""
    paper = judged.loc[judged["id"] == "RUN-INCORRECT-SOCCER", "paper"].iloc[0]
    rows = trials[(trials["task"] == "soccer") & (trials["method"] == "unified-incorrect")]
    return (rows["iterations"] <= paper).groupby(rows["reading"]).mean().to_dict()


def _reward_sd(trials: pd.DataFrame) -> float:
    """Return the SD between trials of the reward's slope, in the open maze as printed."""
    rows = trials[(trials["task"] == "open-maze") & (trials["method"] == "unified")]
    return float(rows.loc[rows["reading"] == "printed", "reward_slope"].std())


def by_key(table: pd.DataFrame, *keys: str) -> dict[str, Any]:
    """Return the rows of a table in nested dictionaries, one level for each key.

    Examples
    --------
    >>> by_key(pd.DataFrame({"id": ["A"], "reading": ["printed"], "n": [3]}), "id", "reading")
    {'A': {'printed': {'id': 'A', 'reading': 'printed', 'n': 3}}}
    """
    nested: dict[str, Any] = {}
    for row in table.to_dict("records"):
        place = nested
        for key in keys[:-1]:
            place = place.setdefault(str(row[key]), {})
        place[str(row[keys[-1]])] = {str(name): value for name, value in row.items()}
    return nested


# --- filters of the template ---------------------------------------------------------------------


def fixed(value: float, digits: int = 1) -> str:
    """Return a number with so many decimals, without a minus before zero.

    Examples
    --------
    >>> fixed(-0.04), fixed(-0.06)
    ('0.0', '-0.1')
    """
    return f"{value:z.{digits}f}"


def interval(row: Mapping[str, Any], name: str = "effect", digits: int = 1) -> str:
    """Return a number of a row with its interval, named for it or simply `low` and `high`.

    Examples
    --------
    >>> interval({"sd": 5.0, "sd_low": 4.0, "sd_high": 6.0, "low": 1.0}, "sd")
    '5.0 [4.0, 6.0]'
    """
    bounds = (row.get(f"{name}_{end}", row.get(end)) for end in ("low", "high"))
    value, low, high = (fixed(number, digits) for number in (row[name], *bounds))
    return f"{value} [{low}, {high}]"


def saving(row: Mapping[str, Any], name: str = "effect") -> str:
    """Return how many iterations a row saves: its difference with the sign changed.

    Examples
    --------
    >>> saving({"effect": -2.0, "low": -3.0, "high": 0.0})
    '2.0 [0.0, 3.0]'
    """
    turned = {name: -row[name], "low": -row["high"], "high": -row["low"]}
    return interval(turned, name)
