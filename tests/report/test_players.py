from __future__ import annotations

import base64
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from replication import Demos
from replication.envs.maze import as_maze
from replication.envs.soccer.field import SoccerField
from replication.evidence.experiments import GENERAL, NONE, Key
from replication.irl import Trial
from replication.paper.params import Params
from replication.paper.published import SOCCER
from replication.report.film import film
from replication.report.moving import Player, player
from replication.report.players import MOST_FRAMES, Course, courses, learning_player
from replication.trials.condition import Condition
from replication.trials.results import Results
from replication.trials.run import run_trials
from replication.trials.store import Store

KEYS: tuple[Key, ...] = (
    ("adaboost", "", NONE),
    ("unified", "printed", NONE),
    ("unified-incorrect", "at-once", GENERAL),
)
FRAME = re.compile(r'data:image/png;base64,([^"]*)')


@pytest.fixture(scope="module")
def trials(conditions: dict[Key, Condition], results: Results) -> dict[Key, Trial]:
    """Return a trial of each method that kept every iteration."""
    return {key: results.trial(conditions[key], 0, snapshots=True) for key in KEYS}


@pytest.fixture(scope="module")
def shown(small_demos: Demos, trials: dict[Key, Trial]) -> list[Course]:
    """Return what a player shows of them."""
    return courses(small_demos, trials)


@pytest.fixture(scope="module")
def made(small_demos: Demos, shown: list[Course]) -> Player:
    """Make a player of it."""
    return learning_player(small_demos, shown)


def frames(page: str) -> list[bytes]:
    """Return the frames of a player."""
    return [base64.b64decode(one) for one in FRAME.findall(page)]


def test_courses_are_the_trials(shown: list[Course], trials: dict[Key, Trial]) -> None:
    """Errors, ways and weights are those of the trial, with an entry for each iteration."""
    labels = [
        "AdaBoost-IRL (R1)",
        "Unified, without incorrect, Fᵢ (printed)",
        "Unified, with incorrect (general list), Fᵢ, maximum at once",
    ]
    assert [one.label for one in shown] == labels
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
    keys = last[["method", "reading", "set"]].itertuples(index=False, name=None)
    assert tuple(keys) == KEYS
    assert last["error"].tolist() == [0, 0, 0]
    assert last["iteration"].tolist() == [one.iterations for one in shown]


def test_words_say_how_each_method_ends(
    small_demos: Demos, made: Player, shown: list[Course]
) -> None:
    """Who cannot see the player reads how many iterations each method takes."""
    for one in shown:
        assert f"{one.label}: d = 0 after {one.iterations}" in made.words
    parts: dict[str, Any] = {"ways": shown[0].ways[:2], "weights": shown[0].weights[:2]}
    unfinished = replace(shown[0], errors=np.array([2.0, 1.5]), **parts)
    assert f"{unfinished.label}: d = 1.5" in learning_player(small_demos, [unfinished]).words


def test_there_is_a_frame_for_each_iteration(made: Player, shown: list[Course]) -> None:
    """The slower method gives the number of frames, and each frame differs from the one before."""
    drawn = frames(made.html)
    assert len(drawn) == max(one.iterations for one in shown) + 1
    assert all(one != other for one, other in pairwise(drawn))


def test_many_iterations_are_thinned(small_demos: Demos, shown: list[Course]) -> None:
    """A trial of very many iterations keeps its first and last ones, and the player stays small."""
    one = shown[1]
    many = np.linspace(0, 1, 3 * MOST_FRAMES + 1)
    parts: dict[str, Any] = {
        "ways": one.ways[-1:] * len(many),
        "weights": many[:, None] * one.weights[-1],
    }
    long = replace(one, errors=2 - 2 * many, **parts)
    assert len(frames(learning_player(small_demos, [long]).html)) == MOST_FRAMES


def test_soccer_is_shown_on_the_field(soccer_demos: Demos, tmp_path: Path) -> None:
    """On the field a way has metres, and a cell the weight that is farthest from zero."""
    condition = Condition(soccer_demos, "unified", Params.of(**{**SOCCER, "max_iterations": 3}))
    store = Store(tmp_path / "trials.sqlite")
    trial = run_trials([condition], trials=1, store=store, seed=3).trial(
        condition, 0, snapshots=True
    )
    found = courses(soccer_demos, {("unified", "printed", NONE): trial})
    assert found[0].weights.shape == (4, 192)
    cells = trial.weights.reshape(192, -1)
    np.testing.assert_array_equal(np.abs(found[0].weights[-1]), np.abs(cells).max(axis=1))
    assert found[0].ways[0].max() < 1.4
    assert len(frames(learning_player(soccer_demos, found).html)) == 4


@pytest.mark.parametrize("kind", ["maze", "field"])
def test_player_needs_nothing_from_elsewhere(
    kind: str, small_demos: Demos, shown: list[Course]
) -> None:
    """A player names no address, is named to those who do not see it, and is always the same."""

    def make() -> str:
        if kind == "maze":
            return learning_player(small_demos, shown).html
        moving = film(SoccerField(), {"a & <b>": [0, 0]})
        return player(moving.animation, "<one> & two", frames_a_second=5)

    page = make()
    text = FRAME.sub("", page)
    assert "//" not in re.sub(r"(?m)^\s*//.*$", "", text)
    assert not re.search(r"<link|<i |url\(|import", text)
    assert text.count("<button") == text.count("aria-label") - 2 == 9
    assert re.search(r'<img alt="[^"<>]+" id="_anim_img', text)
    assert re.search(r'type="range" aria-label="Frame"', text)
    with mpl.rc_context({"font.size": 20, "savefig.dpi": 30}):
        assert make() == page
