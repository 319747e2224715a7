"""Interruptions of a kernel at every moment: it ends, and one line says so."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")

PROGRAM = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "import sys; from pathlib import Path; from replication import cli, paths\n"
    "paths.PROJECT = Path(sys.argv.pop(1)); cli.app()"
)


def kernels(parent: int) -> list[int]:
    """Return the kernels that a process has started."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes()
            own = (folder / "stat").read_text().rpartition(")")[2].split()[1] == str(parent)
        except OSError:
            continue
        if own and b"ipykernel_launcher" in words:
            found.append(int(folder.name))
    return found


def interrupted(project: Path, seconds: float, *, starting: bool) -> None:
    """Interrupt a run some seconds after its cell or kernel has begun; check how it ends."""
    cells = [
        new_code_cell('out = "x"', metadata={"tags": ["parameters"]}),
        new_code_cell(
            f"import time\nfrom pathlib import Path\nPath({str(project / 'begun')!r}).touch()\n"
            "time.sleep(300)"
        ),
    ]
    node = new_notebook(cells=cells, metadata={"replication": {"outputs": []}})
    project.mkdir()
    nbformat.write(node, project / "sleep.ipynb")
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
    while not (kernels(process.pid) if starting else (project / "begun").exists()):
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.001)
    time.sleep(seconds)
    started = kernels(process.pid)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=120)[1]
    assert process.returncode == 130, said
    assert len(said.splitlines()) == 1, said
    assert said.startswith("error: interrupted; ")
    assert not any(Path(f"/proc/{pid}").exists() for pid in started)
    assert list(scratch.iterdir()) == []


def check_ticks(folder: Path, moments: list[float]) -> None:
    """Interrupt a cell at moments about the one at which nbclient looks after the kernel."""
    for moment in moments:
        interrupted(folder / f"{moment:.3f}", moment, starting=False)


def check_starts(folder: Path, moments: list[float]) -> None:
    """Interrupt a run while its kernel starts."""
    for moment in moments:
        interrupted(folder / f"{moment:.3f}", moment, starting=True)


def test_nobody_complains_of_a_kernel_that_was_ended(tmp_path: Path) -> None:
    """Ctrl-C leaves one line also where nbclient finds the kernel dead while it is ended."""
    check_ticks(tmp_path, [0.93, 0.96, 0.99])


def test_a_kernel_that_starts_is_ended(tmp_path: Path) -> None:
    """Ctrl-C while the kernel starts leaves one line, and neither kernel nor files."""
    check_starts(tmp_path, [0, 0.05, 0.4])


@pytest.mark.long
def test_interruptions_at_many_moments(tmp_path: Path) -> None:
    """The same at many more moments."""
    check_ticks(tmp_path, [0.85 + 0.01 * k for k in range(21)])
    check_starts(tmp_path, [0.06 * k for k in range(20)])
