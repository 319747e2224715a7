"""Put bodies of a soccer world somewhere."""

from __future__ import annotations

from typing import Any

from replication.envs.soccer.world import SoccerWorld

OVERLAP = 0.011  # contacts are noticed after bodies have moved on for a tick, at most 0.01 m


def place(world: SoccerWorld, pose: Any = None, ball: Any = None, velocity: Any = None) -> None:
    """Put the robot and the ball somewhere, or leave them where they are."""
    world.pose = pose or world.pose
    world.ball = ball or world.ball
    world.ball_velocity = velocity or world.ball_velocity
