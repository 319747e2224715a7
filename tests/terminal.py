"""A terminal for tests: a process in one, and what its screen shows."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
from contextlib import suppress
from pathlib import Path
from typing import Any


def in_terminal(*words: str, columns: int, cwd: Path, **environment: str) -> str:
    """Run Python in a pseudo-terminal; return all that it has written there."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    given: dict[str, Any] = {"stdin": theirs, "stdout": theirs, "stderr": theirs}
    hidden = ("COLUMNS", "LINES", "NO_COLOR")
    env = {name: value for name, value in os.environ.items() if name not in hidden}
    process = subprocess.Popen(
        [sys.executable, *words], cwd=cwd, env=env | {"TERM": "xterm"} | environment, **given
    )
    os.close(theirs)
    told = b""
    with suppress(OSError):  # which is how a terminal says that nobody writes any more
        while more := os.read(ours, 65536):
            told += more
    os.close(ours)
    process.wait()
    return told.decode().replace("\r\n", "\n")


def screen(told: str, columns: int) -> list[str]:
    """Return the lines that a terminal shows once something was written to it."""
    rows: list[list[str]] = [[]]
    at = row = 0
    for part in re.findall(r"\x1b\[[0-9;]*[A-Za-z]|.|\n", told):
        if part == "\n":
            row, at = row + 1, 0
        elif part == "\r":
            at = 0
        elif part == "\x1b[A":
            row = max(row - 1, 0)
        elif not part.startswith("\x1b"):
            if at == columns:
                row, at = row + 1, 0
            rows += [[] for _ in range(row + 1 - len(rows))]
            line = rows[row]
            line += " " * (at + 1 - len(line))
            line[at] = part
            at += 1
        rows += [[] for _ in range(row + 1 - len(rows))]
    return ["".join(line) for line in rows]


CONTROLLED = (
    "import fcntl, os, signal, sys, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); "
    "signal.signal(signal.SIGINT, signal.SIG_DFL); "
    "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
)
"""Makes standard input the terminal whose Ctrl-C interrupts, then runs Python.

Processes of a shell's background ignore Ctrl-C, and so would what they start.
"""

PATIENCE = 300.0
"""Seconds after which a screen that does not come is a failure."""


class Typist:
    """Someone at a terminal in which Python runs: presses keys and looks at the screen."""

    def __init__(
        self, *words: str, cwd: Path, columns: int = 80, lines: int = 24, **environment: str
    ) -> None:
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))
        self.before = termios.tcgetattr(theirs)
        given: dict[str, Any] = {"stdin": theirs, "stdout": theirs, "stderr": theirs}
        hidden = ("COLUMNS", "LINES", "NO_COLOR")
        env = {name: value for name, value in os.environ.items() if name not in hidden}
        self.process = subprocess.Popen(
            [sys.executable, "-c", CONTROLLED, *words],
            cwd=cwd,
            env=env | {"TERM": "xterm"} | environment,
            start_new_session=True,
            **given,
        )
        self._theirs = theirs  # kept open, so that its settings can be looked at in the end
        self._told = b""

    @property
    def told(self) -> str:
        """All that was written to the terminal."""
        return self._told.decode(errors="replace").replace("\r\n", "\n")

    @property
    def screen(self) -> str:
        """What the terminal shows, without colours."""
        return re.sub(r"\x1b\[[?0-9;]*[A-Za-z]", "", self.told.split("\x1b[H")[-1])

    @property
    def settings(self) -> list[Any]:
        """How the terminal is set."""
        return termios.tcgetattr(self._theirs)

    def see(self, text: str) -> str:
        """Wait until the screen shows a text; return the screen."""
        while text not in self.screen:
            assert select.select([self._ours], [], [], PATIENCE)[0], self.screen
            self._told += os.read(self._ours, 65536)
        return self.screen

    def press(self, keys: str | bytes, text: str) -> str:
        """Press keys, and wait until the screen shows a text."""
        os.write(self._ours, keys.encode() if isinstance(keys, str) else keys)
        return self.see(text)

    def close(self) -> None:
        """Close the terminal."""
        os.close(self._theirs)
        os.close(self._ours)

    def end(self) -> int:
        """Wait for the end of the process; return its exit code."""
        while self.process.poll() is None:
            if select.select([self._ours], [], [], 0.1)[0]:
                self._told += os.read(self._ours, 65536)
        while select.select([self._ours], [], [], 0)[0]:
            self._told += os.read(self._ours, 65536)
        return self.process.returncode
