"""Robot soccer, compiled: the bits of :mod:`replication.envs.soccer.world`, many times faster.

Read `rules.py` and `world.py` first. Two things make the difference:

- **A decision in which nothing can touch needs no engine.** `_glide` computes each tick of the
  robot with the operations that the engine would use, and gives up when two bodies come close.
- **Where bodies may touch, the engine is called without Python.** `_collide` calls the C functions
  within pymunk by their addresses. It reuses one space, which it makes as good as new: it takes out
  what moves, lets a tick pass so that the engine forgets, and puts everything back.

Those functions take pointers and numbers only; they are private to pymunk and may change with its
version. Only `_FUNCTIONS` and `engine` depend on them, and the tests compare every bit with the
public interface.

This is one file because numba renews its cache on disk only when the file of the cached function
changes: a compiled function must not call what is compiled from another file.
"""

# Numba infers the types of compiled functions, and llvmlite has none.
# mypy: disable-error-code="no-untyped-def, no-untyped-call, import-untyped"

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import binding
from numba import njit, types
from numpy.typing import NDArray
from pymunk._chipmunk_cffi import ffi, lib

from replication.envs.soccer import rules, world
from replication.envs.soccer.rules import SoccerParams
from replication.envs.soccer.world import SoccerWorld

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GOING, SCORED, TIMED_OUT = range(3)

# The state of a world: floats (the robot's x, y and heading, the ball's x, y and velocity) and
# integers (the tick, the decisions in which the robot touched obstacles, and walls).
N_FLOATS, N_INTS = 7, 3
_MARGIN = 1e-3  # far above rounding: what is further apart than this cannot touch
_TICK, _OBSTACLES, _WALLS = range(N_INTS)


class Law(NamedTuple):
    """All numbers that the compiled functions use, of the field and of the parameters.

    They are arguments, not constants, as numba would not notice a changed constant of another file.
    They are tuples, not arrays, whose reference counting would take longer than all the rest.
    """

    width: float
    height: float
    columns: int
    rows: int
    corner: float
    goal_x: float
    start: tuple[float, ...]  # the robot's x, y and heading, the ball's x, y and velocity
    ball_radius: float
    ball_drag: float  # force per velocity
    ball_rest: float
    half_side: float
    robot_radius: float  # of the circle around it
    mass: float
    moment: float
    max_force: float
    max_torque: float
    path: tuple[
        tuple[float, ...], ...
    ]  # of each obstacle: x, y of one end, and from there to the other
    half: tuple[int, ...]  # of each obstacle: ticks from end to end
    offset: tuple[int, ...]  # and its tick in the cycle at time 0
    dt: float
    aside: tuple[float, ...]  # of each action
    speeds: tuple[float, ...]  # of each action
    turn_rate: float
    drive_ticks: int
    limit_ticks: int
    macro_step: bool
    ray_length: float
    rays: int
    ray_gap: float

    @classmethod
    def of(cls, params: SoccerParams) -> "Law":
        """Collect the numbers."""
        half = [rules.half_ticks(path, params.dt) for path in rules.PATHS]
        world = SoccerWorld(params)
        return cls(
            width=rules.WIDTH,
            height=rules.HEIGHT,
            columns=rules.COLUMNS,
            rows=rules.ROWS,
            corner=rules.CORNER,
            goal_x=rules.GOAL_X,
            start=(*world.pose, *world.ball, *world.ball_velocity),
            ball_radius=rules.BALL_RADIUS,
            ball_drag=-rules.BALL_DRAG * rules.BALL_MASS,
            ball_rest=rules.BALL_REST,
            half_side=rules.ROBOT_SIDE / 2,
            robot_radius=rules.ROBOT_SIDE / math.sqrt(2),
            mass=rules.ROBOT_MASS,
            moment=rules.ROBOT_MOMENT,
            max_force=rules.MAX_FORCE,
            max_torque=rules.MAX_TORQUE,
            path=tuple(
                (*path.start, path.end[0] - path.start[0], path.end[1] - path.start[1])
                for path in rules.PATHS
            ),
            half=tuple(half),
            offset=tuple(
                round(path.phase * 2 * n) for path, n in zip(rules.PATHS, half, strict=True)
            ),
            dt=float(params.dt),
            aside=rules.ASIDE,
            speeds=tuple(map(float, params.speeds)),
            turn_rate=float(params.turn_rate),
            drive_ticks=params.drive_ticks,
            limit_ticks=params.limit_ticks,
            macro_step=bool(params.macro_step),
            ray_length=float(params.ray_length),
            rays=params.rays,
            ray_gap=params.ray_gap,
        )


def _compiled(function: Callable[..., Any]) -> Any:
    """Compile a function, and cache the result on disk if there is a writable place for it."""
    try:
        return njit(cache=True)(function)
    except RuntimeError:  # neither the package's folder nor the user's can be written
        return njit(function)


# The decision, line by line as in `replication.envs.soccer.rules`.


@_compiled
def _obstacle(law, index, tick):
    """Return an obstacle's position at a tick, and its velocity until the next one."""
    half = law.half[index]
    into = (tick + law.offset[index]) % (2 * half)
    part, sign = into / half, 1.0
    if into >= half:
        part, sign = (2 * half - into) / half, -1.0
    pace = sign / (half * law.dt)
    x, y, dx, dy = law.path[index]
    return x + dx * part, y + dy * part, dx * pace, dy * pace


@_compiled
def _plan(law, action, now):
    """Return ticks of turning, the rate, and the speed of driving."""
    turn = math.atan2(now[4] - now[1], now[3] - now[0]) + law.aside[action] - now[2]
    turn -= 2 * math.pi * math.floor(turn / (2 * math.pi) + 0.5)
    ticks = math.ceil(abs(turn) / (law.turn_rate * law.dt) - 1e-9)
    rate = turn / (ticks * law.dt) if ticks else 0.0
    return ticks, rate, law.speeds[action]


@_compiled
def _servo(law, speed, rate, heading, vx, vy, angular_velocity):
    """Return the force x, y and the torque of the wheels for one tick."""
    heading += angular_velocity * law.dt
    force_x = law.mass * (speed * math.cos(heading) - vx) / law.dt
    force_y = law.mass * (speed * math.sin(heading) - vy) / law.dt
    square = force_x * force_x + force_y * force_y
    if square > law.max_force * law.max_force:
        part = law.max_force / math.sqrt(square)
        force_x, force_y = part * force_x, part * force_y
    torque = law.moment * (rate - angular_velocity) / law.dt
    return force_x, force_y, min(max(torque, -law.max_torque), law.max_torque)


@_compiled
def _state(law, now, tick):
    """Return the state; rays are cast only if an obstacle is near enough to be hit."""
    x, y, heading = now[0], now[1], now[2]
    column = min(max(int(x / law.width * law.columns), 0), law.columns - 1)
    row = min(max(int(y / law.height * law.rows), 0), law.rows - 1)
    detected = False
    for index in range(len(law.path)):
        ox, oy, _, _ = _obstacle(law, index, tick)
        if not detected and math.hypot(ox - x, oy - y) < law.ray_length + law.robot_radius:
            for ray in range(law.rays):
                angle = (ray - (law.rays - 1) / 2) * law.ray_gap
                along_x, along_y = math.cos(heading + angle), math.sin(heading + angle)
                if _ray(law, x - ox, y - oy, along_x, along_y) < law.ray_length:
                    detected = True
    return (column * law.rows + row) * 2 + int(detected)


@_compiled
def _ray(law, x, y, along_x, along_y):
    """Return how far a ray from (x, y) gets before it enters a robot at the origin, or infinity."""
    enter, leave = 0.0, np.inf
    for start, along in ((x, along_x), (y, along_y)):
        if along == 0.0:
            if abs(start) > law.half_side:
                return np.inf
        else:
            first, last = (-law.half_side - start) / along, (law.half_side - start) / along
            enter, leave = max(enter, min(first, last)), min(leave, max(first, last))
    return enter if 0.0 < enter <= leave else np.inf


# Without contacts.


@_compiled
def _inside(law, x, y, radius):
    """Return whether a circle lies within the walls."""
    x, y = min(x, law.width - x), min(y, law.height - y)
    return min(x, y) > radius and (x + y - law.corner) > radius * math.sqrt(2.0)


@_compiled
def _glide(law, turn_ticks, rate, speed, now, clock):
    """Carry out a decision without contacts, or return False and leave everything unchanged.

    Like the engine, this looks for contacts once a tick, at the bodies' new places.
    """
    if now[5] != 0.0 or now[6] != 0.0:
        return False
    x, y, heading = now[0], now[1], now[2]
    ball_x, ball_y = now[3], now[4]
    vx, vy, w, dt = 0.0, 0.0, 0.0, law.dt
    moving = turn_ticks + law.drive_ticks
    robot_reach, ball_reach = law.robot_radius + _MARGIN, law.ball_radius + _MARGIN
    robots, balls = (robot_reach + law.robot_radius) ** 2, (robot_reach + law.ball_radius) ** 2
    if not _inside(law, ball_x, ball_y, ball_reach):
        return False
    for tick in range(moving + 1):
        goal_speed = speed if turn_ticks <= tick < moving else 0.0
        goal_rate = rate if tick < turn_ticks else 0.0
        force_x, force_y, torque = _servo(law, goal_speed, goal_rate, heading, vx, vy, w)
        x, y, heading = x + vx * dt, y + vy * dt, heading + w * dt
        vx, vy = vx + force_x * (1 / law.mass) * dt, vy + force_y * (1 / law.mass) * dt
        w = w + torque * (1 / law.moment) * dt
        if not _inside(law, x, y, robot_reach) or (x - ball_x) ** 2 + (y - ball_y) ** 2 < balls:
            return False
        for index in range(len(law.path)):
            ox, oy, _, _ = _obstacle(law, index, clock[_TICK] + tick + 1)
            if (x - ox) ** 2 + (y - oy) ** 2 < robots:
                return False
            if (ball_x - ox) ** 2 + (ball_y - oy) ** 2 < balls:
                return False
    now[0], now[1], now[2] = x, y, heading
    clock[_TICK] += moving + 1
    return True


# With contacts.

_POINTER = types.intp
_FUNCTIONS = {
    "cpSpaceStep": types.void(_POINTER, types.float64),
    "cpSpaceEachBody": types.void(_POINTER, _POINTER, _POINTER),
    "cpSpaceEachCachedArbiter": types.void(_POINTER, _POINTER, _POINTER),
    "cpSpaceAddShape": _POINTER(_POINTER, _POINTER),
    "cpSpaceRemoveShape": types.void(_POINTER, _POINTER),
    "cpSpaceSetShapeIDCounter": types.void(_POINTER, types.uintp),
}


def _address(pointer: Any) -> int:
    return int(ffi.cast("intptr_t", pointer))


def _function(name: str) -> Any:
    """Make a C function of pymunk known by name to compiled functions, which then can be cached."""
    binding.add_symbol(name, _address(ffi.addressof(lib, name)))
    return types.ExternalFunction(name, _FUNCTIONS[name])


_step = _function("cpSpaceStep")
_each_body = _function("cpSpaceEachBody")
_each_arbiter = _function("cpSpaceEachCachedArbiter")
_add_shape = _function("cpSpaceAddShape")
_remove_shape = _function("cpSpaceRemoveShape")
_set_next_id = _function("cpSpaceSetShapeIDCounter")


class Batch(NamedTuple):
    """A table of some fields of all bodies (or contacts) that the engine fills or reads."""

    function: int  # address of what the engine calls for each of them
    request: int  # address of the structure that describes the table
    used: NDArray[np.intc]  # of numbers that were filled or read, first element
    table: NDArray[Any]


class Engine(NamedTuple):
    """A space, and the addresses by which compiled functions reach it."""

    space: int
    shapes: Ints
    n_walls: int
    bodies: NDArray[np.uintp]  # pymunk's numbers of the bodies
    read: Batch  # [body, x y heading, velocity x y, angular velocity]
    place: Batch  # [body, x y heading]
    move: Batch  # [body, velocity x y, angular velocity, force x y, torque]
    touching: Batch  # [pair, 2], pymunk's numbers of two bodies


def engine(keep: list[Any]) -> Engine:
    """Build a space; Python objects that own its memory are appended to `keep`."""
    space, robot, ball, obstacles = SoccerWorld().build_space()
    bodies = [robot, ball, *obstacles]
    shapes = [shape for body in bodies for shape in body.shapes]
    keep += [space, bodies, shapes]
    pose, motion = lib.POSITION | lib.ANGLE, lib.VELOCITY | lib.ANGULAR_VELOCITY
    get = ffi.addressof(lib, "pmSpaceBodyGetIteratorFuncBatched")
    put = ffi.addressof(lib, "pmSpaceBodySetIteratorFuncBatched")
    pairs = ffi.addressof(lib, "pmSpaceArbiterIteratorFuncBatched")
    bodies_of = lib.BODY_A_ID | lib.BODY_B_ID
    rows = len(bodies) + 2  # one for the static body, which comes last, and one to spare: the
    # engine would otherwise move a table that is full
    most = (len(bodies) + len(space.static_body.shapes)) ** 2
    return Engine(
        _address(space._space),
        np.array([_address(shape._shape) for shape in shapes]),
        len(space.static_body.shapes),
        np.array([body.id for body in bodies], np.uintp),
        _batch(get, pose | motion, np.zeros((rows, 6)), keep),
        _batch(put, pose, np.zeros((rows, 3)), keep),
        _batch(put, motion | lib.FORCE | lib.TORQUE, np.zeros((rows, 6)), keep),
        _batch(pairs, bodies_of, np.zeros((most, 2), np.uintp), keep),
    )


def _batch(function: Any, fields: int, table: NDArray[Any], keep: list[Any]) -> Batch:
    request = ffi.new("pmBatchedData *")
    floats, ints = ffi.new("pmFloatArray *"), ffi.new("pmIntArray *")
    used, kind = (floats, "cpFloat *") if table.dtype == np.float64 else (ints, "uintptr_t *")
    used.max, used.arr = table.size, ffi.cast(kind, table.ctypes.data)
    request.intArray, request.floatArray, request.fields = ints, floats, fields
    keep += [request, floats, ints, table]
    count = np.frombuffer(ffi.buffer(ffi.addressof(used, "num")), np.intc)
    return Batch(_address(function), _address(request), count, table)


@_compiled
def _exchange(space, batch):
    """Fill a table of bodies from the engine, or the engine from the table."""
    batch.used[0] = 0
    _each_body(space, batch.function, batch.request)


@_compiled
def _renew(engine, law, now, tick):
    """Put everything in its place, and make the space as good as new.

    Removing a shape drops its contacts, and removing all empties the tree that finds them; the tick
    in between uses up the corrections of positions that bodies carry over.
    """
    space = engine.space
    for shape in engine.shapes:
        _remove_shape(space, shape)
    _step(space, law.dt)
    place, move = engine.place.table, engine.move.table
    move[:] = 0.0
    place[0, 0], place[0, 1], place[0, 2] = now[0], now[1], now[2]
    place[1, 0], place[1, 1], move[1, 0], move[1, 1] = now[3], now[4], now[5], now[6]
    for index in range(len(law.path)):
        place[2 + index, 0], place[2 + index, 1], _, _ = _obstacle(law, index, tick)
    _exchange(space, engine.place)
    _exchange(space, engine.move)
    _set_next_id(space, engine.n_walls)
    for shape in engine.shapes:
        _add_shape(space, shape)


@_compiled
def _collide(engine, law, turn_ticks, rate, speed, now, clock):
    """Carry out a decision in which bodies may touch; return whether a goal was scored."""
    space, body, move = engine.space, engine.read.table, engine.move.table
    _renew(engine, law, now, clock[_TICK])
    _exchange(space, engine.read)
    moving = turn_ticks + law.drive_ticks
    obstacles = walls = scored = False
    for tick in range(moving + 1):
        goal_speed = speed if turn_ticks <= tick < moving else 0.0
        goal_rate = rate if tick < turn_ticks else 0.0
        force_x, force_y, torque = _servo(
            law, goal_speed, goal_rate, body[0, 2], body[0, 3], body[0, 4], body[0, 5]
        )
        move[:2, :3] = body[:2, 3:]
        move[0, 3], move[0, 4], move[0, 5] = force_x, force_y, torque
        move[1, 3], move[1, 4] = law.ball_drag * body[1, 3], law.ball_drag * body[1, 4]
        for index in range(len(law.path)):
            _, _, move[2 + index, 0], move[2 + index, 1] = _obstacle(law, index, clock[_TICK])
        _exchange(space, engine.move)
        _step(space, law.dt)
        clock[_TICK] += 1
        _exchange(space, engine.read)
        hit_obstacle, hit_wall = _touches(engine)
        obstacles, walls = obstacles or hit_obstacle, walls or hit_wall
        scored = body[1, 0] >= law.goal_x
        if scored:
            break
    now[:3], now[3:5], now[5:] = body[0, :3], body[1, :2], body[1, 3:5]
    clock[_OBSTACLES] += obstacles
    clock[_WALLS] += walls
    return scored


@_compiled
def _touches(engine):
    """Return whether the robot touches an obstacle, and a wall, or did in the last few ticks."""
    batch, robot, ball = engine.touching, engine.bodies[0], engine.bodies[1]
    batch.used[0] = 0
    _each_arbiter(engine.space, batch.function, batch.request)
    obstacles = walls = False
    for pair in range(batch.used[0] // 2):
        one, other = batch.table[pair, 0], batch.table[pair, 1]
        if one == robot or other == robot:
            other = other if one == robot else one
            moves = False
            for body in engine.bodies[2:]:
                moves = moves or other == body
            obstacles = obstacles or moves
            walls = walls or not (moves or other == ball)
    return obstacles, walls


# The world.


@_compiled
def reset(law, now, clock):
    """Put everything in its place and return the state."""
    for index, value in enumerate(law.start):
        now[index] = value
    clock[:] = 0
    return _state(law, now, 0)


@_compiled
def step(engine, law, now, clock, action):
    """Take a decision; return the state and whether the episode goes on, or why it does not."""
    before = -1
    while True:
        if now[5] * now[5] + now[6] * now[6] < law.ball_rest * law.ball_rest:
            now[5], now[6] = 0.0, 0.0
        turn_ticks, rate, speed = _plan(law, action, now)
        scored = False
        if before < 0 and law.macro_step:
            before = _state(law, now, clock[_TICK]) // 2
        if not _glide(law, turn_ticks, rate, speed, now, clock):
            scored = _collide(engine, law, turn_ticks, rate, speed, now, clock)
        state = _state(law, now, clock[_TICK])
        if scored:
            return state, SCORED
        if clock[_TICK] >= law.limit_ticks:
            return state, TIMED_OUT
        if not law.macro_step or state // 2 != before:
            return state, GOING


class FastSoccerWorld(SoccerWorld):
    """A `SoccerWorld` in compiled code, with the same results."""

    def __init__(self, params: SoccerParams | None = None) -> None:
        self._keep: list[Any] = []
        self._engine = engine(self._keep)
        # `SoccerWorld.step` repeats an action by itself.
        self._law = Law.of(params or SoccerParams())._replace(macro_step=False)
        super().__init__(params)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle what is explicit: a copy builds a space of its own."""
        names = ("pose", "ball", "ball_velocity", "tick", "contacts")
        return type(self), (self.params,), {name: getattr(self, name) for name in names}

    @property
    def state(self) -> int:
        """The state, see `replication.envs.soccer.rules.encode`."""
        return _state(self._law, self.pose, self.tick)

    def _decide(self, action: int) -> bool:
        now = np.array([*self.pose, *self.ball, *self.ball_velocity])
        clock = np.array([self.tick, *self.contacts])
        _, outcome = step(self._engine, self._law, now, clock, action)
        floats, (self.tick, *contacts) = now.tolist(), clock.tolist()
        self.pose, self.ball, self.ball_velocity = (*floats[:3],), (*floats[3:5],), (*floats[5:],)
        self.contacts = world.Contacts(*contacts)
        return outcome == SCORED
