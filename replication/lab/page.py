"""The page of the lab: one text that needs no other file and no network."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import t

from replication.demos.maze_expert import Expert
from replication.demos.model import Demo, Demos
from replication.envs.maze import as_maze
from replication.evidence.experiments import condition_of
from replication.evidence.tables import read_table
from replication.evidence.variations import maze_demos
from replication.irl import METHODS
from replication.paper.params import Params
from replication.paper.register import load_choices
from replication.report.readable import full_label

MAZES = {
    "open": "the paper's open maze",
    "obstacles": "the paper's maze with obstacles",
    **{f"random-{k}": f"random maze {k}" for k in range(1, 6)},
}
"""The mazes that the lab offers, by their names in the sensitivity analysis."""

SWITCHES = {
    "f_index": "reading of F",
    "alpha": "alpha",
    "f_start": "F_0",
    "q_start": "Q at each iteration",
}
"""The parameters that can be chosen, by their fields."""

FIELDS = (
    *("beta", "gamma", "epsilon", "episodes", "horizon", "q_start", "ties", "tie_tolerance"),
    *("threshold", "max_iterations", "w_start", "rollout_ties"),
    *("f_index", "alpha", "f_start", "adaboost_rule", "adaboost_margin"),
)
"""The parameters that the lab's trials take; others stay as they are registered."""

TASKS = ("open-maze", "obstacle-maze")
"""The tasks whose published trials can be checked."""

DIGITS = 4
"""Of the 16 digits of each published digest the page holds so many."""

MOST = 100
"""Trials of a method that can be run at once."""


def lab_part(figures: Path | None = None) -> str:
    """Return the lab as a part of a page, in HTML.

    Parameters
    ----------
    figures
        Folder of the published results, whose trials can then be checked.
    """
    worker = ("numbers", "learner", "irl", "worker")
    page = ("maze", "pictures", "app", "pool", "watch", "editor", "many", "published", "begin")
    data = json.dumps(lab_data(figures), ensure_ascii=False, separators=(",", ":"))
    parts = {
        "STYLE": _text("lab.css"),
        "DIGITS": str(DIGITS),
        "DATA": data.replace("</", "<\\/"),
        "WORKER": _scripts(worker),
        "PAGE": _scripts(page),
    }
    text = _text("lab.html")
    for name, part in parts.items():
        text = text.replace(f"@{name}@", part)
    return text


def lab_page(figures: Path | None = None) -> str:
    """Return the lab as a page of its own."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        "<title>The maze lab</title>\n"
        "<style>html { color-scheme: light dark; } body { font-family: system-ui, sans-serif; "
        "max-width: 66rem; margin: 1rem auto; padding: 0 1rem; }</style>\n"
        f"</head>\n<body>\n<main>\n<h1>The maze lab</h1>\n{lab_part(figures)}</main>\n</body>\n"
        "</html>\n"
    )


class Lab:
    """The lab in a cell of a notebook; what is drawn there comes to Python as a saved file."""

    def _repr_html_(self) -> str:
        """Return a frame that holds the page."""
        page = html.escape(lab_page())
        return f'<iframe title="The maze lab" srcdoc="{page}" width="100%" height="900"></iframe>'


def lab_data(figures: Path | None = None) -> dict[str, Any]:
    """Return all that the page's scripts know of the package, as plain JSON values."""
    choices = {entry.field: entry for entry in load_choices().values()}
    values = Params().values()
    worlds = {name: maze_demos(name, Expert()) for name in MAZES}
    usual = Params().demonstrations.incorrect.split("+")
    kinds = worlds["open"].kinds
    return {
        "wasm": base64.b64encode(_bytes("learner.wasm")).decode(),
        "params": {field: values[field] for field in FIELDS},
        "choices": [
            {
                "field": field,
                "label": label,
                "place": f"{entry.id}: {entry.open}",
                "values": sorted({entry.default, *entry.alternatives}),
            }
            for field, label in SWITCHES.items()
            for entry in [choices[f"{'Learner' if field == 'q_start' else 'Update'}.{field}"]]
        ],
        "methods": [
            {
                "name": method.name,
                "label": method.label,
                "colour": method.colour,
                "marks": method.uses_incorrect,
            }
            for method in METHODS.values()
        ],
        "mazes": [_drawing(demos, MAZES[name]) for name, demos in worlds.items()],
        "kinds": kinds,
        "leftOut": [kind for kind in kinds if kind not in usual],
        "published": _published(figures),
        "quantiles": t.ppf(0.975, np.arange(1, MOST)).tolist(),
    }


def _drawing(demos: Demos, title: str) -> dict[str, Any]:
    def packed(demo: Demo) -> dict[str, str]:
        actions = "".join(map(str, demo.actions))
        return {"name": demo.name, "kind": demo.kind, "actions": actions}

    return {
        "title": title,
        "task": demos.task,
        "description": demos.description,
        "rows": as_maze(demos.environment).rows,
        "correct": [packed(demo) for demo in demos.correct],
        "incorrect": [packed(demo) for demo in demos.incorrect],
    }


def _published(figures: Path | None) -> dict[str, Any]:
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


def _bytes(name: str) -> bytes:
    return resources.files(__package__).joinpath(name).read_bytes()


def _scripts(names: tuple[str, ...]) -> str:
    return "\n".join(_text(f"{name}.js") for name in names)


def _text(name: str) -> str:
    return _bytes(name).decode()
