"""What was learned, and what to do with it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from replication.demos.checks import DemoError, action_number
from replication.demos.files import demos_document, doubts, parse_demos, summary
from replication.demos.model import Demos
from replication.envs.environment import Environment
from replication.envs.tasks.base import Task
from replication.errors import UserError, clip
from replication.files import FileError, read_json, write_file
from replication.paper.params import Params

if TYPE_CHECKING:  # it takes long to import
    from matplotlib.figure import Figure

FORMAT = "replication-fit"
VERSION = 1


class FitError(UserError):
    """A file that holds no fit, or a state that it does not know, in one line."""


@dataclass(frozen=True, repr=False, eq=False)
class Fit:
    """What was learned from demonstrations, and all that is needed to learn it again.

    Attributes
    ----------
    demos, method, params, seed
        What it was learned from.
    weights, q
        Reward weights and Q-table, `[state, action]`: the last ones or, where d = 0 cannot be
        reached, those of the smallest error.
    states, actions
        The greedy trajectory that goes with them, [T + 1] and [T].
    errors
        The history: d (Eq. 6) before each iteration and after the last one.
    converged
        Whether the last error is within the threshold.

    Examples
    --------
    >>> from replication import TabularTask, fit
    >>> corridor = TabularTask([[0, 1], [0, 2], [2, 2]], terminal=[2], actions=("back", "on"))
    >>> result = fit({"correct": [["on", "on"]]}, task=corridor, seed=1)
    >>> result
    <Fit of 'mine' by unified-incorrect: converged after 1 iteration>
    >>> result.predict(1), result.path
    ('on', [((0,), 'on'), ((1,), 'on'), ((2,), '')])
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

    def __repr__(self) -> str:
        ended = "converged" if self.converged else "not converged"
        return f"<Fit of {self.demos.task!r} by {self.method}: {ended} after {self._count}>"

    @property
    def iterations(self) -> int:
        """Number of weight updates."""
        return len(self.errors) - 1

    @property
    def stopped(self) -> str:
        """Why it ended: "threshold", "plateau" or "cap"."""
        if self.converged:
            return "threshold"
        return "cap" if self.iterations == self.params.loop.max_iterations else "plateau"

    @property
    def error(self) -> float:
        """The error d of the weights: the last or, with a plateau, the least one."""
        return float(self.errors[taken(self.errors, self.params)])

    @property
    def path(self) -> list[tuple[tuple[int, ...], str]]:
        """The learned trajectory: each state as files write it, and the action taken there."""
        environment = self.demos.environment
        names = [*(environment.actions[action] for action in self.actions), ""]
        cells = (environment.cell(int(state)) for state in self.states)
        return list(zip(cells, names, strict=True))

    def summary(self) -> str:
        """Return what was learned and why it stopped, in a few lines."""
        demos, loop = self.demos, self.params.loop
        why = {
            "threshold": f"converged: d is within the threshold {loop.threshold:g}",
            "plateau": f"not converged: no smaller d in {loop.plateau} iterations",
            "cap": f"not converged: ended at the cap of {loop.max_iterations} iterations",
        }
        chosen = [f"{id}={value}" for id, value in self.params.differences().items()]
        lines = [
            f"task        {demos.task}: {demos.environment.n_states} states, "
            f"{demos.environment.n_actions} actions",
            f"demos       {summary(demos)}",
            " ".join(["method      " + self.method, f"seed {self.seed}", *chosen]),
            f"result      {why[self.stopped]}; {self._count}, d = {self.error:.4g}",
        ]
        if not self.converged and loop.plateau:
            nearest = int(self.errors.argmin())
            lines.append(f"            reward and policy are those of iteration {nearest}")
        lines += [f"note        {doubt}" for doubt in doubts(demos)]
        path = [",".join(map(str, cell)) for cell, _ in self.path]
        shown = path if len(path) <= 12 else [*path[:8], "...", *path[-3:]]
        steps = f"{len(self.actions)} step{'s' * (len(self.actions) != 1)}"
        return "\n".join([*lines, f"path        {' '.join(shown)} ({steps})"])

    def policy(self) -> NDArray[np.int64]:
        """Return the greedy action of each state, int64 [state]."""
        return self.q.argmax(axis=1)

    def predict(self, state: Any) -> str:
        """Return the name of the action that the policy takes.

        `state` is what the environment shows: an observation of Gymnasium; else the number of a
        state or, in a maze, row and column. Raises `UserError` if there is none such.
        """
        return self.demos.environment.actions[int(self.q[self.number(state)].argmax())]

    def reward(self, state: Any, action: str | int) -> float:
        """Return the learned reward R(s, a); state and errors as for `predict`.

        A state in which no trajectory has ever been has none.
        """
        number, at = action_number(self.demos.environment, action), self.number(state)
        if not self.weights[at].any():
            raise FitError(
                f"state {at} has no reward: neither a demonstration nor a trajectory of the agent "
                "was ever there; `weights` have 0"
            )
        return float(self.weights[at, number])

    def plot(self) -> Figure:
        """Return a figure of what was learned."""
        from replication.report.learned import fit_figure

        return fit_figure(self.demos, self.states, self.actions, self.weights, self.errors)

    @property
    def _count(self) -> str:
        return f"{self.iterations} iteration{'s' * (self.iterations != 1)}"

    def number(self, seen: Any) -> int:
        """Return the number of a state, which is given as for `predict`."""
        environment = self.demos.environment
        if isinstance(environment, Task):
            return environment.number(seen)
        if isinstance(seen, Integral) and 0 <= int(seen) < environment.n_states:
            return int(seen)
        for state in range(environment.n_states):
            if isinstance(seen, Iterable) and environment.cell(state) == tuple(seen):
                return state
        last = environment.n_states - 1
        raise FitError(f"there is no state {clip(repr(seen))}; states are 0..{last}")

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
    def load(cls, path: str | os.PathLike[str], *, task: Environment | None = None) -> Fit:
        """Read a fit that was saved; `task` as for :func:`replication.load_demos`.

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
                demos=parse_demos(json.dumps(document["demos"]).encode(), task),
                method=document["method"],
                params=Params.of(**document["params"]),
                seed=document["seed"],
                converged=document["converged"],
                **arrays,
            )
        except FileError as error:
            raise FitError(str(error)) from None
        except DemoError as error:
            how = str(error).replace("load_demos", "Fit.load")
            raise FitError(f"{path}: demos: {how}") from None
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise FitError(f"{path}: cannot be read as a fit ({error!r}); save it again") from None


_ARRAYS: dict[str, type] = {
    "errors": np.float64,
    "states": np.int64,
    "actions": np.int64,
    "weights": np.float64,
    "q": np.float64,
}


def taken(errors: NDArray[np.float64], params: Params) -> int:
    """Return the iteration whose weights are the result, see :class:`replication.irl.Trial`."""
    return int(errors.argmin()) if params.loop.plateau else len(errors) - 1
