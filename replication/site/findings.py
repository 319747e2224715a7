"""The findings in words: ``docs/findings.md.jinja`` with the numbers of the published tables.

The template picks rows of tables by keys, and rounds by the filters at the end.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd

from replication import files
from replication.evidence.calibration import left_out
from replication.evidence.claims import LABELS, label, load_claims
from replication.evidence.experiments import GENERAL, NAMED, NONE
from replication.evidence.tables import read_table
from replication.evidence.verdicts import CONSISTENT, INCONSISTENT, SHOWN, by_claim
from replication.report.findings import (
    at_once,
    chance,
    counted,
    holding,
    robustness,
    shows_opposite,
)
from replication.report.readable import (
    SET_LABELS,
    consistency,
    markdown,
    p_is,
    readable_verdicts,
    sentence,
)

TEMPLATE = "findings.md.jinja"


def render_findings(figures: Path) -> tuple[str, str]:
    """Return the page of findings, and the rows of its answer, as Markdown.

    A name in the template that the numbers lack raises `jinja2.UndefinedError`.
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
        "thousands": "{:,.0f}".format,
    }
    template = environment.get_template(TEMPLATE)
    context = numbers(figures)
    answer = "".join(template.blocks["answer"](template.new_context(context)))
    return template.render(context), answer


def numbers(figures: Path) -> dict[str, Any]:
    """Return what the template is given: rows of tables below `figures`, and some sums."""

    def read(name: str) -> pd.DataFrame:
        return read_table(figures / f"{name}.csv")

    judged, effects = read("claims/verdicts"), read("sensitivity/effects")
    factorial = effects[effects["group"] == "factorial"]
    compared = judged[~judged["statistic"].str.startswith("published")]
    published = judged[judged["verdict"].isin([CONSISTENT, INCONSISTENT])]
    in_general = compared["id"].isin(["SAVES-OPEN", "SAVES-OBSTACLES"]) & (
        compared["set"] == GENERAL
    )
    levels, pairs = read("sensitivity/levels"), read("sensitivity/numbers")
    methods, screen, final = (
        read(name) for name in ("beyond/methods", "calibration/screen", "calibration/final")
    )
    kinds = levels[(levels["claim"] == "SAVES-OPEN") & (levels["choice"] == "INCORRECT-KINDS")]
    opposite = kinds["value"].map(lambda value: shows_opposite({"INCORRECT-KINDS": value}))
    sentences = {id: sentence(rows) for id, rows in by_claim(judged)}
    claims = {
        name: compared[compared["id"].isin([name, *(f"{name}-{task}" for task in TASKS)])]
        for name in ANSWERED
    }
    saves, soccer = claims["SAVES"], claims["ERRS"]["task"] == "soccer"
    claims["ERRS"], errs_in_soccer = claims["ERRS"][~soccer], claims["ERRS"][soccer]
    return {
        "judging": load_claims().judging,
        "sentence": sentences,
        "on_tasks": {name: _on_tasks(name, sentences) for name in ("SAVES", "AVOIDS", "ERRS")},
        "found": {name: found(rows) for name, rows in claims.items()},
        "found_with": {
            "opposite": found(saves[saves["set"] == GENERAL]),
            "other": found(saves[saves["set"] == NAMED]),
            "soccer": found(saves[saves["task"] == "soccer"]),
        },
        "errs_in_soccer": found(errs_in_soccer),
        "range": {
            "FASTER": _range(claims["FASTER"]),
            "SAVES": _range(saves[saves["set"] == GENERAL]),
        },
        "other": {name: _other(factorial, rows, ANSWERED[name]) for name, rows in claims.items()},
        "verdicts": markdown(readable_verdicts(compared)),
        "holds": [
            (label(id), holding(effects, id)) for id in compared["id"].unique() if id in HOLDING
        ],
        "cell": by_key(judged, "id", "set", "reading"),
        "published": len(published),
        "consistent": int((published["verdict"] == CONSISTENT).sum()),
        "printed": published["id"].nunique(),
        "met": published.loc[published["verdict"] == CONSISTENT, "id"].nunique(),
        "joint": by_key(factorial.drop_duplicates("claim"), "claim"),
        "outcomes": by_key(read("sensitivity/outcomes"), "group", "claim"),
        "levels": by_key(levels, "claim", "choice", "value"),
        "variance": by_key(read("sensitivity/shares"), "claim", "choice"),
        "kinds": {
            "opposite": kinds.loc[opposite, "holds"].tolist(),
            "other": kinds.loc[~opposite, "holds"].tolist(),
        },
        "taken": by_key(read("open_maze/kinds"), "reading", "kind"),
        "taken_soccer": by_key(read("soccer/kinds"), "reading", "kind"),
        "sets": by_key(read("open_maze/sets"), "set", "reading"),
        "ablations": by_key(read("sensitivity/ablations"), "method", "reading", "choices"),
        "every_pair": by_key(pairs[pairs["pairs"] == pairs["pairs"].max()], "reading"),
        "contrasts": by_key(read("open_maze/contrasts"), "x", "set", "reading"),
        "summary": by_key(read("open_maze/table1"), "method", "set", "reading"),
        "points": len(screen),
        "screened": int(screen["n"].max()),
        "finalists": len(final),
        "left_out": left_out(screen),
        "nearest": final.iloc[0].to_dict(),
        "rounding": by_key(
            read("rounding/rounding"), "task", "method", "reading", "tolerance", "arithmetic"
        ),
        "consistency": {
            id: consistency(rows) for id, rows in by_claim(compared[compared["consistent"] != ""])
        },
        "general_size": consistency(compared[in_general]),
        "set_labels": SET_LABELS,
        "methods": by_key(methods, "solver", "task", "method", "reading", "set"),
        "projection": _projection(methods),
        "beginning": by_key(read("beyond/beginning"), "task", "method"),
        "p": p_is,
        "depends": at_once(factorial),
        "chance": chance(factorial),
    }


TASKS = ("OPEN", "OBSTACLES", "SOCCER")
"""How ids of claims end that are judged on each task."""

ANSWERED = {
    "ZERO": "ZERO-OPEN",
    "FASTER": "FASTER",
    "SAVES": "SAVES-OPEN",
    "AVOIDS": "AVOIDS-OPEN",
    "ERRS": "ERRS-OPEN",
}
"""The claims of the answer, on all tasks, and how the specifications on all maps name them."""


def found(rows: pd.DataFrame) -> str:
    """Say in one or two words what came out in all cells together."""
    if rows["verdict"].nunique() == 1:
        return str(rows["verdict"].iloc[0])
    shown = int((rows["verdict"] == SHOWN).sum())
    return f"{SHOWN} in {shown} of {len(rows)} cells" if shown else f"not {SHOWN}"


def _range(rows: pd.DataFrame) -> str:
    """Return the least and the largest effect of some cells."""
    return f"{fixed(rows['effect'].min())} to {fixed(rows['effect'].max())}"


def _other(factorial: pd.DataFrame, judged: pd.DataFrame, id: str) -> dict[str, Any]:
    """Return in how many specifications on all maps a claim holds, and if the finding is robust."""
    holds, count = counted(factorial[factorial["claim"] == id], id)
    return {"holds": holds, "count": count, "word": robustness(judged, holds, count)}


def _projection(methods: pd.DataFrame) -> str:
    """Return which part of the unified method's iterations projection takes in the mazes."""
    own = methods[(methods["solver"] == "q-learning") & (methods["task"] != "soccer")]
    by_method = own[own["set"] == NONE].set_index("task").groupby("method")["iterations"]
    parts = by_method.get_group("projection") / by_method.get_group("unified")
    return f"{parts.min():.0%} to {parts.max():.0%}"


HOLDING = tuple(id for id in LABELS if not id.startswith("ZERO"))
"""The claims of which the findings say in how many other sets of choices they hold."""


def _on_tasks(name: str, sentences: Mapping[str, str]) -> str:
    """Say what a claim about incorrect demonstrations comes to on each task; alike ones at once."""
    open_maze, obstacles, soccer = (sentences[f"{name}-{task}"] for task in TASKS)
    mazes = f"Open maze: {open_maze}. Obstacles: {obstacles}"
    if open_maze == obstacles:
        mazes = f"In both mazes: {open_maze}"
    return f"{mazes}. Soccer: {soccer}"


def by_key(table: pd.DataFrame, *keys: str) -> dict[str, Any]:
    """Return the rows of a table in nested dictionaries, one level for each key."""
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
