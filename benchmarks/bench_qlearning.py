"""The speed of Q-learning, on one core: the kernel beside plain C and the plain-Python reference.

Ratios are taken between runs that alternate, so that what else the machine does hits both alike.
"""

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from replication import qlearning, reference

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


class Task(ctypes.Structure):
    """The `task` of qlearning.c."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("states", "start", "goal", "episodes", "horizon")),
        *((name, ctypes.c_double) for name in ("beta", "gamma")),
        ("threshold", ctypes.c_uint64),
        *((name, ctypes.c_int64) for name in ("random_ties", "bootstrap_goal")),
    )


@pytest.fixture(scope="module")
def c_learn(tmp_path_factory: pytest.TempPathFactory) -> Learner:
    """Compile qlearning.c and wrap it, or skip if there is no compiler."""
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        pytest.skip("no C compiler found")
    library = tmp_path_factory.mktemp("c") / "qlearning.so"
    source = Path(__file__).with_name("qlearning.c")
    flags = ["-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "-o", library, source], check=True)
    function = ctypes.CDLL(str(library)).learn

    def learn(
        next_state: Array, weights: Array, q: Array, streams: Array, **options: Any
    ) -> tuple[Array, Array, Array]:
        q, streams, steps = q.copy(), streams.copy(), np.empty(len(q), np.int64)
        task = Task(
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
    streams = np.array([qlearning.stream(seed) for seed in seeds])
    return next_state, weights, np.zeros_like(weights), streams


def reference_learn(
    next_state: Array, weights: Array, q: Array, streams: Array, **options: Any
) -> tuple[Array, Array, Array]:
    """Run the first trial by the reference."""
    lists = (array.tolist() for array in (next_state, weights[0], q[0], streams[0]))
    values, stream, steps = reference.learn(*lists, **options)
    return np.array([values]), np.array([stream], np.uint64), np.array([steps])


def speeds(learners: list[Learner], arrays: Any, episodes: list[int]) -> tuple[list[float], Array]:
    """Return each learner's best steps per second of several alternating rounds.

    Also returns the steps of each trial of the first one.
    """
    best = [0.0] * len(learners)
    first = learners[0](*arrays, episodes=episodes[0], **OPTIONS)
    for _ in range(ROUNDS):
        for i, learner in enumerate(learners):
            begin = thread_time()
            _, _, steps = learner(*arrays, episodes=episodes[i], **OPTIONS)
            best[i] = max(best[i], steps.sum() / (thread_time() - begin))
    return best, first[2]


def utilisation(steps: Array) -> float:
    """Return the share of lane steps that belong to a trial, given each trial's steps."""
    left, slots = steps.copy(), 0
    while groups := qlearning._groups(np.count_nonzero(left)):
        running = np.flatnonzero(left)[: groups * qlearning.LANES]
        count = left[running].min()
        left[running] -= count
        slots += count * groups * qlearning.LANES
    return float(steps.sum() / (slots + left.sum()))


@pytest.mark.parametrize("trials", [25, 50])
@pytest.mark.parametrize("kind", ["loop", "path", "mixed"])
def test_kernel_beside_c(benchmark: Any, c_learn: Learner, kind: str, trials: int) -> None:
    """The kernel and the C program compute the same bits; their speeds are shown."""
    arrays, episodes = make_load(kind, trials), 2000
    for ours, theirs in zip(
        qlearning.learn(*arrays, episodes=20, **OPTIONS),
        c_learn(*arrays, episodes=20, **OPTIONS),
        strict=True,
    ):
        assert ours.tobytes() == theirs.tobytes()
    (kernel, c), steps = speeds([qlearning.learn, c_learn], arrays, [episodes] * 2)
    lengths = f"{steps.min() / 1e3:.0f} k to {steps.max() / 1e3:.0f} k"
    print(
        f"\n{kind}, {trials} trials of {lengths} steps: kernel {kernel / 1e6:.0f} M steps/s, "
        f"C {c / 1e6:.0f} M steps/s, kernel / C {kernel / c:.2f}, "
        f"lanes in use {utilisation(steps):.0%}"
    )
    benchmark.extra_info.update(kernel=kernel, c=c, ratio=kernel / c)
    benchmark.pedantic(
        qlearning.learn, arrays, {"episodes": episodes, **OPTIONS}, rounds=3, warmup_rounds=1
    )


def test_kernel_beside_reference(benchmark: Any) -> None:
    """The kernel and the reference compute the same bits; their speeds are shown."""
    arrays = make_load("mixed", 25)
    for ours, theirs in zip(
        qlearning.learn(*arrays, episodes=20, **OPTIONS),
        reference_learn(*arrays, episodes=20, **OPTIONS),
        strict=True,
    ):
        assert ours[:1].tobytes() == theirs.tobytes()
    (kernel, plain), _ = speeds([qlearning.learn, reference_learn], arrays, [1000, 100])
    print(
        f"\nmixed, 25 trials: kernel {kernel / 1e6:.0f} M steps/s, "
        f"reference {plain / 1e6:.2f} M steps/s, kernel / reference {kernel / plain:.0f}"
    )
    benchmark.extra_info.update(kernel=kernel, reference=plain, ratio=kernel / plain)
    benchmark.pedantic(reference_learn, arrays, {"episodes": 20, **OPTIONS}, rounds=3)
