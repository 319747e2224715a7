"""Progress reports: bars on a terminal, a line every 10 % in a log.

A notebook's kernel does not draw. It keeps a line of JSON in the file that the environment variable
REPLICATION_EVENTS names; the process that runs the notebooks polls that file and shows it.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Self

from tqdm import tqdm

EVENTS = "REPLICATION_EVENTS"
"""Environment variable with the file in which a kernel reports its progress."""

SCHEDULER = "REPLICATION_SCHEDULER"
"""Environment variable with the address of a Dask scheduler that trials are sent to."""

GIVEN = "REPLICATION_GIVEN"
"""Environment variable with the folder of a table of trials that is read instead of computed."""

PAUSE = 0.1
"""Seconds between two reports of a kernel."""

Report = Callable[[int, int], None]
"""Takes how many trials finished, and how many learning steps they took."""


@contextmanager
def trial_meter(total: int, progress: bool | None = None) -> Iterator[Report]:
    """Report the progress of trials.

    Parameters
    ----------
    total
        Number of trials to come.
    progress
        Whether to draw a bar; None reports to the process that runs the notebook if there is one,
        and otherwise draws a bar on a terminal.
    """
    file = os.environ.get(EVENTS)
    if progress is None and file:
        yield _reporter(Path(file), total)
        return
    shown = sys.stderr.isatty() if progress is None else progress
    with TrialBar(total, shown=shown) as bar:
        yield bar.update


def _reporter(file: Path, total: int) -> Report:
    """Return a report that keeps the sums in a file, which is replaced as a whole."""
    began = time.monotonic_ns()  # tells this set of trials from the one before
    trials = steps = 0
    last = -PAUSE

    def report(more: int, more_steps: int) -> None:
        nonlocal trials, steps, last
        trials, steps = trials + more, steps + more_steps
        now = time.monotonic()
        if now - last >= PAUSE or trials >= total:
            last = now
            draft = file.with_suffix(".new")
            draft.write_text(json.dumps([began, total, trials, steps]), encoding="utf-8")
            draft.replace(file)

    report(0, 0)
    return report


class TrialBar:
    """A bar of trials with rate and time left; in a log, a line every 10 %.

    Parameters
    ----------
    total
        Number of trials to come.
    shown
        Whether to draw a bar.
    lines
        Whether to write lines to stderr.
    position
        Line of the terminal, from the first bar on.
    """

    def __init__(self, total: int, *, shown: bool, lines: bool = False, position: int = 0) -> None:
        self.trials = self.steps = 0
        self._total, self._tenth, self._lines = total, 0, lines
        self._began = time.monotonic()
        self._bar = tqdm(
            total=total, unit="trial", disable=not shown, leave=False, position=position
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Remove the bar."""
        self._bar.close()

    def update(self, trials: int, steps: int) -> None:
        """Count trials that finished, and their learning steps."""
        self.trials += trials
        self.steps += steps
        elapsed = max(time.monotonic() - self._began, 1e-9)
        rate = _rate(self.steps / elapsed)
        self._bar.update(trials)
        self._bar.set_postfix_str(rate)
        tenth = 10 * self.trials // self._total
        if self._lines and tenth > self._tenth:
            self._tenth = tenth
            left = _duration(elapsed * (self._total - self.trials) / self.trials)
            text = f"  {10 * tenth:3d} % of {self._total} trials, {rate}, {left} left"
            with suppress(OSError):  # nobody reads the log, as behind `| head`
                tqdm.write(text, file=sys.stderr)


class Display:
    """The progress of a run of notebooks, and of the trials in each: two bars, or lines.

    Parameters
    ----------
    notebooks
        Number of notebooks to come.
    bars
        Whether to draw bars on stderr; otherwise trials are reported as lines there.

    Attributes
    ----------
    computed
        How many trials the notebook that is running has computed.
    """

    def __init__(self, notebooks: int, *, bars: bool) -> None:
        self.computed = 0
        self._bars = bars
        self._began = 0
        self._trials: TrialBar | None = None
        self._notebooks = tqdm(
            total=notebooks, unit="notebook", disable=not bars, leave=False, position=0
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._close_trials()
        self._notebooks.close()

    def begin(self, name: str) -> None:
        """Name the notebook that is running."""
        self.computed = 0
        self._notebooks.set_description(name)

    def end(self) -> None:
        """Count a notebook that has run."""
        self._close_trials()
        self._notebooks.update()

    def poll(self, file: Path) -> None:
        """Show what a kernel has reported in a file, see :func:`trial_meter`."""
        try:
            began, total, trials, steps = map(int, json.loads(file.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):  # no report, or not one of ours
            return
        if began != self._began or self._trials is None:
            self._close_trials()
            self._began = began
            self._trials = TrialBar(total, shown=self._bars, lines=not self._bars, position=1)
        if trials > self._trials.trials:
            self.computed += trials - self._trials.trials
            self._trials.update(trials - self._trials.trials, steps - self._trials.steps)

    def _close_trials(self) -> None:
        if self._trials is not None:
            self._trials.close()
            self._trials = None


def _rate(steps: float) -> str:
    """Return a number of steps a second.

    Examples
    --------
    >>> _rate(2.13e8), _rate(76_000)
    ('213 M steps/s', '76 k steps/s')
    """
    return f"{steps / 1e6:.0f} M steps/s" if steps >= 1e6 else f"{steps / 1e3:.0f} k steps/s"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"
