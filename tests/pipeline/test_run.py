"""Runs: what is refused, what is executed again, and what is published."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import subprocess
import threading
import time
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_markdown_cell

from replication import source
from replication.errors import UserError
from replication.files import scratch_folder, write_file
from replication.pipeline import publish
from replication.pipeline.declaration import MANIFEST
from replication.pipeline.manifest import RUNS
from replication.pipeline.notebook import NotebookError, RunError
from replication.pipeline.run import Published, destination, run_notebooks
from tests.notebooks import damage

STORED = 'trials = 3\nalpha = 0.5\nseed = 1\njobs = 1\nstore = "build/trials.sqlite"\nout = "x"'
WRITE = "[(folder / f'{name}.txt').write_text(f'{value}') for name in 'ab']"


@pytest.fixture
def toy(write: Any) -> Any:
    """Write a notebook with two outputs and a data file."""

    def toy(code: str = "value = trials", **options: Any) -> Path:
        declared = {"data": ["a.txt", "b.txt"], "inputs": ["data.toml"]}
        return Path(write(code, WRITE, **{"parameters": STORED} | declared | options))

    return toy


def published(runs: list[Published]) -> list[str]:
    """Return the names of all published files."""
    return [path.name for run in runs for path in run.files]


def edit(path: Path, at: int, source: str) -> Any:
    """Change the source of one cell of a notebook."""
    node = nbformat.read(path, as_version=4)
    node.cells[at].source = source
    nbformat.write(node, path)
    return node


# --- before anything runs --------------------------------------------------------------------


@pytest.mark.usefixtures("no_kernel")
def test_a_check_that_fails_stops_everything(write: Any, run: Any) -> None:
    """A file that only the second notebook reads is checked before the first one runs."""

    def refuse() -> None:
        raise UserError("data.toml, line 1: no")

    first, second = write(name="first"), write(name="second", inputs=["data.toml"])
    with pytest.raises(UserError, match=r"data\.toml, line 1: no"):
        run(first, second, checks={"data.toml": refuse})


def test_only_checks_of_what_is_read_are_made(toy: Any, run: Any, begun: list[str]) -> None:
    """Nobody checks a file that no notebook reads, or one of a notebook that is fresh."""
    calls: list[str] = []
    checks = {name: lambda name=name: calls.append(name) for name in ("data.toml", "other.toml")}
    run(toy(), checks=checks)
    run(toy(), checks=checks)
    assert calls == ["data.toml"]


@pytest.mark.usefixtures("no_kernel")
def test_folders_must_be_usable(write: Any, run: Any, project: Path) -> None:
    """A file where a folder goes, or a folder of other files, stops the run at once."""
    path = write()
    with pytest.raises(NotebookError, match=r"data\.toml: cannot be used as a folder"):
        run_notebooks([path], profile="paper", out=project / "data.toml")
    (project / "figures").mkdir()
    (project / "figures" / "toy").touch()
    with pytest.raises(NotebookError, match=r"figures/toy: is a file, but toy publishes a folder"):
        run(path)
    (project / "figures" / "toy").unlink()
    (project / "figures" / "toy").mkdir()
    (project / "figures" / "toy" / "precious").touch()
    with pytest.raises(NotebookError, match=r"toy: holds precious, which no run has published"):
        run(path)


def test_other_results_never_go_to_figures(
    toy: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """What changes a result may not be set in a run into the figures, by whatever path."""
    assert run(toy(), parameters={"store": "x", "jobs": 1})
    (project / "link").symlink_to(project / "figures")
    for folder in ("figures", "figures/../figures", "link", "figures/below"):
        with pytest.raises(NotebookError, match="holds the results of the profile 'paper'"):
            run_notebooks([toy()], profile="quick", out=project / folder)
    for options, named in (
        ({"seed": 1}, "with --seed$"),
        ({"parameters": {"trials": 3}}, "with -p trials$"),
        (
            {"profile": "quick", "seed": 1, "parameters": {"trials": 3, "jobs": 1}},
            "with --profile quick, -p trials, --seed$",
        ),
    ):
        with pytest.raises(NotebookError, match=named):
            run(toy(), **options)


@pytest.mark.parametrize("change", ["seed", "cell", "data", "lock"])
def test_an_edit_never_replaces_what_is_published(
    toy: Any, run: Any, project: Path, begun: list[str], change: str
) -> None:
    """A run of an edited notebook, of other data or packages goes elsewhere unless told to."""
    path = toy()
    run(path)
    before = {
        file: file.read_bytes() for file in (project / "figures").rglob("*") if file.is_file()
    }
    if change == "seed":
        path = toy(parameters=STORED.replace("seed = 1", "seed = 2"))
    elif change == "cell":
        path = toy("value = trials + 1")
    elif change == "data":
        (project / "data.toml").write_text("a = 2")
    else:
        (project / "environment.lock").write_text("numpy==2")
    with pytest.raises(NotebookError, match=r"keeps what was published, as .* has changed since"):
        run(path, publish=False)
    assert begun == ["toy"]
    assert before == {file: file.read_bytes() for file in before}
    asked: dict[str, Any] = {"seed": None, "parameters": None}
    folder, why = destination([path], profile="paper", publish=False, **asked)
    assert folder == project / "build" / "edited"
    assert "has changed since then; --publish replaces it" in why
    assert destination([path], profile="paper", publish=True, **asked) == (project / "figures", "")
    assert destination([path], profile="quick", publish=False, **asked)[1] == ""
    run(path, out=folder, publish=False)
    run(path, publish=True)
    assert begun == ["toy"] * 3
    run(path, publish=False)
    assert destination([path], profile="paper", publish=False, **asked)[1] == ""


@pytest.mark.parametrize("lost", ["manifest", "damaged", "folder"])
def test_without_a_manifest_nobody_knows_what_was_edited(
    toy: Any, write: Any, run: Any, project: Path, begun: list[str], lost: str
) -> None:
    """Beside other published folders, one whose manifest cannot be read is not replaced."""
    path, folder = toy(), project / "figures" / "toy"
    asked: dict[str, Any] = {"seed": None, "parameters": None}
    assert destination([path], profile="paper", publish=False, **asked)[1] == ""
    run(path, write(name="other"))
    toy(parameters=STORED.replace("seed = 1", "seed = 2"))
    if lost == "folder":
        shutil.rmtree(folder)
    elif lost == "manifest":
        (folder / MANIFEST).unlink()
    else:
        (folder / MANIFEST).write_text("<<<<<<< HEAD\n" + (folder / MANIFEST).read_text())
    with pytest.raises(NotebookError, match=rf"as its {MANIFEST} is missing or damaged since then"):
        run(path, publish=False)
    assert begun == ["toy", "other"]
    target, why = destination([path], profile="paper", publish=False, **asked)
    assert target == project / "build" / "edited"
    assert MANIFEST in why


def test_a_notebook_of_ones_own_goes_elsewhere(
    toy: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """What is not in the project's folder of notebooks is not published among its results."""
    mine = toy().rename(project / "mine.ipynb")
    with pytest.raises(NotebookError, match=r"mine\.ipynb is not in notebooks/, so nothing of it"):
        run(mine)
    assert begun == []
    for profile, folder in (("paper", "custom"), ("quick", "quick")):
        options: dict[str, Any] = {"profile": profile, "publish": True}
        target, why = destination([mine], seed=None, parameters=None, **options)
        assert target == project / "build" / folder
        assert "is not in notebooks/" in why
    run(mine, out=project / "build" / "custom")
    assert begun == ["mine"]


def test_damage_is_mended_without_being_told_to(toy: Any, run: Any, project: Path) -> None:
    """A published file that is changed or gone is made again: nothing was edited."""
    path = toy()
    run(path)
    (project / "figures" / "toy" / "a.txt").write_text("mine")
    assert destination([path], profile="paper", publish=False, seed=None, parameters=None)[1] == ""
    run(path, publish=False)
    assert (project / "figures" / "toy" / "a.txt").read_text() == "3"


@pytest.mark.usefixtures("no_kernel")
def test_an_invalid_notebook_is_refused_before_any_runs(write: Any, toy: Any, run: Any) -> None:
    """What only nbformat finds wrong stops the notebooks before it, too."""
    second = write(name="second")
    document = json.loads(second.read_text())
    document["cells"][0]["more"] = 1
    second.write_text(json.dumps(document))
    with pytest.raises(NotebookError, match=r"second\.ipynb: is not a valid notebook: .*'more'"):
        run(toy(), second)


@pytest.mark.usefixtures("no_kernel")
@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("tcp://127.0.0.1:9", "refused"),
        ("here", "not of the form tcp://HOST:PORT"),
        ("tcp://127.0.0.1:none", "none"),
    ],
)
@pytest.mark.parametrize("given", [True, False])
def test_a_scheduler_must_answer_before_anything_runs(
    toy: Any, run: Any, monkeypatch: pytest.MonkeyPatch, address: str, message: str, given: bool
) -> None:
    """An address at which nothing answers, of the option or the environment, is refused at once."""
    if not given:
        monkeypatch.setenv("REPLICATION_SCHEDULER", address)
    with pytest.raises(NotebookError, match=f"no Dask scheduler answers at {address}.*{message}"):
        run(toy(), scheduler=address if given else "")


# --- what is executed again ------------------------------------------------------------------


def test_nothing_runs_when_nothing_has_changed(
    toy: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """A second run executes nothing, publishes nothing, writes no file and says so."""
    run(toy())
    written = [path for path in (project / "figures").rglob("*") if path.name != ".lock"]
    times = [path.stat().st_mtime_ns for path in written]
    lines: list[str] = []
    assert run(toy(), parameters={"store": "x"}, jobs=3, echo=lines.append) == []
    assert begun == ["toy"]
    assert lines == ["toy: fresh, nothing to do"]
    assert [path.stat().st_mtime_ns for path in written] == times


@pytest.mark.parametrize(
    "change", ["cell", "literal", "data", "lock", "deleted", "edited", "executed", "manifest"]
)
def test_a_change_that_matters_executes_again(
    toy: Any, run: Any, project: Path, begun: list[str], change: str
) -> None:
    """Code, parameters, data, lock, outputs and their record count; then all is fresh."""
    path, folder = toy(), project / "figures" / "toy"
    run(path)
    if change == "cell":
        path = toy("value = trials + 1")
    elif change == "literal":
        path = toy(parameters=STORED.replace("trials = 3", "trials = 4"))
    elif change == "data":
        (project / "data.toml").write_text("a = 2")
    elif change == "lock":
        (project / "environment.lock").write_text("numpy==2")
    elif change == "deleted":
        (folder / "a.txt").unlink()
    elif change == "edited":
        (folder / "a.txt").write_text("mine")
    elif change == "executed":
        (folder / "notebook.ipynb").unlink()
    elif change == "manifest":
        (folder / "provenance.json").write_text("{")
    assert published(run(path)) == ["a.txt", "b.txt", "notebook.ipynb"]
    assert begun == ["toy", "toy"]
    expected = {"cell": "4", "literal": "4"}.get(change, "3")
    assert [(folder / name).read_text() for name in ("a.txt", "b.txt")] == [expected] * 2
    run(path)
    assert begun == ["toy", "toy"]


def test_what_was_made_elsewhere_can_be_made_here(
    toy: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """A fresh clone is fresh; with `here` all runs once, and it says whether bytes are the same."""
    lines: list[str] = []
    run(toy(), here=True, echo=lines.append)
    (project / "figures" / RUNS).write_text("[1]")
    assert run(toy()) == []
    assert begun == ["toy"]
    run(toy(), here=True, echo=lines.append)
    run(toy(), here=True, echo=lines.append)
    assert begun == ["toy", "toy"]
    assert [line.partition("s; ")[2] for line in lines] == ["", "", "", "all bytes as before", ""]
    assert lines[-1] == "toy: fresh, nothing to do"


def test_files_that_differ_from_before_are_named(
    toy: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """For each notebook the files with other bytes are named, those that come or go among them."""
    folder, lines = project / "figures" / "toy", list[str]()
    assert run(toy())[0].changed == ()
    (changed,) = run(toy("value = (folder / 'b.txt') and trials + 1"), echo=lines.append)
    assert changed.changed == (folder / "a.txt", folder / "b.txt")
    assert lines[-1].endswith("; other bytes than before: a.txt, b.txt")
    code = "value = 4; (folder / 'c.txt').touch()"
    (changed,) = run(toy(code, data=["a.txt", "b.txt", "c.txt"]), force=True)
    assert changed.changed == (folder / "c.txt",)
    (changed,) = run(toy("value = 4"), force=True)
    assert changed.changed == (folder / "c.txt",)
    assert not (folder / "c.txt").exists()
    (folder / "a.txt").unlink()
    (changed,) = run(toy("value = 4"))
    assert changed.changed == ()


def test_other_parameters_of_a_run_execute_again(
    toy: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """Another seed, profile or -p is another run of the same folder, and going back is, too."""
    path, out = toy(profiles={"quick": {"trials": 2}}), project / "build"
    for options in ({}, {"seed": 2}, {"profile": "quick"}, {"parameters": {"alpha": 0.1}}, {}):
        run(path, out=out, **options)
        run(path, out=out, **options)
    assert begun == ["toy"] * 5


def test_a_published_notebook_that_was_edited_is_put_right(
    toy: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """Other text is put right without a run; other outputs, or half a file, take a run."""
    run(toy())
    shown = project / "figures" / "toy" / "notebook.ipynb"
    whole = shown.read_bytes()
    shown.write_bytes(whole.replace(b"# Toy", b"# Mine"))
    run(toy())
    assert (shown.read_bytes(), begun) == (whole, ["toy"])
    shown.write_bytes(whole.replace(b'"execution_count": 1', b'"execution_count": 7'))
    run(toy())
    assert begun == ["toy", "toy"]
    for end in (10, 50):
        shown.write_bytes(whole[:-end])
        run(toy())
    assert begun == ["toy"] * 4
    assert shown.read_bytes() == whole


def test_prose_is_rendered_and_not_executed(
    toy: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """New text, comments and layout come into the executed notebook; the outputs stay."""
    path, folder = toy(), project / "figures" / "toy"
    run(path)
    edit(path, 0, "# Another headline")
    node = edit(path, 3, "value = (trials)  # as given")
    node.cells.append(new_markdown_cell("The end"))
    nbformat.write(node, path)
    before = (folder / "a.txt").stat().st_mtime_ns
    assert run(path) == []
    assert begun == ["toy"]
    assert (folder / "a.txt").stat().st_mtime_ns == before
    shown = nbformat.read(folder / "notebook.ipynb", as_version=4)
    assert [cell.source for cell in shown.cells] == [cell.source for cell in node.cells]
    assert shown.cells[3].execution_count == 3
    assert damage(project / "figures") == []


def test_a_kill_while_text_is_rendered_costs_nothing(
    toy: Any, run: Any, project: Path, begun: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether the file was written or not, the next run ends the work and executes nothing."""
    path = toy()
    run(path)
    for allowed in range(2):
        edit(path, 0, f"# Headline {allowed}")

        def stop(file: Path, text: str, allowed: int = allowed) -> None:
            if allowed:
                write_file(file, text)
            raise KeyboardInterrupt

        with monkeypatch.context() as patched:
            patched.setattr("replication.pipeline.run.write_file", stop)
            with pytest.raises(KeyboardInterrupt):
                run(path)
        run(path)
        text = (project / "figures" / "toy" / "notebook.ipynb").read_text()
        assert f"Headline {allowed}" in text
        assert damage(project / "figures") == []
    assert begun == ["toy"]


def test_force_runs_what_is_fresh_with_an_empty_store(
    toy: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """--force executes again, and gives the notebook a store that has nothing."""
    path = toy("value = Path(store).exists(), store == str(Path(store).absolute())")
    (project / "build").mkdir()
    (project / "build" / "trials.sqlite").touch()
    assert run(path)[0].files[0].read_text() == "(True, True)"
    assert run(path, force=True)[0].files[0].read_text() == "(False, True)"
    assert begun == ["toy"] * 2
    assert [path.name for path in (project / "build").iterdir()] == ["trials.sqlite"]


def test_a_failure_leaves_what_was_published(
    toy: Any, run: Any, project: Path, begun: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a forced run that failed, the outputs of the earlier run are whole and fresh."""
    path = toy("import os\nvalue = 1 // int(os.environ['DIVISOR'])")
    monkeypatch.setenv("DIVISOR", "1")
    run(path)
    monkeypatch.setenv("DIVISOR", "0")
    with pytest.raises(ZeroDivisionError):
        run(path, force=True)
    assert damage(project / "figures") == []
    run(path)
    assert begun == ["toy"] * 2


# --- what a notebook needs -------------------------------------------------------------------


@pytest.fixture
def judge(write: Any) -> Any:
    """Write a notebook that copies a table of the notebook `toy`."""

    def judge() -> Path:
        code = "(folder / 'copy.txt').write_text((Path(results) / 'toy' / 'a.csv').read_text())"
        given = 'out = "x"\nresults = "figures"'
        return Path(write(code, name="judge", parameters=given, needs=["toy"], data=["copy.txt"]))

    return judge


def table(toy: Any, value: int) -> Path:
    """Write the notebook `toy` with a table and a file that nobody needs."""
    code = f"(folder / 'a.csv').write_text('{value}'); (folder / 'b.txt').write_text('{value}')"
    return Path(toy(f"{code}\nvalue = 1", data=["a.txt", "b.txt", "a.csv"]))


def test_a_notebook_reads_what_it_needs(
    toy: Any, judge: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """It finds the published folders in `results`, and runs behind the notebooks that it needs."""
    run(judge(), table(toy, 5), jobs=None)
    assert begun == ["toy", "judge"]
    assert (project / "figures" / "judge" / "copy.txt").read_text() == "5"
    run(judge(), jobs=None)
    assert begun == ["toy", "judge"]


def test_other_numbers_of_a_needed_notebook_count(
    toy: Any, judge: Any, run: Any, begun: list[str]
) -> None:
    """Its tables are inputs; a run that gives the same tables leaves the other notebook fresh."""
    run(judge(), table(toy, 5), jobs=None)
    run(
        judge(),
        toy("(folder / 'a.csv').write_text('5')\nvalue = 2", data=["a.txt", "b.txt", "a.csv"]),
        jobs=None,
    )
    assert begun == ["toy", "judge", "toy"]
    run(judge(), table(toy, 6), jobs=None)
    assert begun == ["toy", "judge", "toy", "toy", "judge"]


# --- edits during a run ----------------------------------------------------------------------


@pytest.mark.parametrize("file", ["data.toml", "environment.lock"])
def test_an_edit_during_the_run_publishes_nothing(
    toy: Any, run: Any, project: Path, begun: list[str], file: str
) -> None:
    """Nobody knows whether outputs were made before or after an edit: they are made again."""
    code = f"from replication.files import PROJECT\n(PROJECT / {file!r}).write_text('b = 2')"
    path = toy(f"{code}\nvalue = 1")
    with pytest.raises(RunError, match=rf"{re.escape(file)} has changed during the run: nothing"):
        run(path)
    assert not (project / "figures" / "toy").exists()
    run(path)
    run(path)
    assert begun == ["toy", "toy"]


def test_an_edit_during_an_earlier_notebook_counts(
    write: Any, toy: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """What a notebook depends on is what was there when it began, not when the command did."""
    code = "from replication.files import PROJECT\n(PROJECT / 'data.toml').write_text('b = 2')"
    first, second = write(code, name="first", parameters=STORED), toy()
    run(first, second)
    run(first, second)
    assert begun == ["first", "toy"]
    (project / "data.toml").write_text("a = 1")
    run(first, second)
    assert begun == ["first", "toy", "toy"]


def test_a_module_that_is_edited_during_the_run_is_noticed(
    toy: Any, run: Any, project: Path, begun: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Source is read again when a notebook ends."""
    package = project / "package"
    package.mkdir()
    (package / "mine.py").write_text("a = 1")
    monkeypatch.setattr(source, "FOLDER", package)
    code = f"Path({str(package / 'mine.py')!r}).write_text('a = 2')"
    path = toy(f"{code}\nif False: import replication.mine\nvalue = 1")
    with pytest.raises(RunError, match=r"replication\.mine has changed during the run"):
        run(path)


# --- publishing ------------------------------------------------------------------------------


def test_outputs_must_be_the_declared_ones(toy: Any, run: Any, begun: list[str]) -> None:
    """A file too many, or too few, or too large for a reader, is named."""
    with pytest.raises(RunError, match=r"toy\.ipynb: written but not declared: c$"):
        run(toy("(folder / 'c').mkdir()\nvalue = 1"))
    with pytest.raises(RunError, match=r"toy\.ipynb: declared but not written: c\.csv, c\.md$"):
        run(toy(tables=["c"]))
    with pytest.raises(RunError, match=r"toy\.ipynb: written, but larger than .*: c\.txt$"):
        run(
            toy(
                "(folder / 'c.txt').touch()\nos.truncate(folder / 'c.txt', 10**9)\nvalue = 1",
                data=["a.txt", "b.txt", "c.txt"],
            )
        )


@pytest.mark.parametrize("step", ["aside", "in"])
def test_publishing_is_all_or_nothing(
    toy: Any,
    run: Any,
    project: Path,
    begun: list[str],
    monkeypatch: pytest.MonkeyPatch,
    step: str,
) -> None:
    """When a folder cannot be renamed, what was published before is still there."""
    run(toy())
    rename = Path.rename

    def fail(path: Path, target: Path) -> Path:
        if path.parent.name.startswith(".draft-") or (step == "aside" and path.name == "toy"):
            raise OSError(errno.ENOSPC, "No space left on device")
        return rename(path, target)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "rename", fail)
        with pytest.raises(RunError, match=r"cannot publish.*No space left"):
            run(toy("value = 9"))
    assert (project / "figures" / "toy" / "a.txt").read_text() == "3"
    assert damage(project / "figures") == []


def leave_behind(parent: Path | None) -> None:
    """Leave what a process leaves that is killed."""
    number = subprocess.Popen(["true"])
    number.wait()
    with scratch_folder(parent) as folder:
        dead = folder.name.replace(f"{os.getpid():07d}", f"{number.pid:07d}")
        shutil.copytree(folder, folder.with_name(dead))


def test_what_killed_runs_left_is_put_right(
    toy: Any, run: Any, project: Path, begun: list[str]
) -> None:
    """Drafts go, a folder that was renamed aside comes back, and one that was replaced goes."""
    figures = project / "figures"
    run(toy())
    for parent in (None, figures, figures / "toy"):
        leave_behind(parent)
    shutil.copytree(figures / "toy", figures / f"{publish.ASIDE}toy")
    run(toy())
    (figures / "toy").rename(figures / f"{publish.ASIDE}toy")
    run(toy())
    assert begun == ["toy"]
    assert sorted(path.name for path in figures.iterdir()) == [
        ".lock",
        RUNS,
        "README.md",
        "toy",
    ]


# --- two runs at once ------------------------------------------------------------------------


def test_runs_at_the_same_time_leave_whole_outputs(
    toy: Any, project: Path, begun: list[str]
) -> None:
    """Runs of different parameters take turns: the outputs are all of one of them."""
    gate = project / "gate"
    gate.touch()
    path = toy(f"import time\nwhile Path({str(gate)!r}).exists(): time.sleep(0.01)\nvalue = seed")
    out, lines = project / "build" / "custom", list[str]()
    options: dict[str, Any] = {"profile": "paper", "out": out}
    threads = [
        threading.Thread(
            target=run_notebooks,
            args=([path],),
            kwargs=options | {"seed": seed, "echo": lines.append},
            daemon=True,  # where this test fails, they may wait for ever
        )
        for seed in (1, 2, 3)
    ]
    for thread in threads:
        thread.start()
    while len(lines) < 3 and all(thread.is_alive() for thread in threads):  # one begins, two wait
        time.sleep(0.01)
    gate.unlink()
    for thread in threads:
        thread.join()
    assert begun == ["toy"] * 3
    assert sum("waiting until it ends" in line for line in lines) == 2
    texts = {(out / "toy" / f"{name}.txt").read_text() for name in "ab"}
    assert len(texts) == 1
    assert run_notebooks([path], seed=int(texts.pop()), **options) == []
