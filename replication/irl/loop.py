"""The loop of Algorithms 1 and 2, the same for all methods and tasks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replication.irl.agent import Agent, Episode
from replication.irl.expectations import mean_expectations, norm
from replication.irl.methods import Method
from replication.learning.seeds import child, stream
from replication.paper.params import Params

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Snapshots:
    """The weights and Q-tables of every iteration of a trial: entry i is after i weight updates.

    Both are `[iteration, state, action]`.
    """

    weights: Array
    q: Array


@dataclass(frozen=True)
class Trial:
    """The outcome of one trial.

    Attributes
    ----------
    errors
        d_0 ... d_n (Eq. 6), one for each trajectory of the agent; n is the number of iterations.
    converged
        Whether the last error is within the threshold; else a cap or a plateau ended the trial.
    steps
        Learning steps in the environment, over all iterations.
    weights, q
        The last reward weights and Q-table, `[state, action]`; with PLATEAU those of least error.
    episodes
        The agent's (first) trajectory before each update and after the last; as many as errors.
    collisions
        Steps that ran into a wall or an obstacle while learning after each update,
        int64 [iteration].
    values, rewards
        max_a Q(s, a) and max_a w(s, a), `[iteration, state]`, in the states where the expert acts,
        in ascending order; entry i is after i updates. In single precision, as they only serve
        reports.
    snapshots
        Every iteration, if requested.
    """

    errors: Array
    converged: bool
    steps: int
    weights: Array
    q: Array
    episodes: tuple[Episode, ...]
    collisions: NDArray[np.int64]
    values: NDArray[np.float32]
    rewards: NDArray[np.float32]
    snapshots: Snapshots | None = None

    @property
    def iterations(self) -> int:
        """Number of weight updates (choice ITERATION-COUNT)."""
        return len(self.errors) - 1


def run_trial(
    agent: Agent,
    method: Method,
    mu_e: Array,
    mu_b: NDArray[np.bool_],
    params: Params,
    *,
    seed: np.random.SeedSequence,
    keep: bool = False,
) -> Trial:
    """Run one trial of Algorithm 1 or 2.

    Parameters
    ----------
    agent
        Learns Q from reward weights, and follows its greedy policy.
    method
        The weight update.
    mu_e, mu_b
        Feature expectations of the correct demonstrations (Eq. 5) and the pairs that the incorrect
        ones visit (Eq. 11), `[state, action]`.
    params
        Parameters of the loop and of the update.
    seed
        The seed of the trial: its learning, its trajectories and its first weights draw from three
        children of it.
    keep
        Whether to keep a snapshot of every iteration.

    Notes
    -----
    ITERATION-COUNT: an iteration is one weight update, the counter i of the listings.
    """
    learning, rolling = stream(child(seed, 0)), stream(child(seed, 1))
    memory = method.start(agent.shape, params.update)
    seen = mu_b if method.uses_incorrect else np.zeros_like(mu_b)
    w = _start_weights(agent.shape, params, seed=child(seed, 2))
    q = np.zeros(agent.shape)
    errors: list[float] = []
    episodes: list[Episode] = []
    collisions: list[int] = []
    values: list[NDArray[np.float32]] = []
    rewards: list[NDArray[np.float32]] = []
    kept: list[tuple[Array, Array]] = []
    on_path = np.flatnonzero(mu_e.any(axis=1))
    nearest = w, q
    steps = 0
    for i in range(params.loop.max_iterations + 1):
        rolled: list[Episode] = []
        for _ in range(params.loop.rollouts):
            episode, rolling = agent.roll_out(q, rolling)
            rolled.append(episode)
        mu_i = mean_expectations(rolled, gamma=params.learner.gamma, shape=agent.shape)  # Eq. 7
        errors.append(norm(mu_e - mu_i))  # Eq. 6
        episodes.append(rolled[0])
        values.append(q[on_path].max(axis=1).astype(np.float32))
        rewards.append(w[on_path].max(axis=1).astype(np.float32))
        if keep:
            kept.append((w, q))
        converged = errors[-1] <= params.loop.threshold
        least = int(np.argmin(errors))
        if least == i or not params.loop.plateau:
            nearest = w, q
        if converged or i == params.loop.max_iterations or 0 < params.loop.plateau <= i - least:
            break
        w, memory = method.update(w, memory, mu_e, mu_i, seen, params.update)
        if params.loop.w_norm == "unit":
            w = w / norm(w)
        if params.learner.q_start == "reset":
            q = np.zeros(agent.shape)
        q, learning, taken, hit = agent.learn(w, q, learning)  # Eq. 1
        steps += taken
        collisions.append(hit)
    snapshots = None
    if keep:
        snapshots = Snapshots(*map(np.array, zip(*kept, strict=True)))
    return Trial(
        np.array(errors),
        converged,
        steps,
        *nearest,
        tuple(episodes),
        np.array(collisions, np.int64),
        np.array(values),
        np.array(rewards),
        snapshots,
    )


def _start_weights(
    shape: tuple[int, int], params: Params, *, seed: np.random.SeedSequence
) -> Array:
    """Return the reward weights before the first iteration (choice W-START)."""
    if params.loop.w_start == "zero":
        return np.zeros(shape)
    return np.random.default_rng(seed).uniform(0.0, 0.001, size=shape)
