from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from replication import files
from replication.export.about import About, ExportError, about, committed
from replication.files import PROJECT


def git(folder: Path, *words: str) -> None:
    """Run git as somebody."""
    who = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
    subprocess.run(["git", *who, *words], cwd=folder, check=True, capture_output=True)


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project with a published file and the package's own description."""
    for name in ("pyproject.toml", "CITATION.cff"):
        (tmp_path / name).write_bytes((PROJECT / name).read_bytes())
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "a.csv").touch()
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    return tmp_path


def test_both_files_say_the_same(about: About) -> None:
    """Version and licence are the same in pyproject.toml and CITATION.cff."""
    for name in ("version", "license"):
        assert about.project[name] == about.cff[name]
    assert about.license == "https://spdx.org/licenses/MIT"


def test_the_paper_has_its_authors(about: About) -> None:
    """The paper is an article by five persons with names in two parts."""
    assert about.paper["@type"] == "ScholarlyArticle"
    people = about.paper["author"]
    assert len(people) == 5
    assert all(one["name"] == f"{one['givenName']} {one['familyName']}" for one in people)


def test_the_date_is_that_of_the_results(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the day on which figures/ last changed in git, not that of a later commit."""
    git(project, "init", "-q")
    for day, change in (("2025-03-04", "figures/a.csv"), ("2025-06-07", "pyproject.toml")):
        monkeypatch.setenv("GIT_COMMITTER_DATE", f"{day}T12:00:00Z")
        git(project, "add", change)
        git(project, "commit", "-q", "-m", "x")
    assert committed() == about().date == "2025-03-04"


def test_a_release_has_its_own_date(project: Path) -> None:
    """What CITATION.cff says comes first."""
    cff = project / "CITATION.cff"
    cff.write_text(cff.read_text(encoding="utf-8") + "date-released: 2026-05-06\n")
    assert about().date == "2026-05-06"


@pytest.mark.parametrize("path", [None, ""])
def test_without_a_date_it_says_what_to_add(
    project: Path, path: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With neither a date, a repository nor git there is one line, with the file and an example."""
    if path is not None:
        monkeypatch.setenv("PATH", path)
    message = r"^CITATION.cff: has no date-released.*add a line such as date-released: 2026-01-31$"
    with pytest.raises(ExportError, match=message):
        about()
