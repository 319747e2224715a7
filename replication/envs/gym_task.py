"""Gymnasium environments as tasks: by their table where they have one, else by stepping them."""

from __future__ import annotations

import json
import operator
from collections.abc import Sequence
from typing import Any

import gymnasium
from gymnasium import spaces
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit

from replication.envs.tabular import TabularTask
from replication.envs.task import Ints, Task, TaskError, Walk
from replication.envs.wrapped_task import WrappedTask, env_name

PLAIN = (OrderEnforcing, PassiveEnvChecker, TimeLimit)
"""Wrappers that leave the moves as they are."""


class GymTask(Task):
    """A Gymnasium environment with discrete observations and actions.

    Where the environment has a table of its moves, as FrozenLake, CliffWalking and Taxi do, it is
    learned on that table, at the speed of the mazes; otherwise by stepping it.

    Parameters
    ----------
    env
        The environment. A table is used only if no wrapper can have changed the moves.
    actions
        Names of the actions; their numbers by default.
    reset_seed
        If given, every episode starts where ``env.reset(seed=reset_seed)`` does.

    Raises
    ------
    TaskError
        If observations or actions are not discrete.

    Examples
    --------
    >>> env = gymnasium.make("FrozenLake-v1", is_slippery=False)
    >>> task = GymTask(env, actions=("left", "down", "right", "up"))
    >>> task.replay([1, 1, 2]).tolist()
    [0, 4, 8, 9]
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        *,
        actions: Sequence[str] | None = None,
        reset_seed: int | None = None,
    ) -> None:
        space = env.observation_space
        if not isinstance(space, spaces.Discrete):
            raise TaskError(
                f"{env_name(env)}: observations are {space}, which have no numbers; give a "
                "function that numbers them: WrappedTask(env, state, n_states), see Bins"
            )
        self.env = env
        table = _table(env)
        self.task: TabularTask | WrappedTask
        if table is None:
            first = int(space.start)
            self.task = WrappedTask(
                env,
                lambda observation: operator.index(observation) - first,
                int(space.n),
                actions=actions,
                reset_seed=reset_seed,
            )
        else:
            start = getattr(env.unwrapped, "initial_state_distrib", None)
            if start is None or reset_seed is not None:
                start = int(env.reset(seed=reset_seed)[0])
            self.task = TabularTask(table, start=start, actions=actions)
        self.n_states, self.actions = self.task.n_states, self.task.actions
        self.reset_seed = reset_seed
        if _is_described(env):
            self.kind = "gymnasium"

    @property
    def is_random(self) -> bool:
        """Whether the same actions may lead to different states."""
        return self.task.is_random

    def walk(self, actions: Sequence[int]) -> Walk:
        """Return where actions lead, if nothing is random; raises `TaskError` if it is."""
        return self.task.walk(actions)

    def fault(self, states: Ints, actions: Ints) -> str | None:
        """Return at which step states [T + 1] and actions [T] cannot be an episode, and why."""
        return self.task.fault(states, actions)

    def is_over(self, states: Ints, actions: Ints) -> bool | None:
        """Return whether an episode has ended with these states; None if that cannot be known."""
        return self.task.is_over(states, actions)

    def describe(self) -> dict[str, Any]:
        """Return plain JSON values, from which `replication.load_demos` makes it again."""
        if self.kind == "own":
            return self.task.describe()
        spec = self.env.spec
        assert spec is not None
        seed = {} if self.reset_seed is None else {"reset_seed": self.reset_seed}
        return {
            "kind": self.kind,
            "id": spec.id,
            "options": dict(spec.kwargs),
            **seed,
            "actions": list(self.actions),
        }


def _table(env: gymnasium.Env[Any, Any]) -> dict[int, Any] | None:
    """Return the environment's own table of moves, if no wrapper can have changed them."""
    while isinstance(env, gymnasium.Wrapper):
        if not isinstance(env, PLAIN):
            return None
        env = env.env
    table = getattr(env, "P", None)
    return table if isinstance(table, dict) else None


def _is_described(env: gymnasium.Env[Any, Any]) -> bool:
    """Return whether the environment can be made again from its name and plain options."""
    spec = env.spec
    if spec is None or ":" in spec.id or spec.additional_wrappers:
        return False
    try:
        return json.loads(json.dumps(dict(spec.kwargs))) == dict(spec.kwargs)
    except (TypeError, ValueError):
        return False
