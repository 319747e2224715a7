"""What happens in an episode of robot soccer, replayed from its actions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replication.envs.soccer import rules
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.field import SoccerField

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Replay:
    """What happened in an episode of T decisions, at each border between two decisions.

    Attributes
    ----------
    times
        Simulated time in s, [T + 1].
    poses
        The robot's x, y and heading, [T + 1, 3].
    balls
        The ball's x and y, [T + 1, 2].
    obstacles
        The obstacles' x and y, [T + 1, obstacle, 2].
    detected
        Whether an obstacle is detected, [T + 1].
    seen
        Which obstacles the rays hit, [T + 1, obstacle].
    actions
        The decisions, [T].
    touched
        Whether the robot touched an obstacle or a wall in a decision, [T].
    outcome
        Why the episode is over, "goal" or "time out"; "open" if it is not.
    """

    times: Floats
    poses: Floats
    balls: Floats
    obstacles: Floats
    detected: NDArray[np.bool_]
    seen: NDArray[np.bool_]
    actions: NDArray[np.int64]
    touched: NDArray[np.bool_]
    outcome: str


def replay(field: SoccerField, actions: Iterable[int]) -> Replay:
    """Replay actions, up to the end of the episode."""
    world = FastSoccerWorld(field.params)
    rows, taken, touched = [_row(world, world.reset())], [], []
    outcome = "open"
    for action in actions:
        if outcome != "open":
            break
        before = sum(world.contacts)
        state, scored, timed_out = world.step(int(action))
        outcome = "goal" if scored else "time out" if timed_out else "open"
        rows.append(_row(world, state))
        taken.append(int(action))
        touched.append(sum(world.contacts) > before)
    times, poses, balls, obstacles, detected, seen = map(np.array, zip(*rows, strict=True))
    return Replay(
        times=times,
        poses=poses,
        balls=balls,
        obstacles=obstacles,
        detected=detected,
        seen=seen,
        actions=np.array(taken, dtype=np.int64),
        touched=np.array(touched, dtype=bool),
        outcome=outcome,
    )


def ray_tips(world: FastSoccerWorld) -> Floats:
    """Return where the robot's rays end, [ray, 2]."""
    angles = world.pose[2] + np.array(world.params.ray_angles)
    along = np.column_stack([np.cos(angles), np.sin(angles)])
    return np.array(world.pose[:2]) + np.array(world.rays())[:, None] * along


def _row(world: FastSoccerWorld, state: int) -> tuple[Any, ...]:
    obstacles = np.array(world.obstacles)[:, :2]
    detected = rules.decode(state)[2]
    seen = np.zeros(len(obstacles), dtype=bool)
    if detected:
        # A ray ends on the side of the obstacle that it hits.
        tips = ray_tips(world)[np.array(world.rays()) < world.params.ray_length]
        off = np.abs(tips[:, None] - obstacles).max(axis=2)
        seen[off.argmin(axis=1)] = True
    return world.time, world.pose, world.ball, obstacles, detected, seen
