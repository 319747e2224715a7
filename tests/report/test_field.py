from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from replication import Demos
from replication.envs.soccer import rules
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.replay import replay
from replication.errors import UserError
from replication.report.field import demonstrations, draw_demonstrations, start

FIELD = SoccerField()


@pytest.fixture(scope="module")
def numbers(soccer_demos: Demos) -> pd.DataFrame:
    """Replay the demonstrations."""
    return demonstrations(soccer_demos).numbers


@pytest.fixture(scope="module")
def drawing(numbers: pd.DataFrame) -> Figure:
    """Draw them."""
    return draw_demonstrations(numbers)


def test_numbers_equal_the_replay(soccer_demos: Demos, numbers: pd.DataFrame) -> None:
    """The table's positions and detections are, in order, the states of every demonstration."""
    everyone = soccer_demos.correct + soccer_demos.incorrect
    groups = numbers.groupby(["kind", "demo"], sort=False)
    assert [key for key, _ in groups] == [(demo.kind, demo.name) for demo in everyone]
    for (_, rows), demo in zip(groups, everyone, strict=True):
        places = zip(rows["x"], rows["y"], rows["detected"], strict=True)
        assert [rules.encode(*place) for place in places] == demo.states.tolist()
        actions = [rules.ACTIONS.index(name) for name in rows["action"] if name]
        assert actions == demo.actions.tolist()


def test_ways_are_drawn_as_replayed(drawing: Figure, soccer_demos: Demos) -> None:
    """Fig. 11 shows every position of the correct demo, unsmoothed and to scale, in both panels."""
    way = replay(FIELD, soccer_demos.correct[0].actions)[["x", "y"]].to_numpy()
    for panel in drawing.axes:
        assert panel.get_aspect() == 1
        assert any(np.array_equal(np.asarray(line.get_xydata()), way) for line in panel.lines)


def test_no_way_hides_another(drawing: Figure) -> None:
    """No two demonstrations are drawn on the same stretch, as their places would be the same."""
    ways = [np.asarray(line.get_xydata()).round(4) for line in drawing.axes[1].lines]
    stretches = [{*map(tuple, np.hstack([way[:-1], way[1:]]))} for way in ways if len(way) > 2]
    assert len(stretches) > 10
    for one, other in itertools.combinations(stretches, 2):
        assert not one & other


def test_ticks_end_with_the_field(drawing: Figure) -> None:
    """The axes have ticks at both ends of the field."""
    for panel in drawing.axes:
        assert panel.get_xticks()[[0, -1]].tolist() == [0, rules.WIDTH]
        assert panel.get_yticks()[[0, -1]].tolist() == [0, rules.HEIGHT]


def test_contacts_are_crossed(drawing: Figure, soccer_demos: Demos) -> None:
    """There is a cross for each demo that ends with a contact, and for no other."""
    crosses = [line for line in drawing.axes[1].lines if line.get_marker() == "x"]
    touching = [
        demo for demo in soccer_demos.incorrect if replay(FIELD, demo.actions)["touched"].iloc[-1]
    ]
    assert len(crosses) == len(touching)
    hits = [demo for demo in touching if demo.kind == "hit"]
    ends = [replay(FIELD, demo.actions).iloc[-1][["x", "y"]].astype(float) for demo in hits]
    drawn = [np.ravel(line.get_xydata()) for line in crosses]
    assert all(any(np.allclose(end, place) for place in drawn) for end in ends)


def test_a_way_that_never_leaves_the_right_one_is_not_drawn(soccer_demos: Demos) -> None:
    """A mistake that is to stop on the way is counted, and has nothing to be drawn from."""
    (right,) = soccer_demos.correct
    stops = replace(
        right, name="s", kind="stops", states=right.states[:6], actions=right.actions[:5]
    )
    picture = demonstrations(replace(soccer_demos, incorrect=(stops,)))
    texts = picture.draw(picture.numbers).legends[0].get_texts()
    assert "stops (1)" in [text.get_text() for text in texts]


def test_words_hold_the_facts(soccer_demos: Demos) -> None:
    """The texts that stand for the pictures give what is measured, for these demos and fewer."""
    words = demonstrations(soccer_demos).words
    assert "15 decisions" in words
    assert "slowly in 3 decisions" in words
    for kind in soccer_demos.kinds:
        assert f"{sum(demo.kind == kind for demo in soccer_demos.incorrect)} {kind}" in words
    assert "Incorrect" not in demonstrations(soccer_demos.select("none")).words
    assert "15 rays of 0.15 m" in start(FIELD).words


def test_start_is_that_of_the_world() -> None:
    """Fig. 10's rows are the robot, the ball, every obstacle and the end of every ray."""
    rows = start(FIELD).numbers
    counts = rows.groupby("what", sort=False).size().to_dict()
    assert counts == {"robot": 1, "ball": 1, "obstacle": len(rules.PATHS), "ray": FIELD.params.rays}
    robot, ball = rows.iloc[0], rows.iloc[1]
    assert (robot["x"], robot["y"]) == rules.ROBOT_START
    assert (ball["x"], ball["y"]) == rules.BALL_START


def test_mazes_are_refused(small_demos: Demos) -> None:
    """Demonstrations of another kind are refused in a line."""
    with pytest.raises(UserError, match="robot soccer is needed"):
        demonstrations(small_demos)
