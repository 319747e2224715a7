"""The multiverse of the lab as data; what the page does with it is tested in a browser."""

from __future__ import annotations

import base64

import numpy as np
import pandas as pd

from replication.evidence.specifications import factorial_specifications, load_specifications
from replication.evidence.sweep import conditions_of
from replication.files import PROJECT
from replication.irl import METHODS
from replication.lab.multiverse import TASK, multiverse
from replication.lab.tasks import drawing

DATA = multiverse(PROJECT / "figures")
PLAN = load_specifications()
SPECIFICATIONS = factorial_specifications(PLAN.mazes.factorial)


def test_specifications_are_those_declared() -> None:
    """Each digit is the place of a value; each default is named; nothing is there unpublished."""
    assert [
        tuple((choice["id"], choice["values"][int(digit)]) for choice, digit in choices)
        for digits in DATA["specifications"]
        for choices in [list(zip(DATA["choices"], digits, strict=True))]
    ] == [one.choices for one in SPECIFICATIONS]
    usual = {choice["id"]: choice["values"][choice["usual"]] for choice in DATA["choices"]}
    assert usual["MAP"] == "open"
    assert usual["INCORRECT-KINDS"] == "hit+detour"
    assert usual["ALPHA"] == 0.5
    assert multiverse(None)["specifications"] == []
    assert multiverse(None)["iterations"] == ""


def test_iterations_are_those_published() -> None:
    """Each trial has its iterations; one that did not converge has more than the cap."""
    packed = np.frombuffer(base64.b64decode(DATA["iterations"]), np.uint8)
    shown = packed.reshape(len(SPECIFICATIONS), len(METHODS), DATA["trials"])
    trials = pd.read_csv(PROJECT / "figures" / "sensitivity" / "trials.csv")
    trials = trials[trials["part"] == "factorial"]
    assert len(trials) == shown.size
    assert set(trials["seed"]) == {DATA["seed"]}
    for row in trials.itertuples():
        count = shown[row.number, list(METHODS).index(row.method), row.trial]
        assert count == (row.iterations if row.converged else DATA["cap"] + 1)


def test_conditions_are_those_of_python() -> None:
    """Drawing and parameters of every specification are those that its trials had."""
    unnamed = [choice["id"] for choice in DATA["choices"] if not choice["field"]]
    assert unnamed == [*TASK, "INCORRECT-KINDS"]
    for number, specification in enumerate(SPECIFICATIONS):
        values = dict(specification.choices)
        condition = conditions_of("factorial", number)[-1]
        name = " ".join(str(values[id]) for id in TASK)
        assert DATA["drawings"][name] == drawing(condition.demos, name)
        params = condition.params.values()
        assert params["max_iterations"] == DATA["cap"]
        for choice in DATA["choices"]:
            if choice["field"]:
                assert params[choice["field"]] == values[choice["id"]]
