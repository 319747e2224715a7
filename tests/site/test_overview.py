from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import pandas as pd
import pytest

from replication.evidence.experiments import GENERAL, NAMED, NONE
from replication.evidence.tables import read_table
from replication.evidence.verdicts import ABSENT, NOT_TESTABLE, SHOWN, by_claim
from replication.files import PROJECT
from replication.report.readable import sentence
from replication.site.overview import citation, interval_plot, published, verdicts
from replication.site.pages import anchor


def rows(text: str) -> list[list[str]]:
    """Return the cells of a table in Markdown, without its head."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines[2:]]


CELLS = [
    (reading, set) for set in (NAMED, GENERAL) for reading in ("printed", "updated", "at-once")
]


def plot(
    effects: list[tuple[float, float, float]],
    *,
    statistic: str = "saved",
    margin: float = 1.0,
    paper: float = math.nan,
) -> ET.Element:
    """Draw intervals (effect, low, high), one for each of the first cells."""
    table = pd.DataFrame(effects, columns=["effect", "low", "high"])
    table[["reading", "set"]] = CELLS[: len(table)]
    return ET.fromstring(
        interval_plot(table.assign(margin=margin, paper=paper, statistic=statistic))
    )


def number(mark: ET.Element, name: str) -> float:
    """Return a number of a mark."""
    return float(mark.get(name, ""))


def edge_of(svg: ET.Element) -> float:
    """Return where no effect is."""
    (edge,) = (line for line in svg.iter("line") if line.get("class") == "edge")
    assert number(edge, "x1") == number(edge, "x2")
    return number(edge, "x1")


def judged(statistic: str = "saved") -> pd.DataFrame:
    """Make the verdicts on a claim and on a published number up."""
    table = pd.DataFrame(CELLS, columns=["reading", "set"]).assign(
        id="SAVES-OPEN", claim="It saves", place="Table I", task="open-maze", measure="iterations"
    )
    table = table.assign(effect=2.0, low=1.0, high=3.0, margin=0.9, paper=3.62, p=0.01, why="")
    table = table.assign(statistic=statistic, verdict=[ABSENT] * 3 + [SHOWN] * 3)
    number = table.head(2).assign(id="SD", claim="SD", statistic="published-sd", set=NONE)
    capped = table.assign(id="ERRS-SOCCER", claim="It errs less", task="soccer", paper=math.nan)
    capped = capped.head(1).assign(measure="early_errors", verdict=NOT_TESTABLE, why="at the cap")
    return pd.concat([table, number, capped.assign(effect=math.nan, low=math.nan, high=math.nan)])


def test_each_claim_has_its_verdicts_and_their_evidence() -> None:
    """Claims that compare are in one table, each with its sentence, which leads to its evidence."""
    table = rows(verdicts(judged(), {"SAVES-OPEN": (9, 48), "ERRS-SOCCER": (0, 0)}))
    assert [row[0] for row in table] == ["It saves", "It errs less"]
    said = "named kinds: absent under every reading; general list: shown under every reading"
    assert table[0][1] == f"[{said}](#{anchor('open_maze', 'contrasts')})"
    assert table[1][1] == "[not testable: at the cap](figures/soccer/trials.csv.xz)"
    assert [row[2] for row in table] == ["3.62 (Table I)", "(Table I)"]
    assert all(row[3].startswith("<svg") for row in table)
    assert [row[4] for row in table] == ["9 of 48: **fragile**", "not tested"]
    (other,) = rows(published(judged()))
    assert other[0] == "SD"


def test_each_verdict_is_that_of_the_file() -> None:
    """Each published claim has a row in the file's order, in one table or the other."""
    path = PROJECT / "figures" / "claims" / "verdicts.csv"
    if not path.exists():
        pytest.skip("figures/claims is not published yet")
    stored = read_table(path)
    compared = stored[~stored["statistic"].str.startswith("published")]
    holds = {id: (at, 48) for at, id in enumerate(stored["id"].unique())}
    table = rows(verdicts(stored, holds))
    for row, (id, part) in zip(table, by_claim(compared), strict=True):
        assert row[0] == part["claim"].iloc[0]
        assert row[1].startswith(f"[{sentence(part)}](")
        assert row[4].startswith(f"{holds[id][0]} of 48: **")
    others = stored[stored["statistic"].str.startswith("published")]
    assert len(rows(published(stored))) == len(others[["id", "set"]].drop_duplicates())


def test_plots_are_to_scale() -> None:
    """Each cell's interval and mark, the margin and the paper's effect stand at their numbers."""
    effects = [(4.0, 2.0, 6.0), (1.0, -1.0, 3.0), (-0.5, -1.5, 0.5), (5.0, 4.5, 5.5)]
    svg = plot(effects, paper=7.0)
    edge = edge_of(svg)
    spans = [line for line in svg.iter("line") if line.get("class") != "edge"]
    scale = (number(spans[0], "x2") - edge) / 6.0
    assert scale > 0
    for span, (_, low, high), (reading, _) in zip(spans, effects, CELLS, strict=False):
        assert span.get("class") == reading
        assert number(span, "x1") - edge == pytest.approx(low * scale, abs=0.2)
        assert number(span, "x2") - edge == pytest.approx(high * scale, abs=0.2)
    heights = [number(span, "y1") for span in spans]
    assert heights == sorted(set(heights))
    circles = list(svg.iter("circle"))
    assert [(number(c, "cx") - edge) / scale for c in circles] == pytest.approx([4, 5], abs=0.02)
    assert [number(circle, "cy") for circle in circles] == [heights[0], heights[3]]
    (square,) = (r for r in svg.iter("rect") if (r.get("class") or "").startswith("updated"))
    assert (number(square, "x") + 3 - edge) / scale == pytest.approx(1, abs=0.02)
    (grey,) = (rect for rect in svg.iter("rect") if rect.get("class") == "margin")
    assert number(grey, "x") - edge == pytest.approx(-scale, abs=0.2)
    assert number(grey, "width") == pytest.approx(2 * scale, abs=0.3)
    diamond, triangle = svg.iter("polygon")
    at = float((diamond.get("points") or "").split()[1].split(",")[0])
    assert (at - edge) / scale == pytest.approx(-0.5, abs=0.02)
    tip = float((triangle.get("points") or "").split()[-1].split(",")[0])
    assert (tip - edge) / scale == pytest.approx(7, abs=0.02)


def test_sets_are_told_apart_without_colour() -> None:
    """The marks of the named kinds are hollow, those of the general list are not."""
    svg = plot([(1.0, 0.0, 2.0)] * 6)
    marks = [m for m in svg if m.tag in ("circle", "rect", "polygon")]
    kinds = [m.get("class") for m in marks if m.get("class") != "margin"]
    readings = ["printed", "updated", "at-once"]
    assert kinds == [f"{name} hollow" for name in readings] + readings
    text = (PROJECT / "docs" / "_static" / "site.css").read_text(encoding="utf-8")
    assert {name for name in ("hollow", *readings) if f".{name}" not in text} == set()


@pytest.mark.parametrize(
    ("statistic", "margin", "ends"),
    [("saved", 2.0, (-2.0, 2.0)), ("sd-ratio", 0.8, (0.8, 1.25)), ("share", 0.9, None)],
)
def test_grey_lies_within_the_margin(
    statistic: str, margin: float, ends: tuple[float, float] | None
) -> None:
    """The margin lies on both sides of no effect, in all of its length; a share has its edge."""
    low, high = (0.95, 1.0) if statistic == "share" else (0.1, 3.0)
    svg = plot([((low + high) / 2, low, high)], statistic=statistic, margin=margin)
    (span,) = (line for line in svg.iter("line") if line.get("class") == "printed")
    scale = (number(span, "x2") - number(span, "x1")) / (high - low)
    start = number(span, "x1") - low * scale
    grey = [rect for rect in svg.iter("rect") if rect.get("class") == "margin"]
    found = [
        ((number(g, "x") - start) / scale, (number(g, "x") + number(g, "width") - start) / scale)
        for g in grey
    ]
    assert found == ([pytest.approx(ends, abs=0.02)] if ends else [])
    neutral = {"saved": 0.0, "sd-ratio": 1.0, "share": 0.9}[statistic]
    assert (edge_of(svg) - start) / scale == pytest.approx(neutral, abs=0.02)


def test_a_cell_without_an_effect_leaves_its_line_free() -> None:
    """Where trials are at the cap there is no mark, and the others stay in their lines."""
    whole = plot([(1.0, 0.0, 2.0)] * 3)
    broken = plot([(1.0, 0.0, 2.0), (math.nan, math.nan, math.nan), (1.0, 0.0, 2.0)])
    places = [
        [number(line, "y1") for line in svg.iter("line") if line.get("class") != "edge"]
        for svg in (whole, broken)
    ]
    assert places[1] == [places[0][0], places[0][2]]
    assert whole.get("height") == broken.get("height")
    assert "nan" not in ET.tostring(broken, encoding="unicode")
    assert "Fᵢ₊₁ (updated), named kinds: no number; " in broken.get("aria-label", "")


def test_plots_have_words() -> None:
    """Who does not see the plot hears every cell, the margin and the paper's effect."""
    svg = plot([(4.0, 2.0, 6.0), (1.0, -1.0, 3.0)], paper=5.0)
    assert svg.get("aria-label") == (
        "Fᵢ (printed), named kinds: 4 from 2 to 6; Fᵢ₊₁ (updated), named kinds: 1 from -1 to 3. "
        "Margin: 1. Paper: 5."
    )
    growth = plot([(4.0, 2.0, 6.0)], margin=math.nan)
    assert growth.get("aria-label") == "Fᵢ (printed), named kinds: 4 from 2 to 6."


def test_citation_is_that_of_the_file() -> None:
    """Authors and title come from CITATION.cff, and so does a DOI as soon as there is one."""
    text = (PROJECT / "CITATION.cff").read_text(encoding="utf-8")
    without = citation(text)
    assert "Kao-Shing Hwang and Yi-Chia Tseng" in without
    assert "no DOI yet" in without
    assert "doi:10.5281/zenodo.1" in citation(text + "doi: 10.5281/zenodo.1\n")
