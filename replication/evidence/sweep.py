"""Run the declared specifications and evaluate the claims under each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import pandas as pd

from replication.evidence.claims import Claim, load_claims
from replication.evidence.experiments import Key
from replication.evidence.sensitivity import ablations_table, effects_table, numbers_table
from replication.evidence.specifications import (
    Specification,
    factorial_specifications,
    load_specifications,
    single_specifications,
)
from replication.evidence.variations import (
    ablation_conditions,
    maze_conditions,
    numbered_conditions,
    soccer_conditions,
)
from replication.trials.condition import Condition
from replication.trials.results import Results
from replication.trials.run import run_trials
from replication.trials.store import Store

PLAN = load_specifications()
MAZES = [load_claims().by_id(id) for id in PLAN.mazes.claims]
SOCCER = [load_claims().by_id(id) for id in PLAN.soccer.claims]


@dataclass(frozen=True)
class Sweep:
    """How the declared specifications are run; each method returns a table.

    Attributes
    ----------
    store, jobs, seed
        As for :func:`replication.trials.run.run_trials`.
    most_trials, most_specifications
        Limits for a quick look: fewer trials of each specification, fewer specifications of a kind.
    """

    store: Store
    jobs: int
    seed: int
    most_trials: int
    most_specifications: int

    def single(self, task: Literal["mazes", "soccer"]) -> pd.DataFrame:
        """Return the effects with one choice changed at a time."""
        plan, make, claims = (
            (PLAN.mazes.single, maze_conditions, MAZES)
            if task == "mazes"
            else (PLAN.soccer.single, soccer_conditions, SOCCER)
        )
        return self._effects(single_specifications(plan.choices), make, plan.trials, claims)

    def factorial(self) -> pd.DataFrame:
        """Return the effects with all choices changed at once."""
        plan = PLAN.mazes.factorial
        return self._effects(factorial_specifications(plan), maze_conditions, plan.trials, MAZES)

    def ablations(self) -> pd.DataFrame:
        """Return the method with its trace switched off, and other readings of AdaBoost-IRL."""
        conditions = ablation_conditions(PLAN.ablations, PLAN.iteration_cap)
        return ablations_table(self._run(conditions.values(), PLAN.ablations.trials), conditions)

    def numbers(self) -> pd.DataFrame:
        """Return what ever more incorrect demonstrations save."""
        conditions = numbered_conditions(PLAN.ablations, PLAN.iteration_cap)
        results = self._run(conditions.values(), PLAN.ablations.trials)
        paper = -load_claims().by_id("SAVES-OPEN").paper_effect
        return numbers_table(results, conditions, paper=paper)

    def _effects(
        self,
        specifications: Sequence[Specification],
        make: Callable[[Specification, int], dict[Key, Condition]],
        trials: int,
        claims: Sequence[Claim],
    ) -> pd.DataFrame:
        conditions = {
            specification: make(specification, PLAN.iteration_cap)
            for specification in specifications[: self.most_specifications]
        }
        every = [condition for run in conditions.values() for condition in run.values()]
        return effects_table(self._run(every, trials), conditions, claims)

    def _run(self, conditions: Iterable[Condition], trials: int) -> Results:
        return run_trials(
            list(conditions),
            trials=min(trials, self.most_trials),
            store=self.store,
            jobs=self.jobs,
            seed=self.seed,
            traced=False,
        )
