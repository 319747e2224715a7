"""Seeds: every random number of a trial descends from one explicit seed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def trial_seeds(root: int, n: int) -> list[np.random.SeedSequence]:
    """Return the seeds of trials 0 ... n - 1: the children of one root, the same for all methods.

    Examples
    --------
    >>> [seed.spawn_key for seed in trial_seeds(7, 2)]
    [(0,), (1,)]
    """
    return np.random.SeedSequence(root).spawn(n)


def child(seed: np.random.SeedSequence, k: int) -> np.random.SeedSequence:
    """Return child k of `seed`, no matter what was spawned from it before."""
    return np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, k))


def stream(seed_sequence: np.random.SeedSequence) -> NDArray[np.uint64]:
    """Return a random stream: the state, uint64 [4], of a xoshiro256++ generator.

    Examples
    --------
    >>> stream(np.random.SeedSequence(1)).shape
    (4,)
    """
    words: NDArray[np.uint64] = seed_sequence.generate_state(4, np.uint64)  # type: ignore[assignment]
    return words if words.any() else np.ones(4, np.uint64)  # the generator cannot leave 0
