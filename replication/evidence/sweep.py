"""Run the declared specifications and evaluate the claims under each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from replication.evidence.claims import Claim, load_claims
from replication.evidence.experiments import Key
from replication.evidence.sensitivity import effects_table
from replication.evidence.specifications import (
    Specification,
    factorial_specifications,
    load_specifications,
    single_specifications,
)
from replication.evidence.statistics import mean_intervals
from replication.evidence.tables import pairs_near
from replication.evidence.variations import (
    Ablation,
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


def ablations_table(results: Results, conditions: Mapping[Ablation, Condition]) -> pd.DataFrame:
    """Return one row a condition: a summary of its iterations, capped trials counting as the cap.

    `more` is the mean number of iterations more than in the first condition, over the same seeds,
    with its interval.
    """
    rows = []
    first = results.iterations(next(iter(conditions.values())))
    for (method, reading, choices), condition in conditions.items():
        counts = results.iterations(condition).astype(float)
        low, high = mean_intervals(np.stack([counts, counts - first]))
        rows.append(
            {
                "method": method,
                "reading": reading,
                "choices": choices,
                "n": len(counts),
                "capped": int((~results.converged(condition)).sum()),
                "mean": counts.mean(),
                "low": low[0],
                "high": high[0],
                "sd": counts.std(ddof=1),
                "median": float(np.median(counts)),
                "more": (counts - first).mean(),
                "more_low": low[1],
                "more_high": high[1],
            }
        )
    return pd.DataFrame(rows)


def numbers_table(
    results: Results, conditions: Mapping[tuple[int, str], Condition], *, paper: float
) -> pd.DataFrame:
    """Return one row for each number of incorrect demonstrations and reading of Eq. 9.

    `saved` is the mean number of iterations fewer than without any, over the same seeds, with its
    interval; `paper` the published saving. `pairs` and `leaving` count the marked pairs, see
    :func:`replication.evidence.tables.pairs_near`.
    """
    rows = []
    for (number, reading), condition in conditions.items():
        counts = results.iterations(condition).astype(float)
        saved = results.iterations(conditions[0, reading]) - counts
        low, high = mean_intervals(np.stack([counts, saved]))
        near = pairs_near(condition.selected)
        rows.append(
            {
                "reading": reading,
                "number": number,
                "pairs": near["pairs"],
                "leaving": near["leaving"],
                "capped": int((~results.converged(condition)).sum()),
                "mean": counts.mean(),
                "low": low[0],
                "high": high[0],
                "saved": saved.mean(),
                "saved_low": low[1],
                "saved_high": high[1],
                "paper": paper,
            }
        )
    return pd.DataFrame(rows)
