"""The speed of Q-learning, on one core: the compiled learner beside plain C and plain Python.

Python stands twice: as the reference, which is written to be read, and as `python_learn`, the same
loop on lists written for speed. Learners take turns, so that what else the machine does hits all of
them alike; shown are the best of several rounds and the ratio in the least and the most favourable
round. Run as ``make bench``.
"""

import ctypes
import resource
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from replication import Demos, Params
from replication.demos.files import load_demos
from replication.files import PROJECT
from replication.irl.agent import Episode
from replication.learning import qlearning, reference
from replication.learning.seeds import stream
from replication.trials.condition import Condition

Array = NDArray[Any]
Learned = tuple[Array, Array, int, int]
Learner = Callable[..., Learned]

RATES: dict[str, Any] = {"beta": 0.7, "gamma": 0.9, "epsilon": 0.1, "tolerance": 1e-12}
ROUNDS = 5


class Task(ctypes.Structure):
    """The `task` of qlearning.c."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("states", "start", "goal", "episodes", "horizon")),
        *((name, ctypes.c_double) for name in ("beta", "gamma", "tolerance")),
        ("threshold", ctypes.c_uint64),
        ("random_ties", ctypes.c_int64),
    )


@pytest.fixture(scope="module")
def c_learn(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Learner]:
    """Compile qlearning.c and wrap it; there is nothing without a compiler."""
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        return {}
    library = tmp_path_factory.mktemp("c") / "qlearning.so"
    source = Path(__file__).with_name("qlearning.c")
    flags = ["-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, "-o", library, source], check=True)
    function = ctypes.CDLL(str(library)).learn
    function.restype = ctypes.c_int64

    def learn(
        next_state: Array, weights: Array, q: Array, stream: Array, **options: Any
    ) -> Learned:
        q, stream, collisions = q.copy(), stream.copy(), ctypes.c_int64()
        task = Task(
            states=len(next_state),
            threshold=round(options.pop("epsilon") * 2**32),
            random_ties=1,
            **options,
        )
        arrays = [x.ctypes.data_as(ctypes.c_void_p) for x in (next_state, weights, q, stream)]
        steps = function(ctypes.byref(task), *arrays, ctypes.byref(collisions))
        return q, stream, steps, collisions.value

    return {"C": learn}


def reference_learn(*arrays: Array, **options: Any) -> Learned:
    """Learn by the reference."""
    lists = (array.tolist() for array in arrays)
    q, stream, steps, collisions = reference.learn(*lists, **options)
    return np.array(q), np.array(stream, np.uint64), steps, collisions


def python_learn(
    next_state: Array, weights: Array, q: Array, stream: Array, **options: Any
) -> Learned:
    """Learn by a loop on lists that draws ahead and carries the best value along."""
    successors, rewards, table = (x.tolist() for x in (next_state, weights, q))
    beta, gamma, epsilon = options["beta"], options["gamma"], options["epsilon"]
    start, goal, horizon = options["start"], options["goal"], options["horizon"]
    tolerance, actions = options["tolerance"], range(len(table[0]))
    rng, width, steps, collisions = np.random.default_rng(stream), len(table[0]), 0, 0

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
            else:
                least = best - tolerance * abs(best)
                tied = [a for a in actions if row[a] >= least]
                action = tied[0] if len(tied) == 1 else tied[int(number() * len(tied))]
            steps += 1
            successor = successors[state][action]
            if successor == goal:
                row[action] += beta * (rewards[state][action] - row[action])
                break
            after = table[successor]
            best = max(after)
            row[action] += beta * (rewards[state][action] + gamma * best - row[action])
            if successor == state:
                collisions += 1
                best = max(row)
            state, row = successor, after
    return np.array(table), stream, steps, collisions


def show(title: str, speeds: dict[str, list[float]]) -> None:
    """Print the best speed of each learner, and the first one's ratios to the others."""
    first, *others = speeds
    print(f"\n{title:28}", *(f"{name} {max(x):7.4g}" for name, x in speeds.items()), end="  ")
    for name in others:
        ratios = np.array(speeds[first]) / speeds[name]
        print(f"  {ratios.min():.3g}-{ratios.max():.3g} x {name}", end="")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"  peak so far {peak:.0f} MB", end="")


def measure(learners: dict[str, Callable[[], int]]) -> dict[str, list[float]]:
    """Let learners take turns; return the million steps a second of each in each round."""
    speeds: dict[str, list[float]] = {name: [] for name in learners}
    for learner in learners.values():
        learner()  # compiles
    for _ in range(ROUNDS):
        for name, learner in learners.items():
            begin = thread_time()
            speeds[name].append(learner() / (thread_time() - begin) / 1e6)
    return speeds


def open_maze(size: int) -> Array:
    """Return the transitions of an open maze: up, down, right, left."""
    row, column = np.divmod(np.arange(size**2), size)
    moves = ((-1, 0), (1, 0), (0, 1), (0, -1))
    rows = [np.clip(row + down, 0, size - 1) for down, _ in moves]
    columns = [np.clip(column + right, 0, size - 1) for _, right in moves]
    return np.stack(rows, axis=1) * size + np.stack(columns, axis=1)


def make_load(kind: str, size: int) -> tuple[tuple[Array, ...], dict[str, Any]]:
    """Return the arrays and the options of a call in an open maze.

    In a `loop` the weights are random, so that the agent circles until the time is out, as early
    in inverse reinforcement learning; along a `path` to the goal each step is worth 1, and any
    other -1, as late in it.
    """
    next_state, start, goal = open_maze(size), (size - 2) * size + 1, 3 * size + size - 3
    weights = np.random.default_rng(1).normal(size=next_state.shape)
    if kind == "path":
        weights, state, steps = np.full(next_state.shape, -1.0), start, 0
        while state != goal:
            up = state // size > goal // size and steps % 2 == 0
            action = 0 if up or state % size == goal % size else 2
            weights[state, action] = 1.0
            state, steps = int(next_state[state, action]), steps + 1
    options = RATES | {"start": start, "goal": goal, "horizon": 25 * size}
    words = stream(np.random.SeedSequence(3))
    return (next_state, weights, np.zeros_like(weights), words), options


def steps_of(learner: Learner, arrays: tuple[Array, ...], options: dict[str, Any]) -> int:
    """Learn, and return the number of steps."""
    return learner(*arrays, **options)[2]


@pytest.mark.parametrize("size", [10, 20, 50, 100, 200])
@pytest.mark.parametrize("kind", ["loop", "path"])
def test_speed(c_learn: dict[str, Learner], kind: str, size: int) -> None:
    """Learner, C and reference compute the same bits; their speeds are shown, by size of maze."""
    arrays, options = make_load(kind, size)
    learners: dict[str, Learner] = {"ours": qlearning.learn, **c_learn}
    bits = {}
    for name, learner in (learners | {"reference": reference_learn}).items():
        q, after, *counts = learner(*arrays, episodes=50, **options)
        bits[name] = q.tobytes(), after.tobytes(), counts
    assert all(x == bits["reference"] for x in bits.values())
    slow: dict[str, Learner] = {"Python": python_learn, "reference": reference_learn}
    episodes = dict.fromkeys(learners, 20_000) | dict.fromkeys(slow, 50)
    speeds = measure(
        {
            name: partial(steps_of, learner, arrays, options | {"episodes": episodes[name]})
            for name, learner in (learners | (slow if size == 20 else {})).items()
        }
    )
    show(f"{kind} of {size} x {size}, M steps/s", speeds)


@dataclass(frozen=True)
class With:
    """An agent that learns by another function."""

    agent: Any
    learner: Learner

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        return self.agent.shape

    def learn(self, weights: Array, q: Array, stream: Array) -> Learned:
        """Learn in the agent's maze."""
        maze, learner = self.agent.maze, self.agent.learner
        names = "episodes", "horizon", "beta", "gamma", "epsilon"
        options = {name: getattr(learner, name) for name in names}
        options |= {"tolerance": learner.tie_tolerance, "start": maze.start, "goal": maze.goal}
        return self.learner(maze.next_state, weights, q, stream, **options)

    def roll_out(self, q: Array, stream: Array) -> tuple[Episode, Array]:
        """Follow the greedy policy as the agent does."""
        return self.agent.roll_out(q, stream)


def trial_steps(demos: Demos, method: str, learner: Learner) -> int:
    """Run a few whole trials by the paper's defaults; return their steps."""
    condition = Condition(demos, method, Params.of(incorrect="all"))
    condition.__dict__["agent"] = With(condition.agent, learner)
    seeds = np.random.SeedSequence(1).spawn(4)
    return sum(condition.trial(seed=seed).steps for seed in seeds)


@pytest.mark.parametrize("method", ["adaboost", "unified", "unified-incorrect"])
@pytest.mark.parametrize("maze", ["open_maze", "obstacle_maze"])
def test_whole_trials(c_learn: dict[str, Learner], maze: str, method: str) -> None:
    """The speed of whole trials of the paper, everything but the learner being the same."""
    demos = load_demos(PROJECT / "data" / "demos" / f"{maze}.json")
    learners: dict[str, Learner] = {"ours": qlearning.learn, **c_learn}
    speeds = measure(
        {name: partial(trial_steps, demos, method, learner) for name, learner in learners.items()}
    )
    show(f"{method}, {maze}", speeds)
