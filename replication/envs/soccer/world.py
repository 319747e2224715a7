"""Robot soccer as a physics world in plain pymunk: the definition, written to be read.

A new pymunk space is built for every decision. :mod:`replication.envs.soccer.compiled` returns the
same bits many times faster.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import pymunk

from replication.envs.soccer.rules import (
    ACTIONS,
    BALL_BIT,
    BALL_DRAG,
    BALL_ELASTICITY,
    BALL_MASS,
    BALL_RADIUS,
    BALL_REST,
    BALL_START,
    CORNER,
    FRICTION,
    GATE,
    GOAL_X,
    HEIGHT,
    ITERATIONS,
    MOUTH,
    MOUTH_BIT,
    N_STATES,
    OBSTACLE_BIT,
    PATHS,
    ROBOT_BIT,
    ROBOT_ELASTICITY,
    ROBOT_MASS,
    ROBOT_MOMENT,
    ROBOT_SIDE,
    ROBOT_START,
    SLOP,
    WALL_BIT,
    WALL_ELASTICITY,
    WALL_RADIUS,
    WIDTH,
    SoccerParams,
    encode,
    obstacle,
    plan,
    servo,
)


class Contacts(NamedTuple):
    """Number of decisions since the reset in which the robot touched something."""

    obstacles: int = 0
    walls: int = 0


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
    >>> from replication.envs.soccer.rules import FORWARD, decode
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
        """Put everything in its starting place and return the state."""
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
        """Return how far each ray gets: to the nearest obstacle, or its whole length."""
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
        """Build a space with everything where it is now, bodies and shapes in a fixed order."""
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
    """Return the walls, which are open at the gate, and the barrier that stops robots there."""
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
