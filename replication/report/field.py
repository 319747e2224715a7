"""Pictures of the soccer field: at the start (Fig. 10), and the demonstrations (Fig. 11).

One file because it is one field, whose walls, paths and sizes are the same in both.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray

from replication.demos.model import Demos
from replication.envs.environment import Environment
from replication.envs.soccer import rules
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.field import SoccerField, as_soccer
from replication.envs.soccer.replay import ray_tips, replay
from replication.report import pitch
from replication.report.picture import Picture
from replication.report.style import (
    CORRECT_COLOUR,
    KIND_COLOURS,
    OTHER_KIND_COLOUR,
    canvas,
    legend_below,
    settled,
)
from replication.report.ways import lanes

COLOURS = KIND_COLOURS | {"overspeed": pitch.ORANGE, "opposite": OTHER_KIND_COLOUR}
SPARE_COLOURS = (pitch.VERMILION, pitch.BLUE, "#000000", pitch.YELLOW)

BESIDE = 0.022  # metres between ways that share a stretch
HEADS = 0.45  # metres of a way at least between two of its heads
SLOW: dict[str, Any] = {"marker": "D", "ms": 4.5, "mfc": "white", "mew": 1.2}


# --- the field (Fig. 10) ---------------------------------------------------------------------


def start(environment: Environment) -> Picture:
    """Show the field from above, at the start of an episode."""
    field = as_soccer(environment)
    world = FastSoccerWorld(field.params)
    world.reset()
    (x, y, heading), tips = world.pose, ray_tips(world)
    rows: list[dict[str, Any]] = [{"what": "robot", "x": x, "y": y, "heading": heading}]
    rows += [{"what": "ball", "x": world.ball[0], "y": world.ball[1]}]
    rows += [{"what": "obstacle", "x": x, "y": y} for x, y, *_ in world.obstacles]
    rows += [{"what": "ray", "x": x, "y": y, "length": field.params.ray_length} for x, y in tips]
    return Picture(pd.DataFrame(rows), draw_start, _describe_start(field))


def _describe_start(field: SoccerField) -> str:
    params = field.params
    (x, y), ball = rules.ROBOT_START, rules.BALL_START
    paths = "; ".join(
        f"from ({path.start[0]:g}, {path.start[1]:g}) to ({path.end[0]:g}, {path.end[1]:g})"
        for path in rules.PATHS
    )
    return (
        f"The soccer field from above, {rules.WIDTH:g} m wide and {rules.HEIGHT:g} m high, in "
        f"walls with cut corners, under a grid of {rules.COLUMNS} x {rules.ROWS} cells. The gate "
        f"is in the right wall, from y = {rules.GATE[0]:g} to {rules.GATE[1]:g} m; the ball is at"
        f" ({ball[0]:g}, {ball[1]:g}). The controlled robot starts at ({x:g}, {y:g}), faces the "
        f"ball and has {params.rays} rays of {params.ray_length:g} m over {params.ray_arc} degrees."
        f" {len(rules.PATHS)} moving obstacles go back and forth: {paths}."
    )


@settled
def draw_start(numbers: pd.DataFrame) -> Figure:
    """Draw the field with its grid, and all that stands on it with labels."""
    figure, (panel,) = canvas(1, 1, height=5.95)
    pitch.draw_pitch(panel, small=False)
    _draw_grid(panel)
    things = dict(iter(numbers.groupby("what")))
    pose = things["robot"][["x", "y", "heading"]].to_numpy()[0]
    ball, *_ = things["ball"][["x", "y"]].to_numpy()
    rays, obstacles = (things[name][["x", "y"]].to_numpy() for name in ("ray", "obstacle"))
    for tip in rays:
        panel.plot(*zip(pose[:2], tip, strict=True), color=pitch.VERMILION, lw=0.7, zorder=3)
    pitch.Movers(panel).place(pose, ball, obstacles)
    reach = things["ray"]["length"].iloc[0]
    x, y, _ = pose
    _label(panel, "controlled robot", (x, y - reach - 0.012), va="top")
    text = f"{len(rays)} infrared rays,\n{reach:g} m long"
    _label(panel, text, (x, y + reach + 0.012), va="bottom", color=pitch.VERMILION)
    _label(panel, "ball", (ball[0], ball[1] + 0.035), va="bottom")
    beyond = rules.WIDTH + pitch.GATE_DEPTH
    _label(panel, "gate", (beyond + 0.01, np.mean(rules.GATE)), ha="left", va="center", rotation=90)
    for number, (path, (x, y)) in enumerate(zip(rules.PATHS, obstacles, strict=True), 1):
        text = f"obstacle {number}\n{path.speed:.2f} m/s"
        if path.start[0] == path.end[0]:
            _label(panel, text, (x + 0.05, y), ha="left", va="center")
        else:
            _label(panel, text, (x, y - 0.05), va="top")
    panel.set(xlabel="x (m)", ylabel="y (m)", xlim=(panel.get_xlim()[0], beyond + 0.05))
    return figure


def _draw_grid(panel: Axes) -> None:
    """Draw the borders between the cells of the state space."""
    style: dict[str, Any] = {"color": "0.9", "lw": 0.5, "zorder": 0.15}
    x = np.arange(1, rules.COLUMNS) * rules.WIDTH / rules.COLUMNS
    y = np.arange(1, rules.ROWS) * rules.HEIGHT / rules.ROWS
    lines = panel.plot([x, x], np.array([[0], [rules.HEIGHT]]), **style)
    lines += panel.plot(np.array([[0], [rules.WIDTH]]), [y, y], **style)
    floor = Polygon(pitch.outline(), transform=panel.transData)
    for line in lines:
        line.set_clip_path(floor)


def _label(panel: Axes, text: str, place: tuple[float, Any], **style: Any) -> None:
    standard: dict[str, Any] = {"ha": "center", "zorder": 8, "linespacing": 1.1}
    panel.text(*place, text, **standard | style)


# --- demonstrations (Fig. 11) ----------------------------------------------------------------


def demonstrations(demos: Demos) -> Picture:
    """Show the correct demonstrations, and the incorrect ones in the same field."""
    field = as_soccer(demos.environment)
    tables = {
        (demo.kind, demo.name): replay(field, demo.actions)
        for demo in demos.correct + demos.incorrect
    }
    numbers = pd.concat(tables, names=["kind", "demo", None]).reset_index(["kind", "demo"])
    return Picture(numbers, draw_demonstrations, _describe_demonstrations(numbers))


def _describe_demonstrations(numbers: pd.DataFrame) -> str:
    correct, incorrect = _split(numbers)
    first = correct[0]
    seen = [str(decision) for decision in first["decision"][first["detected"]]]
    listed = " and ".join(filter(None, [", ".join(seen[:-1]), *seen[-1:]]))
    detects = f"detects a moving robot after {listed} decisions"
    text = (
        f"Ways of the robot on the soccer field. The correct demonstration takes "
        f"{len(first) - 1} decisions and {first['time'].iloc[-1]:.1f} s to the goal; it "
        f"{detects if seen else 'never detects a moving robot'} "
        f"and drives slowly in {_is_slow(first).sum()} decisions."
    )
    if not incorrect:
        return text
    counts = [f"{len(demos)} {kind}" for kind, demos in incorrect.items()]
    contacts = sum(_ends_in_contact(demo) for demos in incorrect.values() for demo in demos)
    return f"{text} Incorrect ones: {', '.join(counts)}; {contacts} of them end with a contact."


def _split(numbers: pd.DataFrame) -> tuple[list[pd.DataFrame], dict[str, list[pd.DataFrame]]]:
    """Return the rows of each correct demonstration, and of the incorrect ones by kind."""
    by_kind: dict[str, list[pd.DataFrame]] = {"correct": []}
    for (kind, _), demo in numbers.groupby(["kind", "demo"], sort=False):
        by_kind.setdefault(kind, []).append(demo)
    return by_kind.pop("correct"), by_kind


def _is_slow(demo: pd.DataFrame) -> pd.Series:
    return demo["action"] == rules.ACTIONS[rules.SLOW]


def _ends_in_contact(demo: pd.DataFrame) -> bool:
    last = demo.iloc[-1]
    return bool(last["touched"] and last["outcome"] != "goal")


@settled
def draw_demonstrations(numbers: pd.DataFrame) -> Figure:
    """Draw correct demonstrations with what they detect, and incorrect ones from where they leave.

    An incorrect demonstration is drawn from where it leaves the first correct one. Where it shares
    its way with others it is drawn beside them, else one would hide the other.
    """
    figure, axes = canvas(1, 2, height=3.72, sharex=True, sharey=True)
    pitch.draw_pitch(axes[0])
    for demo in _split(numbers)[0]:
        _draw_correct(axes[0], demo)
    _place(axes[0], numbers)
    first, *kinds = draw_ways(axes[1], numbers)
    for panel, title in zip(axes, ("(a) correct", "(b) incorrect"), strict=True):
        panel.set(title=title, xlabel="x (m)")
    axes[0].set_ylabel("y (m)")
    axes[1].tick_params(left=False)
    ring: dict[str, Any] = {"marker": "o", "ms": 10, "mfc": "none", "mec": CORRECT_COLOUR}
    cross: dict[str, Any] = {"marker": "x", "ms": 5, "mew": 1.5, "color": "0.3"}
    marks = [
        Line2D([], [], color=pitch.PINK, label="drives slowly", **SLOW),
        Line2D([], [], lw=0, label="detected robot", **ring),
        Line2D([], [], lw=0, label="ends with a contact", **cross),
    ]
    legend_below(figure, [first, *marks, *kinds])
    return figure


def draw_ways(panel: Axes, numbers: pd.DataFrame) -> list[Line2D]:
    """Draw the field with the ways of all demonstrations; return the entries of the legend."""
    correct, incorrect = _split(numbers)
    pitch.draw_pitch(panel)
    right: dict[str, Any] = {"color": pitch.PINK, "marker": "o", "ms": 2.8}
    for demo in correct:
        panel.plot(*_way(demo).T, zorder=3, **right)
    handles = [Line2D([], [], label=f"correct ({len(correct)})", **right)]
    colours = _colours(incorrect)
    demos = [(kind, demo) for kind, each in incorrect.items() for demo in each]
    every = [(each, _branch(_way(each[1]), _way(correct[0]))) for each in demos]
    leaving = [(each, way) for each, way in every if len(way) > 1]
    apart = _apart([way for _, way in leaving], _way(correct[0]))
    for ((kind, demo), _), way in zip(leaving, apart, strict=True):
        _draw_incorrect(panel, demo, way, colours[kind])
    for kind, each in incorrect.items():
        style: dict[str, Any] = {"color": colours[kind], "marker": ">", "ms": 4}
        handles.append(Line2D([], [], label=f"{kind} ({len(each)})", **style))
    _place(panel, numbers)
    return handles


def _place(panel: Axes, numbers: pd.DataFrame) -> None:
    """Put the robot and the ball where they start."""
    start = numbers.iloc[0]
    movers = pitch.Movers(panel, obstacles=False)
    movers.place(start[["x", "y", "heading"]], start[["ball_x", "ball_y"]])


def _way(demo: pd.DataFrame) -> pitch.Floats:
    return demo[["x", "y"]].to_numpy()


def _draw_correct(panel: Axes, demo: pd.DataFrame) -> None:
    panel.plot(*_way(demo).T, color=pitch.PINK, marker="o", ms=2.8, zorder=5)
    panel.plot(*_way(demo[_is_slow(demo)]).T, color=pitch.PINK, lw=0, zorder=6, **SLOW)
    for *names, seen in pitch.obstacle_columns("x", "y", "seen"):
        places = demo.loc[demo[seen], names].to_numpy()
        for (x, y), alpha in zip(places, np.linspace(0.35, 0.9, len(places)), strict=True):
            style: dict[str, Any] = {"alpha": alpha, "zorder": 4}
            body, stripe = (pitch.placed((x, y, 0.0), each) for each in (pitch.BODY, pitch.STRIPE))
            panel.add_patch(Polygon(body, fc=pitch.YELLOW, **pitch.EDGE, **style))
            panel.add_patch(Polygon(stripe, fc=CORRECT_COLOUR, lw=0, **style))
        if len(places):
            centre = (places.min(axis=0) + places.max(axis=0)) / 2
            radius = np.abs(places - centre).max() + 0.8 * rules.ROBOT_SIDE
            panel.add_patch(Circle(centre, radius, fill=False, ec=CORRECT_COLOUR, lw=1.4, zorder=7))


def _colours(kinds: Iterable[str]) -> dict[str, str]:
    """Return a colour for each kind of mistake, the user's own kinds included."""
    own = (kind for kind in kinds if kind not in COLOURS)
    return COLOURS | dict(zip(own, itertools.cycle(SPARE_COLOURS), strict=False))


def _branch(way: pitch.Floats, right: pitch.Floats) -> pitch.Floats:
    """Return a way from where it leaves the right one."""
    shared = min(len(way), len(right))
    same = (way[:shared] == right[:shared]).all(axis=1)
    return way[(shared if same.all() else int(same.argmin())) - 1 :]


def _apart(ways: Sequence[pitch.Floats], right: pitch.Floats) -> list[pitch.Floats]:
    """Return ways moved aside where they share a stretch with each other or the right one."""
    every = [right, *ways]
    chosen = lanes(every, lambda one, other: bool(_shared(one, other).any()))
    moved = []
    for n, (way, lane) in enumerate(zip(ways, chosen[1:], strict=True), 1):
        shared = np.any([_shared(way, other) for other in every[:n]], axis=0)
        ahead = np.gradient(way, axis=0) * (-1 if way[-1][0] < way[0][0] else 1)
        across = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
        moved.append(way + shared[:, None] * lane * BESIDE * across)
    return moved


def _shared(way: pitch.Floats, other: pitch.Floats) -> NDArray[np.bool_]:
    """Return which places of a way lie on another: three in a row, else it is a crossing."""
    on = np.array([_distance(place, other) < BESIDE / 2 for place in way])
    runs = [list(run) for _, run in itertools.groupby(on)]
    return np.concatenate([np.full(len(run), run[0] and len(run) > 2) for run in runs])


def _draw_incorrect(panel: Axes, demo: pd.DataFrame, way: pitch.Floats, colour: str) -> None:
    """Draw a way with a head in every other stretch, and with how it ends."""
    panel.plot(*way.T, marker="o", ms=2, lw=1.3, color=colour, zorder=5.5)
    contact = _ends_in_contact(demo)
    if contact:
        panel.plot(*way[-1], "x", color=colour, ms=5.5, mew=1.6, zorder=6)
    run = np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))
    heads = [int(np.searchsorted(run, at)) for at in np.arange(HEADS / 2, run[-1], HEADS)]
    for head in heads or [len(run) - 1]:
        tip = (way[head] + 2 * way[head + 1]) / 3
        arrow = {"arrowstyle": "-|>", "color": colour, "shrinkA": 0, "shrinkB": 0}
        panel.annotate("", tip, way[head], arrowprops=arrow | {"mutation_scale": 8}, zorder=6)


def _distance(place: pitch.Floats, way: pitch.Floats) -> float:
    """Return how far a place is from a polyline."""
    start, step = way[:-1], np.diff(way, axis=0)
    square = np.maximum((step**2).sum(axis=1), 1e-12)
    part = np.clip(((place - start) * step).sum(axis=1) / square, 0, 1)[:, None]
    return float(np.linalg.norm(start + part * step - place, axis=1).min())
