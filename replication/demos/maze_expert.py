"""The scripted expert in mazes: the rules behind the stored demonstrations.

The paper shows its demonstrations only as pictures, so ours follow rules, the same for every maze.
Each demonstration is a whole trajectory from the start:

``correct``
    Among the shortest paths the one whose straight legs are nearest to a given length (choice
    DEMO-SHAPE), or one drawn at random (choice DEMO-PATH).
``hit``
    Misses a turn: at a corner of the correct path it drives straight on until it bumps.
``detour``, ``near-detour``, ``far-detour``
    Takes a turn too wide: leaves the correct path in the middle of the leg before a corner, passes
    a point outside the corner, and rejoins the path in the middle of the leg after it. The choice
    DETOUR-WIDTH says how far outside; a near detour passes 1 cell off, a far one as far off as the
    walls allow. Where the point cannot be passed without turning back, the detour is narrower.
``opposite``
    Turns round just before the goal and drives the correct path back to the start.

There is one demonstration of each kind at each corner where the rule can be carried out (choice
INCORRECT-NUMBER).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import pairwise

import numpy as np

from replication.demos.model import Demo, Demos
from replication.envs.maze import Maze
from replication.paper.register import Chosen, choice


@dataclass(frozen=True)
class Expert(Chosen):
    """How the scripted expert drives the stored demonstrations."""

    leg: int = choice("DEMO-SHAPE")
    path: str = choice("DEMO-PATH")
    detour_width: int = choice("DETOUR-WIDTH")


MOVES = ((-1, 0), (1, 0), (0, 1), (0, -1))  # up, down, right, left
OPPOSITE = (1, 0, 3, 2)

Node = tuple[int, int, int]
"""A state, the action that led there, and how often it was taken in a row."""


def demonstrate(
    task: str, maze: Maze, *, params: Expert | None = None, description: str = ""
) -> Demos:
    """Return the demonstrations of all kinds for a maze."""
    params = params or Expert()
    if params.path == "legs":
        actions = correct_actions(maze, leg=params.leg)
    else:
        number = int(params.path.removeprefix("random-"))
        actions = random_actions(maze, seed=np.random.SeedSequence(number))
    return Demos(
        task=task,
        environment=maze,
        correct=(_drive(maze, actions, "correct", "correct"),),
        incorrect=tuple(incorrect_demos(maze, actions, params=params)),
        description=description,
    )


def correct_actions(maze: Maze, *, leg: int) -> list[int]:
    """Return the actions of the shortest path whose legs are nearest to `leg` moves.

    Nearest means the smallest sum of squared differences over the legs; among equals the action
    that comes first in the paper's order is taken first.
    """
    distances, next_state = maze.distances().tolist(), maze.next_state.tolist()

    def options(here: Node) -> list[Node]:
        state, last, run = here
        return [
            (there, action, run + 1 if action == last else 1)
            for action, there in enumerate(next_state[state])
            if distances[there] == distances[state] - 1
        ]

    layers: list[set[Node]] = [{(maze.start, -1, 0)}]
    for _ in range(distances[maze.start]):
        layers.append({there for here in layers[-1] for there in options(here)})
    cost = {(goal, last, run): (run - leg) ** 2 for goal, last, run in layers[-1]}
    following: dict[Node, Node] = {}
    for here in (node for layer in reversed(layers[:-1]) for node in layer):
        _, last, run = here
        costs = {}
        for there in options(here):
            turned = last not in (-1, there[1])
            costs[there] = cost[there] + ((run - leg) ** 2 if turned else 0)
        following[here] = min(costs, key=lambda there: (costs[there], there[1]))
        cost[here] = costs[following[here]]
    here, actions = (maze.start, -1, 0), []
    while here in following:
        here = following[here]
        actions.append(here[1])
    return actions


def random_actions(maze: Maze, *, seed: np.random.SeedSequence) -> list[int]:
    """Return the actions of a shortest path, each of them as likely as any other.

    Raises
    ------
    ValueError
        If there are more than 2**63 shortest paths.
    """
    distances, next_state = maze.distances().tolist(), maze.next_state.tolist()
    rng = np.random.default_rng(seed)

    def options(state: int) -> list[tuple[int, int]]:
        nearer = distances[state] - 1
        return [(a, s) for a, s in enumerate(next_state[state]) if distances[s] == nearer]

    ways = {maze.goal: 1}  # number of shortest paths from a state
    for state in sorted(range(maze.n_states), key=distances.__getitem__):
        if distances[state] > 0:
            ways[state] = sum(ways[there] for _, there in options(state))
    state, actions = maze.start, []
    while state != maze.goal:
        drawn = int(rng.integers(ways[state]))
        for action, there in options(state):
            if drawn < ways[there]:
                actions.append(action)
                state = there
                break
            drawn -= ways[there]
    return actions


def incorrect_demos(maze: Maze, correct: list[int], *, params: Expert) -> Iterator[Demo]:
    """Yield the incorrect demonstrations of every kind that belong to a correct one.

    INCORRECT-NUMBER: one of a kind for each corner where it can be driven.
    """
    corners = [t for t in range(1, len(correct)) if correct[t] != correct[t - 1]]
    widths = {"detour": params.detour_width, "near-detour": 1, "far-detour": max(maze.shape)}
    back = [OPPOSITE[action] for action in reversed(correct[:-1])]
    drives: dict[str, list[list[int] | None]] = {
        "hit": [_miss(maze, correct, corner) for corner in corners],
        **{
            kind: [_detour(maze, correct, corner, width) for corner in corners]
            for kind, width in widths.items()
        },
        "opposite": [correct[:-1] + back],
    }
    for kind, attempts in drives.items():
        for number, actions in enumerate(filter(None, attempts), start=1):
            yield _drive(maze, actions, f"{kind}-{number}", kind)


def _drive(maze: Maze, actions: list[int], name: str, kind: str) -> Demo:
    return Demo(name=name, kind=kind, states=maze.replay(actions), actions=np.array(actions))


def _miss(maze: Maze, correct: list[int], corner: int) -> list[int]:
    """Drive straight on at the corner until a move changes nothing."""
    actions = correct[:corner]
    while True:
        actions = [*actions, correct[corner - 1]]
        before, after = maze.replay(actions)[-2:]
        if before == after:
            return actions


def _detour(maze: Maze, correct: list[int], corner: int, width: int) -> list[int] | None:
    """Round the corner `width` cells outside, or as wide as it goes; None if not at all."""
    turns = [0, *(t for t in range(1, len(correct)) if correct[t] != correct[t - 1]), len(correct)]
    at = turns.index(corner)
    leave = (turns[at - 1] + corner) // 2
    join = (corner + turns[at + 1] + 1) // 2
    path = maze.replay(correct)
    row, column = maze.cell(int(path[corner]))
    ahead, back = correct[corner - 1], OPPOSITE[correct[corner]]
    for reach in range(width, 0, -1):
        point = (row, column)
        for action in (ahead, back):
            down, right = MOVES[action]
            point = point[0] + reach * down, point[1] + reach * right
        if not all(0 <= x < size for x, size in zip(point, maze.shape, strict=True)):
            continue
        a, b, c = int(path[leave]), maze.state(*point), int(path[join])
        out = _way(maze, a, b, set(path.tolist()) - {a, b})
        home = out and _way(maze, b, c, set(path.tolist()) - {b, c})
        way = [*(out or []), *(home or [])]
        if out and home and all(b != OPPOSITE[a] for a, b in pairwise(way)):
            return correct[:leave] + way + correct[join:]
    return None


def _way(maze: Maze, source: int, target: int, avoid: set[int]) -> list[int] | None:
    """Return the shortest way that keeps off `avoid`, or None.

    Among the shortest it is one with the fewest turns; ties in the order of the actions.
    """
    next_state = maze.next_state.tolist()
    moves = {target: 0}  # from a state to the target, as all moves can be undone
    waiting = [target]
    for state in waiting:  # it grows meanwhile
        for there in next_state[state]:
            if there not in moves and there not in avoid:
                moves[there] = moves[state] + 1
                waiting.append(there)
    if source not in moves or target in avoid:
        return None
    done: set[tuple[int, int]] = set()
    heap: list[tuple[int, list[int], int]] = [(0, [], source)]
    while True:
        turns, actions, state = heappop(heap)
        if state == target:
            return actions
        last = actions[-1] if actions else -1
        if (state, last) in done:
            continue
        done.add((state, last))
        for action, there in enumerate(next_state[state]):
            if moves.get(there) == moves[state] - 1:
                heappush(heap, (turns + (last not in (-1, action)), [*actions, action], there))
