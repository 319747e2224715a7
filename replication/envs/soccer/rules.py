"""Robot soccer: the field, the robots and what a decision does.

The paper (section IV-C) shows a picture of the task and gives its size, its states and its actions;
the rest is our choice and is defined here, in one file because the numbers depend on each other.
Units are metres, seconds, kilograms and radians; the origin is the lower left corner of the field,
x points to the gate, angles are counter-clockwise.

`world.py` moves the bodies with pymunk and is the definition; `compiled.py` returns the same bits
many times faster.

**All that outlives a decision is explicit**: the pose of the robot, the position and velocity of
the ball, and the time, which determines the obstacles' poses. Between decisions the robot is at
rest. A physics engine hides more state (cached contact forces, the order of contacts). As each
decision starts from a new space, none of it can leak into another decision or episode, and a
decision in which nothing can touch needs no engine at all.

**A decision** is a plan for whole ticks: turn in place, then drive straight, then stop. The wheels
are a servo: in each tick they apply the force that would reach the planned velocity by the end of
the tick, up to what the tyres transmit, so a robot against a wall pushes but does not get through.
As the engine moves bodies before it changes their velocities, a plan of n ticks takes n + 1.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from replication.paper.register import ChoiceError, Chosen, choice

# The state space and the actions are the paper's.
WIDTH, HEIGHT = 1.4, 1.2
COLUMNS, ROWS = 16, 12
N_STATES = COLUMNS * ROWS * 2
ACTIONS = ("forward", "backward", "right", "left", "slow")
FORWARD, BACKWARD, RIGHT, LEFT, SLOW = range(5)
ASIDE = (0.0, 0.0, -math.pi / 2, math.pi / 2, 0.0)  # where an action heads, from the ball's bearing

# The field. Corners are cut so that the ball cannot stop where no robot can get behind it.
WALL_RADIUS = 0.01
CORNER = 0.08
GATE = (0.40, 0.80)  # from, to: the opening in the right wall
MOUTH = 0.02  # how far robots can get behind the line
GOAL_X = WIDTH + 0.0213  # of the ball's centre: the whole ball is over the line

# The bodies.
BALL_RADIUS, BALL_MASS, BALL_START = 0.0213, 0.046, (1.18, 0.60)
BALL_DRAG = 0.92  # 1/s: a free ball keeps 40 % of its speed after a second
BALL_REST = 0.004  # m/s: below this the ball counts as at rest when a decision begins
ROBOT_SIDE, ROBOT_MASS, ROBOT_START = 0.075, 0.45, (0.15, 0.24)
ROBOT_MOMENT = ROBOT_MASS * ROBOT_SIDE**2 / 6
MAX_FORCE, MAX_TORQUE = 3.5, 0.2  # what the tyres transmit, N and N m
FRICTION = 0.3
WALL_ELASTICITY, BALL_ELASTICITY, ROBOT_ELASTICITY = 0.5, 1.0, 0.0

# The engine: its default slop, 0.1, is meant for pixels and would let a robot through a wall.
SLOP = 1e-4
ITERATIONS = 10


class Path(NamedTuple):
    """The path on which an obstacle moves back and forth; its heading stays 0."""

    start: tuple[float, float]
    end: tuple[float, float]
    speed: float  # m/s
    phase: float  # where in the cycle it is at time 0; 0 at the start, 0.5 at the end


# No path comes closer to a wall than a robot is wide, as an obstacle never gives way. The phases
# and the robot's start were taken from a coarse grid so that the expert (`expert_action`) scores
# without a contact, slows down before one obstacle only (which it would hit at full speed), and
# stays 1 mm off the borders between cells, where rounding could change its states.
PATHS = (
    Path((0.62, 0.15), (0.62, 0.85), 0.10, 0.045),
    Path((0.35, 1.00), (1.05, 1.00), 0.10, 0.300),
    Path((0.95, 0.15), (0.95, 0.39), 0.08, 0.100),
)

# What collides with what: bits of pymunk's shape filters.
ROBOT_BIT, BALL_BIT, OBSTACLE_BIT, WALL_BIT, MOUTH_BIT = 1, 2, 4, 8, 16


@dataclass(frozen=True)
class SoccerParams(Chosen):
    """What the paper leaves open about the robot and its decisions.

    Parameters
    ----------
    drive_time
        Time for which a decision drives, in s, after turning and without the tick to start moving.
    speed, slow_speed
        Speed of driving, in m/s, in general and of the action "slow".
    turn_rate
        Maximum rate of turning in place, in rad/s.
    rays, ray_length, ray_arc
        Number of infrared rays; their length from the robot's centre in m; and the arc, in degrees,
        over which they are spread evenly around the heading.
    dt
        Tick of the physics, in s.
    macro
        Whether an action lasts for one "decision" or until the robot is in another "cell".
    time_limit
        Simulated time, in s, after which an episode ends, once the current decision is over.

    Raises
    ------
    ChoiceError
        If a value is not registered, or the speeds do not fit each other or the tick.
    """

    drive_time: float = choice("SOCCER-DECISION")
    speed: float = choice("SOCCER-SPEED")
    slow_speed: float = choice("SOCCER-SLOW")
    turn_rate: float = choice("SOCCER-TURN")
    rays: int = choice("SOCCER-RAYS")
    ray_length: float = choice("SOCCER-RANGE")
    ray_arc: int = choice("SOCCER-ARC")
    dt: float = choice("SOCCER-TICK")
    macro: str = choice("SOCCER-MACRO")
    time_limit: float = choice("SOCCER-LIMIT")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.slow_speed <= self.speed <= 0.02 / self.dt:
            raise ChoiceError(
                f"speed = {self.speed} must be at least slow_speed = {self.slow_speed} and at most "
                f"{0.02 / self.dt:g}, less than half a ball a tick, so that nothing is jumped over"
            )

    @property
    def macro_step(self) -> bool:
        """Whether an action is repeated until the robot is in another cell."""
        return self.macro == "cell"

    @property
    def drive_ticks(self) -> int:
        """Number of ticks for which a decision drives."""
        return round(self.drive_time / self.dt)

    @property
    def limit_ticks(self) -> int:
        """Number of ticks after which an episode is over."""
        return round(self.time_limit / self.dt)

    @property
    def speeds(self) -> tuple[float, ...]:
        """Speed of driving of each action, in m/s; negative in reverse."""
        return (self.speed, -self.speed, self.speed, self.speed, self.slow_speed)

    @property
    def ray_gap(self) -> float:
        """Angle between two rays, in rad; a full circle has as many gaps as rays."""
        gaps = self.rays if self.ray_arc == 360 else max(self.rays - 1, 1)
        return math.radians(self.ray_arc) / gaps

    @property
    def ray_angles(self) -> tuple[float, ...]:
        """Angles of the rays from the heading, in rad, the rightmost first."""
        return tuple((i - (self.rays - 1) / 2) * self.ray_gap for i in range(self.rays))


def encode(x: float, y: float, detected: bool) -> int:
    """Return the state of a position; the outermost cells extend beyond the field.

    Examples
    --------
    >>> encode(0.0, 0.0, True), encode(1.4, 1.2, True)
    (1, 383)
    """
    column = min(max(int(x / WIDTH * COLUMNS), 0), COLUMNS - 1)
    row = min(max(int(y / HEIGHT * ROWS), 0), ROWS - 1)
    return (column * ROWS + row) * 2 + int(detected)


def decode(state: int) -> tuple[int, int, bool]:
    """Return a state's column, row and whether an obstacle is detected.

    Examples
    --------
    >>> decode(383)
    (15, 11, True)
    """
    cell, detected = divmod(state, 2)
    return *divmod(cell, ROWS), bool(detected)


def border_distance(x: float, y: float) -> float:
    """Return the distance of a position from the nearest border between two cells.

    Examples
    --------
    >>> round(border_distance(0.0875 + 0.01, 0.15), 6)
    0.01
    """
    lines = (
        (x, WIDTH / COLUMNS, COLUMNS),
        (y, HEIGHT / ROWS, ROWS),
    )
    return min(
        abs(value - size * min(max(round(value / size), 1), count - 1))
        for value, size, count in lines
    )


def expert_action(state: int) -> int:
    """Return the expert's action: drive to the ball, more slowly if an obstacle is detected."""
    return SLOW if decode(state)[2] else FORWARD


def half_ticks(path: Path, dt: float) -> int:
    """Return the number of ticks for which an obstacle moves before it turns round."""
    return round(math.dist(path.start, path.end) / (path.speed * dt))


def obstacle(path: Path, tick: int, dt: float) -> tuple[float, float, float, float]:
    """Return an obstacle's position at a tick, and its velocity until the next one."""
    half = half_ticks(path, dt)
    into = (tick + round(path.phase * 2 * half)) % (2 * half)
    part, sign = (into / half, 1.0) if into < half else ((2 * half - into) / half, -1.0)
    (x0, y0), (x1, y1) = path.start, path.end
    pace = sign / (half * dt)
    return (
        x0 + (x1 - x0) * part,
        y0 + (y1 - y0) * part,
        (x1 - x0) * pace,
        (y1 - y0) * pace,
    )


def plan(
    params: SoccerParams, action: int, pose: Sequence[float], ball: Sequence[float]
) -> tuple[int, float, float]:
    """Return a decision's plan: ticks of turning, the rate in rad/s, the speed of driving in m/s.

    Actions refer to the bearing of the ball, which the robot faces, forwards or in reverse; for
    "right" and "left" it turns to 90 degrees from there.
    """
    x, y, heading = pose
    turn = math.atan2(ball[1] - y, ball[0] - x) + ASIDE[action] - heading
    turn -= 2 * math.pi * math.floor(turn / (2 * math.pi) + 0.5)
    ticks = math.ceil(abs(turn) / (params.turn_rate * params.dt) - 1e-9)
    rate = turn / (ticks * params.dt) if ticks else 0.0
    return ticks, rate, params.speeds[action]


def servo(
    speed: float,
    rate: float,
    heading: float,
    velocity: Sequence[float],
    angular_velocity: float,
    dt: float,
) -> tuple[float, float, float]:
    """Return the force x, y and the torque of the wheels for one tick.

    They aim at the planned speed along the heading at the end of the tick, and at the planned rate
    of turning; rolling wheels also resist being pushed sideways.
    """
    heading += angular_velocity * dt
    force_x = ROBOT_MASS * (speed * math.cos(heading) - velocity[0]) / dt
    force_y = ROBOT_MASS * (speed * math.sin(heading) - velocity[1]) / dt
    square = force_x * force_x + force_y * force_y
    if square > MAX_FORCE * MAX_FORCE:
        part = MAX_FORCE / math.sqrt(square)
        force_x, force_y = part * force_x, part * force_y
    torque = ROBOT_MOMENT * (rate - angular_velocity) / dt
    return force_x, force_y, min(max(torque, -MAX_TORQUE), MAX_TORQUE)
