from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from replication.paper.register import load_choices
from replication.site.pages import Provenance, anchor, link_choices, page

TABLE = "| a   | b   |\n| --- | --- |\n| 1   | 2   |\n"
CAME = Provenance("toy", {"seed": 7, "trials": 3, "choices": {}, "jobs": 2}, 12.4, "Linux, 2 cores")


def shown(text: str) -> Any:
    """Return an output of a cell in Markdown."""
    return new_output("execute_result", {"text/markdown": text}, execution_count=1)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write outputs: a figure in three files, a table in two, a player in two."""
    names = ("fig05.png", "fig05.svg", "fig05.csv", "table1.csv", "film.html", "film.csv")
    for name in names:
        (tmp_path / name).write_text(name)
    (tmp_path / "table1.md").write_text(TABLE)
    return tmp_path


def made(folder: Path, *outputs: Any, code: str = "x", text: str = "# Toy") -> Any:
    """Return the page of a notebook with a text and one cell."""
    cells = [new_markdown_cell(text), new_code_cell(code, outputs=list(outputs))]
    nbformat.write(new_notebook(cells=cells), folder / "toy.ipynb")
    node = nbformat.from_dict(page(folder / "toy.ipynb", folder, CAME))
    nbformat.validate(node)
    return node


def test_a_figure_says_what_one_sees_and_where_it_is_from(folder: Path) -> None:
    """Its words are alternative text and caption; run, files, notebook and code stand below."""
    code = (
        'shown.figure(\n    figures.error_figure(errors), "fig05", alt=panels.describe_errors(x))'
    )
    node = made(folder, shown(r"![d falls \[to 0\]](fig05.png)"), code=code)
    text = node.cells[2].source
    assert "{figure} ../figures/fig05.png" in text
    assert f":name: {anchor('fig05')}" in text
    assert ":alt: d falls [to 0]" in text
    assert "\n\nd falls \\[to 0\\]\n\n" in text
    assert "seed = 7, trials = 3 · run time of the notebook: 12 s on Linux, 2 cores" in text
    for name in ("fig05.csv", "fig05.svg"):
        assert f"<../figures/{name}>`" in text
    assert "`notebook <../source/toy.ipynb>`" in text
    assert text.rstrip("`\n").endswith("code: {py:func}`~replication.report.figures.error_figure")


def test_code_behind_a_function_of_the_notebook_is_named(folder: Path) -> None:
    """Where a cell draws through a function of an earlier cell, that one's code counts."""
    cells = [
        new_code_cell("def draw():\n    return figures.error_figure(1)"),
        new_code_cell("draw()", outputs=[shown("![falls](fig05.png)")]),
    ]
    nbformat.write(new_notebook(cells=cells), folder / "toy.ipynb")
    text = page(folder / "toy.ipynb", folder, CAME)["cells"][-1]["source"]
    assert "{py:func}`~replication.report.figures.error_figure`" in text


def test_a_table_has_its_file(folder: Path) -> None:
    """A table that was published is shown as it is, with its full numbers to take away."""
    text = made(folder, shown(TABLE)).cells[2].source
    assert text.startswith(f"({anchor('table1')})=\n\n{TABLE}")
    assert "`CSV <../figures/table1.csv>`" in text


def test_a_player_is_part_of_the_page(folder: Path) -> None:
    """A link to a player becomes the player itself."""
    text = made(folder, shown("[film.html](film.html)")).cells[2].source
    assert ":file: ../figures/film.html" in text
    assert "`CSV <../figures/film.csv>`" in text


def test_other_outputs_stay(folder: Path) -> None:
    """Text that a cell prints stays with it; what it says in Markdown becomes text of the page."""
    printed = new_output("stream", name="stdout", text="said")
    node = made(folder, printed, shown("**open:** ALPHA"))
    assert ["".join(one.text) for one in node.cells[1].outputs] == ["said"]
    assert node.cells[2].source == "**open:** [ALPHA](#choice-alpha)"


def test_code_is_there_but_hidden(folder: Path) -> None:
    """Every cell of code has the tag by which its source can be shown, and none is lost."""
    node = made(folder, code="a = 1")
    assert "".join(node.cells[1].source) == "a = 1"
    assert node.cells[1].metadata.tags == ["hide-input"]


def test_unknown_run_times_are_said_to_be_unknown() -> None:
    """Where a run is not known, as in a fresh clone, its time is not made up."""
    line = Provenance("toy", {"seed": 7}).line([], "")
    assert "seed = 7 · run time of the notebook: not recorded here" in line


def test_every_choice_is_linked_once() -> None:
    """All ids of the register lead to their entry; longer ids, code and links are left alone."""
    for id in load_choices():
        assert link_choices(f"see {id}.") == f"see [{id}](#choice-{id.lower()})."
        assert link_choices(f"`{id}` [{id}](#x) {id}-OTHER X{id}") == (
            f"`{id}` [{id}](#x) {id}-OTHER X{id}"
        )
