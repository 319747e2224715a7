"""A stand-in for the task of a Gymnasium environment; to be replaced by the real one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from replication.errors import UserError, show

_NAMES = {
    "FrozenLake": ("left", "down", "right", "up"),
    "CliffWalking": ("up", "right", "down", "left"),
    "Taxi": ("south", "north", "east", "west", "pick up", "drop off"),
}


def gym_task(id: str, options: dict[str, Any], actions: Sequence[str] | None = None) -> GymTask:
    """Make the task of a registered environment."""
    try:
        env = gymnasium.make(id, **options)
    except (gymnasium.error.Error, TypeError, ValueError, ImportError) as error:
        raise UserError(f"{show(id)}: {' '.join(str(error).split())}") from None
    return GymTask(env, actions)


class GymTask:
    """A Gymnasium environment with numbered states and actions."""

    def __init__(self, env: gymnasium.Env[Any, Any], actions: Sequence[str] | None = None) -> None:
        spaces = env.observation_space, env.action_space
        for space, what in zip(spaces, ("observations", "actions"), strict=True):
            if not isinstance(space, gymnasium.spaces.Discrete):
                raise UserError(f"the environment's {what} are {space}; they must be Discrete")
        self.env = env
        self.n_states, self.n_actions = (int(space.n) for space in spaces)  # type: ignore[attr-defined]
        known = _NAMES.get(env.spec.name if env.spec else "")
        self.actions = tuple(actions or known or map(str, range(self.n_actions)))
        if len(self.actions) != self.n_actions:
            raise UserError(f"give {self.n_actions} actions, not {len(self.actions)}")

    kind = "gymnasium"

    def replay(self, actions: Iterable[int]) -> NDArray[np.int64]:
        """Return the states that actions visit."""
        return self._play(actions)[0]

    def goal_step(self, actions: Iterable[int]) -> int | None:
        """Return when the episode ends by itself."""
        return self._play(actions)[1]

    def _play(self, actions: Iterable[int]) -> tuple[NDArray[np.int64], int | None]:
        state, _ = self.env.reset(seed=0)
        states, goal = [int(state)], None
        for number, action in enumerate(actions, start=1):
            if goal is None:
                state, _, terminated, _, _ = self.env.step(int(action))
                goal = number if terminated else None
            states.append(int(state))
        return np.array(states, dtype=np.int64), goal

    def cell(self, state: int) -> tuple[int, ...]:
        """Return the state."""
        return (int(state),)

    def cells(self, states: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the states."""
        return np.asarray(states, dtype=np.int64).reshape(-1, 1)

    def describe(self) -> dict[str, Any]:
        """Return plain JSON values."""
        assert self.env.spec is not None
        options = {k: v for k, v in self.env.spec.kwargs.items() if k != "render_mode"}
        return {"kind": self.kind, "id": self.env.spec.id, "options": options}
