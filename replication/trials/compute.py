"""Compute trials: what runs in a worker, and the key under which a trial is stored.

The key hashes all that determines a trial, including the code: this module, those of the agent and
of the method's update, and whatever they import. Reading files, scheduling, storing and reporting
do not count.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numba
import numpy as np

from replication.irl.loop import Trial
from replication.learning.seeds import child
from replication.source import source_hash
from replication.trials.condition import Condition

TRACED_TRIAL = 0
"""The trial of each condition that may keep every iteration, fixed in advance (FIG5-TRIAL)."""


def compute(condition: Condition, k: int, root: int, *, traced: bool = True) -> tuple[str, Trial]:
    """Compute trial k of a condition; return its key, too.

    Parameters
    ----------
    condition
        What to run.
    k
        Number of the trial; its seed is child k of the root seed.
    root
        Root seed.
    traced
        Whether TRACED_TRIAL keeps its snapshots.
    """
    seed = child(np.random.SeedSequence(root), k)
    trial = condition.trial(seed=seed, keep=traced and k == TRACED_TRIAL)
    return trial_key(condition, root, k, traced=traced), trial


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
