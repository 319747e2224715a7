"""Vectors as numbers: each part of an observation is cut into equal bins."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from replication.envs.tasks.base import TaskError


@dataclass(frozen=True)
class Bins:
    """Numbers a vector by cutting the range of each of its parts into equal bins.

    Parameters
    ----------
    low, high
        The range of each part; what lies outside counts to the nearest bin.
    counts
        Number of bins of each part.

    Examples
    --------
    >>> bins = Bins(low=[0, 0], high=[1, 1], counts=[2, 5])
    >>> bins.n_states, bins([0.4, 0.9]), bins([9.0, -9.0])
    (10, 4, 5)
    """

    low: Sequence[float]
    high: Sequence[float]
    counts: Sequence[int]

    @property
    def n_states(self) -> int:
        """Number of states: the product of the counts."""
        return math.prod(self.counts)

    def __post_init__(self) -> None:
        low, high, counts = np.array(self.low), np.array(self.high), np.array(self.counts)
        fits = low.shape == high.shape == counts.shape == (counts.size,)
        fits = fits and counts.dtype.kind in "iu"
        fits = fits and bool(np.isfinite([low, high]).all() and (low < high).all())
        if not fits or counts.min(initial=1) < 1:
            raise TaskError(
                "Bins: low, high and counts need a finite number for each part of an observation, "
                "low below high and at least one bin"
            )

    def __call__(self, observation: Iterable[float]) -> int:
        """Return the number of an observation's bin."""
        number, values = 0, np.asarray(observation).tolist()  # Python's numbers are faster
        if len(values) != len(self.counts):
            raise TaskError(
                f"Bins cut {len(self.counts)} numbers, but an observation has {len(values)}; "
                "choose those that count: lambda seen: bins(seen[:2])"
            )
        for value, low, high, count in zip(values, self.low, self.high, self.counts, strict=True):
            if value != value:
                raise TaskError("Bins: an observation holds NaN")
            place = int((min(max(value, low), high) - low) / (high - low) * count)
            number = number * count + min(place, count - 1)
        return number
