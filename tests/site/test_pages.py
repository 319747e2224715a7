from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from replication.paper.register import load_choices
from replication.site.pages import Origin, anchor, link_choices, link_pages, page

TABLE = "| a   | b   |\n| --- | --- |\n| 1   | 2   |\n"
ORIGIN = Origin("toy", {"seed": 7, "trials": 3, "choices": {}, "jobs": 2}, 12.4, "Linux, 2 cores")


def shown(data: dict[str, str], **known: str) -> Any:
    """Return an output of a cell; what is known of it stands in its metadata."""
    metadata = {"replication": known} if known else {}
    return new_output("execute_result", data, metadata=metadata, execution_count=1)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write outputs: a figure in three files, a table in two, a player in two."""
    names = ("fig05.png", "fig05.svg", "fig05.csv", "table1.csv", "film.html", "film.csv")
    for name in names:
        (tmp_path / name).touch()
    return tmp_path


def made(folder: Path, *outputs: Any, code: str = "x") -> Any:
    """Return the page of a published notebook with a title and one cell."""
    cells = [new_markdown_cell("# Toy"), new_code_cell(code, outputs=list(outputs))]
    nbformat.write(new_notebook(cells=cells), folder / "notebook.ipynb")
    node = nbformat.from_dict(page(folder / "notebook.ipynb", ORIGIN))
    nbformat.validate(node)
    return node


def test_a_figure_is_described_and_traced(folder: Path) -> None:
    """Its words are alternative text and caption; run, files, notebook and code stand below."""
    words, code = "d falls [to 0]\nat once", "replication.report.errors.draw"
    figure = shown({"image/png": "AAAA"}, kind="figure", name="fig05", alt=words, code=code)
    node = made(folder, figure)
    assert node.cells[1].outputs == []
    text = node.cells[2].source
    assert "{figure} ../figures/toy/fig05.png" in text
    assert text.startswith(f"({anchor('toy', 'fig05')})=\n\n````")
    assert ":alt: d falls [to 0] at once\n" in text
    assert "\n\nd falls \\[to 0\\] at once\n\n" in text
    assert "seed = 7, trials = 3 · the notebook ran 12 s on Linux, 2 cores" in text
    for name in ("fig05.csv", "fig05.svg"):
        assert f"<../figures/toy/{name}>`" in text
    assert "`notebook <../source/toy.ipynb>`" in text
    assert text.rstrip("`\n").endswith(f"code: {{py:func}}`~{code}")


def test_a_table_has_its_file(folder: Path) -> None:
    """A table is shown as it is, with its full numbers as a file."""
    table = shown({"text/markdown": TABLE}, kind="table", name="table1")
    text = made(folder, table).cells[2].source
    assert text.startswith(f"({anchor('toy', 'table1')})=\n\n{TABLE}")
    assert "`CSV <../figures/toy/table1.csv>`" in text
    assert "SVG" not in text


def test_a_name_is_a_place_once(folder: Path) -> None:
    """A figure and a table of one name are both shown; links lead to the first of them."""
    figure = shown({"image/png": "AAAA"}, kind="figure", name="fig05", alt="it falls")
    table = shown({"text/markdown": TABLE}, kind="table", name="fig05")
    cells = made(folder, figure, table).cells
    assert anchor("toy", "fig05") in cells[2].source
    assert cells[3].source.startswith(TABLE)


def test_a_player_is_part_of_the_page(folder: Path) -> None:
    """The link that a published notebook has instead of a player becomes the player itself."""
    link = {"text/markdown": "[film.html](film.html)"}
    text = made(folder, shown(link, kind="player", name="film", alt="it moves")).cells[2].source
    assert ":file: ../figures/toy/film.html" in text
    assert "[film.html]" not in text
    assert "`CSV <../figures/toy/film.csv>`" in text


def test_other_outputs_stay(folder: Path) -> None:
    """Printed text stays with its cell of hidden code; Markdown becomes text of the page."""
    printed = new_output("stream", name="stdout", text="hello")
    node = made(folder, printed, shown({"text/markdown": "**open:** ALPHA"}), code="a = 1")
    assert ["".join(output.text) for output in node.cells[1].outputs] == ["hello"]
    assert "".join(node.cells[1].source) == "a = 1"
    assert node.cells[1].metadata.tags == ["hide-input"]
    assert node.cells[2].source == "**open:** [ALPHA](#choice-alpha)"


def test_an_unknown_run_time_is_left_out(tmp_path: Path) -> None:
    """Where no run is recorded, as in a fresh clone, no time is shown."""
    line = Origin("toy", {"seed": 7}).line(tmp_path, "fig05")
    assert line == "seed = 7 · {download}`notebook <../source/toy.ipynb>`"


def test_every_choice_is_linked_once() -> None:
    """All ids of the register lead to their entry; longer ids, code and links are left alone."""
    for id in load_choices():
        assert link_choices(f"see {id}.") == f"see [{id}](#choice-{id.lower()})."
        assert link_choices(f"`{id}` [{id}](#x) {id}-OTHER X{id}") == (
            f"`{id}` [{id}](#x) {id}-OTHER X{id}"
        )


@pytest.mark.parametrize(
    ("link", "target"),
    [
        ("../figures/claims/verdicts.md", "#result-claims-verdicts"),
        ("../figures/claims/notebook.ipynb", "notebooks/claims.ipynb"),
        ("../figures/claims/verdicts.csv", "figures/claims/verdicts.csv"),
        ("../CITATION.cff", "CITATION.cff"),
        ("choices.md#f-index", "choices.md#f-index"),
    ],
)
def test_links_of_docs_lead_to_pages(link: str, target: str) -> None:
    """A published table or notebook is a place on the site, any other file a file of it."""
    assert link_pages(f"see [this]({link}).") == f"see [this]({target})."
