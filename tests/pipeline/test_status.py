from __future__ import annotations

import datetime
import fcntl
import re
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from replication import files
from replication.pipeline import status
from replication.pipeline.declaration import MANIFEST
from replication.pipeline.index import INDEX
from replication.pipeline.notebook import NotebookError
from replication.pipeline.plan import Run, prepare
from replication.pipeline.run import run_notebooks
from replication.pipeline.status import clean, status_lines
from tests.notebooks import write_notebook


@pytest.fixture
def project(toy_project: Path) -> Path:
    """Use a project in which nothing is really executed."""
    return toy_project


def write(project: Path, name: str = "maze", code: str = "x = 1", prose: str = "# Maze") -> Path:
    """Write a notebook with a figure, a table and a file of data."""
    declared = {"figures": ["fig"], "tables": ["table"], "data": ["trials.csv"]}
    given: dict[str, Any] = {"parameters": 'trials = 3\nout = "x"', "prose": prose} | declared
    write_notebook(project / "notebooks" / f"{name}.ipynb", code, **given)
    return project / "notebooks" / f"{name}.ipynb"


def run(project: Path, *names: str) -> None:
    """Run notebooks into `figures`, whatever is there."""
    notebooks = [project / "notebooks" / f"{name}.ipynb" for name in names]
    run_notebooks(notebooks, profile="paper", out=project / "figures", publish=True)


def prepared(project: Path, *names: str) -> list[Run]:
    """Return the runs of notebooks as they are now."""
    paths = [project / "notebooks" / f"{name}.ipynb" for name in names]
    return prepare(paths, profile="paper", out=project / "figures")


def lines(project: Path, *names: str, all: bool = True) -> list[str]:
    """Return the status of notebooks, as if their runs had taken no time."""
    runs = prepared(project, *names or ("maze",))
    lines = status_lines(runs, project / "figures", all=all)
    return [re.sub(r"\(\d+ s,", "(0 s,", line) for line in lines]


def test_what_is_missing_is_fresh_after_a_run(project: Path) -> None:
    """Each figure and table has a line, its notebook one with run time and age."""
    write(project)
    assert lines(project) == [
        "maze: missing",
        "    missing  fig .csv .png .svg",
        "    missing  table .csv .md",
        "    missing  trials .csv",
        "",
        "to bring figures up to date: replicate run maze",
    ]
    run(project, "maze")
    assert lines(project) == [
        "maze: fresh (0 s, just now)",
        "    fresh    fig .csv .png .svg",
        "    fresh    table .csv .md",
        "    fresh    trials .csv",
        "",
        "everything is fresh; replicate verify proves it",
    ]


def test_what_is_stale_has_its_reasons(project: Path) -> None:
    """Every output of a notebook whose code or environment changed is stale, and it says why."""
    write(project)
    run(project, "maze")
    write(project, code="x = 2")
    (project / "environment.lock").write_text("numpy==3")
    found = lines(project)
    assert found[:3] == [
        "maze: stale (0 s, just now)",
        "    because the notebook's code has changed",
        "    because environment.lock has changed",
    ]
    assert [line.split()[0] for line in found[3:6]] == ["stale"] * 3
    assert found[-1] == "to bring figures up to date: replicate run maze --publish"


def test_only_what_is_due_is_told(project: Path) -> None:
    """When all is well there is one line; otherwise what is due has its reasons, and no list."""
    write(project)
    write(project, "open")
    run(project, "maze", "open")
    fresh = ["everything is fresh; replicate verify proves it"]
    assert lines(project, "maze", "open", all=False) == fresh
    (project / "figures" / "open" / "fig.png").write_text("mine")
    assert lines(project, "maze", "open", all=False) == [
        "open: stale (0 s, just now)",
        "    because fig.png is changed",
        "",
        "to bring figures up to date: replicate run open",
    ]


def test_damaged_outputs_are_told_apart(project: Path) -> None:
    """A file that was deleted or edited has its own state, and is the reason."""
    write(project)
    run(project, "maze")
    (project / "figures" / "maze" / "fig.png").write_text("mine")
    (project / "figures" / "maze" / "table.csv").unlink()
    assert lines(project)[:5] == [
        "maze: stale (0 s, just now)",
        "    because fig.png is changed",
        "    because table.csv is missing",
        "    changed  fig .csv .png .svg",
        "    missing  table .csv .md",
    ]


def test_notebooks_have_states_of_their_own(project: Path) -> None:
    """Only what is due is in the command, and each notebook is judged alone."""
    write(project)
    write(project, "open")
    run(project, "maze")
    run(project, "open")
    write(project, "open", code="x = 2")
    write(project, "third")
    found = lines(project, "maze", "open", "third")
    heads = [line.split(" (")[0] for line in found if line and not line.startswith(" ")]
    assert heads == [
        "maze: fresh",
        "open: stale",
        "third: missing",
        "to bring figures up to date: replicate run open third --publish",
    ]


def test_many_reasons_are_cut_short(project: Path) -> None:
    """Up to six reasons are shown, and of more the first five and their number."""
    assert status._shortened(list("abcdef")) == list("abcdef")
    assert status._shortened(list("abcdefgh")) == [*"abcde", "3 more"]


@pytest.mark.parametrize(
    ("seconds", "age"),
    [
        (-1e9, "just now"),
        (-1, "just now"),
        (0, "just now"),
        (59, "just now"),
        (61, "1 minute ago"),
        (3599, "59 minutes ago"),
        (3700, "1 hour ago"),
        (47 * 3600, "1 day ago"),
        (49 * 3600, "2 days ago"),
    ],
)
def test_age_is_never_negative(seconds: float, age: str) -> None:
    """However the clock was set, the age of a run reads well."""
    then = datetime.datetime.now(datetime.UTC) - datetime.timedelta(seconds=seconds)
    assert status._age(then.isoformat()) == age


def test_a_notebook_that_is_gone_is_named(project: Path) -> None:
    """Outputs of a notebook that was removed or renamed are told, with the way to remove them."""
    write(project)
    write(project, "old")
    run(project, "maze", "old")
    assert lines(project)[-4:] == [
        "old: its notebook is gone",
        "",
        "everything is fresh; replicate verify proves it",
        "to remove what is left of old: replicate clean",
    ]


def test_what_this_repository_publishes_is_fresh() -> None:
    """In a fresh clone, in which nothing has run, every figure and table is up to date."""
    notebooks = sorted((files.PROJECT / "notebooks").glob("*.ipynb"))
    figures = files.PROJECT / "figures"
    found = status_lines(prepare(notebooks, profile="paper", out=figures), figures)
    assert found[-1] == "everything is fresh; replicate verify proves it", "\n".join(found)


# --- clean -----------------------------------------------------------------------------------


def cleaned(project: Path, folder: Path | None = None, *, dry_run: bool = False) -> list[str]:
    """Clean the outputs for the notebook `maze`, and return the lines."""
    told: list[str] = []
    folder = folder or project / "figures"
    clean(prepared(project, "maze"), folder, dry_run=dry_run, echo=told.append)
    return told


def names(folder: Path) -> set[str]:
    """Return all files below a folder but for those that begin with a dot."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("[!.]*") if path.is_file()}


@pytest.fixture
def left(project: Path) -> Path:
    """Run two notebooks of which one is gone afterwards, and add a file of nobody."""
    write(project)
    write(project, "old")
    run(project, "maze", "old")
    (project / "notebooks" / "old.ipynb").unlink()
    (project / "figures" / "maze" / "surplus.png").touch()
    return project / "figures"


def test_what_no_notebook_declares_goes(project: Path, left: Path) -> None:
    """Files and folders that nobody answers for are removed; a dry run only says so."""
    before = names(left)
    surplus = sorted(name for name in before if name.startswith("old/"))
    words = ["maze/surplus.png", *(name for name in surplus if MANIFEST not in name)]
    words.append(f"old/{MANIFEST}")
    assert cleaned(project, dry_run=True) == [f"would remove {word}" for word in words]
    assert names(left) == before
    assert cleaned(project) == [f"removed {word}" for word in words]
    assert names(left) == before - {"maze/surplus.png", *surplus}
    assert not (left / "old").exists()
    assert "[maze]" in (left / INDEX).read_text()
    assert "[old]" not in (left / INDEX).read_text()
    assert cleaned(project) == []
    assert lines(project)[-1].startswith("everything is fresh")


def test_foreign_files_and_folders_stay(project: Path, left: Path) -> None:
    """Trials that are stored beside the outputs, and what a user put there, are never removed."""
    kept = {"s.sqlite", "s.sqlite.damaged-1", "mine/notes.txt", "old/mine.txt"}
    for name in kept:
        (left / name).parent.mkdir(exist_ok=True)
        (left / name).touch()
    cleaned(project)
    assert kept < names(left)


@pytest.mark.parametrize("content", [None, "{", '{"format": "other"}'])
def test_a_folder_that_is_not_ours_is_refused(
    project: Path, left: Path, content: str | None
) -> None:
    """Without a manifest of ours, files may be anybody's, and nothing is removed or made."""
    folder = project / "mine"
    (folder / "maze").mkdir(parents=True)
    (folder / "maze" / "precious.txt").touch()
    if content is not None:
        (folder / "maze" / MANIFEST).write_text(content)
    before = list(folder.rglob("*"))
    with pytest.raises(NotebookError, match=r"mine: has no folder with a provenance\.json of ours"):
        cleaned(project, folder)
    assert list(folder.rglob("*")) == before


def test_cleaning_waits_for_a_run(project: Path, left: Path) -> None:
    """While a run has the folder, nothing is removed."""
    before, told = names(left), list[list[str]]()
    with (left / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        thread = threading.Thread(target=lambda: told.append(cleaned(project)))
        thread.start()
        time.sleep(0.3)
        assert names(left) == before
        assert not told
    thread.join()
    assert "removed maze/surplus.png" in told[0]
