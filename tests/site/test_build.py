from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from replication.files import PROJECT, write_file
from replication.pipeline import execute
from replication.pipeline.run import run_notebooks
from replication.pipeline.verify import verify_outputs
from replication.site import build
from replication.site.build import SiteError, build_site

CONF = """
extensions = ["myst_nb"]
nb_execution_mode = "off"
exclude_patterns = ["figures", "source"]
"""
INDEX = "# Toy report\n\n{text}\n\n```{{toctree}}\nnotebooks/toy\n```\n"


@pytest.fixture
def project(toy_project: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project with a notebook, its published outputs and a page of prose."""
    monkeypatch.setattr(build, "_generated", lambda out: {"verdicts": "all of them"})
    write_file(toy_project / "docs" / "conf.py", CONF)
    write_file(toy_project / "docs" / "index.md", INDEX.format(text="Some prose."))
    write(toy_project)
    run(toy_project)
    monkeypatch.setattr(execute, "execute", lambda *_, **__: pytest.fail("executed"))
    return toy_project


def write(project: Path, code: str = "x = 1", prose: str = "# A toy") -> Path:
    """Write the notebook."""
    parameters = new_code_cell('out = "x"', metadata={"tags": ["parameters"]})
    cells = [new_markdown_cell(prose), parameters, new_code_cell(code, id="code")]
    metadata = {"language_info": {"name": "python"}, "replication": {"data": ["trials.csv"]}}
    path = project / "notebooks" / "toy.ipynb"
    path.parent.mkdir(exist_ok=True)
    nbformat.write(new_notebook(cells=cells, metadata=metadata), path)
    return path


def run(project: Path, **options: Any) -> None:
    """Run the notebook into `figures`."""
    notebook = project / "notebooks" / "toy.ipynb"
    run_notebooks([notebook], profile="paper", out=project / "figures", **options)


def built(project: Path) -> str:
    """Build the site; return its page of the notebook."""
    first = build_site([project / "notebooks" / "toy.ipynb"], project / "site")
    assert first == project / "site" / "index.html"
    return (project / "site" / "notebooks" / "toy.html").read_text(encoding="utf-8")


def test_nothing_is_executed(project: Path) -> None:
    """The site has the notebook's page and that of the prose, from what was published."""
    assert "A toy" in built(project)
    assert "Some prose." in (project / "site" / "index.html").read_text(encoding="utf-8")


def test_a_stale_notebook_stops_the_build(project: Path) -> None:
    """A stale notebook is named, with the reason and what to do; the old site stays."""
    built(project)
    before = (project / "site" / "index.html").read_bytes()
    write(project, code="x = 2")
    why = "the notebook's code has changed"
    with pytest.raises(SiteError, match=f"toy is stale: {why}; first: replicate run toy"):
        built(project)
    assert (project / "site" / "index.html").read_bytes() == before


def test_a_missing_notebook_stops_the_build(project: Path) -> None:
    """Without any outputs the notebook is named, too."""
    shutil.rmtree(project / "figures")
    with pytest.raises(SiteError, match="toy is missing; first: replicate run toy"):
        built(project)


def test_new_text_is_taken_over(project: Path) -> None:
    """Prose of a notebook reaches its page without a run, and the manifest stays true."""
    built(project)
    write(project, prose="# A game")
    assert "A game" in built(project)
    assert list(verify_outputs(project / "figures")) == []


def test_only_what_changed_is_written(project: Path) -> None:
    """New prose on one page leaves the files of the others alone, and an equal build leaves all."""
    built(project)
    source, html = (project / "build" / "site-work" / part for part in ("source", "html"))
    before = {path: path.stat().st_mtime_ns for path in source.rglob("*.*")}
    page = (html / "notebooks" / "toy.html").stat().st_mtime_ns
    (project / "docs" / "index.md").write_text(INDEX.format(text="Other prose."))
    built(project)
    changed = {path.name for path, stamp in before.items() if path.stat().st_mtime_ns != stamp}
    assert changed == {"index.md"}
    assert (html / "notebooks" / "toy.html").stat().st_mtime_ns == page
    assert "Other prose." in (project / "site" / "index.html").read_text(encoding="utf-8")


def test_a_new_title_reaches_every_page(project: Path) -> None:
    """Where titles or their order change, all pages are written: each shows them at its side."""
    built(project)
    text = INDEX.format(text="Some prose.").replace("Toy report", "Other report")
    (project / "docs" / "index.md").write_text(text)
    assert "Other report" in built(project)


def test_what_is_gone_leaves_the_site(project: Path) -> None:
    """A page whose source was removed is not on the site any more."""
    extra = project / "docs" / "extra.md"
    extra.write_text("---\norphan: true\n---\n# Extra\n")
    built(project)
    assert (project / "site" / "extra.html").exists()
    extra.unlink()
    built(project)
    assert not (project / "site" / "extra.html").exists()


def test_other_folders_are_left_alone(project: Path) -> None:
    """A folder that holds something else than a site is refused, and nothing in it is touched."""
    thesis = project / "site" / "thesis.tex"
    write_file(thesis, "years of work")
    with pytest.raises(SiteError, match="site holds other files than a site; choose another"):
        built(project)
    assert thesis.read_text() == "years of work"


def test_a_broken_page_is_named(project: Path) -> None:
    """A link that leads nowhere is one error with the page's name, and the old site stays."""
    built(project)
    (project / "docs" / "index.md").write_text(INDEX.format(text="[gone](nowhere.md)"))
    with pytest.raises(SiteError, match=r"the pages cannot be written: index\.md.*nowhere"):
        built(project)
    assert (project / "site" / "index.html").exists()
    (project / "docs" / "index.md").write_text(INDEX.format(text="fixed"))
    built(project)


def test_what_is_generated_stands_at_its_mark(project: Path) -> None:
    """A mark in the prose is replaced; links to published tables lead to their place on a page."""
    text = "<!-- site: verdicts --> [a](../figures/toy/trials.csv) [b](../figures/toy/table1.md)"
    (project / "docs" / "index.md").write_text(INDEX.format(text=text))
    pages = build._prose({"verdicts": "all of them"})
    assert "all of them [a](figures/toy/trials.csv) [b](#result-toy-table1)" in pages["index.md"]


def test_every_mark_is_known() -> None:
    """Each mark in docs/ names something that the site generates."""
    source = (PROJECT / "replication" / "site" / "build.py").read_text(encoding="utf-8")
    for path in (PROJECT / "docs").glob("*.md"):
        for name in re.findall(r"<!-- site: (\w+) -->", path.read_text(encoding="utf-8")):
            assert f'"{name}": ' in source


@pytest.mark.parametrize("there", [True, False])
def test_the_site_is_replaced_in_one_step(
    project: Path, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    """If the new site cannot be copied, the one that is there stays whole."""
    if there:
        built(project)

    def full(*_: object, **__: object) -> Callable[..., None]:
        raise OSError(28, "No space left on device", "somewhere")

    monkeypatch.setattr(shutil, "copytree", full)
    with pytest.raises(OSError, match="No space left"):
        built(project)
    assert (project / "site" / "index.html").exists() == there
