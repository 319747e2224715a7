"""What the lab holds of the multiverse: its specifications, and what is published of each."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np

from replication.evidence.claims import load_claims
from replication.evidence.specifications import default_of
from replication.evidence.sweep import CAP, PLAN, conditions_of, specifications
from replication.evidence.tables import read_table
from replication.irl import METHODS
from replication.lab.tasks import FIELDS, drawing
from replication.paper.register import load_choices
from replication.report import choices

CLAIMS = ("SAVES-OPEN", "FASTER", "FASTER-WITH")
"""The claims about iterations saved."""

PART = "factorial"
"""The part of the sweep that sets all choices at once."""

TASK = ("MAP", "DEMO-SHAPE")
"""The choices that decide the maze and its demonstrations."""


def multiverse(figures: Path | None) -> dict[str, Any]:
    """Return the specifications that set all choices at once, and what is published of them.

    A specification is a text with a digit for each choice: the place of its value. `iterations`
    are packed bytes [specification, method, trial]; a trial that did not converge has one more
    than the cap. Where nothing is published, there are none.
    """
    factorial = PLAN.mazes.factorial
    declared = [] if figures is None else specifications(PART)
    drawings = {}
    for number, specification in enumerate(declared):
        values = dict(specification.choices)
        name = " ".join(str(values[id]) for id in TASK)
        if name not in drawings:
            drawings[name] = drawing(conditions_of(PART, number)[0].demos, name)
    return {
        "seed": PLAN.root_seed,
        "cap": CAP,
        "trials": factorial.trials,
        "claims": [
            {"title": claim.claim, "x": claim.x, "y": claim.y}
            for claim in map(load_claims().by_id, CLAIMS)
        ],
        "choices": [
            {
                "id": id,
                "title": choices.title(id),
                "field": _field(id),
                "values": values,
                "labels": [choices.value(id, str(value)) for value in values],
                "usual": values.index(default_of(id)),
            }
            for id, values in factorial.choices.items()
        ],
        "specifications": [
            "".join(str(factorial.choices[id].index(value)) for id, value in one.choices)
            for one in declared
        ],
        "iterations": base64.b64encode(_iterations(figures)).decode(),
        "drawings": drawings,
    }


def _field(id: str) -> str | None:
    """Return the parameter of a trial that holds a choice; the task decides the others."""
    name = load_choices()[id].field.partition(".")[2] if id != "MAP" else ""
    return name if name in FIELDS else None


def _iterations(figures: Path | None) -> bytes:
    if figures is None:
        return b""
    trials = read_table(figures / "sensitivity" / "trials.csv")
    trials = trials[trials["part"] == PART]
    counts = trials["iterations"] + (trials["converged"] == 0)
    table = counts.groupby([trials["number"], trials["method"], trials["trial"]]).first().unstack()
    order = [(number, method) for number in range(len(specifications(PART))) for method in METHODS]
    return table.loc[order].to_numpy(np.uint8).tobytes()
