from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from replication import Demos
from replication.demos.soccer_expert import demonstrate_soccer
from replication.envs.soccer import rules
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.replay import replay
from replication.errors import UserError
from replication.report.field import demonstrations, draw_demonstrations, start

FIELD = SoccerField()


@pytest.fixture(scope="module")
def demos() -> Demos:
    """Let the expert demonstrate."""
    return demonstrate_soccer("soccer", FIELD)


@pytest.fixture(scope="module")
def numbers(demos: Demos) -> pd.DataFrame:
    """Replay the demonstrations."""
    return demonstrations(demos).numbers


@pytest.fixture(scope="module")
def drawing(numbers: pd.DataFrame) -> Figure:
    """Draw them."""
    return draw_demonstrations(numbers)


def test_numbers_equal_the_replay(demos: Demos, numbers: pd.DataFrame) -> None:
    """The table's positions and detections are, in order, the states of every demonstration."""
    everyone = demos.correct + demos.incorrect
    assert numbers["demo"].unique().tolist() == [demo.name for demo in everyone]
    for demo in everyone:
        rows = numbers[numbers["demo"] == demo.name]
        assert rows["decision"].tolist() == list(range(len(demo.states)))
        assert set(rows["kind"]) == {demo.kind}
        places = zip(rows["x"], rows["y"], rows["detected"], strict=True)
        assert [rules.encode(*place) for place in places] == demo.states.tolist()
        actions = [rules.ACTIONS.index(name) for name in rows["action"] if name]
        assert actions == demo.actions.tolist()
        seen = rows[[f"obstacle_{n}_seen" for n in (1, 2, 3)]]
        assert (seen.any(axis=1) == rows["detected"]).all()


def test_ways_are_drawn_as_replayed(drawing: Figure, demos: Demos) -> None:
    """Fig. 11 shows every position of the correct demo, unsmoothed and to scale, in both panels."""
    way = replay(FIELD, demos.correct[0].actions).poses[:, :2]
    for panel in drawing.axes:
        assert panel.get_aspect() == 1
        assert any(np.array_equal(np.asarray(line.get_xydata()), way) for line in panel.lines)


def test_contacts_are_crossed(drawing: Figure, demos: Demos) -> None:
    """There is a cross for each demo that ends with a contact, and for no other."""
    crosses = [line for line in drawing.axes[1].lines if line.get_marker() == "x"]
    touching = [demo for demo in demos.incorrect if replay(FIELD, demo.actions).touched[-1]]
    assert len(crosses) == len(touching)
    hits = [demo for demo in touching if demo.kind == "hit"]
    ends = [replay(FIELD, demo.actions).poses[-1, :2] for demo in hits]
    drawn = [np.ravel(line.get_xydata()) for line in crosses]
    assert all(any(np.allclose(end, place) for place in drawn) for end in ends)


def test_words_hold_the_facts(demos: Demos) -> None:
    """The texts that stand for the pictures give what is measured, for these demos and fewer."""
    words = demonstrations(demos).words
    assert "15 decisions" in words
    assert "slowly in 3 decisions" in words
    for kind in demos.kinds:
        assert f"{sum(demo.kind == kind for demo in demos.incorrect)} {kind}" in words
    assert "Incorrect" not in demonstrations(demos.select("none")).words
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
