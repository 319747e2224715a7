"""What the site shows of all notebooks together, as Markdown: verdicts and the citation."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping
from typing import Any

import pandas as pd
import yaml

from replication.evidence.claims import evidence
from replication.evidence.experiments import NAMED, NONE
from replication.irl import READINGS
from replication.report.findings import NOT_TESTED, robustness
from replication.report.outputs import TRIALS
from replication.report.readable import (
    F_LABELS,
    SET_LABELS,
    markdown,
    readable_verdicts,
    sentence,
)
from replication.site.extension import HOLDS
from replication.site.pages import anchor

WIDTH, MARGIN, LINE = 190, 6, 10
"""Of an interval plot, in pixels; a cell takes one line."""


def verdicts(judged: pd.DataFrame, holds: Mapping[str, tuple[int, int]]) -> str:
    """Return the claims with their intervals, each verdict with a link to its evidence.

    Parameters
    ----------
    judged
        The table of verdicts.
    holds
        By claim, in how many of the other specifications it holds, and how many there are.
    """
    rows = []
    for id, part in _comparative(judged).groupby("id", sort=False):
        first = part.iloc[0]
        notebook, name = evidence(first["task"], first["measure"]).split("/")
        shown = (
            f"figures/{notebook}/{TRIALS}.xz"
            if f"{name}.csv" == TRIALS
            else f"#{anchor(notebook, name)}"
        )
        count, of = holds[str(id)]
        word = f"{count} of {of}: **{robustness(part, count, of)}**" if of else NOT_TESTED
        paper = "–" if math.isnan(first["paper"]) else f"{first['paper']:.2f}"
        rows.append(
            {
                "Claim": first["claim"],
                "Verdict": f"[{sentence(part)}]({shown})",
                "Paper": f"{paper} ({first['place']})".removeprefix("– "),
                "Effects, with 95 % intervals": interval_plot(part),
                HOLDS: word,
            }
        )
    return markdown(pd.DataFrame(rows))


def published(judged: pd.DataFrame) -> str:
    """Return the verdicts on the published numbers themselves."""
    return markdown(readable_verdicts(judged[judged["statistic"].str.startswith("published")]))


def _comparative(judged: pd.DataFrame) -> pd.DataFrame:
    return judged[~judged["statistic"].str.startswith("published")]


# --- a small picture of a claim --------------------------------------------------------------


def interval_plot(part: pd.DataFrame) -> str:
    """Return the effects of a claim as a small picture, one line of SVG in the page's own colours.

    A line for each cell: a circle is F_i, a square F_(i+1), a diamond the maximum at once; hollow
    marks are those of the named kinds. Grey lies within the margin; a triangle is the paper's
    effect.
    """
    first = part.iloc[0]
    paper, margin = float(first["paper"]), float(part["margin"].max())
    ratio, share = (first["statistic"] == name for name in ("sd-ratio", "share"))
    neutral = margin if share else float(ratio)
    ends = (1.0, margin) if share else (margin, 1 / margin) if ratio else (-margin, margin)
    values = [neutral, paper, *ends, *part[["effect", "low", "high"]].to_numpy(float).ravel()]
    known = [value for value in values if not math.isnan(value)]
    left, width = min(known), (max(known) - min(known)) or 1.0
    height = LINE * (len(part) + 2)

    def x(value: float) -> float:
        return round(MARGIN + (value - left) / width * (WIDTH - 2 * MARGIN), 1)

    marks = []
    if not math.isnan(margin) and not share:
        begin, end = map(x, ends)
        marks.append(
            _mark("rect", "margin", x=begin, y=0, width=round(end - begin, 1), height=height)
        )
    marks.append(_mark("line", "edge", x1=x(neutral), x2=x(neutral), y1=0, y2=height))
    for line, row in enumerate(part.itertuples()):
        if math.isnan(row.effect):
            continue
        reading, y, at = row.reading or READINGS[0], LINE * (line + 1), x(row.effect)
        kind = f"{reading} hollow" if row.set == NAMED else reading
        marks.append(_mark("line", reading, x1=x(row.low), x2=x(row.high), y1=y, y2=y))
        if reading == READINGS[0]:
            marks.append(_mark("circle", kind, cx=at, cy=y, r=3.5))
        elif reading == READINGS[1]:
            marks.append(_mark("rect", kind, x=round(at - 3, 1), y=y - 3, width=6, height=6))
        else:
            corners = f"{at - 4:.1f},{y} {at},{y - 4} {at + 4:.1f},{y} {at},{y + 4}"
            marks.append(_mark("polygon", kind, points=corners))
    if not math.isnan(paper):
        at, y = x(paper), height
        marks.append(
            _mark(
                "polygon",
                "paper",
                points=f"{at - 5:.1f},{y - 10} {at + 5:.1f},{y - 10} {at},{y - 1}",
            )
        )
    return (
        f'<svg class="interval" role="img" aria-label="{html.escape(_in_words(part))}" '
        f'viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}">{"".join(marks)}</svg>'
    )


def _mark(shape: str, kind: str, **places: object) -> str:
    numbers = " ".join(f'{name}="{value}"' for name, value in places.items())
    return f'<{shape} class="{kind}" {numbers}></{shape}>'


def _in_words(part: pd.DataFrame) -> str:
    paper, margin = float(part["paper"].iloc[0]), float(part["margin"].max())
    cells = []
    for row in part.itertuples():
        cell = F_LABELS[row.reading or READINGS[0]]
        cell += "" if row.set == NONE else f", {SET_LABELS[row.set]}"
        known = f"{row.effect:.3g} from {row.low:.3g} to {row.high:.3g}"
        cells.append(f"{cell}: {'no number' if math.isnan(row.effect) else known}")
    sentences = ["; ".join(cells)]
    sentences += [] if math.isnan(margin) else [f"Margin: {margin:.3g}"]
    sentences += [] if math.isnan(paper) else [f"Paper: {paper:.3g}"]
    return ". ".join(sentences) + "."


# --- the citation ----------------------------------------------------------------------------


def citation(text: str) -> str:
    """Return how to cite, from the text of CITATION.cff."""
    cff: dict[str, Any] = yaml.safe_load(text)
    paper = cff["references"][0]
    authors = [f"{author['given-names']} {author['family-names']}" for author in paper["authors"]]
    doi = f"doi:{cff['doi']}" if "doi" in cff else "no DOI yet: it is shown here after a release"
    software = ", ".join(author["name"] for author in cff["authors"])
    return (
        f"**The paper:** {', '.join(authors[:-1])} and {authors[-1]}. *{paper['title']}*.\n\n"
        f"**This package:** {software}. *{cff['title']}*. Version {cff['version']} ({doi}).\n"
    )
