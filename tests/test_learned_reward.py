from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from replication import Bins, GymTask, LearnedReward, WrappedTask, fit
from replication.result import FitError

ACROSS = [1, 1, 2, 2, 1, 2]


def lake() -> gymnasium.Env[Any, Any]:
    """Return the frozen lake that does not slip."""
    return gymnasium.make("FrozenLake-v1", is_slippery=False)


def test_rewards_are_those_of_the_pairs_that_are_passed() -> None:
    """Each step is rewarded by the weight of the state it left and the action it took."""
    env = lake()
    result = fit({"correct": [ACROSS]}, task=GymTask(env), seed=1)
    learned = LearnedReward(env, result)
    state, _ = learned.reset(seed=1)
    for action in ACROSS:
        after, reward, ended, _, _ = learned.step(action)
        assert reward == result.weights[state, action]
        state = after
    assert ended


def test_states_that_nobody_saw_are_worth_nothing() -> None:
    """Another learner may go where no trajectory was; there the reward is 0."""
    result = fit({"correct": [ACROSS]}, task=GymTask(lake()), seed=1)
    unseen = np.flatnonzero(~result.weights.any(axis=1)).tolist()
    env = lake()
    learned = LearnedReward(env, result)
    learned.reset(seed=1)
    assert 3 in unseen
    learned._observation = 3
    assert learned.step(0)[1] == 0


def test_another_learner_learns_the_way_from_the_reward() -> None:
    """Ten lines of Q-learning that know nothing of demonstrations find the expert's way."""
    result = fit({"correct": [ACROSS]}, task=GymTask(lake()), seed=1)
    env, rng = LearnedReward(lake(), result), np.random.default_rng(1)
    q = np.zeros((16, 4))
    for episode in range(500):
        state, _ = env.reset(seed=episode)
        over = False
        while not over:
            action = int(rng.integers(4) if rng.random() < 0.2 else q[state].argmax())
            after, reward, ended, cut, _ = env.step(action)
            target = reward + 0.9 * (not ended) * q[after].max()
            q[state, action] += 0.5 * (target - q[state, action])
            state, over = after, ended or cut
    state, way, over = env.reset()[0], list[int](), False
    while not over and len(way) < 20:
        way.append(int(q[state].argmax()))
        state, _, over, _, _ = env.step(way[-1])
    assert way == ACROSS


def test_observations_are_numbered_as_in_the_task() -> None:
    """Where a function numbers observations, the wrapper takes the environment as it is."""
    bins = Bins(low=[-1.2, -0.07], high=[0.6, 0.07], counts=[4, 4])
    env = gymnasium.make("MountainCar-v0")
    task = WrappedTask(env, bins, reset_seed=1)
    result = fit({"correct": [[2, 2]]}, task=task, seed=1, horizon=2, episodes=5, max_iterations=2)
    learned = LearnedReward(gymnasium.make("MountainCar-v0"), result)
    observation, _ = learned.reset(seed=1)
    assert learned.step(2)[1] == result.weights[bins(observation), 2]


class FromOne(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Counts states and actions from 1."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self.observation_space = spaces.Discrete(16, start=1)
        self.action_space = spaces.Discrete(4, start=1)

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Start an episode."""
        state, info = self.env.reset(**options)
        return state + 1, info

    def step(self, action: Any) -> Any:
        """Take an action."""
        state, *rest = self.env.step(action - 1)
        return state + 1, *rest


def test_counting_from_one_changes_nothing() -> None:
    """States, actions and names that are digits keep their meaning through fit and reward."""
    env = FromOne(lake())
    names = ("1", "2", "3", "4")
    result = fit({"correct": [ACROSS]}, task=GymTask(env, actions=names), seed=1)
    plain = fit({"correct": [ACROSS]}, task=GymTask(FromOne(lake())), seed=1)
    np.testing.assert_array_equal(result.weights, plain.weights)
    assert result.predict(1) == "2"
    learned = LearnedReward(FromOne(lake()), result)
    learned.reset(seed=1)
    assert learned.step(2)[1] == result.weights[0, 1] != 0


@pytest.mark.parametrize(
    ("env", "message"),
    [
        (gymnasium.make("CliffWalking-v1"), "the fit has 16 states, the environment 48"),
        (gymnasium.make("Blackjack-v1"), "the fit has 4 actions, the environment 2"),
    ],
)
def test_a_foreign_environment_is_refused_in_one_line(
    env: gymnasium.Env[Any, Any], message: str
) -> None:
    """An environment with other states or actions has no such reward."""
    result = fit({"correct": [ACROSS]}, task=GymTask(lake()), seed=1)
    with pytest.raises(FitError, match=message):
        LearnedReward(env, result)


def test_a_file_is_no_fit() -> None:
    """Instead of a path a fit is asked for."""
    with pytest.raises(FitError, match=r"give a fit, Fit\.load\(path\), not 'result\.json'"):
        LearnedReward(lake(), "result.json")  # type: ignore[arg-type]
