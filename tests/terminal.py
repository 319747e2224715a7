"""A terminal for tests: a process in one, and what its screen shows."""

from __future__ import annotations

import fcntl
import os
import pty
import re
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
