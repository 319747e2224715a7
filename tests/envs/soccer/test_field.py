from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from replication import DemoError, Demos
from replication.demos.files import demos_document, parse_demos
from replication.demos.soccer_expert import demonstrate_soccer
from replication.demos.strict_json import layout
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.rules import N_STATES, SoccerParams, encode


def test_replay_is_what_the_world_does(soccer_demos: Demos) -> None:
    """States and the goal's step are those of the world, decision by decision."""
    field = SoccerField()
    actions = soccer_demos.correct[0].actions
    world = FastSoccerWorld()
    states = [world.reset(), *(world.step(int(action))[0] for action in actions)]
    assert field.replay(actions).tolist() == states
    assert field.goal_step(actions) == len(actions)
    assert field.goal_step(actions[:-1]) is None


def test_after_the_goal_nothing_moves(soccer_demos: Demos) -> None:
    """Actions beyond the goal repeat the last state, and the goal keeps its step."""
    field = SoccerField()
    actions = soccer_demos.correct[0].actions
    longer = [*actions, 0, 1]
    assert field.replay(longer)[-3:].tolist() == [field.replay(actions)[-1]] * 3
    assert field.goal_step(longer) == len(actions)


def test_cells_and_states_are_the_same() -> None:
    """Column, row and detection of a state encode to the state."""
    states = np.arange(N_STATES)
    for state, (column, row, detected) in zip(states, SoccerField().cells(states), strict=True):
        x, y = (column + 0.5) * 1.4 / 16, (row + 0.5) * 1.2 / 12
        assert encode(x, y, bool(detected)) == state


def test_demos_survive_their_file() -> None:
    """Soccer demonstrations read back as they were written, their world's parameters included."""
    field = SoccerField(SoccerParams(drive_time=0.4))
    demos = demonstrate_soccer("s", field)
    assert parse_demos((layout(demos_document(demos)) + "\n").encode()) == demos


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"drive_time": 0.0}, "environment: SoccerParams.drive_time = 0.0 is not accepted"),
        ({"rays": 0}, "environment: SoccerParams.rays = 0 is not accepted"),
        ({"speed": 0.05}, "environment: speed = 0.05 must be at least slow_speed"),
        ({"kind": "socer"}, "environment.kind: unknown kind 'socer' (did you mean 'soccer'?)"),
        ({"raise": 1}, "environment: unknown field 'raise'"),
        ({"actions": ["forward"]}, "environment: 'actions' is"),
    ],
)
def test_bad_world_is_refused_in_one_line(
    soccer_demos: Demos, change: dict[str, object], message: str
) -> None:
    """A value that is not registered, or a misspelt field, is named with how to fix it."""
    document = demos_document(soccer_demos)
    document["environment"] |= change
    with pytest.raises(DemoError) as caught:
        parse_demos((layout(document) + "\n").encode())
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_demo_that_does_not_fit_the_physics_is_refused(soccer_demos: Demos) -> None:
    """States that another world would give are found at the first decision that differs."""
    document = demos_document(soccer_demos)
    document["environment"]["drive_time"] = 0.4
    with pytest.raises(
        DemoError, match=r"step \d+ of demo 'correct': 'forward' from \[\d+,\d+,0\]"
    ):
        parse_demos((layout(document) + "\n").encode())


def test_fields_are_values() -> None:
    """Equal parameters make equal fields, and a field cannot be changed."""
    assert SoccerField() == SoccerField(SoccerParams())
    with pytest.raises(dataclasses.FrozenInstanceError):
        SoccerField().params = SoccerParams()  # type: ignore[misc]
