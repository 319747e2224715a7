"""Checks of what a learner is given; what does not fit is a ValueError that names it."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

# far from overflow: among NaN no action is the largest
LARGEST: dict[type, float] = {np.float64: 1e280, np.float32: 1e30}
MAX_COUNT = 2**31 - 1  # so that the number of steps fits in an int64


def integer(name: str, value: Any, low: int, high: int = MAX_COUNT) -> int:
    """Return a whole number as an int."""
    try:
        number = operator.index(value)
    except TypeError:
        number = low - 1
    if isinstance(value, bool) or not low <= number <= high:
        raise ValueError(f"{name} must be an integer from {low} to {high}, not {value!r}")
    return number


def rate(name: str, value: float) -> float:
    """Return a number in [0, 1] as a float."""
    if not 0 <= value <= 1:
        raise ValueError(f"{name} must be in [0, 1], not {value}")
    return float(value)


def tolerance(value: float) -> float:
    """Return the tolerance of ties as a float."""
    if not 0 <= value < 1:
        raise ValueError(f"tolerance must be at least 0 and less than 1, not {value}")
    return float(value)


def table(
    name: str, values: ArrayLike, shape: tuple[int, ...], kind: type = np.float64
) -> NDArray[Any]:
    """Return a contiguous copy of a table of values or rewards, in the given type."""
    array = np.array(values, np.float64, order="C")
    if array.shape != shape:
        raise ValueError(
            f"{name} must have the shape [state, action], {list(shape)}, not {list(array.shape)}"
        )
    largest = LARGEST[kind]
    if not (np.abs(array) < largest).all():
        raise ValueError(f"{name} must be finite and below {largest}")
    return array.astype(kind)


def words(stream: ArrayLike) -> NDArray[np.uint64]:
    """Return a contiguous copy of a random stream."""
    array = np.array(stream, order="C")
    if array.dtype != np.uint64 or array.shape != (4,) or not array.any():
        raise ValueError("stream must be uint64 [4] and not all zero")
    return array
