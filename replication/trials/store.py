"""Finished trials on disk: an SQLite file that survives a kill and never mixes up its contents.

A trial is filed under a key that is a hash of all that determines it, see
:func:`replication.trials.compute.trial_key`; what is stored under a key never changes. SQLite
commits a whole batch of trials or none of it.

A trial's arrays are packed as a line of JSON that names them, followed by their own bytes, all
compressed by zlib. NumPy's npz holds the same in as few bytes, but takes six times as long to read,
and the sensitivity analysis reads tens of thousands of trials.
"""

from __future__ import annotations

import fcntl
import json
import math
import sqlite3
import stat
import sys
import zlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replication.errors import UserError
from replication.files import open_lock, printable, reason
from replication.irl import Snapshots, Trial
from replication.irl.agent import Episode

Arrays = Mapping[str, NDArray[Any]]

_SCHEMA = """
CREATE TABLE IF NOT EXISTS trials (key TEXT PRIMARY KEY, record BLOB NOT NULL, snapshots BLOB)
"""
_PLAIN = (
    "errors",
    "weights",
    "q",
    "collisions",
    "values",
    "rewards",
)  # the arrays that a trial has as they are


class DamagedTrialError(UserError):
    """A stored trial cannot be read back."""


class Store:
    """Trials by key; each thread and each process opens a store of its own.

    Parameters
    ----------
    path
        The SQLite file; it and its folder are made when missing. A damaged file is set aside, with
        a message, and a new one begun; what never was a store, and is not called so, stays.

    Raises
    ------
    UserError
        If there is something else in its place, or SQLite cannot use the file.
    OSError
        If its folder can be neither used nor made.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        for suffix in ("", "-journal", "-wal", "-shm"):
            file = self.path.with_name(self.path.name + suffix)
            with suppress(
                FileNotFoundError
            ):  # one look: another process may set it aside meanwhile
                if not stat.S_ISREG(file.stat().st_mode):
                    message = f"{printable(file)}: the store cannot be used: it is no regular file"
                    raise UserError(message)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        # SQLite does not wait for whoever is making the file, and a damaged one is set aside once
        with open_lock(self.path.with_name(f"{self.path.name}-lock")) as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            try:
                self._open()
            except (
                sqlite3.DatabaseError,
                UnicodeDecodeError,
            ) as error:  # SQLite may quote any bytes
                code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR)
                if isinstance(error, sqlite3.OperationalError) and code != sqlite3.SQLITE_ERROR:
                    message = f"{printable(path)}: the store cannot be used: {error}"
                    raise UserError(message) from None
                if code == sqlite3.SQLITE_NOTADB and self.path.suffix != ".sqlite":
                    message = f"{printable(path)} is no store of trials; give another file"
                    raise UserError(message) from None
                self._set_aside(str(error))
                self._open()

    def __contains__(self, key: str) -> bool:
        return bool(self.known([key]))

    def known(self, keys: Iterable[str]) -> set[str]:
        """Return those of the keys that are stored."""
        query = "SELECT 1 FROM trials WHERE key = ?"
        return {key for key in keys if self._connection.execute(query, (key,)).fetchone()}

    def put(self, trials: Iterable[tuple[str, Trial]]) -> None:
        """Store trials under their keys, all of them or, when interrupted, none."""
        rows = [(key, *pack_trial(trial)) for key, trial in trials]
        with self._connection as connection:
            connection.executemany("INSERT OR IGNORE INTO trials VALUES (?, ?, ?)", rows)

    def get(self, key: str, *, snapshots: bool = False) -> Trial:
        """Return a stored trial, with its snapshots when they are asked for and stored.

        Raises
        ------
        KeyError
            If nothing is stored under the key.
        DamagedTrialError
            If what is stored there cannot be read.
        """
        columns = "record, snapshots" if snapshots else "record, NULL"
        query = f"SELECT {columns} FROM trials WHERE key = ?"
        row = self._connection.execute(query, (key,)).fetchone()
        if row is None:
            raise KeyError(key)
        try:
            return unpack_trial(*row)
        except Exception as error:  # unpacking depends on the bytes alone: they are what is wrong
            raise DamagedTrialError(f"{self.path}: trial {key} is damaged: {error!r}") from None

    def drop(self, key: str) -> None:
        """Remove what is stored under a key."""
        with self._connection as connection:
            connection.execute("DELETE FROM trials WHERE key = ?", (key,))

    def _open(self) -> None:
        self._connection = sqlite3.connect(self.path, timeout=60.0)
        with self._connection as connection:
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = NORMAL")
            connection.execute(_SCHEMA)
            connection.execute("SELECT key, record, snapshots FROM trials LIMIT 0")
            # quick_check leaves out the index, by which each trial is found
            (verdict,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
        if verdict != "ok":
            raise sqlite3.DatabaseError(verdict.splitlines()[-1])

    def _set_aside(self, why: str) -> None:
        self._connection.close()
        try:
            aside = self.path.replace(self.path.with_name(f"{self.path.name}.damaged"))
            for suffix in ("-wal", "-shm"):
                self.path.with_name(self.path.name + suffix).unlink(missing_ok=True)
        except OSError as error:
            message = f"{printable(self.path)} is damaged and cannot be set aside: {reason(error)}"
            raise UserError(message) from None
        print(
            f"{self.path} is damaged ({why}): set aside as {aside.name}; its trials are computed "
            "again",
            file=sys.stderr,
        )


def pack_trial(trial: Trial) -> tuple[bytes, bytes | None]:
    """Return a trial as bytes, and its snapshots, if it has any, as others."""
    states, actions, hits = map(np.concatenate, zip(*trial.episodes, strict=True))
    record = {name: getattr(trial, name) for name in _PLAIN} | {
        "converged": np.array(trial.converged),
        "steps": np.array(trial.steps),
        "lengths": np.array([len(episode.actions) for episode in trial.episodes]),
        "states": states.astype(np.min_scalar_type(states.max())),
        "actions": actions.astype(np.min_scalar_type(actions.max(initial=0))),
        "hits": hits,
    }
    kept = trial.snapshots
    return _pack(record), None if kept is None else _pack({"weights": kept.weights, "q": kept.q})


def unpack_trial(record: bytes, snapshots: bytes | None) -> Trial:
    """Return the trial that was packed; without its snapshots if these are None."""
    arrays = _unpack(record)
    ends = np.cumsum(arrays["lengths"])[:-1]
    episodes = zip(
        # An episode has one state more than it has actions.
        np.split(arrays["states"].astype(np.int64), ends + np.arange(1, len(ends) + 1)),
        np.split(arrays["actions"].astype(np.int64), ends),
        np.split(arrays["hits"], ends),
        strict=True,
    )
    return Trial(
        converged=bool(arrays["converged"]),
        steps=int(arrays["steps"]),
        episodes=tuple(Episode(*parts) for parts in episodes),
        snapshots=None if snapshots is None else Snapshots(**_unpack(snapshots)),
        **{name: arrays[name] for name in _PLAIN},
    )


def _pack(arrays: Arrays) -> bytes:
    header = {name: [array.dtype.str, array.shape] for name, array in arrays.items()}
    parts = [json.dumps(header).encode(), b"\n", *(array.tobytes() for array in arrays.values())]
    return zlib.compress(b"".join(parts), 1)


def _unpack(packed: bytes) -> dict[str, NDArray[Any]]:
    header, _, data = zlib.decompress(packed).partition(b"\n")
    arrays, at = {}, 0
    for name, (kind, shape) in json.loads(header).items():
        arrays[name] = np.frombuffer(data, kind, math.prod(shape), at).reshape(shape).copy()
        at += arrays[name].nbytes
    return arrays
