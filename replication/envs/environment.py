"""What demonstrations need of an environment, whatever its kind."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


class Environment(Protocol):
    """A deterministic world with a start, a goal, and a finite number of states and actions."""

    @property
    def kind(self) -> str:
        """Name of the kind of environment, as it stands in demonstration files."""
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
        """States that actions visit from the start on: int64 [T + 1] for T actions."""
        ...

    def goal_step(self, actions: Iterable[int]) -> int | None:
        """After how many of the actions the goal is reached first; None if it is not."""
        ...

    def cell(self, state: int) -> tuple[int, ...]:
        """Return a state as the numbers that stand for it in a file."""
        ...

    def cells(self, states: NDArray[np.int64]) -> NDArray[np.int64]:
        """States as the numbers that stand for them in a file, [state, number]."""
        ...

    def describe(self) -> dict[str, Any]:
        """Return the environment as plain JSON values, its `kind` among them."""
        ...
