"""Learn a reward from a demonstration file: the package's front door for a user's own task."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replication.demos.files import demos_document, parse_demos
from replication.demos.model import Demos
from replication.errors import UserError
from replication.files import FileError, read_json, write_file
from replication.irl import Method
from replication.irl.expectations import norm
from replication.learning.seeds import trial_seeds
from replication.paper.params import Params
from replication.trials.condition import Condition

FORMAT = "replication-fit"
VERSION = 1


Array = NDArray[np.float64]


class FitError(UserError):
    """A file that does not hold a fit; the message is one line."""


@dataclass(frozen=True)
class Fit:
    """What was learned from demonstrations, and all that is needed to learn it again.

    Attributes
    ----------
    demos, method, params, seed
        What it was learned from.
    weights, q
        Reward weights and Q-table, `[state, action]`.
    states, actions
        The last greedy trajectory, [T + 1] and [T].
    errors
        The history: d (Eq. 6) before each iteration and after the last one.
    converged
        Whether the last error is within the threshold.
    """

    demos: Demos
    method: str
    params: Params
    seed: int
    weights: NDArray[np.float64]
    q: NDArray[np.float64]
    states: NDArray[np.int64]
    actions: NDArray[np.int64]
    errors: NDArray[np.float64]
    converged: bool

    @property
    def iterations(self) -> int:
        """Number of weight updates."""
        return len(self.errors) - 1

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the fit as one JSON file; numbers keep every bit."""
        document = {
            "format": FORMAT,
            "version": VERSION,
            "method": self.method,
            "seed": self.seed,
            "params": self.params.values(),
            "iterations": self.iterations,
            "converged": self.converged,
            **{name: getattr(self, name).tolist() for name in _ARRAYS},
            "demos": demos_document(self.demos),
        }
        lines = [f'  "{key}": {json.dumps(value)}' for key, value in document.items()]
        return write_file(path, "{\n" + ",\n".join(lines) + "\n}\n")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Fit:
        """Read a fit that was saved.

        Raises
        ------
        FitError
            If the file holds no fit of this version.
        """
        try:
            document: dict[str, Any] = read_json(path)
            if (document["format"], document["version"]) != (FORMAT, VERSION):
                raise ValueError(f"it is not a {FORMAT} file of version {VERSION}")
            arrays: dict[str, Any] = {
                name: np.array(document[name], dtype=kind) for name, kind in _ARRAYS.items()
            }
            return cls(
                demos=parse_demos(json.dumps(document["demos"]).encode()),
                method=document["method"],
                params=Params.of(**document["params"]),
                seed=document["seed"],
                converged=document["converged"],
                **arrays,
            )
        except FileError as error:
            raise FitError(str(error)) from None
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise FitError(f"{path}: cannot be read as a fit ({error!r}); save it again") from None


_ARRAYS: dict[str, type] = {
    "errors": np.float64,
    "states": np.int64,
    "actions": np.int64,
    "weights": np.float64,
    "q": np.float64,
}


@dataclass(frozen=True)
class _Watched(Condition):
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
    demos: Demos,
    *,
    method: str = "unified-incorrect",
    params: Params | None = None,
    seed: int = 0,
    report: Callable[[int, float], None] | None = None,
) -> Fit:
    """Learn reward weights and a policy from demonstrations.

    Parameters
    ----------
    demos
        Correct and incorrect demonstrations, from :func:`replication.load_demos`.
    method
        A name in :data:`replication.METHODS`.
    params
        Parameters; by default the registered ones with every incorrect demonstration of the file.
    seed
        Root seed: the result equals trial 0 of :func:`replication.trials.run.run_trials` with it.
    report
        Is called at each weight update, with its number and the error d before it.

    Raises
    ------
    ChoiceError
        If the method is unknown.
    DemoError
        If the demonstrations lack a kind that the parameters ask for.

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
    chosen = params if params is not None else Params.of(incorrect="all")
    given = (demos, method, chosen)
    condition = Condition(*given) if report is None else _Watched(*given, report)
    trial = condition.trial(seed=trial_seeds(seed, 1)[0])
    return Fit(
        demos=demos,
        method=method,
        params=chosen,
        seed=seed,
        weights=trial.weights,
        q=trial.q,
        states=trial.episodes[-1].states,
        actions=trial.episodes[-1].actions,
        errors=trial.errors,
        converged=trial.converged,
    )
