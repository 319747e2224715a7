"""The registry of baselines, one row each, and where the methods of the paper are found as well."""

from __future__ import annotations

from replication.baselines import from_failure, max_entropy, one_line, perceptron, wary
from replication.baselines.baseline import Baseline
from replication.errors import unknown
from replication.irl import METHODS, Method
from replication.irl.methods import TRACES
from replication.paper.register import ChoiceError

BASELINES: dict[str, Baseline] = {
    method.name: method
    for method in (
        Baseline(
            name="cloning",
            label="Copying the expert",
            colour="#000000",
        ),
        Baseline(
            name="one-line",
            label="One-line reward",
            colour="#56B4E9",
            update=one_line.update,
        ),
        Baseline(
            name="perceptron",
            label="Perceptron (F = 1)",
            colour="#009E73",
            update=perceptron.update,
        ),
        Baseline(
            name="wary",
            label="Unified, wary from the start (ours)",
            colour="#CC79A7",
            readings=TRACES,
            use="marked pairs",
            start=wary.start,
            update=wary.update,
        ),
        Baseline(
            name="max-entropy",
            label="Maximum causal entropy",
            colour="#E69F00",
            find=max_entropy.find,
        ),
        Baseline(
            name="from-failure",
            label="IRL from failure",
            colour="#882255",
            use="whole trajectories",
            find=from_failure.find,
        ),
    )
}
"""In the order in which tables and figures show them."""


def find_method(name: str) -> Method:
    """Return a method of the paper or a baseline.

    Raises
    ------
    ChoiceError
        If there is none; the message lists those that exist.
    """
    known: dict[str, Method] = {**METHODS, **BASELINES}
    if name not in known:
        raise ChoiceError(unknown(name, known, "method"))
    return known[name]
