"""Pages of the site from executed notebooks: a caption under each figure, a file for each table.

A page is a notebook again. The outputs that are also files become cells of text, with what a reader
wants to know of them: what one sees, from which run it comes, and where data and code are.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replication.paper.register import load_choices

PICTURE = re.compile(r"!\[(?P<alt>.*)\]\((?P<file>[\w.-]+)\)", re.DOTALL)
PLAYER = re.compile(r"\[[\w.-]+\]\((?P<file>[\w.-]+\.html)\)")
CALLED = re.compile(r"\b(figures|claim_figures|field_figures|players|tables|calibration)\.(\w+)\(")
DRAWS = re.compile(r"_figure$|_table$|_player$|^animate$|^readable_")


@dataclass(frozen=True)
class Provenance:
    """What stands under each output of a notebook.

    Attributes
    ----------
    notebook
        Its name.
    parameters
        The parameters of the run.
    seconds, machine
        Run time of the whole notebook, and where; None and empty if the run is not known here.
    """

    notebook: str
    parameters: Mapping[str, Any]
    seconds: float | None = None
    machine: str = ""

    def line(self, files: Sequence[str], code: str) -> str:
        """Return the line of an output, which is also in files, and that some code made."""
        named = ("seed", "trials", "set_trials", "most_trials", "choices")
        values = [
            f"{name} = {self.parameters[name]}"
            for name in named
            if self.parameters.get(name) not in (None, {})
        ]
        took = f"{self.seconds:.0f} s" if self.seconds is not None else "not recorded here"
        if self.machine:
            took += f" on {self.machine}"
        links = [_download(Path(file).suffix[1:].upper(), f"figures/{file}") for file in files]
        drawn = sorted({(m[1], m[2]) for m in CALLED.finditer(code) if DRAWS.search(m[2])})
        functions = [f"{{py:func}}`~replication.{module}.{name}`" for module, name in drawn]
        parts = [
            ", ".join(values),
            f"run time of the notebook: {took}",
            f"files: {', '.join(links)}",
            _download("notebook", f"source/{self.notebook}.ipynb"),
        ]
        if functions:
            parts.append(f"code: {', '.join(functions)}")
        return " · ".join(part for part in parts if part)


def _download(text: str, file: str) -> str:
    return f"{{download}}`{text} <../{file}>`"


def page(executed: Path, files: Path, provenance: Provenance) -> dict[str, Any]:
    """Return the page of an executed notebook, a notebook as JSON.

    Parameters
    ----------
    executed
        The notebook as it was published, with links to its outputs.
    files
        The folder of the outputs.
    provenance
        What stands under each of them.
    """
    node: dict[str, Any] = json.loads(executed.read_text(encoding="utf-8"))
    tables = {path.read_text(encoding="utf-8"): path.stem for path in sorted(files.glob("*.md"))}
    cells: list[dict[str, Any]] = []
    defined: dict[str, str] = {}
    for cell in node["cells"]:
        cells.append(cell)
        if cell["cell_type"] == "markdown":
            cell["source"] = link_choices("".join(cell["source"]))
            continue
        code = "".join(cell["source"])
        called = [text for name, text in defined.items() if f"{name}(" in code]
        defined |= {match[1]: code for match in re.finditer(r"^def (\w+)", code, re.MULTILINE)}
        cell["metadata"].setdefault("tags", []).append("hide-input")
        kept = []
        for at, output in enumerate(cell["outputs"]):
            text = "".join(output.get("data", {}).get("text/markdown", ""))
            if not text:
                kept.append(output)
                continue
            shown = _shown(text, tables, files, "".join([code, *called]), provenance)
            cells.append(
                {
                    "cell_type": "markdown",
                    "id": f"{cell['id']}-output-{at}",
                    "metadata": {},
                    "source": shown,
                }
            )
        cell["outputs"] = kept
    node["cells"] = cells
    return node


def anchor(name: str) -> str:
    """Return the name by which pages refer to an output."""
    return f"result-{name.replace('_', '-')}"


def link_choices(text: str) -> str:
    """Return Markdown in which the id of a registered choice leads to what is said of it.

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


def _shown(
    text: str, tables: Mapping[str, str], files: Path, code: str, provenance: Provenance
) -> str:
    """Return what a page shows of an output in Markdown."""
    if picture := PICTURE.fullmatch(text.strip()):
        name = Path(picture["file"]).stem
        return _figure(name, picture["alt"], provenance.line(_beside(files, name), code))
    if player := PLAYER.fullmatch(text.strip()):
        name = Path(player["file"]).stem
        said = provenance.line(_beside(files, name), code)
        return (
            f"({anchor(name)})=\n\n```{{raw}} html\n:file: ../figures/{player['file']}\n```\n\n"
            f"{{.provenance}}\n{said}\n"
        )
    if text in tables:
        name = tables[text]
        said = provenance.line(_beside(files, name), code)
        return f"({anchor(name)})=\n\n{text}\n{{.provenance}}\n{said}\n"
    return link_choices(text)


def _figure(name: str, alt: str, said: str) -> str:
    return (
        f"````{{figure}} ../figures/{name}.png\n:name: {anchor(name)}\n:alt: {_plain(alt)}\n"
        f":width: 700px\n\n"
        f"{alt}\n\n{said}\n````"
    )


def _plain(alt: str) -> str:
    """Return the text of an escaped one, for an option, which has one line and no markup."""
    return re.sub(r"\\(.)", r"\1", " ".join(alt.split()))


def _beside(files: Path, name: str) -> list[str]:
    """Return the files of an output, its numbers first."""
    return sorted(_named(files, name), key=lambda file: (not file.endswith(".csv"), file))


def _named(files: Path, name: str) -> Iterator[str]:
    for suffix in (".csv", ".svg"):  # pictures and players are on the page itself
        if (files / f"{name}{suffix}").exists():
            yield f"{name}{suffix}"
