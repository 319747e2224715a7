"""What the lab holds of the published trials of the mazes, to compute them again."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from replication.evidence.experiments import condition_of
from replication.evidence.tables import read_table
from replication.lab.tasks import FIELDS
from replication.paper.params import Params
from replication.report.readable import full_label

TASKS = ("open-maze", "obstacle-maze")
"""The tasks whose published trials can be checked."""

DIGITS = 4
"""Of the 16 digits of each published digest the page holds so many."""


def published(figures: Path | None) -> dict[str, Any]:
    """Return the conditions of the published trials, and the first digits of their digests."""
    groups: list[dict[str, Any]] = []
    digests = b""
    if figures is not None:
        for task in TASKS:
            for group, digits in _conditions(figures, task):
                groups.append(group | {"first": 2 * len(digests) // DIGITS})
                digests += digits
    return {
        "digits": DIGITS,
        "groups": groups,
        "digests": base64.b64encode(digests).decode(),
    }


def _conditions(figures: Path, task: str) -> Iterator[tuple[dict[str, Any], bytes]]:
    """Yield each condition of a task's published trials, and the digits, packed, in their order."""
    usual = Params().values()
    trials = read_table(figures / task.replace("-", "_") / "trials.csv").fillna("")
    for key, rows in trials.groupby(["method", "reading", "set"], sort=False):
        method, reading, set = map(str, key)
        values = condition_of(task, method, reading, set).params.values()
        yield (
            {
                "title": f"{task}: {full_label(method, reading, set)}",
                "task": task,
                "method": method,
                "reading": reading,
                "set": set,
                "params": {name: values[name] for name in FIELDS if values[name] != usual[name]},
                "seed": _only(rows["seed"]),
                "trials": len(rows),
            },
            b"".join(
                bytes.fromhex(text.removeprefix("sha256:")[:DIGITS])
                for text in rows.sort_values("trial")["digest"]
            ),
        )


def _only(values: pd.Series) -> int:
    """Return the one value of a column."""
    (value,) = values.unique()
    return int(value)
