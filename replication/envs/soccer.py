"""Robot soccer: the field, the robots and what a decision does, in plain pymunk.

The paper (section IV-C) shows a picture of the task and names its size, its states and its actions;
the rest is ours and stands here. Units are metres, seconds, kilograms and radians; the origin is
the lower left corner of the field, x points to the gate, angles are counter-clockwise.

`SoccerWorld` is the definition, written for reading: it builds a new pymunk space for every
decision. `replication.envs.chipmunk` returns the same bits many times faster.

**All that outlives a decision is explicit**: the pose of the robot, the position and velocity of
the ball, and the time, of which the obstacles' poses are a function. Between decisions the robot is
at rest. A physics engine hides more (cached contact forces, the order in which it finds contacts);
since each decision starts from a new space, none of it can leak from one decision or episode into
another, and a decision in which nothing can touch needs no engine at all.

**A decision** is a plan for whole ticks: turn in place, then drive straight, then stop. The wheels
are a servo: each tick they push with the force that would reach the planned velocity by the end of
the tick, up to what the tyres transmit, so a robot against a wall pushes but does not get through.
As the engine moves bodies before it changes their velocities, a plan of n ticks takes n + 1.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import pymunk

from replication.choices import ChoiceError, Chosen, choice

# The state space and the actions are the paper's.
WIDTH, HEIGHT = 1.4, 1.2
COLUMNS, ROWS = 16, 12
N_STATES = COLUMNS * ROWS * 2
ACTIONS = ("forward", "backward", "right", "left", "slow")
FORWARD, BACKWARD, RIGHT, LEFT, SLOW = range(5)
ASIDE = (0.0, 0.0, -math.pi / 2, math.pi / 2, 0.0)  # where an action heads, from the ball's bearing

# The field. Corners are cut so that the ball cannot come to lie where no robot can get behind it.
WALL_RADIUS = 0.01
CORNER = 0.08
GATE = (0.40, 0.80)  # from, to: the opening in the right wall
MOUTH = 0.02  # how far behind the line robots can get
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
    """An obstacle's way back and forth; its heading stays 0."""

    start: tuple[float, float]
    end: tuple[float, float]
    speed: float  # m/s
    phase: float  # where in the cycle it is at time 0; 0 at the start, 0.5 at the end


# No path comes closer to a wall than a robot is wide: an obstacle gives way to nothing. The phases
# and the robot's start are those, of a coarse grid, for which the expert (`expert_action`) scores
# without a contact, slows down before one obstacle only and stays 1 mm off the borders between
# cells, so that rounding cannot change its states; driving on at full speed hits that obstacle.
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
        Time for which a decision drives, in s, after turning and without the tick to get going.
    speed, slow_speed
        Speed of driving, in m/s, in general and of the action "slow".
    turn_rate
        Greatest rate of turning in place, in rad/s.
    rays, ray_length, ray_arc
        Number of infrared rays; their length from the robot's centre in m; and the arc, in degrees,
        over which they are spread evenly around the heading.
    dt
        Tick of the physics, in s.
    macro
        Whether an action lasts for one "decision" or until the robot is in another "cell".
    time_limit
        Simulated time after which an episode ends, in s, at the end of a decision.

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
        """Number of ticks from which an episode is over."""
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


class Contacts(NamedTuple):
    """Number of decisions since the reset in which the robot touched something."""

    obstacles: int = 0
    walls: int = 0


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
    """Return how far a position is from the nearest border between two cells.

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
    """Return what the expert does: drive to the ball, more slowly if an obstacle is detected."""
    return SLOW if decode(state)[2] else FORWARD


def half_ticks(path: Path, dt: float) -> int:
    """Return for how many ticks an obstacle moves before it turns round."""
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

    They aim at the planned speed, along the heading at the end of the tick, and the planned rate of
    turning; wheels that roll also resist being pushed sideways.
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


class SoccerWorld:
    """One robot, three moving obstacles and a ball.

    Parameters
    ----------
    params
        What the paper leaves open.

    Attributes
    ----------
    pose : tuple[float, float, float]
        The robot's x, y and heading.
    ball, ball_velocity : tuple[float, float]
        Position and velocity of the ball.
    tick : int
        Number of ticks since the reset.
    contacts : Contacts
        In how many decisions the robot touched an obstacle or a wall.

    Examples
    --------
    >>> world = SoccerWorld()
    >>> decode(world.reset())
    (1, 2, False)
    >>> state, scored, timed_out = world.step(FORWARD)
    >>> decode(state), scored, timed_out, round(world.time, 2)
    ((2, 2, False), False, False, 0.55)
    """

    n_states = N_STATES
    n_actions = len(ACTIONS)
    actions = ACTIONS

    def __init__(self, params: SoccerParams | None = None) -> None:
        self.params = params or SoccerParams()
        self.reset()

    def reset(self) -> int:
        """Put everything in its place and return the state."""
        x, y = ROBOT_START
        self.pose = (x, y, math.atan2(BALL_START[1] - y, BALL_START[0] - x))
        self.ball: tuple[float, float] = BALL_START
        self.ball_velocity: tuple[float, float] = (0.0, 0.0)
        self.tick = 0
        self.contacts = Contacts()
        return self.state

    def step(self, action: int) -> tuple[int, bool, bool]:
        """Take a decision and return the state, whether a goal fell, whether the time is up."""
        if action not in range(len(ACTIONS)):
            raise ValueError(f"there is no action {action!r}; actions are 0..{len(ACTIONS) - 1}")
        cell = self.state // 2
        while True:
            scored = self._decide(action)
            timed_out = not scored and self.tick >= self.params.limit_ticks
            if scored or timed_out or not self.params.macro_step or self.state // 2 != cell:
                return self.state, scored, timed_out

    @property
    def time(self) -> float:
        """Simulated time since the reset, in s."""
        return self.tick * self.params.dt

    @property
    def state(self) -> int:
        """The state, see `encode`: an obstacle is detected if any ray hits one."""
        x, y, _ = self.pose
        return encode(x, y, any(hit < self.params.ray_length for hit in self.rays()))

    @property
    def obstacles(self) -> list[tuple[float, float, float]]:
        """The obstacles' x, y and heading."""
        return [(*obstacle(path, self.tick, self.params.dt)[:2], 0.0) for path in PATHS]

    def rays(self) -> list[float]:
        """How far each ray gets: its distance to the first obstacle, or its whole length."""
        space = pymunk.Space()
        for x, y, _ in self.obstacles:
            body = pymunk.Body(body_type=pymunk.Body.STATIC)
            body.position = x, y
            space.add(body, pymunk.Poly.create_box(body, (ROBOT_SIDE, ROBOT_SIDE)))
        x, y, heading = self.pose
        reach = self.params.ray_length
        hits = []
        for angle in self.params.ray_angles:
            direction = math.cos(heading + angle), math.sin(heading + angle)
            tip = x + reach * direction[0], y + reach * direction[1]
            hit = space.segment_query_first((x, y), tip, 0.0, pymunk.ShapeFilter())
            hits.append(reach * hit.alpha if hit else reach)
        return hits

    def _decide(self, action: int) -> bool:
        """Advance the world by one decision and return whether a goal fell."""
        params, dt = self.params, self.params.dt
        if math.hypot(*self.ball_velocity) < BALL_REST:
            self.ball_velocity = (0.0, 0.0)
        turn_ticks, rate, speed = plan(params, action, self.pose, self.ball)
        space, robot, ball, obstacles = self.build_space()
        touched: set[int] = set()
        moving = turn_ticks + params.drive_ticks
        scored = False
        for tick in range(moving + 1):
            command = (0.0, rate) if tick < turn_ticks else (speed if tick < moving else 0.0, 0.0)
            force_x, force_y, torque = servo(
                *command, robot.angle, robot.velocity, robot.angular_velocity, dt
            )
            robot.force, robot.torque = (force_x, force_y), torque
            drag = -BALL_DRAG * BALL_MASS
            ball.force = drag * ball.velocity.x, drag * ball.velocity.y
            for body, path in zip(obstacles, PATHS, strict=True):
                body.velocity = obstacle(path, self.tick, dt)[2:]
            space.step(dt)
            self.tick += 1
            robot.each_arbiter(
                lambda arbiter: touched.update(s.filter.categories for s in arbiter.shapes)
            )
            scored = ball.position.x >= GOAL_X
            if scored:
                break
        self.pose = (*robot.position, robot.angle)
        self.ball = (ball.position.x, ball.position.y)
        self.ball_velocity = (ball.velocity.x, ball.velocity.y)
        self.contacts = Contacts(
            self.contacts.obstacles + (OBSTACLE_BIT in touched),
            self.contacts.walls + (WALL_BIT in touched or MOUTH_BIT in touched),
        )
        return scored

    def build_space(self) -> tuple[pymunk.Space, pymunk.Body, pymunk.Body, list[pymunk.Body]]:
        """Build a space with everything where it is now; bodies and shapes in a fixed order."""
        space = pymunk.Space()
        space.collision_slop, space.iterations = SLOP, ITERATIONS
        for segment in wall_segments(space.static_body):
            space.add(segment)
        robot = pymunk.Body(ROBOT_MASS, ROBOT_MOMENT)
        ball = pymunk.Body(BALL_MASS, math.inf)  # seen from above, a rolling ball does not spin
        robot.position, robot.angle = self.pose[:2], self.pose[2]
        ball.position, ball.velocity = self.ball, self.ball_velocity
        obstacles = [pymunk.Body(body_type=pymunk.Body.KINEMATIC) for _ in PATHS]
        for body, path in zip(obstacles, PATHS, strict=True):
            body.position = obstacle(path, self.tick, self.params.dt)[:2]
        shapes = [box(robot, ROBOT_BIT), circle(ball), *(box(b, OBSTACLE_BIT) for b in obstacles)]
        space.add(robot, ball, *obstacles)
        space.add(*shapes)
        return space, robot, ball, obstacles


def box(body: pymunk.Body, category: int) -> pymunk.Poly:
    """Return the shape of a robot."""
    shape = pymunk.Poly.create_box(body, (ROBOT_SIDE, ROBOT_SIDE))
    shape.elasticity, shape.friction = ROBOT_ELASTICITY, FRICTION
    shape.filter = pymunk.ShapeFilter(categories=category)
    return shape


def circle(body: pymunk.Body) -> pymunk.Circle:
    """Return the shape of the ball."""
    shape = pymunk.Circle(body, BALL_RADIUS)
    shape.elasticity, shape.friction = BALL_ELASTICITY, FRICTION
    shape.filter = pymunk.ShapeFilter(categories=BALL_BIT)
    return shape


def wall_segments(body: pymunk.Body) -> list[pymunk.Segment]:
    """Return the walls, open at the gate, and what stops robots in the gate."""
    shift = WALL_RADIUS * math.sqrt(2)
    left, right, bottom, top = -WALL_RADIUS, WIDTH + WALL_RADIUS, -WALL_RADIUS, HEIGHT + WALL_RADIUS
    near = CORNER - shift + WALL_RADIUS  # where the lines inside the cut corners meet the walls'
    posts = GATE[0] - WALL_RADIUS, GATE[1] + WALL_RADIUS
    outline = [
        (right, posts[0]),
        (right, near),
        (WIDTH - near, bottom),
        (near, bottom),
        (left, near),
        (left, HEIGHT - near),
        (near, top),
        (WIDTH - near, top),
        (right, HEIGHT - near),
        (right, posts[1]),
    ]
    segments = [pymunk.Segment(body, a, b, WALL_RADIUS) for a, b in pairwise(outline)]
    for segment in segments:
        segment.filter = pymunk.ShapeFilter(categories=WALL_BIT)
    stop = WIDTH + MOUTH + WALL_RADIUS
    mouth = pymunk.Segment(body, (stop, posts[0]), (stop, posts[1]), WALL_RADIUS)
    mouth.filter = pymunk.ShapeFilter(categories=MOUTH_BIT, mask=ROBOT_BIT)
    for segment in (*segments, mouth):
        segment.elasticity, segment.friction = WALL_ELASTICITY, FRICTION
    return [*segments, mouth]
