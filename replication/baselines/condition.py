"""A condition with any method: of the paper, or a baseline."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replication.baselines.agents import Copier, Planner
from replication.baselines.baseline import Baseline
from replication.baselines.problem import Problem, table_of
from replication.baselines.registry import BASELINES, find_method
from replication.demos.model import Demos
from replication.irl import Method, Trial
from replication.irl.agent import Agent
from replication.irl.expectations import mean_expectations
from replication.paper.params import Update
from replication.paper.register import ChoiceError
from replication.trials.condition import Condition

Array = NDArray[np.float64]


class Found(NamedTuple):
    """The weights [state, action] that a method without a loop found, by so many plans."""

    weights: Array
    plans: int


_FOUND: dict[tuple[str, str, float], Found] = {}


@dataclass(frozen=True)
class BaselineCondition(Condition):
    """A condition whose method may be a baseline.

    A method that finds its reward beforehand is run for one iteration, in which the agent learns by
    that reward, whatever cap the parameters have.

    Raises
    ------
    ChoiceError
        If the method needs what the demonstrations or their task do not have.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        method = self.named
        if not isinstance(method, Baseline) or method.find is None:
            return
        if table_of(self.demos.environment) is None:
            others = [name for name, method in BASELINES.items() if method.find is None]
            raise ChoiceError(
                f"the method {self.method!r} needs the table of moves, which a task of the kind "
                f"{self.demos.environment.kind!r} does not have; without it work: "
                f"{', '.join(others)}"
            )
        if self.params.learner.gamma == 1:
            raise ChoiceError(
                f"the method {self.method!r} needs a discount below 1: set gamma = 0.99"
            )
        if method.needs_incorrect and not self.selected.incorrect:
            raise ChoiceError(
                f"the method {self.method!r} compares correct with incorrect demonstrations, and "
                "there are no incorrect ones"
            )
        loop = replace(self.params.loop, max_iterations=1)
        object.__setattr__(self, "params", replace(self.params, loop=loop))

    @property
    def named(self) -> Method:
        """The method as it is registered."""
        return find_method(self.method)

    @cached_property
    def selected(self) -> Demos:
        """The demonstrations that the method is given."""
        kinds = self.params.demonstrations.incorrect if self.named.uses_incorrect else "none"
        return self.demos.select(kinds)

    @property
    def found(self) -> Found:
        """What a method without a loop finds; it is found once in each process."""
        key = self.method, self.selected_hash, self.params.learner.gamma
        if key not in _FOUND:
            moves = table_of(self.demos.environment)
            find = self.named.find if isinstance(self.named, Baseline) else None
            assert moves is not None
            assert find is not None
            demos = self.selected
            problem = Problem(moves, demos.correct, demos.incorrect, self.params.learner.gamma)
            _FOUND[key] = Found(find(problem), problem.plans)
        return _FOUND[key]

    @property
    def rule(self) -> Method:
        """The method itself, for the loop."""
        method = self.named
        if not isinstance(method, Baseline) or method.find is None:
            return method

        def update(
            w: Array,
            memory: Array,
            mu_e: Array,
            mu_i: Array,
            mu_b: NDArray[np.bool_],
            params: Update,
        ) -> tuple[Array, Array]:
            return self.found.weights, memory

        return replace(method, update=update)

    @cached_property
    def agent(self) -> Agent:
        """The agent that learns or plans in the environment, or copies the expert."""
        agent, gamma = super().agent, self.params.learner.gamma
        if self.method == "cloning":
            mu_e = mean_expectations(self.selected.correct, gamma=gamma, shape=agent.shape)
            return Copier(agent, mu_e)
        moves = table_of(self.demos.environment)
        if self.params.learner.solver == "planning" and moves is not None:
            return Planner(agent, moves, gamma)
        return agent

    def trial(self, *, seed: np.random.SeedSequence, keep: bool = False) -> Trial:
        """Run one trial; what a copier prefers stands in place of its Q-table."""
        trial = super().trial(seed=seed, keep=keep)
        agent = self.agent
        return replace(trial, q=agent.preferences) if isinstance(agent, Copier) else trial
