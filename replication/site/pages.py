"""Pages of the site from published notebooks: a caption under each figure, files under each table.

A page is a notebook again. What an output is stands in its metadata, where the notebook put it when
it displayed it: kind, name, words and code (see :mod:`replication.report.outputs`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from replication.files import read_json
from replication.paper.register import load_choices
from replication.report.outputs import TRIALS
from replication.site.reference import source_of

LARGE = 100_000
"""Bytes of a table above which the report has it compressed."""

SHOWN = {"seed": "Root seed", "trials": "trials of each method", "choices": "choices"}
"""Parameters that a reader wants to know of a run, in words."""


@dataclass(frozen=True)
class Origin:
    """Where the outputs of a notebook come from.

    Attributes
    ----------
    notebook
        Its name.
    parameters
        The parameters of the run.
    captions
        By the name of a figure, what a reader should know of it; it may name parameters.
    """

    notebook: str
    parameters: Mapping[str, Any]
    captions: Mapping[str, str] = field(default_factory=dict)

    def line(self) -> str:
        """Return the line at the end of the page: its run, and the notebook itself."""
        values = [
            f"{words} {self.parameters[key]}"
            for key, words in SHOWN.items()
            if self.parameters.get(key) not in (None, {})
        ]
        return ", ".join([*values, _download("the notebook", f"source/{self.notebook}.ipynb")])

    def links(self, folder: Path, name: str, code: str = "") -> str:
        """Return the links under an output: its numbers in `folder`, and its code."""
        csv = folder / f"{name}.csv"
        file = f"figures/{self.notebook}/{csv.name}"
        parts = [
            _download("CSV", f"{file}.xz" if packed(csv) else file) if csv.exists() else "",
            f'<a href="{source_of("py", _drawing(code))}">code</a>' if code else "",
        ]
        return " · ".join(filter(None, parts))

    def caption(self, name: str, words: str) -> str:
        """Return the caption of a figure, or its words if it has none."""
        text = self.captions.get(name)
        return text.format(**self.parameters) if text else _escaped(words)


def _drawing(code: str) -> dict[str, str]:
    """Return the module and the name of what drew a figure."""
    module, _, name = code.rpartition(".")
    return {"module": module, "fullname": name}


def packed(path: Path) -> bool:
    """Return whether the report has a file compressed: tables of trials, and other large ones."""
    return path.name == TRIALS or (path.suffix == ".csv" and path.stat().st_size > LARGE)


def _download(text: str, file: str) -> str:
    return f"{{download}}`{text} <../{file}>`"


def page(published: Path, origin: Origin) -> dict[str, Any]:
    """Return the page of a published notebook, a notebook as JSON; its files lie beside it."""
    node: dict[str, Any] = read_json(published)
    named: set[str] = set()
    parts = [
        part for cell in node["cells"] for part in _parts(cell, published.parent, origin, named)
    ]
    end = _text("origin", f"{{.provenance}}\n{origin.line()}\n")
    node["cells"] = [*_joined(parts), end]
    return node


def _text(id: str, source: str) -> dict[str, Any]:
    return {"cell_type": "markdown", "id": id, "metadata": {}, "source": source}


def _joined(cells: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Join cells of code that follow each other and show nothing in between."""
    joined: list[dict[str, Any]] = []
    for cell in cells:
        last = joined[-1] if joined else {}
        if cell["cell_type"] == "code" == last.get("cell_type") and not last["outputs"]:
            source = "".join(last["source"]) + "\n\n" + "".join(cell["source"])
            joined[-1] = {**cell, "id": last["id"], "source": source}
        else:
            joined.append(cell)
    return joined


def _parts(
    cell: dict[str, Any], folder: Path, origin: Origin, named: set[str]
) -> Iterator[dict[str, Any]]:
    """Yield a cell, and below it a cell of text for each output that is shown as text."""
    if cell["cell_type"] != "code":
        source = "".join(cell["source"]).replace("](../../", "](../")  # pages lie less deep
        yield {**cell, "source": link_choices(source)}
        return
    shown = [_shown(output, folder, origin, named) for output in cell["outputs"]]
    kept = [output for output, text in zip(cell["outputs"], shown, strict=True) if text is None]
    tags = [*cell["metadata"].get("tags", []), "hide-input"]
    yield {**cell, "outputs": kept, "metadata": {**cell["metadata"], "tags": tags}}
    for at, text in enumerate(shown):
        if text is not None:
            yield _text(f"{cell['id']}-output-{at}", text)


def _shown(output: Mapping[str, Any], folder: Path, origin: Origin, named: set[str]) -> str | None:
    """Return an output as text of the page, or None where the output stays as it is.

    A figure and the table beside it may have one name; links lead to the first of them. A figure is
    shown in the smaller of its two files.
    """
    text = "".join(output.get("data", {}).get("text/markdown", ""))
    known = output.get("metadata", {}).get("replication")
    if known is None:
        return link_choices(text) if text else None
    kind, name = known["kind"], known["name"]
    links = origin.links(folder, name, known.get("code", ""))
    file = f"../figures/{origin.notebook}/{name}"
    target = "" if name in named else f"({anchor(origin.notebook, name)})=\n\n"
    named.add(name)
    if kind == "figure":
        words = " ".join(known["alt"].split())
        sizes = {each: (folder / f"{name}.{each}").stat().st_size for each in ("png", "svg")}
        return (
            f"{target}````{{figure}} {file}.{min(sizes, key=sizes.__getitem__)}\n"
            f":alt: {words}\n:width: 860px\n\n{origin.caption(name, words)}\n\n{links}\n````"
        )
    body = f"```{{raw}} html\n:file: {file}.html\n```\n" if kind == "player" else text
    return f"{target}{body}\n{{.provenance}}\n{links}\n"


def anchor(notebook: str, name: str) -> str:
    """Return the name by which pages refer to an output of a notebook."""
    return f"result-{notebook}-{name}".replace("_", "-")


def link_choices(text: str) -> str:
    """Return Markdown in which the id of a registered choice leads to its description.

    Examples
    --------
    >>> link_choices("two readings (choice F-INDEX), `F-INDEX`")
    'two readings (choice [F-INDEX](#choice-f-index)), `F-INDEX`'
    """
    ids = "|".join(sorted(map(re.escape, load_choices()), key=len, reverse=True))
    return re.sub(
        rf"(?<![\w`\[-])({ids})(?![\w`\]-])",
        lambda match: f"[{match[1]}](#choice-{match[1].lower()})",
        text,
    )


def link_pages(text: str) -> str:
    """Return a page of docs/ with its links to other folders as links within the site.

    A published table or notebook is part of a page, and so is a choice; any other file is laid out
    below the pages.

    Examples
    --------
    >>> link_pages("[a](../figures/soccer/summary.md) [b](../figures/soccer/notebook.ipynb)")
    '[a](#result-soccer-summary) [b](notebooks/soccer.ipynb)'
    >>> link_pages("![c](../figures/soccer/fig12.png)")
    '![c](figures/soccer/fig12.png)'
    """
    text = re.sub(r"\]\(\.\./figures/(\w+)/notebook\.ipynb\)", r"](notebooks/\1.ipynb)", text)
    text = re.sub(
        r"\]\(\.\./figures/(\w+)/(\w+)\.md\)", lambda m: f"](#{anchor(m[1], m[2])})", text
    )
    text = re.sub(r"\]\(choices\.md#([\w-]+)\)", r"](#choice-\1)", text)
    return text.replace("](../", "](")


def _escaped(words: str) -> str:
    r"""Return plain words as Markdown.

    Examples
    --------
    >>> print(_escaped("4 [3, 5] of a*b"))
    4 \[3, 5\] of a\*b
    """
    return re.sub(r"([\\`*_\[\]<>$#|])", r"\\\1", words)
