from __future__ import annotations

import base64
import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from replication import Demos
from replication.demos.soccer_expert import demonstrate_soccer
from replication.envs.maze import as_maze
from replication.envs.soccer.field import SoccerField
from replication.evidence.experiments import Key
from replication.irl import Trial
from replication.paper.params import Params
from replication.paper.published import SOCCER
from replication.report.film import film
from replication.report.players import (
    MOST_FRAMES,
    Course,
    Player,
    courses,
    learning_player,
    player,
)
from replication.trials.condition import Condition
from replication.trials.run import run_trials
from replication.trials.store import Store

FRAME = re.compile(r'data:image/png;base64,([^"]*)')


def learned(demos: Demos, folder: Path, **choices: object) -> dict[Key, Trial]:
    """Let two methods learn, keeping every iteration."""
    conditions = {
        (name, f): Condition(demos, name, Params.of(**choices))
        for name, f in (("adaboost", ""), ("unified", "printed"))
    }
    results = run_trials(
        list(conditions.values()), trials=1, store=Store(folder / "trials.sqlite"), seed=3
    )
    return {key: results.trial(one, 0, snapshots=True) for key, one in conditions.items()}


@pytest.fixture(scope="module")
def soccer_demos() -> Demos:
    """Let the expert demonstrate."""
    return demonstrate_soccer("soccer", SoccerField())


@pytest.fixture(scope="module")
def shown(small_demos: Demos, tmp_path_factory: pytest.TempPathFactory) -> list[Course]:
    """Learn in a small maze."""
    choices = {"episodes": 60, "horizon": 40, "max_iterations": 60}
    return courses(small_demos, learned(small_demos, tmp_path_factory.mktemp("store"), **choices))


@pytest.fixture(scope="module")
def made(small_demos: Demos, shown: list[Course]) -> Player:
    """Make a player of it."""
    return learning_player(small_demos, shown)


def frames(page: str) -> list[bytes]:
    """Return the frames of a player."""
    return [base64.b64decode(one) for one in FRAME.findall(page)]


def test_courses_are_the_trials(small_demos: Demos, shown: list[Course], tmp_path: Path) -> None:
    """Errors, ways and weights are those of the trial, with an entry for each iteration."""
    choices = {"episodes": 60, "horizon": 40, "max_iterations": 60}
    trials = learned(small_demos, tmp_path, **choices)
    assert [one.label for one in shown] == [
        "AdaBoost-IRL (R1)",
        "Unified, without incorrect, Fᵢ (printed)",
    ]
    for one, trial in zip(shown, trials.values(), strict=True):
        assert one.iterations == trial.iterations
        np.testing.assert_array_equal(one.errors, trial.errors)
        assert [len(way) for way in one.ways] == [len(e.states) for e in trial.episodes]
        np.testing.assert_array_equal(one.weights[-1], trial.weights.ravel())
        assert not one.weights[0].any()


def test_the_last_way_is_the_experts(small_demos: Demos, shown: list[Course]) -> None:
    """A trial that converged ends on the expert's way, from the start to the goal."""
    maze = as_maze(small_demos.environment)
    for one in shown:
        assert one.errors[-1] == 0
        x, y = one.ways[-1][-1]
        assert (maze.shape[0] - 1 - y) * maze.shape[1] + x == maze.goal
        assert len(one.ways[-1]) == len(small_demos.correct[0].states)


def test_numbers_have_a_row_for_each_iteration(made: Player, shown: list[Course]) -> None:
    """The file beside a player has what moves, method by method."""
    table = made.numbers
    assert len(table) == sum(one.iterations + 1 for one in shown)
    last = table.groupby("method", sort=False).tail(1)
    assert last["error"].tolist() == [0, 0]
    assert last["iteration"].tolist() == [one.iterations for one in shown]


def test_words_say_how_each_method_ends(
    small_demos: Demos, made: Player, shown: list[Course]
) -> None:
    """Who cannot see the player reads how many iterations each method takes."""
    for one in shown:
        assert f"{one.label}: d = 0 after {one.iterations}" in made.words
    first = shown[0]
    unfinished = replace(
        first, errors=np.array([2.0, 1.5]), ways=first.ways[:2], weights=first.weights[:2]
    )
    assert f"{first.label}: d = 1.5" in learning_player(small_demos, [unfinished]).words


def test_there_is_a_frame_for_each_iteration(made: Player, shown: list[Course]) -> None:
    """The slower method gives the number of frames, and each frame differs from the one before."""
    drawn = frames(made.html)
    assert len(drawn) == max(one.iterations for one in shown) + 1
    assert all(one != other for one, other in pairwise(drawn))


def test_many_iterations_are_thinned(small_demos: Demos, shown: list[Course]) -> None:
    """A trial of very many iterations keeps its first and last ones, and the player stays small."""
    one = shown[1]
    many = 3 * MOST_FRAMES
    long = replace(
        one,
        errors=np.linspace(2, 0, many + 1),
        ways=tuple(one.ways[-1] for _ in range(many + 1)),
        weights=np.linspace(0, 1, many + 1)[:, None] * one.weights[-1],
    )
    assert len(frames(learning_player(small_demos, [long]).html)) == MOST_FRAMES


def test_soccer_is_shown_on_the_field(soccer_demos: Demos, tmp_path: Path) -> None:
    """On the field a way has metres, and a cell the weight that is farthest from zero."""
    trials = learned(soccer_demos, tmp_path, **{**SOCCER, "max_iterations": 3})
    found = courses(soccer_demos, trials)
    assert found[0].weights.shape == (4, 192)
    cells = trials["adaboost", ""].weights.reshape(192, -1)
    np.testing.assert_array_equal(np.abs(found[0].weights[-1]), np.abs(cells).max(axis=1))
    assert found[0].ways[0].max() < 1.4
    assert len(frames(learning_player(soccer_demos, found).html)) == 4


@pytest.fixture(params=["maze", "field"])
def make(
    request: pytest.FixtureRequest, small_demos: Demos, shown: list[Course]
) -> Callable[[], str]:
    """Return what makes a player."""

    def moving() -> str:
        shown = film(SoccerField(), {"a & <b>": [0, 0]})
        return player(shown.animation, "<one> & two", frames_a_second=5)

    return moving if request.param == "field" else lambda: learning_player(small_demos, shown).html


def test_player_needs_nothing_from_elsewhere(make: Callable[[], str]) -> None:
    """A player names no address, is named to those who do not see it, and is always the same."""
    page = make()
    text = FRAME.sub("", page)
    assert "//" not in re.sub(r"(?m)^\s*//.*$", "", text)
    assert not re.search(r"<link|<i |url\(|import", text)
    assert text.count("<button") == text.count("aria-label") - 2 == 9
    assert re.search(r'<img alt="[^"<>]+" id="_anim_img', text)
    assert re.search(r'type="range" aria-label="Frame"', text)
    with mpl.rc_context({"font.size": 20, "savefig.dpi": 30}):
        assert make() == page
