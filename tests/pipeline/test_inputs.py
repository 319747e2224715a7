from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from replication import files, load_demos
from replication.demos.checks import DemoError
from replication.pipeline import inputs as inputs_module
from replication.pipeline.inputs import Inputs, changes
from replication.pipeline.notebook import Notebook, NotebookError, read_notebook
from tests.conftest import Spoil
from tests.notebooks import write_notebook

PARAMETERS = 'trials = 3\ndemos = "demos.json"\njobs = 1\nstore = "s"\nout = "build"'
CODE = "from replication.learning.seeds import trial_seeds\nvalue = trials  # as given"

Write = Callable[..., Notebook]


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project with a lock, a data file of each format, and no notebook."""
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "environment.lock").write_text("numpy==1\n")
    (tmp_path / "choices.toml").write_text("a = 1\nb = 2\n")
    (tmp_path / "demos.json").write_text('{"a": 1, "b": [2]}')
    return tmp_path


@pytest.fixture
def write(project: Path) -> Write:
    """Write a notebook and read it: a headline, the parameters and code cells."""

    def write(*code: str, **given: Any) -> Notebook:
        declared = {"data": ["a.csv"], "inputs": ["choices.toml"]}
        given = {"parameters": PARAMETERS, "prose": "# Toy"} | declared | given
        write_notebook(project / "toy.ipynb", *code or (CODE,), **given)
        return read_notebook(project / "toy.ipynb")

    return write


def inputs_of(notebook: Notebook, values: dict[str, Any]) -> Inputs:
    """Return the inputs of a notebook that needs no other."""
    return inputs_module.inputs_of(notebook, values, notebook.path.parent / "figures")


def known(inputs: Inputs) -> Inputs:
    """Return inputs as they come back from a manifest."""
    found: Inputs = json.loads(json.dumps(inputs))
    return found


# --- what does not count ---------------------------------------------------------------------


def test_prose_comments_and_layout_do_not_count(write: Write, project: Path) -> None:
    """A reader's text, and how code and data are laid out, leave the inputs as they are."""
    before = inputs_of(write(), {})
    notebook = write(
        '"""Why."""\n'
        "from replication.learning.seeds import trial_seeds  # the seeds\n\nvalue = (trials)",
        prose="# Another headline",
        parameters=f"# So many:\n{PARAMETERS}  # a folder",
    )
    (project / "choices.toml").write_text("# why\nb=2\na   = 1\n")
    (project / "demos.json").write_text('{\n  "b": [2],\n  "a": 1\n}\n')
    assert inputs_of(notebook, {}) == before
    assert changes(known(before), inputs_of(notebook, {})) == []


def test_what_changes_no_result_does_not_count(write: Write) -> None:
    """Workers, the store and the folder may differ, and so may literals that are overridden."""
    before = inputs_of(write(), {"trials": 5})
    other = PARAMETERS.replace("trials = 3", "trials = 4").replace("jobs = 1", "jobs = 2")
    values = {"trials": 5, "jobs": 8, "store": "elsewhere", "out": "there"}
    assert inputs_of(write(parameters=other), values) == before


def test_another_folder_does_not_count(
    write: Write, project: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """The inputs hold no path of this machine."""
    before = inputs_of(write(), {})
    assert str(project) not in json.dumps(before)
    assert sorted(before["data"]) == ["choices.toml", "demos.json"]
    away = tmp_path_factory.mktemp("away") / "mine.json"
    away.write_text("{}")
    assert "mine.json" in inputs_of(write(), {"demos": str(away)})["data"]
    assert str(away.parent) not in json.dumps(inputs_of(write(), {"demos": str(away)})["data"])


# --- what counts -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"code": CODE + " + 1"}, []),
        ({"code": CODE.replace("trials  #", "trials + 1  #")}, ["the notebook's code has changed"]),
        (
            {"parameters": PARAMETERS.replace("trials = 3", "trials = 4")},
            ["parameter trials has changed"],
        ),
        ({"parameters": f"more = 1\n{PARAMETERS}"}, ["parameter more has changed"]),
        ({"data": ["a.csv", "b.csv"]}, ["the notebook declares other outputs"]),
        ({"inputs": []}, ["choices.toml has changed"]),
        ({"values": {"trials": 9}}, ["parameter trials has changed"]),
        ({"choices.toml": "a = 2\nb = 2"}, ["choices.toml has changed"]),
        ({"choices.toml": "no TOML"}, ["choices.toml has changed"]),
        ({"demos.json": '{"a": 1, "b": [3]}'}, ["demos.json has changed"]),
        ({"demos.json": "no JSON"}, ["demos.json has changed"]),
        ({"environment.lock": "numpy==2"}, ["environment.lock has changed"]),
    ],
)
def test_what_counts_is_named(
    write: Write, project: Path, changed: dict[str, Any], message: list[str]
) -> None:
    """Code, parameters, declarations, data and lock: each is told by its name."""
    before = known(inputs_of(write(), {}))
    for name in ("choices.toml", "demos.json", "environment.lock"):
        if name in changed:
            (project / name).write_text(changed.pop(name))
    code, values = changed.pop("code", CODE), changed.pop("values", {})
    assert changes(before, inputs_of(write(code, **changed), values)) == message


def test_a_change_of_a_module_is_named(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    """The hash of each module that the cells import, directly or not, is part of the inputs."""
    before = inputs_of(write(), {})
    assert list(before["source"]) == ["replication.learning.seeds"]
    now = inputs_of(write("import replication.evidence.tables\nfrom numpy import pi"), {})
    assert {"replication.evidence.tables", "replication.evidence.statistics"} <= set(now["source"])
    assert all(name.startswith("replication") for name in now["source"])
    edited = before | {"source": {"replication.learning.seeds": "0" * 16}}
    assert changes(known(before), edited) == ["replication.learning.seeds has changed"]


def test_code_that_python_cannot_read_has_inputs(write: Write) -> None:
    """Magics and faults are left to the run, and what stands beside magics still counts."""
    first, second = (inputs_of(write(CODE, line), {}) for line in ("%time x", "%time y"))
    assert changes(known(first), second) == ["the notebook's code has changed"]
    assert list(first["source"]) == ["replication.learning.seeds"]
    beside = write(
        "%%time\n%matplotlib inline\n!ls\nfrom replication.learning.seeds import trial_seeds"
    )
    assert list(inputs_of(beside, {})["source"]) == ["replication.learning.seeds"]
    assert inputs_of(write("from replication.learning.seeds import ("), {})["source"] == {}


def test_cells_are_told_apart(write: Write) -> None:
    """The same lines in other cells are other code, since each cell has outputs of its own."""
    whole = "x = 1\n\n\ndef f(): pass"
    before = known(inputs_of(write(whole), {}))
    notebook = write(*whole.split("\n\n\n"))
    assert changes(before, inputs_of(notebook, {})) == ["the notebook's code has changed"]
    before = known(inputs_of(notebook, {}))
    text, parameters, first, second = notebook.cells
    moved = replace(notebook, cells=(text, first, parameters, second), at=2)
    assert changes(before, inputs_of(moved, {})) == ["the notebook's code has changed"]


def test_any_file_that_a_parameter_names_counts(write: Write, project: Path) -> None:
    """A text that is the name of a file stands for what the file says; other text is only text."""
    parameters = PARAMETERS + f'\nmap = "map.txt"\nword = "none.txt"\nlong = "{"x" * 5000}"'
    (project / "map.txt").write_text("..G")
    (project / "s").write_text("a store")
    notebook = write(parameters=parameters)
    before = inputs_of(notebook, {})
    assert sorted(before["data"]) == ["choices.toml", "demos.json", "map.txt"]
    (project / "map.txt").write_text(".#G")
    (project / "s").write_text("another store")
    assert changes(known(before), inputs_of(notebook, {})) == ["map.txt has changed"]


def test_missing_data_is_the_users_mistake(write: Write, project: Path) -> None:
    """A data file that does not exist is named before anything runs."""
    (project / "demos.json").unlink()
    with pytest.raises(NotebookError, match=r"demos\.json: cannot be read \(no .*; toy reads"):
        inputs_of(write(), {})


def test_data_of_any_kind_is_hashed_or_refused(write: Write, project: Path, spoil: Spoil) -> None:
    """What cannot be read is named; what its reader will refuse has the hash of its bytes."""
    path = project / "demos.json"
    spoil(path)
    if path.is_file() and path.stat().st_size < 10**6:
        due = hashlib.sha256(path.read_bytes()).hexdigest()
        assert inputs_of(write(), {})["data"]["demos.json"] == due
    else:
        with pytest.raises(NotebookError, match=r"demos\.json: is [^\n]+; toy reads it"):
            inputs_of(write(), {})


@pytest.mark.parametrize(
    "refused",
    [
        b'{"a": 2, "a": 1, "b": [2]}',
        '{"a": 1, "b": [2]}'.encode("utf-16"),
        b'{"a": 1, "b": [2]}' + b" " * 10_000_000,
    ],
)
def test_what_a_reader_refuses_is_not_taken_for_what_it_accepts(
    write: Write, project: Path, refused: bytes
) -> None:
    """A key that stands there twice, other encodings and sizes leave no file as it was."""
    before = inputs_of(write(), {})
    (project / "demos.json").write_bytes(refused)
    with pytest.raises(DemoError):
        load_demos(project / "demos.json")
    assert changes(known(before), inputs_of(write(), {})) == ["demos.json has changed"]


def test_toml_that_is_nested_too_deeply_is_hashed(write: Write, project: Path) -> None:
    """It has the hash of its bytes, as everything that its reader refuses."""
    (project / "choices.toml").write_text("a = " + "[" * 100_000)
    assert inputs_of(write(), {})["data"]["choices.toml"]


def test_tables_of_needed_notebooks_count(write: Write, project: Path) -> None:
    """All CSV files of a needed notebook are inputs, under names without the folder's place."""
    parameters = f'{PARAMETERS}\nresults = "figures"'
    notebook = write(parameters=parameters, needs=["maze"])
    folder = project / "elsewhere" / "maze"
    folder.mkdir(parents=True)
    for name in ("trials.csv", "fig.csv", "fig.png"):
        (folder / name).write_text("1")
    before = inputs_module.inputs_of(notebook, {}, folder.parent)
    assert {"maze/fig.csv", "maze/trials.csv"} < set(before["data"])
    assert "maze/fig.png" not in before["data"]
    (folder / "fig.png").write_text("2")
    (folder / "trials.csv").write_text("2")
    now = inputs_module.inputs_of(notebook, {"results": "there"}, folder.parent)
    assert changes(known(before), now) == ["maze/trials.csv has changed"]


def test_the_code_of_agents_counts(write: Write) -> None:
    """Modules that are only named, and imported when they are needed, are inputs, too."""
    found = inputs_of(write("from replication.trials.run import run_trials"), {})["source"]
    assert {"replication.trials.table_agent", "replication.trials.soccer_agent"} <= found.keys()
