from __future__ import annotations

import numpy as np
import pytest

from replication import Demos
from replication.demos.soccer_expert import demonstrate_soccer
from replication.envs.soccer import rules
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.replay import replay
from replication.envs.soccer.rules import FORWARD, LEFT, SLOW
from replication.envs.soccer.world import SoccerWorld

FIELD = SoccerField()
SEEN = [f"obstacle_{n}_seen" for n in (1, 2, 3)]


@pytest.fixture(scope="module")
def demos() -> Demos:
    """Let the expert demonstrate."""
    return demonstrate_soccer("soccer", FIELD)


def test_correct_demo_scores_and_slows_down(demos: Demos) -> None:
    """The expert drives slowly exactly while it detects an obstacle, and ends with a goal."""
    episode = replay(FIELD, demos.correct[0].actions)
    assert set(episode["outcome"]) == {"goal"}
    assert episode["ball_x"].iloc[-1] >= rules.GOAL_X
    slow = episode["action"] == rules.ACTIONS[SLOW]
    assert (episode["detected"] == slow)[:-1].all()
    assert 0 < slow.sum() < len(slow) - 1
    assert not episode["touched"].any()


def test_detected_obstacle_is_the_one_in_front() -> None:
    """What the rays hit is known by number: the nearest obstacle, and none if none is detected."""
    episode = replay(FIELD, [FORWARD] * 4)
    assert (episode[SEEN].any(axis=1) == episode["detected"]).all()
    last = episode.iloc[-1]
    distance = np.array(
        [
            np.hypot(last[f"obstacle_{n}_x"] - last["x"], last[f"obstacle_{n}_y"] - last["y"])
            for n in (1, 2, 3)
        ]
    )
    assert last[SEEN].tolist() == (distance == distance.min()).tolist()


def test_replay_equals_the_plain_world(demos: Demos) -> None:
    """A replay holds what the world shows at each border between two decisions, bit by bit."""
    world, actions = SoccerWorld(), demos.incorrect[0].actions.tolist()
    world.reset()
    episode = replay(FIELD, actions)
    for row, action in zip(episode.to_dict("records"), [*actions, None], strict=True):
        assert row["time"] == world.time
        assert (row["x"], row["y"], row["heading"]) == world.pose
        assert (row["ball_x"], row["ball_y"]) == world.ball
        for n, (x, y, *_) in enumerate(world.obstacles, 1):
            assert (row[f"obstacle_{n}_x"], row[f"obstacle_{n}_y"]) == (x, y)
        assert row["detected"] == rules.decode(world.state)[2]
        assert row["action"] == ("" if action is None else rules.ACTIONS[action])
        if action is not None:
            world.step(action)
    assert episode["touched"].tolist() == [False] * len(actions) + [True]


def test_replay_stops_when_the_episode_is_over(demos: Demos) -> None:
    """Actions after a goal, or after the time is up, are left out."""
    right = demos.correct[0].actions.tolist()
    assert len(replay(FIELD, [*right, LEFT, LEFT])) == len(right) + 1
    short = SoccerField(rules.SoccerParams(time_limit=60.0))
    late = replay(short, [LEFT] * 300)
    assert set(late["outcome"]) == {"time out"}
    assert late["time"].iloc[-2] < 60 <= late["time"].iloc[-1]
    assert set(replay(FIELD, [LEFT])["outcome"]) == {"open"}
