"""Pages of the site from published notebooks: a caption under each figure, files under each table.

A page is a notebook again. What an output is stands in its metadata, where the notebook put it when
it displayed it: kind, name, words and code (see :mod:`replication.report.outputs`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replication.files import read_json
from replication.paper.register import load_choices

SHOWN = ("seed", "trials", "set_trials", "choices")
"""Parameters that a reader wants to know of a run."""


@dataclass(frozen=True)
class Origin:
    """Where the outputs of a notebook come from.

    Attributes
    ----------
    notebook
        Its name.
    parameters
        The parameters of the run.
    seconds, machine
        Run time of the whole notebook, and where; None and empty if not recorded on this machine.
    """

    notebook: str
    parameters: Mapping[str, Any]
    seconds: float | None = None
    machine: str = ""

    def line(self, folder: Path, name: str, code: str = "") -> str:
        """Return the line under an output: its run, its files in `folder`, and its code."""
        values = [
            f"{key} = {self.parameters[key]}"
            for key in SHOWN
            if self.parameters.get(key) not in (None, {})
        ]
        files = [
            _download(suffix.upper(), f"figures/{self.notebook}/{name}.{suffix}")
            for suffix in ("csv", "svg")  # pictures and players are on the page itself
            if (folder / f"{name}.{suffix}").exists()
        ]
        took = f"the notebook ran {self.seconds:.0f} s" if self.seconds is not None else ""
        parts = [
            ", ".join(values),
            f"{took} on {self.machine}" if took and self.machine else took,
            ", ".join(files),
            _download("notebook", f"source/{self.notebook}.ipynb"),
            f"code: {{py:func}}`~{code}`" if code else "",
        ]
        return " · ".join(filter(None, parts))


def _download(text: str, file: str) -> str:
    return f"{{download}}`{text} <../{file}>`"


def page(published: Path, origin: Origin) -> dict[str, Any]:
    """Return the page of a published notebook, a notebook as JSON; its files lie beside it."""
    node: dict[str, Any] = read_json(published)
    named: set[str] = set()
    node["cells"] = [
        part for cell in node["cells"] for part in _parts(cell, published.parent, origin, named)
    ]
    return node


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
            id = f"{cell['id']}-output-{at}"
            yield {"cell_type": "markdown", "id": id, "metadata": {}, "source": text}


def _shown(output: Mapping[str, Any], folder: Path, origin: Origin, named: set[str]) -> str | None:
    """Return an output as text of the page, or None where the output stays as it is.

    A figure and the table beside it may have one name; links lead to the first of them.
    """
    text = "".join(output.get("data", {}).get("text/markdown", ""))
    known = output.get("metadata", {}).get("replication")
    if known is None:
        return link_choices(text) if text else None
    kind, name = known["kind"], known["name"]
    line = origin.line(folder, name, known.get("code", ""))
    file = f"../figures/{origin.notebook}/{name}"
    target = "" if name in named else f"({anchor(origin.notebook, name)})=\n\n"
    named.add(name)
    if kind == "figure":
        words = " ".join(known["alt"].split())
        return (
            f"{target}````{{figure}} {file}.png\n:alt: {words}\n:width: 700px\n\n"
            f"{_escaped(words)}\n\n{line}\n````"
        )
    body = f"```{{raw}} html\n:file: {file}.html\n```\n" if kind == "player" else text
    return f"{target}{body}\n{{.provenance}}\n{line}\n"


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

    A published table or notebook is part of a page; any other file is laid out below the pages.

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
    return text.replace("](../", "](")


def _escaped(words: str) -> str:
    r"""Return plain words as Markdown.

    Examples
    --------
    >>> print(_escaped("4 [3, 5] of a*b"))
    4 \[3, 5\] of a\*b
    """
    return re.sub(r"([\\`*_\[\]<>$#|])", r"\\\1", words)
