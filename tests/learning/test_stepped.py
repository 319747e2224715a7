from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from replication.envs.gym import MazeEnv
from replication.learning import qlearning, reference, stepped
from replication.learning.seeds import stream
from replication.source import source_hash

Array = NDArray[Any]
RATES: dict[str, Any] = {"beta": 0.7, "gamma": 0.9, "epsilon": 0.1}
MAZE = ("....G", ".##..", ".....", "..##.", "S....")


def make_stream(seed: int) -> Array:
    """Return a random stream."""
    return stream(np.random.SeedSequence(seed))


def after_seed(words: Array) -> Array:
    """Return the stream after the draw that seeds the environment."""
    drawn = words.tolist()
    reference.draw(drawn)
    return np.array(drawn, np.uint64)


def tables(shape: tuple[int, int], seed: int) -> tuple[Array, Array]:
    """Return random rewards, and values with ties."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=shape), rng.integers(0, 3, shape).astype(float)


@pytest.mark.parametrize("tolerance", [0.0, 0.5])
@pytest.mark.parametrize("random_ties", [True, False])
@pytest.mark.parametrize("horizon", [1, 7, 60])
def test_stepping_a_maze_is_the_learner_of_mazes(
    tolerance: float, random_ties: bool, horizon: int
) -> None:
    """After the draw of the seed, Q, stream, steps and collisions are those of the table."""
    env = MazeEnv(MAZE)
    maze, words = env.maze, make_stream(1)
    weights, q = tables(maze.next_state.shape, 2)
    task: dict[str, Any] = {"horizon": horizon, "tolerance": tolerance, "random_ties": random_ties}
    ways: dict[str, Any] = {"start": maze.start, "goal": maze.goal}
    got = stepped.learn(env, int, weights, q, words, episodes=30, **RATES, **task)
    wanted = qlearning.learn(
        maze.next_state, weights, q, after_seed(words), episodes=30, **ways, **RATES, **task
    )
    assert got[0].tobytes() == wanted[0].tobytes()
    assert got[1].tolist() == wanted[1].tolist()
    assert got[2:] == wanted[2:]
    assert 0 < got[3] < got[2]
    path = stepped.roll_out(env, int, wanted[0], words, **task)
    same = qlearning.roll_out(maze.next_state, wanted[0], after_seed(words), **ways, **task)
    assert all(a.tolist() == b.tolist() for a, b in zip(path, same, strict=True))
    assert path[0].dtype == path[1].dtype == np.int64


def learn_plainly(
    env: Any, state_of: Any, weights: Any, q: Any, words: list[int], options: dict[str, Any]
) -> tuple[Any, list[int], int, int]:
    """Learn by stepping, by the definitions of `replication.learning.reference`."""
    steps, collisions = 0, 0
    seed: int | None = reference.draw(words) >> 33
    for _ in range(options["episodes"]):
        state, seed = state_of(env.reset(seed=seed)[0]), None
        for _ in range(options["horizon"]):
            action = reference.choose(q[state], reference.draw(words), options["epsilon"], True)
            observation, _, terminated, truncated, _ = env.step(action)
            successor = state_of(observation)
            value = 0.0 if terminated else max(q[successor])
            q[state][action] = reference.double(
                q[state][action],
                weights[state][action],
                value,
                options["beta"],
                options["gamma"],
            )
            steps, collisions = steps + 1, collisions + (successor == state)
            state = successor
            if terminated or truncated:
                break
    return q, words, steps, collisions


def bins(observation: Any) -> int:
    """Return the state of a car in the valley: 10 x 8 bins of position and speed."""
    position, speed = observation.tolist()
    return min(int((position + 1.2) / 0.18), 9) * 8 + min(int((speed + 0.07) / 0.0175), 7)


@pytest.mark.parametrize(
    ("name", "state_of", "shape"),
    [
        ("FrozenLake-v1", int, (16, 4)),
        ("CliffWalking-v1", int, (48, 4)),
        ("Taxi-v4", int, (500, 6)),
        ("MountainCar-v0", bins, (80, 3)),
    ],
)
def test_learning_is_the_reference(name: str, state_of: Any, shape: tuple[int, int]) -> None:
    """In environments that nobody here wrote, learning has the bits of the plain loop."""
    env, words = gymnasium.make(name), make_stream(4)
    weights, q = tables(shape, 5)
    options = RATES | {"episodes": 12, "horizon": 230}
    got = stepped.learn(env, state_of, weights, q, words, **options)
    wanted = learn_plainly(env, state_of, weights.tolist(), q.tolist(), words.tolist(), options)
    assert got[0].tolist() == wanted[0]
    assert got[1].tolist() == wanted[1]
    assert got[2:] == wanted[2:]


def test_more_actions_than_are_unrolled() -> None:
    """An environment may have any number of actions."""
    env = gymnasium.make("Blackjack-v1")
    wide: Any = gymnasium.wrappers.TransformAction(
        env, lambda action: action % 2, gymnasium.spaces.Discrete(40)
    )
    weights, q = tables((32, 40), 6)
    options = RATES | {"episodes": 50, "horizon": 20}

    def state_of(observation: Any) -> int:
        return int(observation[0])

    got = stepped.learn(wide, state_of, weights, q, make_stream(7), **options)
    lists = weights.tolist(), q.tolist(), make_stream(7).tolist()
    wanted = learn_plainly(wide, state_of, *lists, options)
    assert got[0].tolist() == wanted[0]
    assert got[2:] == wanted[2:]


class Script(gymnasium.Env[int, int]):
    """A chain of states that ends as told, and keeps what it was asked."""

    def __init__(self, *, terminated: bool = False, truncated: bool = False) -> None:
        self.end, self.seeds, self.state = (terminated, truncated), list[Any](), 0

    def reset(self, *, seed: Any = None, options: Any = None) -> tuple[int, dict[str, Any]]:
        """Go back to state 0."""
        self.seeds.append(seed)
        self.state = 0
        return 0, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Move on; the episode may end in state 2."""
        self.state += 1
        ends = self.state == 2
        return self.state, 99.0, ends and self.end[0], ends and self.end[1], {}


@pytest.mark.parametrize(
    ("ending", "horizon", "last"),
    [
        ({"terminated": True}, 9, 1.0),
        ({"truncated": True}, 9, 6.0),
        ({"terminated": True, "truncated": True}, 9, 1.0),
        ({}, 2, 6.0),
    ],
)
def test_only_termination_is_terminal(ending: dict[str, bool], horizon: int, last: float) -> None:
    """Time-outs, the environment's own and the horizon's, bootstrap; an end is worth 0."""
    env, ones = Script(**ending), np.ones((3, 1))
    rates: dict[str, Any] = {"beta": 1.0, "gamma": 0.5, "epsilon": 0.0}
    q, _, steps, _ = stepped.learn(
        *(env, int, ones, [[0.0], [0.0], [10.0]], make_stream(1)),
        episodes=1,
        horizon=horizon,
        **rates,
    )
    assert q.tolist() == [[1.0], [last], [10.0]]
    assert steps == 2
    states, actions, _ = stepped.roll_out(env, int, ones, make_stream(1), horizon=horizon)
    assert (states.tolist(), actions.tolist()) == ([0, 1, 2], [0, 0])


def test_the_environment_is_seeded_once_a_call() -> None:
    """The first reset has 31 bits of the first draw as its seed, and the others have none."""
    env, ones, words = Script(terminated=True), np.ones((3, 1)), make_stream(8)
    stepped.learn(env, int, ones, ones, words, episodes=3, horizon=9, **RATES)
    stepped.roll_out(env, int, ones, words, horizon=9)
    seed = reference.draw(words.tolist()) >> 33
    assert env.seeds == [seed, None, None, seed]
    assert type(seed) is int


def test_what_is_compiled_is_kept_and_notices_a_change_elsewhere() -> None:
    """A step closes over the hash of what it calls, and over nothing that is never the same."""
    plain = stepped._advance.py_func
    assert plain.__code__.co_freevars == ("code",)
    assert plain.__closure__[0].cell_contents == source_hash("replication.learning.compiled")


def test_inputs_are_not_modified() -> None:
    """Neither learning nor a roll-out changes its arguments."""
    env = MazeEnv(MAZE)
    weights, q = tables(env.maze.next_state.shape, 2)
    words = make_stream(1)
    before = weights.copy(), q.copy(), words.copy()
    stepped.learn(env, int, weights, q, words, episodes=3, horizon=9, **RATES)
    stepped.roll_out(env, int, q, words, horizon=9)
    after = weights, q, words
    assert all((a == b).all() for a, b in zip(before, after, strict=True))


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"state_of": lambda _: 3}, ValueError, "a state that q does not have"),
        ({"state_of": lambda _: -1}, ValueError, "a state that q does not have"),
        ({"state_of": lambda o: 3 if o else 0}, ValueError, "a state that q does not have"),
        ({"state_of": float}, TypeError, "cannot be interpreted as an integer"),
        ({"weights": np.ones((2, 1))}, ValueError, "weights must have the shape"),
        ({"q": np.ones(3)}, ValueError, "q must have the shape"),
        ({"q": np.ones((3, 0))}, ValueError, "q must have the shape"),
        ({"q": np.full((3, 1), np.inf)}, ValueError, "q must be finite"),
        ({"stream": np.ones(4)}, ValueError, "stream must be uint64"),
        ({"episodes": 0}, ValueError, "episodes must be an integer from 1"),
        ({"horizon": 0}, ValueError, "horizon must be an integer from 1"),
        ({"beta": 1.5}, ValueError, "beta must be in"),
        ({"gamma": -0.1}, ValueError, "gamma must be in"),
        ({"epsilon": np.nan}, ValueError, "epsilon must be in"),
        ({"tolerance": 1}, ValueError, "tolerance must be at least 0 and less than 1"),
    ],
)
def test_what_does_not_fit_is_refused(
    change: dict[str, Any], error: type[Exception], message: str
) -> None:
    """A shape or value that does not fit raises an error that names it."""
    task: dict[str, Any] = {
        "env": Script(terminated=True),
        "state_of": int,
        "weights": np.ones((3, 1)),
        "q": np.ones((3, 1)),
        "stream": make_stream(1),
        "horizon": 9,
    }
    with pytest.raises(error, match=message):
        stepped.learn(**task | {"episodes": 1} | RATES | change)
    del task["weights"]
    if change.keys() <= task.keys():
        with pytest.raises(error, match=message):
            stepped.roll_out(**task | change)
