"""Recording by hand in a terminal: :func:`record`, its keys and its screen."""

from __future__ import annotations

import codecs
import os
import re
import select
import shutil
import sys
import termios
import tty
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium

from replication.demos.files import load_demos, save_demos
from replication.demos.model import Demos
from replication.envs.environment import Environment
from replication.errors import UserError
from replication.files import check_writable, read_file
from replication.recording.keys import split_keys
from replication.recording.recorder import Recorder
from replication.recording.worlds import as_world

POLL = 0.25
"""Seconds between two looks at the terminal's size."""

ESCAPE_PAUSE = 0.05
"""Seconds in which the rest of an arrow key's characters come, if it is one."""

_OPEN = "\x1b[?1049h\x1b[?25l\x1b[?7l"  # the other screen, without cursor and wrapped lines
_CLOSE = "\x1b[?7h\x1b[?25h\x1b[?1049l"


def record(
    environment: Environment | gymnasium.Env[Any, Any],
    path: str | os.PathLike[str] | None = None,
    task: str | None = None,
) -> Demos:
    """Let someone demonstrate by keys in this terminal.

    Parameters
    ----------
    environment
        A maze, a task, or a Gymnasium environment with numbered states and actions.
    path
        A demonstration file that is written whenever a demonstration is finished. If it is there
        already, its demonstrations are kept.
    task
        Name of the task; that of the file by default.

    Returns
    -------
    Demos
        All that was finished, also if Ctrl-C ended it and no `path` was given.

    Raises
    ------
    UserError
        If this is no terminal, if the file is of another environment or cannot be used, or if
        nothing was finished.
    """
    _check_terminal()
    world = as_world(environment)
    if path is not None:
        check_writable(Path(path).absolute().parent)
    present = known = None
    if path is not None and Path(path).exists():
        known = read_file(path)
        present = load_demos(path, task=world.environment)
    name = present.task if present else task or _task_name(path)

    def save(demos: Demos) -> None:
        nonlocal known
        if path is None:
            return
        if Path(path).exists() and read_file(path) != known:
            raise UserError(f"{path} was changed elsewhere; move it away, and keep this again")
        save_demos(demos, path)
        known = read_file(path)

    recorder = Recorder(world, name, present, save)
    try:
        _run(recorder)
    except KeyboardInterrupt:
        if path is not None or recorder.demos is None:
            raise
    if recorder.demos is None:
        raise UserError("nothing was recorded; finish a demonstration by Enter")
    return recorder.demos


def _check_terminal() -> None:
    """Refuse to record where there is no terminal; raises `UserError`."""
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise UserError(
            "recording needs a terminal; elsewhere write the demonstrations as a CSV file for "
            "`read_csv`, or as lists of actions for `make_demos`"
        )


def _task_name(path: str | os.PathLike[str] | None) -> str:
    """Return the name of a file as that of a task."""
    stem = "" if path is None else Path(path).stem
    return re.sub(r"[^A-Za-z0-9]+", "-", stem).strip("-") or "recorded"


def _run(recorder: Recorder) -> None:
    """Show the recorder's screen and pass keys on until the user or the terminal is gone."""
    shown: object = None
    with _terminal() as (read, write), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # would be written across the screen
        while not recorder.done:
            size = shutil.get_terminal_size()
            text = recorder.screen(*size)
            if (text, size) != shown:
                write(text)
                shown = (text, size)
            keys = read(recorder.pause or POLL)
            if keys is None:
                return
            for key in keys:
                recorder.press(key)
            if not keys:
                recorder.tick()


@contextmanager
def _terminal() -> Iterator[tuple[Callable[[float], list[str] | None], Callable[[str], None]]]:
    """Make each key arrive at once and unseen; whatever happens, all is as before in the end."""
    number = sys.stdin.fileno()
    decoder = codecs.getincrementaldecoder("utf-8")("replace")
    begun = ""

    def read(pause: float) -> list[str] | None:
        """Return the keys that came within a time; None if no more can come."""
        nonlocal begun
        if not select.select([number], [], [], ESCAPE_PAUSE if begun else pause)[0]:
            alone, begun = begun, ""
            return ["escape"] if alone else []
        try:
            data = os.read(number, 1024)
        except OSError:  # how a terminal says that it was closed
            return None
        keys, begun = split_keys(begun + decoder.decode(data))
        return keys if data else None

    def write(text: str) -> None:
        plain = re.sub(r"\x1b\[[0-9;]*m", "", text) if os.environ.get("NO_COLOR") else text
        lines = "\x1b[0m\r\n\x1b[K".join(plain.split("\n"))
        sys.stdout.write(f"\x1b[H\x1b[K{lines}\x1b[0m\x1b[J")
        sys.stdout.flush()

    before = termios.tcgetattr(number)
    try:
        tty.setcbreak(number)
        during = termios.tcgetattr(number)
        during[6][termios.VSUSP] = b"\0"  # Ctrl-Z would leave the shell on this screen
        termios.tcsetattr(number, termios.TCSADRAIN, during)
        sys.stdout.write(_OPEN)
        yield read, write
    finally:
        termios.tcsetattr(number, termios.TCSADRAIN, before)
        sys.stdout.write(_CLOSE)
        sys.stdout.flush()
