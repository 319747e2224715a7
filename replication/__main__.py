"""The process of the command `replicate`: its signals, its streams and its environment.

All this is set up before anything slow is imported, so that Ctrl-C is quiet from then on. What the
interpreter itself does before, in its first 30 ms or so, is out of reach.
"""

from __future__ import annotations

import atexit
import io
import os
import signal
import sys
from contextlib import suppress
from typing import Any, NoReturn

UNUSED = (
    *("MPLBACKEND", "MATPLOTLIBRC", "SOURCE_DATE_EPOCH"),
    *("NUMBA_DISABLE_JIT", "NUMBA_NUM_THREADS"),
)
"""Variables of libraries that no result depends on, and of which a wrong one ends them."""


def main() -> None:
    """Run the command."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, stop)
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    sys.unraisablehook = _interrupt_again
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        # At exit Python restores the default handler; ignore the signal instead.
        atexit.register(signal.signal, number, signal.SIG_IGN)
    for stream in range(3):
        _open(stream)
    sys.stdout, sys.stderr = _stream(1, sys.stdout), _stream(2, sys.stderr)
    for name in UNUSED:
        os.environ.pop(name, None)
    from replication.cli import app

    try:
        app()
    except KeyboardInterrupt:
        stop()


def stop(*_: object) -> NoReturn:
    """End at once: the handler of signals while there is nothing to clean up."""
    with suppress(OSError):
        os.write(2, b"error: interrupted\n")
    os._exit(130)


def _interrupt_again(lost: Any) -> None:
    """Repeat an interruption that hit code whose errors Python drops, such as a `__del__`."""
    if isinstance(lost.exc_value, KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, 0.01)
    else:
        sys.__unraisablehook__(lost)


class _Output(io.FileIO):
    """A standard stream: what nobody reads any more is dropped, and the command goes on."""

    lost = False

    def write(self, data: Any) -> int:
        if not self.lost:
            try:
                return super().write(data)
            except OSError as error:
                self.lost = True  # what is still to be written would fail again at exit
                if self.fileno() == 1 and not isinstance(error, BrokenPipeError):
                    error.filename = "standard output"
                    raise
        return len(data)


def _open(number: int) -> None:
    """Let a standard stream that is closed go nowhere, else the next file would take its place."""
    try:
        os.fstat(number)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_RDWR), number)


def _stream(number: int, before: Any) -> io.TextIOWrapper:
    """Return a standard stream that can take any text."""
    raw = io.BufferedWriter(_Output(number, "wb", closefd=False))
    encoding = before.encoding if before else "utf-8"
    return io.TextIOWrapper(raw, encoding, "backslashreplace", line_buffering=True)


if __name__ == "__main__":
    main()
