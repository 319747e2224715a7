from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator, Set
from itertools import groupby, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from replication import Demos, Maze, demonstrate
from replication.demos.maze_expert import OPPOSITE, Expert, _way, correct_actions, random_actions
from replication.envs.maze import as_maze
from replication.paper.published import MOVES
from tests.envs.mazes import mazes

STEPS = ((-1, 0), (1, 0), (0, 1), (0, -1))  # up, down, right, left
DETOURS = ("detour", "near-detour", "far-detour")
LEGS = [1, 2, 4, 8, 16]
START, GOAL = (17, 2), (2, 18)  # of both stored mazes


def shortest(rows: tuple[str, ...]) -> int:
    """Count the moves from S to G on the text of a map, by breadth-first search."""
    cells = {(r, c): x for r, row in enumerate(rows) for c, x in enumerate(row) if x != "#"}
    (start,) = (cell for cell, x in cells.items() if x == "S")
    moves, queue = {start: 0}, deque([start])
    while queue:
        row, column = queue.popleft()
        if cells[row, column] == "G":
            return moves[row, column]
        for down, right in STEPS:
            there = row + down, column + right
            if there in cells and there not in moves:
                moves[there] = moves[row, column] + 1
                queue.append(there)
    raise AssertionError("the goal cannot be reached")


def all_ways(maze: Maze, state: int, left: int) -> Iterator[list[int]]:
    """Enumerate all ways of exactly `left` moves from a state to the goal."""
    if state == maze.goal:
        if left == 0:
            yield []
        return
    if left >= maze.distances()[state]:
        for action, there in enumerate(maze.next_state[state].tolist()):
            for rest in all_ways(maze, there, left - 1):
                yield [action, *rest]


def ways_around(maze: Maze, source: int, avoid: Set[int]) -> dict[int, list[list[int]]]:
    """Enumerate the shortest ways from a state to each other that keep off `avoid`."""
    found: dict[int, list[list[int]]] = {}
    layer: dict[int, list[list[int]]] = {source: [[]]}
    while layer:
        found |= layer
        following: dict[int, list[list[int]]] = {}
        for state, ways in layer.items():
            for action, there in enumerate(maze.next_state[state].tolist()):
                if there not in found and there not in avoid:
                    following.setdefault(there, []).extend([*way, action] for way in ways)
        layer = following
    return found


def turns(actions: list[int]) -> int:
    """Count the turns of a way."""
    return sum(a != b for a, b in pairwise(actions))


def cost(actions: list[int], leg: int) -> int:
    """Sum the squared differences of the legs' lengths from `leg`."""
    return sum((len(list(moves)) - leg) ** 2 for _, moves in groupby(actions))


def test_stored_files_follow_from_the_rules(stored_demos: Demos) -> None:
    """A stored file is what the expert makes of its map with the registered parameters."""
    maze, text = as_maze(stored_demos.environment), stored_demos.description
    assert demonstrate(stored_demos.task, maze, description=text) == stored_demos


def test_stored_mazes_are_the_papers(stored_demos: Demos) -> None:
    """20 x 20 cells, start and goal in both; 31 and 33 moves, and no way in the map is shorter."""
    maze, (correct,) = as_maze(stored_demos.environment), stored_demos.correct
    assert maze.shape == (20, 20)
    assert (maze.cell(maze.start), maze.cell(maze.goal)) == (START, GOAL)
    assert maze.free.all() == (stored_demos.task == "open-maze")
    assert len(correct.actions) == MOVES[stored_demos.task] == shortest(maze.rows)


@given(maze=mazes(5), leg=st.sampled_from(LEGS))
@settings(max_examples=150, deadline=None)
def test_legs_are_the_best_of_all_shortest_paths(maze: Maze, leg: int) -> None:
    """Of all shortest paths, the expert's has the least cost, and comes first among equals."""
    ways = list(all_ways(maze, maze.start, shortest(maze.rows)))
    assert correct_actions(maze, leg=leg) == min(ways, key=lambda way: (cost(way, leg), way))


@pytest.mark.parametrize(
    ("leg", "due"),
    [(1, "0202020202"), (2, "0022002022"), (4, "0000022222"), (16, "0000022222")],
)
def test_leg_shapes(leg: int, due: str) -> None:
    """In an empty square, short legs make a staircase and long ones a single corner."""
    maze = Maze((".....G", *["......"] * 4, "S....."))
    found = correct_actions(maze, leg=leg)
    assert cost(found, leg) <= cost([int(action) for action in due], leg)
    if leg != 2:
        assert "".join(map(str, found)) == due


def test_long_mazes_do_not_exhaust_the_stack() -> None:
    """A corridor of the greatest length is driven from end to end."""
    assert correct_actions(Maze(("S" + "." * 998 + "G",)), leg=4) == [2] * 999


@given(maze=mazes(), seed=st.integers(0, 2**32))
@settings(max_examples=100, deadline=None)
def test_random_paths_are_shortest(maze: Maze, seed: int) -> None:
    """A random path reaches the goal in the fewest moves, and the same seed gives the same one."""
    actions, again = (random_actions(maze, seed=np.random.SeedSequence(seed)) for _ in range(2))
    assert len(actions) == shortest(maze.rows)
    assert maze.goal_step(actions) == len(actions)
    assert actions == again


@pytest.mark.parametrize(
    "rows", [("..G", "...", "S.."), ("...G", "...#", "....", "S..."), ("G.#.", "....", ".S..")]
)
def test_random_paths_are_equally_likely(rows: tuple[str, ...]) -> None:
    """Every shortest path occurs, as often as the others: chi-square at the level 0.001."""
    maze = Maze(rows)
    ways = {tuple(way) for way in all_ways(maze, maze.start, shortest(rows))}
    each = 200
    seeds = np.random.SeedSequence(1).spawn(each * len(ways))
    counts = Counter(tuple(random_actions(maze, seed=seed)) for seed in seeds)
    assert set(counts) == ways
    statistic = sum((count - each) ** 2 / each for count in counts.values())
    assert chi2.sf(statistic, len(ways) - 1) > 0.001


def test_too_many_paths_to_number_are_refused() -> None:
    """Beyond 2**63 shortest paths none is drawn, rather than some never."""
    size = 40
    rows = ("." * (size - 1) + "G", *["." * size] * (size - 2), "S" + "." * (size - 1))
    with pytest.raises(ValueError, match="high"):
        random_actions(Maze(rows), seed=np.random.SeedSequence(1))


@pytest.mark.parametrize("number", [1, 2, 3])
def test_demonstrations_along_a_random_path(stored_demos: Demos, number: int) -> None:
    """DEMO-PATH random-n: the correct demonstration is the path of seed n, the rules go on."""
    demos = demonstrate(
        "t", as_maze(stored_demos.environment), params=Expert(path=f"random-{number}")
    )
    due = random_actions(as_maze(stored_demos.environment), seed=np.random.SeedSequence(number))
    assert demos.correct[0].actions.tolist() == due
    assert len(due) == MOVES[stored_demos.task]
    check_kinds(demos)


@given(maze=mazes(6), data=st.data())
@settings(max_examples=150, deadline=None)
def test_ways_are_shortest_with_the_fewest_turns(maze: Maze, data: st.DataObject) -> None:
    """Of all shortest ways around what is avoided it is the one with the fewest turns."""
    source = data.draw(st.integers(0, maze.n_states - 1))
    avoid = data.draw(st.frozensets(st.integers(0, maze.n_states - 1), max_size=8)) - {source}
    due = {
        state: min(ways, key=lambda way: (turns(way), way))
        for state, ways in ways_around(maze, source, avoid).items()
    }
    for target in range(maze.n_states):
        assert _way(maze, source, target, set(avoid)) == due.get(target)


def test_hits_miss_each_corner() -> None:
    """In a map solved by hand: straight on at each of two corners, until a move changes nothing."""
    demos = demonstrate("t", Maze(("..#G", ".##.", "S...")), params=Expert(leg=4))
    assert demos.correct[0].actions.tolist() == [2, 2, 2, 0, 0]
    (hit,) = demos.select("hit").incorrect
    assert hit.actions.tolist() == [2, 2, 2, 2]
    assert hit.states.tolist() == [8, 9, 10, 11, 11]


def test_near_detour_passes_the_cell_outside_the_corner() -> None:
    """In a map solved by hand, the way leaves mid-leg, rounds the corner and joins mid-leg."""
    maze = Maze((".......", ".....G.", ".......", ".......", ".S....."))
    demos = demonstrate("t", maze, params=Expert(leg=4))
    assert demos.correct[0].actions.tolist() == [0, 0, 0, 2, 2, 2, 2]
    (near,) = demos.select("near-detour").incorrect
    assert near.actions.tolist() == [0, 3, 0, 0, 0, 2, 2, 2, 1, 2, 2]
    assert maze.state(0, 0) in near.states


def test_a_detour_is_narrower_where_it_has_to_be() -> None:
    """Wide detours keep to the map; where not even one cell fits, there is none."""
    rows = ("........", "......G.", "........", "........", "..S.....", "........")
    demos = demonstrate("t", Maze(rows), params=Expert(leg=4, detour_width=8))
    (near,), (wide,) = (demos.select(kind).incorrect for kind in ("near-detour", "detour"))
    assert wide.actions.tolist() == near.actions.tolist()
    edge = demonstrate("t", Maze(("...G", "....", "S...")), params=Expert(leg=4))
    assert not set(DETOURS) & set(edge.kinds)


@given(maze=mazes(), leg=st.sampled_from(LEGS), path=st.sampled_from(["legs", "random-1"]))
@settings(max_examples=150, deadline=None)
def test_demonstrations_of_any_maze(maze: Maze, leg: int, path: str) -> None:
    """Each kind keeps its rule in any maze; `Demos` itself checks that all moves are possible."""
    check_kinds(demonstrate("t", maze, params=Expert(leg=leg, path=path)))


def test_demonstrations_of_the_stored_mazes(stored_demos: Demos) -> None:
    """Each kind keeps its rule in the paper's mazes, and each of the six kinds is there."""
    check_kinds(stored_demos)
    assert set(stored_demos.kinds) == {"hit", *DETOURS, "opposite"}
    corners = sum(a != b for a, b in pairwise(stored_demos.correct[0].actions))
    for kind in stored_demos.kinds:
        number = len(stored_demos.select(kind).incorrect)
        assert number == 1 if kind == "opposite" else 1 <= number <= corners


def check_kinds(demos: Demos) -> None:
    """Assert what tells each kind of incorrect demonstration."""
    maze, (correct,) = as_maze(demos.environment), demos.correct
    actions = correct.actions.tolist()
    corners = [t for t, (a, b) in enumerate(pairwise(actions), start=1) if a != b]
    for demo in demos.incorrect:
        taken = demo.actions.tolist()
        if demo.kind == "hit":
            assert demo.states[-1] == demo.states[-2]
            assert (demo.states[1:-1] != demo.states[:-2]).all()
            missed = [
                c for c in corners if taken == actions[:c] + actions[c - 1 : c] * (len(taken) - c)
            ]
            assert missed
        elif demo.kind in DETOURS:
            assert demo.states[-1] == maze.goal
            assert len(taken) >= len(actions) + 4
            assert all(b != OPPOSITE[a] for a, b in pairwise(taken))
            assert (demo.states[1:] != demo.states[:-1]).all()
        else:
            assert demo.kind == "opposite"
            out = len(actions) - 1
            assert taken[:out] == actions[:out]
            assert demo.states.tolist() == [*correct.states[:-1], *correct.states[-3::-1]]
