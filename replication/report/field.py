"""Pictures of the soccer field: at the start (Fig. 10), and the demonstrations (Fig. 11).

Axes are in metres and to scale. Walls, gate, paths and sizes are the same in every field
(:mod:`replication.envs.soccer.rules`); all else is in the numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from numpy.typing import ArrayLike, NDArray

from replication.demos.model import Demos
from replication.envs.environment import Environment
from replication.envs.soccer import rules
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.field import SoccerField, as_soccer
from replication.envs.soccer.replay import ray_tips, replay
from replication.report.picture import Picture
from replication.report.style import (
    CORRECT_COLOUR,
    KIND_COLOURS,
    OTHER_KIND_COLOUR,
    canvas,
    legend_below,
    settled,
)

Floats = NDArray[np.float64]

# Okabe and Ito's colours where the mazes have none; the paper's correct demonstration is pink.
PINK, ORANGE, BLUE, YELLOW, VERMILION = "#CC79A7", "#E69F00", "#0072B2", "#F0E442", "#D55E00"
COLOURS = KIND_COLOURS | {"overspeed": ORANGE, "opposite": OTHER_KIND_COLOUR}
SPARE_COLOURS = (VERMILION, BLUE, "#000000", YELLOW)
PATH_COLOUR, WALL_COLOUR, GATE_COLOUR = "#6C8EBF", "0.45", "#D9EAD3"

GATE_DEPTH = 0.06  # of the drawing only: in metres
BESIDE = 0.02  # metres between ways that would hide each other
BROAD, NARROW = 2.3, 1.1  # where kinds share a way, the later is drawn upon the broader earlier one
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
    draw_pitch(panel, small=False)
    _draw_grid(panel)
    things = dict(iter(numbers.groupby("what")))
    pose = things["robot"][["x", "y", "heading"]].to_numpy()[0]
    ball, *_ = things["ball"][["x", "y"]].to_numpy()
    rays, obstacles = (things[name][["x", "y"]].to_numpy() for name in ("ray", "obstacle"))
    for tip in rays:
        panel.plot(*zip(pose[:2], tip, strict=True), color=VERMILION, lw=0.7, zorder=3)
    Movers(panel).place(pose, ball, obstacles)
    reach = things["ray"]["length"].iloc[0]
    x, y, _ = pose
    _label(panel, "controlled robot", (x, y - reach - 0.012), va="top")
    text = f"{len(rays)} infrared rays,\n{reach:g} m long"
    _label(panel, text, (x, y + reach + 0.012), va="bottom", color=VERMILION)
    _label(panel, "ball", (ball[0], ball[1] + 0.035), va="bottom")
    _label(panel, "gate", (rules.WIDTH - 0.012, np.mean(rules.GATE)), ha="right", va="center")
    for number, (path, place) in enumerate(zip(rules.PATHS, obstacles, strict=True), 1):
        upright = path.start[0] == path.end[0]
        text = f"obstacle {number}\n{path.speed:.2f} m/s"
        if upright:
            _label(panel, text, (place[0] + 0.05, place[1]), ha="left", va="center")
        else:
            _label(panel, text, (place[0], place[1] - 0.05), va="top")
    panel.set(xlabel="x (m)", ylabel="y (m)")
    return figure


def _draw_grid(panel: Axes) -> None:
    """Draw the borders between the cells of the state space."""
    style: dict[str, Any] = {"color": "0.9", "lw": 0.5, "zorder": 0.15}
    floor = Polygon(_outline(), transform=panel.transData)
    for column in range(1, rules.COLUMNS):
        x = column * rules.WIDTH / rules.COLUMNS
        (line,) = panel.plot([x, x], [0, rules.HEIGHT], **style)
        line.set_clip_path(floor)
    for row in range(1, rules.ROWS):
        y = row * rules.HEIGHT / rules.ROWS
        (line,) = panel.plot([0, rules.WIDTH], [y, y], **style)
        line.set_clip_path(floor)


def _label(panel: Axes, text: str, place: tuple[float, Any], **style: Any) -> None:
    standard: dict[str, Any] = {"ha": "center", "zorder": 8, "linespacing": 1.1}
    panel.text(*place, text, **standard | style)


# --- demonstrations (Fig. 11) ----------------------------------------------------------------


def demonstrations(demos: Demos) -> Picture:
    """Show the correct demonstrations, and the incorrect ones in the same field."""
    field = as_soccer(demos.environment)
    tables = []
    for demo in demos.correct + demos.incorrect:
        table = episode_numbers(field, demo.actions)
        table.insert(0, "kind", demo.kind)
        table.insert(1, "demo", demo.name)
        tables.append(table)
    numbers = pd.concat(tables, ignore_index=True)
    return Picture(numbers, draw_demonstrations, _describe_demonstrations(numbers))


def episode_numbers(field: SoccerField, actions: Iterable[int]) -> pd.DataFrame:
    """Return an episode as rows, one for each border between two decisions.

    `action` is the decision that follows, `touched` whether the robot touched something in the one
    before; `outcome` is why the episode is over, or "open".
    """
    episode = replay(field, actions)
    columns = {
        "decision": np.arange(len(episode.times)),
        "time": episode.times,
        "x": episode.poses[:, 0],
        "y": episode.poses[:, 1],
        "heading": episode.poses[:, 2],
        "ball_x": episode.balls[:, 0],
        "ball_y": episode.balls[:, 1],
        "detected": episode.detected,
        "action": [*(rules.ACTIONS[action] for action in episode.actions), ""],
        "touched": [False, *episode.touched],
        "outcome": episode.outcome,
    }
    for number in range(episode.obstacles.shape[1]):
        columns[f"obstacle_{number + 1}_x"] = episode.obstacles[:, number, 0]
        columns[f"obstacle_{number + 1}_y"] = episode.obstacles[:, number, 1]
        columns[f"obstacle_{number + 1}_seen"] = episode.seen[:, number]
    return pd.DataFrame(columns)


def obstacle_columns(*axes: str) -> list[list[str]]:
    """Return the names of each obstacle's columns."""
    return [[f"obstacle_{n}_{axis}" for axis in axes] for n in range(1, len(rules.PATHS) + 1)]


def _describe_demonstrations(numbers: pd.DataFrame) -> str:
    correct, incorrect = _split(numbers)
    first = correct[0]
    seen = [str(decision) for decision in first["decision"][first["detected"]]]
    listed = " and ".join(filter(None, [", ".join(seen[:-1]), *seen[-1:]]))
    detected = (
        f"it detects a moving robot after {listed} decisions"
        if seen
        else "it never detects a moving robot"
    )
    text = (
        f"Ways of the robot on the soccer field. The correct demonstration takes "
        f"{len(first) - 1} decisions and {first['time'].iloc[-1]:.1f} s to the goal; {detected} "
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


def _is_slow(demo: pd.DataFrame) -> NDArray[np.bool_]:
    return (demo["action"] == rules.ACTIONS[rules.SLOW]).to_numpy()


def _ends_in_contact(demo: pd.DataFrame) -> bool:
    last = demo.iloc[-1]
    return bool(last["touched"] and last["outcome"] != "goal")


@settled
def draw_demonstrations(numbers: pd.DataFrame) -> Figure:
    """Draw correct demonstrations with what they detect, and incorrect ones from where they leave.

    An incorrect demonstration is drawn from where it leaves the first correct one. If it stays on
    that one's way it is drawn beside it, else one would hide the other.
    """
    correct, incorrect = _split(numbers)
    figure, axes = canvas(1, 2, height=4.05, sharex=True, sharey=True)
    for panel, title in zip(axes, ("(a) correct", "(b) incorrect"), strict=True):
        draw_pitch(panel)
        panel.set(title=title, xlabel="x (m)")
    axes[0].set_ylabel("y (m)")
    axes[1].tick_params(left=False)
    for demo in correct:
        _draw_correct(axes[0], demo)
        axes[1].plot(*_way(demo).T, color=PINK, lw=1.0, zorder=3)
    handles = [
        Line2D([], [], color=PINK, marker="o", ms=3.5, label=f"correct ({len(correct)})"),
        Line2D([], [], color=PINK, label="drives slowly", **SLOW),
        Line2D(
            [], [], lw=0, marker="o", ms=10, mfc="none", mec=CORRECT_COLOUR, label="detected robot"
        ),
        Line2D([], [], lw=0, marker="x", ms=5, mew=1.5, color="0.3", label="ends with a contact"),
    ]
    beside = (side * rank for rank in itertools.count(1) for side in (1, -1))
    spare = itertools.cycle(SPARE_COLOURS)
    for rank, (kind, demos) in enumerate(incorrect.items()):
        colour = COLOURS.get(kind) or next(spare)
        line: dict[str, Any] = {"color": colour, "lw": NARROW if rank else BROAD}
        for demo in demos:
            _draw_incorrect(axes[1], demo, _way(correct[0]), line, beside)
        handles.append(Line2D([], [], label=f"{kind} ({len(demos)})", **line))
    first = correct[0].iloc[0]
    for panel in axes:
        Movers(panel, obstacles=False).place(
            first[["x", "y", "heading"]], first[["ball_x", "ball_y"]]
        )
    legend_below(figure, handles)
    return figure


def _way(demo: pd.DataFrame) -> Floats:
    return demo[["x", "y"]].to_numpy()


def _draw_correct(panel: Axes, demo: pd.DataFrame) -> None:
    x, y = _way(demo).T
    slow = np.flatnonzero(_is_slow(demo))
    panel.plot(x, y, color=PINK, marker="o", ms=2.8, zorder=5)
    panel.plot(x[slow], y[slow], color=PINK, lw=0, zorder=6, **SLOW)
    for *place, seen in obstacle_columns("x", "y", "seen"):
        places = demo.loc[demo[seen], place].to_numpy()
        for centre, alpha in zip(places, np.linspace(0.35, 0.9, len(places)), strict=True):
            _draw_obstacle(panel, centre, alpha)
        if len(places):
            centre = (places.min(axis=0) + places.max(axis=0)) / 2
            radius = np.abs(places - centre).max() + 0.8 * rules.ROBOT_SIDE
            panel.add_patch(Circle(centre, radius, fill=False, ec=CORRECT_COLOUR, lw=1.4, zorder=7))


def _draw_incorrect(
    panel: Axes, demo: pd.DataFrame, right: Floats, line: Mapping[str, Any], beside: Iterator[int]
) -> None:
    way = _way(demo)
    shared = min(len(way), len(right))
    same = (way[:shared] == right[:shared]).all(axis=1)
    branch = way[(shared if same.all() else int(same.argmin())) - 1 :]
    on_way = np.array([_distance(place, right) < BESIDE / 2 for place in branch])
    if on_way[1:].mean() > 0.5:
        x, y = right[-1] - right[0]
        across = np.array([-y, x]) / np.hypot(x, y)
        branch = branch + on_way[:, None] * next(beside) * BESIDE * across
    panel.plot(*branch.T, marker="o", ms=line["lw"] + 0.6, zorder=5.5, **line)
    if _ends_in_contact(demo):
        panel.plot(*branch[-1], "x", color=line["color"], ms=5.5, mew=1.6, zorder=6)
    elif demo["outcome"].iloc[-1] != "goal":
        style = {"arrowstyle": "-|>", "color": line["color"], "shrinkA": 0, "shrinkB": 0}
        panel.annotate("", branch[-1], branch[-2], arrowprops=style, zorder=6)


def _distance(place: Floats, way: Floats) -> float:
    """Return how far a place is from a polyline."""
    start, step = way[:-1], np.diff(way, axis=0)
    square = np.maximum((step**2).sum(axis=1), 1e-12)
    part = np.clip(((place - start) * step).sum(axis=1) / square, 0, 1)[:, None]
    return float(np.linalg.norm(start + part * step - place, axis=1).min())


# --- pieces ----------------------------------------------------------------------------------


def draw_pitch(panel: Axes, *, small: bool = True) -> None:
    """Draw walls, gate and the obstacles' paths, and set up the axes."""
    width, head, gap, layer = (0.6, 6, 0.4, 1.0) if small else (1.0, 10, 0.2, 4.5)
    thick = 2 * rules.WALL_RADIUS
    low, high = rules.GATE
    gate = [(rules.WIDTH, low), (rules.WIDTH + GATE_DEPTH, low)]
    gate += [(rules.WIDTH + GATE_DEPTH, high), (rules.WIDTH, high)]
    panel.add_patch(Polygon(_outline(thick), fc=WALL_COLOUR, lw=0, zorder=0))
    panel.add_patch(Polygon(_outline(), fc="white", lw=0, zorder=0.1))
    panel.add_patch(Polygon(gate, fc=GATE_COLOUR, ec="#2E7D32", lw=0.8, hatch="xxxx", zorder=0.2))
    for path in rules.PATHS:
        arrow = {"arrowstyle": "<|-|>", "ls": "--", "color": PATH_COLOUR, "lw": width}
        arrow |= {"shrinkA": 0, "shrinkB": 0, "mutation_scale": head}
        panel.annotate("", path.end, path.start, arrowprops=arrow, zorder=layer)
    margin = thick + 0.01
    panel.set(
        xlim=(-margin, rules.WIDTH + GATE_DEPTH + 0.01),
        ylim=(-margin, rules.HEIGHT + margin),
        aspect="equal",
        anchor="N",  # else the layout, which knows nothing of the aspect, may cut a title
        xticks=np.arange(0, rules.WIDTH + 0.01, gap),
        yticks=np.arange(0, rules.HEIGHT + 0.01, gap),
    )
    panel.spines[:].set_visible(False)
    panel.tick_params(length=2)


def _outline(grow: float = 0.0) -> Floats:
    """Return the corners of the field, or of what is further out by `grow`."""
    cut = rules.CORNER + grow * (2 - np.sqrt(2))
    low, right, top = -grow, rules.WIDTH + grow, rules.HEIGHT + grow
    return np.array(
        [
            (low, low + cut),
            (low + cut, low),
            (right - cut, low),
            (right, low + cut),
            (right, top - cut),
            (right - cut, top),
            (low + cut, top),
            (low, top - cut),
        ]
    )


_BODY = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
_NOSE = ((0.5, 0.0), (-0.35, -0.27), (-0.35, 0.27))  # a triangle that points ahead
_STRIPE = ((-0.5, -0.16), (0.5, -0.16), (0.5, 0.16), (-0.5, 0.16))


def _placed(pose: Iterable[float], shape: ArrayLike) -> Floats:
    """Turn and move a shape, given in sides of a robot, to a pose."""
    x, y, heading = pose
    turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    return np.asarray(shape) * rules.ROBOT_SIDE @ turn + (x, y)


def _draw_obstacle(panel: Axes, place: Floats, alpha: float) -> None:
    pose = (*place, 0.0)
    style: dict[str, Any] = {"alpha": alpha, "zorder": 4}
    panel.add_patch(Polygon(_placed(pose, _BODY), fc=YELLOW, ec="0.2", lw=0.6, **style))
    panel.add_patch(Polygon(_placed(pose, _STRIPE), fc=CORRECT_COLOUR, lw=0, **style))


class Movers:
    """All that moves, in one panel."""

    def __init__(self, panel: Axes, *, obstacles: bool = True) -> None:
        def patch(colour: str, **style: Any) -> Polygon:
            shape = Polygon(((0, 0),), fc=colour, **{"zorder": 4, "lw": 0} | style)
            panel.add_patch(shape)
            return shape

        edge: dict[str, Any] = {"ec": "0.2", "lw": 0.6}
        n_obstacles = len(rules.PATHS) if obstacles else 0
        self.obstacles = [
            (patch(YELLOW, **edge), patch(CORRECT_COLOUR)) for _ in range(n_obstacles)
        ]
        self.robot = patch(BLUE, **edge, zorder=5), patch(CORRECT_COLOUR, zorder=5)
        self.ball = Circle((0, 0), rules.BALL_RADIUS, fc="white", ec="black", lw=0.9, zorder=5)
        panel.add_patch(self.ball)

    def place(
        self, pose: Iterable[float], ball: Iterable[float], obstacles: Sequence[Floats] = ()
    ) -> None:
        """Put everything in its place."""
        for patch, shape in zip(self.robot, (_BODY, _NOSE), strict=True):
            patch.set_xy(_placed(pose, shape))
        x, y = ball
        self.ball.set_center((float(x), float(y)))
        for patches, (x, y) in zip(self.obstacles, obstacles, strict=False):
            for patch, shape in zip(patches, (_BODY, _STRIPE), strict=True):
                patch.set_xy(_placed((x, y, 0.0), shape))
