"""Notebooks that are run for their files: what is refused, what is published and what is not."""

import errno
import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nbformat
import papermill
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook, new_output

from replication import Demos, paths, regenerate
from replication.notebooks import NotebookError
from replication.regenerate import RunError, run_notebooks

PARAMETERS = 'trials = 3\nalpha = 0.5\nname = "a"\nchoices = {}\njobs = 1\nseed = 1\nout = "build"'
PRELUDE = "import os, sys\nfrom pathlib import Path\nfolder = Path(out)"

Write = Callable[..., Path]
Run = Callable[..., list[Path]]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write a notebook: a headline, the parameters cell, PRELUDE and more code cells."""

    def write(*code: str, name: str = "toy", parameters: str = PARAMETERS, **declared: Any) -> Path:
        cells = [new_markdown_cell("# Toy"), new_code_cell(parameters)]
        cells[1].metadata["tags"] = ["parameters"]
        cells += [new_code_cell(source) for source in (PRELUDE, *code)]
        node = new_notebook(cells=cells, metadata={"replication": {"outputs": []} | declared})
        path = tmp_path / f"{name}.ipynb"
        nbformat.write(node, path)
        return path

    return write


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run notebooks into `figures`, with a temporary folder in which nothing may be left."""
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))

    def run(*notebooks: Path, **options: Any) -> list[Path]:
        defaults: dict[str, Any] = {"profile": "paper", "jobs": 1}
        defaults |= {"out": tmp_path / "figures", "executed": tmp_path / "executed"}
        try:
            return run_notebooks(notebooks, **defaults | options)
        finally:
            assert not list(scratch.iterdir())

    return run


@pytest.fixture
def no_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail when anything is executed."""

    def execute(*_: Any, **__: Any) -> None:
        pytest.fail("a notebook was executed")

    monkeypatch.setattr(papermill, "execute_notebook", execute)


# --- before anything runs --------------------------------------------------------------------


@pytest.mark.usefixtures("no_kernel")
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"trails": 3}, "unknown parameter 'trails' (did you mean 'trials'?)"),
        ({"trials": "3"}, "parameter 'trials' is a whole number, such as 3; '3' is text"),
        ({"trials": True}, "'trials' is a whole number, such as 3; True is true or false"),
        ({"trials": 3.0}, "'trials' is a whole number, such as 3; 3.0 is a number"),
        ({"alpha": float("nan")}, "'alpha' is a number, such as 0.5; nan is a number"),
        ({"name": Path("a")}, "'name' is text"),
        ({"choices": {"a": (1, 2)}}, "'choices' is an object"),
        ({"choices": []}, "'choices' is an object, such as {}; [] is a list"),
        ({"out": "elsewhere"}, "use --out"),
    ],
)
def test_bad_parameter_is_refused_before_any_notebook_runs(
    write: Write, run: Run, given: dict[str, Any], message: str
) -> None:
    """A parameter that only the second notebook cannot take stops the first one, too."""
    first = write(name="first", parameters=PARAMETERS + "\ntrails = 1" * ("trails" in given))
    with pytest.raises(NotebookError, match=re.escape(message)):
        run(first, write(name="second"), parameters=given)


@pytest.mark.usefixtures("no_kernel")
def test_notebooks_may_not_overwrite_each_other(write: Write, run: Run) -> None:
    """An output of two notebooks must be merged by both."""
    first = write(name="first", outputs=["a.csv"])
    with pytest.raises(NotebookError, match=r"would overwrite a\.csv of"):
        run(first, write(name="second", outputs=["a.csv"]))
    with pytest.raises(NotebookError, match=r"merges a\.csv, which .* overwrites"):
        run(first, write(name="second", merged=["a.csv"]))


@pytest.mark.usefixtures("no_kernel")
def test_folders_must_be_usable(write: Write, run: Run, tmp_path: Path) -> None:
    """A file where a folder is due, or a folder where a file is due, stops the run at once."""
    (tmp_path / "figures" / "a.png").mkdir(parents=True)
    with pytest.raises(NotebookError, match=r"a\.png: is a folder"):
        run(write(outputs=["a.png"]))
    with pytest.raises(NotebookError, match=r"toy\.ipynb: cannot be used as a folder"):
        run(write(), out=write())


@pytest.mark.usefixtures("no_kernel")
def test_quick_results_never_go_to_figures(
    write: Write, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the profile `paper` may write to the project's figures, by whatever path."""
    monkeypatch.setattr(paths, "PROJECT", tmp_path)
    (tmp_path / "link").symlink_to(tmp_path / "figures")
    for folder in ("figures", "figures/../figures", "link", "figures/below"):
        with pytest.raises(NotebookError, match="holds the results of the profile 'paper'"):
            run(write(), profile="quick", out=tmp_path / folder)


def test_changed_results_never_go_to_figures(
    write: Write, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What changes no result may be set in a run into the figures, anything else may not."""
    monkeypatch.setattr(paths, "PROJECT", tmp_path)
    path = write("(folder / 'a').touch()", outputs=["a"], parameters=f"{PARAMETERS}\nstore = ''")
    assert run(path, parameters={"store": "x", "jobs": 1}) == [tmp_path / "figures" / "a"]
    for options, named in (
        ({"seed": 1}, "with --seed$"),
        ({"parameters": {"trials": 3}}, "with -p trials$"),
        (
            {"profile": "quick", "seed": 1, "parameters": {"trials": 3, "jobs": 1}},
            "with --profile quick, -p trials, --seed$",
        ),
    ):
        with pytest.raises(NotebookError, match=named):
            run(path, **options)


# --- a run that succeeds ---------------------------------------------------------------------


def test_run_publishes_what_is_declared(
    write: Write, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernel is our interpreter in the user's folder, with the profile's and our parameters.

    A foreign kernel of the same name, and the user's start-up files, take no part.
    """
    foreign = tmp_path / "jupyter" / "kernels" / regenerate.KERNEL
    foreign.mkdir(parents=True)
    spec = {"argv": ["false"], "display_name": "foreign", "language": "python"}
    (foreign / "kernel.json").write_text(json.dumps(spec))
    startup = tmp_path / "startup.py"
    startup.write_text("foreign = True")
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path / "jupyter"))
    monkeypatch.setenv("PYTHONSTARTUP", str(startup))
    monkeypatch.chdir(tmp_path)
    path = write(
        "import json\n"
        "seen = [sys.executable, os.getcwd(), trials, seed, jobs, choices, 'foreign' in dir()]\n"
        "(folder / 'seen.json').write_text(json.dumps(seen))\n"
        "print(folder)\n"
        "for k in range(3):\n"
        "    print(f'\\r{k}0%|##| {k}/9', end='', file=sys.stderr, flush=True)\n"
        "print('\\r        \\rkept', file=sys.stderr)",
        outputs=["seen.json"],
        profiles={"quick": {"trials": 7, "seed": 2}},
    )
    lines: list[str] = []
    choices = {"Q-START": "reset", "text": 'it\'s "quoted"'}
    published = run(
        path, profile="quick", seed=5, parameters={"choices": choices}, echo=lines.append
    )
    assert published == [tmp_path / "figures" / "seen.json"]
    expected = [sys.executable, str(tmp_path), 7, 5, 1, choices, False]
    assert json.loads(published[0].read_text()) == expected
    assert len(lines) == 2
    assert "trials = 7" in lines[0]
    assert "1 output in" in lines[1]
    assert os.environ["JUPYTER_PATH"] == str(tmp_path / "jupyter")

    executed = (tmp_path / "executed" / "custom" / "toy.ipynb").read_text()
    node = nbformat.reads(executed, as_version=4)
    assert [output.text for output in node.cells[-1].outputs] == [
        f"{tmp_path / 'figures'}\n",
        "kept\n",
    ]
    assert "papermill" not in node.metadata
    assert not re.search(r"scratch|\d\d:\d\d:\d\d", executed)

    run(path, profile="quick", seed=5, parameters={"choices": choices})
    assert (tmp_path / "executed" / "custom" / "toy.ipynb").read_text() == executed


def test_merged_file_is_there_when_the_notebook_starts(
    write: Write, run: Run, tmp_path: Path
) -> None:
    """Each notebook adds its rows to those that are published; one that does not is stopped."""
    append = "with (folder / 'rows.csv').open('a') as file: print(name, file=file)"
    notebooks = [
        write(append, name=name, parameters=f'out = "build"\nname = "{name}"', merged=["rows.csv"])
        for name in ("one", "two")
    ]
    lines: list[str] = []
    published = run(*notebooks, jobs=None, echo=lines.append)
    assert published == [tmp_path / "figures" / "rows.csv"]
    assert published[0].read_text() == "one\ntwo\n"
    assert "two: 0 outputs and rows of rows.csv in" in lines[-1]
    with pytest.raises(RunError, match=r"declared but not written: rows\.csv"):
        run(write(merged=["rows.csv"]))
    assert published[0].read_text() == "one\ntwo\n"


# --- a run that fails ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("raise KeyError('gone')", r"toy\.ipynb: cell 5 failed: KeyError: 'gone'"),
        ("os.kill(os.getpid(), 9)", r"toy\.ipynb: cell 5: the kernel was killed.*memory"),
        ("import time; time.sleep(60)", r"toy\.ipynb: cell 5 took more than 2 seconds.*--timeout"),
        ("sys.exit()", r"toy\.ipynb: cell 5 ended the notebook before its last cell"),
        ("(folder / 'c').mkdir()", r"toy\.ipynb: written but not declared: c$"),
        ("(folder / 'a.txt').unlink()", r"toy\.ipynb: declared but not written: a\.txt$"),
    ],
)
def test_failure_leaves_earlier_outputs(
    write: Write, run: Run, tmp_path: Path, code: str, message: str
) -> None:
    """However a notebook fails, what was published stays, and the executed notebook can be seen."""
    earlier = tmp_path / "figures" / "a.txt"
    earlier.parent.mkdir()
    earlier.write_text("earlier")
    path = write("(folder / 'a.txt').write_text('new')", code, "done = 1", outputs=["a.txt"])
    with pytest.raises(RunError, match=message) as caught:
        run(path, timeout=2)
    assert earlier.read_text() == "earlier"
    assert list(earlier.parent.iterdir()) == [earlier]
    assert (tmp_path / "executed" / "paper" / "toy.ipynb").exists()
    assert ("KeyError" in caught.value.details) == ("KeyError" in code)


@pytest.mark.parametrize("ename", sorted(regenerate.MISTAKES))
def test_refusal_in_a_cell_is_the_users_mistake(
    write: Write, run: Run, tmp_path: Path, ename: str
) -> None:
    """What the package refuses in a cell is told as before a run, and nothing is published."""
    module = {"ChoiceError": "choices", "DemoError": "demos", "MazeError": "envs"}[ename]
    code = f"from replication.{module} import {ename}\nraise {ename}('wrong\\nmore')"
    path = write("(folder / 'a').touch()", code, outputs=["a"])
    with pytest.raises(NotebookError, match=r"toy\.ipynb: wrong$"):
        run(path)
    assert list((tmp_path / "figures").iterdir()) == []
    assert (tmp_path / "executed" / "paper" / "toy.ipynb").exists()


def test_missing_kind_comes_with_a_mend(write: Write, run: Run, small_demos: Demos) -> None:
    """The option that takes the kinds of a file is shown, beside the choices that were made."""
    code = f"Demos('t', Maze({small_demos.maze.rows!r}), [Demo('c', 'correct', "
    correct = small_demos.correct[0]
    code += f"{correct.states.tolist()}, {correct.actions.tolist()})]).select('hit')"
    path = write("from replication import Demo, Demos, Maze", code)
    for given, shown in (
        ({}, '{"incorrect": "all"}'),
        ({"choices": {"alpha": 0.1, "incorrect": "hit"}}, '{"alpha": 0.1, "incorrect": "all"}'),
    ):
        message = f"use all, none, such as -p choices '{shown}'"
        with pytest.raises(NotebookError, match=f"{re.escape(message)}$"):
            run(path, parameters=given)
    path = write("from replication import Demo, Demos, Maze", code, parameters='out = "x"')
    with pytest.raises(NotebookError, match=r"use all, none$"):
        run(path, jobs=None)


def test_first_failure_stops_the_rest(write: Write, run: Run, tmp_path: Path) -> None:
    """Notebooks before the failing one are published, those behind it do not run."""
    cells = {"one": "(folder / '1').touch()", "two": "1 / 0", "three": "(folder / '3').touch()"}
    outputs = {"one": ["1"], "two": [], "three": ["3"]}
    with pytest.raises(RunError, match=r"two\.ipynb: cell 4 failed: ZeroDivisionError"):
        run(*(write(code, name=name, outputs=outputs[name]) for name, code in cells.items()))
    assert [path.name for path in (tmp_path / "figures").iterdir()] == ["1"]
    assert not (tmp_path / "executed" / "paper" / "three.ipynb").exists()


def test_only_the_start_of_a_kernel_is_tried_again(
    write: Write, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kernel that does not start is started again; a cell never runs twice."""
    begun: list[bool] = []

    def execute(*_: Any, on_cell_execute: Callable[..., None], **__: Any) -> None:
        begun.append(len(begun) == 1)
        if begun[-1]:
            on_cell_execute(cell=None, cell_index=1)
        raise RuntimeError("Kernel died")

    monkeypatch.setattr(papermill, "execute_notebook", execute)
    with pytest.raises(RunError, match="cell 2: Kernel died"):
        run(write())
    assert begun == [False, True]
    begun[:] = [False] * 2
    with pytest.raises(RunError, match="the kernel does not start: Kernel died"):
        run(write())
    assert len(begun) == 2 + regenerate.STARTS


def test_publishing_is_all_or_nothing(
    write: Write, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """When one output cannot be copied, none of them is replaced."""
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "a").write_text("earlier")

    def copy(source: Path, target: Path) -> None:
        if source.name == "b":
            raise OSError(errno.ENOSPC, "No space left on device")
        target.write_bytes(source.read_bytes())

    monkeypatch.setattr(shutil, "copyfile", copy)
    path = write("[(folder / name).write_text('new') for name in 'ab']", outputs=["a", "b"])
    with pytest.raises(RunError, match=r"cannot publish.*No space left"):
        run(path)
    assert (tmp_path / "figures" / "a").read_text() == "earlier"
    assert [path.name for path in (tmp_path / "figures").iterdir()] == ["a"]


def test_progress_bars_leave_only_what_a_terminal_would_show() -> None:
    """Pieces of stderr are joined, redrawn lines keep their last state, bars are dropped."""
    pieces = ["\r 10%|#   | 1/10", "\r100%|####| 10/10 [00:01]\n", "\rone", "\rtwo\n", "three\n"]
    outputs = [new_output("stream", name="stderr", text=text) for text in pieces]
    outputs.insert(0, new_output("stream", name="stdout", text="\r50%|# |"))
    kept = regenerate._without_bars(outputs)
    assert [output.text for output in kept] == ["\r50%|# |", "two\nthree\n"]
    bar = new_output("stream", name="stderr", text="\r 10%|#   | 1/10\r             \r")
    assert not regenerate._without_bars([bar])
