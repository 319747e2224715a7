from __future__ import annotations

import csv
import io
import re
import xml.etree.ElementTree as ET
from typing import Any
from urllib.parse import unquote

import pytest
from bs4 import BeautifulSoup
from sphinx.errors import SphinxError

from replication.site.extension import HOLDS, formula, improve_tables


def table(*rows: tuple[str, ...]) -> str:
    """Return a table in HTML; the first row is its head."""
    lines = ["".join(f"<td>{cell}</td>" for cell in row) for row in rows]
    head, *body = (f"<tr>{line}</tr>" for line in lines)
    return f"<table><thead>{head}</thead><tbody>{''.join(body)}</tbody></table>"


def improved(*rows: tuple[str, ...]) -> Any:
    """Return a page with an improved table, parsed."""
    return BeautifulSoup(improve_tables(table(*rows)), "html.parser")


@pytest.mark.parametrize(
    ("cells", "keys"),
    [
        (("-4.45 [-6, -3]", "2", "–"), ["-4.45", "2", ""]),
        (("× 0.46", "27 % of 48", "≥ 100 %"), ["0.46", "27", "100"]),
        (("35,021,108", "1e-3", "+5"), ["35021108", "1e-3", "+5"]),
        (("Table I", "2", "3"), [None, None, None]),
    ],
)
def test_columns_of_numbers_sort_as_numbers(cells: tuple[str, ...], keys: list[str | None]) -> None:
    """A column in which each cell begins with a number has it as its key, any other has none."""
    page = improved(("what", "n"), *((f"row {cell}", cell) for cell in cells))
    found = [row.find_all("td")[1].get("data-sort") for row in page.tbody.find_all("tr")]
    assert found == keys


def test_tables_sort_and_scroll_by_themselves() -> None:
    """A table can be reached, named and scrolled from the keyboard; the page keeps its width."""
    page = improved(("claim", "n"), ("a", "1"))
    box = page.find("div")
    assert (box["role"], box["tabindex"]) == ("region", "0")
    assert box["aria-label"] == "Table 1: claim n"
    assert box.table["class"] == ["sortable"]
    assert [cell["scope"] for cell in box.thead.find_all("td")] == ["col", "col"]


def test_numbers_are_aligned() -> None:
    """A column of numbers, and its head, stand at the right; one with words in it does not."""
    rows = (
        ("1.50 [1, 2]", "3 of 4: robust", "<svg></svg>"),
        ("–", "1 of 4: fragile", "<svg></svg>"),
    )
    page = improved(("n", "said", "plot"), *rows)
    for row in page.find_all("tr"):
        kinds = [cell.get("class") == ["number"] for cell in row.find_all("td")]
        assert kinds == [True, False, False]


def test_intervals_are_not_broken() -> None:
    """A line may end before an interval, not in it; the file has plain spaces."""
    page = improved(("n", "m [95 %]"), ("1", "1.50 [1, 2]"), ("2", "–"))
    assert page.tbody.find_all("td")[1].get_text() == "1.50 [1,\xa02]"
    assert "1.50 [1, 2]" in unquote(page.find("a", class_="table-csv")["href"])


def test_what_holds_has_a_bar() -> None:
    """The share of specifications is drawn to scale, and cells know the head of their column."""
    rows = (("a", "12 of 48: fragile"), ("b", "not tested"))
    page = improved(("Claim", HOLDS), *rows)
    assert page.table["class"] == ["sortable", "cards"]
    first, second = (row.find_all("td")[1] for row in page.tbody.find_all("tr"))
    assert first.find(class_="bar")["style"] == "--share: 25.0%"
    assert first.get_text() == rows[0][1]
    assert second.find(class_="bar") is None
    assert [cell["data-label"] for cell in page.tbody.find_all("td")] == ["Claim", HOLDS] * 2
    assert improved(("Claim", "n"), *rows).table["class"] == ["sortable"]


def test_tables_can_be_downloaded() -> None:
    """The link below a table that has no file holds what the table shows, as CSV."""
    page = improved(("claim", "n"), ('say "hit" &amp; go', "1, 2"), ("<b>bold</b> text", ""))
    link = page.find("a", class_="table-csv")
    assert link["download"] == "table-1.csv"
    text = unquote(link["href"].partition(",")[2])
    assert list(csv.reader(io.StringIO(text))) == [
        ["claim", "n"],
        ['say "hit" & go', "1, 2"],
        ["bold text", ""],
    ]


@pytest.mark.parametrize(("file", "links"), [("claims.csv", 0), ("fig05.svg", 1)])
def test_tables_with_a_file_have_no_second_one(file: str, links: int) -> None:
    """Where a CSV file is linked below a table, it gets no link to what it shows."""
    below = f'<p class="provenance"><a class="download" href="_downloads/{file}">CSV</a></p>'
    text = f"<div>{table(('a', 'b'), ('1', '2'))}</div>{below}"  # the theme wraps tables
    page = BeautifulSoup(improve_tables(text), "html.parser")
    assert len(page.find_all("a", class_="table-csv")) == links


def test_tables_without_a_head_stay() -> None:
    """Tables that only lay things out are not touched."""
    text = "<table><tbody><tr><td>x</td></tr></tbody></table>"
    assert improve_tables(text) == text


def test_formulas_are_mathml() -> None:
    """A formula is well-formed MathML with its symbols, and needs no script."""
    text = formula(r"F_{i+1} = F_i + \alpha (1 - F_i)", as_block=True)
    root = ET.fromstring(text)
    assert root.tag.endswith("math")
    assert root.get("display") == "block"
    assert "α" in "".join(root.itertext())
    assert not re.search(r"\\|<script", text)


def test_a_formula_that_cannot_be_shown_is_named() -> None:
    """What is unknown is an error with the formula, not a page without it."""
    with pytest.raises(SphinxError, match=r"the formula '\\\\nonsense x' cannot be shown"):
        formula(r"\nonsense x")
