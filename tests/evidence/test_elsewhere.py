from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from numpy.typing import NDArray

from replication.baselines import table_of
from replication.demos.maze_expert import Expert
from replication.envs.maze import Maze
from replication.evidence.elsewhere import CHANGES, GAMMA, World, moved_goal, moves_of, worlds
from replication.evidence.specifications import MAPS
from replication.evidence.transfer import ANOTHER
from replication.evidence.variations import maze_demos
from replication.learning.planning import plan
from tests.envs.mazes import mazes

UP, DOWN, RIGHT, LEFT = range(4)

BEND = Maze.from_text("""
    ..G
    .#.
    S..
""")
OTHER = Maze.from_text("""
    #.G
    ...
    S..
""")
CHANGED = worlds(BEND, OTHER)

Array = NDArray[np.float64]


def dense(world: World) -> Array:
    """Return the probabilities of the table, [state, action, successor]."""
    moves = world.moves
    table = np.zeros((*moves.shape, moves.shape[0]))
    for pair in range(moves.shape[0] * moves.shape[1]):
        for k in range(moves.first[pair], moves.first[pair + 1]):
            table[(*divmod(pair, moves.shape[1]), moves.successors[k])] += moves.probabilities[k]
    return table


def solved(world: World, policy: Array) -> float:
    """Return the value of a policy by a linear system, (I - gamma P) V = -1."""
    go_on = np.where(world.moves.ends, 0.0, 1.0)
    ahead = np.einsum("sa,sat->st", policy, dense(world)) * go_on
    v = np.linalg.solve(np.eye(len(ahead)) - GAMMA * ahead, np.full(len(ahead), -1.0))
    starts = world.moves.probabilities[world.moves.first[-2] :]
    return float(starts @ v[world.moves.starts])


def way(world: World, *actions: int) -> Array:
    """Return the policy that takes these actions in the first states, and then up."""
    chosen = np.zeros(world.moves.shape[0], int)
    chosen[: len(actions)] = actions
    return np.eye(4)[chosen]


def test_a_corridor_by_hand() -> None:
    """The value is minus the discounted number of moves, 10 if they never end."""
    corridor = Maze(("S..G",))
    world = World(corridor, moves_of(corridor))
    assert world.value(way(world, RIGHT, RIGHT, RIGHT)) == pytest.approx(-(1 + 0.9 + 0.81))
    assert world.value(way(world, LEFT, LEFT, LEFT)) == pytest.approx(-10)
    assert world.best == pytest.approx(-2.71)
    starts = np.array([0, 0.5, 0.5, 0])
    world = World(corridor, moves_of(corridor, starts=starts))
    assert world.best == pytest.approx(-(1 + 1.9) / 2)


@settings(max_examples=40, deadline=None)
@given(mazes(5))
@example(Maze(("G.#", "...", ".S.")))  # with slips the best way depends on the discount
def test_values_are_those_of_a_linear_system(maze: Maze) -> None:
    """In every changed world, for a policy of chance, for random moves, and for the best of all."""
    rng = np.random.default_rng(maze.n_states)
    for name, world in worlds_of(maze).items():
        policy = rng.dirichlet(np.ones(4), maze.n_states)
        assert world.value(policy) == pytest.approx(solved(world, policy), rel=1e-9), name
        assert world.random == pytest.approx(solved(world, np.full((maze.n_states, 4), 0.25)))
        assert world.best == pytest.approx(
            planned(world, np.full((maze.n_states, 4), -1.0)), rel=1e-9
        )


@settings(max_examples=40, deadline=None)
@given(mazes(5))
def test_what_follows_a_reward_is_best_by_it(maze: Maze) -> None:
    """In every changed world no policy earns more of a reward than the one that follows it."""
    weights = np.random.default_rng(maze.n_states).normal(size=(maze.n_states, 4))
    for name, world in worlds_of(maze).items():
        earned = (world.visits(world.follow(weights)) * weights).sum()
        assert earned == pytest.approx(planned(world, weights), abs=1e-6), name


def planned(world: World, weights: Array) -> float:
    """Return the greatest value by a reward, by plain value iteration."""
    values = plan(weights, world.moves.ahead, gamma=GAMMA).max(axis=1)
    starts = world.moves.probabilities[world.moves.first[-2] :]
    return float(starts @ values[world.moves.starts])


def worlds_of(maze: Maze) -> dict[str, World]:
    """Return the changed worlds that a small maze has: there may be no other start."""
    few = {"none": World(maze, moves_of(maze)), "slip": World(maze, moves_of(maze, slip=0.3))}
    if ((maze.distances() > 0).sum()) > 1:
        few |= worlds(maze, maze)
    return few


@pytest.mark.parametrize("change", CHANGES)
def test_the_true_reward_loses_nothing_and_random_moves_all(change: str) -> None:
    """Both ends of the measure stand where it says, in each changed world."""
    world = CHANGED[change]
    assert world.lost(world.follow(np.full(world.moves.shape, -1.0))) == 0
    assert world.lost(np.full(world.moves.shape, 0.25)) == 1


@pytest.mark.parametrize("task", MAPS)
def test_the_demonstration_is_optimal(task: str) -> None:
    """In each task nobody is nearer to the goal than the expert: the right answer is known."""
    demos = maze_demos(task, Expert())
    maze = demos.environment
    assert isinstance(maze, Maze)
    world = World(maze, moves_of(maze))
    (correct,) = demos.correct
    policy = np.eye(4)[np.zeros(maze.n_states, int)]
    policy[correct.states[:-1]] = np.eye(4)[correct.actions]
    assert len(correct.actions) == maze.distances()[maze.start]
    assert world.lost(policy) == pytest.approx(0, abs=1e-12)


def test_a_table_is_that_of_the_maze() -> None:
    """Without slips it is the table with which a method learns."""
    own, known = moves_of(BEND), table_of(BEND)
    assert known is not None
    for one, other in zip(own, known, strict=True):
        np.testing.assert_array_equal(one, other)


def test_slips_by_hand() -> None:
    """A move goes across with the chance of a slip, half of it to either side, and may bump."""
    table = dense(World(BEND, moves_of(BEND, slip=0.2)))
    start, above, beside = BEND.start, BEND.state(1, 0), BEND.state(2, 1)
    wanted = np.zeros((4, 9))
    wanted[UP, [above, beside, start]] = 0.8, 0.1, 0.1
    wanted[DOWN, [start, beside]] = 0.9, 0.1
    wanted[RIGHT, [beside, above, start]] = 0.8, 0.1, 0.1
    wanted[LEFT, [start, above]] = 0.9, 0.1
    np.testing.assert_allclose(table[start], wanted)
    np.testing.assert_allclose(table.sum(axis=2), 1)


def test_slips_grow() -> None:
    """Worlds have the chance that their name says, and the more of it the worse at best."""
    for chance in (0.1, 0.2, 0.3):
        table = dense(CHANGED[f"slip {chance}"])
        assert table[BEND.start, UP, BEND.state(1, 0)] == pytest.approx(1 - chance)
    best = [CHANGED[name].best for name in ("none", "slip 0.1", "slip 0.2", "slip 0.3")]
    assert (np.diff(best) < 0).all()


def test_other_starts_are_all_others() -> None:
    """Each free cell but start and goal begins alike; a cell without a way to the goal does not."""
    moves = CHANGED["other starts"].moves
    assert moves.starts.tolist() == [0, 1, 3, 5, 7, 8]
    np.testing.assert_allclose(moves.probabilities[moves.first[-2] :], 1 / 6)
    enclosed = Maze.from_text("""
        .#.
        #SG
        ...
    """)
    assert worlds(enclosed, enclosed)["other starts"].moves.starts.tolist() == [2, 6, 7, 8]


def test_maps_by_hand() -> None:
    """The mirrored map, the moved goal and the other map are what their names say."""
    assert CHANGED["mirrored map"].maze.rows == ("G..", ".#.", "..S")
    assert CHANGED["another map"].maze == OTHER
    assert moved_goal(BEND).rows == ("G..", ".#.", "S..")  # 2 from either; so is the other corner
    assert moved_goal(Maze(("S...G..",))).rows == ("S.G....",)
    for name in ("mirrored map", "moved goal", "another map"):
        world = CHANGED[name]
        assert world.moves.starts.tolist() == [world.maze.start]
        assert np.flatnonzero(world.moves.ends).tolist() == [world.maze.goal]


def test_a_mirrored_map_has_the_mirrored_answer() -> None:
    """It is worth the same, and the expert's own moves fail there."""
    own, mirrored = CHANGED["none"], CHANGED["mirrored map"]
    assert mirrored.best == pytest.approx(own.best)
    assert mirrored.random == pytest.approx(own.random)
    policy = own.follow(np.full(own.moves.shape, -1.0))
    exchanged = policy.reshape(3, 3, 4)[:, ::-1][:, :, [UP, DOWN, LEFT, RIGHT]].reshape(9, 4)
    assert mirrored.lost(exchanged) == pytest.approx(0, abs=1e-12)
    assert mirrored.lost(policy) > 0.9


def test_changes_are_all_there_and_the_other_map_is_another() -> None:
    """The names are the worlds; the map of another task has the same size, start and goal."""
    assert tuple(CHANGED) == CHANGES
    another = maze_demos(ANOTHER, Expert()).environment
    assert isinstance(another, Maze)
    for task in MAPS:
        maze = maze_demos(task, Expert()).environment
        assert isinstance(maze, Maze)
        assert (maze.shape, maze.start, maze.goal) == (another.shape, another.start, another.goal)
        assert maze.rows != another.rows
