"""Tables of moves that chance may decide."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

CERTAIN = 2**32  # the bound of the last outcome: above the high half of any draw


class Moves(NamedTuple):
    """Where each action can lead, and with which probability.

    A pair is ``state * n_actions + action``. The outcomes of pair i are those from ``first[i]`` up
    to ``first[i + 1]``; after the pairs come the possible starts, as if they were one more. This
    takes the memory of what is possible, however many outcomes a single move has.

    Attributes
    ----------
    first
        Where outcomes begin, int64 [pair + 2].
    successors
        The states that they lead to, int64 [outcome].
    probabilities
        float64 [outcome].
    bounds
        The sums of probabilities up to and with each outcome, in units of 2**-32, uint64 [outcome].
        Whole numbers have no rounding to agree on, and these are compared with half a draw as
        exploring is; each outcome's probability is exact to 2**-32.
    ends
        Whether a state ends an episode, bool [state].

    Examples
    --------
    In a corridor of three states one slips half of the time.

    >>> moves = Moves.of(
    ...     ([0, 0, 1, 1, 2], [0] * 5, [0, 1, 1, 2, 2], [0.5, 0.5, 0.5, 0.5, 1]),
    ...     shape=(3, 1),
    ...     starts=[1, 0, 0],
    ...     ends=[False, False, True],
    ... )
    >>> moves.shape, moves.first.tolist(), moves.successors.tolist()
    ((3, 1), [0, 2, 4, 5, 6], [0, 1, 1, 2, 2, 0])
    >>> moves.ahead(np.array([8.0, 4.0, 100.0])).tolist()
    [[6.0], [2.0], [0.0]]
    """

    first: NDArray[np.int64]
    successors: NDArray[np.int64]
    probabilities: NDArray[np.float64]
    bounds: NDArray[np.uint64]
    ends: NDArray[np.bool_]

    @classmethod
    def of(
        cls,
        outcomes: tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike],
        *,
        shape: tuple[int, int],
        starts: ArrayLike,
        ends: ArrayLike,
    ) -> Moves:
        """Return the table of some outcomes.

        Parameters
        ----------
        outcomes
            States, actions, the states that they lead to, and probabilities, in any order. Those
            that agree in all but the probability are one outcome, and impossible ones are left out.
        shape
            Number of states and number of actions.
        starts
            The probability that an episode begins in a state, [state].
        ends
            Whether a state ends an episode, [state].

        Raises
        ------
        ValueError
            If states, actions or probabilities are out of range, or do not sum to 1.
        """
        n_states, n_actions = shape
        n_pairs = n_states * n_actions
        if n_actions < 1:
            raise ValueError("there must be an action")
        final, start = np.array(ends), np.asarray(starts, np.float64)
        if final.dtype != np.bool_ or not final.shape == start.shape == (n_states,):
            raise ValueError(f"starts and ends must have {n_states} entries, those of ends bool")
        state = _indices("states", outcomes[0], n_states)
        action = _indices("actions", outcomes[1], n_actions)
        successor = _indices("successors", outcomes[2], n_states)
        probability = np.asarray(outcomes[3], np.float64)
        if not state.shape == action.shape == successor.shape == probability.shape:
            raise ValueError("outcomes must be four lists of the same length")
        # Each key is a pair and where it leads.
        keys = np.concatenate(
            [
                (state * n_actions + action) * n_states + successor,
                np.arange(n_states) + n_pairs * n_states,
            ]
        )
        probability = np.concatenate([probability, start])
        if not (probability >= 0).all():
            raise ValueError("probabilities must not be negative")
        keys, places = np.unique(keys[probability > 0], return_inverse=True)
        probabilities = np.bincount(places, probability[probability > 0], len(keys)).astype(float)
        pairs, successors = np.divmod(keys, n_states)
        sums = np.bincount(pairs, probabilities, n_pairs + 1)
        for pair in np.flatnonzero(~(np.abs(sums - 1) <= 1e-6)).tolist():
            where = f"state {pair // n_actions}, action {pair % n_actions}"
            raise ValueError(
                f"the probabilities of {where if pair < n_pairs else 'the starts'} must sum to 1, "
                f"not {sums[pair]}"
            )
        first = np.searchsorted(pairs, np.arange(n_pairs + 2))
        bounds = np.full(len(keys), CERTAIN, np.uint64)
        for pair in np.flatnonzero(np.diff(first) > 1).tolist():
            begin, last = first[pair], first[pair + 1] - 1
            bounds[begin:last] = (probabilities[begin:last].cumsum() * CERTAIN).round()
        return cls(first, successors, probabilities, bounds, final)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of states and number of actions."""
        return len(self.ends), (len(self.first) - 2) // len(self.ends)

    @property
    def starts(self) -> NDArray[np.int64]:
        """The states in which episodes begin, int64 [n]."""
        return self.successors[self.first[-2] :]

    def after(self, state: int, action: int) -> NDArray[np.int64]:
        """Return the states that an action can lead to, int64 [n]."""
        pair = int(state) * self.shape[1] + int(action)
        return self.successors[self.first[pair] : self.first[pair + 1]]

    def ahead(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the expected value of the next state, [state, action]: 0 where an episode ends."""
        worth = self.probabilities * np.where(self.ends, 0.0, values)[self.successors]
        worth = worth[: self.first[-2]]  # without the starts
        expected: NDArray[np.float64] = np.add.reduceat(worth, self.first[:-2])
        return expected.reshape(self.shape)


def _indices(name: str, given: ArrayLike, n: int) -> NDArray[np.int64]:
    """Check a list of whole numbers below `n`."""
    array = np.asarray(given)
    integers = array.dtype.kind in "iu" and array.ndim == 1
    if not integers or array.min(initial=0) < 0 or array.max(initial=0) >= n:
        raise ValueError(f"{name} must be a list of integers from 0 to {n - 1}")
    return array.astype(np.int64)
