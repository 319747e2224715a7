"""The published trials of the lab as data; that they are computed again is tested in a browser."""

from __future__ import annotations

import base64

import pandas as pd

from replication.files import PROJECT
from replication.lab.published import DIGITS, published

FIGURES = PROJECT / "figures"


def test_every_published_trial_of_the_mazes_is_there() -> None:
    """Each row of both tables has a place, and there the first digits of its digest."""
    data = published(FIGURES)
    digits = base64.b64decode(data["digests"]).hex()
    tables = [FIGURES / task / "trials.csv" for task in ("open_maze", "obstacle_maze")]
    trials = pd.concat([pd.read_csv(table, keep_default_na=False) for table in tables])
    assert len(digits) == DIGITS * len(trials)
    by_condition = trials.groupby(["task", "method", "reading", "set"])
    assert len(data["groups"]) == by_condition.ngroups
    for group in data["groups"]:
        names = tuple(group[name] for name in ("task", "method", "reading", "set"))
        rows = by_condition.get_group(names)
        at = DIGITS * group["first"]
        shown = digits[at : at + DIGITS * group["trials"]]
        assert shown == "".join(text[7 : 7 + DIGITS] for text in rows["digest"])
        assert set(rows["seed"]) == {group["seed"]}
