"""What demonstrations and agents need of an environment, whatever its kind."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


class Environment(Protocol):
    """A world with a finite number of states and actions."""

    @property
    def kind(self) -> str:
        """Name of the kind of environment, as written in demonstration files."""
        ...

    @property
    def n_states(self) -> int:
        """Number of states."""
        ...

    @property
    def n_actions(self) -> int:
        """Number of actions."""
        ...

    @property
    def actions(self) -> tuple[str, ...]:
        """Names of the actions."""
        ...

    def replay(self, actions: Iterable[int]) -> NDArray[np.int64]:
        """Return the states that T actions visit from the start on, int64 [T + 1]."""
        ...

    def goal_step(self, actions: Iterable[int]) -> int | None:
        """Return how many of the actions it takes to reach the goal; None if they do not."""
        ...

    def cell(self, state: int) -> tuple[int, ...]:
        """Return the numbers by which files refer to a state."""
        ...

    def cells(self, states: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the numbers by which files refer to states, [state, number]."""
        ...

    def describe(self) -> dict[str, Any]:
        """Return the environment as plain JSON values, including its `kind`."""
        ...
