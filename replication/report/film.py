"""Episodes of robot soccer, moving."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from replication.demos.model import Demos
from replication.envs.soccer import rules
from replication.envs.soccer.field import as_soccer
from replication.envs.soccer.replay import replay
from replication.irl import Trial
from replication.report.moving import Player, key_entry, player_page
from replication.report.pitch import (
    BLUE,
    BODY,
    NOSE,
    STRIPE,
    VERMILION,
    YELLOW,
    obstacle_columns,
)
from replication.report.stages import EXPERT, METRE, metres, stage


def turning_points(trial: Trial) -> dict[str, Iterable[int]]:
    """Return the actions of a trial's first, middle and last episode, by title."""
    iterations = (0, trial.iterations // 2, trial.iterations)
    return {f"iteration {i}": trial.episodes[i].actions.tolist() for i in iterations}


def film(demos: Demos, episodes: Mapping[str, Iterable[int]]) -> Player:
    """Show episodes, given as actions by title, with a frame for each border of two decisions."""
    field, place = as_soccer(demos.environment), stage(demos)
    tables = {title: replay(field, actions) for title, actions in episodes.items()}
    ends = "; ".join(f"{title}: {_end(table)}" for title, table in tables.items())
    content = {
        "title": "Episodes of robot soccer",
        "unit": "decision",
        "rate": 8,
        "continuous": True,
        "view": place.view,
        "still": place.still,
        "movers": [*[OBSTACLE] * len(rules.PATHS), BALL, ROBOT],
        "marks": None,
        "chart": "",
        "key": "".join(key_entry(*entry) for entry in KEY),
        "choices": [
            {"name": "Episode", "options": [*map(html.escape, tables)], "start": len(tables) - 1}
        ],
        "plays": [{"text": "", "panels": [_panel(table)]} for table in tables.values()],
    }
    words = f"Episodes of robot soccer, decision by decision. {ends[:1].upper()}{ends[1:]}."
    numbers = pd.concat(tables, names=["episode", None]).reset_index("episode")
    return Player(player_page(content, words), numbers, words)


def _polygon(shape: Iterable[tuple[float, float]], attributes: str) -> str:
    """Return a shape, given in sides of a robot that heads to the right, as SVG."""
    side = METRE * rules.ROBOT_SIDE
    corners = " ".join(f"{side * x:g},{-side * y:g}" for x, y in shape)
    return f'<polygon points="{corners}" {attributes}/>'


OUTLINE = 'stroke="#333" stroke-width="1.5"'
ROBOT = _polygon(BODY, f'fill="{BLUE}" {OUTLINE}') + _polygon(NOSE, 'fill="#fff"')
OBSTACLE = _polygon(BODY, f'fill="{YELLOW}" {OUTLINE}') + _polygon(STRIPE, f'fill="{VERMILION}"')
BALL = f'<circle r="{METRE * rules.BALL_RADIUS:g}" fill="#fff" stroke="#000" stroke-width="2.5"/>'
KEY = (
    ("-40 -27 80 54", ROBOT, "controlled robot"),
    ("-40 -27 80 54", OBSTACLE, "obstacle"),
    ("-40 -27 80 54", BALL, "ball"),
    ("-12 -8 24 16", '<path class="way" d="M-10 0H10"/>', "the robot\u2019s way"),
    ("-12 -8 24 16", EXPERT, "the expert\u2019s way"),
)


def _panel(table: pd.DataFrame) -> dict[str, object]:
    """Return the panel of an episode."""
    headings = -np.degrees(np.unwrap(table["heading"]))  # it turns the short way
    bodies = [metres(table[names]) for names in obstacle_columns("x", "y")]
    ball, robot = metres(table[["ball_x", "ball_y"]]), metres(table[["x", "y"]])
    frames = []
    for i, time in enumerate(table["time"]):
        places = [f"{x} {y} 0" for x, y in (*(body[i] for body in bodies), ball[i])]
        places.append(f"{robot[i][0]} {robot[i][1]} {headings[i]:.0f}")
        line = f"{'L' if i else 'M'}{robot[i][0]} {robot[i][1]}"
        frames.append([line, f"{time:.1f} s", " ".join(places), ""])
    frames[-1][1] = _end(table)
    return {"name": "", "colour": "currentColor", "wide": 2, "marked": False, "frames": frames}


def _end(table: pd.DataFrame) -> str:
    """Return how an episode ends."""
    taken, last = len(table) - 1, table.iloc[-1]
    if last["outcome"] == "open":
        return f"ends after {taken} decisions"
    return f"{last['outcome']}: {last['time']:.1f} s, {taken} decisions"
