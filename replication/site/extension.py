"""Sphinx extension: formulas as MathML, and sortable, downloadable tables."""

from __future__ import annotations

import html
import re
from typing import Any
from urllib.parse import quote

from bs4 import BeautifulSoup, Tag
from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.errors import SphinxError
from sphinx.writers.html5 import HTML5Translator

NUMBER = re.compile(r"[×≥~]?\s*([-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?)")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register everything with Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("html-page-context", _improve_tables, priority=900)
    app.connect("autodoc-skip-member", _skip_fields)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _skip_fields(
    app: Sphinx, what: str, name: str, value: object, skip: bool, options: object
) -> bool | None:
    """Leave out the fields of named tuples, which their docstrings describe."""
    return True if type(value).__name__ == "_tuplegetter" else None


# --- formulas --------------------------------------------------------------------------------


def _inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(formula(node.astext()))
    raise nodes.SkipNode


def _block(self: HTML5Translator, node: nodes.math_block) -> None:
    shown = formula(node.astext(), as_block=True)
    self.body.append(f'<div class="formula" tabindex="0" role="math">{shown}</div>')
    raise nodes.SkipNode


def formula(tex: str, *, as_block: bool = False) -> str:
    """Return a formula as MathML, which browsers show without any script.

    Raises
    ------
    SphinxError
        If docutils does not know what the formula uses.
    """
    try:
        return str(tex2mathml(tex, as_block=as_block))
    except MathError as error:
        raise SphinxError(f"the formula {tex!r} cannot be shown: {error}") from None


# --- tables ----------------------------------------------------------------------------------


def _improve_tables(
    app: Sphinx, name: str, template: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    if doctree is not None and "<table" in context.get("body", ""):
        context["body"] = improve_tables(context["body"])


def improve_tables(body: str) -> str:
    """Return a page whose tables with a head can be sorted, scrolled and downloaded.

    The columns sort by the number that their cells begin with, if all do, and else as text. A table
    gets a link to its cells as CSV unless a link to a CSV file stands below it.
    """
    soup = BeautifulSoup(body, "html.parser")
    for number, table in enumerate(soup.find_all("table"), 1):
        head = table.find("thead")
        if not isinstance(table, Tag) or head is None:
            continue
        table["class"] = " ".join([*table.get_attribute_list("class"), "sortable"])
        rows = [list(row.find_all(["td", "th"])) for row in table.find_all("tr")]
        _add_keys(rows[1:])
        for cell in rows[0]:
            cell["scope"] = "col"
        title = " ".join(cell.get_text(" ", strip=True) for cell in rows[0][:2])
        box = soup.new_tag("div", attrs={"class": "table-box", "role": "region", "tabindex": "0"})
        box["aria-label"] = f"Table {number}: {title}"
        table.wrap(box)
        below = list(table.descendants)[-1].find_next(True)
        if isinstance(below, Tag) and below.select("a.download[href$='.csv']"):
            continue
        link = soup.new_tag("a", href=f"data:text/csv;charset=utf-8,{quote(_csv(rows))}")
        link["class"] = "table-csv"
        link["download"] = f"table-{number}.csv"
        link.string = "this table as CSV"
        box.insert_after(link)
    return str(soup)


def _add_keys(rows: list[list[Tag]]) -> None:
    """Give each cell of a column of numbers the number as its sorting key."""
    for column in zip(*rows, strict=False):
        texts = [cell.get_text(" ", strip=True) for cell in column]
        matches = [NUMBER.match(text) for text in texts]
        if all(match or text in ("", "–") for match, text in zip(matches, texts, strict=True)):
            for cell, match in zip(column, matches, strict=True):
                number = match[1].replace(",", "") if match else ""
                cell["data-sort"] = number


def _csv(rows: list[list[Tag]]) -> str:
    lines = []
    for row in rows:
        texts = [" ".join(cell.get_text(" ", strip=True).split()) for cell in row]
        lines.append(",".join('"' + html.unescape(text).replace('"', '""') + '"' for text in texts))
    return "\n".join(lines) + "\n"
