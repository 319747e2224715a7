from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from nbclient import NotebookClient

from replication.progress import EVENTS, Count, Display, iteration_meter, trial_meter
from tests.notebooks import write_notebook
from tests.terminal import in_terminal, screen


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the time, in a list of one, which a test may set."""
    now = [100.0]
    monkeypatch.setattr("replication.progress.time.monotonic", lambda: now[0])
    return now


# --- what is said of trials ------------------------------------------------------------------


def test_a_count_says_how_far_the_trials_are(clock: list[float]) -> None:
    """It has rate and time left, and in the end the time that all took."""
    count = Count(200)
    assert count.line() == "0 % of 200 trials, 0 k steps/s"
    for _ in range(3):
        clock[0] += 20.0
        count.add(20, 60_000_000)
    assert count.line() == "30 % of 200 trials, 3 M steps/s, 2 min left"
    clock[0] += 30.0
    count.add(139, 90_000_000)
    assert count.line() == "99 % of 200 trials, 3 M steps/s, 0 s left"
    count.add(1, 0)
    assert count.line() == "100 % of 200 trials, 3 M steps/s, took 2 min"


def test_a_clock_that_stands_still_is_no_fault(clock: list[float]) -> None:
    """Trials that take no time at all are told."""
    count = Count(1)
    count.add(1, 5)
    assert count.line().startswith("100 % of 1 trials, ")


def test_nothing_is_drawn_unless_it_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    """Without a terminal, or when told so, no bar disturbs the output."""
    for wanted in (None, False):
        with trial_meter(2, wanted) as report:
            report(1, 1)
            report(1, 1)
    assert capsys.readouterr().err == ""
    with trial_meter(2, True) as report:
        report(1, 1)
    shown = capsys.readouterr().err
    assert "computing" in shown
    assert shown.endswith("\r")


def report(file: Path, *numbers: int) -> None:
    """Write what a kernel reports: when it began, the total, trials and steps."""
    file.write_text(json.dumps(numbers))


# --- on a terminal ---------------------------------------------------------------------------

FAKE_RUN = """
import json, time
from pathlib import Path
import click
from replication.cli import _say
from replication.progress import Display
_say("before: fresh, nothing to do")
with Display(2, bars=True) as display:
    for name in ("open_maze", "obstacle_maze"):
        display.begin(name)
        _say(f"{name}: running, {'a long list of parameters, ' * 4}")
        time.sleep(0.15)
        display.poll(Path("events"))
        for trials in range(0, 9, 2):
            Path("events").write_text(json.dumps([hash(name), 8, trials, 10**6 * trials]))
            display.poll(Path("events"))
            time.sleep(0.12)
        _say(f"{name}: 34 outputs in 1.0 s")
        display.end()
_say("outputs (34 new): figures")
"""


@pytest.mark.parametrize("columns", [80, 110])
def test_lines_and_the_bar_do_not_meet(tmp_path: Path, columns: int) -> None:
    """Whenever the run is looked at, a bar has one line of its own, below all other lines."""
    told = in_terminal("-c", FAKE_RUN, columns=columns, cwd=tmp_path)
    ends = [found.start() for found in re.finditer("\r", told)] + [len(told)]
    bars = set()
    for end in ends:
        *lines, last = [line for line in screen(told[:end], columns) if line.strip()] or [""]
        for line in lines:
            assert not re.search(r"trials,|\d\d:\d\d|\(\d of 2\)", line)
        if "of 2)" in last:
            assert re.match(r"o[a-z_]+ \([12] of 2\): (\d\d:\d\d|[ \d]+ %\|.+trials, .+)$", last)
            assert len(last) <= columns
            bars.add(last)
    assert any("(1 of 2): 00:00" in bar for bar in bars)
    assert any(re.search(r"\(2 of 2\):  50 %\|.*4 of 8 trials, .*left", bar) for bar in bars)
    shown = "".join(line.ljust(columns) for line in screen(told, columns))
    for name in ("open_maze", "obstacle_maze"):
        assert shown.count(f"{name}: running, ") == shown.count(f"{name}: 34 outputs") == 1
    assert "trials," not in shown
    assert shown.rstrip().endswith("outputs (34 new): figures")


def test_iterations_have_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A terminal shows the newest weight update, and nothing stays; elsewhere nothing is shown."""
    code = (
        "import time\nfrom replication.progress import iteration_meter\n"
        "with iteration_meter() as report:\n"
        "    for k in (1, 2, 3):\n        time.sleep(0.12)\n        report(k, k / 7)\n"
    )
    told = in_terminal("-c", code, columns=80, cwd=tmp_path)
    assert "iteration 2, d = 0.2857" in told
    assert "\n" not in told
    assert not "".join(screen(told, 80)).strip()
    with iteration_meter() as report:
        report(1, 0.5)
    assert capsys.readouterr() == ("", "")


def test_display_in_a_log_writes_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each set of trials has its own lines, and there are no bars."""
    with Display(2, bars=False) as display:
        for total in (10, 20):
            for trials in range(total + 1):
                report(tmp_path / "events", total, total, trials, trials)
                display.poll(tmp_path / "events")
                display.poll(tmp_path / "events")
    told = capsys.readouterr().err
    assert "\r" not in told
    assert [line.split(",")[0] for line in told.splitlines()] == [
        f"  {10 * k} % of {total} trials" for total in (10, 20) for k in range(1, 11)
    ]


# --- reports of a kernel ---------------------------------------------------------------------


def test_reports_of_another_process_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a kernel reports reaches the display, and the kernel draws nothing."""
    code = (
        "from replication.progress import trial_meter\n"
        "with trial_meter(4) as report:\n"
        "    for k in range(4): report(1, k)\n"
    )
    events = tmp_path / "events"
    with Display(1, bars=False) as display:
        for _ in range(2):  # kernels come and go
            done = subprocess.run(
                [sys.executable, "-c", code],
                env=os.environ | {EVENTS: str(events)},
                capture_output=True,
                check=True,
            )
            assert (done.stdout, done.stderr) == (b"", b"")
            display.poll(events)
    assert list(tmp_path.iterdir()) == [events]
    assert capsys.readouterr().err.count("100 % of 4 trials") == 2


def test_sums_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A report that is missed is contained in the next one, and the last one is always made."""
    monkeypatch.setenv(EVENTS, str(tmp_path / "events"))
    with trial_meter(9000) as told:
        first = json.loads((tmp_path / "events").read_text())
        for _ in range(9000):
            told(1, 2)
    assert first[1:] == [9000, 0, 0]
    assert json.loads((tmp_path / "events").read_text()) == [first[0], 9000, 9000, 18000]


def test_a_bar_that_is_asked_for_is_no_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An explicit wish wins over the file."""
    monkeypatch.setenv(EVENTS, str(tmp_path / "none"))
    with trial_meter(1, False) as told:
        told(1, 1)
    assert not (tmp_path / "none").exists()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "broken",
    [b"[1, 2, ", b"", b"17", b"[]", b'{"trials": 1}', b"null", b"\xff\xfe", b'["a"]', None],
)
def test_what_is_no_report_is_passed_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], broken: bytes | None
) -> None:
    """Whatever the file holds, later reports are shown."""
    with Display(1, bars=False) as display:
        if broken is not None:
            (tmp_path / "events").write_bytes(broken)
        display.poll(tmp_path / "events")
        assert capsys.readouterr().err == ""
        report(tmp_path / "events", 1, 2, 2, 5)
        display.poll(tmp_path / "events")
    assert "100 % of 2 trials" in capsys.readouterr().err


def test_a_log_that_is_closed_is_no_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """When lines cannot be written, as behind `| head`, the run goes on."""

    class Closed(io.StringIO):
        def write(self, _: str) -> int:
            raise BrokenPipeError

    monkeypatch.setattr(sys, "stderr", Closed())
    report(tmp_path / "events", 1, 2, 2, 5)
    with Display(1, bars=False) as display:
        display.poll(tmp_path / "events")


def test_a_cell_shows_a_line(tmp_path: Path) -> None:
    """In a notebook that is run by hand, one output tells how far the trials are."""
    code = (
        "from replication.progress import trial_meter\n"
        "with trial_meter(4) as report:\n"
        "    for _ in range(4): report(1, 1)"
    )
    node = write_notebook(tmp_path / "toy.ipynb", code)
    client = NotebookClient(node, kernel_name="python3", resources={"metadata": {"path": tmp_path}})
    (output,) = client.execute().cells[-1].outputs
    assert output.output_type == "display_data"
    assert output.data["text/plain"].startswith("100 % of 4 trials, ")
