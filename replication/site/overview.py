"""What the site says of all notebooks together: verdicts at a glance, choices, the citation.

Each function returns Markdown, computed from the published results and the registers.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from itertools import chain
from typing import Any

import pandas as pd
import yaml

from replication.evidence.tables import markdown, readable_verdicts
from replication.irl import READINGS
from replication.paper.register import Choice, load_choices
from replication.site.pages import anchor

EVIDENCE = {
    ("open-maze", "iterations"): "table1_contrasts",
    ("open-maze", "converged"): "fig05",
    ("open-maze", "q_growth"): "fig07",
    ("open-maze", "q_slope"): "fig07",
    ("open-maze", "reward_slope"): "fig07",
    ("obstacle-maze", "iterations"): "table2_contrasts",
    ("obstacle-maze", "converged"): "fig09_errors",
    ("soccer", "iterations"): "soccer_contrasts",
    ("soccer", "converged"): "fig12",
}
"""Where the numbers behind a claim are shown, by task and measure; else with all claims' trials."""

WIDTH, HEIGHT, MARGIN = 190, 40, 6
"""Of an interval plot, in pixels."""


def verdicts(judged: pd.DataFrame) -> str:
    """Return the claims with their intervals, each verdict with a link to its evidence."""
    compared = judged[judged["direction"] != "inside"]
    readable = readable_verdicts(compared)
    rows = []
    for (_, part), row in zip(
        compared.groupby("id", sort=False), readable.to_dict("records"), strict=True
    ):
        first = part.iloc[0]
        evidence = EVIDENCE.get((first["task"], first["measure"]), "claims_trials")
        rows.append(
            {
                "Claim": row["Claim"],
                "Verdict": f"[{row['Verdict']}](#{anchor(evidence)})",
                "Paper": f"{row['Paper']} ({row['Place']})".removeprefix("– "),
                "Effect, with 95 % interval": interval_plot(part),
                "Fᵢ (printed)": row["Fᵢ (printed)"],
                "Fᵢ₊₁ (updated)": row["Fᵢ₊₁ (updated)"],
            }
        )
    return markdown(pd.DataFrame(rows))


def published(judged: pd.DataFrame) -> str:
    """Return how the published numbers themselves come out."""
    inside = judged[judged["direction"] == "inside"]
    return markdown(readable_verdicts(inside))


def interval_plot(part: pd.DataFrame) -> str:
    """Return the effects of a claim as a small picture, one line of SVG in the page's own colours.

    The grey side is the claimed one; a circle is the printed reading of Eq. 9, a square the updated
    one, and a triangle the paper's effect.
    """
    first = part.iloc[0]
    margin, paper = float(first["margin"]), float(first["paper"])
    ends = [margin, *part["low"], *part["high"], *part["effect"]]
    known = [float(one) for one in (*ends, paper) if not math.isnan(one)]
    low, high = min(known), max(known)
    scale = (WIDTH - 2 * MARGIN) / ((high - low) or 1.0)

    def x(value: float) -> float:
        return round(MARGIN + (value - low) * scale, 1)

    edge = x(margin)
    side = (0.0, edge) if first["direction"] == "less" else (edge, WIDTH - edge)
    marks = [
        f'<rect class="claimed" x="{side[0]}" y="0" width="{round(side[1], 1)}" '
        f'height="{HEIGHT}"></rect>',
        f'<line class="edge" x1="{edge}" x2="{edge}" y1="0" y2="{HEIGHT}"></line>',
    ]
    for one in part.itertuples():
        if math.isnan(one.effect):
            continue
        kind, y, at = (
            _reading(one.F),
            {"printed": 13, "updated": 27}[_reading(one.F)],
            x(one.effect),
        )
        marks.append(
            f'<line class="{kind}" x1="{x(one.low)}" x2="{x(one.high)}" y1="{y}" y2="{y}"></line>'
        )
        shape = (
            f'<circle class="{kind}" cx="{at}" cy="{y}" r="4"></circle>'
            if kind == "printed"
            else f'<rect class="{kind}" x="{at - 3.5:.1f}" y="{y - 3.5}" width="7" height="7">'
            "</rect>"
        )
        marks.append(shape)
    if not math.isnan(paper):
        at = x(paper)
        marks.append(
            f'<polygon class="paper" points="{at - 5:.1f},15 {at + 5:.1f},15 {at},24"></polygon>'
        )
    said = html.escape(_in_words(part), quote=True)
    return (
        f'<svg class="interval" role="img" aria-label="{said}" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'width="{WIDTH}" height="{HEIGHT}">{"".join(marks)}</svg>'
    )


def _reading(f_index: str) -> str:
    """Return the reading of Eq. 9; a claim about a method without a trace has but one line."""
    return f_index or READINGS[0]


def _in_words(part: pd.DataFrame) -> str:
    first = part.iloc[0]
    own = "; ".join(
        f"{_reading(row.F)} F: {row.effect:.3g} from {row.low:.3g} to {row.high:.3g}"
        for row in part.itertuples()
    )
    paper = "" if math.isnan(first["paper"]) else f" Paper: {first['paper']:.3g}."
    return f"{own}. Margin: {first['margin']:.3g}.{paper}"


def choices(shares: pd.DataFrame) -> str:
    """Return every choice: a table of all, and below it what is known of each.

    Parameters
    ----------
    shares
        By claim and choice, the share of the variance of the claim's effect over specifications.
    """
    entries = list(load_choices().values())
    table = pd.DataFrame(
        {
            "Choice": [f"[{one.id}](#choice-{one.id.lower()})" for one in entries],
            "Where": [one.place for one in entries],
            "Default": [f"`{one.default}`" if one.field else one.default for one in entries],
            "Also accepted": [_alternatives(one) for one in entries],
            "Matters most to": [_matters(one, shares) for one in entries],
        }
    )
    return "\n".join([markdown(table), *chain.from_iterable(map(_choice, entries))])


def _choice(one: Choice) -> Sequence[str]:
    embodied = one.field or one.data or one.code
    return (
        f"(choice-{one.id.lower()})=",
        "",
        f"### {one.id}",
        "",
        f"*{one.place}.* {one.open}",
        "",
        f"**Default:** `{one.default}`. {one.rule}",
        "",
        f"**Also accepted:** {_alternatives(one)}. **Where it is set:** `{embodied}`.",
        "",
    )


def _alternatives(one: Choice) -> str:
    if one.range is not None:
        return f"{one.range[0]:g} to {one.range[1]:g}"
    return ", ".join(f"`{value}`" for value in one.alternatives) or "–"


def _matters(one: Choice, shares: pd.DataFrame) -> str:
    varied = shares[shares["choice"] == ("MAP" if one.id.startswith("MAP-") else one.id)]
    own = varied[varied["share"] >= 0.05].sort_values("share", ascending=False)
    said = ", ".join(f"{row.claim} ({100 * row.share:.0f} %)" for row in own.itertuples())
    return said or ("none" if len(varied) else "–")


def citation(text: str) -> str:
    """Return how to cite, from the text of CITATION.cff."""
    cff: dict[str, Any] = yaml.safe_load(text)
    paper = cff["references"][0]
    authors = [f"{one['given-names']} {one['family-names']}" for one in paper["authors"]]
    doi = f"doi:{cff['doi']}" if "doi" in cff else "no DOI yet: it will stand here after a release"
    software = ", ".join(one["name"] for one in cff["authors"])
    return (
        f"**The paper:** {', '.join(authors[:-1])} and {authors[-1]}. *{paper['title']}*.\n\n"
        f"**This package:** {software}. *{cff['title']}*. Version {cff['version']} ({doi}).\n"
    )
