"""Interruptions at every moment: driver and kernel end, and one line says so."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from replication.files import PROJECT
from tests.notebooks import write_notebook

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")

SOCCER = str(PROJECT / "data" / "demos" / "soccer.json")

PATIENCE = 1200
"""Seconds after which something hangs, on however slow a machine."""

PROGRAM = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "import sys; from pathlib import Path; from replication import files\n"
    "from replication.__main__ import main\n"
    "files.PROJECT = Path(sys.argv.pop(1)); main()"
)


def marked(mark: Path) -> list[int]:
    """Return the kernels and drivers whose temporary files are in a folder."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes()
            own = f"TMPDIR={mark}".encode() in (folder / "environ").read_bytes()
        except OSError:
            continue
        if own and (b"ipykernel_launcher" in words or b"pipeline.driver" in words):
            found.append(int(folder.name))
    return found


def interrupted(
    project: Path, seconds: float, *, starting: bool, number: int = signal.SIGINT
) -> None:
    """Interrupt a run some seconds after its cell or driver has begun; check how it ends."""
    begin = f"from pathlib import Path\nPath({str(project / 'begun')!r}).touch()"
    write_notebook(
        project / "notebooks" / "sleep.ipynb", f"{begin}\nimport time\ntime.sleep(36_000)"
    )
    (project / "environment.lock").touch()
    scratch = project / "scratch"
    scratch.mkdir()
    process = subprocess.Popen(
        [
            sys.executable,
            "-c",
            PROGRAM,
            str(project),
            "run",
            str(project / "notebooks" / "sleep.ipynb"),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"TMPDIR": str(scratch)},
    )
    end = time.monotonic() + PATIENCE
    while not (marked(scratch) if starting else (project / "begun").exists()):
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.001)
    time.sleep(seconds)
    started = marked(scratch)
    process.send_signal(number)
    shown = process.communicate(timeout=PATIENCE)[1]
    assert process.returncode == 130, shown
    assert len(shown.splitlines()) == 1, shown
    assert shown.startswith("error: interrupted; ")
    assert started
    assert not marked(scratch)
    assert list(scratch.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_cell_that_runs_is_ended(tmp_path: Path, number: int) -> None:
    """Ctrl-C, or a polite kill, leaves one line, and neither processes nor files."""
    interrupted(tmp_path / "toy", 0.5, starting=False, number=number)


@pytest.mark.parametrize("moment", [0, 1.5])
def test_a_run_that_starts_is_ended(tmp_path: Path, moment: float) -> None:
    """So does Ctrl-C while driver and kernel start."""
    interrupted(tmp_path / "toy", moment, starting=True)


def ended_early(project: Path, pause: float, number: int, *words: str) -> None:
    """Send a signal some time after the handlers are set; the command ends quietly."""
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(project), *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    mask = 0
    while not mask >> (signal.SIGTERM - 1) & 1:
        assert process.poll() is None
        status = Path(f"/proc/{process.pid}/status").read_text()
        mask = int(status.partition("SigCgt:")[2].split()[0], 16)
    time.sleep(pause)
    process.send_signal(number)
    shown = process.communicate(timeout=120)[1]
    assert process.returncode == 130, shown
    assert re.fullmatch(r"error: interrupted(; .*)?\n", shown)


def importing(project: Path, *pauses: float) -> None:
    """Interrupt commands while they import; nothing is left."""
    begin = "import time\ntime.sleep(36_000)"
    write_notebook(project / "notebooks" / "sleep.ipynb", begin)
    (project / "environment.lock").touch()
    for at, pause in enumerate(pauses):
        number = (signal.SIGINT, signal.SIGTERM)[at % 2]
        ended_early(project, pause, number, "run", str(project / "notebooks" / "sleep.ipynb"))
        ended_early(project, pause, number, "learn", SOCCER, "--out", str(project / "learn"))
    assert list((project / "learn").glob("*")) == []


def test_imports_are_ended(tmp_path: Path) -> None:
    """Ctrl-C from the first moment on is one line: no import shows or swallows it."""
    importing(tmp_path, *(0.07 * k for k in range(10)))


def test_a_swallowed_interruption_is_repeated(tmp_path: Path) -> None:
    """Where Python drops what a signal raises, as in `__del__`, it is raised once more."""
    program = PROGRAM.replace(
        "main()",
        "from replication.pipeline import run\n"
        "class Dropping:\n"
        "    def __del__(self): signal.raise_signal(signal.SIGTERM)\n"
        "def runs(*_, **__):\n"
        "    Dropping()\n"
        "    import time; time.sleep(36_000)\n"
        "run.run_notebooks = runs\n"
        "main()",
    )
    write_notebook(tmp_path / "notebooks" / "toy.ipynb", "1")
    (tmp_path / "environment.lock").touch()
    words = [sys.executable, "-c", program, str(tmp_path), "run"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 130
    assert re.fullmatch(r"error: interrupted; .*\n", done.stderr)


@pytest.mark.long
def test_interruptions_at_many_moments(tmp_path: Path) -> None:
    """The same at many more moments."""
    for k in range(21):
        interrupted(tmp_path / f"cell-{k}", 0.85 + 0.01 * k, starting=False)
    for k in range(25):
        interrupted(tmp_path / f"start-{k}", 0.2 * k, starting=True)
    importing(tmp_path, *(0.01 * k for k in range(100)))
