"""Finished trials on disk: a SQLite file that survives a kill and never mixes up its contents.

A trial is filed under a key that is a hash of all that determines it (see
:func:`replication.trials.trial_key`); what is stored under a key never changes. SQLite commits a
whole batch of trials or none of it.
"""

from __future__ import annotations

import io
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from replication.irl import Snapshots, Trial
from replication.tasks import Episode

_SCHEMA = """
CREATE TABLE IF NOT EXISTS trials (key TEXT PRIMARY KEY, record BLOB NOT NULL, snapshots BLOB)
"""


class Store:
    """Trials by key.

    Parameters
    ----------
    path
        The SQLite file; it and its folder are made when missing.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self._connection() as connection:
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute(_SCHEMA)

    def __contains__(self, key: str) -> bool:
        with self._connection() as connection:
            query = "SELECT 1 FROM trials WHERE key = ?"
            return connection.execute(query, (key,)).fetchone() is not None

    def known(self, keys: Iterable[str]) -> set[str]:
        """Return those of the keys that are stored."""
        with self._connection() as connection:
            query = "SELECT 1 FROM trials WHERE key = ?"
            return {key for key in keys if connection.execute(query, (key,)).fetchone()}

    def put(self, trials: Iterable[tuple[str, Trial]]) -> None:
        """Store trials under their keys, all of them or, when interrupted, none."""
        rows = [(key, _pack(trial), _pack_snapshots(trial.snapshots)) for key, trial in trials]
        with self._connection() as connection:
            connection.executemany("INSERT OR IGNORE INTO trials VALUES (?, ?, ?)", rows)

    def get(self, key: str, *, snapshots: bool = False) -> Trial:
        """Return a stored trial, with its snapshots when they are asked for and stored.

        Raises
        ------
        KeyError
            If nothing is stored under the key.
        """
        columns = "record, snapshots" if snapshots else "record, NULL"
        with self._connection() as connection:
            query = f"SELECT {columns} FROM trials WHERE key = ?"
            row = connection.execute(query, (key,)).fetchone()
        if row is None:
            raise KeyError(key)
        return _unpack(*row)

    @contextmanager
    def _connection(self) -> Iterator[sqlite3.Connection]:
        with closing(sqlite3.connect(self.path, timeout=60.0)) as connection, connection:
            yield connection


_ARRAYS = ("errors", "weights", "q", "values")


def _pack(trial: Trial) -> bytes:
    arrays = {name: getattr(trial, name) for name in _ARRAYS}
    states, actions, hits = map(np.concatenate, zip(*trial.episodes, strict=True))
    return _savez(
        converged=trial.converged,
        steps=trial.steps,
        lengths=np.array([len(episode.actions) for episode in trial.episodes]),
        states=states.astype(np.min_scalar_type(states.max())),
        actions=actions.astype(np.min_scalar_type(actions.max(initial=0))),
        hits=hits,
        **arrays,
    )


def _pack_snapshots(snapshots: Snapshots | None) -> bytes | None:
    if snapshots is None:
        return None
    return _savez(weights=snapshots.weights, q=snapshots.q)


def _unpack(record: bytes, snapshots: bytes | None) -> Trial:
    with np.load(io.BytesIO(record)) as stored:
        return Trial(
            converged=bool(stored["converged"]),
            steps=int(stored["steps"]),
            episodes=_unpack_episodes(stored),
            snapshots=_unpack_snapshots(snapshots),
            **{name: stored[name] for name in _ARRAYS},
        )


def _unpack_episodes(stored: Mapping[str, Any]) -> tuple[Episode, ...]:
    ends = np.cumsum(stored["lengths"])[:-1]
    states = np.split(stored["states"].astype(np.int64), ends + np.arange(1, len(ends) + 1))
    actions = np.split(stored["actions"].astype(np.int64), ends)
    return tuple(map(Episode, states, actions, np.split(stored["hits"], ends)))


def _unpack_snapshots(snapshots: bytes | None) -> Snapshots | None:
    if snapshots is None:
        return None
    with np.load(io.BytesIO(snapshots)) as stored:
        return Snapshots(weights=stored["weights"], q=stored["q"])


def _savez(**arrays: object) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()
