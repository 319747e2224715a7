"""Gymnasium environments as tasks: by their table where they have one, else by stepping them."""

from __future__ import annotations

import json
import operator
from collections.abc import Sequence
from typing import Any

import gymnasium
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit

from replication.envs.tasks.base import Ints, Task, TaskError, Walk
from replication.envs.tasks.stepped import WrappedTask, env_name
from replication.envs.tasks.table import TabularTask
from replication.errors import clip

NAMES = {
    "FrozenLakeEnv": ("left", "down", "right", "up"),
    "CliffWalkingEnv": ("up", "right", "down", "left"),
    "TaxiEnv": ("south", "north", "east", "west", "pick up", "drop off"),
}
"""What Gymnasium's documentation calls the actions of its environments, by their class."""

PLAIN = (OrderEnforcing, PassiveEnvChecker, TimeLimit)
"""Wrappers that leave the moves as they are."""


class GymTask(Task):
    """A Gymnasium environment with discrete observations and actions.

    Gymnasium's FrozenLake, CliffWalking and Taxi have a table of their moves, and are learned on
    it at the speed of the mazes, unless a wrapper may have changed them; others by stepping them.

    Parameters
    ----------
    env
        The environment.
    actions
        Names of the actions; by default those of Gymnasium's documentation, or their numbers.
    reset_seed
        If given, every episode starts by ``env.reset(seed=reset_seed)``. This is for environments
        in which nothing but the start is random.

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
        if not isinstance(env, gymnasium.Env):
            raise TaskError(f"give an environment, gymnasium.make(...), not {clip(repr(env))}")
        space = env.observation_space
        if not isinstance(space, spaces.Discrete):
            raise TaskError(
                f"{env_name(env)}: observations are {space}, which have no numbers; give a "
                "function that numbers them: WrappedTask(env, state, n_states), see Bins"
            )
        self.env = env
        bare = env.unwrapped
        names = actions or NAMES.get(type(bare).__name__) if _is_plain(env) else actions
        self._first = int(space.start)
        self.task: TabularTask | WrappedTask
        if _is_plain(env):
            start = bare.initial_state_distrib  # type: ignore[attr-defined]
            if reset_seed is not None:
                start = int(env.reset(seed=reset_seed)[0])
            self.task = TabularTask(bare.P, start=start, actions=names)  # type: ignore[attr-defined]
            if reset_seed is not None and self.task.is_random:
                raise TaskError(f"{env_name(env)}: moves are random; leave out reset_seed")
        else:
            self.task = WrappedTask(
                env,
                lambda observation: operator.index(observation) - self._first,
                int(space.n),
                actions=names,
                reset_seed=reset_seed,
            )
        self.table = self.task.table
        self.n_states, self.actions = self.task.n_states, self.task.actions
        self.reset_seed = reset_seed
        if _is_described(env):
            self.kind = "gymnasium"

    def number(self, observation: Any) -> int:
        """Return the number of the state that is observed; raises `TaskError` if it is none."""
        if self.table is None:
            return self.task.number(observation)
        return super().number(observation)

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
            "options": _options(spec),
            **seed,
            "actions": list(self.actions),
        }


def _is_plain(env: gymnasium.Env[Any, Any]) -> bool:
    """Return whether an environment moves by Gymnasium's own table."""
    while isinstance(env, gymnasium.Wrapper):
        if not isinstance(env, PLAIN):
            return False
        env = env.env
    own = type(env).step.__module__.startswith("gymnasium.envs.toy_text.")
    tabled = hasattr(env, "P") and hasattr(env, "initial_state_distrib")
    return own and tabled and not getattr(env, "fickle_passenger", False)


def _is_described(env: gymnasium.Env[Any, Any]) -> bool:
    """Return whether the environment can be made again from its name and plain options."""
    spec = env.spec
    if spec is None or ":" in spec.id or spec.additional_wrappers:
        return False
    try:
        return json.loads(json.dumps(_options(spec))) == _options(spec)
    except (TypeError, ValueError):
        return False


def _options(spec: EnvSpec) -> dict[str, Any]:
    """Return what Gymnasium needs to make an environment again, but for how it is shown."""
    options = {name: value for name, value in spec.kwargs.items() if name != "render_mode"}
    registered = gymnasium.registry.get(spec.id)
    if registered and spec.max_episode_steps != registered.max_episode_steps:
        options["max_episode_steps"] = spec.max_episode_steps
    return options
