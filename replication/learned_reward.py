"""A learned reward in a Gymnasium environment, for any other learner to train on."""

from __future__ import annotations

from typing import Any

import gymnasium

from replication.demos.checks import action_number
from replication.envs.tasks.stepped import WrappedTask
from replication.errors import clip
from replication.result import Fit, FitError


class LearnedReward(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Replaces an environment's reward by a learned one, R(s, a) of state s and action a.

    Parameters
    ----------
    env
        The environment, as it is used by the other learner. Its observations are those of the
        task: state numbers, or whatever the task's function numbers.
    result
        What was learned in it, or in one with the same states.

    Raises
    ------
    FitError
        If the environment has other numbers of states or actions.

    Notes
    -----
    Where no trajectory has ever been the reward is 0: nothing was learned there.

    The reward says what the demonstrations say with the discount of `result.params`: train with the
    same one.

    Examples
    --------
    >>> from replication import GymTask, fit
    >>> env = gymnasium.make("FrozenLake-v1", is_slippery=False)
    >>> result = fit({"correct": [[1, 1, 2, 1, 2, 2]]}, task=GymTask(env), seed=1)
    >>> learned = LearnedReward(env, result)
    >>> _ = learned.reset(seed=1)
    >>> learned.step(1)[1] == result.weights.item(0, 1)
    True
    """

    def __init__(self, env: gymnasium.Env[Any, Any], result: Fit) -> None:
        super().__init__(env)
        if not isinstance(result, Fit):
            raise FitError(f"give a fit, Fit.load(path), not {clip(repr(result))}")
        task = result.demos.environment
        for what, space, due in (
            ("states", env.observation_space, task.n_states),
            ("actions", env.action_space, task.n_actions),
        ):
            found = getattr(space, "n", due)
            if found != due and not (what == "states" and isinstance(task, WrappedTask)):
                raise FitError(f"the fit has {due} {what}, the environment {found}")
        self.result = result
        self._observation: Any = None
        self._first = int(getattr(env.action_space, "start", 0))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode."""
        self._observation, info = self.env.reset(seed=seed, options=options)
        return self._observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Take an action; raises `UserError` if the state is not one of the task."""
        state = self.result.number(self._observation)
        number = action_number(self.result.demos.environment, int(action) - self._first)
        reward = self.result.weights.item(state, number)
        self._observation, _, ended, cut, info = self.env.step(action)
        return self._observation, reward, ended, cut, info
