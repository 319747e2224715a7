"""What happens in an episode of robot soccer, replayed from its actions."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.envs.soccer import rules
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.field import SoccerField


def replay(field: SoccerField, actions: Iterable[int]) -> pd.DataFrame:
    """Replay actions, up to the end of the episode.

    Returns
    -------
    DataFrame
        A row for each border between two decisions: `decision`; `time` in simulated s; `x`, `y` and
        `heading` of the robot; `ball_x`, `ball_y`; whether an obstacle is `detected`; the `action`
        that follows; whether the robot `touched` an obstacle or a wall in the decision before;
        `outcome`, why the episode is over: "goal", "time out", or "open" if it is not; for each
        obstacle n `obstacle_n_x`, `obstacle_n_y`, and whether the rays hit it, `obstacle_n_seen`.
    """
    world = FastSoccerWorld(field.params)
    rows = [_row(world, world.reset())]
    outcome = "open"
    for action in actions:
        if outcome != "open":
            break
        rows[-1]["action"] = rules.ACTIONS[action]
        before = sum(world.contacts)
        state, scored, timed_out = world.step(int(action))
        outcome = "goal" if scored else "time out" if timed_out else "open"
        rows.append(_row(world, state) | {"touched": sum(world.contacts) > before})
    table = pd.DataFrame(rows).assign(outcome=outcome)
    table.insert(0, "decision", range(len(table)))
    return table


def ray_tips(world: FastSoccerWorld) -> NDArray[np.float64]:
    """Return where the robot's rays end, [ray, 2]."""
    angles = world.pose[2] + np.array(world.params.ray_angles)
    along = np.column_stack([np.cos(angles), np.sin(angles)])
    return np.array(world.pose[:2]) + np.array(world.rays())[:, None] * along


def _row(world: FastSoccerWorld, state: int) -> dict[str, Any]:
    detected = rules.decode(state)[2]
    (x, y, heading), (ball_x, ball_y) = world.pose, world.ball
    row: dict[str, Any] = {"time": world.time, "x": x, "y": y, "heading": heading}
    row |= {"ball_x": ball_x, "ball_y": ball_y, "detected": detected}
    row |= {"action": "", "touched": False, "outcome": ""}
    places = np.array(world.obstacles)[:, :2]
    hit = set()
    if detected:
        # A ray ends on the side of the obstacle that it hits.
        tips = ray_tips(world)[np.array(world.rays()) < world.params.ray_length]
        hit = {*np.abs(tips[:, None] - places).max(axis=2).argmin(axis=1).tolist()}
    for number, (x, y) in enumerate(places):
        name = f"obstacle_{number + 1}"
        row |= {f"{name}_x": x, f"{name}_y": y, f"{name}_seen": number in hit}
    return row
