"""Progress that a person can live with: bars on a terminal, a line each 10 % in a log.

A notebook's kernel does not draw. It sends events to the process that runs the notebooks, through
the pipe that the environment variable REPLICATION_EVENTS names, and that process shows them.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Self, TextIO

from tqdm import tqdm

EVENTS = "REPLICATION_EVENTS"

Report = Callable[[int, int], None]
"""Told how many trials finished, and how many learning steps they took."""


@contextmanager
def trial_meter(total: int, progress: bool | None = None) -> Iterator[Report]:
    """Report the progress of trials.

    Parameters
    ----------
    total
        Number of trials to come.
    progress
        Whether to draw a bar; None reports to the process that runs the notebook if there is one,
        and else draws a bar on a terminal.
    """
    pipe = os.environ.get(EVENTS)
    if progress is None and pipe:
        with Path(pipe).open("w", encoding="utf-8") as events:

            def send(**event: Any) -> None:
                print(json.dumps(event), file=events, flush=True)

            send(total=total)
            yield lambda trials, steps: send(trials=trials, steps=steps)
            send(total=0)
        return
    shown = sys.stderr.isatty() if progress is None else progress
    with TrialBar(total, shown=shown) as bar:
        yield bar.update


class TrialBar:
    """A bar of trials with rate and time left; in a log, a line each 10 %.

    Parameters
    ----------
    total
        Number of trials to come.
    shown
        Whether to draw a bar.
    lines
        Where to write lines instead, if anywhere.
    position
        Line of the terminal, from the first bar on.
    """

    def __init__(
        self, total: int, *, shown: bool, lines: TextIO | None = None, position: int = 0
    ) -> None:
        self._lines = lines
        self._total, self._done, self._steps, self._said = total, 0, 0, 0
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
        self._done += trials
        self._steps += steps
        elapsed = max(time.monotonic() - self._began, 1e-9)
        rate = _rate(self._steps / elapsed)
        self._bar.update(trials)
        self._bar.set_postfix_str(rate)
        tenth = 10 * self._done // self._total
        if self._lines is not None and tenth > self._said:
            self._said = tenth
            left = elapsed * (self._total - self._done) / self._done
            said = f"{10 * tenth:3d} % of {self._total} trials, {rate}, {_duration(left)} left"
            print(f"  {said}", file=self._lines, flush=True)


class Display:
    """The progress of a run of notebooks, and of the trials in each: two bars, or lines.

    Parameters
    ----------
    notebooks
        Number of notebooks to come.
    bars
        Whether to draw bars on stderr; otherwise trials are reported as lines there.
    """

    def __init__(self, notebooks: int, *, bars: bool) -> None:
        self._bars = bars
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
        """Say which notebook is running."""
        self._notebooks.set_description(name)

    def end(self) -> None:
        """Count a notebook that has run."""
        self._close_trials()
        self._notebooks.update()

    def event(self, event: dict[str, Any]) -> None:
        """Show an event of :func:`trial_meter`."""
        if "total" in event:
            self._close_trials()
            if event["total"]:
                lines = None if self._bars else sys.stderr
                self._trials = TrialBar(event["total"], shown=self._bars, lines=lines, position=1)
        elif self._trials is not None:
            self._trials.update(event["trials"], event["steps"])

    @contextmanager
    def listen(self, pipe: Path) -> Iterator[None]:
        """Show the events that come through a pipe, which is made for it."""
        os.mkfifo(pipe)
        # Open at both ends, the pipe neither blocks nor ends while kernels come and go.
        reader = os.open(pipe, os.O_RDWR)

        def read() -> None:
            with os.fdopen(reader, encoding="utf-8", errors="replace") as events:
                for line in events:
                    if line.endswith("end\n"):
                        return
                    # What a killed kernel left half-written; a reader that ends blocks kernels.
                    with suppress(ValueError, KeyError, TypeError, OSError):
                        self.event(json.loads(line))

        thread = threading.Thread(target=read, daemon=True)
        thread.start()
        try:
            yield
        finally:
            with pipe.open("w", encoding="utf-8") as last:
                last.write("end\n")
            thread.join(timeout=5)

    def _close_trials(self) -> None:
        if self._trials is not None:
            self._trials.close()
            self._trials = None


def _rate(steps: float) -> str:
    """Return a number of steps a second; those of physics are dear.

    Examples
    --------
    >>> _rate(2.13e8), _rate(76_000)
    ('213 M steps/s', '76 k steps/s')
    """
    return f"{steps / 1e6:.0f} M steps/s" if steps >= 1e6 else f"{steps / 1e3:.0f} k steps/s"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"
