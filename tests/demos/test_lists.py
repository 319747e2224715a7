from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from replication import DemoError, Demos, GymTask, Maze, TabularTask, load_demos, save_demos
from replication.demos.lists import make_demos

CORRIDOR = TabularTask([[0, 1], [0, 2], [2, 2]], terminal=[2], actions=("back", "on"))
COIN = TabularTask(np.array([[[0.5, 0.5]], [[0.0, 1.0]]]), terminal=[1])
"""From state 0 the one action leads to the end every second time."""


def lake(**options: Any) -> GymTask:
    """Return the frozen lake that does not slip."""
    env = gymnasium.make("FrozenLake-v1", is_slippery=False, **options)
    return GymTask(env, actions=("left", "down", "right", "up"))


def test_names_numbers_and_pairs_are_the_same_demonstration() -> None:
    """Actions by name, by number, or with their states give the same states and actions."""
    ways: list[Any] = [["on", "on"], [1, 1], ([0, 1, 2], ["on", 1])]
    made = [make_demos(CORRIDOR, {"correct": [way]}).correct[0] for way in ways]
    assert made[0] == made[1] == made[2]
    assert made[0].states.tolist() == [0, 1, 2]


def test_kinds_are_those_of_the_mapping() -> None:
    """Each key but "correct" is a kind of mistake; names number the demonstrations of a kind."""
    demos = make_demos(
        CORRIDOR,
        {"correct": [["on", "on"]], "dawdle": [["back", "on", "on"], ["on", "back"]]},
        name="corridor",
    )
    assert [demo.name for demo in demos.incorrect] == ["dawdle-1", "dawdle-2"]
    assert (demos.task, demos.kinds) == ("corridor", ("dawdle",))


def test_mazes_take_lists_as_well() -> None:
    """Demonstrations in a maze can be given without a file."""
    demos = make_demos(Maze.from_text("S.G"), {"correct": [["right", "right"]]})
    assert demos.correct[0].states.tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("ways", "message"),
    [
        ({"correct": [["on", "away"]]}, "step 2 of demo 'correct-1': unknown action 'away'"),
        ({"correct": [["on", "on", "on"]]}, "demo 'correct-1': it goes on after the episode"),
        ({"correct": [([0, 2], ["on"])]}, "demo 'correct-1': step 1: 'on' in state 0 leads to 1"),
        ({"correct": [7]}, r"demo 'correct-1' must be a list of actions, or a pair"),
        ({"correct": [[]]}, "demo 'correct-1' is empty"),
        ({"dawdle": [["back"]]}, "there is no correct demo"),
        ({"correct": [["on", "on"]], "Bad kind": [["back"]]}, "of kind 'Bad kind'; use small"),
    ],
)
def test_what_is_wrong_is_one_line_with_the_demonstration(ways: Any, message: str) -> None:
    """A mistake names the demonstration and the step."""
    with pytest.raises(DemoError, match=message) as caught:
        make_demos(CORRIDOR, ways)
    assert "\n" not in str(caught.value)


def test_random_tasks_need_states_and_take_what_is_possible() -> None:
    """Where moves are random the states are given, and refused only if they cannot have been."""
    demos = make_demos(COIN, {"correct": [([0, 0, 0, 1], [0, 0, 0])]})
    assert demos.correct[0].states.tolist() == [0, 0, 0, 1]
    with pytest.raises(DemoError, match=r"demo 'correct-1': .*give the states as well"):
        make_demos(COIN, {"correct": [[0, 0]]})


@pytest.mark.parametrize("options", [{}, {"map_name": "8x8"}])
def test_gymnasium_demonstrations_come_back_from_a_file(
    options: dict[str, Any], tmp_path: Path
) -> None:
    """A file names a registered environment with its options, and makes it again."""
    task = lake(**options)
    demos = make_demos(task, {"correct": [["down", "down"]], "bump": [["left"]]}, name="lake")
    save_demos(demos, tmp_path / "lake.json")
    again = load_demos(tmp_path / "lake.json")
    assert (again.correct, again.incorrect) == (demos.correct, demos.incorrect)
    assert again.environment.describe() == task.describe()


def test_own_demonstrations_come_back_with_their_task(tmp_path: Path) -> None:
    """A file of a user's own task is read with that task, and with no other."""
    demos = make_demos(CORRIDOR, {"correct": [["on", "on"]]})
    save_demos(demos, tmp_path / "own.json")
    assert load_demos(tmp_path / "own.json", task=CORRIDOR).correct == demos.correct
    with pytest.raises(DemoError, match=r"own\.json: environment: only its own program .*task="):
        load_demos(tmp_path / "own.json")
    with pytest.raises(DemoError, match="made in another one than the task that is given"):
        load_demos(tmp_path / "own.json", task=COIN)


@pytest.mark.parametrize(
    ("environment", "message"),
    [
        ('{"kind": "gymnasium", "id": "os:Lake-v1"}', "environment.id: 'os:Lake-v1' names a mod"),
        ('{"kind": "gymnasium", "id": "Lake-v1"}', "environment: Gymnasium cannot make it: "),
        ('{"kind": "gymnasium", "id": "FrozenLake-v1", "options": {"x": 1}}', "Gymnasium cannot"),
        ('{"kind": "gymnasium", "id": "CartPole-v1"}', "environment: CartPole-v1: observations"),
        ('{"kind": "gymnasium"}', "environment: the field 'id' is missing; add it"),
        ('{"kind": "own", "states": 0, "actions": []}', "environment.states: 0 does not fit"),
    ],
)
def test_environments_that_a_file_cannot_make(
    environment: str, message: str, tmp_path: Path
) -> None:
    """A file imports nothing, and what Gymnasium refuses is one line that names the file."""
    text = (
        '{"format": "replication-demos", "version": 1, "task": "t", "environment": '
        f'{environment}, "correct": [{{"name": "a", "actions": ["1"]}}]}}'
    )
    (tmp_path / "file.json").write_text(text)
    with pytest.raises(DemoError, match=message) as caught:
        load_demos(tmp_path / "file.json")
    assert str(caught.value).startswith(str(tmp_path / "file.json"))
    assert "\n" not in str(caught.value)


def test_demonstrations_of_a_task_select_as_others_do() -> None:
    """Kinds of a user's own are selected by name."""
    demos = make_demos(CORRIDOR, {"correct": [["on", "on"]], "dawdle": [["back"]], "nap": [[0]]})
    assert isinstance(demos, Demos)
    assert demos.select("nap").kinds == ("nap",)
