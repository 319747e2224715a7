"""What the site shows of all notebooks together: verdicts, choices, the citation.

Each function returns Markdown, computed from the published tables and the registers.
"""

from __future__ import annotations

import html
import math
from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd
import yaml

from replication.evidence.claims import evidence
from replication.irl import READINGS
from replication.paper.register import Choice, load_choices
from replication.report.readable import markdown, readable_verdicts
from replication.site.pages import anchor

WIDTH, HEIGHT, MARGIN = 190, 40, 6
"""Of an interval plot, in pixels."""

HEIGHTS = {"printed": 13, "updated": 27}
"""At which height each reading of Eq. 9 is drawn."""


def verdicts(judged: pd.DataFrame, holds: Mapping[str, str]) -> str:
    """Return the claims with their intervals, each verdict with a link to its evidence.

    Parameters
    ----------
    judged
        The table of verdicts.
    holds
        By claim, in how many of the other specifications it holds.
    """
    compared = judged[judged["direction"] != "inside"]
    readable = readable_verdicts(compared).to_dict("records")
    rows = []
    for (id, part), row in zip(compared.groupby("id", sort=False), readable, strict=True):
        notebook, name = evidence(part["task"].iloc[0], part["measure"].iloc[0]).split("/")
        shown = (
            f"#{anchor(notebook, name)}" if name != "trials" else f"figures/{notebook}/trials.csv"
        )
        rows.append(
            {
                "Claim": row["Claim"],
                "Verdict": f"[{row['Verdict']}]({shown})",
                "Holds with other choices": holds[str(id)],
                "Paper": f"{row['Paper']} ({row['Place']})".removeprefix("– "),
                "Effect, with 95 % interval": interval_plot(part),
                "Fᵢ (printed)": row["Fᵢ (printed)"],
                "Fᵢ₊₁ (updated)": row["Fᵢ₊₁ (updated)"],
            }
        )
    return markdown(pd.DataFrame(rows))


def published(judged: pd.DataFrame) -> str:
    """Return the verdicts on the published numbers themselves."""
    return markdown(readable_verdicts(judged[judged["direction"] == "inside"]))


# --- a small picture of a claim --------------------------------------------------------------


def interval_plot(part: pd.DataFrame) -> str:
    """Return the effects of a claim as a small picture, one line of SVG in the page's own colours.

    The grey side is the claimed one; a circle is the printed reading of Eq. 9, a square the updated
    one, and a triangle the paper's effect.
    """
    first = part.iloc[0]
    margin, paper = float(first["margin"]), float(first["paper"])
    values = [margin, paper, *part[["effect", "low", "high"]].to_numpy(float).ravel()]
    known = [value for value in values if not math.isnan(value)]
    left, width = min(known), (max(known) - min(known)) or 1.0

    def x(value: float) -> float:
        return round(MARGIN + (value - left) / width * (WIDTH - 2 * MARGIN), 1)

    edge = x(margin)
    begin, end = (0.0, edge) if first["direction"] == "less" else (edge, float(WIDTH))
    marks = [
        _mark("rect", "claimed", x=begin, y=0, width=round(end - begin, 1), height=HEIGHT),
        _mark("line", "edge", x1=edge, x2=edge, y1=0, y2=HEIGHT),
    ]
    for row in part.dropna(subset="effect").itertuples():
        reading = _reading(row.reading)
        y, at = HEIGHTS[reading], x(row.effect)
        marks.append(_mark("line", reading, x1=x(row.low), x2=x(row.high), y1=y, y2=y))
        if reading == READINGS[0]:
            marks.append(_mark("circle", reading, cx=at, cy=y, r=4))
        else:
            marks.append(_mark("rect", reading, x=round(at - 3.5, 1), y=y - 3.5, width=7, height=7))
    if not math.isnan(paper):
        at = x(paper)
        marks.append(_mark("polygon", "paper", points=f"{at - 5:.1f},15 {at + 5:.1f},15 {at},24"))
    return (
        f'<svg class="interval" role="img" aria-label="{html.escape(_in_words(part))}" '
        f'viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}">{"".join(marks)}</svg>'
    )


def _mark(shape: str, kind: str, **places: object) -> str:
    numbers = " ".join(f'{name}="{value}"' for name, value in places.items())
    return f'<{shape} class="{kind}" {numbers}></{shape}>'


def _reading(reading: str) -> str:
    """Return a reading of Eq. 9; a claim about a method without a trace has but one line."""
    return reading or READINGS[0]


def _in_words(part: pd.DataFrame) -> str:
    first = part.iloc[0]
    effects = "; ".join(
        f"{_reading(row.reading)} F: {row.effect:.3g} from {row.low:.3g} to {row.high:.3g}"
        for row in part.itertuples()
    )
    paper = "" if math.isnan(first["paper"]) else f" Paper: {first['paper']:.3g}."
    return f"{effects}. Margin: {first['margin']:.3g}.{paper}"


# --- choices and citation --------------------------------------------------------------------


def choices(shares: pd.DataFrame) -> str:
    """Return every choice: a table of all, and a section on each.

    Parameters
    ----------
    shares
        By claim and choice, the share of the variance of the claim's effect over specifications.
    """
    entries = list(load_choices().values())
    table = pd.DataFrame(
        {
            "Choice": [f"[{entry.id}](#choice-{entry.id.lower()})" for entry in entries],
            "Where": [entry.place for entry in entries],
            "Default": [
                f"`{entry.default}`" if entry.field else entry.default for entry in entries
            ],
            "Also accepted": [_alternatives(entry) for entry in entries],
            "Matters most to": [_matters(entry, shares) for entry in entries],
        }
    )
    return "\n".join([markdown(table), *(line for entry in entries for line in _section(entry))])


def _section(entry: Choice) -> Iterator[str]:
    yield f"(choice-{entry.id.lower()})=\n"
    yield f"### {entry.id}\n"
    yield f"*{entry.place}.* {entry.open}\n"
    yield f"**Default:** `{entry.default}`. {entry.rule}\n"
    where = entry.field or entry.data or entry.code
    yield f"**Also accepted:** {_alternatives(entry)}. **Where it is set:** `{where}`.\n"


def _alternatives(entry: Choice) -> str:
    if entry.range is not None:
        return f"{entry.range[0]:g} to {entry.range[1]:g}"
    return ", ".join(f"`{value}`" for value in entry.alternatives) or "–"


def _matters(entry: Choice, shares: pd.DataFrame) -> str:
    varied = shares[shares["choice"] == ("MAP" if entry.id.startswith("MAP-") else entry.id)]
    large = varied[varied["share"] >= 0.05].sort_values("share", ascending=False)
    claims = ", ".join(f"{row.claim} ({100 * row.share:.0f} %)" for row in large.itertuples())
    return claims or ("none" if len(varied) else "–")


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
