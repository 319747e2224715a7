"""The speed of Q-learning, on one core: the kernel beside plain C and plain Python.

Python stands twice: as the reference, which is written to be read, and as `python_learn`, the same
loop on lists written for speed. Learners take turns, so that what else the machine does hits all of
them alike, and the best of several rounds counts. Run as ``python -m pytest benchmarks -s``.
"""

import ctypes
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from replication.learning import compiled, qlearning, reference
from replication.learning.seeds import stream

Array = NDArray[Any]
Learner = Callable[..., tuple[Array, Array, Array]]

SIZE = 20  # cells a side of the open maze
OPTIONS: dict[str, Any] = {
    "start": 18 * SIZE + 1,
    "goal": 3 * SIZE + 17,
    "horizon": 500,
    "beta": 0.7,
    "gamma": 0.9,
    "epsilon": 0.1,
}
ROUNDS = 5


class Agent(ctypes.Structure):
    """The `task` of qlearning.c."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("states", "start", "goal", "episodes", "horizon")),
        *((name, ctypes.c_double) for name in ("beta", "gamma")),
        ("threshold", ctypes.c_uint64),
        ("random_ties", ctypes.c_int64),
    )


@pytest.fixture(scope="module")
def c_learn(tmp_path_factory: pytest.TempPathFactory) -> Learner | None:
    """Compile qlearning.c and wrap it, or return None if there is no compiler."""
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        return None
    library = tmp_path_factory.mktemp("c") / "qlearning.so"
    source = Path(__file__).with_name("qlearning.c")
    flags = ["-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "-o", library, source], check=True)
    function = ctypes.CDLL(str(library)).learn

    def learn(
        next_state: Array, weights: Array, q: Array, streams: Array, **options: Any
    ) -> tuple[Array, Array, Array]:
        q, streams, steps = q.copy(), streams.copy(), np.empty(len(q), np.int64)
        task = Agent(
            states=len(next_state),
            threshold=round(options["epsilon"] * 2**32),
            random_ties=1,
            **{name: value for name, value in options.items() if name != "epsilon"},
        )
        arrays = [x.ctypes.data_as(ctypes.c_void_p) for x in (next_state, weights, q, streams)]
        steps_pointer = steps.ctypes.data_as(ctypes.c_void_p)
        function(ctypes.byref(task), ctypes.c_int64(len(q)), *arrays, steps_pointer)
        return q, streams, steps

    return learn


def open_maze() -> Array:
    """Return the transitions of an open maze: up, down, right, left."""
    row, column = np.divmod(np.arange(SIZE**2), SIZE)
    moves = ((-1, 0), (1, 0), (0, 1), (0, -1))
    rows = [np.clip(row + down, 0, SIZE - 1) for down, _ in moves]
    columns = [np.clip(column + right, 0, SIZE - 1) for _, right in moves]
    return np.stack(rows, axis=1) * SIZE + np.stack(columns, axis=1)


def make_load(kind: str, trials: int) -> tuple[Array, Array, Array, Array]:
    """Return the arrays of a call.

    In a `loop` the weights are random, so that the agent circles until the time is out, as early
    in inverse reinforcement learning; along a `path` to the goal each step is worth 1, and any
    other -1, as late in it; a `mixed` batch has both, so that its trials differ in length.
    """
    next_state = open_maze()
    loop = np.random.default_rng(1).normal(size=(trials, *next_state.shape))
    path = np.full(next_state.shape, -1.0)
    state = OPTIONS["start"]
    while state != OPTIONS["goal"]:
        up = state // SIZE > OPTIONS["goal"] // SIZE and np.count_nonzero(path > 0) % 2 == 0
        action = 0 if up or state % SIZE == OPTIONS["goal"] % SIZE else 2
        path[state, action] = 1.0
        state = next_state[state, action]
    chance = np.random.default_rng(2).random(trials)[:, None, None]
    weights = np.where(chance < {"loop": 1.0, "path": 0.0, "mixed": 0.5}[kind], loop, path)
    seeds = np.random.SeedSequence(3).spawn(trials)
    streams = np.array([stream(seed) for seed in seeds])
    return next_state, weights, np.zeros_like(weights), streams


def reference_learn(
    next_state: Array, weights: Array, q: Array, streams: Array, **options: Any
) -> tuple[Array, Array, Array]:
    """Run the first trial by the reference."""
    lists = (array.tolist() for array in (next_state, weights[0], q[0], streams[0]))
    values, stream, steps = reference.learn(*lists, **options)
    return np.array([values]), np.array([stream], np.uint64), np.array([steps])


def python_learn(
    next_state: Array, weights: Array, q: Array, streams: Array, **options: Any
) -> tuple[Array, Array, Array]:
    """Run the first trial by a loop on lists that draws ahead and carries the best value along."""
    successors, rewards, table = (x.tolist() for x in (next_state, weights[0], q[0]))
    beta, gamma, epsilon = options["beta"], options["gamma"], options["epsilon"]
    start, goal, horizon = options["start"], options["goal"], options["horizon"]
    rng, width, steps = np.random.default_rng(streams[0]), len(table[0]), 0

    def numbers() -> Iterator[float]:
        while True:
            yield from rng.random(10_000).tolist()

    number = numbers().__next__
    for _ in range(options["episodes"]):
        state, row = start, table[start]
        best = max(row)
        for _ in range(horizon):
            if number() < epsilon:
                action = int(number() * width)
            elif (ties := row.count(best)) == 1:
                action = row.index(best)
            else:
                action = [a for a in range(width) if row[a] == best][int(number() * ties)]
            steps += 1
            successor = successors[state][action]
            if successor == goal:
                row[action] += beta * (rewards[state][action] - row[action])
                break
            after = table[successor]
            best = max(after)
            row[action] += beta * (rewards[state][action] + gamma * best - row[action])
            if successor == state:
                best = max(row)
            state, row = successor, after
    return np.array([table]), streams, np.array([steps])


def speeds(
    learners: dict[str, Learner], arrays: Any, episodes: dict[str, int]
) -> tuple[dict[str, float], Array]:
    """Return each learner's best million steps per second, and the steps of the kernel's trials."""
    best, steps = dict.fromkeys(learners, 0.0), {}
    for _ in range(ROUNDS):
        for name, learner in learners.items():
            begin = thread_time()
            _, _, steps[name] = learner(*arrays, episodes=episodes[name], **OPTIONS)
            speed = steps[name].sum() / (thread_time() - begin) / 1e6
            best[name] = max(best[name], speed)
    return best, steps["kernel"]


def utilisation(steps: Array) -> float:
    """Return the share of lane steps that belong to a trial, given each trial's steps."""
    left, slots = steps.copy(), 0
    while groups := compiled.count_groups(np.count_nonzero(left)):
        running = np.flatnonzero(left)[: groups * compiled.LANES]
        count = left[running].min()
        left[running] -= count
        slots += count * groups * compiled.LANES
    return float(steps.sum() / (slots + left.sum()))


@pytest.fixture(scope="module")
def rows() -> Iterator[list[str]]:
    """Collect the rows of the table, which is printed at the end."""
    rows = [
        "load   trials    k steps   lanes   kernel      C  Python  reference   ratios of kernel"
    ]
    yield rows
    print("\n\nMillions of steps per second\n" + "\n".join(rows))


@pytest.mark.parametrize("trials", [25, 50])
@pytest.mark.parametrize("kind", ["loop", "path", "mixed"])
def test_speed(rows: list[str], c_learn: Learner | None, kind: str, trials: int) -> None:
    """Kernel, C and reference compute the same bits; their speeds are shown."""
    arrays = make_load(kind, trials)
    learners: dict[str, Learner] = {"kernel": qlearning.learn}
    if c_learn is not None:
        learners["C"] = c_learn
    learners |= {"Python": python_learn, "reference": reference_learn}
    bits = {
        name: [array[:1].tobytes() for array in learner(*arrays, episodes=20, **OPTIONS)]
        for name, learner in learners.items()
        if name != "Python"
    }
    assert all(x == bits["reference"] for x in bits.values())
    episodes = {"kernel": 2000, "C": 2000, "Python": 1000, "reference": 100}
    best, steps = speeds(learners, arrays, episodes)
    ratios = ", ".join(f"{best['kernel'] / best[name]:.3g} {name}" for name in list(learners)[1:])
    lengths = f"{steps.min() / 1e3:.0f}-{steps.max() / 1e3:.0f}"
    rows.append(
        f"{kind:6} {trials:6} {lengths:>10} {utilisation(steps):7.0%} {best['kernel']:8.0f} "
        f"{best.get('C', np.nan):6.0f} {best['Python']:7.2f} {best['reference']:10.2f}   {ratios}"
    )
