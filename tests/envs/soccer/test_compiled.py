from __future__ import annotations

import copy
import math
import pickle
import platform
from collections.abc import Iterator
from typing import Any

import numpy as np
import pymunk
import pytest

from replication.envs.soccer import compiled, rules
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.rules import SoccerParams
from replication.envs.soccer.world import Contacts, SoccerWorld
from tests.envs.soccer.placing import OVERLAP, place

# On some processors a compiler may fuse a product and a sum, which rounds once instead of twice.
EXACT = platform.machine() in ("x86_64", "AMD64")
VARIANTS: tuple[dict[str, Any], ...] = (
    {},
    {"ray_arc": 180.0},
    {"macro": "cell", "time_limit": 60.0},
    {"drive_time": 0.4, "dt": 0.025, "rays": 7},
)


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
