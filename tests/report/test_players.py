from __future__ import annotations

import json
import re
from collections.abc import Mapping
from functools import cache
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replication import Demos
from replication.envs.maze import as_maze
from replication.evidence.experiments import GENERAL, NONE, Key, conditions_of
from replication.irl import Trial
from replication.learning.seeds import child
from replication.paper.published import SOCCER
from replication.report import players
from replication.report.moving import Player, path
from replication.report.players import LEVELS, PARTS, typical_trials
from replication.report.stages import SIDE, stage
from replication.trials.condition import Condition
from replication.trials.measures import measure_trials
from replication.trials.run import run_trials
from replication.trials.store import Store

SEED = 2


def content_of(page: str) -> dict[str, Any]:
    """Return what a player draws."""
    (data,) = re.findall(r"(?m)^const data = (.*);$", page)
    content: dict[str, Any] = json.loads(data)
    return content


def frames_of(play: Mapping[str, Any]) -> list[list[list[str]]]:
    """Return the frames of each panel of a play, those that are as in the first one, too."""
    first, second = (panel["frames"] for panel in play["panels"])
    return [first, [frame or first[i] for i, frame in enumerate(second)]]


@pytest.fixture(scope="module")
def replayed(conditions: dict[Key, Condition]) -> Any:
    """Return a function that computes a trial with its snapshots."""

    @cache
    def replayed(key: Key, k: int) -> Trial:
        return conditions[key].trial(seed=child(np.random.SeedSequence(SEED), k), keep=True)

    return replayed


@pytest.fixture(scope="module")
def made(small_demos: Demos, trials: pd.DataFrame, replayed: Any) -> Player:
    """Make a player of a small maze."""
    return players.learning(small_demos, trials, replayed, set=GENERAL)


# --- which trial -----------------------------------------------------------------------------


@given(st.lists(st.integers(-9, 9), min_size=1, max_size=30))
def test_no_trial_is_nearer_and_none_before_as_near(saved: list[int]) -> None:
    """The trial shown is the first of those whose difference is nearest to the quantile."""
    for part, k in typical_trials(pd.Series(saved)).items():
        away = np.abs(np.array(saved) - np.quantile(saved, PARTS[part]))
        assert away[k] == away.min()
        assert k == 0 or away[:k].min() > away[k]


def test_each_reading_shows_the_trials_of_its_own_differences(
    made: Player, trials: pd.DataFrame
) -> None:
    """The numbers name the trials that follow from the table, for each reading and part."""
    shown = made.numbers.groupby(["under", "nearest_to"], sort=False)["trial"].unique()
    assert len(shown) == 3 * len(PARTS)
    for reading in ("printed", "updated", "at-once"):
        saved = players.differences(trials, reading, GENERAL)
        for part, k in typical_trials(saved).items():
            assert shown[reading, part].tolist() == [k]
    at_once = made.numbers[made.numbers["under"] == "at-once"]
    assert {*zip(at_once["method"], at_once["reading"], at_once["set"], strict=True)} == {
        ("unified", "printed", NONE),
        ("unified-incorrect", "at-once", GENERAL),
    }


def test_a_trial_at_the_cap_saves_nothing_that_is_known(trials: pd.DataFrame) -> None:
    """Its pair is left out, unless no pair is left."""
    usual = players.differences(trials, "updated", GENERAL)
    first = trials.assign(converged=(trials["trial"] != 0).astype(int))
    assert players.differences(first, "updated", GENERAL).equals(usual.drop(0))
    assert players.differences(trials.assign(converged=0), "updated", GENERAL).equals(usual)


def test_differences_are_paired_by_trial(trials: pd.DataFrame) -> None:
    """What a trial saves is its own iterations without less those with, in whatever order."""
    mixed = trials.sample(frac=1, random_state=1)
    found = players.differences(mixed, "updated", GENERAL)
    for k, saved in found.items():
        rows = trials[(trials["trial"] == k) & (trials["reading"] == "updated")]
        counts = rows.set_index("set")["iterations"]
        assert saved == counts[NONE] - counts[GENERAL]
    assert len(found) == 4


# --- what is drawn ---------------------------------------------------------------------------


def test_the_player_draws_its_numbers(made: Player) -> None:
    """Ways, ends, rewards and errors of the page are those of the file beside it, row by row."""
    content = content_of(made.html)
    parts = made.numbers.groupby(["under", "nearest_to"], sort=False)
    assert len(content["plays"]) == len(parts)
    for play, (_, rows) in zip(content["plays"], parts, strict=True):
        sides = [side for _, side in rows.groupby("method", sort=False)]
        for frames, panel, side in zip(frames_of(play), play["panels"], sides, strict=True):
            assert [frame[0] for frame in frames] == side["way"].tolist()
            assert [frame[2] for frame in frames] == [f"{end} 0" for end in side["end"]]
            assert [frame[3] for frame in frames] == side["rewards"].tolist()
            np.testing.assert_allclose(panel["errors"], side["error"], rtol=1e-3)
            assert frames[-1][1] == f"d = 0 after {len(side) - 1} iterations"


def test_the_numbers_are_those_of_the_trials(
    small_demos: Demos, made: Player, replayed: Any
) -> None:
    """Errors, moves, ends and levels of rewards follow from the trial that is named."""
    maze = as_maze(small_demos.environment)
    names = ["under", "nearest_to", "trial"]
    for (_, _, k), rows in made.numbers.groupby(names, sort=False):
        sides = {}
        for key, side in rows.groupby(["method", "reading", "set"], sort=False):
            trial = sides[key] = replayed(key, k)
            np.testing.assert_array_equal(side["error"], trial.errors)
            assert side["moves"].tolist() == [len(episode.actions) for episode in trial.episodes]
            x, y = map(int, side["end"].iloc[-1].split())
            assert y // SIDE * maze.shape[1] + x // SIDE == maze.goal
        most = max(np.abs(trial.snapshots.weights).max() for trial in sides.values())
        for key, side in rows.groupby(["method", "reading", "set"], sort=False):
            levels: dict[int, int] = {}
            for change in " ".join(side["rewards"]).split():
                place, level = map(int, change.split(":"))
                levels[place] = level
            last = sides[key].weights.ravel()
            assert {place for place, level in levels.items() if level} == {*np.flatnonzero(last)}
            for place, level in levels.items():
                assert np.sign(level) == np.sign(last[place])
                assert (abs(level) - 1) ** 2 * most < LEVELS**2 * abs(last[place]) + 1e-9
                assert LEVELS**2 * abs(last[place]) <= level**2 * most + 1e-9


def test_the_readers_way_starts_with_the_median(made: Player) -> None:
    """All readings and parts can be chosen; at first it is the median under the printed one."""
    reading, part = content_of(made.html)["choices"]
    assert reading["options"][reading["start"]] == "Fᵢ (printed)"
    assert len(reading["options"]) == 3
    assert part["options"][part["start"]] == "median"
    assert part["options"] == [*PARTS]


def test_text_says_which_trial_and_whether_the_runs_differ(made: Player) -> None:
    """Each play says its trial, the rule and the outcome, and where two runs are the same, so."""
    parts = made.numbers.groupby(["under", "nearest_to"], sort=False)
    equal = []
    for play, ((_, part), rows) in zip(content_of(made.html)["plays"], parts, strict=True):
        counts = (rows.groupby("method", sort=False).size() - 1).tolist()
        assert re.match(
            rf"Trial {rows['trial'].iloc[0]}, the first of 4 .* to the {part}, ", play["text"]
        )
        assert f"{counts[0]} iterations without" in play["text"]
        assert f"and {counts[1]} with them (general list)" in play["text"]
        one, other = frames_of(play)
        equal.append(one == other)
        assert ("the same, move by move" in play["text"]) == equal[-1]
    assert not all(equal)


def test_words_say_how_many_iterations_the_median_takes(made: Player) -> None:
    """Who cannot see the player reads what it comes to under each reading."""
    median = made.numbers[made.numbers["nearest_to"] == "median"]
    for reading, label in (("printed", "Fᵢ (printed)"), ("at-once", "Fᵢ, maximum at once")):
        rows = median[median["under"] == reading]
        without, given = rows.groupby("method", sort=False).size() - 1
        assert f"{label}: {without} without and {given} with" in made.words


def test_what_incorrect_demonstrations_mark_is_no_pair_of_the_experts(
    small_demos: Demos, made: Player
) -> None:
    """Only the side with incorrect demonstrations marks pairs: theirs, less the expert's."""
    content = content_of(made.html)
    pairs = [
        {
            (state, action)
            for demo in demos
            for state, action in zip(demo.states, demo.actions, strict=False)
        }
        for demos in (small_demos.select(GENERAL).incorrect, small_demos.correct)
    ]
    marked = {divmod(place, 4) for place in content["marks"]["marked"]}
    assert marked == pairs[0] - pairs[1] != set()
    assert [panel["marked"] for panel in content["plays"][0]["panels"]] == [False, True]


def test_demonstrations_without_mistakes_have_a_player(small_demos: Demos) -> None:
    """Without incorrect demonstrations two equal runs are shown, and it is said that they are."""
    demos = small_demos.select("none")
    conditions = conditions_of(demos, {"episodes": 60, "horizon": 40})
    key = ("unified-incorrect", "printed", "all")

    def replayed(key: Key, k: int) -> Trial:
        return conditions[key].trial(seed=child(np.random.SeedSequence(SEED), k), keep=True)

    rows = [
        {"method": key[0], "reading": key[1], "set": key[2], "trial": 0, "iterations": 3}
        | {"converged": 1}
        for key in conditions
    ]
    player = players.learning(demos, pd.DataFrame(rows), replayed, set=key[2])
    content = content_of(player.html)
    assert content["marks"]["marked"] == []
    assert all("the same, move by move" in play["text"] for play in content["plays"][:3])


def test_soccer_is_shown_on_the_field(soccer_demos: Demos) -> None:
    """A cell has its weight of greatest size, counted from the upper left; ways stay inside."""
    place = stage(soccer_demos)
    weights = np.zeros((1, 384, 5))
    weights[0, 2 * (3 * 12 + 1) : 2 * (3 * 12 + 1) + 2, 4] = 1, -3  # column 3, row 1 from below
    shown = place.weights(weights)
    assert shown.shape == (1, 192)
    assert np.flatnonzero(shown[0]).tolist() == [(12 - 1 - 1) * 16 + 3]
    assert shown.min() == -3
    demo = soccer_demos.correct[0]
    (x, y), *_ = place.points(demo.states, demo.actions)
    assert (x, y) == (75, 480)  # 0.15 m from the left and 0.24 m from below


def test_soccer_has_a_player(soccer_demos: Demos, tmp_path: Path) -> None:
    """The field's player has the same form as a maze's."""
    conditions = conditions_of(
        soccer_demos, {**SOCCER, "max_iterations": 2}, ("unified", "unified-incorrect"), ("all",)
    )
    results = run_trials(
        [*conditions.values()], trials=1, store=Store(tmp_path / "trials.sqlite"), seed=SEED
    )
    table = measure_trials(results, conditions.values())

    def replayed(key: Key, k: int) -> Trial:
        return results.trial(conditions[key], k, snapshots=True)

    content = content_of(players.learning(soccer_demos, table, replayed, set="all").html)
    assert len(content["plays"]) == 9
    assert content["plays"][0]["panels"][0]["frames"][-1][1].endswith("after 2 iterations")


# --- the page --------------------------------------------------------------------------------


def test_a_player_needs_nothing_from_elsewhere(
    made: Player, small_demos: Demos, trials: pd.DataFrame, replayed: Any
) -> None:
    """A player is ASCII, names no address but that of SVG, is small, and is always the same."""
    assert made.html.isascii()
    text = made.html.replace("http://www.w3.org/2000/svg", "")
    assert "//" not in text
    assert not re.search(r"<link|<img|url\(|import|@[A-Z]+@", text)
    assert len(made.html) < 150_000
    assert players.learning(small_demos, trials, replayed, set=GENERAL).html == made.html


def test_words_cannot_break_the_page(made: Player) -> None:
    """The data closes no script, and the words that stand there without scripts are escaped."""
    assert made.html.count("</script>") == 1
    (said,) = re.findall(r'<div class="replay"[^>]*><p>([^<]*)</p></div>', made.html)
    assert "&#x27;" in said or "&#39;" in said


@given(
    st.lists(st.sampled_from([(0, 1), (1, 0), (0, -1), (-1, 0), (0, 0)]), max_size=40),
)
def test_a_path_has_each_line_once(steps: list[tuple[int, int]]) -> None:
    """The path covers the same lines between neighbours as the way, and none of them twice."""
    way = list(accumulate(steps, lambda a, b: (a[0] + b[0], a[1] + b[1]), initial=(0, 0)))
    walked = {frozenset(pair) for pair in pairwise(way) if len({*pair}) == 2}
    drawn: list[frozenset[tuple[int, int]]] = []
    for part in path(way).split("M")[1:]:
        numbers = [int(number) for number in re.findall(r"-?\d+", part)]
        corners = list(zip(numbers[::2], numbers[1::2], strict=True))
        for (x, y), (to_x, to_y) in pairwise(corners):
            n = max(abs(to_x - x), abs(to_y - y))
            line = [(x + i * (to_x - x) // n, y + i * (to_y - y) // n) for i in range(n + 1)]
            drawn += [frozenset(pair) for pair in pairwise(line)]
    assert len(drawn) == len({*drawn})
    assert {*drawn} == walked
