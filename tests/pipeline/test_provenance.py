from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from replication import files
from replication.pipeline import provenance
from replication.pipeline.notebook import Notebook, NotebookError, read_notebook
from replication.pipeline.provenance import (
    Inputs,
    changes,
    damaged,
    inputs_of,
    read_manifest,
    record,
)

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

    def write(
        *code: str,
        name: str = "toy",
        parameters: str = PARAMETERS,
        prose: str = "# Toy",
        **declared: Any,
    ) -> Notebook:
        cells = [new_markdown_cell(prose), new_code_cell(parameters)]
        cells[1].metadata["tags"] = ["parameters"]
        cells += [new_code_cell(source) for source in code or (CODE,)]
        metadata = {"replication": {"outputs": ["a.csv"], "inputs": ["choices.toml"]} | declared}
        nbformat.write(new_notebook(cells=cells, metadata=metadata), project / f"{name}.ipynb")
        return read_notebook(project / f"{name}.ipynb")

    return write


def known(inputs: Inputs) -> Inputs:
    """Return inputs as they come back from a manifest."""
    found: Inputs = json.loads(json.dumps(inputs))
    return found


# --- what does not count ---------------------------------------------------------------------


def test_prose_comments_and_layout_do_not_count(write: Write, project: Path) -> None:
    """A reader's text, and how code and data are laid out, leave the inputs as they are."""
    before = inputs_of(write(), {})
    notebook = write(
        '"""Why."""\nfrom replication.learning.seeds import trial_seeds  # the seeds\n\nvalue = (trials)',
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
        ({"outputs": ["a.csv", "b.csv"]}, ["the notebook declares other outputs"]),
        ({"merged": ["b.csv"]}, ["the notebook declares other outputs"]),
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
    assert changes(
        known(inputs_of(write(whole), {})), inputs_of(write(*whole.split("\n\n\n")), {})
    ) == ["the notebook's code has changed"]


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
    with pytest.raises(NotebookError, match=r"demos\.json: cannot be read by toy: no such file"):
        inputs_of(write(), {})


# --- the manifest ----------------------------------------------------------------------------


def test_equal_runs_have_equal_manifests(write: Write, project: Path) -> None:
    """The same outputs in another folder, later, give the same bytes, in any order of notebooks."""
    texts = []
    for number, order in enumerate((("one", "two"), ("two", "one"), ("one", "one", "two"))):
        folder = project / f"out-{number}"
        folder.mkdir()
        for name in order:
            (folder / f"{name}.csv").write_text(name)
            (folder / f"{name}.ipynb").write_text("executed")
            notebook = write(name=name, outputs=[f"{name}.csv"])
            record(folder, notebook, inputs_of(notebook, {"jobs": number + 1}), {})
        texts.append((folder / provenance.MANIFEST).read_text())
        assert str(project) not in texts[-1]
    assert texts[0] == texts[1] == texts[2]
    assert list(read_manifest(folder)) == ["one", "two"]
    assert changes(read_manifest(folder)["two"]["inputs"], inputs_of(notebook, {})) == []


def merge(folder: Path, notebook: Notebook) -> None:
    """Let a notebook add its row to a merged file, write its own one, and be recorded."""
    rows = folder / "rows.csv"
    shared = {rows.name: provenance.file_hash(rows)} if rows.exists() else {}
    (folder / f"{notebook.name}.csv").write_text(notebook.name)
    with rows.open("a") as file:
        file.write(notebook.name)
    (folder / notebook.executed).touch()
    record(folder, notebook, inputs_of(notebook, {}), shared)


def lost(folder: Path) -> dict[str, dict[str, str]]:
    """Return the outputs of each notebook that are damaged."""
    return {name: damaged(folder, entry) for name, entry in read_manifest(folder).items()}


def test_a_merged_file_changes_for_all_that_share_it(write: Write, project: Path) -> None:
    """After one notebook has replaced its rows, the file is not damaged for the others."""
    for name in ("one", "two", "one"):
        merge(project, write(name=name, outputs=[f"{name}.csv"], merged=["rows.csv"]))
    assert lost(project) == {"one": {}, "two": {}}
    (project / "rows.csv").write_text("mine")
    (project / "one.csv").unlink()
    assert lost(project) == {
        "one": {"one.csv": "missing", "rows.csv": "changed"},
        "two": {"rows.csv": "changed"},
    }


@pytest.mark.parametrize("how", ["deleted", "edited"])
def test_lost_rows_are_missed_until_they_are_made_again(
    write: Write, project: Path, how: str
) -> None:
    """A merged file that was damaged is sound again only for a notebook that has run since."""
    notebooks = {
        name: write(name=name, outputs=[f"{name}.csv"], merged=["rows.csv"])
        for name in ("one", "two", "three")
    }
    for notebook in notebooks.values():
        merge(project, notebook)
    rows = project / "rows.csv"
    if how == "deleted":
        rows.unlink()
    else:
        rows.write_text("mine")
    changed = {"rows.csv": "changed"}
    merge(project, notebooks["one"])
    assert lost(project) == {"one": {}, "two": changed, "three": changed}
    merge(project, notebooks["three"])
    assert lost(project) == {"one": {}, "two": changed, "three": {}}
    merge(project, notebooks["two"])
    assert lost(project) == {"one": {}, "two": {}, "three": {}}


@pytest.mark.parametrize(
    "entry",
    [
        "3",
        "[]",
        "{}",
        '{"inputs": {}, "outputs": {}}',
        '{"inputs": {"parameters": {}, "data": {}, "source": {}}}',
        '{"inputs": {"parameters": {}, "data": {}, "source": []}, "outputs": {}}',
        '{"inputs": {"parameters": {}, "data": {}, "source": {}}, "outputs": [1]}',
    ],
)
def test_an_entry_that_cannot_be_used_counts_as_none(
    write: Write, project: Path, entry: str
) -> None:
    """One notebook's entry that lacks a part is left out, and the others stay."""
    (project / "a.csv").touch()
    (project / "toy.ipynb").touch()
    record(project, write(), inputs_of(write(), {}), {})
    path = project / provenance.MANIFEST
    document = json.loads(path.read_text())
    document["notebooks"]["other"] = json.loads(entry)
    path.write_text(json.dumps(document))
    assert list(read_manifest(project)) == ["toy"]


@pytest.mark.parametrize(
    "content",
    [
        None,
        b"",
        b"{",
        b"\xff",
        b"[]",
        b"3",
        b"{}",
        b'{"format": "replication-provenance", "version": 1}',
        b'{"format": "replication-provenance", "version": 1, "notebooks": 3}',
        b'{"format": "replication-provenance", "version": 2, "notebooks": {"a": {}}}',
        b'{"format": "other", "version": 1, "notebooks": {"a": {}}}',
    ],
)
def test_a_manifest_that_cannot_be_read_counts_as_none(
    write: Write, project: Path, content: bytes | None
) -> None:
    """Whatever the file holds, its outputs are unknown; the next run writes a new one."""
    if content is not None:
        (project / provenance.MANIFEST).write_bytes(content)
    assert read_manifest(project) == {}
    (project / "a.csv").touch()
    record(project, write(), inputs_of(write(), {}), {})
    assert list(read_manifest(project)) == ["toy"]


def test_versions_are_named_in_neutral_words() -> None:
    """Python, platform and the packages that compute are named, and no machine."""
    found = provenance.versions()
    assert {"python", "platform", "numpy", "numba", "pymunk"} <= set(found)
    assert all(isinstance(value, str) and "/" not in value for value in found.values())
