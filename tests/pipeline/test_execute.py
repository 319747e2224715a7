from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nbformat
import papermill
import pytest
from nbformat.v4 import new_markdown_cell

from replication import files
from replication.files import write_file
from replication.pipeline import driver
from replication.pipeline.execute import KERNEL, _environment, execute
from replication.pipeline.notebook import NotebookError, RunError, read_notebook
from replication.pipeline.rendering import rendered
from replication.progress import GIVEN, SCHEDULER, Display
from tests.notebooks import write_notebook

PARAMETERS = 'trials = 3\nname = "a"\njobs = 1\nstore = "build/s"\nout = "build"'
CODE = """
import os, sys, time
from pathlib import Path
print(out, jobs is not None, file=sys.stderr)
for k in range(4):
    print(k)
    time.sleep(0.12)
sorted({"a", "b", "c"}, key=hash), Path(out) / "a.txt"
"""

Run = Callable[..., bytes]


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Set up a project with the notebook `toy`."""
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    write(tmp_path, CODE)
    return tmp_path


def write(project: Path, *code: str, prose: str = "# Toy") -> Any:
    """Write the notebook: a headline, the parameters and code cells; return its contents."""
    return write_notebook(project / "toy.ipynb", *code, parameters=PARAMETERS, prose=prose)


@pytest.fixture
def run(project: Path) -> Run:
    """Execute the notebook and return the executed one."""

    def run(
        stage: str = "stage",
        target: str = "figures/toy",
        timeout: int = 3600,
        settings: dict[str, str] | None = None,
        **given: Any,
    ) -> bytes:
        (project / stage).mkdir(parents=True, exist_ok=True)
        with Display(1, bars=False) as display:
            text = execute(
                read_notebook(project / "toy.ipynb"),
                given,
                project / stage,
                folders={project / stage: project / target},
                failed=project / "failed.ipynb",
                timeout=timeout,
                display=display,
                settings=settings,
            )
        return text.encode()

    return run


def cells(content: bytes) -> list[Any]:
    """Return the cells of an executed notebook."""
    found: list[Any] = nbformat.reads(content.decode(), as_version=4).cells
    return found


# --- the same bytes --------------------------------------------------------------------------


def test_equal_runs_give_equal_bytes(run: Run, project: Path) -> None:
    """Other workers, another store or stage, or another moment change no byte."""
    first = run(trials=4, jobs=1, store="build/s")
    assert run(store=str(project / "mine"), jobs=7, trials=4, stage="elsewhere/stage-2") == first
    assert run(trials=5, jobs=1, store="build/s") != first


def test_executed_notebook_has_no_path_of_the_machine(run: Run, project: Path) -> None:
    """The folder of the outputs is named from the project on, and nothing has a time."""
    content = run(target="build/quick/toy", store=str(project / "mine")).decode()
    assert str(project) not in content
    assert "stage" not in content
    assert not re.search(r"\d\d:\d\d|start_time|papermill_record|duration", content)
    shown = cells(content.encode())
    assert [cell.id for cell in shown] == ["head", "parameters", "papermill-1", "code-0"]
    outputs = {output.get("name", "result"): output for output in shown[-1].outputs}
    assert outputs["stderr"].text == "build/quick/toy True\n"
    assert outputs["stdout"].text == "0\n1\n2\n3\n"
    assert "PosixPath('build/quick/toy/a.txt')" in outputs["result"].data["text/plain"]
    assert shown[2].source.startswith("# Parameters of this run, instead of those above\n")
    assert 'out = "build/quick/toy"' in shown[2].source
    assert "mine" not in content


# --- failures and surroundings ---------------------------------------------------------------


def test_a_failed_notebook_can_be_seen(run: Run, project: Path) -> None:
    """The executed notebook of a failure is there, free of the stage, with the cell's error."""
    write(project, "print(out)\n1 / 0", "2")
    with pytest.raises(RunError, match=r"toy\.ipynb: cell 3 failed: ZeroDivisionError") as caught:
        run()
    assert "ZeroDivisionError" in caught.value.details
    shown = nbformat.read(project / "failed.ipynb", as_version=4)
    errors = [
        output.ename
        for cell in shown.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if output.output_type == "error"
    ]
    assert errors == ["ZeroDivisionError"]
    assert str(project / "stage") not in (project / "failed.ipynb").read_text()


def test_mistakes_are_the_users(run: Run, project: Path) -> None:
    """What the package refuses is told as a mistake, in one line; the notebook is kept."""
    code = "from replication.paper.register import ChoiceError\nraise ChoiceError('so\\nmore')"
    write(project, code)
    with pytest.raises(NotebookError, match=r"toy\.ipynb: so$"):
        run()
    assert "error: so" in (project / "failed.ipynb").read_text()


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("import os; os.kill(os.getpid(), 9)", r"cell 3: the kernel was killed.*memory"),
        ("import time; time.sleep(36_000)", r"cell [23] took more than 8 seconds.*--timeout"),
        ("import sys; sys.exit()", r"cell 3 ended the notebook before its last cell"),
        ("import os; os.kill(os.getppid(), 9)", r"its process failed: it was killed"),
    ],
)
def test_what_ends_a_kernel_is_named(run: Run, project: Path, code: str, message: str) -> None:
    """A kernel that was killed, a cell over its time or that ends the notebook has its own line."""
    write(project, code, "done = 1")
    with pytest.raises(RunError, match=rf"toy\.ipynb: {message}"):
        run(timeout=8 if "sleep" in code else 3600)


def test_only_the_start_of_a_kernel_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kernel that does not start is started again; a cell never runs twice."""
    calls: list[bool] = []

    def execute(*, on_cell_execute: Callable[..., None], **_: Any) -> None:
        calls.append(len(calls) == 1)
        if calls[-1]:
            on_cell_execute(cell=None, cell_index=1)
        raise RuntimeError("Kernel died")

    def fault() -> Any:
        (tmp_path / "options.json").write_text(json.dumps({"parent": os.getppid()}))
        driver.main(tmp_path)
        return json.loads((tmp_path / "fault.json").read_text())

    monkeypatch.setattr(papermill, "execute_notebook", execute)
    assert fault() == {"cell": 1, "kind": "RuntimeError", "message": "Kernel died"}
    assert calls == [False, True]
    assert fault()["cell"] is None
    assert len(calls) == 2 + driver.STARTS


def test_the_kernel_is_our_interpreter(
    run: Run, project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It runs in the user's folder; foreign kernels of its name and start-up files take no part."""
    spec = {"argv": ["false"], "display_name": "foreign", "language": "python"}
    for place in ("JUPYTER_PATH", "JUPYTER_DATA_DIR"):
        monkeypatch.setenv(place, str(project / place))
        for name in (KERNEL, "python3", "python"):
            kernel = project / place / "kernels" / name / "kernel.json"
            write_file(kernel, json.dumps(spec))
    write_file(project / "startup.py", "foreign = True")
    write_file(project / "profile_default" / "startup" / "00-mine.py", "foreign = True")
    monkeypatch.setenv("IPYTHONDIR", str(project))
    monkeypatch.setenv("JUPYTER_PREFER_ENV_PATH", "1")
    monkeypatch.setenv("PYTHONSTARTUP", str(project / "startup.py"))
    monkeypatch.chdir(project)
    seen = "(sys.executable, os.getcwd(), trials, name, 'foreign' in dir())"
    write(project, f"import json, os, sys\nprint(json.dumps({seen}))")
    (output,) = cells(run(trials=7, name='it\'s "quoted"'))[-1].outputs
    expected = [sys.executable, "figures/toy", 7, 'it\'s "quoted"', False]
    expected[1] = str(project)
    assert json.loads(output.text) == expected


def test_settings_reach_the_notebook(project: Path, run: Run) -> None:
    """Environment variables that are given are those of the kernel."""
    write(project, f"import os\nprint(os.environ[{SCHEDULER!r}])")
    (output,) = cells(run(settings={SCHEDULER: "tcp://given:1"}))[-1].outputs
    assert output.text == "tcp://given:1\n"


def test_trials_are_never_given_by_accident(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A variable that somebody has set does not let a run publish other trials than it computes."""
    monkeypatch.setenv(GIVEN, "somewhere")
    assert _environment(tmp_path)[GIVEN] == ""


def test_a_scheduler_of_the_user_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scheduler is that of the user's environment, else none."""
    monkeypatch.delenv(SCHEDULER, raising=False)
    assert SCHEDULER not in _environment(tmp_path / "1")
    monkeypatch.setenv(SCHEDULER, "tcp://mine:1")
    assert _environment(tmp_path / "2")[SCHEDULER] == "tcp://mine:1"


def test_progress_of_trials_leaves_no_trace(
    run: Run, project: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Trials are reported where the notebook was started from, and not in the notebook."""
    write(
        project,
        "from replication.progress import trial_meter\n"
        "with trial_meter(10) as report:\n"
        "    for k in range(10): report(1, 1)",
    )
    assert cells(run())[-1].outputs == []
    told = capsys.readouterr().err.splitlines()
    assert told[-1].startswith("  100 % of 10 trials, ")


# --- new prose in an executed notebook -------------------------------------------------------


def test_render_is_what_a_run_would_give(run: Run, project: Path) -> None:
    """Text, comments, and cells of text that come or go: rendering spares an execution."""
    published = project / "published.ipynb"
    published.write_bytes(run(trials=4))
    node = write(project, f"# why\n{CODE}", prose="# Labyrinth\nmore")
    node.cells[1].source = f"# So many:\n{PARAMETERS}"
    node.cells.insert(0, new_markdown_cell("Before", id="before"))
    node.cells.insert(3, new_markdown_cell("Behind the parameters", id="behind"))
    node.cells.append(new_markdown_cell("The end", id="end"))
    nbformat.write(node, project / "toy.ipynb")
    text = rendered(read_notebook(project / "toy.ipynb"), published)
    assert "Labyrinth" in cells(text.encode())[1].source
    assert text.encode() == run(trials=4)
