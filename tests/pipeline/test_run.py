"""Notebooks that are run for their files: what is refused, what is published and what is not."""

import errno
import fcntl
import json
import os
import re
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import nbformat
import papermill
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from replication import Demos
from replication import files as project_files
from replication.envs.maze import as_maze
from replication.evidence import claims, specifications
from replication.files import write_file
from replication.pipeline import execute as execution
from replication.pipeline import provenance
from replication.pipeline.folders import executed_folder
from replication.pipeline.freshness import read_runs
from replication.pipeline.notebook import Notebook, NotebookError, RunError
from replication.pipeline.run import run_notebooks
from replication.pipeline.verify import verify_outputs

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


def files(folder: Path) -> list[str]:
    """Return the names of a folder's files but for the manifest and the lock."""
    return sorted({path.name for path in folder.iterdir()} - {"provenance.json", ".lock"})


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


@pytest.mark.parametrize(
    ("module", "old", "new", "said"),
    [
        (claims, 'statistic = "sd-ratio"', 'statistic = "sd-rato"', "claim STEADIER.statistic"),
        (claims, "soccer = 60", "soccer = 0", "judging.trials.soccer: Input should be greater"),
        (specifications, "trials = 10", "trials = 0", "mazes.factorial.trials: Input should be"),
        (specifications, '["hit", "detour", "op', '["lob", "detour", "op', "soccer.single: "),
        (specifications, '"far-detour", "opposite"', '"overspeed"', "mazes.single: task open-maze"),
    ],
)
def test_bad_plans_are_refused_before_any_notebook_runs(
    write: Write,
    run: Run,
    monkeypatch: pytest.MonkeyPatch,
    module: Any,
    old: str,
    new: str,
    said: str,
) -> None:
    """A mistake in claims or specifications that only the second notebook reads stops the first."""
    name = module.__name__.rpartition(".")[2]
    text = module._text()
    assert old in text
    monkeypatch.setattr(module, "_text", lambda: text.replace(old, new, 1))
    cached = claims.load_claims if module is claims else specifications.load_specifications
    cached.cache_clear()
    try:
        with monkeypatch.context() as patch:
            patch.setattr(papermill, "execute_notebook", lambda *_, **__: pytest.fail("executed"))
            with pytest.raises(ValueError, match=f"^{name}.toml, {said}"):
                run(
                    write(name="first"),
                    write(name="last", inputs=[f"replication/evidence/{name}.toml"]),
                )
        run(write(name="first"))
    finally:
        cached.cache_clear()


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
    monkeypatch.setattr(project_files, "PROJECT", tmp_path)
    (tmp_path / "link").symlink_to(tmp_path / "figures")
    (tmp_path / "environment.lock").touch()
    for folder in ("figures", "figures/../figures", "link", "figures/below"):
        with pytest.raises(NotebookError, match="holds the results of the profile 'paper'"):
            run(write(), profile="quick", out=tmp_path / folder)


def test_changed_results_never_go_to_figures(
    write: Write, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What changes no result may be set in a run into the figures, anything else may not."""
    monkeypatch.setattr(project_files, "PROJECT", tmp_path)
    (tmp_path / "environment.lock").touch()
    path = write("(folder / 'a').touch()", outputs=["a"], parameters=f"{PARAMETERS}\nstore = ''")
    published = run(path, parameters={"store": "x", "jobs": 1})
    assert published == [tmp_path / "figures" / name for name in ("a", "toy.ipynb")]
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
    foreign = tmp_path / "jupyter" / "kernels" / execution.KERNEL
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
    assert published == [tmp_path / "figures" / name for name in ("seen.json", "toy.ipynb")]
    expected = [sys.executable, str(tmp_path), 7, 5, 1, choices, False]
    assert json.loads(published[0].read_text()) == expected
    assert len(lines) == 2
    assert "trials = 7" in lines[0]
    assert "1 output in" in lines[1]
    assert os.environ["JUPYTER_PATH"] == str(tmp_path / "jupyter")

    executed = (tmp_path / "executed" / "toy.ipynb").read_text()
    node = nbformat.reads(executed, as_version=4)
    assert [output.text for output in node.cells[-1].outputs] == [
        "figures\n",
        "kept\n",
    ]
    assert "papermill" not in node.metadata
    assert str(tmp_path) not in executed
    assert not re.search(r"scratch|\d\d:\d\d:\d\d", executed)

    run(path, profile="quick", seed=5, parameters={"choices": choices}, force=True)
    assert (tmp_path / "executed" / "toy.ipynb").read_text() == executed


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
    assert [path.name for path in published] == ["rows.csv", "one.ipynb", "two.ipynb"]
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
        ("import time; time.sleep(60)", r"toy\.ipynb: cell 5 took more than 8 seconds.*--timeout"),
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
        run(path, timeout=8)
    assert earlier.read_text() == "earlier"
    assert files(earlier.parent) == ["a.txt"]
    assert (tmp_path / "executed" / "toy.ipynb").exists()
    assert ("KeyError" in caught.value.details) == ("KeyError" in code)


@pytest.mark.parametrize("ename", sorted(execution.MISTAKES))
def test_refusal_in_a_cell_is_the_users_mistake(
    write: Write, run: Run, tmp_path: Path, ename: str
) -> None:
    """What the package refuses in a cell is told as before a run, and nothing is published."""
    modules = {
        "ChoiceError": "choices",
        "ClaimError": "claims",
        "DemoError": "demos",
        "MazeError": "envs",
    }
    module = modules[ename]
    code = f"from replication.{module} import {ename}\nraise {ename}('wrong\\nmore')"
    path = write("(folder / 'a').touch()", code, outputs=["a"])
    with pytest.raises(NotebookError, match=r"toy\.ipynb: wrong$"):
        run(path)
    assert files(tmp_path / "figures") == []
    assert (tmp_path / "executed" / "toy.ipynb").exists()


def test_missing_kind_comes_with_a_mend(write: Write, run: Run, small_demos: Demos) -> None:
    """The option that takes the kinds of a file is shown, beside the choices that were made."""
    code = f"Demos('t', Maze({as_maze(small_demos.environment).rows!r}), [Demo('c', 'correct', "
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
    assert files(tmp_path / "figures") == ["1", "one.ipynb"]
    assert not (tmp_path / "executed" / "three.ipynb").exists()


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
    assert len(begun) == 2 + execution.STARTS


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
    assert files(tmp_path / "figures") == ["a"]


def test_folders_of_outputs_do_not_share_executed_notebooks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The default folders have theirs below `build`, every other folder has its own."""
    monkeypatch.setattr(project_files, "PROJECT", tmp_path)
    folders = {
        ("figures", "paper"): "build/executed/paper",
        ("build/quick", "quick"): "build/executed/quick",
        ("build/custom", "custom"): "build/executed/custom",
        ("here", "paper"): "here/executed",
        ("build/quick", "paper"): "build/quick/executed",
        ("../there", "paper"): "../there/executed",
    }
    for (out, name), folder in folders.items():
        assert executed_folder(tmp_path / out, name) == tmp_path / folder


# --- what is executed again ------------------------------------------------------------------


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Run notebooks in this process, which is fast; return the names of those that began."""
    begun: list[str] = []

    def execute(
        notebook: Notebook, values: Mapping[str, Any], stage: Path, *, executed: Path, **_: Any
    ) -> None:
        begun.append(notebook.name)
        names: dict[str, Any] = {}
        node = notebook.load()
        for at, cell in enumerate(node.cells):
            if cell.cell_type == "code":
                cell.execution_count = len(begun)
                exec(cell.source, names)
            if at == notebook.at:
                names |= {**values, "out": str(stage)}
        write_file(executed, str(nbformat.writes(node)))

    monkeypatch.setattr(execution, "execute", execute)
    return begun


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project with a lock and a data file."""
    monkeypatch.setattr(project_files, "PROJECT", tmp_path)
    (tmp_path / "environment.lock").write_text("numpy==1")
    (tmp_path / "data.toml").write_text("a = 1")
    return tmp_path


STORED = PARAMETERS + '\nstore = "build/trials.sqlite"'


def toy(write: Write, code: str = "value = trials", **options: Any) -> Path:
    """Write a notebook with two outputs and a data file."""
    last = "[(folder / f'{name}.txt').write_text(f'{value}') for name in 'ab']"
    declared = {"outputs": ["a.txt", "b.txt"], "inputs": ["data.toml"]}
    return write(code, last, **declared | {"parameters": STORED} | options)


def test_nothing_runs_when_nothing_has_changed(
    write: Write, run: Run, project: Path, no_kernel: None, begun: list[str]
) -> None:
    """A second run executes nothing, publishes nothing, writes no file and says so."""
    run(toy(write))
    assert begun == ["toy"]
    names = ("a.txt", "b.txt", "toy.ipynb", "provenance.json")
    written = [project / "figures" / name for name in names]
    written += [project / "executed" / name for name in ("toy.ipynb", "run.json")]
    times = [path.stat().st_mtime_ns for path in written]
    lines: list[str] = []
    assert run(toy(write), parameters={"store": "x"}, jobs=3, echo=lines.append) == []
    assert begun == ["toy"]
    assert lines == ["toy: fresh, nothing to do"]
    assert [path.stat().st_mtime_ns for path in written] == times


@pytest.mark.parametrize(
    "change", ["cell", "literal", "data", "lock", "deleted", "edited", "executed", "runs"]
)
def test_a_change_that_matters_executes_again(
    write: Write, run: Run, project: Path, begun: list[str], change: str
) -> None:
    """Code, parameters, data, lock, outputs and executed notebook count; then all is fresh."""
    path = toy(write)
    figures = project / "figures"
    run(path)
    if change == "cell":
        path = toy(write, "value = trials + 1")
    elif change == "literal":
        path = toy(write, parameters=STORED.replace("trials = 3", "trials = 4"))
    elif change == "data":
        (project / "data.toml").write_text("a = 2")
    elif change == "lock":
        (project / "environment.lock").write_text("numpy==2")
    elif change == "deleted":
        (figures / "a.txt").unlink()
    elif change == "edited":
        (figures / "a.txt").write_text("mine")
    elif change == "executed":
        (figures / "toy.ipynb").unlink()
    elif change == "runs":
        (project / "executed" / "run.json").write_text("[1]")
    published = run(path)
    assert begun == ["toy", "toy"]
    assert [path.name for path in published] == ["a.txt", "b.txt", "toy.ipynb"]
    due = {"cell": "4", "literal": "4"}.get(change, "3")
    assert [path.read_text() for path in published[:2]] == [due, due]
    run(path)
    assert begun == ["toy", "toy"]


def test_results_from_elsewhere_are_fresh(
    write: Write, run: Run, project: Path, no_kernel: None, begun: list[str]
) -> None:
    """Published outputs whose run is not known here, as in a fresh clone, are not made again."""
    path = toy(write)
    run(path)
    shutil.rmtree(project / "executed")
    lines: list[str] = []
    assert run(path, echo=lines.append) == []
    assert lines == ["toy: fresh, nothing to do"]
    assert begun == ["toy"]


def test_what_was_made_elsewhere_can_be_made_here(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """With `here` a fresh clone runs everything once, and says whether it has the same bytes."""
    path = toy(write)
    lines: list[str] = []
    run(path, here=True, echo=lines.append)
    shutil.rmtree(project / "executed")
    run(path, here=True, echo=lines.append)
    run(path, here=True, echo=lines.append)
    assert begun == ["toy", "toy"]
    assert [line.partition("s; ")[2] for line in lines] == ["", "", "", "all bytes as before", ""]
    assert lines[-1] == "toy: fresh, nothing to do"


def test_a_run_says_what_differs_from_before(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """How many of the outputs have other bytes than before is said, for each notebook."""
    lines: list[str] = []
    run(toy(write))
    run(toy(write, "value = (folder / 'b.txt') and trials + 1"), echo=lines.append)
    assert lines[-1].endswith("; 2 of them differ from before")


def test_cells_that_move_across_the_parameters_cell_count(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """The same cells in another order around the parameters cell are another notebook."""
    path = toy(write, "value = 5")
    run(path)
    node = nbformat.read(path, as_version=4)
    node.cells.insert(1, node.cells.pop(3))
    nbformat.write(node, path)
    run(path)
    assert begun == ["toy", "toy"]


def test_a_cell_that_is_cut_before_a_function_counts(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """Cells are compared one by one, because each has outputs of its own."""
    run(toy(write, "value = 5\n\n\ndef unused(): pass"))
    path = toy(write, "value = 5")
    node = nbformat.read(path, as_version=4)
    node.cells.insert(4, new_code_cell("def unused(): pass"))
    nbformat.write(node, path)
    run(path)
    assert begun == ["toy", "toy"]


def test_other_parameters_of_a_run_execute_again(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """Another seed, profile or -p is another run of the same folder, and going back is, too."""
    path, out = toy(write, profiles={"quick": {"trials": 2}}), project / "build"
    for options in ({}, {"seed": 2}, {"profile": "quick"}, {"parameters": {"alpha": 0.1}}, {}):
        run(path, out=out, **options)
        run(path, out=out, **options)
    assert begun == ["toy"] * 5


@pytest.mark.parametrize("end", [1, 50])
def test_an_executed_notebook_that_is_cut_off_is_made_again(
    write: Write, run: Run, project: Path, begun: list[str], end: int
) -> None:
    """New text cannot be put into half a file, so the notebook is executed."""
    run(toy(write))
    executed = project / "executed" / "toy.ipynb"
    executed.write_bytes(executed.read_bytes()[:-end])
    path = toy(write)
    node = nbformat.read(path, as_version=4)
    node.cells[0].source = "# Another headline"
    nbformat.write(node, path)
    run(path)
    assert begun == ["toy", "toy"]
    assert "Another headline" in executed.read_text()


def test_a_kill_while_text_is_brought_up_to_date_costs_nothing(
    write: Write,
    run: Run,
    project: Path,
    no_kernel: None,
    begun: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whichever file was written last, the next run ends the work and executes nothing."""
    path = toy(write)
    run(path)
    for allowed in range(4):
        node = nbformat.read(path, as_version=4)
        node.cells[0].source = f"# Headline {allowed}"
        nbformat.write(node, path)
        replace, left = Path.replace, [allowed]

        def stop(draft: Path, target: Path, replace: Any = replace, left: list[int] = left) -> None:
            left[0] -= 1
            if left[0] < 0:
                raise KeyboardInterrupt
            replace(draft, target)

        with monkeypatch.context() as patched:
            patched.setattr(Path, "replace", stop)
            if allowed < 3:
                with pytest.raises(KeyboardInterrupt):
                    run(path)
            else:
                run(path)
        run(path)
        assert f"Headline {allowed}" in (project / "figures" / "toy.ipynb").read_text()
        assert list(verify_outputs(project / "figures")) == []
    assert begun == ["toy"]


def test_a_published_notebook_that_was_edited_is_made_again(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """Other text is put right without a run; other outputs, or half a file, take a run."""
    path = toy(write)
    run(path)
    published = project / "figures" / "toy.ipynb"
    whole = published.read_bytes()
    published.write_bytes(whole.replace(b"# Toy", b"# Mine"))
    run(path)
    assert (published.read_bytes(), begun) == (whole, ["toy"])
    published.write_bytes(whole.replace(b'"execution_count": 1', b'"execution_count": 7'))
    run(path)
    assert begun == ["toy", "toy"]
    published.write_bytes(b"{")
    run(path)
    assert begun == ["toy"] * 3


def test_prose_is_rendered_and_not_executed(
    write: Write, run: Run, project: Path, no_kernel: None, begun: list[str]
) -> None:
    """New text, comments and layout come into the executed notebook; the outputs stay."""
    path = toy(write)
    run(path)
    node = nbformat.read(path, as_version=4)
    node.cells[0].source = "# Another headline"
    node.cells[3].source = "value = (trials)  # as given"
    node.cells.append(new_markdown_cell("The end"))
    nbformat.write(node, path)
    before = (project / "figures" / "a.txt").stat().st_mtime_ns
    lines: list[str] = []
    assert run(path, echo=lines.append) == []
    assert lines == ["toy: fresh; its text is brought up to date, nothing is executed"]
    assert begun == ["toy"]
    assert (project / "figures" / "a.txt").stat().st_mtime_ns == before
    for folder in ("executed", "figures"):
        shown = nbformat.read(project / folder / "toy.ipynb", as_version=4)
        assert [cell.source for cell in shown.cells] == [cell.source for cell in node.cells]
        assert shown.cells[3].execution_count == 1
    assert list(verify_outputs(project / "figures")) == []
    run(path, echo=lines.append)
    assert lines[-1] == "toy: fresh, nothing to do"


def test_force_runs_what_is_fresh_with_an_empty_store(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """--force executes again, and gives the notebook a store that has nothing."""
    path = toy(write, "value = Path(store).exists(), store == str(Path(store).absolute())")
    (project / "build").mkdir()
    (project / "build" / "trials.sqlite").touch()
    assert run(path)[0].read_text() == "(True, True)"
    assert run(path, force=True)[0].read_text() == "(False, True)"
    assert begun == ["toy"] * 2
    assert [one.name for one in (project / "build").iterdir()] == ["trials.sqlite"]


def test_a_failure_forgets_the_run(
    write: Write, run: Run, project: Path, begun: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a forced run that failed, the executed notebook is not that of the outputs."""
    path = toy(write, "import os\nvalue = 1 // int(os.environ['DIVISOR'])")
    monkeypatch.setenv("DIVISOR", "1")
    run(path)
    monkeypatch.setenv("DIVISOR", "0")
    with pytest.raises(ZeroDivisionError):
        run(path, force=True)
    assert read_runs(project / "executed") == {}
    monkeypatch.setenv("DIVISOR", "1")
    run(path)
    assert begun == ["toy"] * 3
    assert list(read_runs(project / "executed")) == ["toy"]


def test_only_what_changed_runs(write: Write, run: Run, project: Path, begun: list[str]) -> None:
    """Of several notebooks, one that is fresh is left alone, also when a shared file is merged."""
    append = "with (folder / 'rows.csv').open('a') as file: print(name, file=file)"

    def both(code: str = "") -> list[Path]:
        return [
            write(append, text, name=name, parameters=f'out = "x"\nname = "{name}"', merged=shared)
            for name, text in (("one", ""), ("two", code))
        ]

    shared = ["rows.csv"]
    run(*both(), jobs=None)
    run(*both("more = 1"), jobs=None)
    run(*both("more = 1"), jobs=None)
    assert begun == ["one", "two", "two"]


def test_rows_that_were_lost_are_made_again(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """Who runs after a shared file was deleted does not answer for the rows of the others."""
    append = (
        "path = folder / 'rows.csv'\n"
        "rows = path.read_text().split() if path.exists() else []\n"
        "path.write_text(' '.join(sorted({*rows, name})))"
    )
    paths = [
        write(append, name=name, parameters=f'out = "x"\nname = "{name}"', merged=["rows.csv"])
        for name in ("one", "two", "three")
    ]
    run(*paths, jobs=None)
    (project / "figures" / "rows.csv").unlink()
    run(paths[0], jobs=None)
    begun.clear()
    run(*paths, jobs=None)
    assert begun == ["two", "three"]
    assert (project / "figures" / "rows.csv").read_text() == "one three two"
    run(*paths, jobs=None)
    assert begun == ["two", "three"]


@pytest.mark.parametrize("file", ["data.toml", "environment.lock"])
def test_an_edit_during_the_run_publishes_nothing(
    write: Write, run: Run, project: Path, begun: list[str], file: str
) -> None:
    """Nobody knows whether outputs were made before or after an edit: they are made again."""
    edit = f"(PROJECT / {file!r}).write_text('b = 2')\nvalue = 1"
    path = toy(write, f"from replication.files import PROJECT\n{edit}")
    with pytest.raises(RunError, match=rf"{re.escape(file)} has changed during the run: nothing"):
        run(path)
    assert files(project / "figures") == []
    assert [one.name for one in run(path)] == ["a.txt", "b.txt", "toy.ipynb"]
    run(path)
    assert begun == ["toy", "toy"]


def test_an_edit_during_an_earlier_notebook_counts(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """What a notebook depends on is what was there when it began, not when the command did."""
    edit = "from replication.files import PROJECT\n(PROJECT / 'data.toml').write_text('b = 2')"
    first = write(edit, name="first", parameters=STORED)
    second = toy(write)
    run(first, second)
    run(first, second)
    assert begun == ["first", "toy"]
    (project / "data.toml").write_text("a = 1")
    run(first, second)
    assert begun == ["first", "toy", "toy"]


def test_a_module_that_is_edited_during_the_run_is_noticed(
    write: Write, run: Run, project: Path, begun: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Source is read again when a notebook ends, although it is read once for all notebooks."""
    package = project / "package"
    package.mkdir()
    (package / "mine.py").write_text("a = 1")
    monkeypatch.setattr(provenance, "__file__", str(package / "provenance.py"))
    edit = f"Path({str(package / 'mine.py')!r}).write_text('a = 2')"
    path = toy(write, f"{edit}\nif False: import replication.mine\nvalue = 1")
    with pytest.raises(RunError, match=r"replication\.mine has changed during the run"):
        run(path)


@pytest.mark.usefixtures("no_kernel")
def test_an_invalid_notebook_is_refused_before_any_runs(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """What only nbformat finds wrong stops the notebooks before it, too."""
    second = write(name="second")
    document = json.loads(second.read_text())
    document["cells"][0]["more"] = 1
    second.write_text(json.dumps(document))
    with pytest.raises(NotebookError, match=r"second\.ipynb: is not a valid notebook: .*'more'"):
        run(toy(write), second)
    assert begun == []


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
    write: Write,
    run: Run,
    project: Path,
    begun: list[str],
    monkeypatch: pytest.MonkeyPatch,
    address: str,
    message: str,
    given: bool,
) -> None:
    """An address at which nothing answers, of the option or the environment, is refused at once."""
    if not given:
        monkeypatch.setenv("REPLICATION_SCHEDULER", address)
    with pytest.raises(NotebookError, match=f"no Dask scheduler answers at {address}.*{message}"):
        run(toy(write), scheduler=address if given else "")
    assert begun == []


def test_what_killed_runs_left_is_swept(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """Half-written files are removed by the next run, also by one with nothing to do."""
    path = toy(write)
    run(path)
    for folder in ("figures", "executed"):
        (project / folder / ".draft-killed").mkdir()
        (project / folder / ".draft-killed" / "draft").touch()
    run(path)
    assert begun == ["toy"]
    assert list(project.glob("*/.draft-*")) == []


# --- two runs at once ------------------------------------------------------------------------


def test_a_second_run_says_that_it_waits(
    write: Write, run: Run, project: Path, begun: list[str]
) -> None:
    """While another process has the folder, nothing begins, and one line says why."""
    path, lines = toy(write), list[str]()
    (project / "figures").mkdir()
    with (project / "figures" / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        second = threading.Thread(target=run, args=(path,), kwargs={"echo": lines.append})
        second.start()
        end = time.monotonic() + 60
        while not lines and time.monotonic() < end:
            time.sleep(0.01)
        time.sleep(0.1)
        assert lines == [f"another run writes to {project / 'figures'}: waiting until it ends"]
        assert begun == []
    second.join(timeout=60)
    assert begun == ["toy"]
    assert files(project / "figures") == ["a.txt", "b.txt", "toy.ipynb"]


def test_runs_at_the_same_time_leave_whole_outputs(
    write: Write, run: Run, project: Path, begun: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Runs of different parameters take turns: the outputs are all of one of them."""
    path = toy(write, "import time; time.sleep(0.3); value = seed")
    options: dict[str, Any] = {"profile": "paper", "out": project / "build" / "custom"}
    lines: list[str] = []
    threads = [
        threading.Thread(
            target=run_notebooks,
            args=([path],),
            kwargs=options | {"seed": seed, "echo": lines.append},
        )
        for seed in (1, 2, 3)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
    assert begun == ["toy"] * 3
    assert sum("waiting until it ends" in line for line in lines) == 2
    texts = {(project / "build" / "custom" / f"{name}.txt").read_text() for name in "ab"}
    assert len(texts) == 1
    assert run_notebooks([path], seed=int(texts.pop()), **options) == []
