"""The paper's claims and the frozen criteria by which they are judged: the file ``claims.toml``.

This module only reads and checks; :mod:`replication.evidence.verdicts` judges. One file because
what the paper says of a claim, its label and the place of its evidence are read together.
"""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from replication.errors import UserError, unknown
from replication.evidence.experiments import EXPERIMENTS, NONE
from replication.evidence.statistics import CONFIDENCE
from replication.files import read_text
from replication.irl import METHODS, get_method
from replication.source import bare_source

FILE = Path(__file__).with_name("claims.toml")

DECIDING = ("verdicts.py", "statistics.py")
"""The modules that decide, beside the file: they are frozen with it."""

TaskName = Literal["open-maze", "obstacle-maze", "soccer"]
Measure = Literal[
    "iterations", "converged", "early_collisions", "early_errors", "q_growth", "reward_growth"
]
Statistic = Literal[
    "saved", "sd-ratio", "mean", "share", "published-mean", "published-sd", "published-run"
]

TESTED = ("saved", "sd-ratio", "mean")
"""The statistics with a test; those of "published" numbers and of shares have none."""

LABELS = {
    "FASTER": "faster than AdaBoost-IRL",
    "STEADIER": "steadier than AdaBoost-IRL",
    "FASTER-WITH": "faster with incorrect ones",
    "SAVES-OPEN": "saves iterations, open maze",
    "SAVES-OBSTACLES": "saves iterations, obstacles",
    "SAVES-SOCCER": "saves iterations, soccer",
    "AVOIDS-OPEN": "collides less at first, open maze",
    "AVOIDS-OBSTACLES": "collides less at first, obstacles",
    "AVOIDS-SOCCER": "collides less at first, soccer",
    "ERRS-OPEN": "errs less at first, open maze",
    "ERRS-OBSTACLES": "errs less at first, obstacles",
    "ERRS-SOCCER": "errs less at first, soccer",
    "ZERO-OPEN": "error falls to zero, open maze",
    "ZERO-OBSTACLES": "error falls to zero, obstacles",
    "ZERO-SOCCER": "error falls to zero, soccer",
    "Q-GROWS": "Q grows with time",
    "REWARD-GROWS": "reward grows with time",
}
"""What each claim that is not a published number says, in a few words, and on which task."""

EVIDENCE = {
    ("open-maze", "iterations"): "open_maze/contrasts",
    ("open-maze", "converged"): "open_maze/fig05",
    ("open-maze", "q_growth"): "open_maze/fig07",
    ("open-maze", "reward_growth"): "open_maze/fig07",
    ("obstacle-maze", "iterations"): "obstacle_maze/contrasts",
    ("obstacle-maze", "converged"): "obstacle_maze/fig09_errors",
    ("soccer", "iterations"): "soccer/contrasts",
    ("soccer", "converged"): "soccer/fig12",
}
"""The output, as notebook/name, that shows what a claim is judged on, by task and measure."""


def evidence(task: str, measure: str) -> str:
    """Return the output that shows a measure best; if there is none, the table of all trials.

    Examples
    --------
    >>> evidence("soccer", "converged"), evidence("soccer", "early_errors")
    ('soccer/fig12', 'soccer/trials')
    """
    return EVIDENCE.get((task, measure), f"{task.replace('-', '_')}/trials")


def label(id: str) -> str:
    """Return what a claim says in a few words; one without a label is called by its id."""
    return LABELS.get(id, id)


def short_label(id: str) -> str:
    """Return what a claim says without its task, for where the task changes.

    Examples
    --------
    >>> short_label("SAVES-OPEN")
    'saves iterations'
    """
    return label(id).partition(",")[0]


class ClaimError(UserError):
    """A file of claims that cannot be used; the message is one line."""


class Strict(BaseModel):
    """A table of a file: no key may be unknown."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Claim(Strict):
    """One claim of the paper; ``claims.toml`` explains the fields.

    `paper` has mean, SD and number of trials by method. `margin` is the smallest effect of
    interest, or `fraction` that as a share of y's mean; without either it follows from `paper`.
    `used` is the reason why a number gets no verdict.
    """

    id: str
    claim: str
    place: str
    task: TaskName
    measure: Measure
    statistic: Statistic
    x: str
    y: str = ""
    margin: float | None = None
    fraction: Annotated[float, Field(gt=0, lt=1)] | None = None
    prediction: str = ""
    note: str = ""
    paper: Mapping[str, tuple[float, float, int]] = {}
    used: str = ""

    @model_validator(mode="after")
    def _fits(self) -> Self:
        for method in (self.x, *filter(None, [self.y]), *self.paper):
            if method not in METHODS:
                raise ValueError(f"there is no method {method!r}; known: {', '.join(METHODS)}")
        if self.is_published and self.x not in self.paper:
            raise ValueError(f"paper.{self.x} is missing")
        if self.statistic in ("saved", "sd-ratio", "share") and not self.y:
            raise ValueError(f"{self.statistic!r} needs y")
        if self.x == self.y:
            raise ValueError(f"x and y are both {self.x!r}; name two methods")
        if self.paper and self.y and not {self.x, self.y} <= set(self.paper):
            raise ValueError(f"paper has to have both {self.x!r} and {self.y!r}, or neither")
        if bool(self.used) == bool(self.prediction):
            raise ValueError("needs a prediction, or a reason why it is not judged (used)")
        return self

    @property
    def is_published(self) -> bool:
        """Whether the claim is a published number itself."""
        return self.statistic.startswith("published")

    def cells(self) -> list[tuple[str, str]]:
        """Return the cells in which it is judged: reading of Eq. 9, and set of demonstrations."""
        method = get_method(self.x)
        sets = EXPERIMENTS[self.task].sets if method.uses_incorrect else (NONE,)
        return [(reading, set) for set in sets for reading in method.readings]

    @property
    def paper_effect(self) -> float:
        """The published effect in the claim's own statistic, NaN where none is published."""
        if not self.paper:
            return math.nan
        mean, sd, _ = self.paper[self.x]
        if self.statistic == "saved":
            return self.paper[self.y][0] - mean
        if self.statistic == "sd-ratio":
            return sd / self.paper[self.y][1]
        return sd if self.statistic == "published-sd" else mean


class Judging(Strict):
    """What holds for all claims: the judging run, and the criterion's numbers."""

    root_seed: Annotated[int, Field(ge=0)]
    fewest: Annotated[int, Field(ge=2)]
    confidence: float
    level: Annotated[float, Field(gt=0, lt=1)]
    trials: Mapping[TaskName, Annotated[int, Field(ge=2)]]

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.confidence != CONFIDENCE:
            raise ValueError(
                f"all intervals have a confidence of {CONFIDENCE}, not {self.confidence}; "
                "change it in replication/evidence/statistics.py, too"
            )
        return self


class Known(Strict):
    """What was known when the criteria were frozen: runs, by their root seeds."""

    root_seeds: tuple[int, ...]
    what: str


class Claims(Strict):
    """The whole file: the judging run, the claims, and what was known before."""

    version: Literal[2]
    judging: Judging
    known: tuple[Known, ...]
    claim: tuple[Claim, ...]

    @model_validator(mode="after")
    def _fits(self) -> Self:
        ids = [claim.id for claim in self.claim]
        for claim in self.claim:
            if ids.count(claim.id) > 1:
                raise ValueError(f"the claim {claim.id!r} is there twice")
            if claim.task not in self.judging.trials:
                raise ValueError(f"judging.trials has no {claim.task!r}")
        seed = self.judging.root_seed
        if any(seed in run.root_seeds for run in self.known):
            raise ValueError(f"root seed {seed} was used before; judge by one that never was")
        return self

    def by_id(self, id: str) -> Claim:
        """Return one claim.

        Raises
        ------
        ClaimError
            If there is none with that id.
        """
        known = {claim.id: claim for claim in self.claim}
        if id not in known:
            raise ClaimError(unknown(id, known, "claim"))
        return known[id]


@cache
def load_claims() -> Claims:
    """Return the claims of the package."""
    return parse_claims(read_text(FILE))


def parse_claims(text: str) -> Claims:
    """Read and check a file of claims.

    Raises
    ------
    ClaimError
        In one line that names the claim and the key, for whatever is unknown, missing or does not
        fit the rest.
    """
    try:
        document = tomllib.loads(text)
        return Claims(**document)
    except tomllib.TOMLDecodeError as error:
        raise ClaimError(f"claims.toml is not TOML: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = list(first["loc"])
        if place[:1] == ["claim"] and len(place) > 1:
            entry = document["claim"][place[1]]
            name = entry.get("id", place[1]) if isinstance(entry, dict) else place[1]
            place[:2] = [f"claim {name}"]
        where = "claims.toml" + (f", {'.'.join(map(str, place))}" if place else "")
        message = first["msg"].removeprefix("Value error, ")
        if first["type"] not in ("value_error", "missing"):
            message += f", not {first['input']!r:.80}"
        raise ClaimError(f"{where}: {message}") from None


def criteria_hash() -> str:
    """Return the hash of the criteria, which is written beside every verdict.

    It covers the values of the file, and the source that decides.
    """
    deciding = (bare_source(read_text(FILE.with_name(name))) for name in DECIDING)
    content = "\n".join([canonical_hash(read_text(FILE)), *deciding])
    return hashlib.sha256(content.encode()).hexdigest()


def canonical_hash(text: str) -> str:
    """Return the SHA-256 of the values of a TOML text: layout, order and comments do not count."""
    document = json.dumps(tomllib.loads(text), sort_keys=True, separators=(",", ":"), default=str)
    return hashlib.sha256(document.encode()).hexdigest()
