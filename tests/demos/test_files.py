from __future__ import annotations

import copy
import json
import os
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from replication.demos.checks import DemoError, DemoWarning
from replication.demos.files import check_demos, load_demos, save_demos
from replication.demos.model import Demos, content_hash
from replication.envs.maze import Maze
from tests.demos.example import EXAMPLE, MAZE, STORED, Changes, demo, edited

Write = Callable[[Any], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return a function that writes JSON values, text or bytes into a file."""

    def write(content: Any) -> Path:
        path = tmp_path / "demos.json"
        if not isinstance(content, str | bytes):
            content = json.dumps(content)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def refusal(path: str | os.PathLike[str]) -> str:
    """Return the one line with which a file is refused, by both functions alike."""
    with pytest.raises(DemoError) as caught:
        load_demos(path)
    with pytest.raises(DemoError) as again:
        check_demos(path)
    message = str(caught.value)
    assert str(again.value) == message
    assert message.isprintable()
    assert message.startswith(f"{os.fspath(path)}: ")
    assert len(message) < 400 + len(os.fspath(path))
    return message.removeprefix(f"{os.fspath(path)}: ")


# --- what a program sees ---------------------------------------------------------------------


def test_worked_example(write: Write) -> None:
    """A small file is read into the states and actions that a person reads in it."""
    demos = load_demos(write(EXAMPLE))
    assert demos.task == "tiny"
    assert demos.environment == MAZE
    (correct,) = demos.correct
    assert (correct.name, correct.kind) == ("c", "correct")
    assert correct.actions.tolist() == [2, 1, 2]
    assert correct.states.tolist() == [0, 1, 4, 5]
    assert [d.kind for d in demos.incorrect] == ["hit", "detour", "hit"]
    assert demos.incorrect[0].states.tolist() == [0, 0, 3]
    for array in (correct.states, correct.actions):
        assert array.dtype == np.int64
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_what_follows_may_be_left_out(write: Write) -> None:
    """A file without states, start, goal and names of actions says the same."""
    left_out = ("description", *(f"environment.{name}" for name in ("actions", "start", "goal")))
    short = dict.fromkeys((*left_out, "correct.0.states"), ...) | {"incorrect.1.states": None}
    whole = load_demos(write(EXAMPLE))
    assert load_demos(write(edited(short))) == replace(whole, description="")
    assert load_demos(write(edited({"incorrect": ...}))) == whole.select("none")


def test_how_a_file_is_written_does_not_matter_to_a_learner(write: Write) -> None:
    """The hash of what a learner sees is this number, whether or not states are written down."""
    demos = load_demos(write(edited({"correct.0.states": ...})))
    assert content_hash(demos) == content_hash(load_demos(write(EXAMPLE)))
    assert content_hash(demos) == "fd501d29923d3fb07e160ae4204c8b9856e874ad52ed4fe92017d68fd6e810aa"


# --- warnings --------------------------------------------------------------------------------


def test_consistent_demos_give_no_warning(write: Write) -> None:
    """One demo that asks for one action in each state is silent, and so are equal demos."""
    assert check_demos(write(EXAMPLE)) == []
    twin = EXAMPLE["correct"][0] | {"name": "twin"}
    assert check_demos(write(edited({"correct.1": twin}))) == []


def test_two_actions_in_one_state_are_a_warning(write: Write) -> None:
    """A demo at odds with itself is read, with a warning that names the state and the actions."""
    correct = {"name": "c", "actions": ["up", "right", "down", "right"]}
    path = write(edited({"correct": [correct]}))
    with pytest.warns(DemoWarning, match="d = 0 cannot be reached") as caught:
        demos = load_demos(path)
    assert demos.conflicts() == (0,)
    assert [str(warning.message) for warning in caught] == check_demos(path)
    assert "take 'up' and 'right' in [0,0]" in str(caught[0].message)
    assert Path(caught[0].filename) == Path(__file__)


def test_two_trajectories_are_a_warning(write: Write) -> None:
    """Different correct demos are read, with a warning that mu_E is an average."""
    other = {"name": "c2", "actions": ["down", "right", "right"]}
    first, second = check_demos(write(edited({"correct.1": other, "incorrect.1": ...})))
    assert "'down' and 'right' in [0,0]" in first
    assert "2 different trajectories: mu_E is their average" in second


def test_incorrect_demo_without_effect_is_a_warning(write: Write) -> None:
    """An incorrect demo that marks no pair of its own is named, and only such a one."""
    early = {"name": "early", "kind": "stop", "actions": ["right", "down"]}
    path = write(edited({"incorrect.3": early}))
    with pytest.warns(DemoWarning, match="incorrect demo 'early' has no effect") as caught:
        load_demos(path)
    assert [str(warning.message) for warning in caught] == check_demos(path)
    late = early | {"actions": ["right", "down", "down"]}
    assert check_demos(write(edited({"incorrect.3": late}))) == []


# --- writing ---------------------------------------------------------------------------------


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_stored_files_are_as_saved(path: Path, tmp_path: Path) -> None:
    """Each stored file is sound, without a warning, and byte for byte what is saved of it."""
    assert check_demos(path) == []
    save_demos(load_demos(path), tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_layout(write: Write) -> None:
    """The saved text is JSON of the same value; a demo's actions and states take one line each."""
    path = write(EXAMPLE)
    save_demos(load_demos(path), path)
    text = path.read_text(encoding="utf-8")
    assert json.loads(text) == EXAMPLE
    lines = text.splitlines()
    assert '      "actions": ["right", "down", "right"],' in lines
    assert '      "states": [[0,0], [0,1], [1,1], [1,2]]' in lines
    assert '      "S.#",' in lines
    assert text.endswith("}\n")
    assert "Käse\\n" in text


WORDS = st.text(
    st.characters(codec="utf-8", exclude_characters="".join(map(chr, (*range(32), 127))))
)


@given(st.data(), WORDS, st.booleans())
@settings(max_examples=50, deadline=None)
def test_round_trip(tmp_path_factory: Any, data: st.DataObject, text: str, long: bool) -> None:
    """Whatever Demos can be made are read back equal, and saved again to the same bytes."""
    maze = Maze(("S" + "." * 5 * long + "G",))
    steps = maze.goal - maze.start
    back = data.draw(st.lists(st.sampled_from(["up", "down", "left"]), max_size=5))
    demos = Demos(
        "task_1",
        maze,
        (demo(text or "c", "correct", *back, *["right"] * steps, maze=maze),),
        (demo(text + "x", "no-move", *back, "up", maze=maze),),
        description=text,
    )
    if len(text) > 99:
        return
    path = tmp_path_factory.mktemp("round") / "demos.json"
    save_demos(demos, path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DemoWarning)
        again = load_demos(path)
    assert again == demos
    saved = path.read_bytes()
    save_demos(again, path)
    assert path.read_bytes() == saved


def test_saving_is_all_or_nothing(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    """When a write fails, the old file is whole, nothing is left behind and the error is clear."""
    path = write(EXAMPLE)
    before, demos = path.read_bytes(), load_demos(path)

    def full(self: Path, content: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(DemoError, match="cannot be written"):
        save_demos(demos, path)
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_saving_refuses_what_cannot_be_read(tmp_path: Path) -> None:
    """Names that no file may hold, and places that no file can take, are refused clearly."""
    maze = Maze(("SG",))
    for name in ("x\n", "", "x" * 101, "\ud800"):
        demos = Demos("t", maze, (demo(name, "correct", "right", maze=maze),))
        with pytest.raises(DemoError) as caught:
            save_demos(demos, tmp_path / "demos.json")
        assert str(caught.value).isprintable()
    demos = Demos("t", maze, (demo("x", "correct", "right", maze=maze),))
    assert list(tmp_path.iterdir()) == []
    taken = tmp_path / "taken"
    taken.touch()
    for path in (taken / "demos.json", tmp_path):
        with pytest.raises(DemoError, match="cannot be written"):
            save_demos(demos, path)
    assert list(tmp_path.iterdir()) == [taken]


# --- refusals --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"task": ...}, "the field 'task' is missing; add it"),
        ({"environment.goal": [1, 1]}, "environment: 'goal' is [1, 1], but"),
        ({"correct.0.actions.1": "dwon"}, "step 2 of demo 'c': unknown action 'dwon' (did you me"),
        ({"correct.0.states.2": [0, 2]}, "'down' from [0,1] leads to [1,1], but the file claims"),
        ({"correct.0.states.0": [1, 0]}, "demo 'c' starts at [1,0], but the start is [0,0]; wri"),
        ({"incorrect.0.states.1": [0, 1]}, "'up' from [0,0] hits a wall and stays, but the file"),
        ({"correct.0.states": []}, "demo 'c' has 3 actions and 0 states; give 4"),
        ({"incorrect.2.actions": [], "incorrect.2.states": [[0, 0]]}, "demo 'h2' is empty; give"),
        ({"incorrect.1.actions.3": "up", "incorrect.1.states": ...}, "demo 'd' goes on after"),
        ({"correct": []}, "there is no correct demo; give at least one from the start to the goal"),
        ({"incorrect.1.name": "c"}, "two demos are named 'c'; give each its own name"),
        ({"incorrect.0.kind": "all"}, "demo 'h' is incorrect, of kind 'all'; use small"),
        ({"correct.0.actions.2": ..., "correct.0.states.3": ...}, "misses the goal [1,2]; add the"),
    ],
)
def test_refusals(changes: Changes, message: str, write: Write) -> None:
    """Whatever finds the fault - structure, moves, model - one line names the place and the fix."""
    assert message in refusal(write(edited(changes)))


def test_refusals_of_paths(tmp_path: Path) -> None:
    """What cannot be read, or is not JSON, is refused under the file's name."""
    assert refusal(tmp_path / "none.json") == "cannot be read (no such file or directory)"
    assert "is not a regular file" in refusal(tmp_path)
    (tmp_path / "empty.json").touch()
    assert refusal(tmp_path / "empty.json").startswith("is empty")
    with pytest.raises(DemoError, match=r"'a\\x00b': cannot be read"):
        load_demos("a\0b")


# --- fuzzing ---------------------------------------------------------------------------------

TEXT = json.dumps(EXAMPLE).encode()
SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-2, 8),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.sampled_from(["up", "right", "S.G", "hit", "maze", "\ud800", "a\u2028b"]),
)
TREES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=5,
)


def sound_or_refused(content: bytes, path: Path) -> None:
    """Read the content: it gives sound demos that can be saved, or one line of DemoError."""
    path.write_bytes(content)
    try:
        check_demos(path)
    except DemoError as error:
        assert str(error).isprintable()  # noqa: PT017 - refusing is one of two right answers
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DemoWarning)
        demos = load_demos(path)
        save_demos(demos, path)
        assert load_demos(path) == demos


@given(
    edits=st.lists(
        st.tuples(
            st.integers(0, len(TEXT)),
            st.integers(0, 4),
            st.binary(max_size=4) | st.just(b"[" * 2000),
        ),
        min_size=1,
        max_size=4,
    )
)
@settings(max_examples=300, deadline=None)
@example(edits=[(0, len(TEXT), b"1" * 5000)])
def test_any_bytes_are_sound_or_refused(tmp_path_factory: Any, edits: Any) -> None:
    """Spliced bytes never raise anything but DemoError."""
    content = TEXT
    for start, removed, added in edits:
        content = content[:start] + added + content[start + removed :]
    sound_or_refused(content, tmp_path_factory.getbasetemp() / "bytes.json")


@given(data=st.data())
@settings(max_examples=300, deadline=None)
def test_any_tree_is_sound_or_refused(tmp_path_factory: Any, data: st.DataObject) -> None:
    """JSON with values replaced, removed, added or renamed never raises anything but DemoError."""
    document: Any = copy.deepcopy(EXAMPLE)
    for _ in range(data.draw(st.integers(1, 3))):
        holder = document
        while True:
            keys: list[Any] = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
            if not keys:
                break
            key = data.draw(st.sampled_from(keys))
            if not isinstance(holder[key], dict | list) or data.draw(st.integers(0, 3)) == 0:
                change = data.draw(st.sampled_from(["replace", "remove", "add"]))
                if change == "replace":
                    holder[key] = data.draw(TREES)
                elif change == "remove":
                    del holder[key]
                elif isinstance(holder, dict):
                    holder[data.draw(st.text(max_size=5))] = data.draw(TREES)
                else:
                    holder.insert(key, data.draw(TREES | st.just(holder[key])))
                break
            holder = holder[key]
    path = tmp_path_factory.getbasetemp() / "tree.json"
    sound_or_refused(json.dumps(document).encode(), path)
