from __future__ import annotations

import re

import numpy as np
import pytest

from replication import Demos
from replication.envs.soccer import rules
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.replay import replay
from replication.envs.soccer.rules import BACKWARD, LEFT
from replication.report.film import film
from replication.report.moving import Player
from replication.report.stages import METRE
from tests.report.test_players import content_of


@pytest.fixture
def right(soccer_demos: Demos) -> list[int]:
    """Return the actions of the expert."""
    actions: list[int] = soccer_demos.correct[0].actions.tolist()
    return actions


@pytest.fixture
def shown(soccer_demos: Demos, right: list[int]) -> Player:
    """Show an episode that scores and goes on, and one that has no more actions."""
    return film(soccer_demos, {"a & <b>": [*right, LEFT], "left": [LEFT] * 9})


def test_each_episode_can_be_chosen(shown: Player) -> None:
    """Episodes are options by title, and the last one is shown first."""
    content = content_of(shown.html)
    assert content["choices"] == [
        {"name": "Episode", "options": ["a &amp; &lt;b&gt;", "left"], "start": 1}
    ]
    assert len(content["plays"]) == 2


def test_numbers_have_every_decision(shown: Player, right: list[int]) -> None:
    """The file beside a film has a row for each frame of each episode, up to its end."""
    lengths = shown.numbers.groupby("episode", sort=False).size().tolist()
    assert lengths == [len(right) + 1, 10]
    frames = [len(play["panels"][0]["frames"]) for play in content_of(shown.html)["plays"]]
    assert frames == lengths


def test_things_are_where_the_replay_has_them(shown: Player, right: list[int]) -> None:
    """Obstacles, ball and robot stand in each frame where the numbers say, to 2 mm."""
    table = replay(SoccerField(), right)
    for frame, row in zip(
        content_of(shown.html)["plays"][0]["panels"][0]["frames"], table.itertuples(), strict=True
    ):
        places = np.array(frame[2].split(), dtype=float).reshape(-1, 3)
        expected = [
            *((row.obstacle_1_x, row.obstacle_1_y), (row.obstacle_2_x, row.obstacle_2_y)),
            *((row.obstacle_3_x, row.obstacle_3_y), (row.ball_x, row.ball_y), (row.x, row.y)),
        ]
        from_below = np.column_stack([places[:, 0], METRE * rules.HEIGHT - places[:, 1]])
        np.testing.assert_allclose(from_below / METRE, expected, atol=1.001e-3)
        assert abs(-np.radians(places[-1, 2]) - row.heading) % (2 * np.pi) < 0.01


def test_the_robot_turns_the_short_way(soccer_demos: Demos) -> None:
    """From frame to frame the heading changes by half a turn at most, so that it can glide."""
    turning = film(soccer_demos, {"turns": [LEFT, LEFT, BACKWARD, LEFT, BACKWARD] * 6})
    frames = content_of(turning.html)["plays"][0]["panels"][0]["frames"]
    angles = [float(frame[2].split()[-1]) for frame in frames]
    assert np.abs(np.diff(angles)).max() <= 181


def test_it_is_told_how_episodes_end(shown: Player, right: list[int]) -> None:
    """Time stands at each frame, and at the last, and in the words, why the episode is over."""
    plays = content_of(shown.html)["plays"]
    first, left = (play["panels"][0]["frames"] for play in plays)
    assert first[0][1] == "0.0 s"
    assert re.fullmatch(rf"goal: \d+\.\d s, {len(right)} decisions", first[-1][1])
    assert left[-1][1] == "ends after 9 decisions"
    assert first[-1][1] in shown.words
    assert left[-1][1] in shown.words
