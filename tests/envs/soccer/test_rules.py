from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from replication.envs.soccer import rules
from replication.envs.soccer.rules import SoccerParams


def test_wheels_have_a_limit() -> None:
    """However much there is to correct, wheels push no harder than the tyres hold."""
    for velocity, rate in (((0.3, 0.9), 90.0), ((-2.0, 0.1), -90.0)):
        force_x, force_y, torque = rules.servo(0.2, rate, 0.0, velocity, 0.0, 0.05)
        assert math.hypot(force_x, force_y) == pytest.approx(3.5)
        assert force_y / force_x == pytest.approx(velocity[1] / (velocity[0] - 0.2))
        assert torque == math.copysign(0.2, rate)


def test_obstacle_is_a_triangle_wave() -> None:
    """An obstacle goes from end to end at its speed, turns round, and is back after a cycle."""
    for path in rules.PATHS:
        half = rules.half_ticks(path, 0.05)
        assert half * 0.05 * path.speed == pytest.approx(math.dist(path.start, path.end))
        at = [np.array(rules.obstacle(path, tick, 0.05)) for tick in range(2 * half + 1)]
        assert (at[0] == at[-1]).all()
        for now, later in pairwise(at):
            assert later[:2] == pytest.approx(now[:2] + 0.05 * now[2:], abs=1e-12)
            assert np.hypot(*now[2:]) == pytest.approx(path.speed)
        assert np.ptp([p[:2] for p in at], axis=0) == pytest.approx(
            np.abs(np.subtract(path.end, path.start))
        )


def test_obstacle_paths_leave_room() -> None:
    """Between an obstacle and a wall there is always room for a robot: it is not crushed."""
    for path in rules.PATHS:
        for x, y in (path.start, path.end):
            gap = min(x, rules.WIDTH - x, y, rules.HEIGHT - y) - rules.ROBOT_SIDE / 2
            assert gap >= rules.ROBOT_SIDE


def test_state_at_borders() -> None:
    """The states number 16 x 12 cells of two each; a border belongs to the cell that it opens."""
    seen = {
        rules.encode((i + 0.5) * 1.4 / 16, (j + 0.5) * 0.1, detected): (i, j, detected)
        for i in range(16)
        for j in range(12)
        for detected in (False, True)
    }
    assert sorted(seen) == list(range(384))
    assert all(rules.decode(state) == place for state, place in seen.items())
    for i in range(1, 16):
        x = i * 1.4 / 16
        assert rules.decode(rules.encode(x + 1e-9, 0.0, False))[0] == i
        assert rules.decode(rules.encode(x - 1e-9, 0.0, False))[0] == i - 1
    assert rules.encode(-0.01, -0.01, False) == rules.encode(0.0, 0.0, False)
    assert rules.encode(1.42, 1.21, False) == rules.encode(1.39, 1.19, False)


def test_border_distance() -> None:
    """The distance is to the nearest border between cells; the outline of the field is none."""
    assert rules.border_distance(0.001, 0.05) == pytest.approx(0.05)
    assert rules.border_distance(0.0875 * 3 + 0.004, 0.95) == pytest.approx(0.004)
    assert rules.border_distance(0.0875 * 3.5, 0.9 - 0.003) == pytest.approx(0.003)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("speed", 0.5),
        ("slow_speed", 0.3),
        ("rays", 0),
        ("rays", 2.5),
        ("ray_arc", 400.0),
        ("dt", 0.0),
        ("drive_time", 0.01),
        ("time_limit", math.nan),
    ],
)
def test_params_are_checked(name: str, value: float) -> None:
    """A parameter out of range is refused by its name."""
    with pytest.raises(ValueError, match=name):
        SoccerParams(**{name: value})  # type: ignore[arg-type]
