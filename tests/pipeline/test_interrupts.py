"""Interruptions at every moment: driver and kernel end, and one line says so."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.notebooks import write_notebook

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")

PROGRAM = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "import sys; from pathlib import Path; from replication import cli, files\n"
    "files.PROJECT = Path(sys.argv.pop(1)); cli.app()"
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


def interrupted(project: Path, seconds: float, *, starting: bool) -> None:
    """Interrupt a run some seconds after its cell or driver has begun; check how it ends."""
    begin = f"from pathlib import Path\nPath({str(project / 'begun')!r}).touch()"
    write_notebook(project / "sleep.ipynb", f"{begin}\nimport time\ntime.sleep(300)")
    (project / "environment.lock").touch()
    scratch = project / "scratch"
    scratch.mkdir()
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(project), "run", str(project / "sleep.ipynb")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"TMPDIR": str(scratch)},
    )
    end = time.monotonic() + 120
    while not (marked(scratch) if starting else (project / "begun").exists()):
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.001)
    time.sleep(seconds)
    started = marked(scratch)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=120)[1]
    assert process.returncode == 130, said
    assert len(said.splitlines()) == 1, said
    assert said.startswith("error: interrupted; ")
    assert started
    assert not marked(scratch)
    assert list(scratch.iterdir()) == []


def check_cells(folder: Path, moments: list[float]) -> None:
    """Interrupt a cell that is running."""
    for moment in moments:
        interrupted(folder / f"{moment:.3f}", moment, starting=False)


def check_starts(folder: Path, moments: list[float]) -> None:
    """Interrupt a run some seconds after its driver was started."""
    for moment in moments:
        interrupted(folder / f"{moment:.3f}", moment, starting=True)


def test_a_cell_that_runs_is_ended(tmp_path: Path) -> None:
    """Ctrl-C while a cell runs leaves one line, and neither processes nor files."""
    check_cells(tmp_path, [0, 0.96])


def test_a_run_that_starts_is_ended(tmp_path: Path) -> None:
    """Ctrl-C while driver and kernel start leaves one line, and neither processes nor files."""
    check_starts(tmp_path, [0, 0.5, 1.5, 3])


@pytest.mark.long
def test_interruptions_at_many_moments(tmp_path: Path) -> None:
    """The same at many more moments."""
    check_cells(tmp_path, [0.85 + 0.01 * k for k in range(21)])
    check_starts(tmp_path, [0.2 * k for k in range(25)])
