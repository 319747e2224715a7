from __future__ import annotations

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from replication.paper.register import load_choices
from replication.site.pages import Origin, anchor, link_choices, link_pages, page
from replication.site.reference import source_of

TABLE = "| a   | b   |\n| --- | --- |\n| 1   | 2   |\n"
PARAMETERS = {"seed": 7, "trials": 3, "choices": {}, "jobs": 2}
ORIGIN = Origin("toy", PARAMETERS, {"fig06": "**Fig. 6.** All {trials} trials."})


def shown(data: dict[str, str], **known: str) -> Any:
    """Return an output of a cell; what is known of it stands in its metadata."""
    metadata = {"replication": known} if known else {}
    return new_output("execute_result", data, metadata=metadata, execution_count=1)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Write outputs: a figure in three files, a table in two, a player in two."""
    names = ("fig05.png", "fig05.svg", "fig05.csv", "table1.csv", "film.html", "film.csv")
    for name in names:
        (tmp_path / name).write_text(name)
    (tmp_path / "fig05.svg").write_text("larger than the other")
    return tmp_path


def made(folder: Path, *outputs: Any, code: str = "x") -> Any:
    """Return the page of a published notebook with a title and one cell."""
    cells = [new_markdown_cell("# Toy"), new_code_cell(code, outputs=list(outputs))]
    nbformat.write(new_notebook(cells=cells), folder / "notebook.ipynb")
    node = nbformat.from_dict(page(folder / "notebook.ipynb", ORIGIN))
    nbformat.validate(node)
    return node


def test_a_figure_is_described_and_traced(folder: Path) -> None:
    """Its words are alternative text and caption; its numbers and its code stand below."""
    words, code = "d falls [to 0]\nat once", "replication.report.errors.draw"
    figure = shown({"image/png": "AAAA"}, kind="figure", name="fig05", alt=words, code=code)
    node = made(folder, figure)
    assert node.cells[1].outputs == []
    text = node.cells[2].source
    assert "{figure} ../figures/toy/fig05.png" in text
    assert text.startswith(f"({anchor('toy', 'fig05')})=\n\n````")
    assert ":alt: d falls [to 0] at once\n" in text
    assert "\n\nd falls \\[to 0\\] at once\n\n" in text
    assert "`CSV <../figures/toy/fig05.csv>`" in text
    address = source_of("py", {"module": "replication.report.errors", "fullname": "draw"})
    assert text.rstrip("`\n").endswith(f'<a href="{address}">code</a>')


def test_a_caption_is_for_readers(folder: Path) -> None:
    """A figure with a caption has that, with the numbers of the run; its words stay for the ear."""
    for suffix in ("png", "svg"):
        (folder / f"fig06.{suffix}").touch()
    text = made(folder, shown({}, kind="figure", name="fig06", alt="d falls to 0")).cells[2].source
    assert ":alt: d falls to 0\n" in text
    assert "\n\n**Fig. 6.** All 3 trials.\n\n" in text


@pytest.mark.parametrize(("png", "svg", "taken"), [("12", "123", "png"), ("123", "12", "svg")])
def test_the_smaller_file_is_shown(folder: Path, png: str, svg: str, taken: str) -> None:
    """A figure is shown as PNG or as SVG, whichever weighs less."""
    for suffix, content in (("png", png), ("svg", svg)):
        (folder / f"fig05.{suffix}").write_text(content)
    figure = shown({"image/png": "AAAA"}, kind="figure", name="fig05", alt="it falls")
    assert f"{{figure}} ../figures/toy/fig05.{taken}\n" in made(folder, figure).cells[2].source


def test_where_a_page_comes_from_stands_once(folder: Path) -> None:
    """The run and the notebook stand at the end of the page, and nowhere else."""
    figure = shown({"image/png": "AAAA"}, kind="figure", name="fig05", alt="it falls")
    cells = made(folder, figure, figure).cells
    line = "Root seed 7, trials of each method 3, {download}`the notebook <../source/toy.ipynb>`"
    assert [line in cell.source for cell in cells] == [False] * (len(cells) - 1) + [True]


def test_code_that_shows_nothing_joins_what_follows(folder: Path) -> None:
    """Cells of code one after the other are one, up to the one that shows something."""
    cells = [new_markdown_cell("# Toy"), new_code_cell("a = 1"), new_code_cell("b = 2")]
    cells[-1].outputs = [new_output("stream", name="stdout", text="hello")]
    nbformat.write(new_notebook(cells=[*cells, new_code_cell("c")]), folder / "notebook.ipynb")
    code = [each for each in page(folder / "notebook.ipynb", ORIGIN)["cells"] if "outputs" in each]
    assert ["".join(each["source"]) for each in code] == ["a = 1\n\nb = 2", "c"]
    assert len(code[0]["outputs"]) == 1


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
        ("choices.md#f-index", "#choice-f-index"),
        ("claims.md#cells", "claims.md#cells"),
    ],
)
def test_links_of_docs_lead_to_pages(link: str, target: str) -> None:
    """A published table or notebook is a place on the site, any other file a file of it."""
    assert link_pages(f"see [this]({link}).") == f"see [this]({target})."
