"""Finished trials on disk: a SQLite file that survives a kill and never mixes up its contents.

A trial is filed under a key that is a hash of all that determines it (see
:func:`replication.trials.compute.trial_key`); what is stored under a key never changes. SQLite commits a
whole batch of trials or none of it.
"""

from __future__ import annotations

import json
import math
import sqlite3
import sys
import threading
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replication.irl import Snapshots, Trial
from replication.irl.agent import Episode

_SCHEMA = """
CREATE TABLE IF NOT EXISTS trials (key TEXT PRIMARY KEY, record BLOB NOT NULL, snapshots BLOB)
"""


class DamagedTrialError(ValueError):
    """A stored trial cannot be read back."""


class Store:
    """Trials by key.

    Parameters
    ----------
    path
        The SQLite file; it and its folder are made when missing. A file that is damaged is set
        aside, with a message, and a new one begun.

    Raises
    ------
    OSError
        If the file can be neither used nor made.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._local = threading.local()
        try:
            self._check()
        except sqlite3.OperationalError as error:
            raise OSError(f"{self.path}: the store cannot be used: {error}") from None
        except sqlite3.DatabaseError as error:
            self._set_aside(str(error))
            self._check()

    def __reduce__(self) -> tuple[type[Store], tuple[Path]]:
        """Copy and pickle the path alone; a copy has connections of its own."""
        return Store, (self.path,)

    def __contains__(self, key: str) -> bool:
        return bool(self.known([key]))

    def known(self, keys: Iterable[str]) -> set[str]:
        """Return those of the keys that are stored."""
        query = "SELECT 1 FROM trials WHERE key = ?"
        return {key for key in keys if self._connection.execute(query, (key,)).fetchone()}

    def put(self, trials: Iterable[tuple[str, Trial]]) -> None:
        """Store trials under their keys, all of them or, when interrupted, none."""
        rows = [(key, _pack(trial), _pack_snapshots(trial.snapshots)) for key, trial in trials]
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
            return _unpack(*row)
        except (zlib.error, ValueError, KeyError, TypeError) as error:
            raise DamagedTrialError(f"{self.path}: trial {key}: {error!r}") from None

    def drop(self, key: str) -> None:
        """Remove what is stored under a key."""
        with self._connection as connection:
            connection.execute("DELETE FROM trials WHERE key = ?", (key,))

    @property
    def _connection(self) -> sqlite3.Connection:
        """The connection of the running thread."""
        if not hasattr(self._local, "connection"):
            self._local.connection = sqlite3.connect(self.path, timeout=60.0)
        connection: sqlite3.Connection = self._local.connection
        return connection

    def _check(self) -> None:
        with self._connection as connection:
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = NORMAL")
            connection.execute(_SCHEMA)
            (said,) = connection.execute("PRAGMA quick_check(1)").fetchone()
        if said != "ok":
            raise sqlite3.DatabaseError(said.splitlines()[-1])

    def _set_aside(self, why: str) -> None:
        self._local.connection.close()
        del self._local.connection
        number = 1
        while (aside := self.path.with_name(f"{self.path.name}.damaged-{number}")).exists():
            number += 1
        self.path.replace(aside)
        for suffix in ("-wal", "-shm"):
            self.path.with_name(self.path.name + suffix).unlink(missing_ok=True)
        print(
            f"{self.path} is damaged ({why}): set aside as {aside.name}; its trials are computed "
            "again",
            file=sys.stderr,
        )


_ARRAYS = ("errors", "weights", "q", "values")


def _pack(trial: Trial) -> bytes:
    states, actions, hits = map(np.concatenate, zip(*trial.episodes, strict=True))
    return _packed(
        {
            **{name: getattr(trial, name) for name in _ARRAYS},
            "converged": np.array(trial.converged),
            "steps": np.array(trial.steps),
            "lengths": np.array([len(episode.actions) for episode in trial.episodes]),
            "states": states.astype(np.min_scalar_type(states.max())),
            "actions": actions.astype(np.min_scalar_type(actions.max(initial=0))),
            "hits": hits,
        }
    )


def _pack_snapshots(snapshots: Snapshots | None) -> bytes | None:
    if snapshots is None:
        return None
    return _packed({"weights": snapshots.weights, "q": snapshots.q})


def _unpack(record: bytes, snapshots: bytes | None) -> Trial:
    stored = _unpacked(record)
    return Trial(
        converged=bool(stored["converged"]),
        steps=int(stored["steps"]),
        episodes=_episodes(stored),
        snapshots=None if snapshots is None else Snapshots(**_unpacked(snapshots)),
        **{name: stored[name] for name in _ARRAYS},
    )


def _episodes(stored: Mapping[str, NDArray[Any]]) -> tuple[Episode, ...]:
    states, actions = (
        stored["states"].astype(np.int64),
        stored["actions"].astype(np.int64),
    )
    found, at = [], 0
    for number, length in enumerate(stored["lengths"].tolist()):
        begin = at + number  # an episode has one more state than actions
        own = slice(at, at + length)
        found.append(Episode(states[begin : begin + length + 1], actions[own], stored["hits"][own]))
        at += length
    return tuple(found)


def _packed(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return arrays as bytes: a line that says what they are, and then their own bytes."""
    header = {name: [array.dtype.str, array.shape] for name, array in arrays.items()}
    parts = [
        json.dumps(header).encode(),
        b"\n",
        *(a.tobytes() for a in arrays.values()),
    ]
    return zlib.compress(b"".join(parts), 1)


def _unpacked(packed: bytes) -> dict[str, NDArray[Any]]:
    header, _, data = zlib.decompress(packed).partition(b"\n")
    arrays, at = {}, 0
    for name, (kind, shape) in json.loads(header).items():
        arrays[name] = np.frombuffer(data, kind, math.prod(shape), at).reshape(shape).copy()
        at += arrays[name].nbytes
    return arrays
