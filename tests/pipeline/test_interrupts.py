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

PATIENCE = 1200
"""Seconds after which something hangs, on however slow a machine."""

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


def interrupted(
    project: Path, seconds: float, *, starting: bool, number: int = signal.SIGINT
) -> None:
    """Interrupt a run some seconds after its cell or driver has begun; check how it ends."""
    begin = f"from pathlib import Path\nPath({str(project / 'begun')!r}).touch()"
    write_notebook(project / "sleep.ipynb", f"{begin}\nimport time\ntime.sleep(36_000)")
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


@pytest.mark.long
def test_interruptions_at_many_moments(tmp_path: Path) -> None:
    """The same at many more moments."""
    for k in range(21):
        interrupted(tmp_path / f"cell-{k}", 0.85 + 0.01 * k, starting=False)
    for k in range(25):
        interrupted(tmp_path / f"start-{k}", 0.2 * k, starting=True)
