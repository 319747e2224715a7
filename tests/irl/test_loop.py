from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from replication import Demos
from replication.irl import Trial, get_method, run_trial
from replication.irl.agent import Agent, Episode
from replication.irl.expectations import (
    feature_expectations,
    mean_expectations,
    norm,
    visited,
)
from replication.learning import reference
from replication.paper.params import Params
from replication.trials.agents import make_agent
from replication.trials.condition import Condition

Array = NDArray[np.float64]
Words = NDArray[np.uint64]
GAMMA = 0.9
NEXT = np.array([[1, 0], [2, 0], [3, 1], [4, 2], [4, 4]])  # a corridor of five: right, left
EXPERT = np.array([0, 1, 2, 3, 4]), np.array([0, 0, 0, 0])


@dataclass
class Corridor:
    """Five cells in a row, solved exactly; it notes what each call begins from."""

    shape: tuple[int, int] = (5, 2)
    begun: list[Array] = field(default_factory=list)

    def learn(
        self, weights: Array, q: Array, stream: NDArray[np.uint64]
    ) -> tuple[Array, NDArray[np.uint64], int, int]:
        """Solve the corridor by value iteration; say that it took 7 steps, and ever more hits."""
        self.begun.append(q)
        value = np.zeros(5)
        for _ in range(200):
            q = weights + GAMMA * value[NEXT]
            value = q.max(axis=1)
            value[4] = 0.0
        return q, stream + np.uint64(1), 7, 10 + len(self.begun)

    def roll_out(self, q: Array, stream: NDArray[np.uint64]) -> tuple[Episode, NDArray[np.uint64]]:
        """Follow the greedy policy for at most 30 steps."""
        states, actions = [0], list[int]()
        while states[-1] != 4 and len(actions) < 30:
            actions.append(int(np.argmax(q[states[-1], ::-1]) == 0))  # ties go left
            states.append(int(NEXT[states[-1], actions[-1]]))
        visited = np.array(states)
        return Episode(visited, np.array(actions), visited[1:] == visited[:-1]), stream


def _mu_e() -> Array:
    return feature_expectations(*EXPERT, gamma=GAMMA, shape=(5, 2))


def _trial(
    method: str = "unified",
    *,
    agent: Corridor | None = None,
    mu_e: Array | None = None,
    keep: bool = False,
    **choices: Any,
) -> Trial:
    return run_trial(
        agent or Corridor(),
        get_method(method),
        _mu_e() if mu_e is None else mu_e,
        np.zeros((5, 2), dtype=bool),
        Params.of(**choices),
        seed=np.random.SeedSequence(1),
        keep=keep,
    )


@pytest.mark.parametrize("method", ["unified", "unified-incorrect", "adaboost"])
def test_every_method_learns_the_right_ordering(method: str) -> None:
    """In a corridor that the expert walks to the end, each method does so too, with d exactly 0."""
    trial = _trial(method)
    assert trial.converged
    assert trial.errors[-1] == 0
    np.testing.assert_array_equal(trial.episodes[-1].states, EXPERT[0])
    assert (trial.q[:4, 0] > trial.q[:4, 1]).all()


def test_iterations_count_weight_updates() -> None:
    """ITERATION-COUNT: one error for each trajectory, one learning call for each iteration."""
    trial = _trial()
    assert trial.iterations == len(trial.errors) - 1 > 0
    assert trial.steps == 7 * trial.iterations
    assert trial.collisions.tolist() == [11 + i for i in range(trial.iterations)]


@pytest.mark.parametrize("method", ["unified", "unified-incorrect", "adaboost"])
@pytest.mark.parametrize("cap", [1, 500])
def test_errors_follow_from_the_episodes(method: str, cap: int) -> None:
    """Eq. 6: there are iterations + 1 episodes, and d of each has the bits of its error."""
    trial = _trial(method, max_iterations=cap)
    assert len(trial.episodes) == len(trial.errors) == trial.iterations + 1
    for (states, actions, _), error in zip(trial.episodes, trial.errors, strict=True):
        mu_i = feature_expectations(states, actions, gamma=GAMMA, shape=(5, 2))
        assert np.linalg.norm(_mu_e() - mu_i) == error


@pytest.mark.parametrize("cap", [1, 9])
def test_records_have_a_row_for_each_state_of_the_trial(small_demos: Demos, cap: int) -> None:
    """Row i of values and rewards: max_a Q and max_a w after i updates where the expert acts."""
    condition = Condition(
        small_demos,
        "unified",
        Params.of(episodes=60, horizon=40, max_iterations=cap, w_start="uniform-0.001"),
    )
    trial = condition.trial(seed=np.random.SeedSequence(1), keep=True)
    assert trial.snapshots is not None
    path = sorted(small_demos.correct[0].states[:-1].tolist())
    assert path != small_demos.correct[0].states[:-1].tolist()
    for found, tables in (
        (trial.values, trial.snapshots.q),
        (trial.rewards, trial.snapshots.weights),
    ):
        due = tables.max(axis=2)[:, path].astype(np.float32)
        assert found.dtype == np.float32
        assert found.shape == (trial.iterations + 1, len(path))
        assert due[1:].any()
        np.testing.assert_array_equal(found, due)
    assert trial.collisions.dtype == np.int64
    assert trial.collisions.shape == (trial.iterations,)


def test_first_error_is_that_of_the_first_trajectory() -> None:
    """Eq. 6 by hand: the first agent bumps into the left end 30 times."""
    mu_i = np.zeros((5, 2))
    mu_i[0, 1] = sum(GAMMA**t for t in range(30))
    assert _trial().errors[0] == pytest.approx(np.linalg.norm(_mu_e() - mu_i))


def test_cap_ends_a_trial_and_marks_it() -> None:
    """A trial that reaches the cap says that it did not converge."""
    trial = _trial(max_iterations=1)
    assert not trial.converged
    assert trial.iterations == 1


def test_larger_threshold_stops_earlier() -> None:
    """Every error but the last is above the threshold, and the last is not."""
    trial = _trial(threshold=0.5)
    assert (trial.errors[:-1] > 0.5).all()
    assert trial.errors[-1] <= 0.5


def test_an_error_that_is_the_threshold_is_small_enough() -> None:
    """Converged means at most the threshold: with d_0 exactly 0.5 nothing is learned."""
    episode, _ = Corridor().roll_out(np.zeros((5, 2)), np.zeros(4, np.uint64))
    mu_e = feature_expectations(episode.states, episode.actions, gamma=GAMMA, shape=(5, 2))
    mu_e[4, 0] = 0.5
    trial = _trial(mu_e=mu_e, threshold=0.5)
    assert (trial.errors.tolist(), trial.converged) == ([0.5], True)


def test_snapshots_begin_before_and_end_after_learning() -> None:
    """Entry i of the snapshots is the state after i updates; they change nothing else."""
    plain, trial = _trial(), _trial(keep=True)
    assert trial.snapshots is not None
    assert len(trial.snapshots.weights) == trial.iterations + 1
    assert not trial.snapshots.weights[0].any()
    np.testing.assert_array_equal(trial.snapshots.weights[-1], trial.weights)
    np.testing.assert_array_equal(trial.snapshots.q[-1], trial.q)
    assert len(trial.snapshots.q) == len(trial.episodes)
    assert plain.snapshots is None
    np.testing.assert_array_equal(plain.values, trial.values)
    np.testing.assert_array_equal(plain.errors, trial.errors)


def test_weights_are_the_sum_of_the_updates() -> None:
    """Eq. 9 along a whole trial: the snapshots' weights follow from the trajectories."""
    trial = _trial(keep=True, f_start=0.5, alpha=0.3)
    assert trial.snapshots is not None
    f, w = np.full((5, 2), 0.5), np.zeros((5, 2))
    for i in range(trial.iterations):
        states, actions, _ = trial.episodes[i]
        mu_i = feature_expectations(states, actions, gamma=GAMMA, shape=(5, 2))
        residual = _mu_e() - mu_i
        w = w + f * residual
        f = f + 0.3 * ((residual != 0) - f)
        np.testing.assert_array_equal(trial.snapshots.weights[i + 1], w)


# --- a whole trial, call by call -------------------------------------------------------------


@dataclass
class Recorder:
    """An agent that notes what each call is given and returns."""

    agent: Agent
    calls: list[tuple[str, dict[str, Any]]] = field(default_factory=list)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        return self.agent.shape

    def learn(self, weights: Array, q: Array, stream: Words) -> tuple[Array, Words, int, int]:
        """Learn as the agent does."""
        given = {"weights": weights.copy(), "q": q.copy(), "from": stream.tolist()}
        values, after, *counts = self.agent.learn(weights, q, stream)
        learned = {"learned": values.copy(), "to": after.tolist(), "counts": counts}
        self.calls.append(("learn", given | learned))
        return values, after, counts[0], counts[1]

    def roll_out(self, q: Array, stream: Words) -> tuple[Episode, Words]:
        """Roll out as the agent does."""
        given = {"q": q.copy(), "from": stream.tolist()}
        episode, after = self.agent.roll_out(q, stream)
        counts = [len(episode.actions)]
        self.calls.append(("roll", given | {"to": after.tolist(), "counts": counts}))
        return episode, after


def recorded(demos: Demos, *, seed: int = 1, **choices: Any) -> tuple[Trial, Recorder, Array]:
    """Run a trial in a maze; return its record and the expert's expectations, too."""
    params = Params.of(**{"episodes": 20, "horizon": 30, "max_iterations": 6, **choices})
    agent = Recorder(make_agent(demos.environment, params))
    mu_e = mean_expectations(demos.correct, gamma=params.learner.gamma, shape=agent.shape)
    mu_b = visited(demos.incorrect, shape=agent.shape)
    method = get_method("unified-incorrect")
    trial = run_trial(
        agent, method, mu_e, mu_b, params, seed=np.random.SeedSequence(seed), keep=True
    )
    return trial, agent, mu_e


def words_between(start: list[int], end: list[int], draws: int) -> list[int]:
    """Return the words that a stream gives from one state to another, so many draws later."""
    words, stream = [], start[:]
    for _ in range(draws):
        words.append(reference.draw(stream))
    assert stream == end
    return words


@pytest.mark.parametrize("q_start", ["kept", "reset"])
def test_no_random_word_is_used_twice(small_demos: Demos, q_start: str) -> None:
    """Learning and trajectories draw from a stream each, from end to end; no word comes again."""
    used: list[int] = []
    for seed in (1, 2):
        trial, agent, _ = recorded(small_demos, q_start=q_start, seed=seed)
        assert trial.iterations >= 2
        for kind in ("learn", "roll"):
            calls = [call for name, call in agent.calls if name == kind]
            for before, after in pairwise(calls):
                assert after["from"] == before["to"]
            for call in calls:
                used += words_between(call["from"], call["to"], call["counts"][0])
    assert len(used) > 2000
    assert len(set(used)) == len(used)


@pytest.mark.parametrize("q_start", ["kept", "reset"])
def test_each_iteration_looks_first_and_updates_then(small_demos: Demos, q_start: str) -> None:
    """A trajectory of Q, its error, one update, learning; from the last Q or from zero; again."""
    trial, agent, mu_e = recorded(small_demos, q_start=q_start)
    assert trial.snapshots is not None
    assert [name for name, _ in agent.calls] == ["roll", "learn"] * 6 + ["roll"]
    rolls = [call for name, call in agent.calls if name == "roll"]
    learns = [call for name, call in agent.calls if name == "learn"]
    assert not rolls[0]["q"].any()
    for i, call in enumerate(rolls):
        np.testing.assert_array_equal(call["q"], trial.snapshots.q[i])
        episode = trial.episodes[i]
        mu_i = feature_expectations(episode.states, episode.actions, gamma=GAMMA, shape=agent.shape)
        assert trial.errors[i] == norm(mu_e - mu_i)
    for i, call in enumerate(learns):
        np.testing.assert_array_equal(call["weights"], trial.snapshots.weights[i + 1])
        np.testing.assert_array_equal(call["learned"], trial.snapshots.q[i + 1])
        begins = trial.snapshots.q[i] if q_start == "kept" else np.zeros(agent.shape)
        np.testing.assert_array_equal(call["q"], begins)
    assert learns[1]["q"].any() == (q_start == "kept")
    assert trial.steps == sum(call["counts"][0] for call in learns)
    assert trial.collisions.tolist() == [call["counts"][1] for call in learns]
    assert 0 < trial.collisions.sum() < trial.steps


def test_incorrect_pairs_reach_only_the_method_that_uses_them() -> None:
    """With all pairs marked, the method without incorrect demonstrations does as with none."""

    def run(name: str, marked: bool) -> Trial:
        mu_b = np.full((5, 2), marked)
        seed = np.random.SeedSequence(1)
        params = Params.of(f_index="updated")
        return run_trial(Corridor(), get_method(name), _mu_e(), mu_b, params, seed=seed)

    for name, same in (("unified", True), ("adaboost", True), ("unified-incorrect", False)):
        none, every = run(name, False), run(name, True)
        assert np.array_equal(none.weights, every.weights) == same


# --- other choices of the loop ---------------------------------------------------------------


def test_unit_norm_normalises_every_update() -> None:
    """W-NORM unit keeps the norm of the weights at 1, as Eq. 4 assumes."""
    trial = _trial(keep=True, w_norm="unit")
    assert trial.snapshots is not None
    norms = np.linalg.norm(trial.snapshots.weights[1:], axis=(1, 2))
    np.testing.assert_allclose(norms, 1.0)


def test_random_start_weights_come_from_the_seed() -> None:
    """W-START draws small positive weights, the same for the same seed."""
    one, other = (_trial(keep=True, w_start="uniform-0.001") for _ in range(2))
    assert one.snapshots is not None
    assert other.snapshots is not None
    first = one.snapshots.weights[0]
    assert (first > 0).all()
    assert (first < 0.001).all()
    np.testing.assert_array_equal(first, other.snapshots.weights[0])
    third = np.random.SeedSequence(1).spawn(3)[2]  # the others are for learning and trajectories
    due = np.random.default_rng(third).uniform(0, 0.001, size=(5, 2))
    np.testing.assert_array_equal(first, due)


def test_an_expert_matched_at_once_needs_no_iteration() -> None:
    """No error at the first trajectory means zero iterations and no learning."""
    agent = Corridor()
    episode, _ = agent.roll_out(np.zeros((5, 2)), np.zeros(4, np.uint64))
    mu = feature_expectations(episode.states, episode.actions, gamma=GAMMA, shape=(5, 2))
    trial = _trial(agent=agent, mu_e=mu)
    assert (trial.iterations, trial.converged, agent.begun) == (0, True, [])
    assert (trial.steps, trial.collisions.tolist()) == (0, [])
    assert trial.collisions.dtype == np.int64
    assert len(trial.values) == len(trial.rewards) == len(trial.episodes) == 1


def test_several_trajectories_are_averaged(small_demos: Demos) -> None:
    """ROLLOUTS: an error is that of the mean over so many trajectories; the first one is kept."""
    trial, agent, mu_e = recorded(small_demos, rollouts=3, max_iterations=2)
    assert [name for name, _ in agent.calls] == ["roll"] * 3 + (["learn"] + ["roll"] * 3) * 2
    again = make_agent(small_demos.environment, Params.of(episodes=20, horizon=30))
    for i, error in enumerate(trial.errors):
        calls = [call for name, call in agent.calls if name == "roll"][3 * i : 3 * i + 3]
        rolled = [again.roll_out(c["q"], np.array(c["from"], np.uint64))[0] for c in calls]
        each = [
            feature_expectations(one.states, one.actions, gamma=GAMMA, shape=agent.shape)
            for one in rolled
        ]
        assert error == pytest.approx(norm(mu_e - np.mean(each, axis=0)), rel=1e-12)
        np.testing.assert_array_equal(trial.episodes[i].states, rolled[0].states)


@pytest.mark.parametrize("window", [1, 3, 8])
def test_a_plateau_ends_a_trial_with_its_least_error(window: int) -> None:
    """PLATEAU: a trial ends after so many updates without a smaller d, with the nearest weights."""
    mu_e = _mu_e() + 0.05  # no trajectory is everywhere at once
    params = Params.of(plateau=window, max_iterations=60)
    seed = np.random.SeedSequence(1)
    trial = run_trial(
        Corridor(),
        get_method("unified"),
        mu_e,
        np.zeros((5, 2), bool),
        params,
        seed=seed,
        keep=True,
    )
    least = int(trial.errors.argmin())
    assert not trial.converged
    assert trial.iterations == least + window
    assert trial.snapshots is not None
    np.testing.assert_array_equal(trial.weights, trial.snapshots.weights[least])
    np.testing.assert_array_equal(trial.q, trial.snapshots.q[least])
    for k in range(window, least):  # nothing ended it before
        assert trial.errors[: k + 1].argmin() > k - window


def test_without_a_plateau_the_last_weights_are_the_result() -> None:
    """By default a trial ends at the cap, and its result is that of the last update."""
    seed, params = np.random.SeedSequence(1), Params.of(max_iterations=30)
    given = Corridor(), get_method("unified"), _mu_e() + 0.05, np.zeros((5, 2), bool), params
    trial = run_trial(*given, seed=seed, keep=True)
    assert (trial.iterations, trial.converged) == (30, False)
    assert trial.snapshots is not None
    np.testing.assert_array_equal(trial.weights, trial.snapshots.weights[-1])
