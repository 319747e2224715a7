from __future__ import annotations

import math
from itertools import pairwise

import pytest

from replication.envs.soccer import rules
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.rules import BACKWARD, FORWARD, LEFT, RIGHT, SLOW, SoccerParams
from replication.envs.soccer.world import SoccerWorld
from tests.envs.soccer.placing import OVERLAP, place


def test_ball_rolls_straight_and_slows() -> None:
    """A ball that is hit straight rolls straight and keeps 40 % of its speed after a second."""
    world = SoccerWorld()
    place(world, ball=(0.3, 0.9), pose=(0.2, 0.2, 0.0), velocity=(0.2, 0.0))
    speeds = [0.2]
    while world.time < 1:
        world.step(SLOW)
        speeds.append(world.ball_velocity[0])
        assert world.ball_velocity[1] == 0.0
        assert world.ball[1] == 0.9
    assert all(later < earlier for earlier, later in pairwise(speeds))
    assert speeds[-1] == pytest.approx(0.2 * 0.4**world.time, rel=0.05)


def test_robot_moves_as_planned() -> None:
    """Free of contacts, a decision turns exactly to the planned heading and drives 0.10 m."""
    for action, aside, way in (
        (FORWARD, 0, 0.1),
        (BACKWARD, 0, -0.1),
        (RIGHT, -90, 0.1),
        (LEFT, 90, 0.1),
        (SLOW, 0, 0.05),
    ):
        world = SoccerWorld()
        place(world, pose=(0.40, 0.60, 2.0))
        world.step(action)
        heading = math.radians(aside)
        x, y = 0.40 + way * math.cos(heading), 0.60 + way * math.sin(heading)
        assert world.pose[:2] == pytest.approx((x, y), abs=1e-12)
        assert math.remainder(world.pose[2] - heading, math.tau) == pytest.approx(0, abs=1e-12)
        turn = abs(math.remainder(heading - 2.0, math.tau))
        assert world.tick == math.ceil(turn / 0.2) + 10 + 1


def test_rays_by_hand() -> None:
    """A ray that points at an obstacle measures the way to its near side; the others reach on."""
    world = SoccerWorld(SoccerParams(rays=4))  # at -135, -45, 45 and 135 degrees
    x, y, _ = world.obstacles[0]
    place(world, pose=(x - 0.10, y, math.pi / 4))
    near = 0.10 - rules.ROBOT_SIDE / 2
    assert world.rays() == pytest.approx([0.15, near, 0.15, 0.15])
    place(world, pose=(x - 0.08, y - 0.08, 0.0))
    corner = (0.08 - rules.ROBOT_SIDE / 2) * math.sqrt(2)
    assert world.rays() == pytest.approx([0.15, 0.15, corner, 0.15])


def test_front_rays() -> None:
    """Over half a circle the rays see what is ahead and not what is behind."""
    angles = SoccerParams(ray_arc=180).ray_angles
    assert (len(angles), angles[0], angles[-1]) == pytest.approx((15, -math.pi / 2, math.pi / 2))
    front, around = SoccerWorld(SoccerParams(ray_arc=180)), SoccerWorld()
    x, y, _ = front.obstacles[0]
    for heading, ahead in ((0.0, True), (math.pi, False)):
        for world, sees in ((front, ahead), (around, True)):
            place(world, pose=(x - 0.12, y, heading))
            assert rules.decode(world.state)[2] == sees


def test_detection_ends_with_the_rays() -> None:
    """An obstacle is detected within reach of a ray and not a micrometre beyond."""
    world = SoccerWorld()
    x, y, _ = world.obstacles[0]
    reach = 0.15 + rules.ROBOT_SIDE / 2
    for offset, seen in ((1e-6, False), (-1e-6, True)):
        place(world, pose=(x - reach - offset, y, 0.0))
        assert rules.decode(world.state)[2] == seen


def test_time_out() -> None:
    """An episode without a goal ends after the first decision that reaches the time limit."""
    world = FastSoccerWorld(SoccerParams(time_limit=20.0))
    outcomes = [(world.time, world.step(BACKWARD)[1:]) for _ in range(40)]
    last = next(i for i, (_, (_, timed_out)) in enumerate(outcomes) if timed_out)
    assert outcomes[last][0] < 20.0 <= outcomes[last + 1][0]
    assert not any(scored for _, (scored, _) in outcomes)
    assert SoccerParams().limit_ticks * SoccerParams().dt == 300.0


def test_goal_is_the_whole_ball() -> None:
    """A goal falls when the whole ball is over the line between the posts, not before."""
    world = SoccerWorld()
    place(world, ball=(1.36, 0.6), velocity=(0.1, 0.0))
    while world.ball[0] < rules.GOAL_X:
        before = world.ball[0]
        _, scored, _ = world.step(BACKWARD)
        assert scored == (world.ball[0] >= 1.4 + rules.BALL_RADIUS)
    assert before < rules.GOAL_X
    place(world, ball=(1.36, 0.3), velocity=(0.1, 0.0))  # beside the gate
    assert not any(world.step(BACKWARD)[1] for _ in range(8))
    assert world.ball[0] < 1.4 - rules.BALL_RADIUS + OVERLAP


def test_ball_pinned_to_wall() -> None:
    """A robot that presses the ball against a wall does not push it through, nor itself."""
    world = FastSoccerWorld()
    place(world, pose=(0.5, 0.15, -math.pi / 2), ball=(0.5, 0.03))
    for _ in range(60):
        world.step(FORWARD)
        assert world.ball[1] > 0
        assert world.pose[1] > 0


def test_contacts_are_counted() -> None:
    """A decision that ends at a wall, or at an obstacle, counts once as a contact with it."""
    world = SoccerWorld()
    place(world, pose=(0.10, 0.60, 0.0))
    assert world.contacts == (0, 0)
    world.step(BACKWARD)
    assert world.contacts == (0, 1)
    x, y, _ = world.obstacles[0]
    place(world, pose=(x - 0.12, y + 0.03, 0.0), ball=(x + 0.2, y + 0.03))
    world.step(FORWARD)
    assert world.contacts == (1, 1)


def test_unknown_action_is_refused() -> None:
    """An action that does not exist is an error that names it."""
    with pytest.raises(ValueError, match="no action 5"):
        SoccerWorld().step(5)
