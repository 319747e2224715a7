import copy
import functools
import math
import os
import pickle
import platform
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import gymnasium
import numpy as np
import pymunk
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.typing import NDArray

from replication.envs.soccer import compiled, rules
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.rules import BACKWARD, FORWARD, LEFT, RIGHT, SLOW, SoccerParams
from replication.envs.soccer.world import Contacts, SoccerWorld
from replication.learning import reference, soccer
from replication.learning.seeds import stream

OVERLAP = 0.011  # bodies are found to touch after they have moved on for a tick, at most 0.01 m
# On some processors a compiler may fuse a product and a sum, which rounds once instead of twice.
EXACT = platform.machine() in ("x86_64", "AMD64")


def explicit(world: SoccerWorld) -> tuple[Any, ...]:
    """Everything that a world is made of."""
    return world.pose, world.ball, world.ball_velocity, world.tick, world.contacts, world.state


def agree(one: SoccerWorld, other: SoccerWorld) -> bool:
    """Whether two worlds are equal, to the last bit where that can be asked for."""
    if EXACT:
        return explicit(one) == explicit(other)
    close = np.allclose(
        [*one.pose, *one.ball, *one.ball_velocity],
        [*other.pose, *other.ball, *other.ball_velocity],
        rtol=0,
        atol=1e-9,
    )
    return close and explicit(one)[3:] == explicit(other)[3:]


def place(world: SoccerWorld, pose: Any = None, ball: Any = None, velocity: Any = None) -> None:
    """Put the robot and the ball somewhere."""
    world.pose = pose or world.pose
    world.ball = ball or world.ball
    world.ball_velocity = velocity or world.ball_velocity


def random_actions(seed: int, n: int) -> Iterator[int]:
    """Actions with habits: each stretch of 30 decisions prefers some to others."""
    rng = np.random.default_rng(seed)
    for _ in range(n // 30):
        yield from rng.choice(5, 30, p=rng.dirichlet(np.full(5, 0.4))).tolist()


def random_places(seed: int, n: int) -> Iterator[tuple[Any, Any]]:
    """Places of the robot and the ball, clear of the walls and of each other."""
    rng = np.random.default_rng(seed)
    for _ in range(n):
        while True:
            x, y, u, v = rng.uniform(0.12, (1.28, 1.08, 1.28, 1.08)).tolist()
            if math.hypot(x - u, y - v) > 0.08:
                break
        yield (x, y, rng.uniform(-4, 4)), (u, v)


@functools.cache
def expert() -> tuple[list[tuple[int, int]], list[tuple[float, float]], FastSoccerWorld]:
    """Return the expert's pairs, the positions where it decided, and the world after them."""
    world = FastSoccerWorld()
    pairs: list[tuple[int, int]] = []
    places: list[tuple[float, float]] = []
    state, scored = world.reset(), False
    while not scored and len(pairs) < 100:
        pairs.append((state, rules.expert_action(state)))
        places.append(world.pose[:2])
        state, scored, _ = world.step(pairs[-1][1])
    assert scored
    return pairs, places, world


# The plain world.


def test_ball_rolls_straight_and_slows() -> None:
    """A ball that is hit straight rolls straight and keeps 40 % of its speed after a second."""
    world = SoccerWorld()
    place(world, ball=(0.3, 0.9), pose=(0.2, 0.2, 0.0), velocity=(0.2, 0.0))
    speeds = [0.2]
    while world.time < 1:
        world.step(SLOW)
        speeds.append(world.ball_velocity[0])
        assert world.ball_velocity[1] == 0.0
        assert world.ball[1] == 0.9
    assert all(later < earlier for earlier, later in pairwise(speeds))
    assert speeds[-1] == pytest.approx(0.2 * 0.4**world.time, rel=0.05)


def test_robot_moves_as_planned() -> None:
    """Free of contacts, a decision turns exactly to the planned heading and drives 0.10 m."""
    for action, aside, way in (
        (FORWARD, 0, 0.1),
        (BACKWARD, 0, -0.1),
        (RIGHT, -90, 0.1),
        (LEFT, 90, 0.1),
        (SLOW, 0, 0.05),
    ):
        world = SoccerWorld()
        place(world, pose=(0.40, 0.60, 2.0))
        world.step(action)
        heading = math.radians(aside)
        x, y = 0.40 + way * math.cos(heading), 0.60 + way * math.sin(heading)
        assert world.pose[:2] == pytest.approx((x, y), abs=1e-12)
        assert math.remainder(world.pose[2] - heading, math.tau) == pytest.approx(0, abs=1e-12)
        turn = abs(math.remainder(heading - 2.0, math.tau))
        assert world.tick == math.ceil(turn / 0.2) + 10 + 1


def test_wheels_have_a_limit() -> None:
    """However much there is to correct, wheels push no harder than the tyres hold."""
    for velocity, rate in (((0.3, 0.9), 90.0), ((-2.0, 0.1), -90.0)):
        force_x, force_y, torque = rules.servo(0.2, rate, 0.0, velocity, 0.0, 0.05)
        assert math.hypot(force_x, force_y) == pytest.approx(3.5)
        assert force_y / force_x == pytest.approx(velocity[1] / (velocity[0] - 0.2))
        assert torque == math.copysign(0.2, rate)


def test_obstacle_is_a_triangle_wave() -> None:
    """An obstacle goes from end to end at its speed, turns round, and is back after a cycle."""
    for path in rules.PATHS:
        half = rules.half_ticks(path, 0.05)
        assert half * 0.05 * path.speed == pytest.approx(math.dist(path.start, path.end))
        at = [np.array(rules.obstacle(path, tick, 0.05)) for tick in range(2 * half + 1)]
        assert (at[0] == at[-1]).all()
        for now, later in pairwise(at):
            assert later[:2] == pytest.approx(now[:2] + 0.05 * now[2:], abs=1e-12)
            assert np.hypot(*now[2:]) == pytest.approx(path.speed)
        assert np.ptp([p[:2] for p in at], axis=0) == pytest.approx(
            np.abs(np.subtract(path.end, path.start))
        )


def test_obstacle_paths_leave_room() -> None:
    """Between an obstacle and a wall there is always room for a robot: it is not crushed."""
    for path in rules.PATHS:
        for x, y in (path.start, path.end):
            gap = min(x, rules.WIDTH - x, y, rules.HEIGHT - y) - rules.ROBOT_SIDE / 2
            assert gap >= rules.ROBOT_SIDE


def test_rays_by_hand() -> None:
    """A ray that points at an obstacle measures the way to its near side; the others reach on."""
    world = SoccerWorld(SoccerParams(rays=4))  # at -135, -45, 45 and 135 degrees
    x, y, _ = world.obstacles[0]
    place(world, pose=(x - 0.10, y, math.pi / 4))
    near = 0.10 - rules.ROBOT_SIDE / 2
    assert world.rays() == pytest.approx([0.15, near, 0.15, 0.15])
    place(world, pose=(x - 0.08, y - 0.08, 0.0))
    corner = (0.08 - rules.ROBOT_SIDE / 2) * math.sqrt(2)
    assert world.rays() == pytest.approx([0.15, 0.15, corner, 0.15])


def test_front_rays() -> None:
    """Over half a circle the rays see what is ahead and not what is behind."""
    angles = SoccerParams(ray_arc=180).ray_angles
    assert (len(angles), angles[0], angles[-1]) == pytest.approx((15, -math.pi / 2, math.pi / 2))
    front, around = SoccerWorld(SoccerParams(ray_arc=180)), SoccerWorld()
    x, y, _ = front.obstacles[0]
    for heading, ahead in ((0.0, True), (math.pi, False)):
        for world, sees in ((front, ahead), (around, True)):
            place(world, pose=(x - 0.12, y, heading))
            assert rules.decode(world.state)[2] == sees


def test_state_at_borders() -> None:
    """The states number 16 x 12 cells of two each; a border belongs to the cell that it opens."""
    seen = {
        rules.encode((i + 0.5) * 1.4 / 16, (j + 0.5) * 0.1, detected): (i, j, detected)
        for i in range(16)
        for j in range(12)
        for detected in (False, True)
    }
    assert sorted(seen) == list(range(384))
    assert all(rules.decode(state) == place for state, place in seen.items())
    for i in range(1, 16):
        x = i * 1.4 / 16
        assert rules.decode(rules.encode(x + 1e-9, 0.0, False))[0] == i
        assert rules.decode(rules.encode(x - 1e-9, 0.0, False))[0] == i - 1
    assert rules.encode(-0.01, -0.01, False) == rules.encode(0.0, 0.0, False)
    assert rules.encode(1.42, 1.21, False) == rules.encode(1.39, 1.19, False)


def test_border_distance() -> None:
    """The distance is to the nearest border between cells; the outline of the field is none."""
    assert rules.border_distance(0.001, 0.05) == pytest.approx(0.05)
    assert rules.border_distance(0.0875 * 3 + 0.004, 0.95) == pytest.approx(0.004)
    assert rules.border_distance(0.0875 * 3.5, 0.9 - 0.003) == pytest.approx(0.003)


def test_detection_ends_with_the_rays() -> None:
    """An obstacle is detected within reach of a ray and not a micrometre beyond."""
    world = SoccerWorld()
    x, y, _ = world.obstacles[0]
    reach = 0.15 + rules.ROBOT_SIDE / 2
    for offset, seen in ((1e-6, False), (-1e-6, True)):
        place(world, pose=(x - reach - offset, y, 0.0))
        assert rules.decode(world.state)[2] == seen


def test_time_out() -> None:
    """An episode without a goal ends after the first decision that reaches the time limit."""
    world = FastSoccerWorld(SoccerParams(time_limit=20.0))
    outcomes = [(world.time, world.step(BACKWARD)[1:]) for _ in range(40)]
    last = next(i for i, (_, (_, timed_out)) in enumerate(outcomes) if timed_out)
    assert outcomes[last][0] < 20.0 <= outcomes[last + 1][0]
    assert not any(scored for _, (scored, _) in outcomes)
    assert SoccerParams().limit_ticks * SoccerParams().dt == 300.0


def test_goal_is_the_whole_ball() -> None:
    """A goal falls when the whole ball is over the line between the posts, not before."""
    world = SoccerWorld()
    place(world, ball=(1.36, 0.6), velocity=(0.1, 0.0))
    while world.ball[0] < rules.GOAL_X:
        before = world.ball[0]
        _, scored, _ = world.step(BACKWARD)
        assert scored == (world.ball[0] >= 1.4 + rules.BALL_RADIUS)
    assert before < rules.GOAL_X
    place(world, ball=(1.36, 0.3), velocity=(0.1, 0.0))  # beside the gate
    assert not any(world.step(BACKWARD)[1] for _ in range(8))
    assert world.ball[0] < 1.4 - rules.BALL_RADIUS + OVERLAP


def test_ball_pinned_to_wall() -> None:
    """A robot that presses the ball against a wall does not push it through, nor itself."""
    world = FastSoccerWorld()
    place(world, pose=(0.5, 0.15, -math.pi / 2), ball=(0.5, 0.03))
    for _ in range(60):
        world.step(FORWARD)
        assert world.ball[1] > 0
        assert world.pose[1] > 0


@pytest.mark.parametrize("seed", range(3))
def test_nothing_gets_out(seed: int) -> None:
    """Whatever the robot does, bodies stay in the field and overlap by a tick's way at most."""
    world = FastSoccerWorld()
    touched = Contacts()
    for (pose, ball), block in zip(random_places(seed, 60), range(60), strict=True):
        world.reset()
        place(world, pose=pose, ball=ball)
        for action in random_actions(60 * seed + block, 60):
            _, scored, _ = world.step(action)
            x, y, _ = world.pose
            u, v = world.ball
            inner = rules.ROBOT_SIDE / 2
            assert inner - OVERLAP < x < 1.4 + rules.MOUTH - inner + OVERLAP
            assert inner - OVERLAP < y < 1.2 - inner + OVERLAP
            assert 0 < u < 1.5
            assert 0 < v < 1.2
            assert math.hypot(x - u, y - v) > inner
            for ox, oy, _ in world.obstacles:
                assert max(abs(x - ox), abs(y - oy)) > 2 * inner - 2 * OVERLAP
                assert max(abs(u - ox), abs(v - oy)) > inner
            if scored:
                break
        touched = Contacts(*np.add(touched, world.contacts).tolist())
    assert min(touched) > 50  # else this has not tried


def test_contacts_are_counted() -> None:
    """A decision that ends at a wall, or at an obstacle, counts once as a contact with it."""
    world = SoccerWorld()
    place(world, pose=(0.10, 0.60, 0.0))
    assert world.contacts == (0, 0)
    world.step(BACKWARD)
    assert world.contacts == (0, 1)
    x, y, _ = world.obstacles[0]
    place(world, pose=(x - 0.12, y + 0.03, 0.0), ball=(x + 0.2, y + 0.03))
    world.step(FORWARD)
    assert world.contacts == (1, 1)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("speed", 0.5),
        ("slow_speed", 0.3),
        ("rays", 0),
        ("rays", 2.5),
        ("ray_arc", 400.0),
        ("dt", 0.0),
        ("drive_time", 0.01),
        ("time_limit", math.nan),
    ],
)
def test_params_are_checked(name: str, value: float) -> None:
    """A parameter out of range is refused by its name, as is an action that does not exist."""
    with pytest.raises(ValueError, match=name):
        SoccerParams(**{name: value})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no action 5"):
        SoccerWorld().step(5)


# The compiled world.

VARIANTS: tuple[dict[str, Any], ...] = (
    {},
    {"ray_arc": 180.0},
    {"macro": "cell", "time_limit": 60.0},
    {"drive_time": 0.4, "dt": 0.025, "rays": 7},
)


@pytest.mark.parametrize("options", VARIANTS)
def test_compiled_world_is_the_plain_world(options: dict[str, Any]) -> None:
    """The compiled world equals the one of pymunk's public interface after every decision."""
    plain, fast = SoccerWorld(SoccerParams(**options)), FastSoccerWorld(SoccerParams(**options))
    touched = Contacts()
    for (pose, ball), block in zip(random_places(1, 12), range(12), strict=True):
        assert plain.reset() == fast.reset()
        for world in (plain, fast):
            place(world, pose=pose, ball=ball)
        for action in random_actions(block, 30 if options else 120):
            outcome = plain.step(action)
            assert fast.step(action) == outcome
            assert agree(plain, fast)
            if any(outcome[1:]):
                break
        touched = Contacts(*np.add(touched, plain.contacts).tolist())
    assert min(touched) > 0


def test_engine_is_not_needed_for_free_decisions() -> None:
    """Decisions without a contact come out the same if they are given to the engine."""
    params = SoccerParams()
    law = compiled.Law.of(params)
    keep: list[Any] = []
    engine = compiled.engine(keep)
    glided = 0
    for i, (pose, ball) in enumerate(random_places(2, 300)):
        now, clock = np.array([*pose, *ball, 0.0, 0.0]), np.array([17, 0, 0])
        plan = rules.plan(params, i % 5, pose, ball)
        other, other_clock = now.copy(), clock.copy()
        if compiled._glide(law, *plan, now, clock):
            glided += 1
            assert not compiled._collide(engine, law, *plan, other, other_clock)
            assert (clock == other_clock).all()
            assert now == pytest.approx(other, rel=0, abs=0 if EXACT else 1e-12)
    assert 100 < glided < 300


def test_compiled_rays_are_the_engines() -> None:
    """Rays by geometry and by pymunk's segment queries have the same length."""
    rng = np.random.default_rng(3)
    space = pymunk.Space()
    space.add(pymunk.Poly.create_box(space.static_body, (rules.ROBOT_SIDE, rules.ROBOT_SIDE)))
    law, hits = compiled.Law.of(SoccerParams()), 0
    for x, y, angle in rng.uniform((-0.15, -0.15, -4), (0.15, 0.15, 4), (500, 3)).tolist():
        if max(abs(x), abs(y)) < rules.ROBOT_SIDE / 2:
            continue
        along = math.cos(angle), math.sin(angle)
        tip = x + along[0], y + along[1]
        hit = space.segment_query_first((x, y), tip, 0.0, pymunk.ShapeFilter())
        hits += hit is not None
        length = compiled._ray(law, x, y, *along)
        assert length == pytest.approx(hit.alpha if hit else math.inf)
    assert hits > 50


def test_episodes_leave_no_trace() -> None:
    """An episode has the same bits at first, after another one, and in a copy of the world."""

    def episode(world: SoccerWorld, seed: int) -> list[Any]:
        world.reset()
        return [(world.step(action), explicit(world)) for action in random_actions(seed, 150)]

    world = FastSoccerWorld()
    first, between, again = (episode(world, seed) for seed in (4, 5, 4))
    assert first == again != between
    assert episode(pickle.loads(pickle.dumps(world)), 4) == first
    half = FastSoccerWorld()
    for action in list(random_actions(4, 150))[:70]:
        half.step(action)
    twin = copy.deepcopy(half)
    rest = list(random_actions(4, 150))[70:]
    for one in (half, twin):
        assert [(one.step(action), explicit(one)) for action in rest] == first[70:]


SCRIPT = """
import numpy as np
from replication.envs.soccer import SoccerParams
from replication.soccer_learning import learn_trial
q, words, n = learn_trial(SoccerParams(time_limit=100.0), np.eye(384, 5), np.zeros((384, 5)),
    np.arange(1, 5, dtype=np.uint64), episodes=8, beta=0.6, gamma=0.9, epsilon_start=0.3,
    epsilon_end=0.05)
print(q.tobytes().hex(), words, n)
"""


def test_new_process_same_bits() -> None:
    """Another process, with another hash seed, learns the same bits."""
    outputs = {
        subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env=os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("0", "42")
    }
    assert len(outputs) == 1


# The expert.


def test_expert() -> None:
    """The expert scores in 15 decisions without a contact, and slows down before one obstacle."""
    pairs, places, world = expert()
    assert (len(pairs), len(set(pairs)), world.contacts) == (15, 14, (0, 0))
    slow = [i for i, (_, action) in enumerate(pairs) if action == SLOW]
    assert slow == list(range(slow[0], slow[0] + 3))
    assert {action for _, action in pairs} == {FORWARD, SLOW}
    assert world.time < 10
    assert min(rules.border_distance(*place) for place in places) >= 0.001


def test_expert_has_a_reason() -> None:
    """Driving on at full speed, as the expert would without obstacles, hits one."""
    world = FastSoccerWorld()
    for _ in range(15):
        if world.step(FORWARD)[1]:
            break
    assert world.contacts.obstacles > 0


# Learning.


def learn_plainly(
    params: SoccerParams, weights: Any, q: Any, stream: list[int], options: dict[str, Any]
) -> tuple[Any, list[int], int]:
    """Learn in the uncompiled world by the definitions of `replication.learning.reference`."""
    world, steps, episodes = FastSoccerWorld(params), 0, options["episodes"]
    for epsilon in np.linspace(options["epsilon_start"], options["epsilon_end"], episodes).tolist():
        state, done = world.reset(), False
        while not done:
            word = reference.draw(stream)
            action = reference.choose(q[state], word, epsilon, options["random_ties"])
            successor, scored, timed_out = world.step(action)
            value = 0.0 if scored else max(q[successor])
            target = weights[state][action] + options["gamma"] * value
            q[state][action] += options["beta"] * (target - q[state][action])
            state, done, steps = successor, scored or timed_out, steps + 1
    return q, stream, steps


def tables(seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint64]]:
    """Weights that lead to the goal and back, values with ties, and a stream."""
    rng = np.random.default_rng(seed)
    q = rng.integers(0, 3, (384, 5)).astype(float)
    return rng.normal(size=(384, 5)), q, stream(np.random.SeedSequence(seed))


@pytest.mark.parametrize("random_ties", [True, False])
@pytest.mark.parametrize("macro", ["cell", "decision"])
def test_learning_is_the_reference(random_ties: bool, macro: str) -> None:
    """Learning returns the bits of the plain loop: Q, the stream and the number of decisions."""
    params = SoccerParams(time_limit=40.0, macro=macro)
    options: dict[str, Any] = {
        "episodes": 12,
        "beta": 0.6,
        "gamma": 0.9,
        "random_ties": random_ties,
    }
    options |= {"epsilon_start": 0.3, "epsilon_end": 0.05}
    weights, q, stream = tables(6)
    weights[:, FORWARD] += 1.0  # so that some episodes end with a goal
    got = soccer.learn_trial(params, weights, q, stream, **options)
    wanted = learn_plainly(params, weights.tolist(), q.tolist(), stream.tolist(), options)
    assert got[0].tolist() == wanted[0]
    assert got[1].tolist() == wanted[1]
    assert got[2] == wanted[2]
    assert (q == tables(6)[1]).all()


def test_goal_and_time_out_in_the_target() -> None:
    """A goal is worth nothing afterwards; a time-out is not terminal, so its target bootstraps."""
    pairs, _, world = expert()
    q = np.zeros((384, 5))
    for state, action in pairs:
        q[state, action] = 1.0
    stream = np.arange(1, 5, dtype=np.uint64)
    rates: dict[str, Any] = {"beta": 1.0, "gamma": 0.5, "epsilon_start": 0.0, "epsilon_end": 0.0}
    zero = np.zeros((384, 5))
    got, _, n = soccer.learn_trial(SoccerParams(), zero, q, stream, episodes=1, **rates)
    assert (n, got[pairs[-1]]) == (15, 0.0)
    short = SoccerParams(time_limit=world.time - 0.3)  # before the last decision
    got, _, n = soccer.learn_trial(short, zero, q, stream, episodes=1, **rates)
    assert (n, got[pairs[-2]]) == (14, 0.5)


def test_roll_out_of_the_expert() -> None:
    """The greedy policy of a Q that prefers the expert's actions repeats its episode, hitless."""
    pairs, _, world = expert()
    q = np.zeros((384, 5))
    for state, action in pairs:
        q[state, action] = 1.0
    words = stream(np.random.SeedSequence(7))
    states, actions, hits, after = soccer.roll_out(SoccerParams(), q, words)
    assert list(zip(states[:-1].tolist(), actions.tolist(), strict=True)) == pairs
    assert states[-1] == world.state
    assert hits.tolist() == [False] * len(pairs)
    words = words.tolist()
    for _ in pairs:
        reference.draw(words)
    assert after.tolist() == words


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weights": np.zeros((3, 5))}, "weights"),
        ({"q": np.full((384, 5), np.nan)}, "q must"),
        ({"stream": np.zeros(4, np.uint64)}, "stream"),
        ({"episodes": 0}, "episodes"),
        ({"gamma": 1.5}, "gamma"),
        ({"epsilon_end": -0.1}, "epsilon_end"),
    ],
)
def test_learning_checks_its_arguments(change: dict[str, Any], message: str) -> None:
    """An argument that does not fit is refused by its name."""
    arguments: dict[str, Any] = {
        "weights": np.zeros((384, 5)),
        "q": np.zeros((384, 5)),
        "stream": np.ones(4, np.uint64),
        "episodes": 1,
        "beta": 0.6,
        "gamma": 0.9,
        "epsilon_start": 0.3,
        "epsilon_end": 0.05,
    }
    with pytest.raises(ValueError, match=message):
        soccer.learn_trial(SoccerParams(), **(arguments | change))


# Gymnasium.


def test_environment() -> None:
    """The environment passes Gymnasium's checks and reports what its world does."""
    env = gymnasium.make("replication/Soccer-v0", render_mode="rgb_array")
    check_env(env.unwrapped)
    pairs, _, world = expert()
    state, _ = env.reset(seed=0)
    for i, (expected, action) in enumerate(pairs):
        assert state == expected
        state, reward, terminated, truncated, info = env.step(action)
        assert (reward, terminated, truncated) == (0.0, i == len(pairs) - 1, False)
    assert (state, info["time"]) == (world.state, world.time)


def test_picture() -> None:
    """The robot is drawn where it is, and nowhere else."""
    env = gymnasium.make("replication/Soccer-v0", render_mode="rgb_array")
    env.reset()
    image: Any = env.render()
    blue = np.argwhere((image == (40, 80, 200)).all(axis=-1))
    row, column = blue.mean(axis=0)
    assert (column / 200, 1.2 - row / 200) == pytest.approx(rules.ROBOT_START, abs=0.02)
    assert np.ptp(blue, axis=0).max() < 0.075 * math.sqrt(2) * 200
