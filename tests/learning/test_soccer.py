from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from replication import Demos
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.rules import FORWARD, SoccerParams
from replication.files import PROJECT
from replication.learning import reference, soccer
from replication.learning.seeds import stream

SCRIPT = "from tests.learning.test_soccer import learned; print(learned())"

RATES: dict[str, Any] = {
    "beta": 0.6,
    "gamma": 0.9,
    "epsilon_start": 0.3,
    "epsilon_end": 0.05,
}

Expert = tuple[list[tuple[int, int]], NDArray[np.float64], FastSoccerWorld]


@pytest.fixture(scope="module")
def expert(soccer_demos: Demos) -> Expert:
    """Return the expert's pairs, a Q that prefers them, and the world after the last of them."""
    (correct,) = soccer_demos.correct
    pairs = list(zip(correct.states.tolist(), correct.actions.tolist(), strict=False))
    q, world = np.zeros((384, 5)), FastSoccerWorld()
    for state, action in pairs:
        q[state, action] = 1.0
        world.step(action)
    return pairs, q, world


def learn_plainly(
    params: SoccerParams, weights: Any, q: Any, stream: list[int], options: dict[str, Any]
) -> tuple[Any, list[int], int, int]:
    """Learn in the uncompiled world by the definitions of `replication.learning.reference`."""
    world, steps, collisions = FastSoccerWorld(params), 0, 0
    episodes = options["episodes"]
    for epsilon in np.linspace(options["epsilon_start"], options["epsilon_end"], episodes).tolist():
        state, done = world.reset(), False
        while not done:
            word = reference.draw(stream)
            action = reference.choose(
                q[state], word, epsilon, options["random_ties"], options["tolerance"]
            )
            touched = world.contacts
            successor, scored, timed_out = world.step(action)
            collisions += world.contacts != touched
            beyond = options.get("bootstrap_goal", False)
            value = 0.0 if scored and not beyond else max(q[successor])
            target = weights[state][action] + options["gamma"] * value
            q[state][action] += options["beta"] * (target - q[state][action])
            state, done, steps = successor, scored or timed_out, steps + 1
    return q, stream, steps, collisions


def tables(seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint64]]:
    """Weights that lead to the goal and back, values with ties, and a stream."""
    rng = np.random.default_rng(seed)
    q = rng.integers(0, 3, (384, 5)).astype(float)
    return rng.normal(size=(384, 5)), q, stream(np.random.SeedSequence(seed))


@pytest.mark.parametrize("tolerance", [0.0, 0.1])
@pytest.mark.parametrize("random_ties", [True, False])
@pytest.mark.parametrize("macro", ["cell", "decision"])
@pytest.mark.parametrize("bootstrap_goal", [True, False])
def test_learning_is_the_reference(
    tolerance: float, random_ties: bool, macro: str, bootstrap_goal: bool
) -> None:
    """Learning returns the bits of the plain loop: Q, the stream, decisions and collisions."""
    params = SoccerParams(time_limit=40.0, macro=macro)
    options = RATES | {"episodes": 12, "tolerance": tolerance, "random_ties": random_ties}
    options["bootstrap_goal"] = bootstrap_goal
    weights, q, stream = tables(6)
    weights[:, FORWARD] += 1.0  # so that some episodes end with a goal
    got = soccer.learn(params, weights, q, stream, **options)
    wanted = learn_plainly(params, weights.tolist(), q.tolist(), stream.tolist(), options)
    assert got[0].tolist() == wanted[0]
    assert got[1].tolist() == wanted[1]
    assert got[2:] == wanted[2:]
    assert 0 < got[3] < got[2]
    assert (q == tables(6)[1]).all()


def learned() -> str:
    """Return the bits of a short learning call, as text."""
    q, words, *counts = soccer.learn(
        SoccerParams(time_limit=100.0), *tables(3), episodes=8, **RATES
    )
    return f"{q.tobytes().hex()} {words} {counts}"


def test_new_process_same_bits() -> None:
    """Another process, with another hash seed, learns the same bits."""
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env=os.environ | {"PYTHONHASHSEED": "42"},
        cwd=PROJECT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == learned()


def test_what_is_compiled_notices_a_change_elsewhere(tmp_path: Path) -> None:
    """Code that is kept compiled is used again, but not after a change of what it calls."""
    package = Path(shutil.copytree(PROJECT / "replication", tmp_path / "replication"))

    def run() -> str:
        script = SCRIPT.replace("tests.learning.test_soccer", "soccer_bits")
        done = subprocess.run(
            [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    def kept() -> int:
        return len(list((package / "learning" / "__pycache__").glob("soccer._compile.*learn*.nbc")))

    (tmp_path / "soccer_bits.py").write_text(Path(__file__).read_text("utf-8"), "utf-8")
    assert run() == learned()
    before = kept()
    assert run() == learned()
    assert before == kept() > 0
    changed = package / "learning" / "compiled.py"
    text = changed.read_text("utf-8")
    assert text.count("seen <= number") == 1
    changed.write_text(text.replace("seen <= number", "seen < number"), "utf-8")
    assert run() != learned()


def test_goal_and_time_out_in_the_target(expert: Expert) -> None:
    """A goal is worth nothing afterwards; a time-out is not terminal, so its target bootstraps."""
    pairs, q, world = expert
    stream = np.arange(1, 5, dtype=np.uint64)
    rates: dict[str, Any] = {"beta": 1.0, "gamma": 0.5, "epsilon_start": 0.0, "epsilon_end": 0.0}
    zero = np.zeros((384, 5))
    got, _, n, _ = soccer.learn(SoccerParams(), zero, q, stream, episodes=1, **rates)
    assert (n, got[pairs[-1]]) == (15, 0.0)
    short = SoccerParams(time_limit=world.time - 0.3)  # before the last decision
    got, _, n, _ = soccer.learn(short, zero, q, stream, episodes=1, **rates)
    assert (n, got[pairs[-2]]) == (14, 0.5)


def test_roll_out_of_the_expert(expert: Expert) -> None:
    """The greedy policy of a Q that prefers the expert's actions repeats its episode, hitless."""
    pairs, q, world = expert
    words = stream(np.random.SeedSequence(7))
    states, actions, hits, after = soccer.roll_out(SoccerParams(), q, words)
    assert list(zip(states[:-1].tolist(), actions.tolist(), strict=True)) == pairs
    assert states[-1] == world.state
    assert hits.tolist() == [False] * len(pairs)
    words = words.tolist()
    for _ in pairs:
        reference.draw(words)
    assert after.tolist() == words


@pytest.mark.parametrize("random_ties", [True, False])
@pytest.mark.parametrize("tolerance", [0.0, 0.1])
def test_roll_out_is_the_reference(tolerance: float, random_ties: bool) -> None:
    """A greedy episode takes the reference's choices, and hits where the world has a contact."""
    params = SoccerParams(time_limit=60.0)
    _, q, words = tables(5)
    q += np.random.default_rng(2).choice([0.0, 0.05], q.shape)  # ties within the tolerance only
    states, actions, hits, after = soccer.roll_out(params, q, words, tolerance, random_ties)
    world, draws, expected = FastSoccerWorld(params), words.tolist(), []
    state, done = world.reset(), False
    while not done:
        word = reference.draw(draws)
        action = reference.choose(q[state].tolist(), word, 0.0, random_ties, tolerance)
        touched = world.contacts
        state, scored, timed_out = world.step(action)
        expected.append((action, state, world.contacts != touched))
        done = scored or timed_out
    taken = zip(actions.tolist(), states[1:].tolist(), hits.tolist(), strict=True)
    assert list(taken) == expected
    assert after.tolist() == draws


def test_epsilon_goes_from_its_start_to_its_end() -> None:
    """It falls over the episodes: the first explores by the start value, the last by the end."""
    params, (weights, q, words) = SoccerParams(time_limit=10.0), tables(4)
    fixed: dict[str, Any] = {"beta": 0.6, "gamma": 0.9}

    def run(episodes: int, start: float, end: float) -> Any:
        options = fixed | {"epsilon_start": start, "epsilon_end": end, "episodes": episodes}
        return soccer.learn(params, weights, q, words, **options)

    falling = run(2, 1.0, 0.0)
    first = run(1, 1.0, 1.0)
    options = fixed | {"epsilon_start": 0.0, "epsilon_end": 0.0, "episodes": 1}
    then = soccer.learn(params, weights, first[0], first[1], **options)
    assert falling[0].tolist() == then[0].tolist()
    assert falling[1].tolist() == then[1].tolist()
    assert falling[2:] == (first[2] + then[2], first[3] + then[3])
    assert falling[0].tolist() != run(2, 0.0, 1.0)[0].tolist()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weights": np.zeros((3, 5))}, "weights"),
        ({"q": np.full((384, 5), np.nan)}, "q must"),
        ({"stream": np.zeros(4, np.uint64)}, "stream"),
        ({"episodes": 0}, "episodes"),
        ({"gamma": 1.5}, "gamma"),
        ({"tolerance": 1.0}, "tolerance"),
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
        **RATES,
    }
    with pytest.raises(ValueError, match=message):
        soccer.learn(SoccerParams(), **(arguments | change))
