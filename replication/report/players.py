"""Players of the agent while it learns: where it goes, its rewards, how far it is from the expert.

Two runs stand side by side, without and with incorrect demonstrations, from the same seed. Which
trial is shown follows from a rule: of all trials that one whose difference in iterations between
the two is nearest to the median difference; of equally near ones the first. The quartiles can be
looked at, too, by the same rule.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import zip_longest
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from replication.demos.model import Demos
from replication.evidence.experiments import NONE, Key
from replication.irl import READINGS, Trial, get_method
from replication.report.moving import Player, key_entry, path, player_page
from replication.report.readable import F_LABELS, SET_LABELS
from replication.report.stages import EXPERT, Stage, stage
from replication.trials.measures import marked_pairs

Floats = NDArray[np.float64]

PARTS = {"lower quartile": 0.25, "median": 0.5, "upper quartile": 0.75}
"""Of the differences: what the trials that can be chosen are nearest to."""

LEVELS = 9
"""In so many steps a reward goes from hardly anything to the largest."""

NAMES = {"unified": "Without incorrect", "unified-incorrect": "With incorrect"}


def keys(reading: str, set: str) -> tuple[Key, Key]:
    """Return what is compared under a reading: the method without, and with incorrect ones."""
    without = get_method("unified").under(reading)
    return ("unified", without, NONE), ("unified-incorrect", reading, set)


def differences(trials: pd.DataFrame, reading: str, set: str) -> pd.Series:
    """Return how many iterations each trial saves with incorrect demonstrations, by its number.

    Trials at the cap count only where no pair ends before it.
    """
    rows = trials.set_index(["method", "reading", "set", "trial"]).sort_index()
    without, given = (rows.loc[key] for key in keys(reading, set))
    saved = (without["iterations"] - given["iterations"]).dropna()
    ended = (without["converged"] * given["converged"]).reindex(saved.index) == 1
    return saved[ended] if ended.any() else saved


def typical_trials(saved: pd.Series) -> dict[str, int]:
    """Return the trial nearest to the median of the differences, and to each quartile.

    Examples
    --------
    >>> typical_trials(pd.Series([3, -1, 8, 3, 4], index=[0, 1, 2, 3, 4]))
    {'lower quartile': 0, 'median': 0, 'upper quartile': 4}
    """
    return {part: int((saved - saved.quantile(q)).abs().idxmin()) for part, q in PARTS.items()}


def learning(
    demos: Demos, trials: pd.DataFrame, replayed: Callable[[Key, int], Trial], *, set: str
) -> Player:
    """Return a player of typical trials, under each reading.

    Parameters
    ----------
    demos
        What the expert shows.
    trials
        The table of all trials, from which the typical ones are chosen.
    replayed
        Returns a trial, given by what it is of and its number, with its snapshots.
    set
        The set of incorrect demonstrations that is shown.
    """
    place = stage(demos)
    known = SET_LABELS.get(set, set)
    readings = [one for one in READINGS if one in {*trials.loc[trials["set"] == set, "reading"]}]

    @cache
    def run(key: Key, k: int) -> tuple[pd.DataFrame, Floats]:
        return _numbers(place, key, k, replayed(key, k))

    tables: list[pd.DataFrame] = []
    plays: list[dict[str, object]] = []
    medians: list[str] = []
    for reading in readings:
        saved = differences(trials, reading, set)
        for part, k in typical_trials(saved).items():
            runs = _with_rewards([run(key, k) for key in keys(reading, set)])
            tables += [each.assign(under=reading, nearest_to=part) for each in runs]
            text = _why(saved, part, k) + _outcome(runs, known)
            plays.append({"text": text, "panels": _panels(runs, place.steps)})
            if part == "median":
                without, given = (len(each) - 1 for each in runs)
                medians.append(f"{F_LABELS[reading]}: {without} without and {given} with")
    pairs = marked_pairs(demos.select(set))[None].astype(float)
    marked = np.flatnonzero(place.weights(pairs)).tolist()
    content = {
        "title": "The agent learning, without and with incorrect demonstrations",
        "unit": "iteration",
        "rate": 3,
        "continuous": False,
        "view": place.view,
        "still": place.still,
        "movers": ['<path class="dot" d="M0 0h0"/>'],
        "marks": {**place.marks, "levels": LEVELS, "marked": marked},
        "chart": "error d (square-root scale) after each iteration",
        "key": _key(place),
        "choices": [
            {"name": "Reading", "options": [F_LABELS[one] for one in readings], "start": 0},
            {"name": "Trial", "options": [*PARTS], "start": [*PARTS].index("median")},
        ],
        "plays": plays,
    }
    words = (
        "The agent's way, its reward weights and its error, iteration by iteration, without and "
        f"with incorrect demonstrations ({known}) side by side. Iterations of the trial whose "
        f"difference is nearest to the median: {'; '.join(medians)}."
    )
    numbers = pd.concat(tables, ignore_index=True)
    first = ["under", "nearest_to"]
    return Player(player_page(content, words), numbers[[*first, *numbers.columns[:-2]]], words)


def _numbers(place: Stage, key: Key, k: int, trial: Trial) -> tuple[pd.DataFrame, Floats]:
    """Return what the player draws of a trial, a row for each iteration; and all weights."""
    assert trial.snapshots is not None, "a player needs trials that kept their snapshots"
    ways = [place.points(episode.states, episode.actions) for episode in trial.episodes]
    table = pd.DataFrame(
        {
            **dict(zip(("method", "reading", "set"), key, strict=True)),
            "trial": k,
            "iteration": range(trial.iterations + 1),
            "error": trial.errors,
            "moves": [len(way) - 1 for way in ways],
            "way": [path(way) for way in ways],
            "end": [f"{x} {y}" for x, y in (way[-1] for way in ways)],
        }
    )
    return table, place.weights(trial.snapshots.weights)


def _with_rewards(runs: list[tuple[pd.DataFrame, Floats]]) -> list[pd.DataFrame]:
    """Return runs with their rewards, on one scale."""
    most = max(np.abs(weights).max() for _, weights in runs) or 1.0
    return [table.assign(rewards=_changes(weights, most)) for table, weights in runs]


def _changes(weights: Floats, most: float) -> list[str]:
    """Return which places change their level in each iteration, and to what.

    Levels go by the root of a weight's size: one wrong loop outweighs all that is learned.
    """
    levels = (np.sign(weights) * np.ceil(LEVELS * np.sqrt(np.abs(weights) / most))).astype(int)
    before = np.vstack([np.zeros_like(levels[:1]), levels[:-1]])
    return [
        " ".join(f"{at}:{new[at]}" for at in np.flatnonzero(new != old))
        for old, new in zip(before, levels, strict=True)
    ]


def _panels(runs: list[pd.DataFrame], steps: str) -> list[dict[str, object]]:
    """Return both sides of a player; None stands for a frame that is as on the first side."""
    first, second = (_panel(run, steps) for run in runs)
    pairs = zip_longest(first["frames"], second["frames"])
    same = [one == other for one, other in pairs]
    second["frames"] = [
        None if equal else frame for equal, frame in zip(same, second["frames"], strict=False)
    ]
    return [first, second]


def _panel(run: pd.DataFrame, steps: str) -> dict[str, Any]:
    """Return one side of a player."""
    method = get_method(run["method"].iloc[0])
    frames = [
        [row.way, f"d = {row.error:.3g}, {row.moves} {steps}", f"{row.end} 0", row.rewards]
        for row in run.itertuples()
    ]
    frames[-1][1] = f"d = {run['error'].iloc[-1]:.3g} after {len(run) - 1} iterations"
    return {
        "name": NAMES[method.name],
        "colour": method.colour,
        "wide": 2 if method.uses_incorrect else 4.5,  # so both are seen where they are one
        "marked": method.uses_incorrect,
        "frames": frames,
        "errors": [float(f"{error:.4g}") for error in run["error"]],
    }


def _why(saved: pd.Series, part: str, k: int) -> str:
    """Return why a trial is shown, as a sentence."""
    nearest = f"nearest to the {part}, {saved.quantile(PARTS[part]):g}"
    return f"Trial {k}, the first of {len(saved)} that saves a number of iterations {nearest}. "


def _outcome(runs: list[pd.DataFrame], known: str) -> str:
    """Return what comes out, as a sentence."""
    without, given = (len(run) - 1 for run in runs)
    drawn = ["error", "way", "rewards"]
    same = runs[0][drawn].equals(runs[1][drawn])
    return (
        f"It takes {without} iterations without incorrect demonstrations and {given} with them "
        f"({known}){'; the two runs are the same, move by move' if same else ''}."
    )


def _key(place: Stage) -> str:
    """Return what everything means, as HTML."""
    seek, avoid, marked = place.marks["shapes"]
    line = '<path class="way" d="M-11 0H9"/><path class="dot" d="M9 0h0"/>'
    entries = [
        ("-12 -8 24 16", line, "the agent\u2019s way, and where it ends"),
        ("-12 -8 24 16", EXPERT, "the expert\u2019s way"),
        (place.close, f'<path class="seek" d="{seek}"/>', "rewarded"),
        (place.close, f'<path class="avoid" d="{avoid}"/>', "punished; the fuller, the more"),
        (place.close, f'<path class="marked" d="{marked}"/>', "in an incorrect demonstration only"),
    ]
    return "".join(key_entry(*entry) for entry in entries)
