from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from replication import files
from replication.files import write_file
from replication.pipeline.execute import execute
from replication.pipeline.notebook import NotebookError, RunError, read_notebook
from replication.pipeline.rendering import rendered
from replication.progress import Display

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
    cells = [
        new_markdown_cell(prose, id="head"),
        new_code_cell(PARAMETERS, id="parameters", metadata={"tags": ["parameters"]}),
        *(new_code_cell(source, id=f"code-{at}") for at, source in enumerate(code)),
    ]
    node = new_notebook(cells=cells, metadata={"replication": {"outputs": []}})
    nbformat.write(node, project / "toy.ipynb")
    return node


@pytest.fixture
def run(project: Path) -> Run:
    """Execute the notebook and return the executed one."""

    def run(
        stage: str = "stage", target: str = "figures", timeout: int = 60, **given: Any
    ) -> bytes:
        scheduler = given.pop("scheduler", "")
        (project / stage).mkdir(parents=True, exist_ok=True)
        executed = project / "executed" / "toy.ipynb"
        with Display(1, bars=False) as display:
            execute(
                read_notebook(project / "toy.ipynb"),
                given,
                project / stage,
                target=project / target,
                executed=executed,
                timeout=timeout,
                display=display,
                scheduler=scheduler,
            )
        return executed.read_bytes()

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
    content = run(target="build/quick", store=str(project / "mine")).decode()
    assert str(project) not in content
    assert "stage" not in content
    assert not re.search(r"\d\d:\d\d|start_time|papermill_record|duration", content)
    shown = cells(content.encode())
    assert [cell.id for cell in shown] == ["head", "parameters", "papermill-1", "code-0"]
    outputs = {output.get("name", "result"): output for output in shown[-1].outputs}
    assert outputs["stderr"].text == "build/quick True\n"
    assert outputs["stdout"].text == "0\n1\n2\n3\n"
    assert "PosixPath('build/quick/a.txt')" in outputs["result"].data["text/plain"]
    assert 'out = "build/quick"' in shown[2].source
    assert "mine" not in content


def test_folders_outside_the_project_are_named_only(
    run: Run, project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the outputs are on this machine is nobody's business."""
    (project / "inner").mkdir()
    monkeypatch.setattr(files, "PROJECT", project / "inner")
    content = run().decode()
    assert str(project) not in content
    assert cells(content.encode())[-1].outputs[-1].data["text/plain"].count("figures/a.txt") == 1


def test_older_notebooks_give_equal_bytes(run: Run, project: Path) -> None:
    """A notebook of a format without cell ids is executed, too."""
    document = json.loads((project / "toy.ipynb").read_text())
    document["nbformat_minor"] = 4
    for cell in document["cells"]:
        del cell["id"]
    (project / "toy.ipynb").write_text(json.dumps(document))
    assert run() == run()


# --- failures and surroundings ---------------------------------------------------------------


def test_a_failed_notebook_can_be_seen(run: Run, project: Path) -> None:
    """The executed notebook of a failure is there, free of the stage, with the cell's error."""
    write(project, "print(out)\n1 / 0", "2")
    with pytest.raises(RunError, match=r"toy\.ipynb: cell 3 failed: ZeroDivisionError") as caught:
        run()
    assert "ZeroDivisionError" in caught.value.details
    shown = nbformat.read(project / "executed" / "toy.ipynb", as_version=4)
    errors = [
        output.ename
        for cell in shown.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if output.output_type == "error"
    ]
    assert errors == ["ZeroDivisionError"]
    assert str(project / "stage") not in (project / "executed" / "toy.ipynb").read_text()


def test_mistakes_are_the_users(run: Run, project: Path) -> None:
    """What the package refuses is told as a mistake, in one line."""
    write(
        project,
        "from replication.paper.register import ChoiceError\nraise ChoiceError('so\\nmore')",
    )
    with pytest.raises(NotebookError, match=r"toy\.ipynb: so$"):
        run()


def test_scheduler_reaches_the_notebook(
    run: Run, project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scheduler is the given one, else that of the user's environment, else none."""
    write(project, "import os\nos.environ.get('REPLICATION_SCHEDULER')")

    def seen(**options: Any) -> str:
        (output,) = cells(run(**options))[-1].outputs or [None]
        return output.data["text/plain"] if output else "None"

    monkeypatch.delenv("REPLICATION_SCHEDULER", raising=False)
    assert seen() == "None"
    assert seen(scheduler="tcp://given:1") == "'tcp://given:1'"
    monkeypatch.setenv("REPLICATION_SCHEDULER", "tcp://mine:1")
    assert seen() == "'tcp://mine:1'"


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
    assert [line.split("trials")[0] for line in told] == [
        f"  {10 * k:3d} % of 10 " for k in range(1, 11)
    ]


# --- new prose in an executed notebook -------------------------------------------------------


@pytest.fixture
def no_kernel(run: Run, monkeypatch: pytest.MonkeyPatch) -> bytes:
    """Execute the notebook once, and then fail when anything is executed."""
    first = run(trials=4)
    monkeypatch.setattr("papermill.execute_notebook", pytest.fail)
    return first


def test_render_is_what_a_run_would_give(run: Run, project: Path) -> None:
    """Text, comments, and cells of text that come or go: rendering spares an execution."""
    run(trials=4)
    node = write(project, f"# why\n{CODE}", prose="# Labyrinth\nmore")
    node.cells[1].source = f"# So many:\n{PARAMETERS}"
    node.cells.insert(0, new_markdown_cell("Before", id="before"))
    node.cells.insert(3, new_markdown_cell("Behind the parameters", id="behind"))
    node.cells.append(new_markdown_cell("The end", id="end"))
    nbformat.write(node, project / "toy.ipynb")
    text = rendered(read_notebook(project / "toy.ipynb"), project / "executed" / "toy.ipynb")
    assert "Labyrinth" in cells(text.encode())[1].source
    assert text.encode() == run(trials=4)


def test_render_keeps_outputs(no_kernel: bytes, project: Path) -> None:
    """Rendered twice, there and back, an executed notebook is as it was."""
    executed = project / "executed" / "toy.ipynb"
    write(project, f"{CODE}# a comment", prose="Only text")
    notebook = read_notebook(project / "toy.ipynb")
    write_file(executed, rendered(notebook, executed))
    shown = cells(executed.read_bytes())
    assert shown[0].source == "Only text"
    assert shown[-1].source.endswith("# a comment")
    assert [c.get("outputs") for c in shown] == [c.get("outputs") for c in cells(no_kernel)]
    assert not any(cell.get("outputs") for cell in notebook.load().cells)
    write(project, CODE)
    write_file(executed, rendered(read_notebook(project / "toy.ipynb"), executed))
    assert executed.read_bytes() == no_kernel


@pytest.mark.parametrize("cut", [[0], [0, 1]])
def test_render_follows_cells_of_text(no_kernel: bytes, project: Path, cut: list[int]) -> None:
    """Cells of text that were removed are gone, and the code cells keep their outputs."""
    node = write(project, CODE)
    node.cells[:1] = [new_markdown_cell(f"{k}", id=f"text-{k}") for k in cut]
    nbformat.write(node, project / "toy.ipynb")
    executed = project / "executed" / "toy.ipynb"
    write_file(executed, rendered(read_notebook(project / "toy.ipynb"), executed))
    shown = cells(executed.read_bytes())
    assert [cell.source for cell in shown if cell.cell_type == "markdown"] == [str(k) for k in cut]
    assert [cell.id for cell in shown][-3:] == ["parameters", "papermill-1", "code-0"]
    assert shown[-1].outputs == cells(no_kernel)[-1].outputs
