"""The page of the lab: one text that needs no other file and no network."""

from __future__ import annotations

import base64
import html
import json
import zlib
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t

from replication.demos.maze_expert import Expert
from replication.evidence.variations import maze_demos
from replication.irl import METHODS
from replication.lab.multiverse import multiverse
from replication.lab.published import DIGITS, published
from replication.lab.tasks import FIELDS, MAZES, drawing
from replication.paper.params import Params
from replication.paper.register import load_choices

SWITCHES = {
    "f_index": "reading of F",
    "alpha": "alpha",
    "f_start": "F_0",
    "q_start": "Q at each iteration",
}
"""The parameters that can be chosen, by their fields."""

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
    page = (
        *("maze", "pictures", "app", "pool"),
        *("watch", "editor", "many", "multiverse", "published", "begin"),
    )
    data = json.dumps(lab_data(figures), ensure_ascii=False, separators=(",", ":"))
    parts = {
        "STYLE": _text("lab.css"),
        "DIGITS": str(DIGITS),
        "DATA": base64.b64encode(zlib.compress(data.encode(), 9)).decode(),
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
        "mazes": [drawing(demos, MAZES[name]) for name, demos in worlds.items()],
        "kinds": kinds,
        "leftOut": [kind for kind in kinds if kind not in usual],
        "published": published(figures),
        "multiverse": multiverse(figures),
        "quantiles": t.ppf(0.975, np.arange(1, MOST)).tolist(),
    }


def _bytes(name: str) -> bytes:
    return resources.files(__package__).joinpath(name).read_bytes()


def _scripts(names: tuple[str, ...]) -> str:
    return "\n".join(_text(f"{name}.js") for name in names)


def _text(name: str) -> str:
    return _bytes(name).decode()
