"""The speed of learning in other tasks, on one core: tables with chance, stepped environments.

A stepped learner stands beside the bare loop over `env.step` that takes the same actions, and
beside that loop with the function that gives states. Loops take turns, so that what else the
machine does hits all of them alike; shown are the medians and the ratios in the least and the most
favourable round. Run as ``make bench``.
"""

from collections.abc import Callable
from functools import partial
from time import thread_time
from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.bench_qlearning import ROUNDS, make_load, measure, show
from replication.envs.gym import MazeEnv
from replication.envs.tasks.moves import Moves
from replication.learning import chance, qlearning, stepped
from replication.learning.seeds import stream

Array = NDArray[Any]

RATES: dict[str, Any] = {"beta": 0.7, "gamma": 0.9, "epsilon": 0.1, "tolerance": 1e-12}
EPISODES, HORIZON, ITERATIONS = 2000, 500, 40  # the paper's


def open_field(size: int, n_actions: int) -> Array:
    """Return the transitions of an open maze where one may move diagonally, too."""
    row, column = np.divmod(np.arange(size**2), size)
    ways = ((-1, 0), (1, 0), (0, 1), (0, -1), (-1, -1), (-1, 1), (1, -1), (1, 1))[:n_actions]
    rows = [np.clip(row + down, 0, size - 1) for down, _ in ways]
    columns = [np.clip(column + right, 0, size - 1) for _, right in ways]
    return np.stack(rows, axis=1) * size + np.stack(columns, axis=1)


def slippery(next_state: Array, slip: float, start: int, goal: int | None = None) -> Moves:
    """Return the moves of a table where, with probability `slip`, the next action is taken."""
    state, action = (x.ravel() for x in np.indices(next_state.shape))
    slipped = next_state[state, (action + 1) % next_state.shape[1]]
    pairs, states = len(state), np.arange(len(next_state))
    return Moves.of(
        (
            np.tile(state, 2),
            np.tile(action, 2),
            np.concatenate([next_state.ravel(), slipped]),
            np.repeat([1 - slip, slip], pairs),
        ),
        shape=next_state.shape,
        starts=states == start,
        ends=np.zeros(len(states), bool) if goal is None else states == goal,
    )


@pytest.mark.parametrize("slip", [0.0, 0.2])
@pytest.mark.parametrize(("size", "n_actions"), [(20, 4), (20, 8), (100, 8)])
def test_the_papers_episodes(size: int, n_actions: int, slip: float) -> None:
    """With 40 iterations of 2000 episodes of 500 steps, a trial takes less than a minute."""
    moves = slippery(open_field(size, n_actions), slip, (size - 2) * size + 1)
    weights, q = np.random.default_rng(1).normal(size=moves.shape), np.zeros(moves.shape)
    words, options = stream(np.random.SeedSequence(3)), RATES | {"horizon": HORIZON}
    chance.learn(moves, weights, q, words, episodes=1, **options)  # compiles
    begin, total = thread_time(), 0
    for _ in range(ITERATIONS):
        q, words, steps, _ = chance.learn(moves, weights, q, words, episodes=EPISODES, **options)
        total += steps
    seconds = thread_time() - begin
    print(
        f"\n{len(q)} states, {n_actions} actions, slip {slip}: {total / 1e6:.0f} M steps in "
        f"{seconds:.2f} s, {total / seconds / 1e6:.3g} M steps/s"
    )
    assert total == ITERATIONS * EPISODES * HORIZON
    assert seconds < 60


@pytest.mark.parametrize("kind", ["loop", "path"])
def test_a_table_of_400_states_beside_the_mazes(kind: str) -> None:
    """Without chance a table learns as fast as a maze, and with it more slowly."""
    (next_state, *tables), options = make_load(kind, 20)
    start, goal = options.pop("start"), options.pop("goal")
    certain, chancy = (slippery(next_state, slip, start, goal) for slip in (0.0, 0.1))
    options["episodes"] = 20_000
    maze = partial(qlearning.learn, start=start, goal=goal)
    speeds = measure(
        {
            "table": lambda: chance.learn(certain, *tables, **options)[2],
            "maze": lambda: maze(next_state, *tables, **options)[2],
            "chance": lambda: chance.learn(chancy, *tables, **options)[2],
        }
    )
    show(f"{kind}, 400 states, M steps/s", speeds)


class Recorder:
    """Steps an environment and keeps the seeds and the actions of its episodes."""

    def __init__(self, env: Any) -> None:
        self.env, self.episodes = env, list[tuple[Any, list[int]]]()

    def reset(self, seed: int | None) -> Any:
        """Begin an episode."""
        self.episodes.append((seed, []))
        return self.env.reset(seed=seed)

    def step(self, action: int) -> Any:
        """Take an action."""
        self.episodes[-1][1].append(action)
        return self.env.step(action)


def bins(observation: Any) -> int:
    """Return the state of a car in the valley: 20 x 20 bins of position and speed."""
    position, speed = observation
    return min(int((position + 1.2) / 0.09), 19) * 20 + min(int((speed + 0.07) / 0.007), 19)


@pytest.mark.parametrize(
    ("name", "make", "state_of", "n_states"),
    [
        ("MazeEnv without wrappers", MazeEnv, int, 25),
        ("FrozenLake", lambda: gymnasium.make("FrozenLake-v1", is_slippery=False), int, 16),
        ("FrozenLake, slippery", lambda: gymnasium.make("FrozenLake-v1"), int, 16),
        ("CliffWalking", lambda: gymnasium.make("CliffWalking-v1"), int, 48),
        ("Taxi", lambda: gymnasium.make("Taxi-v4"), int, 500),
        ("MountainCar, 400 bins", lambda: gymnasium.make("MountainCar-v0"), bins, 400),
    ],
)
def test_a_stepped_environment_beside_its_own_steps(
    name: str, make: Callable[[], Any], state_of: Callable[[Any], int], n_states: int
) -> None:
    """What learning costs beside stepping alone; shown, since it depends on the environment."""
    env = make()
    shape = n_states, int(env.action_space.n)
    weights, q = np.random.default_rng(1).normal(size=shape), np.zeros(shape)
    words, options = stream(np.random.SeedSequence(3)), RATES | {"horizon": 200, "episodes": 100}
    recorder = Recorder(env)
    steps = stepped.learn(recorder, state_of, weights, q, words, **options)[2]

    def bare() -> None:
        for seed, actions in recorder.episodes:
            env.reset(seed=seed)
            for action in actions:
                env.step(action)

    def mapped() -> None:
        for seed, actions in recorder.episodes:
            env.reset(seed=seed)
            for action in actions:
                state_of(env.step(action)[0])

    def learning() -> None:
        stepped.learn(env, state_of, weights, q, words, **options)

    times = np.empty((ROUNDS, 3))
    for i in range(ROUNDS):
        for j, loop in enumerate((bare, mapped, learning)):
            begin = thread_time()
            loop()
            times[i, j] = (thread_time() - begin) / steps * 1e6
    middle = np.median(times, axis=0)
    ratios = times[:, 2:] / times[:, :2]
    print(
        f"\n{name:25} {steps} steps, µs/step: bare {middle[0]:.2f}, with states {middle[1]:.2f}, "
        f"learning {middle[2]:.2f}: {ratios[:, 0].min():.2f}-{ratios[:, 0].max():.2f} x bare, "
        f"{ratios[:, 1].min():.2f}-{ratios[:, 1].max():.2f} x with states"
    )
