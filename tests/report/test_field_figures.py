from __future__ import annotations

import re
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.animation import PillowWriter
from matplotlib.figure import Figure
from PIL import Image, ImageSequence

from replication import Demos
from replication.demos.checks import DemoError
from replication.demos.soccer_expert import demonstrate_soccer
from replication.envs.soccer import rules
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.rules import BACKWARD, FORWARD, LEFT, SLOW
from replication.envs.soccer.world import SoccerWorld
from replication.report.field_figures import (
    FieldAnimation,
    animate,
    describe_field,
    describe_soccer_demos,
    field_figure,
    numbers,
    save_gif,
    soccer_demos_figure,
    trace,
)
from replication.report.style import save_figure

FIELD = SoccerField()
CUT = 6


@pytest.fixture(scope="module")
def demos() -> Demos:
    """Let the expert demonstrate."""
    return demonstrate_soccer("soccer", FIELD)


@pytest.fixture(scope="module")
def drawings(demos: Demos) -> dict[str, Figure]:
    """Draw each still figure once."""
    return {"field": field_figure(FIELD), "demos": soccer_demos_figure(demos)}


def moving(demos: Demos) -> FieldAnimation:
    """Show an episode that goes on, one that ends soon and one that has no more actions."""
    hit = demos.incorrect[0].actions.tolist()
    return animate(
        SoccerField(rules.SoccerParams(drive_time=0.4)),
        {"first & <early>": [LEFT] * 9, "middle": hit, "last": [FORWARD] * CUT},
        decisions=CUT,
    )


def play(animation: FieldAnimation, folder: Path) -> None:
    """Draw all frames, coarsely."""
    animation.save(folder / "coarse.gif", writer=PillowWriter(), dpi=20)


@pytest.fixture(scope="module")
def gif(demos: Demos, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Save a moving figure."""
    return save_gif(moving(demos), tmp_path_factory.mktemp("gif") / "new" / "soccer.gif")


def test_correct_demo_scores_and_slows_down(demos: Demos) -> None:
    """The expert drives slowly exactly while it detects an obstacle, and ends with a goal."""
    one = trace(FIELD, demos.correct[0].actions)
    assert (one.scored, one.outcome, one.timed_out) == (True, "goal", False)
    assert one.balls[-1, 0] >= rules.GOAL_X
    np.testing.assert_array_equal(one.detected[:-1], one.actions == SLOW)
    assert 0 < one.detected.sum() < len(one.actions)
    assert not one.touched.any()


def test_detected_obstacle_is_the_one_in_front() -> None:
    """What the rays hit is known by number: the nearest obstacle, and none if none is detected."""
    one = trace(FIELD, [FORWARD] * 4)
    distance = np.linalg.norm(one.obstacles - one.poses[:, None, :2], axis=2)
    np.testing.assert_array_equal(one.seen.any(axis=1), one.detected)
    assert one.seen[-1].tolist() == (distance[-1] == distance[-1].min()).tolist()


def test_trace_equals_the_plain_world(demos: Demos) -> None:
    """A trace holds what the world shows at each border between two decisions, bit by bit."""
    world, actions = SoccerWorld(), demos.incorrect[0].actions.tolist()
    world.reset()
    one = trace(FIELD, actions)
    for t, action in enumerate([*actions, None]):
        assert one.times[t] == world.time
        assert tuple(one.poses[t]) == world.pose
        assert tuple(one.balls[t]) == world.ball
        np.testing.assert_array_equal(one.obstacles[t], [place[:2] for place in world.obstacles])
        assert one.detected[t] == rules.decode(world.state)[2]
        if action is not None:
            world.step(action)
    assert one.touched.tolist() == [False] * (len(actions) - 1) + [True]


def test_trace_stops_when_the_episode_is_over(demos: Demos) -> None:
    """Actions after a goal, or after the time is up, are left out."""
    right = demos.correct[0].actions.tolist()
    assert trace(FIELD, [*right, LEFT, LEFT]).actions.tolist() == right
    short = SoccerField(rules.SoccerParams(time_limit=60.0))
    late = trace(short, [LEFT] * 300)
    assert late.outcome == "time out"
    assert late.times[-2] < 60 <= late.times[-1]
    assert trace(FIELD, [LEFT]).outcome == ""


def test_numbers_equal_the_replay(demos: Demos) -> None:
    """The table's positions and detections are, in order, the states of every demonstration."""
    table = numbers(FIELD, demos)
    everyone = demos.correct + demos.incorrect
    assert table["demo"].unique().tolist() == [demo.name for demo in everyone]
    for demo in everyone:
        rows = table[table["demo"] == demo.name]
        assert rows["decision"].tolist() == list(range(len(demo.states)))
        assert set(rows["kind"]) == {demo.kind}
        places = zip(rows["x"], rows["y"], rows["detected"], strict=True)
        assert [rules.encode(*place) for place in places] == demo.states.tolist()


def test_ways_are_drawn_as_replayed(drawings: dict[str, Figure], demos: Demos) -> None:
    """Fig. 11 shows every position of the correct demo, unsmoothed and to scale, in both panels."""
    way = trace(FIELD, demos.correct[0].actions).poses[:, :2]
    for panel in drawings["demos"].axes:
        assert panel.get_aspect() == 1
        assert any(np.array_equal(np.asarray(line.get_xydata()), way) for line in panel.lines)


def test_contacts_are_crossed(drawings: dict[str, Figure], demos: Demos) -> None:
    """There is a cross for each demo that ends with a contact, and for no other."""
    crosses = [line for line in drawings["demos"].axes[1].lines if line.get_marker() == "x"]
    touching = [demo for demo in demos.incorrect if trace(FIELD, demo.actions).touched[-1]]
    assert len(crosses) == len(touching)
    hits = [demo for demo in touching if demo.kind == "hit"]
    ends = [trace(FIELD, demo.actions).poses[-1, :2] for demo in hits]
    drawn = [np.ravel(line.get_xydata()) for line in crosses]
    assert all(any(np.allclose(end, one) for one in drawn) for end in ends)


@pytest.mark.parametrize("kind", ["field", "demos"])
def test_equal_numbers_give_equal_bytes(
    kind: str, drawings: dict[str, Figure], demos: Demos, tmp_path: Path
) -> None:
    """Drawing and saving again gives the same PNG and SVG, whatever the caller's conditions are."""
    once = [path.read_bytes() for path in save_figure(drawings[kind], tmp_path / "a")]
    with mpl.rc_context({"font.size": 20, "axes.facecolor": "black", "lines.linewidth": 9}):
        again = field_figure(FIELD) if kind == "field" else soccer_demos_figure(demos)
        twice = [path.read_bytes() for path in save_figure(again, tmp_path / "b")]
    assert once == twice


@pytest.mark.parametrize("kind", ["field", "demos", "one panel", "three panels"])
def test_nothing_is_cut_off(kind: str, drawings: dict[str, Figure], tmp_path: Path) -> None:
    """All that is drawn, texts included, lies within the figure."""
    if kind in drawings:
        figure = drawings[kind]
    else:
        titles = ["early"] if kind == "one panel" else ["early", "middle", "last"]
        animation = animate(FIELD, {title: [FORWARD] for title in titles}, decisions=1)
        play(animation, tmp_path)
        figure = animation.figure
    box = figure.get_tightbbox(figure.canvas.get_renderer())  # type: ignore[attr-defined]
    width, height = figure.get_size_inches()
    assert min(box.x0, box.y0) > -0.01
    assert box.x1 < width + 0.01
    assert box.y1 < height + 0.01


def test_legends_are_clear_of_the_panels(drawings: dict[str, Figure], tmp_path: Path) -> None:
    """No legend covers a panel or its labels."""
    animation = animate(FIELD, {"one": [FORWARD], "two": [FORWARD]})
    play(animation, tmp_path)
    for figure in (drawings["demos"], animation.figure):
        (legend,) = figure.legends
        top = legend.get_window_extent().y1
        boxes = [panel.get_tightbbox() for panel in figure.axes]
        assert all(box is not None and box.y0 > top for box in boxes)


def test_gif_is_small_and_repeats(gif: Path, demos: Demos, tmp_path: Path) -> None:
    """The GIF is 7 inches wide at 90 dpi, and making it anew gives the same bytes."""
    with mpl.rc_context({"font.size": 20, "savefig.dpi": 30, "savefig.bbox": "tight"}):
        again = save_gif(moving(demos), tmp_path / "again.gif")
    assert again.read_bytes() == gif.read_bytes()
    with Image.open(gif) as image:
        assert image.width == 630
        shown = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
    assert len(shown) == CUT + 1
    assert set(shown[:-1]) == {200}
    assert shown[-1] == 1000
    assert gif.stat().st_size / len(shown) < 1.5e6 / 41


def test_moving_titles_tell_the_end(demos: Demos, tmp_path: Path) -> None:
    """Each title shows time and decision, and at last why the episode ends or is cut."""
    right = demos.correct[0].actions.tolist()
    pinned = [BACKWARD] * 9  # against the wall: it stays in its cell until the time is up
    cells = SoccerField(rules.SoccerParams(macro="cell", time_limit=60.0))
    shown = animate(FIELD, {"a": [*right, LEFT], "b": [LEFT] * 2, "c": [LEFT] * 99}, decisions=16)
    late = animate(cells, {"d": pinned})
    assert shown.figure.axes[2].get_title(loc="left") == "c\n0.0 s, decision 0"
    for animation in (shown, late):
        play(animation, tmp_path)
    ends = [panel.get_title(loc="left") for panel in shown.figure.axes + late.figure.axes]
    one = trace(FIELD, right)
    assert ends[0] == f"a\ngoal: {one.times[-1]:.1f} s, {len(right)} decisions"
    assert ends[1:3] == ["b\nends after 2 decisions", "c\ncut after 16 decisions"]
    assert re.fullmatch(r"d\ntime out: 6\d\.\d s, [2-8] decisions", ends[3])
    assert all(end.replace("\n", ": ") in shown.description for end in ends[:3])


def test_descriptions_hold_the_facts(demos: Demos) -> None:
    """The texts that stand for the pictures give what is measured, for these demos and fewer."""
    text = describe_soccer_demos(demos)
    assert "15 decisions" in text
    assert "slowly in 3 decisions" in text
    for kind in demos.kinds:
        assert f"{sum(demo.kind == kind for demo in demos.incorrect)} {kind}" in text
    assert "Incorrect" not in describe_soccer_demos(demos.select("none"))
    assert "15 rays of 0.15 m" in describe_field(FIELD)


def test_mazes_are_refused(small_demos: Demos) -> None:
    """Demonstrations of another task are refused by name."""
    with pytest.raises(DemoError, match="small is not robot soccer"):
        soccer_demos_figure(small_demos)
