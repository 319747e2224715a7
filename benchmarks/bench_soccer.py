"""The speed of robot soccer, in decisions a second on one core, beside pymunk's bare steps."""

from collections.abc import Callable
from time import thread_time
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.rules import FORWARD, SLOW, SoccerParams
from replication.envs.soccer.world import SoccerWorld
from replication.learning.seeds import stream
from replication.learning.soccer import learn

OPTIONS: dict[str, Any] = {"gamma": 0.9, "epsilon_start": 0.3, "epsilon_end": 0.05}
SEEDS = 8


def mixes(seed: int) -> dict[str, tuple[NDArray[Any], NDArray[Any], float]]:
    """Weights, values and learning rates of what a learner does in the course of a trial."""
    rng = np.random.default_rng(seed)
    zeros, noise = np.zeros((384, 5)), rng.normal(size=(384, 5))
    expert = np.zeros((384, 5))
    expert[0::2, FORWARD] = expert[1::2, SLOW] = 1.0
    return {
        "random policy, fixed": (zeros, noise, 0.0),
        "learning on random rewards": (noise, zeros, 0.6),
        "learning from zero on no reward": (zeros, zeros, 0.6),
        "near the expert": (zeros, expert, 0.0),
    }


def clock(run: Callable[[], int]) -> float:
    """Return how many things a second `run`, which returns their number, does."""
    start = thread_time()
    number = run()
    return number / (thread_time() - start)


@pytest.mark.parametrize("mix", mixes(0))
def test_decisions(mix: str) -> None:
    """Epsilon-greedy learning does tens of thousands of decisions a second in every mix."""
    rates = []
    for seed in range(SEEDS + 1):
        weights, q, beta = mixes(seed)[mix]
        words = stream(np.random.SeedSequence(seed))
        options = OPTIONS | {"episodes": 100, "beta": beta}
        run = lambda: learn(SoccerParams(), weights, q, words, **options)[2]  # noqa: B023, E731
        rates.append(clock(run))
    rates = rates[1:]  # the first one compiles
    print(f"\n{mix}: {np.mean(rates):,.0f} decisions/s ({min(rates):,.0f} to {max(rates):,.0f})")
    assert np.mean(rates) > 20_000


def test_against_bare_steps() -> None:
    """Stepped from Python, the compiled world takes about what pymunk's steps alone would take."""

    def decide(world: SoccerWorld, n: int) -> Callable[[], int]:
        actions = np.random.default_rng(1).integers(0, 5, n).tolist()

        def run() -> int:
            world.reset()
            for action in actions:
                if any(world.step(action)[1:]):
                    world.reset()
            return n

        return run

    fast = FastSoccerWorld()
    fast.step(FORWARD)
    plain_rate, fast_rate = clock(decide(SoccerWorld(), 500)), clock(decide(fast, 20_000))
    ticks, decisions = 0, 0
    world = FastSoccerWorld()
    for action in np.random.default_rng(1).integers(0, 5, 500).tolist():
        before, decisions = world.tick, decisions + 1
        if any(world.step(action)[1:]):
            world.reset()
        else:
            ticks += world.tick - before
    space = SoccerWorld().build_space()[0]

    def steps() -> int:
        for _ in range(100_000):
            space.step(0.05)
        return 100_000

    bare = clock(steps) * decisions / ticks
    print(
        f"\nplain {plain_rate:,.0f}, compiled {fast_rate:,.0f}, only pymunk's steps {bare:,.0f} "
        f"decisions/s: the compiled world takes {bare / fast_rate:.2f} of bare stepping"
    )
    assert fast_rate > 5 * plain_rate
