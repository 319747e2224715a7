"""Moving figures with buttons and a slider, as HTML that needs nothing from elsewhere.

The page is the template `player.html`. It works inside another page, inside a notebook, several
times on one page, and as a file of its own; so it is ASCII, and names nothing but itself.
"""

from __future__ import annotations

import hashlib
import html
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import pandas as pd

from replication.files import read_text

TEMPLATE = Path(__file__).with_name("player.html")


@dataclass(frozen=True)
class Player:
    """A moving figure as HTML, its numbers, and what it shows in words."""

    html: str
    numbers: pd.DataFrame
    words: str


def player_page(content: Mapping[str, Any], words: str) -> str:
    """Return a player as HTML.

    Parameters
    ----------
    content
        `title`; `unit`, what a frame is called; `rate`, frames a second; `continuous`: whether each
        frame goes on where the one before ends, so that ways grow and movers glide.
        `view`, the view box of a panel; `still` and `movers`, what stands and what moves, as SVG;
        `key`, what it means, as HTML; `chart`, the title of the errors' axis, or "".
        `marks`, or None: a place has a number, from which its cell (so many `columns` of a `size`)
        and its direction there (`turns`) follow; `shapes` are drawn where something is rewarded,
        punished and in the list `marked`; a reward has one of so many `levels`.
        `choices`, each with `name`, `options` and the option at the `start`; and `plays`, one for
        each combination of options, the last choice varying first: `text` and `panels`. A panel has
        `name`, `colour`, `wide` (of its curve), whether it is `marked`, `errors` and `frames`. A
        frame is the way as the `d` of a path, the status in words, x, y and angle of each mover,
        and the rewards that change, as `place:level`; or None: as that of the first panel.
    words
        What stands there where scripts do not run.
    """
    data = json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")
    said = html.escape(words).encode("ascii", "xmlcharrefreplace").decode()
    id = hashlib.sha256(f"{data}{said}".encode()).hexdigest()[:12]
    page = read_text(TEMPLATE).replace("@ID@", id)
    return page.replace("@WORDS@", said).replace("@DATA@", data)


def key_entry(view: str, drawn: str, name: str) -> str:
    """Return what something that is drawn means, as HTML."""
    return f'<span><svg viewBox="{view}" aria-hidden="true">{drawn}</svg>{html.escape(name)}</span>'


def path(points: Iterable[tuple[int, int]]) -> str:
    """Return a way as the `d` of an SVG path: each line once, and only its corners.

    Examples
    --------
    >>> path([(0, 0), (1, 0), (2, 0), (2, 0), (2, 5), (2, 0)])
    'M0 0L2 0 2 5'
    >>> path([(0, 0), (1, 0), (0, 0), (0, 3)])
    'M0 0L1 0M0 0L0 3'
    >>> path([(4, 4)])
    'M4 4'
    """
    points = list(points)
    seen, lines = set(), [[points[0]]]
    for one, other in pairwise(points):
        edge = frozenset((one, other))
        if edge in seen or one == other:
            continue
        seen.add(edge)
        if lines[-1][-1] != one:
            lines.append([one])
        line = lines[-1]
        if len(line) > 1 and _direction(line[-2], line[-1]) == _direction(one, other):
            line[-1] = other
        else:
            line.append(other)
    parts = [[f"{x} {y}" for x, y in line] for line in lines if len(line) > 1 or len(lines) == 1]
    return "".join(f"M{first}" + (f"L{' '.join(rest)}" if rest else "") for first, *rest in parts)


def _direction(one: tuple[int, int], other: tuple[int, int]) -> tuple[int, int]:
    """Return the sign of a step along an axis; of a slanted one, all of it."""
    x, y = other[0] - one[0], other[1] - one[1]
    return (x, y) if x and y else ((x > 0) - (x < 0), (y > 0) - (y < 0))
