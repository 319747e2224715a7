from __future__ import annotations

import datetime
import json
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from replication import files
from replication.pipeline import status
from replication.pipeline.plan import prepare
from replication.pipeline.run import run_notebooks
from replication.pipeline.status import status_lines


@pytest.fixture
def project(toy_project: Path) -> Path:
    """Use a project in which nothing is really executed."""
    return toy_project


def write(project: Path, name: str = "maze", code: str = "x = 1", prose: str = "# Maze") -> Path:
    """Write a notebook with a figure in two formats, a table, and a file that is shared."""
    parameters = new_code_cell('trials = 3\nout = "x"', metadata={"tags": ["parameters"]})
    cells = [new_markdown_cell(prose), parameters, new_code_cell(code)]
    outputs = [f"{name}_fig.png", f"{name}_fig.svg", f"{name}_table.csv"]
    declared = {"outputs": outputs, "merged": ["trials.csv"]}
    node = new_notebook(cells=cells, metadata={"replication": declared})
    nbformat.write(node, project / f"{name}.ipynb")
    return project / f"{name}.ipynb"


def run(project: Path, *names: str) -> None:
    """Run notebooks into `figures`."""
    notebooks = [project / f"{name}.ipynb" for name in names]
    run_notebooks(notebooks, profile="paper", out=project / "figures", executed=project / "done")


def lines(project: Path, *names: str) -> list[str]:
    """Return the status of notebooks."""
    runs = prepare([project / f"{name}.ipynb" for name in names or ("maze",)], profile="paper")
    return status_lines(runs, project / "figures", project / "done")


def test_before_the_first_run_everything_is_missing(project: Path) -> None:
    """There need be no folder; the last line says what to do."""
    write(project)
    assert lines(project) == [
        "maze: missing",
        "    missing  maze_fig .png .svg",
        "    missing  maze_table .csv",
        "    missing  trials .csv",
        "",
        "to bring figures up to date: replicate run maze",
    ]


def test_after_a_run_everything_is_fresh(project: Path) -> None:
    """Each figure and table is fresh, with run time and age of its notebook."""
    write(project)
    run(project, "maze")
    assert lines(project) == [
        "maze: fresh (0 s, just now)",
        "    fresh    maze_fig .png .svg",
        "    fresh    maze_table .csv",
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
    assert found[-1] == "to bring figures up to date: replicate run maze"


def test_prose_alone_is_no_reason_to_execute(project: Path) -> None:
    """New text leaves figures and tables fresh, and a run is due for the executed notebook."""
    write(project)
    run(project, "maze")
    write(project, prose="# Labyrinth")
    found = lines(project)
    assert found[:2] == [
        "maze: fresh (0 s, just now)",
        "    only its text has changed, which is not executed",
    ]
    assert [line.split()[0] for line in found[2:5]] == ["fresh"] * 3
    assert found[-1] == "to bring figures up to date: replicate run maze"


def test_damaged_outputs_are_told_apart(project: Path) -> None:
    """A file that was deleted or edited has its own state, and is the reason."""
    write(project)
    run(project, "maze")
    (project / "figures" / "maze_fig.png").write_text("mine")
    (project / "figures" / "maze_table.csv").unlink()
    assert lines(project)[:5] == [
        "maze: stale (0 s, just now)",
        "    because maze_fig.png is changed",
        "    because maze_table.csv is missing",
        "    changed  maze_fig .png .svg",
        "    missing  maze_table .csv",
    ]


def test_outputs_without_a_record_are_stale(project: Path) -> None:
    """Files that nobody knows how they were made are never called fresh."""
    write(project)
    run(project, "maze")
    (project / "figures" / "provenance.json").write_text("{")
    assert lines(project)[1] == "    because there is no record of how they were made"
    run(project, "maze")
    (project / "figures" / "maze.ipynb").unlink()
    assert lines(project)[1] == "    because maze.ipynb is missing"


def test_notebooks_have_states_of_their_own(project: Path) -> None:
    """Only what is due is in the command, and a shared file that was merged is still fresh."""
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
        "to bring figures up to date: replicate run open third",
    ]


def test_many_reasons_are_cut_short(project: Path) -> None:
    """Up to six reasons are shown, and of more the first five and their number."""
    assert status._reasons(list("abcdef")) == list("abcdef")
    assert status._reasons(list("abcdefgh")) == [*"abcde", "3 more"]


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
def test_age_is_never_negative(project: Path, seconds: float, age: str) -> None:
    """However the clock was set, the age of a run reads well."""
    write(project)
    run(project, "maze")
    file = project / "done" / "run.json"
    runs = json.loads(file.read_text())
    then = datetime.datetime.now(datetime.UTC) - datetime.timedelta(seconds=seconds)
    runs["maze"] |= {"finished": then.isoformat(), "seconds": 754.4}
    file.write_text(json.dumps(runs))
    assert lines(project)[0] == f"maze: fresh (754 s, {age})"


def test_the_commands_have_the_options_of_the_question(project: Path) -> None:
    """What is recommended for other outputs than the default ones names these."""
    write(project)
    runs = prepare([project / "maze.ipynb"], profile="paper")
    options = ["--profile", "quick", "--out", "my figures"]
    found = status_lines(runs, project / "figures", project / "done", options)
    command = "replicate run maze --profile quick --out 'my figures'"
    assert found[-1] == f"to bring figures up to date: {command}"
    run(project, "maze")
    runs = prepare([project / "maze.ipynb"], profile="paper")
    found = status_lines(runs, project / "figures", project / "done", options)
    command = "replicate verify --profile quick --out 'my figures'"
    assert found[-1] == f"everything is fresh; {command} proves it"


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


@pytest.mark.parametrize(
    "entry", ["3", "{}", '{"seconds": 1}', '{"seconds": "x", "finished": "y"}', "null"]
)
def test_what_is_badly_remembered_is_forgotten(project: Path, entry: str) -> None:
    """A line of run.json that lacks what is shown counts as a run that did not finish."""
    write(project)
    run(project, "maze")
    (project / "done" / "run.json").write_text(f'{{"maze": {entry}}}')
    assert lines(project)[:2] == ["maze: stale", "    because its last run did not finish"]


def test_what_this_repository_publishes_is_fresh(tmp_path: Path) -> None:
    """In a fresh clone, in which nothing has run, every figure and table is up to date."""
    notebooks = sorted((files.PROJECT / "notebooks").glob("*.ipynb"))
    runs = prepare(notebooks, profile="paper")
    found = status_lines(runs, files.PROJECT / "figures", tmp_path)
    assert found[-1] == "everything is fresh; replicate verify proves it", "\n".join(found)
