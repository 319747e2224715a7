from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET

import pandas as pd
import pytest

from replication.evidence.tables import read_table
from replication.evidence.verdicts import by_claim, overall
from replication.files import PROJECT
from replication.paper.register import load_choices
from replication.site.overview import choices, citation, interval_plot, published, verdicts


def rows(text: str) -> list[list[str]]:
    """Return the cells of a table in Markdown, without its head."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[2:]]


def plot(
    effects: list[tuple[float, float, float]], *, direction: str = "less", paper: float = math.nan
) -> ET.Element:
    """Draw intervals (effect, low, high) beside the margin 0."""
    table = pd.DataFrame(effects, columns=["effect", "low", "high"])
    table["reading"] = ["printed", "updated"][: len(table)]
    return ET.fromstring(
        interval_plot(table.assign(margin=0.0, paper=paper, direction=direction, id="X"))
    )


def test_each_verdict_is_that_of_the_file() -> None:
    """Each claim has a row in the file's order: those that compare in one table, others in one."""
    path = PROJECT / "figures" / "claims" / "verdicts.csv"
    if not path.exists():
        pytest.skip("figures/claims is not published yet")
    judged = read_table(path)
    compared = judged[judged["direction"] != "inside"]
    holds = {id: f"{at} of 48" for at, id in enumerate(judged["id"].unique())}
    table = rows(verdicts(judged, holds))
    for row, (id, part) in zip(table, by_claim(compared), strict=True):
        assert row[0] == part["claim"].iloc[0]
        link = re.match(
            r"\[\**([\w ]+?)\**( \(.*\)|:.*)?\]\((#result-|figures/)[\w/.-]+\)$", row[1]
        )
        assert link is not None, row[1]
        assert link[1] == overall(part["verdict"].tolist())
        assert row[2] == holds[id]
    assert len(rows(published(judged))) == len(holds) - len(table)


def test_plots_are_to_scale() -> None:
    """Interval, effect, margin and the paper's effect stand where their sizes and words say."""
    svg = plot([(-4.0, -6.0, -2.0), (-1.0, -3.0, 1.0)], paper=-5.0)
    lines = {line.get("class"): line for line in svg.iter("line")}
    margin = float(lines["edge"].get("x1", ""))
    scale = (margin - float(lines["printed"].get("x1", ""))) / 6.0
    assert scale > 0
    (circle,) = svg.iter("circle")
    assert margin - float(circle.get("cx", "")) == pytest.approx(4 * scale, abs=0.2)
    assert float(lines["updated"].get("x2", "")) - margin == pytest.approx(scale, abs=0.2)
    (paper,) = svg.iter("polygon")
    tip = float(paper.get("points", "").split()[-1].split(",")[0])
    assert margin - tip == pytest.approx(5 * scale, abs=0.2)

    assert svg.get("aria-label") == (
        "printed F: -4 from -6 to -2; updated F: -1 from -3 to 1. Margin: 0. Paper: -5."
    )


@pytest.mark.parametrize(("direction", "left"), [("less", True), ("greater", False)])
def test_the_claimed_side_is_marked(direction: str, left: bool) -> None:
    """The grey side begins at the margin and reaches the edge at which the claim points."""
    svg = plot([(0.5, -1.0, 1.0)], direction=direction)
    (side,) = (rect for rect in svg.iter("rect") if rect.get("class") == "claimed")
    begin, width = float(side.get("x", "")), float(side.get("width", ""))
    margin = next(float(line.get("x1", "")) for line in svg.iter("line"))
    assert (begin, begin + width) == ((0, margin) if left else (margin, 190))


def test_every_choice_is_described() -> None:
    """Each entry of the register has a row and a section that its id leads to."""
    shares = pd.DataFrame({"claim": ["X", "Y"], "choice": ["ALPHA"] * 2, "share": [0.5, 0.01]})
    text = choices(shares)
    for entry in load_choices().values():
        assert f"[{entry.id}](#choice-{entry.id.lower()})" in text
        assert f"(choice-{entry.id.lower()})=\n\n### {entry.id}\n" in text
        assert entry.open in text
        assert entry.rule in text
    matters = {row[0].partition("]")[0]: row[-1] for row in rows(text)}
    assert (matters["[ALPHA"], matters["[BETA"]) == ("X (50 %)", "–")


def test_citation_is_that_of_the_file() -> None:
    """Authors and title come from CITATION.cff, and so does a DOI as soon as there is one."""
    text = (PROJECT / "CITATION.cff").read_text(encoding="utf-8")
    without = citation(text)
    assert "Kao-Shing Hwang and Yi-Chia Tseng" in without
    assert "no DOI yet" in without
    assert "doi:10.5281/zenodo.1" in citation(text + "doi: 10.5281/zenodo.1\n")
