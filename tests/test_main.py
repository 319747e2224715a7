"""The process of the command: its streams and its environment, from outside."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from replication import Demos, save_demos
from replication.__main__ import UNUSED
from replication.files import PROJECT
from tests.notebooks import write_notebook
from tests.terminal import in_terminal, screen

PROGRAM = (
    "import sys; from pathlib import Path; from replication import files\n"
    "from replication.__main__ import main\n"
    "files.PROJECT = Path(sys.argv.pop(1)); main()"
)
FULL = Path("/dev/full")
DEMOS = str(PROJECT / "data" / "demos" / "soccer.json")
PRINTING = [
    *(["--help"], ["--version"], ["run", "--help"], ["run"], ["status"], ["verify"], ["draw"]),
    *(["learn", DEMOS], ["choices"], ["demos", "schema"], ["demos", "check", DEMOS]),
]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """Set up a project with a notebook that writes a file."""
    code = "from pathlib import Path\n(Path(out) / 'a.md').write_text('| a |')"
    write_notebook(tmp_path / "notebooks" / "toy.ipynb", code, data=["a.md"])
    (tmp_path / "environment.lock").touch()
    return tmp_path


def replicate(project: Path, *words: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run the command in a process of its own, which sees a given project."""
    command = [sys.executable, "-c", PROGRAM, str(project), *words]
    given: dict[str, Any] = {"stderr": subprocess.PIPE, "text": True, "cwd": project, **options}
    return subprocess.run(command, timeout=300, check=False, **given)


@pytest.mark.skipif(not FULL.exists(), reason="has no full device")
@pytest.mark.parametrize("words", PRINTING, ids=" ".join)
def test_a_full_device_is_one_line(project: Path, words: list[str]) -> None:
    """What cannot be shown is not computed, and one line says so."""
    with FULL.open("w") as full:
        done = replicate(project, *words, stdout=full)
    assert done.returncode in (1, 2)
    assert done.stderr == "error: standard output: no space left on device\n"
    assert not list(project.glob("*/*/toy")) + list(project.glob("build/learn/*"))


def test_a_reader_who_goes_does_not_end_a_run(project: Path) -> None:
    """Behind `| head -1` everything is done in silence, with the exit code of an open pipe."""
    reader, writer = os.pipe()
    os.close(reader)
    done = replicate(project, "run", stdout=writer)
    assert (done.returncode, done.stderr) == (0, "")
    assert (project / "figures" / "toy" / "a.md").exists()
    for words in (["status"], ["--help"], ["demos", "schema"]):
        done = replicate(project, *words, stdout=writer)
        assert (done.returncode, done.stderr) == (0, "")
    assert replicate(project, "draw", "none", stdout=writer).returncode == 2
    assert replicate(project, "run", "--force", stdout=writer, stderr=writer).returncode == 0
    assert replicate(project, "draw", "none", stdout=writer, stderr=writer).returncode == 2
    os.close(writer)


@pytest.mark.parametrize("closed", [(1,), (2,), (0, 1, 2)])
def test_streams_may_be_closed(project: Path, closed: tuple[int, ...]) -> None:
    """Without standard streams a run is the same, and no file takes their numbers."""

    def close() -> None:
        for number in closed:
            os.close(number)

    done = replicate(project, "run", stdout=subprocess.PIPE, preexec_fn=close)
    assert done.returncode == 0
    assert done.stderr == ""
    assert ("toy: running" in done.stdout) == (1 not in closed)
    assert (project / "figures" / "toy" / "a.md").read_text() == "| a |"


def test_any_text_can_be_shown(project: Path) -> None:
    """What the terminal's encoding lacks is shown by its number."""
    options: dict[str, Any] = {
        "env": os.environ | {"PYTHONIOENCODING": "latin-1"},
        "stdout": subprocess.PIPE,
    }
    done = replicate(project, "choices", "α", **options)
    assert done.returncode == 2
    assert done.stderr.startswith("error: unknown choice '\\u0391'")


def test_no_figure_needs_a_backend(project: Path) -> None:
    """Whatever backend is asked for, it is not loaded: here, nor in the kernel."""
    code = "import os, matplotlib\nfrom pathlib import Path\n(Path(out) / 'a.md').write_text('a')"
    write_notebook(project / "notebooks" / "toy.ipynb", code, data=["a.md"])
    bogus = os.environ | {"MPLBACKEND": "bogus"}
    assert replicate(project, "run", env=bogus).returncode == 0
    done = replicate(project, "learn", "none.json", env=bogus)
    assert done.stderr == "error: none.json: cannot be read (no such file or directory)\n"


@pytest.mark.parametrize("name", UNUSED)
def test_what_libraries_are_told_does_not_matter(name: str, tmp_path: Path) -> None:
    """A variable that would end Matplotlib or Numba, or hold it up, is none for the command."""
    os.mkfifo(tmp_path / "pipe")
    value = str(tmp_path / "pipe") if name == "MATPLOTLIBRC" else "bogus"
    words = ["learn", "data/demos/open_maze.json", "-p", "max_iterations", "1"]
    done = replicate(PROJECT, *words, "--out", str(tmp_path), env=os.environ | {name: value})
    assert (done.returncode, done.stderr) == (0, "")


def test_it_is_a_module_as_well() -> None:
    """`python -m replication` is the command."""
    words = [sys.executable, "-m", "replication", "--version"]
    done = subprocess.run(words, cwd=PROJECT, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("replicate ")


# --- in a terminal and in a pipe -------------------------------------------------------------

COUNTING = """
import time
from pathlib import Path
from replication.progress import trial_meter
with trial_meter(5) as report:
    for k in range(5):
        time.sleep(0.2)
        report(1, 10**6)
(Path(out) / "a.md").write_text("| a | table | that | is | wide |" * 9)
"""
SHOWN = [
    *(
        ["--help"],
        ["run", "--help"],
        ["run"],
        ["status"],
        ["status", "--all"],
        ["verify", "--seed", "1"],
    ),
    *(["choices"], ["choices", "EPSILON-FALL"], ["copy", "toy"], ["rum"]),
    *(["learn", "mine.json"], ["demos", "check", "mine.json", "none.json"]),
]


def shown_in(project: Path, demos: Demos, *words: str, columns: int, terminal: bool) -> list[str]:
    """Return the lines that a command leaves in a terminal, or that a file would get."""
    write_notebook(project / "notebooks" / "toy.ipynb", COUNTING, data=["a.md"])
    (project / "environment.lock").touch()
    save_demos(demos, project / "mine.json")
    if terminal:
        told = in_terminal("-c", PROGRAM, str(project), *words, columns=columns, cwd=project)
    else:
        env = os.environ | {"COLUMNS": str(columns)}
        both: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        told = replicate(project, *words, env=env, **both).stdout
        assert not re.search(r"[\r\x1b]", told)
        told = re.sub(r"^  \d+ % of 5 trials, .*\n", "", told, flags=re.MULTILINE)
    told = re.sub(r"\d+\.\d s\b", "1.5 s", told)
    return [line.rstrip() for line in screen(told, columns)]


@pytest.mark.parametrize("columns", [80, 110])
@pytest.mark.parametrize("words", SHOWN, ids=" ".join)
def test_a_terminal_keeps_what_a_pipe_gets(
    tmp_path: Path, small_demos: Demos, words: list[str], columns: int
) -> None:
    """Nothing is left of bars and running lines, and no line was written into another."""
    (tmp_path / "a").mkdir()
    piped = shown_in(tmp_path / "a", small_demos, *words, columns=columns, terminal=False)
    shutil.move(tmp_path / "a", tmp_path / "used")
    (tmp_path / "a").mkdir()
    left = shown_in(tmp_path / "a", small_demos, *words, columns=columns, terminal=True)
    assert left == piped
    assert len("".join(left)) > 10
