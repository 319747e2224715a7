from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from replication.progress import EVENTS, Display, TrialBar, trial_meter


class Spy(Display):
    """A display that keeps the events it is given."""

    def __init__(self) -> None:
        super().__init__(1, bars=False)
        self.seen: list[dict[str, Any]] = []

    def event(self, event: dict[str, Any]) -> None:
        """Keep an event and show it."""
        self.seen.append(event)
        super().event(event)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the time, in a list of one, which a test may set."""
    now = [100.0]
    monkeypatch.setattr("replication.progress.time.monotonic", lambda: now[0])
    return now


# --- a bar or lines --------------------------------------------------------------------------


def test_a_log_has_one_line_each_tenth(clock: list[float]) -> None:
    """Each 10 % has one line with rate and time left, however many trials finish at a time."""
    lines = io.StringIO()
    with TrialBar(200, shown=False, lines=lines) as bar:
        for _ in range(200):
            clock[0] += 1.0
            bar.update(1, 3_000_000)
    told = lines.getvalue().splitlines()
    assert len(told) == 10
    assert told[0] == "   10 % of 200 trials, 3 M steps/s, 3 min left"
    assert told[-2] == "   90 % of 200 trials, 3 M steps/s, 20 s left"
    assert told[-1] == "  100 % of 200 trials, 3 M steps/s, 0 s left"


@pytest.mark.parametrize("chunk", [1, 3, 7, 25, 100])
def test_no_tenth_is_told_twice(clock: list[float], chunk: int) -> None:
    """Trials that finish in chunks pass tenths by; the last line is always 100 %."""
    lines = io.StringIO()
    with TrialBar(100, shown=False, lines=lines) as bar:
        for at in range(0, 100, chunk):
            bar.update(min(chunk, 100 - at), 1)
    tenths = [int(line.split()[0]) for line in lines.getvalue().splitlines()]
    assert tenths == sorted(set(tenths))
    assert tenths[-1] == 100
    assert all(tenth % 10 == 0 for tenth in tenths)


def test_a_clock_that_stands_still_is_no_fault(clock: list[float]) -> None:
    """Trials that take no time at all are told."""
    lines = io.StringIO()
    with TrialBar(1, shown=False, lines=lines) as bar:
        bar.update(1, 5)
    assert "100 % of 1 trials" in lines.getvalue()


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


def test_display_has_a_bar_of_notebooks_and_one_of_trials(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The bar of notebooks names the one that runs; that of trials stands below it."""
    with Display(2, bars=True) as display:
        display.begin("open_maze")
        display.event({"total": 8})
        display.event({"trials": 8, "steps": 10})
        display.event({"total": 0})
        display.end()
        display.event({"trials": 1, "steps": 1})  # of no run: left out
    shown = capsys.readouterr().err
    assert "open_maze:   0%" in shown
    assert "/2 [" in shown
    assert "\n\r" in shown
    assert "/8 [" in shown


def test_display_in_a_log_has_lines_only(capsys: pytest.CaptureFixture[str]) -> None:
    """Each set of trials has its own lines, and there are no bars."""
    with Display(2, bars=False) as display:
        for total in (10, 20):
            display.event({"total": total})
            for _ in range(total):
                display.event({"trials": 1, "steps": 1})
    told = capsys.readouterr().err
    assert "\r" not in told
    assert [line.split(",")[0] for line in told.splitlines()] == [
        f"  {10 * k:3d} % of {total} trials" for total in (10, 20) for k in range(1, 11)
    ]


# --- events ----------------------------------------------------------------------------------


def test_events_of_another_process_are_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a kernel reports reaches the display in its order, and the kernel draws nothing."""
    code = (
        "from replication.progress import trial_meter\n"
        "with trial_meter(4) as report:\n"
        "    for k in range(4): report(1, k)\n"
    )
    with Spy() as display, display.listen(tmp_path / "events"):
        environment = os.environ | {EVENTS: str(tmp_path / "events")}
        for _ in range(2):  # kernels come and go
            done = subprocess.run(
                [sys.executable, "-c", code], env=environment, capture_output=True, check=True
            )
            assert (done.stdout, done.stderr) == (b"", b"")
    steps = [{"trials": 1, "steps": k} for k in range(4)]
    assert display.seen == [{"total": 4}, *steps, {"total": 0}] * 2
    assert capsys.readouterr().err.count("100 % of 4 trials") == 2


def test_a_bar_that_is_asked_for_is_drawn_beside_a_pipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An explicit wish wins over the pipe."""
    monkeypatch.setenv(EVENTS, str(tmp_path / "none"))
    with trial_meter(1, False) as report:
        report(1, 1)
    assert not (tmp_path / "none").exists()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "broken", [b'{"trials": 1, "st', b"", b"17", b"[]", b'{"trials": 1}', b"null", b"\xff\xfe"]
)
def test_half_written_events_are_ignored(tmp_path: Path, broken: bytes) -> None:
    """What a killed kernel left is passed over, and later events are shown."""
    with Spy() as display, display.listen(tmp_path / "events"):
        whole = [json.dumps(event).encode() for event in ({"total": 2}, {"trials": 2, "steps": 1})]
        with (tmp_path / "events").open("wb") as pipe:
            pipe.write(b"\n".join([whole[0], broken, whole[1], b""]))
    assert display.seen[0] == {"total": 2}
    assert display.seen[-1] == {"trials": 2, "steps": 1}


def test_a_half_line_before_the_end_is_no_obstacle(tmp_path: Path) -> None:
    """Listening ends, although the last event has no end of line."""
    before = threading.active_count()
    events = tmp_path / "events"
    with Spy() as display, display.listen(events), events.open("wb") as pipe:
        pipe.write(b'{"total": 3}\n{"tri')
    assert display.seen == [{"total": 3}]
    assert threading.active_count() == before


def test_listening_ends_when_nobody_ever_wrote(tmp_path: Path) -> None:
    """A notebook without trials, and one that fails, leave no thread behind."""
    before = threading.active_count()
    with Spy() as display, display.listen(tmp_path / "events"):
        pass
    with pytest.raises(ZeroDivisionError), display.listen(tmp_path / "again"):
        raise ZeroDivisionError
    assert threading.active_count() == before
    assert display.seen == []


def test_a_log_that_is_closed_does_not_stop_the_kernel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """When lines cannot be written, as behind `| head`, events are still taken from the pipe."""

    class Closed(io.StringIO):
        def write(self, _: str) -> int:
            raise BrokenPipeError

    monkeypatch.setattr(sys, "stderr", Closed())
    monkeypatch.setenv(EVENTS, str(tmp_path / "events"))
    with Spy() as display, display.listen(tmp_path / "events"), trial_meter(9000) as report:
        for _ in range(9000):  # more than a pipe holds
            report(1, 1)
    assert len(display.seen) == 9002
