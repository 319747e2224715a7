"""Sphinx extension: formulas as MathML, better tables, and a search that works from disk."""

from __future__ import annotations

import html
import json
import re
import textwrap
from pathlib import Path
from typing import Any
from urllib.parse import quote

from bs4 import BeautifulSoup, Tag
from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.errors import SphinxError
from sphinx.writers.html5 import HTML5Translator

from replication.files import write_file
from replication.site import reference

NUMBER = re.compile(r"[×≥~<]?\s*([-+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?)")
TOGETHER = re.compile(r"\[[^\]]*\]|[×≥~<] (?=\d)")
WORD = re.compile(r"[^\W\d_]{2}")

HOLDS = "Holds with other choices"
"""Head of the column that is shown as bars."""


def setup(app: Sphinx) -> dict[str, Any]:
    """Register everything with Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("html-page-context", _finish, priority=900)
    app.connect("build-finished", _write_texts)
    reference.connect(app)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


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


# --- pages -----------------------------------------------------------------------------------


def _finish(
    app: Sphinx, name: str, template: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Improve the tables of a page, and say what it shows to those who get a link to it."""
    if doctree is None:
        return
    code = f'href="{reference.CODE}'
    body = context["body"].replace(code, f'href="{context["content_root"]}{reference.CODE}')
    context["body"] = improve_tables(body) if "<table" in body else body
    texts = (paragraph.astext() for paragraph in doctree.findall(nodes.paragraph))
    first = next((text for text in texts if len(text) > 40), context.get("title", ""))
    context["description"] = textwrap.shorten(first, 200, placeholder=" …")
    pictures = (image["uri"] for image in doctree.findall(nodes.image))  # as the page sees them
    context["picture"] = next((uri for uri in pictures if uri.endswith(".png")), None)


def _write_texts(app: Sphinx, error: Exception | None) -> None:
    """Write what the search shows of each page: a page from disk may not read the others.

    Sphinx's search fetches a page to show a part of it; here it finds the text in a script.
    """
    if error:
        return
    texts = {}
    for name in sorted(app.env.found_docs):
        tree = app.env.get_doctree(name)
        for node in [*tree.findall(nodes.raw), *tree.findall(nodes.literal_block)]:
            node.parent.remove(node)
        written = "" if name.startswith("api/") else " ".join(tree.astext().split())
        texts[name] = html.escape(written) or " "
    script = (
        f"const TEXTS = {json.dumps(texts, ensure_ascii=False)};\n"
        "window.fetch = (url) => {\n"
        '  const text = TEXTS[url.replace(/^\\.\\/|\\.html$/g, "")] ?? " ";\n'
        '  return Promise.resolve({ text: () => `<main role="main">${text}</main>` });\n'
        "};\n"
    )
    write_file(Path(app.outdir) / "_static" / "searchtexts.js", script)


# --- tables ----------------------------------------------------------------------------------


def improve_tables(body: str) -> str:
    """Return a page whose tables with a head can be sorted, scrolled and downloaded.

    The columns sort by the number that their cells begin with, if all do, and else as text. A table
    gets a link to its cells as CSV unless a link to a CSV file stands below it. One that says what
    holds with other choices shows it as bars, and becomes a card for each row on a telephone.
    """
    soup = BeautifulSoup(body, "html.parser")
    for number, table in enumerate(soup.find_all("table"), 1):
        head = table.find("thead")
        if not isinstance(table, Tag) or head is None:
            continue
        kinds = [*table.get_attribute_list("class"), "sortable"]
        rows = [list(row.find_all(["td", "th"])) for row in table.find_all("tr")]
        _add_keys(rows)
        for cell in rows[0]:
            cell["scope"] = "col"
        table["class"] = " ".join([*kinds, *["cards"] * _add_bars(soup, rows)])
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
        link.string = "CSV"
        link["aria-label"] = f"Table {number} as CSV"
        box.insert_after(link)
    return str(soup)


def _add_keys(rows: list[list[Tag]]) -> None:
    """Give each cell of a column of numbers the number as its sorting key."""
    for head, *column in zip(*rows, strict=False):
        texts = [cell.get_text(" ", strip=True) for cell in column]
        matches = [NUMBER.match(text) for text in texts]
        numbers = (match or text in ("", "–") for match, text in zip(matches, texts, strict=True))
        if not any(matches) or not all(numbers):
            continue
        for cell, match in zip(column, matches, strict=True):
            cell["data-sort"] = match[1].replace(",", "") if match else ""
        if not any(WORD.search(text) for text in texts):
            for cell in (head, *column):
                cell["class"] = [*cell.get_attribute_list("class", []), "number"]
                for text in cell.find_all(string=TOGETHER):
                    text.replace_with(TOGETHER.sub(lambda part: part[0].replace(" ", "\xa0"), text))


def _add_bars(soup: BeautifulSoup, rows: list[list[Tag]]) -> bool:
    """Draw a bar beside each "3 of 48" in the column of what holds; return if there is one.

    The cells are also given the head of their column, which stands beside them in a card.
    """
    heads = [cell.get_text(" ", strip=True) for cell in rows[0]]
    if HOLDS not in heads:
        return False
    for row in rows[1:]:
        for head, cell in zip(heads, row, strict=True):
            cell["data-label"] = head
        cell = row[heads.index(HOLDS)]
        if match := re.match(r"(\d+) of (\d+)", cell.get_text(strip=True)):
            share = int(match[1]) / max(1, int(match[2]))
            bar = soup.new_tag("span", attrs={"class": "bar", "style": f"--share: {share:.1%}"})
            bar["aria-hidden"] = "true"
            cell.insert(0, bar)
    return True


def _csv(rows: list[list[Tag]]) -> str:
    lines = []
    for row in rows:
        texts = [" ".join(cell.get_text(" ", strip=True).split()) for cell in row]
        lines.append(",".join('"' + html.unescape(text).replace('"', '""') + '"' for text in texts))
    return "\n".join(lines) + "\n"
