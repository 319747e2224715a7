"""Progress reports: a bar on a terminal, a line in a notebook, a line every 10 % in a log.

The kernel of a run does not draw. It keeps a line of JSON in the file that the environment variable
REPLICATION_EVENTS names; the process that runs the notebooks polls that file and shows it. In a
notebook that is run by hand, such as in JupyterLab, the cell itself shows a line.
"""

from __future__ import annotations

import json
import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Self

from tqdm import tqdm

EVENTS = "REPLICATION_EVENTS"
"""Environment variable with the file in which a kernel reports its progress."""

SCHEDULER = "REPLICATION_SCHEDULER"
"""Environment variable with the address of a Dask scheduler that trials are sent to."""

GIVEN = "REPLICATION_GIVEN"
"""Environment variable with the folder of a table of trials that is read instead of computed."""

PAUSE = 0.1
"""Seconds between two reports of a kernel, or two changes of what is shown."""

TRIALS = "{desc}: {percentage:3.0f} %|{bar}| {n_fmt} of {total_fmt} trials{postfix}"
WAITING = "{desc}: {elapsed}"
"""How tqdm formats the bar while trials are computed, and otherwise."""

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
        else shows a line in the cell of a notebook, or draws a bar on a terminal.
    """
    file = os.environ.get(EVENTS)
    if progress is None and file:
        yield _reporter(Path(file), total)
        return
    line = _cell_output() if progress is None else None
    if line is not None:
        yield _teller(line, total)
        return
    if not (sys.stderr.isatty() if progress is None else progress):
        yield lambda *_: None
        return
    with Display(1, bars=True) as display:
        display.begin("computing")
        count = Count(total)

        def report(trials: int, steps: int) -> None:
            count.add(trials, steps)
            display.show(count)

        yield report


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


def _cell_output() -> Any:
    """Return an output of the notebook's cell that runs, which can be updated; None elsewhere."""
    if "IPython" not in sys.modules:
        return None
    from IPython import get_ipython
    from IPython.display import display

    if not hasattr(get_ipython(), "kernel"):
        return None
    return display({"text/plain": "trials: starting"}, raw=True, display_id=True)


def _teller(line: Any, total: int) -> Report:
    """Return a report that keeps an output of a cell up to date."""
    count = Count(total)
    last = -math.inf

    def report(trials: int, steps: int) -> None:
        nonlocal last
        count.add(trials, steps)
        now = time.monotonic()
        if now - last >= PAUSE or count.trials >= total:
            last = now
            line.update({"text/plain": count.line()}, raw=True)

    return report


class Count:
    """Counts trials and their learning steps, and says how far they are.

    Parameters
    ----------
    total
        Number of trials to come.
    """

    def __init__(self, total: int) -> None:
        self.total = total
        self.trials = self.steps = 0
        self._began = time.monotonic()

    @property
    def percent(self) -> int:
        """How many of a hundred trials finished."""
        return 100 * self.trials // self.total

    def add(self, trials: int, steps: int) -> None:
        """Count trials that finished, and their learning steps."""
        self.trials += trials
        self.steps += steps

    def pace(self) -> str:
        """Return the rate, and the time that is left, or that all of them took."""
        elapsed = max(time.monotonic() - self._began, 1e-9)
        rate = _rate(self.steps / elapsed)
        if self.trials >= self.total:
            return f"{rate}, took {_duration(elapsed)}"
        if not self.trials:
            return rate
        return f"{rate}, {_duration(elapsed * (self.total - self.trials) / self.trials)} left"

    def line(self) -> str:
        """Return how far the trials are."""
        return f"{self.percent} % of {self.total} trials, {self.pace()}"


class Display:
    """The progress of a run of notebooks, and of the trials in each: one bar, or lines.

    Parameters
    ----------
    notebooks
        Number of notebooks to come.
    bars
        Whether to draw a bar on stderr; otherwise each tenth of the trials has a line there.
    """

    def __init__(self, notebooks: int, *, bars: bool) -> None:
        self._notebooks, self._number = notebooks, 0
        self._bars = bars
        self._bar = tqdm(disable=True)
        self._began = self._tenth = 0
        self._count: Count | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def begin(self, name: str) -> None:
        """Name the notebook that is running."""
        self._number += 1
        of = f" ({self._number} of {self._notebooks})" if self._notebooks > 1 else ""
        self._bar = tqdm(
            desc=f"{name}{of}",
            bar_format=WAITING,
            disable=not self._bars,
            leave=False,
            dynamic_ncols=True,
            miniters=0,  # what is shown changes with the time, too
            mininterval=PAUSE,
        )

    def end(self) -> None:
        """Take the bar away."""
        self._bar.close()

    def poll(self, file: Path) -> None:
        """Show what a kernel has reported in a file, see :func:`trial_meter`."""
        self._bar.update(0)
        try:
            began, total, trials, steps = map(int, json.loads(file.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):  # no report, or not one of ours
            return
        if began != self._began or self._count is None:
            self._began, self._tenth, self._count = began, 0, Count(total)
        more = trials - self._count.trials
        if more > 0:
            self._count.add(more, steps - self._count.steps)
            self.show(self._count)

    def show(self, count: Count) -> None:
        """Show how far some trials are."""
        self._bar.total, self._bar.n = count.total, count.trials
        self._bar.bar_format = TRIALS if count.trials < count.total else WAITING
        self._bar.set_postfix_str(count.pace(), refresh=False)
        self._bar.update(0)
        tenth = count.percent // 10
        if not self._bars and tenth > self._tenth:
            self._tenth = tenth
            with suppress(OSError):  # nobody reads the log, as behind `| head`
                tqdm.write(f"  {count.line()}", file=sys.stderr)


@contextmanager
def iteration_meter() -> Iterator[Callable[[int, float], None]]:
    """Show on a terminal, in one line, how many weight updates there were, and the error."""
    shown = sys.stderr.isatty()
    with tqdm(bar_format="{desc}", disable=not shown, leave=False, mininterval=PAUSE) as bar:
        bar.miniters = 0

        def report(iteration: int, error: float) -> None:
            bar.set_description_str(f"iteration {iteration}, d = {error:.4g}", refresh=False)
            bar.update(0)

        yield report


@contextmanager
def between_bars() -> Iterator[None]:
    """Let lines be printed where a bar may stand: it is taken away, and drawn again below them."""
    with tqdm.external_write_mode(file=sys.stdout):
        yield


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
