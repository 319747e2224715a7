"""Compute trials: what runs in a worker, and the key under which a trial is stored.

The key hashes all that determines a trial, including the code: this module, those of the agent and
of the method's update, and whatever they import. Reading files, scheduling, storing and reporting
do not count.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import Any

import numba
import numpy as np

from replication.irl.agent import Agent
from replication.irl.loop import Trial, run
from replication.learning.seeds import trial_seeds
from replication.source import source_hash
from replication.trials.condition import Condition

TRACED_TRIAL = 0
"""The trial of each condition that may keep every iteration, fixed in advance (FIG5-TRIAL)."""


def compute(
    agent: Agent, wanted: Sequence[tuple[Condition, int]], root: int, *, traced: bool = True
) -> list[tuple[str, Trial]]:
    """Compute trials of conditions that share an agent, side by side.

    Parameters
    ----------
    agent
        The agent of all conditions.
    wanted
        Pairs of a condition and the number of a trial.
    root
        Root seed; trial k descends from its child k.
    traced
        Whether TRACED_TRIAL keeps its snapshots.

    Returns
    -------
    list
        Pairs of a key and a trial, in the order in which the trials finished.
    """
    seeds = trial_seeds(root, max(k for _, k in wanted) + 1)
    loops = [
        condition.trial(seed=seeds[k], keep=traced and k == TRACED_TRIAL) for condition, k in wanted
    ]
    finished = []
    for at, trial in run(agent, loops):
        condition, k = wanted[at]
        finished.append((trial_key(condition, root, k, traced=traced), trial))
    return finished


def trial_key(condition: Condition, root: int, k: int, *, traced: bool = True) -> str:
    """Return the hash of all that determines a trial: demos, method, parameters, seed and code."""
    params: dict[str, Any] = condition.params.values()
    del params["incorrect"]  # the selected demonstrations stand for it
    content = {
        "demos": condition.selected_hash,
        "method": condition.method,
        "params": params,
        "seed": [root, k],
        "traced": traced and k == TRACED_TRIAL,
        "source": source_hash(
            "replication.trials.compute",
            type(condition.agent).__module__,
            condition.rule.update.__module__,
        ),
        "versions": {"numba": numba.__version__, "numpy": np.__version__},
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
