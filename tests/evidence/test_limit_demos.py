from __future__ import annotations

from itertools import combinations, groupby, pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from replication import Maze
from replication.demos.maze_expert import Expert, correct_actions, random_actions
from replication.demos.model import Demo, Demos
from replication.envs.maze import as_maze
from replication.evidence import limit_demos
from replication.evidence.experiments import EXPERIMENTS
from replication.evidence.limit_demos import (
    contradictory,
    nearest,
    nearest_demo,
    noisy_actions,
    noisy_demos,
    open_demos,
    path_demos,
)
from replication.irl.expectations import feature_expectations
from replication.learning.seeds import child
from tests.envs.mazes import mazes

GAMMA = 0.9
TINY = Maze.from_text("..G\n...\nS..")
UP, DOWN, RIGHT, LEFT = range(4)
ROOMS = [TINY, Maze.from_text("...G\n....\n.#..\nS..."), Maze.from_text("S....\n..#..\n....G")]
STAIRS, CORNER = [UP, RIGHT, UP, RIGHT], [RIGHT, RIGHT, UP, UP]


def shown(maze: Maze, *ways: list[int]) -> Demos:
    """Return correct demonstrations of these actions."""
    demos = [
        Demo(str(at), "correct", maze.replay(way), np.array(way)) for at, way in enumerate(ways)
    ]
    return Demos("task", maze, tuple(demos))


def walks(maze: Maze, most: int) -> list[list[int]]:
    """Enumerate all walks of up to so many moves, cut at the goal or at the end."""
    found: list[list[int]] = []
    open_: list[list[int]] = [[]]
    for _ in range(most):
        open_ = [[*walk, action] for walk in open_ for action in range(4)]
        found += [walk for walk in open_ if maze.goal_step(walk) is not None]
        open_ = [walk for walk in open_ if maze.goal_step(walk) is None]
    return found + open_


WALKS = walks(TINY, 7)


def mu(maze: Maze, way: list[int]) -> Any:
    """Return discounted visits by the definition, one step at a time."""
    table = np.zeros((maze.n_states, 4))
    for t, (state, action) in enumerate(zip(maze.replay(way)[:-1], way, strict=True)):
        table[state, action] += GAMMA**t
    return table


VISITS = np.array([mu(TINY, walk).ravel() for walk in WALKS])


# --- different demonstrations ----------------------------------------------------------------


def test_paths_differ_and_are_shortest() -> None:
    """Each is another shortest path of the open maze, the next number has one more."""
    for draw in range(3):
        five = path_demos(5, draw)
        assert as_maze(five.environment).shape == (20, 20)
        assert [len(demo.actions) for demo in five.correct] == [31] * 5
        assert all(
            a.actions.tolist() != b.actions.tolist() for a, b in combinations(five.correct, 2)
        )
        assert path_demos(3, draw).correct == five.correct[:3]
        assert path_demos(5, draw) == five
    assert len({path_demos(1, draw).correct for draw in range(5)}) == 5


def test_what_is_drawn_twice_counts_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A path that comes again is not taken for another one, and each draw has its own seed."""
    drawn, seeds = iter([STAIRS, STAIRS, STAIRS, CORNER]), []

    def random_actions(maze: Maze, *, seed: np.random.SeedSequence) -> list[int]:
        seeds.append(seed.spawn_key)
        return next(drawn)

    monkeypatch.setattr(limit_demos, "random_actions", random_actions)
    monkeypatch.setattr(limit_demos, "_stored", lambda: shown(TINY, STAIRS))
    assert [demo.actions.tolist() for demo in path_demos(2, 0).correct] == [STAIRS, CORNER]
    assert len(set(seeds)) == 4


def test_draws_are_of_the_declared_root() -> None:
    """Each design has its own branch of it, and each draw a branch of that."""
    root = np.random.SeedSequence(18)
    maze, path = as_maze(limit_demos._stored().environment), limit_demos._stored().correct[0]
    for draw in (0, 3):
        paths, noise = (child(child(root, design), draw) for design in (0, 1))
        drawn = random_actions(maze, seed=child(paths, 0))
        assert path_demos(1, draw).correct[0].actions.tolist() == drawn
        slipped = noisy_actions(maze, path, 0.2, seed=noise)
        assert noisy_demos(0.2, draw).correct[0].actions.tolist() == slipped


# --- noisy demonstrations --------------------------------------------------------------------


def test_without_slips_it_is_the_plain_demonstration() -> None:
    """At level 0 each draw is the stored path."""
    stored = limit_demos._stored().correct[0].actions.tolist()
    assert EXPERIMENTS["open-maze"].demos.name == "open_maze.json"
    assert [noisy_demos(0.0, draw).correct[0].actions.tolist() for draw in (0, 7)] == [stored] * 2


@settings(max_examples=50)
@given(mazes(), st.sampled_from([0.1, 0.3, 0.6]), st.integers(0, 100))
def test_noisy_drives_reach_the_goal(maze: Maze, level: float, number: int) -> None:
    """In any maze, by steps that lead nearer but for the slips; the same again by the same seed."""
    (path,) = shown(maze, correct_actions(maze, leg=4)).correct
    seed = np.random.SeedSequence(number)
    way = noisy_actions(maze, path, level, seed=seed)
    assert maze.goal_step(way) == len(way)
    assert noisy_actions(maze, path, level, seed=np.random.SeedSequence(number)) == way
    distances, states = maze.distances(), maze.replay(way)
    draws = np.random.default_rng(seed)
    for t, (here, there) in enumerate(pairwise(states.tolist())):
        slips, _ = draws.random() < level, draws.integers(1, 4)
        nearer = distances[there] == distances[here] - 1
        assert slips or nearer
        expected = dict(zip(path.states[:-1].tolist(), path.actions.tolist(), strict=True))
        if here in expected:
            assert (way[t] == expected[here]) != slips
        else:
            ahead = distances[maze.next_state[here]].tolist()
            assert (way[t] == ahead.index(distances[here] - 1)) != slips


def test_slips_are_as_frequent_as_their_level_and_take_each_other_action() -> None:
    """Of the steps on the path a share of the level leaves it, a third by each other action."""
    (path,) = shown(TINY, STAIRS).correct
    counts = np.zeros(4)
    for number in range(3000):
        first = noisy_actions(TINY, path, 0.3, seed=np.random.SeedSequence(number))[0]
        counts[first] += 1
    np.testing.assert_allclose(counts / 3000, [0.7, 0.1, 0.1, 0.1], atol=0.03)


def test_contradictions_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A demonstration counts if it takes two actions in a state; the level raises their number."""
    monkeypatch.setattr(limit_demos, "LOOKED_AT", 60)
    expected = 0
    for draw in range(60):
        (demo,) = noisy_demos(0.1, draw).correct
        pairs = set(zip(demo.states[:-1].tolist(), demo.actions.tolist(), strict=True))
        expected += len(pairs) > len({state for state, _ in pairs})
    assert contradictory(0.1) == expected
    assert contradictory(0.0) == 0 < expected < contradictory(0.4) <= 60


# --- larger mazes ----------------------------------------------------------------------------


@pytest.mark.parametrize("side", [2, 5, 10, 20, 30])
def test_legs_are_as_even_as_the_experts(side: int) -> None:
    """From corner to corner by a shortest path, whose legs cost as little as any; up first."""

    def cost(actions: list[int]) -> int:
        return sum((len(list(leg)) - Expert().leg) ** 2 for _, leg in groupby(actions))

    demos = open_demos(side)
    maze = as_maze(demos.environment)
    assert maze.shape == (side, side)
    assert maze.free.all()
    assert maze.cell(maze.start) == (side - 1, 0)
    assert maze.cell(maze.goal) == (0, side - 1)
    own = demos.correct[0].actions.tolist()
    assert len(own) == 2 * (side - 1)
    assert own[0] == UP
    assert cost(own) == cost(correct_actions(maze, leg=Expert().leg))


# --- how near one trajectory can come --------------------------------------------------------


@pytest.mark.parametrize(
    "ways",
    [
        [STAIRS],
        [STAIRS, CORNER],
        [STAIRS, [UP, UP, RIGHT, RIGHT]],
        [STAIRS, CORNER, [RIGHT, UP, UP, RIGHT]],
        [STAIRS, CORNER, [UP, UP, RIGHT, RIGHT], [RIGHT, UP, RIGHT, UP], [UP, RIGHT, RIGHT, UP]],
    ],
)
def test_nearest_by_brute_force(ways: list[list[int]]) -> None:
    """In a tiny maze no walk at all of up to seven moves is nearer than the nearest shortest."""
    demos = shown(TINY, *ways)
    mu_e = np.mean([mu(TINY, way) for way in ways], axis=0)
    distances = np.linalg.norm(VISITS - mu_e.ravel(), axis=1)
    every = {tuple(walk): float(d) for walk, d in zip(WALKS, distances, strict=True)}
    found = nearest(demos, gamma=GAMMA)
    assert found == pytest.approx(min(d for walk, d in every.items() if len(walk) == 4))
    assert found == pytest.approx(min(every.values()))
    assert nearest_demo(demos, gamma=GAMMA) == pytest.approx(min(every[tuple(w)] for w in ways))


def test_nearest_is_a_shortest_path_though_the_demonstration_is_none() -> None:
    """One that turns away from the goal on its way is not followed there."""
    turns = [UP, RIGHT, DOWN, RIGHT, UP, UP]
    shortest = [walk for walk in WALKS if len(walk) == 4]
    least = min(float(np.linalg.norm(mu(TINY, turns) - mu(TINY, walk))) for walk in shortest)
    assert nearest(shown(TINY, turns), gamma=GAMMA) == pytest.approx(least)
    assert nearest_demo(shown(TINY, turns), gamma=GAMMA) == 0 < least


EVERY = [
    [UP if t in ups else RIGHT for t in range(6)] for ups in combinations(range(6), 3)
]  # of a room of 4 x 4


@pytest.mark.parametrize("root", range(40))
def test_nearest_of_every_shortest_path(root: int) -> None:
    """Where several share some of their way, the nearest may be none of them."""
    room = Maze.from_text("...G\n....\n....\nS...")
    chosen = np.random.default_rng(np.random.SeedSequence(root)).permutation(20)[: 3 + root % 5]
    ways = [EVERY[at] for at in chosen]
    mu_e = np.mean([mu(room, way) for way in ways], axis=0)
    least = min(float(np.linalg.norm(mu_e - mu(room, way))) for way in EVERY)
    assert nearest(shown(room, *ways), gamma=GAMMA) == pytest.approx(least)


@settings(max_examples=100)
@given(mazes(), st.integers(1, 5), st.integers(0, 1000))
def test_nearest_is_no_farther_than_a_demonstration(maze: Maze, number: int, root: int) -> None:
    """It is zero for one way alone, and above zero for several."""
    seeds = np.random.SeedSequence(root).spawn(number)
    ways = {tuple(random_actions(maze, seed=seed)) for seed in seeds}
    demos = shown(maze, *map(list, ways))
    d = nearest(demos, gamma=GAMMA)
    assert d <= nearest_demo(demos, gamma=GAMMA) + 1e-12
    assert (d > 0) == (len(ways) > 1)


@settings(max_examples=200)
@given(st.sampled_from(ROOMS), st.integers(0, 1000), st.data())
def test_nothing_is_at_zero_from_two_different_ways(maze: Maze, root: int, data: Any) -> None:
    """No walk, shortest or not, has the expectations of two demonstrations that differ."""
    seeds = np.random.SeedSequence(root).spawn(2)
    ways = [random_actions(maze, seed=seed) for seed in seeds]
    assume(ways[0] != ways[1])
    mu_e = np.mean([mu(maze, way) for way in ways], axis=0)
    start = data.draw(st.sampled_from(ways))  # most walks that differ at once are far off anyway
    walk = start[: data.draw(st.integers(0, len(start)))]
    walk += data.draw(st.lists(st.integers(0, 3), max_size=20))
    end = maze.goal_step(walk)
    walk = walk[:end]
    states = maze.replay(walk)
    own = feature_expectations(states, np.array(walk, int), gamma=GAMMA, shape=mu_e.shape)
    t = next(t for t, (a, b) in enumerate(zip(*ways, strict=True)) if a != b)
    assert np.linalg.norm(mu_e - own) >= GAMMA**t / 2 - 1e-12
