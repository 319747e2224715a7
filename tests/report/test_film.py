from __future__ import annotations

import re
from pathlib import Path

import matplotlib as mpl
import pytest
from matplotlib.animation import PillowWriter
from PIL import Image, ImageSequence

from replication import Demos
from replication.envs.soccer import rules
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.replay import replay
from replication.envs.soccer.rules import BACKWARD, FORWARD, LEFT
from replication.report.film import Film, film

FIELD = SoccerField()
CUT = 6


def moving(demos: Demos) -> Film:
    """Show an episode that goes on, one that ends soon and one that has no more actions."""
    hit = demos.incorrect[0].actions.tolist()
    return film(
        SoccerField(rules.SoccerParams(drive_time=0.4)),
        {"first & <early>": [LEFT] * 9, "middle": hit, "last": [FORWARD] * CUT},
        decisions=CUT,
    )


def play(shown: Film, folder: Path) -> None:
    """Draw all frames, coarsely."""
    shown.animation.save(folder / "coarse.gif", writer=PillowWriter(), dpi=20)


@pytest.mark.parametrize("titles", [["early"], ["early", "middle", "last"]])
def test_nothing_is_cut_off(titles: list[str], tmp_path: Path) -> None:
    """All that is drawn lies within the figure, and the legend below the panels."""
    shown = film(FIELD, {title: [FORWARD] for title in titles}, decisions=1)
    play(shown, tmp_path)
    figure = shown.figure
    box = figure.get_tightbbox(figure.canvas.get_renderer())  # type: ignore[attr-defined]
    width, height = figure.get_size_inches()
    assert min(box.x0, box.y0) > -0.01
    assert box.x1 < width + 0.01
    assert box.y1 < height + 0.01
    (legend,) = figure.legends
    panels = [panel.get_tightbbox() for panel in figure.axes]
    assert all(panel is not None and panel.y0 > legend.get_window_extent().y1 for panel in panels)


def test_gif_is_small_and_repeats(soccer_demos: Demos, tmp_path: Path) -> None:
    """The GIF is 7 inches wide at 90 dpi, and making it anew gives the same bytes."""
    gif = moving(soccer_demos).save_gif(tmp_path / "new" / "film.gif")
    with mpl.rc_context({"font.size": 20, "savefig.dpi": 30, "savefig.bbox": "tight"}):
        again = moving(soccer_demos).save_gif(tmp_path / "again.gif")
    assert again.read_bytes() == gif.read_bytes()
    with Image.open(gif) as image:
        assert image.width == 630
        durations = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
    assert len(durations) == CUT + 1
    assert set(durations[:-1]) == {200}
    assert durations[-1] == 1000
    assert gif.stat().st_size / len(durations) < 1.5e6 / 41


def test_moving_titles_tell_the_end(soccer_demos: Demos, tmp_path: Path) -> None:
    """Each title shows time and decision, and at last why the episode ends or is cut."""
    right = soccer_demos.correct[0].actions.tolist()
    pinned = [BACKWARD] * 9  # against the wall: it stays in its cell until the time is up
    cells = SoccerField(rules.SoccerParams(macro="cell", time_limit=60.0))
    shown = film(FIELD, {"a": [*right, LEFT], "b": [LEFT] * 2, "c": [LEFT] * 99}, decisions=16)
    late = film(cells, {"d": pinned})
    assert shown.figure.axes[2].get_title(loc="left") == "c\n0.0 s, decision 0"
    for each in (shown, late):
        play(each, tmp_path)
    ends = [panel.get_title(loc="left") for panel in shown.figure.axes + late.figure.axes]
    episode = replay(FIELD, right)
    assert ends[0] == f"a\ngoal: {episode['time'].iloc[-1]:.1f} s, {len(right)} decisions"
    assert ends[1:3] == ["b\nends after 2 decisions", "c\ncut after 16 decisions"]
    assert re.fullmatch(r"d\ntime out: 6\d\.\d s, [2-8] decisions", ends[3])
    assert all(end.replace("\n", ": ") in shown.words for end in ends[:3])


def test_numbers_have_every_decision(soccer_demos: Demos, tmp_path: Path) -> None:
    """The file beside a film has each episode in full, also where the film is cut."""
    right = soccer_demos.correct[0].actions
    shown = film(FIELD, {"right": right, "left": [LEFT] * 9}, decisions=2)
    play(shown, tmp_path)
    lengths = shown.numbers.groupby("episode", sort=False).size().to_dict()
    assert lengths == {"right": len(right) + 1, "left": 10}
