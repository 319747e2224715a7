"""What a trial in the lab is made of: a maze with demonstrations, and parameters."""

from __future__ import annotations

from typing import Any

from replication.demos.model import Demo, Demos
from replication.envs.maze import as_maze

MAZES = {
    "open": "the paper's open maze",
    "obstacles": "the paper's maze with obstacles",
    **{f"random-{k}": f"random maze {k}" for k in range(1, 6)},
}
"""The mazes that the lab offers, by their names in the sensitivity analysis."""

FIELDS = (
    *("beta", "gamma", "epsilon", "episodes", "horizon", "q_start", "ties", "tie_tolerance"),
    *("threshold", "max_iterations", "w_start", "rollout_ties"),
    *("f_index", "alpha", "f_start", "adaboost_rule", "adaboost_margin"),
)
"""The parameters that the lab's trials take; others stay as they are registered."""


def drawing(demos: Demos, title: str) -> dict[str, Any]:
    """Return a maze with its demonstrations as the page's scripts take them."""

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
