"""The soccer field as demonstrations see it: actions lead to states, and in the end to a goal."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replication.envs.environment import Environment
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.rules import ACTIONS, N_STATES, SoccerParams, decode
from replication.errors import UserError


@dataclass(frozen=True)
class SoccerField:
    """Robot soccer with given parameters; its states and actions are those of the world."""

    params: SoccerParams = field(default_factory=SoccerParams)

    @property
    def kind(self) -> str:
        """Kind of environment: "soccer"."""
        return "soccer"

    @property
    def n_states(self) -> int:
        """Number of states: 16 x 12 cells, with an obstacle detected or not."""
        return N_STATES

    @property
    def n_actions(self) -> int:
        """Number of actions: 5."""
        return len(ACTIONS)

    @property
    def actions(self) -> tuple[str, ...]:
        """Names of the actions."""
        return ACTIONS

    def replay(self, actions: Iterable[int]) -> NDArray[np.int64]:
        """Return the states that T actions visit, int64 [T + 1]; after the end, the last one."""
        return self._play(actions)[0]

    def goal_step(self, actions: Iterable[int]) -> int | None:
        """Return how many of the actions it takes to score; None if they do not."""
        return self._play(actions)[1]

    def cell(self, state: int) -> tuple[int, ...]:
        """Return a state's column, row (from the lower left), and 1 if an obstacle is detected."""
        column, row, detected = decode(int(state))
        return column, row, int(detected)

    def cells(self, states: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return column, row and detection of states, int64 [state, 3]."""
        return np.array([self.cell(state) for state in states], dtype=np.int64).reshape(-1, 3)

    def describe(self) -> dict[str, Any]:
        """Return the field as plain JSON values."""
        return {"kind": self.kind, "actions": list(ACTIONS), **asdict(self.params)}

    def _play(self, actions: Iterable[int]) -> tuple[NDArray[np.int64], int | None]:
        world = FastSoccerWorld(self.params)
        states, over, goal = [world.reset()], False, None
        for number, action in enumerate(actions, start=1):
            if not over:
                state, scored, timed_out = world.step(int(action))
                over, goal = scored or timed_out, number if scored else None
                states.append(state)
            else:
                states.append(states[-1])
        return np.array(states, dtype=np.int64), goal


def as_soccer(environment: Environment) -> SoccerField:
    """Return the environment if it is a soccer field; raises `UserError` if it is not."""
    if not isinstance(environment, SoccerField):
        raise UserError(
            f"robot soccer is needed here, but this environment is of kind {environment.kind!r}"
        )
    return environment
