"""Environments whose observations a function numbers."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.wrappers import TransformAction

from replication.envs.tasks.base import Ints, Task, TaskError, Walk, named_actions, out_of_range
from replication.errors import clip

PROBES = (0, 1, 2)
"""Seeds under which an environment is tried, to see whether anything in it is random."""

STEPS = 200
"""Steps of such a trial."""


class WrappedTask(Task):
    """An environment whose observations a function numbers; it is known by stepping it.

    Parameters
    ----------
    env
        A Gymnasium environment with discrete actions.
    state
        Returns the number of an observation's state.
    n_states
        Number of states; may be left out if `state` has it, as `Bins` do.
    actions
        Names of the actions; their numbers by default.
    reset_seed
        If given, every episode starts by ``env.reset(seed=reset_seed)``. This is for environments
        in which nothing but the start is random: all luck is the same in every episode.

    Raises
    ------
    TaskError
        If actions are not discrete, or `state` returns no whole number from 0 to n_states - 1, or
        two numbers for the same observation.

    Examples
    --------
    >>> from replication import Bins
    >>> env = gymnasium.make("MountainCar-v0")
    >>> task = WrappedTask(env, Bins(low=[-1.2, -0.07], high=[0.6, 0.07], counts=[20, 20]))
    >>> task.n_states, task.n_actions, task.is_random
    (400, 3, True)
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        state: Callable[[Any], int],
        n_states: int | None = None,
        *,
        actions: Sequence[str] | None = None,
        reset_seed: int | None = None,
    ) -> None:
        known = n_states if n_states is not None else getattr(state, "n_states", None)
        if known is None:
            raise TaskError(f"{env_name(env)}: say how many states there are: n_states = ...")
        if not isinstance(env.action_space, spaces.Discrete):
            raise TaskError(
                f"{env_name(env)}: actions are {env.action_space}, which have no numbers; wrap the "
                "environment so that they are Discrete"
            )
        self.env = _numbered_from_0(env)
        if reset_seed is not None:
            self.env = _Restarted(self.env, reset_seed)
        self.state = state
        self.n_states = int(known)
        self.actions = named_actions(actions, int(env.action_space.n))
        self._trials = [self._trial(seed) for seed in PROBES]

    @property
    def name(self) -> str:
        """Name of the environment, for messages."""
        return env_name(self.env)

    @cached_property
    def is_random(self) -> bool:
        """Whether trials with different seeds went different ways."""
        return any(trial != self._trials[0] for trial in self._trials[1:])

    def number(self, observation: Any) -> int:
        """Return the number of an observation's state; raises `TaskError` if it is none."""
        found = self.state(observation)
        if type(found) is int and 0 <= found < self.n_states:  # a learner asks at every step
            return found
        try:
            return super().number(found)
        except TaskError:
            shown = clip(str(observation).replace("\n", " "))
            raise TaskError(
                f"{self.name}: the state of observation {shown} is {found!r}; it must be a "
                f"whole number from 0 to {self.n_states - 1}"
            ) from None

    def walk(self, actions: Sequence[int]) -> Walk:
        """Return where actions lead; raises `TaskError` if they lead elsewhere another time."""
        walks = [self._walk(actions, seed) for seed in PROBES]
        same = all(walk.states.tolist() == walks[0].states.tolist() for walk in walks[1:])
        if self.is_random or not same:
            raise TaskError(
                f"{self.name}: moves or the start are random: give the states as well as the "
                "actions"
            )
        return walks[0]

    def fault(self, states: Ints, actions: Ints) -> str | None:
        """Return at which step states [T + 1] and actions [T] cannot be an episode, and why.

        Where something is random, any states may be: there is no table to look them up in.
        """
        wrong = out_of_range(states, actions, self.n_states, self.n_actions)
        if wrong:
            return wrong
        if self.is_random:
            return None
        first = self._walk(actions.tolist(), PROBES[0])
        for step, (found, claim) in enumerate(zip(first.states, states, strict=False)):
            if found != claim:
                if step == 0:
                    return f"it starts in state {claim}, but episodes start in {found}"
                return f"step {step} leads to state {found}, not to {claim}"
        if len(first.states) < len(states):
            return f"it goes on after the episode has ended at step {first.end}; drop the rest"
        return None

    def is_over(self, states: Ints, actions: Ints) -> bool | None:
        """Return whether the environment ends the episode there, if nothing is random."""
        return None if self.is_random else self.walk(actions.tolist()).end is not None

    def describe(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {"kind": self.kind, "states": self.n_states, "actions": list(self.actions)}

    def _walk(self, actions: Sequence[int], seed: int) -> Walk:
        """Follow actions until the episode ends."""
        states, end = [self.number(self.env.reset(seed=seed)[0])], None
        for step, action in enumerate(actions, start=1):
            observation, _, ended, cut, _ = self.env.step(action)
            states.append(self.number(observation))
            if ended or cut:
                end = step
                break
        return Walk(np.array(states, np.int64), end)

    def _trial(self, seed: int) -> list[int]:
        """Take the same actions whatever the seed; number each observation before and after one."""
        draws = np.random.default_rng(0).integers(self.n_actions, size=STEPS).tolist()
        states: list[int] = []
        observation, _ = self.env.reset(seed=seed)
        for action in draws:
            states.append(self.number(observation))
            seen = copy.deepcopy(observation)
            observation, _, ended, cut, _ = self.env.step(action)
            if (again := self.number(seen)) != states[-1]:
                shown = clip(str(seen).replace("\n", " "))
                raise TaskError(
                    f"{self.name}: the state of observation {shown} is once {states[-1]} and once "
                    f"{again}; it must depend on the observation alone"
                )
            if ended or cut:
                observation, _ = self.env.reset()
        return states


class _Restarted(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Starts every episode with the same seed."""

    def __init__(self, env: gymnasium.Env[Any, Any], seed: int) -> None:
        super().__init__(env)
        self._seed = seed

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode, whatever the seed."""
        return self.env.reset(seed=self._seed, options=options)


def _numbered_from_0(env: gymnasium.Env[Any, Any]) -> gymnasium.Env[Any, Any]:
    """Return the environment, with actions that are numbered from 0."""
    space = env.action_space
    assert isinstance(space, spaces.Discrete)
    if space.start == 0:
        return env
    return TransformAction(env, lambda action: action + space.start, spaces.Discrete(space.n))


def env_name(env: gymnasium.Env[Any, Any]) -> str:
    """Return the name of an environment, for messages."""
    return env.spec.id if env.spec is not None else type(env.unwrapped).__name__
