from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from replication.files import PROJECT, write_file
from replication.pipeline import execute
from replication.pipeline.notebook import NotebookError
from replication.pipeline.run import run_notebooks
from replication.site import build
from replication.site.build import SiteError, build_site
from tests.notebooks import damage

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
    write_file(toy_project / "docs" / "captions.toml", "")
    write_file(toy_project / "docs" / "index.md", INDEX.format(text="Some prose."))
    run_notebooks([write(toy_project)], profile="paper", out=toy_project / "figures")
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


@pytest.fixture
def no_sphinx(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let each page be its source; like Sphinx, keep the pages that are there."""

    def write(work: Path) -> None:
        for path in (work / "source").glob("*.md"):
            write_file(work / "html" / f"{path.stem}.html", path.read_text(encoding="utf-8"))
        write_file(work / "html" / build.INDEX, "")

    monkeypatch.setattr(build, "_write", write)


def built(project: Path) -> Path:
    """Build the site; return its folder."""
    first = build_site([project / "notebooks" / "toy.ipynb"], project / "site")
    assert first == project / "site" / "index.html"
    return first.parent


def test_a_site_follows_its_sources(project: Path) -> None:
    """Without executing anything, new words reach their page and new titles all pages."""
    (project / "docs" / "other.md").write_text("---\norphan: true\n---\n# Other\n")
    site = built(project)
    index, notebook = site / "index.html", site / "notebooks" / "toy.html"
    assert "Some prose." in index.read_text("utf-8")
    assert "A toy" in notebook.read_text("utf-8")

    work = project / "build" / "site-work"
    others = [work / "source" / "other.md", work / "html" / "other.html"]
    before = [path.stat().st_mtime_ns for path in others]
    (project / "docs" / "index.md").write_text(INDEX.format(text="Other prose."))
    write(project, prose="# A toy\n\nMore words.")
    built(project)
    assert "Other prose." in index.read_text("utf-8")
    assert "More words." in notebook.read_text("utf-8")
    assert [path.stat().st_mtime_ns for path in others] == before
    assert damage(project / "figures") == []

    (project / "docs" / "index.md").write_text(INDEX.format(text="[gone](nowhere.md)"))
    with pytest.raises(SiteError, match=r"the pages cannot be written: index\.md.*nowhere"):
        built(project)
    assert "Other prose." in index.read_text("utf-8")

    text = INDEX.format(text="Fixed.").replace("Toy report", "New report")
    (project / "docs" / "index.md").write_text(text)
    built(project)
    assert "Fixed." in index.read_text("utf-8")
    assert "New report" in notebook.read_text("utf-8")


def test_pages_of_what_is_gone_are_removed(project: Path) -> None:
    """When the modules of the package change, no page that was written for one before is kept."""
    built(project)
    left = project / "build" / "site-work" / "html" / "gone.html"
    left.touch()
    (project / "replication").mkdir()
    (project / "replication" / "new.py").touch()
    assert not (built(project) / "gone.html").exists()
    assert not left.exists()


@pytest.mark.usefixtures("no_sphinx")
def test_a_stale_or_missing_notebook_stops_the_build(project: Path) -> None:
    """It is named, with the reason and what to do; the site that is there stays."""
    before = (built(project) / "index.html").read_bytes()
    write(project, code="x = 2")
    why = "the notebook's code has changed"
    with pytest.raises(NotebookError, match=f"toy is stale: {why}; first: replicate run toy"):
        built(project)
    shutil.rmtree(project / "figures")
    with pytest.raises(NotebookError, match="toy is missing; first: replicate run toy"):
        built(project)
    assert (project / "site" / "index.html").read_bytes() == before


@pytest.mark.usefixtures("no_sphinx")
def test_what_is_gone_leaves_the_site(project: Path) -> None:
    """A page whose source was removed is not on the site any more."""
    extra = project / "docs" / "extra.md"
    extra.write_text("# Extra")
    assert (built(project) / "extra.html").exists()
    extra.unlink()
    assert not (built(project) / "extra.html").exists()


def test_other_folders_are_left_alone(project: Path) -> None:
    """A folder that holds something else than a site is refused, and nothing in it is touched."""
    thesis = project / "site" / "thesis.tex"
    write_file(thesis, "years of work")
    with pytest.raises(SiteError, match="site holds other files than a site; choose another"):
        built(project)
    assert thesis.read_text() == "years of work"


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


@pytest.mark.usefixtures("no_sphinx")
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
