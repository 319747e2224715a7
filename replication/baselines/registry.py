"""The registry of baselines, one row each, and where the methods of the paper are found as well."""

from __future__ import annotations

from replication.baselines import (
    bayesian,
    from_failure,
    margin_perceptron,
    max_entropy,
    max_margin,
    mwal,
    one_line,
    perceptron,
    projection,
    ranking,
    wary,
)
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
            name="projection",
            label="Projection",
            colour="#88CCEE",
            start=projection.start,
            update=projection.update,
        ),
        Baseline(
            name="mwal",
            label="MWAL",
            colour="#44AA99",
            update=mwal.update,
        ),
        Baseline(
            name="wary",
            label="Unified, wary from the start (ours)",
            colour="#CC79A7",
            readings=TRACES,
            use="marked pairs",
            baseline="unified",
            start=wary.start,
            update=wary.update,
        ),
        Baseline(
            name="margin-perceptron",
            label="Perceptron with margin",
            colour="#E69F00",
            find=margin_perceptron.find,
        ),
        Baseline(
            name="max-margin",
            label="Maximum margin",
            colour="#882255",
            use="marked pairs",
            find=max_margin.find,
        ),
        Baseline(
            name="max-entropy",
            label="Maximum causal entropy",
            colour="#661100",
            find=max_entropy.find,
        ),
        Baseline(
            name="from-failure",
            label="IRL from failure",
            colour="#AA4499",
            use="whole trajectories",
            find=from_failure.find,
        ),
        Baseline(
            name="bayesian",
            label="Bayesian IRL",
            colour="#332288",
            use="marked pairs",
            find=bayesian.find,
        ),
        Baseline(
            name="ranking",
            label="Ranking",
            colour="#999933",
            use="whole trajectories",
            find=ranking.find,
            needs_incorrect=True,
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
