"""A condition of an experiment: demonstrations, a method and parameters, ready to run any trial."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from replication.demos.model import Demos, content_hash
from replication.irl.agent import Agent
from replication.irl.expectations import mean_expectations, visited
from replication.irl.loop import Trial, run_trial
from replication.irl.methods import Method, get_method
from replication.paper.params import Params
from replication.trials.agents import make_agent


@dataclass(frozen=True)
class Condition:
    """What all trials of a condition have in common.

    Attributes
    ----------
    demos
        All demonstrations of a task; `params.demonstrations` selects among the incorrect ones.
    method
        Name in the registry of methods.
    params
        Everything else that determines a trial, except its seed.

    Raises
    ------
    ChoiceError
        If the method is unknown.
    DemoError
        If the demonstrations lack a kind that the parameters ask for.
    """

    demos: Demos
    method: str
    params: Params

    def __post_init__(self) -> None:
        _ = self.selected  # refuses a condition that could not run as soon as it is made

    @cached_property
    def selected(self) -> Demos:
        """The demonstrations that the method is given."""
        uses = self.rule.uses_incorrect
        return self.demos.select(self.params.demonstrations.incorrect if uses else "none")

    @cached_property
    def selected_hash(self) -> str:
        """Hash of what the method is given, see :func:`replication.demos.model.content_hash`."""
        return content_hash(self.selected)

    @property
    def rule(self) -> Method:
        """The method itself."""
        return get_method(self.method)

    @cached_property
    def agent(self) -> Agent:
        """The agent that learns in the environment."""
        return make_agent(self.demos.environment, self.params)

    def trial(self, *, seed: np.random.SeedSequence, keep: bool = False) -> Trial:
        """Run one trial, see :func:`replication.irl.run_trial`."""
        shape, gamma = self.agent.shape, self.params.learner.gamma
        mu_e = mean_expectations(self.selected.correct, gamma=gamma, shape=shape)
        mu_b = visited(self.selected.incorrect, shape=shape)
        return run_trial(self.agent, self.rule, mu_e, mu_b, self.params, seed=seed, keep=keep)
