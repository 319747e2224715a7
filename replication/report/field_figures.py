"""All drawing of the soccer field: still (Figs. 10 and 11), and moving.

What is drawn is replayed from the actions (`trace`); the axes are in metres and to scale. The rules
of `replication.report.figures` hold here too: no pyplot, and equal numbers give equal bytes.
"""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Polygon
from numpy.typing import ArrayLike, NDArray

from replication.demos.checks import DemoError
from replication.demos.model import Demo, Demos
from replication.envs.soccer import rules
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.field import SoccerField
from replication.files import write_file
from replication.report.style import (
    CORRECT_COLOUR,
    KIND_COLOURS,
    OTHER_KIND_COLOUR,
    WIDTH,
    canvas,
    legend_below,
    settled,
    style,
)

Floats = NDArray[np.float64]

# Okabe and Ito's colours where the mazes have none; the paper's correct demonstration is pink.
PINK, ORANGE, BLUE, YELLOW, VERMILION = "#CC79A7", "#E69F00", "#0072B2", "#F0E442", "#D55E00"
COLOURS = KIND_COLOURS | {"overspeed": ORANGE, "opposite": OTHER_KIND_COLOUR}
SPARE_COLOURS = (VERMILION, BLUE, "#000000", YELLOW)
PATH_COLOUR, WALL_COLOUR, GATE_COLOUR = "#6C8EBF", "0.45", "#D9EAD3"

GATE_DEPTH = 0.06  # of the drawing only: in metres
BESIDE = 0.02  # metres between ways that would hide each other
FRAMES_A_SECOND, LAST_FRAMES, DPI = 5, 5, 90


@dataclass(frozen=True)
class Trace:
    """What happened in an episode of T decisions, at each border between two decisions.

    Attributes
    ----------
    times
        Simulated time in s, [T + 1].
    poses
        The robot's x, y and heading, [T + 1, 3].
    balls
        The ball's x and y, [T + 1, 2].
    obstacles
        The obstacles' x and y, [T + 1, obstacle, 2].
    detected
        Whether an obstacle is detected, [T + 1].
    seen
        Which obstacles the rays hit, [T + 1, obstacle].
    actions
        The decisions, [T].
    touched
        Whether the robot touched an obstacle or a wall in a decision, [T].
    scored, timed_out
        Why the episode is over, if it is.
    """

    times: Floats
    poses: Floats
    balls: Floats
    obstacles: Floats
    detected: NDArray[np.bool_]
    seen: NDArray[np.bool_]
    actions: NDArray[np.int64]
    touched: NDArray[np.bool_]
    scored: bool
    timed_out: bool

    @property
    def outcome(self) -> str:
        """Why the episode is over: "goal", "time out", or "" if it is not."""
        return "goal" if self.scored else "time out" if self.timed_out else ""


def trace(field: SoccerField, actions: Sequence[int] | NDArray[np.int64]) -> Trace:
    """Replay actions, up to the end of the episode."""
    world = FastSoccerWorld(field.params)
    rows, taken, touched = [_row(world, world.reset())], [], []
    scored = timed_out = False
    for action in actions:
        if scored or timed_out:
            break
        before = sum(world.contacts)
        state, scored, timed_out = world.step(int(action))
        rows.append(_row(world, state))
        taken.append(int(action))
        touched.append(sum(world.contacts) > before)
    times, poses, balls, obstacles, detected, seen = zip(*rows, strict=True)
    return Trace(
        times=np.array(times),
        poses=np.array(poses),
        balls=np.array(balls),
        obstacles=np.array(obstacles),
        detected=np.array(detected),
        seen=np.array(seen),
        actions=np.array(taken, dtype=np.int64),
        touched=np.array(touched, dtype=bool),
        scored=scored,
        timed_out=timed_out,
    )


def _row(world: FastSoccerWorld, state: int) -> tuple[Any, ...]:
    obstacles = np.array(world.obstacles)[:, :2]
    detected = rules.decode(state)[2]
    seen = np.zeros(len(obstacles), dtype=bool)
    if detected:
        # A ray ends on the side of the obstacle that it hits.
        reach = np.array(world.rays())
        tips = _ray_tips(world)[reach < world.params.ray_length]
        off = np.abs(tips[:, None] - obstacles).max(axis=2)
        seen[off.argmin(axis=1)] = True
    return world.time, world.pose, world.ball, obstacles, detected, seen


def _ray_tips(world: FastSoccerWorld) -> Floats:
    """Return where the rays end, [ray, 2]."""
    angles = world.pose[2] + np.array(world.params.ray_angles)
    along = np.column_stack([np.cos(angles), np.sin(angles)])
    return np.array(world.pose[:2]) + np.array(world.rays())[:, None] * along


# --- what the figures show -------------------------------------------------------------------


def numbers(field: SoccerField, demos: Demos) -> pd.DataFrame:
    """Return what Fig. 11 shows: a row for each border between two decisions of each demo."""
    every = demos.correct + demos.incorrect
    tables = [_trace_numbers(trace(field, demo.actions)) for demo in every]
    for demo, table in zip(every, tables, strict=True):
        table.insert(0, "kind", demo.kind)
        table.insert(1, "demo", demo.name)
    return pd.concat(tables, ignore_index=True)


def film_numbers(field: SoccerField, episodes: Mapping[str, Sequence[int]]) -> pd.DataFrame:
    """Return what some episodes show, moving: a row for each border between two decisions."""
    tables = {title: _trace_numbers(trace(field, actions)) for title, actions in episodes.items()}
    return pd.concat(tables, names=["episode", None]).reset_index("episode")


def _trace_numbers(one: Trace) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "decision": np.arange(len(one.times)),
            "time": one.times,
            "x": one.poses[:, 0],
            "y": one.poses[:, 1],
            "heading": one.poses[:, 2],
            "detected": one.detected,
        }
    )


def describe_field(field: SoccerField) -> str:
    """Return Fig. 10 in words."""
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


def describe_soccer_demos(demos: Demos) -> str:
    """Return Fig. 11 in words."""
    one = trace(_field(demos), demos.correct[0].actions)
    counts = [f"{len(_of(demos, kind))} {kind}" for kind in demos.kinds]
    contacts = sum(_ends_in_contact(trace(_field(demos), d.actions)) for d in demos.incorrect)
    incorrect = (
        f" Incorrect ones: {', '.join(counts)}; {contacts} of them end with a contact."
        if counts
        else ""
    )
    seen = np.flatnonzero(one.detected)
    detected = (
        f"it detects a moving robot after {_listed(seen)} decisions"
        if len(seen)
        else "it never detects a moving robot"
    )
    return (
        f"Ways of the robot on the soccer field. The correct demonstration takes "
        f"{len(one.actions)} decisions and {one.times[-1]:.1f} s to the goal; {detected} and "
        f"drives slowly in {int((one.actions == rules.SLOW).sum())} decisions.{incorrect}"
    )


def _field(demos: Demos) -> SoccerField:
    if not isinstance(demos.environment, SoccerField):
        raise DemoError(f"task {demos.task} is not robot soccer")
    return demos.environment


def _of(demos: Demos, kind: str) -> list[Demo]:
    return [demo for demo in demos.incorrect if demo.kind == kind]


def _ends_in_contact(one: Trace) -> bool:
    return bool(len(one.touched) and one.touched[-1] and not one.scored)


def _listed(values: ArrayLike) -> str:
    *first, last = [str(value) for value in np.asarray(values).tolist()]
    return f"{', '.join(first)} and {last}" if first else last


# --- still figures ---------------------------------------------------------------------------


@settled
def field_figure(field: SoccerField) -> Figure:
    """Draw the field from above, at the start of an episode (Fig. 10)."""
    figure, (panel,) = canvas(1, 1, height=5.95)
    _draw_field(panel, small=False)
    _draw_grid(panel)
    world = FastSoccerWorld(field.params)
    world.reset()
    for tip in _ray_tips(world):
        panel.plot(*zip(world.pose[:2], tip, strict=True), color=VERMILION, lw=0.7, zorder=3)
    _Movers(panel).place(world.pose, world.ball, np.array(world.obstacles)[:, :2])
    reach = field.params.ray_length
    x, y, _ = world.pose
    _label(panel, "controlled robot", (x, y - reach - 0.012), va="top")
    _label(
        panel,
        f"{field.params.rays} infrared rays,\n{reach:g} m long",
        (x, y + reach + 0.012),
        va="bottom",
        color=VERMILION,
    )
    _label(panel, "ball", (world.ball[0], world.ball[1] + 0.035), va="bottom")
    _label(panel, "gate", (rules.WIDTH - 0.012, np.mean(rules.GATE)), ha="right", va="center")
    for number, (path, place) in enumerate(zip(rules.PATHS, world.obstacles, strict=True), 1):
        upright = path.start[0] == path.end[0]
        text = f"obstacle {number}\n{path.speed:.2f} m/s"
        if upright:
            _label(panel, text, (place[0] + 0.05, place[1]), ha="left", va="center")
        else:
            _label(panel, text, (place[0], place[1] - 0.05), va="top")
    panel.set(xlabel="x (m)", ylabel="y (m)")
    return figure


@settled
def soccer_demos_figure(demos: Demos) -> Figure:
    """Draw the correct demonstrations, and the incorrect ones in the same field (Fig. 11).

    An incorrect demonstration is drawn from where it leaves the first correct one. If it stays on
    that one's way it is drawn beside it, else one would hide the other.

    Raises
    ------
    DemoError
        If the task is not robot soccer.
    """
    field = _field(demos)
    figure, axes = canvas(1, 2, height=4.05, sharex=True, sharey=True)
    for panel, title in zip(axes, ("(a) correct", "(b) incorrect"), strict=True):
        _draw_field(panel)
        panel.set(title=title, xlabel="x (m)")
    axes[0].set_ylabel("y (m)")
    axes[1].tick_params(left=False)
    correct = [trace(field, demo.actions) for demo in demos.correct]
    for one in correct:
        _draw_correct(axes[0], one)
        axes[1].plot(*one.poses[:, :2].T, color=PINK, lw=1.0, zorder=3)
    handles = [
        Line2D([], [], color=PINK, marker="o", ms=3.5, label=f"correct ({len(correct)})"),
        Line2D([], [], color=PINK, label="drives slowly", **_SLOW),
        Line2D(
            [], [], lw=0, marker="o", ms=10, mfc="none", mec=CORRECT_COLOUR, label="detected robot"
        ),
        Line2D([], [], lw=0, marker="x", ms=5, mew=1.5, color="0.3", label="ends with a contact"),
    ]
    beside = (side * rank for rank in itertools.count(1) for side in (1, -1))
    for kind, colour in _kind_colours(demos).items():
        line: dict[str, Any] = {
            "color": colour,
            "lw": _BROAD if kind == demos.kinds[0] else _NARROW,
        }
        found = _of(demos, kind)
        for demo in found:
            _draw_incorrect(axes[1], trace(field, demo.actions), correct[0], line, beside)
        handles.append(Line2D([], [], label=f"{kind} ({len(found)})", **line))
    for panel in axes:
        _Movers(panel, obstacles=False).place(correct[0].poses[0], correct[0].balls[0])
    legend_below(figure, handles)
    return figure


# Where kinds share a way, the later one is drawn upon the broader earlier one.
_BROAD, _NARROW = 2.3, 1.1
_SLOW: dict[str, Any] = {"marker": "D", "ms": 4.5, "mfc": "white", "mew": 1.2}


def _kind_colours(demos: Demos) -> dict[str, str]:
    spare = itertools.cycle(SPARE_COLOURS)
    return {kind: COLOURS.get(kind) or next(spare) for kind in demos.kinds}


def _draw_correct(panel: Axes, one: Trace) -> None:
    x, y = one.poses[:, :2].T
    slow = np.flatnonzero(one.actions == rules.SLOW)
    panel.plot(x, y, color=PINK, marker="o", ms=2.8, zorder=5)
    panel.plot(x[slow], y[slow], color=PINK, lw=0, zorder=6, **_SLOW)
    for number in range(len(rules.PATHS)):
        places = one.obstacles[one.seen[:, number], number]
        for place, alpha in zip(places, np.linspace(0.35, 0.9, len(places)), strict=True):
            _draw_obstacle(panel, place, alpha)
        if len(places):
            centre = (places.min(axis=0) + places.max(axis=0)) / 2
            radius = np.abs(places - centre).max() + 0.8 * rules.ROBOT_SIDE
            panel.add_patch(Circle(centre, radius, fill=False, ec=CORRECT_COLOUR, lw=1.4, zorder=7))


def _draw_incorrect(
    panel: Axes, one: Trace, correct: Trace, line: Mapping[str, Any], beside: Iterator[int]
) -> None:
    way, right = one.poses[:, :2], correct.poses[:, :2]
    shared = min(len(way), len(right))
    same = (way[:shared] == right[:shared]).all(axis=1)
    branch = way[(shared if same.all() else int(same.argmin())) - 1 :]
    on_way = np.array([_distance(place, right) < BESIDE / 2 for place in branch])
    if on_way[1:].mean() > 0.5:
        x, y = right[-1] - right[0]
        across = np.array([-y, x]) / np.hypot(x, y)
        branch = branch + on_way[:, None] * next(beside) * BESIDE * across
    panel.plot(*branch.T, marker="o", ms=line["lw"] + 0.6, zorder=5.5, **line)
    if _ends_in_contact(one):
        panel.plot(*branch[-1], "x", color=line["color"], ms=5.5, mew=1.6, zorder=6)
    elif not one.scored:
        style = {"arrowstyle": "-|>", "color": line["color"], "shrinkA": 0, "shrinkB": 0}
        panel.annotate("", branch[-1], branch[-2], arrowprops=style, zorder=6)


def _distance(place: Floats, way: Floats) -> float:
    """Return how far a place is from a polyline."""
    start, step = way[:-1], np.diff(way, axis=0)
    square = np.maximum((step**2).sum(axis=1), 1e-12)
    part = np.clip(((place - start) * step).sum(axis=1) / square, 0, 1)[:, None]
    return float(np.linalg.norm(start + part * step - place, axis=1).min())


# --- pieces ----------------------------------------------------------------------------------


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


def _draw_field(panel: Axes, *, small: bool = True) -> None:
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


def _placed(pose: Sequence[float] | Floats, shape: ArrayLike) -> Floats:
    """Turn and move a shape, given in sides of a robot, to a pose."""
    x, y, heading = pose
    turn = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
    return np.asarray(shape) * rules.ROBOT_SIDE @ turn + (x, y)


_BODY = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
_NOSE = ((0.5, 0.0), (-0.35, -0.27), (-0.35, 0.27))  # a triangle that points ahead
_STRIPE = ((-0.5, -0.16), (0.5, -0.16), (0.5, 0.16), (-0.5, 0.16))


def _draw_obstacle(panel: Axes, place: Floats, alpha: float) -> None:
    pose = (*place, 0.0)
    style: dict[str, Any] = {"alpha": alpha, "zorder": 4}
    panel.add_patch(Polygon(_placed(pose, _BODY), fc=YELLOW, ec="0.2", lw=0.6, **style))
    panel.add_patch(Polygon(_placed(pose, _STRIPE), fc=CORRECT_COLOUR, lw=0, **style))


class _Movers:
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
        self,
        pose: Sequence[float] | Floats,
        ball: Sequence[float] | Floats,
        obstacles: ArrayLike = (),
    ) -> None:
        """Put everything in its place."""
        for patch, shape in zip(self.robot, (_BODY, _NOSE), strict=True):
            patch.set_xy(_placed(pose, shape))
        self.ball.set_center((float(ball[0]), float(ball[1])))
        for patches, (x, y) in zip(self.obstacles, np.asarray(obstacles), strict=False):
            for patch, shape in zip(patches, (_BODY, _STRIPE), strict=True):
                patch.set_xy(_placed((x, y, 0.0), shape))


# --- moving figures --------------------------------------------------------------------------


class FieldAnimation(FuncAnimation):
    """An animation that knows its figure, and what it shows in words."""

    figure: Figure
    description: str


def animate(
    field: SoccerField, episodes: Mapping[str, Sequence[int]], *, decisions: int = 40
) -> FieldAnimation:
    """Show episodes side by side, a frame for each decision.

    Parameters
    ----------
    field
        Where they take place.
    episodes
        Actions by title.
    decisions
        How many of them are shown of each episode, at most. An episode that is over keeps its last
        frame, and so does the whole for a second.
    """
    traces = {title: trace(field, actions[:decisions]) for title, actions in episodes.items()}
    ends = {title: _end(one, len(episodes[title])) for title, one in traces.items()}
    with style():
        size = min(WIDTH / len(traces), 4.0)
        figure = Figure(figsize=(WIDTH, size * 0.87 + 0.68), dpi=DPI, layout="constrained")
        FigureCanvasAgg(figure)
        panels = np.atleast_1d(figure.subplots(1, len(traces)))
        movers, trails = [], []
        for panel in panels:
            _draw_field(panel)
            panel.set(xticks=[], yticks=[])
            trails += panel.plot([], [], color=PINK, marker="o", ms=2, lw=1.2, zorder=3)
            movers.append(_Movers(panel))

        def draw(frame: int) -> list[Any]:
            for panel, mover, trail, title in zip(panels, movers, trails, traces, strict=True):
                one = traces[title]
                now = min(frame, len(one.actions))
                mover.place(one.poses[now], one.balls[now], one.obstacles[now])
                trail.set_data(*one.poses[: now + 1, :2].T)
                status = f"{one.times[now]:.1f} s, decision {now}"
                if now == len(one.actions):
                    status = ends[title]
                panel.set_title(f"{title}\n{status}", loc="left", fontsize=8.5)
            return []

        draw(0)
        legend_below(
            figure,
            [
                Line2D([], [], color=BLUE, marker="s", ms=6, lw=0, label="controlled robot"),
                Line2D([], [], color=PINK, marker="o", ms=2, label="its way, a dot a decision"),
                Line2D([], [], color=YELLOW, marker="s", ms=6, mec="0.2", lw=0, label="obstacle"),
                Line2D([], [], color="white", marker="o", ms=5, mec="black", lw=0, label="ball"),
            ],
        )
        figure.draw_without_rendering()
        figure.set_layout_engine("none")
        longest = max(len(one.actions) for one in traces.values())
        frames = [*range(longest), *[longest] * LAST_FRAMES]
        animation = FieldAnimation(
            figure, draw, frames=frames, interval=1000 // FRAMES_A_SECOND, cache_frame_data=False
        )
    animation.figure = figure
    animation.description = "The robot's way in some episodes, moving. " + "; ".join(
        f"{title}: {end}" for title, end in ends.items()
    )
    return animation


def _end(one: Trace, length: int) -> str:
    """Return how an episode of some actions ends, of which a part is shown."""
    shown = len(one.actions)
    if one.outcome:
        return f"{one.outcome}: {one.times[-1]:.1f} s, {shown} decisions"
    return f"cut after {shown} decisions" if shown < length else f"ends after {shown} decisions"


def save_gif(animation: FuncAnimation, path: Path) -> Path:
    """Write an animation as a GIF, whole or not at all."""
    with tempfile.TemporaryDirectory() as folder, style():
        draft = Path(folder) / "draft.gif"
        animation.save(draft, writer=PillowWriter(fps=FRAMES_A_SECOND), dpi=DPI)
        return write_file(path, draft.read_bytes())
