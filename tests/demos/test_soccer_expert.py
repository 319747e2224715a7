from __future__ import annotations

import numpy as np

from replication import Demos
from replication.demos.soccer_expert import SoccerExpert, demonstrate_soccer
from replication.envs.soccer.compiled import FastSoccerWorld
from replication.envs.soccer.field import SoccerField
from replication.envs.soccer.rules import (
    BACKWARD,
    FORWARD,
    SLOW,
    border_distance,
    decode,
    expert_action,
)


def _contacts(field: SoccerField, actions: np.ndarray) -> list[bool]:
    """Return after which decisions the robot has touched something."""
    world = FastSoccerWorld(field.params)
    world.reset()
    touched = []
    for action in actions:
        world.step(int(action))
        touched.append(any(world.contacts))
    return touched


def test_stored_file_is_what_the_expert_does(soccer_demos: Demos) -> None:
    """The rules give the stored demonstrations, name by name and state by state."""
    made = demonstrate_soccer("soccer", description=soccer_demos.description)
    assert made == soccer_demos


def test_correct_demo_follows_a_policy(soccer_demos: Demos) -> None:
    """The expert's action is a function of the state, as else d = 0 could not be reached."""
    (correct,) = soccer_demos.correct
    assert [expert_action(int(s)) for s in correct.states[:-1]] == correct.actions.tolist()
    assert soccer_demos.conflicts() == ()


def test_correct_demo_slows_down_touches_nothing_and_scores(soccer_demos: Demos) -> None:
    """It drives slowly where an obstacle is detected and only there, and ends with a goal."""
    (correct,) = soccer_demos.correct
    detected = [decode(int(state))[2] for state in correct.states[:-1]]
    assert [action == SLOW for action in correct.actions] == detected
    assert any(detected)
    assert not any(_contacts(SoccerField(), correct.actions))
    assert SoccerField().goal_step(correct.actions) == len(correct.actions)


def test_correct_demo_keeps_off_the_borders_of_cells(soccer_demos: Demos) -> None:
    """At each decision the robot is at least 1 mm from any border, so rounding moves no state."""
    world = FastSoccerWorld()
    world.reset()
    for action in soccer_demos.correct[0].actions:
        assert border_distance(*world.pose[:2]) >= 1e-3
        world.step(int(action))


def test_incorrect_demos_are_of_the_papers_four_kinds(soccer_demos: Demos) -> None:
    """There is at least one of each kind, and no two are the same."""
    assert set(soccer_demos.kinds) == {"hit", "detour", "overspeed", "opposite"}
    drives = [
        tuple(demo.actions.tolist()) for demo in (*soccer_demos.correct, *soccer_demos.incorrect)
    ]
    assert len(set(drives)) == len(drives)


def test_hits_end_with_their_first_contact(soccer_demos: Demos) -> None:
    """A hit touches something in its last decision and not before."""
    for demo in soccer_demos.select("hit").incorrect:
        touched = _contacts(SoccerField(), demo.actions)
        assert touched[-1]
        assert not any(touched[:-1])


def test_detours_score_later_and_touch_nothing(soccer_demos: Demos) -> None:
    """A detour takes more decisions than the correct demonstration and ends with a goal."""
    for demo in soccer_demos.select("detour").incorrect:
        assert len(demo.actions) > len(soccer_demos.correct[0].actions)
        assert SoccerField().goal_step(demo.actions) == len(demo.actions)
        assert not any(_contacts(SoccerField(), demo.actions))


def test_overspeed_does_not_slow_down(soccer_demos: Demos) -> None:
    """Where the expert slows down, an overspeeding one goes forward and pays for it."""
    correct = soccer_demos.correct[0].actions
    for demo in soccer_demos.select("overspeed").incorrect:
        first = int(np.flatnonzero(demo.actions != correct[: len(demo.actions)])[0])
        assert (correct[first], demo.actions[first]) == (SLOW, FORWARD)
        assert (demo.actions[first:] == FORWARD).all()
        assert _contacts(SoccerField(), demo.actions)[-1]


def test_opposite_drives_away(soccer_demos: Demos) -> None:
    """After the correct beginning it goes backward only, for as many decisions, at least four."""
    correct = soccer_demos.correct[0].actions
    for demo in soccer_demos.select("opposite").incorrect:
        back = int((demo.actions == BACKWARD).sum())
        begin = len(demo.actions) - back
        assert demo.actions[:begin].tolist() == correct[:begin].tolist()
        assert back == max(begin, 4)


def test_leaving_at_every_decision_gives_more() -> None:
    """SOCCER-INCORRECT every: more demonstrations of the same kinds, the default's among them."""
    legs, every = (
        {tuple(d.actions.tolist()) for d in demonstrate_soccer("s", params=params).incorrect}
        for params in (SoccerExpert(), SoccerExpert(leave="every"))
    )
    assert legs < every


def test_correct_demo_is_short_and_plain(soccer_demos: Demos) -> None:
    """It scores in 15 decisions and 10 s, and slows down once, before one obstacle."""
    (correct,) = soccer_demos.correct
    actions = correct.actions.tolist()
    assert len(actions) == 15
    assert len(set(zip(correct.states.tolist(), actions, strict=False))) == 14
    assert set(actions) == {FORWARD, SLOW}
    slow = [i for i, action in enumerate(actions) if action == SLOW]
    assert slow == list(range(slow[0], slow[0] + 3))
    world = FastSoccerWorld()
    for action in actions:
        world.step(action)
    assert world.time < 10


def test_slowing_down_has_a_reason() -> None:
    """Driving on at full speed, as the expert would without obstacles, hits one."""
    world = FastSoccerWorld()
    for _ in range(15):
        if world.step(FORWARD)[1]:
            break
    assert world.contacts.obstacles > 0
