"""A setting: demonstrations, a method and parameters, ready to run any trial of it."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from replication.demos import Demos, content_hash
from replication.expectations import expert_expectations, visited
from replication.irl import Method, Trial, get_method, iterate
from replication.irl.loop import Answer, Request
from replication.params import Params
from replication.tasks import Task, make_task


@dataclass(frozen=True)
class Setting:
    """What all trials of one cell of an experiment have in common.

    Attributes
    ----------
    demos
        All demonstrations of a task; `params.demonstrations` selects among the incorrect ones.
    method
        Name in the registry of methods.
    params
        Everything else that determines a trial but its seed.

    Raises
    ------
    ChoiceError
        If the method is unknown.
    DemoError
        If the demonstrations have none of a kind that the parameters ask for.
    """

    demos: Demos
    method: str
    params: Params

    def __post_init__(self) -> None:
        _ = self.selected  # a setting that cannot run is refused when it is made

    @cached_property
    def selected(self) -> Demos:
        """The demonstrations that the method is given."""
        uses = self.rule.uses_incorrect
        return self.demos.select(self.params.demonstrations.incorrect if uses else "none")

    @cached_property
    def selected_hash(self) -> str:
        """The hash of what the method is given, see :func:`replication.demos.content_hash`."""
        return content_hash(self.selected)

    @property
    def rule(self) -> Method:
        """The method itself."""
        return get_method(self.method)

    @property
    def choices(self) -> str:
        """The registered choices that differ from the defaults: `ID=value`, parted by blanks."""
        return " ".join(f"{id}={value}" for id, value in self.params.differences().items())

    @cached_property
    def task(self) -> Task:
        """The task as the loop sees it."""
        return make_task(self.demos.environment, self.params)

    def trial(
        self, *, seed: np.random.SeedSequence, keep: bool = False
    ) -> Generator[Request, Answer, Trial]:
        """Return one trial, ready for :func:`replication.irl.run`."""
        shape, gamma = self.task.shape, self.params.learner.gamma
        mu_e = expert_expectations(self.selected.correct, gamma=gamma, shape=shape)
        mu_b = visited(self.selected.incorrect, shape=shape)
        return iterate(self.task, self.rule, mu_e, mu_b, self.params, seed=seed, keep=keep)
