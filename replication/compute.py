"""Compute trials: what runs in a worker, and the key under which a trial is filed.

The key hashes all that determines a trial, the code included: this module and whatever it imports.
Scheduling, storing and reporting are not among them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import Any

import numba
import numpy as np

from replication.irl import Trial, run
from replication.seeds import trial_seeds
from replication.setting import Setting
from replication.source import source_hash
from replication.tasks import Task

TRACED_TRIAL = 0
"""The one trial of a setting that may keep every iteration, declared beforehand (FIG5-TRIAL)."""


def compute(
    task: Task, wanted: Sequence[tuple[Setting, int]], root: int, *, traced: bool = True
) -> list[tuple[str, Trial]]:
    """Compute trials of settings that share a task side by side.

    Parameters
    ----------
    task
        The task of all settings.
    wanted
        Settings, each with the number of a trial.
    root
        Root seed: trial k descends from its child k.
    traced
        Whether TRACED_TRIAL keeps its snapshots.

    Returns
    -------
    list
        Each trial with its key, in the order in which they finished.
    """
    seeds = trial_seeds(root, max(k for _, k in wanted) + 1)
    loops = [
        setting.trial(seed=seeds[k], keep=traced and k == TRACED_TRIAL) for setting, k in wanted
    ]
    found = []
    for at, trial in run(task, loops):
        setting, k = wanted[at]
        found.append((trial_key(setting, root, k, traced=traced), trial))
    return found


def trial_key(setting: Setting, root: int, k: int, *, traced: bool = True) -> str:
    """Return the hash of all that determines a trial: demos, method, parameters, seed and code."""
    params: dict[str, Any] = setting.params.values()
    del params["incorrect"]  # the selected demonstrations stand for it
    content = {
        "demos": setting.selected_hash,
        "method": setting.method,
        "params": params,
        "seed": [root, k],
        "traced": traced and k == TRACED_TRIAL,
        "source": source_hash("replication.compute"),
        "versions": {"numba": numba.__version__, "numpy": np.__version__},
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
