from __future__ import annotations

import numpy as np
import pytest

from replication import Demos, Params, load_demos
from replication.choices import ChoiceError
from replication.paper import SOCCER
from replication.paths import PROJECT
from replication.qlearning import stream
from replication.setting import Setting
from replication.tasks import MazeTask, SoccerTask, make_task


@pytest.fixture(scope="module")
def soccer() -> Demos:
    """Load the stored soccer demonstrations."""
    return load_demos(PROJECT / "data" / "demos" / "soccer.json")


def test_each_environment_has_its_task(small_demos: Demos, soccer: Demos) -> None:
    """A maze makes a maze task, a field a soccer task, anything else an error."""
    assert isinstance(make_task(small_demos.environment, Params()), MazeTask)
    assert isinstance(make_task(soccer.environment, Params.of(**SOCCER)), SoccerTask)
    with pytest.raises(ChoiceError, match="no task for a str"):
        make_task("chess", Params())  # type: ignore[arg-type]


def test_mazes_refuse_a_falling_epsilon(small_demos: Demos) -> None:
    """What the compiled maze learner cannot do is refused, not ignored."""
    with pytest.raises(ChoiceError, match=r"epsilon_end = 0\.3"):
        make_task(small_demos.environment, Params.of(epsilon=0.3))


def test_soccer_trials_do_not_depend_on_each_other(soccer: Demos) -> None:
    """Two trials learned in one call have the bits of each learned alone."""
    params = Params.of(**{**SOCCER, "episodes": 3})
    task = make_task(soccer.environment, params)
    rng = np.random.default_rng(1)
    weights, q = rng.normal(size=(2, *task.shape)), np.zeros((2, *task.shape))
    streams = np.stack([stream(np.random.SeedSequence(k)) for k in range(2)])
    together = task.learn(weights, q, streams)
    for k in range(2):
        alone = task.learn(weights[k : k + 1], q[k : k + 1], streams[k : k + 1])
        for one, other in zip(alone, together, strict=True):
            np.testing.assert_array_equal(one[0], other[k])


def test_soccer_goal_value_matters(soccer: Demos) -> None:
    """GOAL-VALUE bootstrap changes what is learned where a goal falls, and nothing before."""
    tables = []
    for goal_value in ("zero", "bootstrap"):
        setting = Setting(soccer, "unified", Params.of(**SOCCER, goal_value=goal_value))
        (correct,) = soccer.correct
        weights = np.zeros((1, *setting.task.shape))
        weights[0, correct.states[:-1], correct.actions] = 1.0
        words = stream(np.random.SeedSequence(2))[None]
        tables.append(setting.task.learn(weights, np.zeros_like(weights), words)[0])
    assert not np.array_equal(tables[0], tables[1])
