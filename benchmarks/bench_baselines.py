"""The speed of the other methods: one fit of each, and maximum entropy beside that of `imitation`.

The peer is optional and outside the lock: it asks for a Gymnasium before 1.0, which this package
cannot use. What is called here works with a newer one, too, so the peer goes into an environment of
its own, where pip warns of the conflict::

    python3 -m venv build/peer
    build/peer/bin/pip install imitation==1.0.1 pytest
    build/peer/bin/pip install --upgrade stable-baselines3 --editable .
    build/peer/bin/python -m pytest benchmarks/bench_baselines.py -s

Times are those of the calling thread, so that what else the machine does hardly shows. Run as
``make bench``.
"""

from collections.abc import Callable
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.bench_qlearning import ROUNDS
from replication import BASELINES, METHODS, Maze, fit, load_demos
from replication.baselines import Problem, max_entropy, table_of
from replication.files import PROJECT

Array = NDArray[Any]

DEMOS = PROJECT / "data" / "demos"
GAMMA = 0.9
STEPS = 5  # of the peer's training in each round, which ends by planning once more


def test_fits() -> None:
    """Every method ends; shown are the seconds of a fit that plans, and d (Eq. 6) at its end."""
    other, demos = (load_demos(DEMOS / f"{maze}.json") for maze in ("obstacle_maze", "open_maze"))
    print(f"\n{'open maze, 20 x 20':20} seconds        d")
    for method in (*METHODS, *BASELINES):
        fit(other, method=method, solver="planning")  # compiles
        begin = thread_time()
        result = fit(demos, method=method, solver="planning")
        print(f"{method:20} {thread_time() - begin:7.4f} {result.error:8.3g}")
        assert result.converged or result.iterations == 1  # all loops end with d = 0


def peers_maze(maze: Maze, horizon: int) -> Any:
    """Return the maze as the peer takes it: a dense table, in which one stays at the goal."""
    places = np.eye(maze.n_states)
    transitions = places[maze.next_state]
    transitions[maze.goal] = places[maze.goal]
    return pytest.importorskip("seals.base_envs").TabularModelPOMDP(
        transition_matrix=transitions,
        observation_matrix=places,
        reward_matrix=np.zeros(maze.n_states),
        horizon=horizon,
        initial_state_dist=places[maze.start],
    )


def peers_training(env: Any, target: Array, folder: Path) -> Any:
    """Return the peer's method with a reward for each state and visits that it is to match."""
    uses = {"use_action": False, "use_next_state": False, "use_done": False}
    nets = pytest.importorskip("imitation.rewards.reward_nets")
    return pytest.importorskip("imitation.algorithms.mce_irl").MCEIRL(
        target,
        env,
        nets.BasicRewardNet(env.observation_space, env.action_space, hid_sizes=(), **uses),
        np.random.default_rng(1),
        discount=GAMMA,
        log_interval=None,
        custom_logger=pytest.importorskip("imitation.util.logger").configure(folder, ["log"]),
    )


@pytest.mark.filterwarnings("ignore")  # the peer is older than what it is installed with
@pytest.mark.parametrize("horizon", [66, 285])
def test_max_entropy_beside_imitation(tmp_path: Path, horizon: int) -> None:
    """A gradient of the likelihood has the same Q and visits; shown is what it costs in both.

    That is soft values, their policy, and its discounted visits, of random rewards of states, since
    the peer has none of pairs. The peer plans for so many steps: the last one counts by 0.001, or
    by 1e-13, which is our precision. Ours plans without end, each time from nothing, though a fit
    goes on from the last Q. A step of `MCEIRL.train` is such a gradient, a network and Adam. Whole
    fits would not compare the same thing: while it trains, the peer plans without a discount.
    """
    mce_irl = pytest.importorskip("imitation.algorithms.mce_irl")
    demos = load_demos(DEMOS / "open_maze.json")
    maze, moves = demos.environment, table_of(demos.environment)
    assert isinstance(maze, Maze)
    assert moves is not None
    problem = Problem(moves, demos.correct, (), GAMMA)
    reward = np.random.default_rng(1).normal(size=maze.n_states)
    reward[maze.goal] = -np.log(maze.n_actions)  # so that to stay there, by any action, is worth 0
    weights = np.repeat(reward[:, None], maze.n_actions, axis=1)
    env = peers_maze(maze, horizon)
    training = peers_training(env, problem.mu_e.sum(axis=1), tmp_path)

    def ours() -> tuple[Array, Array]:
        q = problem.plan_softly(weights)
        gradient = max_entropy.likelihood(problem, problem.mu_e, weights, q, ridge=0.0)[1]
        return q, (problem.mu_e - gradient).sum(axis=1)

    def peers() -> tuple[Array, Array]:
        _, q, policy = mce_irl.mce_partition_fh(env, reward=reward, discount=GAMMA)
        options = {"reward": reward, "pi": policy, "discount": GAMMA}
        return q[0], mce_irl.mce_occupancy_measures(env, **options)[1]

    def train() -> None:
        training.train(max_iter=STEPS)

    on_the_way = np.arange(maze.n_states) != maze.goal
    (q, visits), (peers_q, peers_visits) = ours(), peers()
    q_apart = np.abs(peers_q - q)[on_the_way].max()
    visits_apart = np.abs(peers_visits - visits)[on_the_way].max()
    runs: tuple[Callable[[], Any], ...] = ours, peers, train
    times = np.empty((ROUNDS + 1, len(runs)))
    for i in range(len(times)):
        for j, run in enumerate(runs):
            begin = thread_time()
            run()
            times[i, j] = (thread_time() - begin) * 1e3
    times = times[1:] / [1, 1, STEPS]  # the first round warms up
    middle, ratios = np.median(times, axis=0), times[:, 1:] / times[:, :1]
    print(
        f"\n{horizon} steps, ms: ours {middle[0]:.2f}, imitation {middle[1]:.1f}, a step of its "
        f"training {middle[2]:.1f}: {ratios[:, 0].min():.3g}-{ratios[:, 0].max():.3g} and "
        f"{ratios[:, 1].min():.3g}-{ratios[:, 1].max():.3g} x ours; Q (up to {np.abs(q).max():.3g})"
        f" differs by {q_apart:.2g}, visits by {visits_apart:.2g}"
    )
    assert q_apart < 2 * GAMMA**horizon * np.abs(q).max()
    assert visits_apart < 2 * GAMMA**horizon / (1 - GAMMA)
