from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from replication.progress import EVENTS, Display, TrialBar, trial_meter


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the time, in a list of one, which a test may set."""
    now = [100.0]
    monkeypatch.setattr("replication.progress.time.monotonic", lambda: now[0])
    return now


# --- a bar or lines --------------------------------------------------------------------------


def test_a_log_has_one_line_each_tenth(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    """Each 10 % has one line with rate and time left, however many trials finish at a time."""
    with TrialBar(200, shown=False, lines=True) as bar:
        for _ in range(200):
            clock[0] += 1.0
            bar.update(1, 3_000_000)
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 10
    assert told[0] == "   10 % of 200 trials, 3 M steps/s, 3 min left"
    assert told[-2] == "   90 % of 200 trials, 3 M steps/s, 20 s left"
    assert told[-1] == "  100 % of 200 trials, 3 M steps/s, 0 s left"


@pytest.mark.parametrize("chunk", [1, 3, 7, 25, 100])
def test_no_tenth_is_told_twice(
    clock: list[float], capsys: pytest.CaptureFixture[str], chunk: int
) -> None:
    """Trials that finish in chunks pass tenths by; the last line is always 100 %."""
    with TrialBar(100, shown=False, lines=True) as bar:
        for at in range(0, 100, chunk):
            bar.update(min(chunk, 100 - at), 1)
    tenths = [int(line.split()[0]) for line in capsys.readouterr().err.splitlines()]
    assert tenths == sorted(set(tenths))
    assert tenths[-1] == 100
    assert all(tenth % 10 == 0 for tenth in tenths)


def test_a_clock_that_stands_still_is_no_fault(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    """Trials that take no time at all are told."""
    with TrialBar(1, shown=False, lines=True) as bar:
        bar.update(1, 5)
    assert "100 % of 1 trials" in capsys.readouterr().err


def test_a_bar_shows_rate_and_time_left(capsys: pytest.CaptureFixture[str]) -> None:
    """A terminal has a bar that is drawn again, and none is left at the end."""
    with TrialBar(4, shown=True) as bar:
        bar._bar.mininterval = 0.0
        for _ in range(3):
            bar.update(1, 2_000_000)
    shown = capsys.readouterr().err
    assert re.search(r"3/4 \[\d\d:\d\d<\d\d:\d\d, .*M steps/s\]", shown)
    assert shown.endswith("\r")
    assert "\n" not in shown


def test_nothing_is_drawn_unless_it_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    """Without a terminal, or when told so, no bar disturbs the output."""
    for wanted in (None, False):
        with trial_meter(2, wanted) as report:
            report(1, 1)
            report(1, 1)
    assert capsys.readouterr().err == ""
    with trial_meter(2, True) as report:
        report(2, 1)
    assert "/2 [" in capsys.readouterr().err


def report(file: Path, *numbers: int) -> None:
    """Write what a kernel reports: when it began, the total, trials and steps."""
    file.write_text(json.dumps(numbers))


def test_display_has_a_bar_of_notebooks_and_one_of_trials(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The bar of notebooks names the one that runs; that of trials stands below it."""
    with Display(2, bars=True) as display:
        display.begin("open_maze")
        report(tmp_path / "events", 1, 8, 8, 10)
        display.poll(tmp_path / "events")
        display.end()
    shown = capsys.readouterr().err
    assert "open_maze" in shown
    assert "/8 [" in shown
    assert "/2 [" in shown


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
        f"  {10 * k:3d} % of {total} trials" for total in (10, 20) for k in range(1, 11)
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
