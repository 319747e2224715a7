from __future__ import annotations

import numpy as np

from replication import Demos
from replication.envs.soccer import rules
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.replay import replay
from replication.envs.soccer.rules import FORWARD, LEFT
from replication.envs.soccer.world import SoccerWorld

FIELD = SoccerField()


def test_detected_obstacle_is_the_one_in_front() -> None:
    """What the rays hit is known by number: the nearest obstacle, and none if none is detected."""
    episode = replay(FIELD, [FORWARD] * 4)
    distance = np.linalg.norm(episode.obstacles - episode.poses[:, None, :2], axis=2)
    np.testing.assert_array_equal(episode.seen.any(axis=1), episode.detected)
    assert episode.seen[-1].tolist() == (distance[-1] == distance[-1].min()).tolist()


def test_replay_equals_the_plain_world(soccer_demos: Demos) -> None:
    """A replay holds what the world shows at each border between two decisions, bit by bit."""
    world, actions = SoccerWorld(), soccer_demos.incorrect[0].actions.tolist()
    world.reset()
    episode = replay(FIELD, actions)
    for t, action in enumerate([*actions, None]):
        assert episode.times[t] == world.time
        assert tuple(episode.poses[t]) == world.pose
        assert tuple(episode.balls[t]) == world.ball
        obstacles = [place[:2] for place in world.obstacles]
        np.testing.assert_array_equal(episode.obstacles[t], obstacles)
        assert episode.detected[t] == rules.decode(world.state)[2]
        if action is not None:
            world.step(action)
    assert episode.touched.tolist() == [False] * (len(actions) - 1) + [True]


def test_replay_stops_when_the_episode_is_over(soccer_demos: Demos) -> None:
    """Actions after a goal, or after the time is up, are left out."""
    right = soccer_demos.correct[0].actions.tolist()
    scored = replay(FIELD, [*right, LEFT, LEFT])
    assert scored.actions.tolist() == right
    assert scored.outcome == "goal"
    assert scored.balls[-1, 0] >= rules.GOAL_X
    assert not scored.touched.any()
    short = SoccerField(rules.SoccerParams(time_limit=60.0))
    late = replay(short, [LEFT] * 300)
    assert late.outcome == "time out"
    assert late.times[-2] < 60 <= late.times[-1]
    assert replay(FIELD, [LEFT]).outcome == "open"
