from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from replication.learning.seeds import child, trial_seeds

ROOTS = st.integers(0, 2**64)


def words(seed: np.random.SeedSequence) -> tuple[int, ...]:
    """Return what a generator would be seeded with."""
    return tuple(int(word) for word in seed.generate_state(4, np.uint64))


@given(root=ROOTS, few=st.integers(0, 8), more=st.integers(0, 8))
def test_trial_seeds_do_not_depend_on_how_many_there_are(root: int, few: int, more: int) -> None:
    """The first seeds of many trials are the seeds of few: trial k has one seed for ever."""
    short, long = trial_seeds(root, few), trial_seeds(root, few + more)
    assert (len(short), len(long)) == (few, few + more)
    assert list(map(words, short)) == list(map(words, long[:few]))


def test_trial_seeds_are_the_same_on_every_machine() -> None:
    """The first word of trial 1 of root 7 is this number, whatever the platform."""
    assert words(trial_seeds(7, 2)[1])[0] == 4042502035264064771


@given(root=ROOTS, k=st.integers(0, 5), spawned=st.integers(0, 5))
def test_a_child_does_not_depend_on_what_was_spawned(root: int, k: int, spawned: int) -> None:
    """Child k is the one that a fresh seed spawns as its k-th, whatever was spawned before."""
    used = np.random.SeedSequence(root)
    used.spawn(spawned)
    fresh = np.random.SeedSequence(root).spawn(k + 1)[k]
    assert words(child(used, k)) == words(fresh)
    assert words(child(used, k)) == words(child(used, k))
    grandchild = np.random.SeedSequence(root).spawn(k + 1)[k].spawn(k + 1)[k]
    assert words(child(child(used, k), k)) == words(grandchild)


def test_streams_are_all_different() -> None:
    """No two of root, trial and child share a stream."""
    states = [
        words(child(seed, k))
        for root in range(20)
        for seed, k in itertools.product(trial_seeds(root, 20), range(3))
    ]
    states += [words(seed) for root in range(20) for seed in trial_seeds(root, 20)]
    assert len(set(states)) == len(states) == 20 * 20 * 4
