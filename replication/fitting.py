"""Learn a reward from demonstrations: the package's front door for a user's own task."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from replication.baselines import BASELINES, BaselineCondition, find_method
from replication.demos.checks import DemoWarning
from replication.demos.files import different_ways, doubts
from replication.demos.lists import Trajectory, make_demos
from replication.demos.model import Demos
from replication.envs.environment import Environment
from replication.envs.tasks.base import is_over, is_random
from replication.errors import clip, show
from replication.irl import METHODS, Method
from replication.irl.expectations import norm
from replication.learning.seeds import trial_seeds
from replication.paper.params import Params
from replication.paper.register import ChoiceError
from replication.result import Fit, FitError, taken

if TYPE_CHECKING:  # it takes long to import
    import pandas as pd

ROLLOUTS = 100
"""Trajectories behind each expectation (Eq. 7) where moves are random."""

LIMIT = "max_episode_steps"
"""What Gymnasium calls the horizon of an environment."""

PLATEAU = 50
"""Iterations without a smaller error that end a fit where d = 0 cannot be reached."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Watched(BaselineCondition):
    """A condition that reports each weight update of its trial, and the error before it."""

    report: Callable[[int, float], None]

    @property
    def rule(self) -> Method:
        rule = super().rule
        numbers = count(1)

        def update(w: Array, memory: Array, mu_e: Array, mu_i: Array, *rest: Any) -> Any:
            self.report(next(numbers), norm(mu_e - mu_i))
            return rule.update(w, memory, mu_e, mu_i, *rest)

        return replace(rule, update=update)


def fit(
    demos: Demos | Mapping[str, Iterable[Trajectory]],
    *,
    task: Environment | None = None,
    method: str = "unified-incorrect",
    params: Params | None = None,
    seed: int = 0,
    report: Callable[[int, float], None] | None = None,
    **values: Any,
) -> Fit:
    """Learn reward weights and a policy from demonstrations.

    Parameters
    ----------
    demos
        Correct and incorrect demonstrations, from :func:`replication.load_demos`; or lists of them
        by kind, see :func:`replication.make_demos`, in the `task`.
    task
        The environment of such lists, a task of your own or a maze; or one in whose place `demos`
        are checked again.
    method
        A name in :data:`replication.METHODS` or :data:`replication.BASELINES`.
    params
        Parameters; by default those of `own_params`.
    seed
        Root seed: the result equals trial 0 of :func:`replication.trials.run.run_trials` with it.
    report
        Is called at each weight update, with its number and the error d before it.
    values
        Single parameters by name, such as ``alpha=0.2``, instead of `params`.

    Raises
    ------
    ChoiceError
        If the method or a parameter is unknown, a value is out of range, or `incorrect` demos are
        chosen for a method that uses none.
    DemoError, TaskError
        If the task cannot have gone as demonstrated, or the demonstrations lack a kind that the
        parameters ask for.

    Warns
    -----
    DemoWarning
        If no policy can match such lists exactly (`load_demos` has warned of those in a file), or
        an episode goes on where a correct demonstration stops.

    Examples
    --------
    >>> from replication import Maze, demonstrate, fit
    >>> demos = demonstrate(
    ...     "small",
    ...     Maze.from_text('''
    ...     ..G
    ...     S..
    ... '''),
    ... )
    >>> result = fit(demos, seed=1)
    >>> result.converged, result.actions.tolist() == demos.correct[0].actions.tolist()
    (True, True)
    """
    checked = _checked(demos, task)
    if "incorrect" in values:
        checked = checked.select(_useful(values.pop("incorrect"), method))
    if not isinstance(seed, int) or seed < 0:
        raise FitError(f"seed = {clip(repr(seed))} must be a whole number, at least 0")
    if params is not None and values:
        raise FitError(f"give {min(values)} = {show(values[min(values)])} or params, not both")
    chosen = params if params is not None else own_params(checked, **values)
    given = (checked, method, chosen)
    condition = BaselineCondition(*given) if report is None else _Watched(*given, report)
    trial = condition.trial(seed=trial_seeds(seed, 1)[0])
    episode = trial.episodes[taken(trial.errors, condition.params)]
    result = Fit(
        demos=checked,
        method=method,
        params=condition.params,
        seed=seed,
        weights=trial.weights,
        q=trial.q,
        states=episode.states,
        actions=episode.actions,
        errors=trial.errors,
        converged=trial.converged,
    )
    for doubt in (*_open_ends(result), *_untrained(result)):
        warnings.warn(doubt, DemoWarning, stacklevel=2)
    return result


def fit_many(
    demos: Demos | Mapping[str, Iterable[Trajectory]],
    *,
    seeds: Iterable[int],
    progress: bool = True,
    **options: Any,
) -> pd.DataFrame:
    """Fit once for each seed; return a table with a row for each.

    Parameters
    ----------
    demos, options
        As for `fit`.
    seeds
        Root seeds.
    progress
        Whether to show a bar.

    Returns
    -------
    DataFrame
        Columns seed, method, iterations, converged, stopped and error.
    """
    import pandas as pd
    from tqdm.auto import tqdm

    checked = _checked(demos, options.pop("task", None))
    rows = []
    if not isinstance(seeds, Iterable):
        raise FitError(f"seeds = {clip(repr(seeds))} must be several: range({clip(repr(seeds))})")
    for seed in tqdm(list(seeds), desc=checked.task, unit="fit", disable=not progress):
        result = fit(checked, seed=seed, **options)
        names = ("seed", "method", "iterations", "converged", "stopped", "error")
        rows.append({name: getattr(result, name) for name in names})
    return pd.DataFrame(rows)


def own_params(demos: Demos, **values: Any) -> Params:
    """Return the parameters that suit demonstrations of a user's own, with some values replaced.

    All incorrect demonstrations are used. Where moves are random, `ROLLOUTS` trajectories stand
    behind each expectation; where moves are random or correct demonstrations differ, a fit ends
    after `PLATEAU` iterations without a smaller error. The horizon is that of the environment, if
    it has one that is shorter. All else is as in the register.
    """
    random = is_random(demos.environment)
    limit = getattr(getattr(getattr(demos.environment, "env", None), "spec", None), LIMIT, None)
    usual = Params().learner.horizon
    suited = {
        "incorrect": "all",
        "horizon": min(usual, limit or usual),
        "rollouts": ROLLOUTS if random else 1,
        "plateau": PLATEAU if random or different_ways(demos) > 1 else 0,
    }
    return Params.of(**suited | values)


def _useful(kinds: str, method: str) -> str:
    """Return the kinds of incorrect demonstrations that a call asks for, if the method uses any."""
    if kinds != "none" and not find_method(method).uses_incorrect:
        able = [name for name, row in {**METHODS, **BASELINES}.items() if row.uses_incorrect]
        raise ChoiceError(
            f"the method {method!r} uses no incorrect demonstrations: leave out incorrect = "
            f"{show(kinds)}, or take one of {', '.join(able)}"
        )
    return kinds


def _untrained(result: Fit) -> list[str]:
    """Return a word on a result that is no better than an agent that has learned nothing."""
    if result.converged or not result.params.loop.plateau or result.errors.argmin():
        return []
    return [
        f"nothing was better than the untrained agent in {result.iterations} iterations, so the "
        f"reward is that of the start; set plateau = {4 * result.params.loop.plateau}"
    ]


def _checked(demos: Demos | Mapping[str, Iterable[Trajectory]], task: Environment | None) -> Demos:
    """Return demonstrations of the task, with a warning where they cannot be matched."""
    if task is not None and not hasattr(task, "goal_step"):
        raise FitError(f"task = {clip(repr(task))} is no task; wrap it: GymTask(env)")
    if isinstance(demos, Demos):
        return demos if task is None else replace(demos, environment=task)
    if task is None:
        raise FitError("demonstrations in plain lists need their environment: fit(..., task=...)")
    made = make_demos(task, demos)
    for doubt in doubts(made):
        warnings.warn(doubt, DemoWarning, stacklevel=3)
    return made


def _open_ends(result: Fit) -> list[str]:
    """Return why d = 0 is out of reach where the horizon does not suit a correct demonstration."""
    task, horizon = result.demos.environment, result.params.learner.horizon
    for demo in result.demos.correct:
        steps = len(demo.actions)
        if steps > horizon:
            return [f"correct demo {show(demo.name)} has {steps} steps, but horizon = {horizon}"]
        if steps < horizon and is_over(task, demo.states, demo.actions) is False:
            return [
                f"correct demo {show(demo.name)} stops after {steps} steps, but the episode goes "
                f"on: the agent drives on to the horizon, so set horizon = {steps}"
            ]
    return []
