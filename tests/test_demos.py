"""Demonstration files: round trips, refusals in one line, warnings, and fuzzing."""

from __future__ import annotations

import copy
import json
import os
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema  # type: ignore[import-untyped] # it ships no types
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from replication import demos as module
from replication.demos import (
    Demo,
    DemoError,
    Demos,
    DemoWarning,
    check_demos,
    content_hash,
    json_schema,
    load_demos,
    parse_demos,
    save_demos,
)
from replication.envs import ACTIONS, Maze

DATA = Path(__file__).parent.parent / "data" / "demos"
STORED = sorted(path for path in DATA.glob("*.json") if path.name != "schema.json")

EXAMPLE: dict[str, Any] = {
    "format": "replication-demos",
    "version": 1,
    "task": "tiny",
    "description": "Käse\n",
    "environment": {
        "kind": "maze",
        "map": ["S.#", "..G"],
        "actions": ["up", "down", "right", "left"],
        "start": [0, 0],
        "goal": [1, 2],
    },
    "correct": [
        {
            "name": "c",
            "actions": ["right", "down", "right"],
            "states": [[0, 0], [0, 1], [1, 1], [1, 2]],
        }
    ],
    "incorrect": [
        {"name": "h", "kind": "hit", "actions": ["up", "down"], "states": [[0, 0], [0, 0], [1, 0]]},
        {
            "name": "d",
            "kind": "detour",
            "actions": ["down", "right", "right"],
            "states": [[0, 0], [1, 0], [1, 1], [1, 2]],
        },
        {"name": "h2", "kind": "hit", "actions": ["left"], "states": [[0, 0], [0, 0]]},
    ],
}


@pytest.fixture
def write(tmp_path: Path) -> Callable[[Any], Path]:
    """Return a function that writes JSON values, text or bytes into a file."""

    def write(content: Any) -> Path:
        path = tmp_path / "demos.json"
        if not isinstance(content, str | bytes):
            content = json.dumps(content)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def edited(*changes: tuple[tuple[str | int, ...], Any]) -> dict[str, Any]:
    """Copy the example and set (or, for ..., delete) what stands at some places."""
    document = copy.deepcopy(EXAMPLE)
    for place, value in changes:
        holder: Any = document
        for key in place[:-1]:
            holder = holder[key]
        if value is ...:
            del holder[place[-1]]
        elif isinstance(holder, list) and place[-1] == len(holder):
            holder.append(value)
        else:
            holder[place[-1]] = value
    return document


def demo(name: str, kind: str, *actions: str, maze: Maze) -> Demo:
    """Replay the named actions."""
    numbers = [ACTIONS.index(action) for action in actions]
    return Demo(name, kind, maze.replay(numbers), np.array(numbers))


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


def test_worked_example(write: Callable[[Any], Path]) -> None:
    """A small file is read into the states and actions that a person reads in it."""
    demos = load_demos(write(EXAMPLE))
    assert demos.task == "tiny"
    assert demos.environment == Maze(("S.#", "..G"))
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


def test_what_follows_may_be_left_out(write: Callable[[Any], Path]) -> None:
    """A file without states, start, goal and names of actions says the same."""
    short = edited(
        (("description",), ...),
        (("environment", "actions"), ...),
        (("environment", "start"), ...),
        (("environment", "goal"), ...),
        (("correct", 0, "states"), ...),
        (("incorrect", 1, "states"), None),
    )
    whole = load_demos(write(EXAMPLE))
    assert load_demos(write(short)) == Demos(
        whole.task, whole.environment, whole.correct, whole.incorrect
    )
    assert load_demos(write(edited((("incorrect",), ...)))) == whole.select("none")


def test_select(write: Callable[[Any], Path]) -> None:
    """Kinds are listed in the file's order; a selection keeps them and refuses absent ones."""
    demos = load_demos(write(EXAMPLE))
    assert demos.kinds == ("hit", "detour")
    assert demos.select("all") == demos == demos.select("detour+hit")
    assert demos.select("none").incorrect == ()
    assert [d.name for d in demos.select("hit").incorrect] == ["h", "h2"]
    assert demos.select("hit").correct == demos.correct
    for wrong in ("hits", "", "hit+", "all+hit", "hit, detour"):
        with pytest.raises(DemoError, match=r"no incorrect demo .*; use all, none, hit, detour$"):
            demos.select(wrong)


def test_demos_validate_themselves() -> None:
    """Demos that a program makes are checked as those of a file are."""
    maze = Maze(("S.G",))
    right = demo("a", "correct", "right", "right", maze=maze)
    bad = demo("b", "hit", "up", maze=maze)
    Demos("t", maze, (right,), (bad,))
    with pytest.raises(DemoError, match="two demos are named 'a'"):
        Demos("t", maze, (right, right))
    with pytest.raises(DemoError, match="'b' is correct; its kind must be 'correct'"):
        Demos("t", maze, (bad,))
    with pytest.raises(DemoError, match="'b' is incorrect, of kind 'correct'"):
        Demos("t", maze, (right,), (demo("b", "correct", "up", maze=maze),))
    with pytest.raises(DemoError, match="no correct demo"):
        Demos("t", maze, ())
    with pytest.raises(DemoError, match="letters, digits"):
        Demos("../t", maze, (right,))
    with pytest.raises(DemoError, match=r"actions must be 0\.\.3"):
        Demos("t", maze, (Demo("a", "correct", np.array([0, 1]), np.array([4])),))
    with pytest.raises(DemoError, match=r"step 1 .* leads to \[0,1\], but the file claims \[0,2\]"):
        Demos("t", maze, (Demo("a", "correct", np.array([0, 2]), np.array([2])),))
    with pytest.raises(DemoError, match="one-dimensional array of integers"):
        Demo("a", "correct", np.array([0.0, 1.0]), np.array([2]))


def test_content_hash_sees_what_the_learner_sees(write: Callable[[Any], Path]) -> None:
    """Names, description and layout leave the hash alone; map, actions, kinds, order change it."""

    def of(*changes: tuple[tuple[str | int, ...], Any]) -> str:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DemoWarning)
            return content_hash(load_demos(write(edited(*changes))))

    same = of()
    assert same == "fd501d29923d3fb07e160ae4204c8b9856e874ad52ed4fe92017d68fd6e810aa"
    assert (
        of((("description",), "x"), (("task",), "other"), (("incorrect", 0, "name"), "x")) == same
    )
    assert of((("correct", 0, "states"), ...)) == same
    swapped = [EXAMPLE["incorrect"][i] for i in (1, 0, 2)]
    others = {
        of((("environment", "map"), ["S..", "..G"])),
        of((("incorrect", 0, "kind"), "bump")),
        of((("incorrect",), swapped)),
        of((("incorrect",), [])),
        of((("incorrect", 2), {"name": "h2", "kind": "hit", "actions": ["up"]})),
        of((("correct", 0), {"name": "c", "actions": ["down", "right", "right"]})),
    }
    assert len(others | {same}) == 7


# --- warnings --------------------------------------------------------------------------------


def test_consistent_demos_give_no_warning(write: Callable[[Any], Path]) -> None:
    """One demo that asks for one action in each state is silent, and so are equal demos."""
    assert check_demos(write(EXAMPLE)) == []
    twin = EXAMPLE["correct"][0] | {"name": "twin"}
    assert check_demos(write(edited((("correct", 1), twin)))) == []


def test_two_actions_in_one_state_are_a_warning(write: Callable[[Any], Path]) -> None:
    """A demo at odds with itself is read, with a warning that names the state and the actions."""
    path = write(
        edited((("correct",), [{"name": "c", "actions": ["up", "right", "down", "right"]}]))
    )
    with pytest.warns(DemoWarning, match="d = 0 cannot be reached") as caught:
        demos = load_demos(path)
    assert demos.conflicts() == (0,)
    assert [str(one.message) for one in caught] == check_demos(path)
    assert "ask for 'up' and 'right' in [0,0]" in str(caught[0].message)
    assert Path(caught[0].filename) == Path(__file__)


def test_two_trajectories_are_a_warning(write: Callable[[Any], Path]) -> None:
    """Different correct demos are read, with a warning that mu_E is an average."""
    other = {"name": "c2", "actions": ["down", "right", "right"]}
    first, second = check_demos(write(edited((("correct", 1), other))))
    assert "'down' and 'right' in [0,0]" in first
    assert "2 different trajectories: mu_E is their average" in second


# --- writing ---------------------------------------------------------------------------------


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_stored_files_are_as_saved(path: Path, tmp_path: Path) -> None:
    """Each stored file is sound, without a warning, and byte for byte what is saved of it."""
    assert check_demos(path) == []
    save_demos(load_demos(path), tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == path.read_bytes()
    jsonschema.validate(json.loads(path.read_text()), json_schema())


def test_layout(write: Callable[[Any], Path]) -> None:
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


def test_saving_is_all_or_nothing(
    write: Callable[[Any], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
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

REFUSALS: dict[str, tuple[list[tuple[tuple[str | int, ...], Any]], str]] = {
    "format": ([(("format",), "demos")], "unknown format 'demos'; this program reads"),
    "no format": ([(("format",), ...)], "'format' is missing; write \"format\": "),
    "version": ([(("version",), 2)], "unknown version 2; this program reads 1"),
    "true version": ([(("version",), True)], "unknown version true; this program reads 1"),
    "float version": ([(("version",), 1.0)], "unknown version 1.0; this program reads 1"),
    "no task": ([(("task",), ...)], "the field 'task' is missing; add it"),
    "path as task": ([(("task",), "../x")], "task: '../x' does not fit: use letters, digits, '-'"),
    "misspelt": (
        [(("correct", 0, "sates"), [])],
        "correct[0] (demo 'c'): unknown field 'sates'; did you mean 'states'? the fields are name",
    ),
    "misspelt on top": (
        [(("descriptoin",), "")],
        "field 'descriptoin'; did you mean 'description'?",
    ),
    "strange field": (
        [(("environment", "xyz\n"), 1)],
        r"environment: unknown field 'xyz\n'; the fie",
    ),
    "no kind": (
        [(("incorrect", 1, "kind"), ...)],
        "incorrect[1] (demo 'd'): the field 'kind' is missing; add it",
    ),
    "kind": (
        [(("incorrect", 0, "kind"), "Hit!")],
        "incorrect[0] (demo 'h').kind: 'Hit!' does not f",
    ),
    "reserved kind": (
        [(("incorrect", 0, "kind"), "all")],
        "demo 'h' is incorrect, of kind 'all'; us",
    ),
    "kind of correct": (
        [(("correct", 0, "kind"), "correct")],
        "correct[0] (demo 'c'): unknown field",
    ),
    "environment": (
        [(("environment", "kind"), "tank")],
        "environment.kind: 'tank' does not fit: input",
    ),
    "no environment": ([(("environment",), ...)], "the field 'environment' is missing"),
    "not rectangular": (
        [(("environment", "map"), ["S.#", "..G."])],
        "environment: map line 2 has 4 characters, but line 1 has 3; make all lines equally long",
    ),
    "two starts": (
        [(("environment", "map"), ["S.S", "..G"])],
        "environment: the map has 2 starts 'S'",
    ),
    "no goal": (
        [(("environment", "map"), ["S.#", "..."])],
        "environment: the map has no goal; mark",
    ),
    "closed": (
        [(("environment", "map"), ["S#.", "#.G"])],
        "environment: the goal at map line 2, colu",
    ),
    "no map": ([(("environment", "map"), [])], "environment: the map is empty"),
    "map as text": (
        [(("environment", "map"), "S.G")],
        "environment.map: 'S.G' does not fit: input s",
    ),
    "start": (
        [(("environment", "start"), [1, 0])],
        "environment: 'start' is [1, 0], but by the map it is [0,0]; write that, or leave it out",
    ),
    "goal": (
        [(("environment", "goal"), [1, 1])],
        "environment: 'goal' is [1, 1], but by the map it is",
    ),
    "order of actions": (
        [(("environment", "actions"), ["down", "up", "right", "left"])],
        "environment: 'actions' is ['down', 'up', 'right', 'left'], but by the map it is [\"up\"",
    ),
    "no correct demo": (
        [(("correct",), [])],
        "there is no correct demo; give at least one from the start to the goal",
    ),
    "unknown action": (
        [(("correct", 0, "actions", 1), "dwon")],
        "step 2 of demo 'c': unknown action 'dwon'; did you mean 'down'? use up, down, right, left",
    ),
    "action as number": (
        [(("correct", 0, "actions", 1), 1)],
        "correct[0] (demo 'c').actions[1]: 1 do",
    ),
    "hits a wall": (
        [(("incorrect", 0, "states", 1), [0, 1])],
        "step 1 of demo 'h': 'up' from [0,0] hits a wall and stays, but the file claims [0,1]; "
        "write [0,0] or change the action",
    ),
    "does not follow": (
        [(("correct", 0, "states", 2), [0, 2])],
        "step 2 of demo 'c': 'down' from [0,1] leads to [1,1], but the file claims [0,2]; "
        "write [1,1] or change the action",
    ),
    "off the map": (
        [(("correct", 0, "states", 3), [1, 3])],
        "leads to [1,2], but the file claims [1,3]",
    ),
    "begins elsewhere": (
        [(("correct", 0, "states", 0), [1, 0])],
        "demo 'c' begins at [1,0], but the start is [0,0]; write [0,0]",
    ),
    "a state too few": (
        [(("correct", 0, "states", 3), ...)],
        "demo 'c' has 3 actions and 3 states; give 4 states, the last one reached included, or",
    ),
    "a state too many": (
        [(("correct", 0, "states", 4), [1, 2])],
        "demo 'c' has 3 actions and 5 states",
    ),
    "no states": ([(("correct", 0, "states"), [])], "demo 'c' has 3 actions and 0 states; give 4"),
    "empty": (
        [(("incorrect", 2, "actions"), []), (("incorrect", 2, "states"), [[0, 0]])],
        "demo 'h2' is empty; give it at least one action",
    ),
    "goes on": (
        [(("correct", 0, "actions", 3), "up"), (("correct", 0, "states"), ...)],
        "demo 'c' goes on after reaching the goal at step 3; drop the 1 steps that follow",
    ),
    "incorrect goes on": (
        [(("incorrect", 1, "actions", 3), "left"), (("incorrect", 1, "states"), ...)],
        "demo 'd' goes on after reaching the goal at step 3",
    ),
    "misses the goal": (
        [(("correct", 0, "actions", 2), ...), (("correct", 0, "states", 3), ...)],
        "demo 'c' is correct, but ends at [1,1], not at the goal [1,2]; add the missing steps or",
    ),
    "same name": (
        [(("incorrect", 1, "name"), "c")],
        "two demos are named 'c'; give each its own name",
    ),
    "no name": (
        [(("correct", 0, "name"), "")],
        "correct[0] (demo '').name: '' does not fit: string",
    ),
    "name of two lines": (
        [(("correct", 0, "name"), "a\nb")],
        r"(demo 'a\nb').name: 'a\nb' does not f",
    ),
    "surrogate": ([(("correct", 0, "name"), "\ud800")], r"name: '\ud800' does not fit"),
    "surrogate field": ([(("\ud800",), 1)], r"'\ud800' does not fit"),
    "float state": (
        [(("correct", 0, "states", 1, 1), 1.0)],
        "correct[0] (demo 'c').states[1][1]: 1.0 does not fit: input should be a valid integer",
    ),
    "true state": (
        [(("correct", 0, "states", 1, 1), True)],
        "true does not fit: input should be a v",
    ),
    "negative state": (
        [(("correct", 0, "states", 1, 1), -1)],
        "-1 does not fit: input should be grea",
    ),
    "state of three": (
        [(("correct", 0, "states", 1), [0, 1, 0])],
        "[0, 1, 0] does not fit: list sho",
    ),
    "large": (
        [(("correct", 0, "states", 1, 1), 10**15)],
        "1000000000000000 does not fit: input shou",
    ),
    "huge": ([(("correct", 0, "states", 1, 1), 10**400)], "the number 1000000000000000000"),
    "NaN": (
        [(("correct", 0, "states", 1, 1), float("nan"))],
        "NaN is not a JSON number; write a fin",
    ),
    "infinity": ([(("x",), float("-inf"))], "-Infinity is not a JSON number"),
    "list for an object": (
        [(("correct", 0), ["right"])],
        "correct[0]: ['right'] does not fit: input",
    ),
    "object for a list": (
        [(("correct",), {"a": 1})],
        "correct: an object does not fit: input should",
    ),
    "many fields": ([((f"x{i}",), 1) for i in range(60)], "an object has 67 fields"),
}


@pytest.mark.parametrize("case", REFUSALS)
def test_refusals(case: str, write: Callable[[Any], Path]) -> None:
    """Each way to spoil a file is refused in one line that names the place and the mend."""
    changes, message = REFUSALS[case]
    assert message in refusal(write(edited(*changes)))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b" \n", "is empty"),
        (
            b"{",
            "is not JSON: Expecting property name enclosed in double quotes at line 1, column 2",
        ),
        (
            b"{\n \"format\": 'x'}",
            "is not JSON: Expecting value at line 2, column 12; mend it there",
        ),
        (b"{} {}", "is not JSON: Extra data at line 1, column 4"),
        (b"[]", "holds []; a demonstration file is one JSON object"),
        (b"null", "holds null; a demonstration file is one JSON object"),
        ("{}".encode("utf-16"), "is not UTF-8 text (byte 1); save it as UTF-8"),
        (b'{"a": "\xff"}', "is not UTF-8 text (byte 8)"),
        (b'{"a": 1, "b": {"c": 1, "c": 2}}', "the field 'c' stands twice in one object; keep one"),
        (b'{"a": 1e999}', "the number 1e999 is too large"),
        (b'{"a": ' + b"9" * 10_000 + b"}", "the number 9999999999"),
        (b"[" * 100_000, "is nested too deeply"),
        (b'{"a":' * 100_000 + b"1" + b"}" * 100_000, "is nested too deeply"),
        (b" " * 10_000_001, "is larger than 10 MB; drop some demos"),
    ],
)
def test_refusals_of_bytes(content: bytes, message: str, write: Callable[[Any], Path]) -> None:
    """What is not JSON, or not sane JSON, is refused with its place."""
    assert refusal(write(content)).startswith(message)


def test_a_byte_order_mark_is_ignored(write: Callable[[Any], Path]) -> None:
    """An editor's byte order mark does no harm."""
    content = json.dumps(EXAMPLE).encode()
    assert load_demos(write(b"\xef\xbb\xbf" + content)) == load_demos(write(content))


def test_refusals_of_paths(tmp_path: Path) -> None:
    """A missing file, a folder, a pipe and a device are refused at once."""
    assert refusal(tmp_path / "none.json") == "cannot be read (no such file or directory)"
    assert "is not a regular file" in refusal(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    assert "is not a regular file" in refusal(tmp_path / "pipe")
    assert "is not a regular file" in refusal("/dev/zero")
    with pytest.raises(DemoError, match="cannot be read"):
        load_demos("a\0b")


def test_large_files_are_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The size is looked at before the file is opened; content that has no file is limited too."""
    path = tmp_path / "large.json"
    with path.open("wb") as file:
        file.truncate(10_000_001)
    monkeypatch.setattr(Path, "open", None)
    assert refusal(path) == "is larger than 10 MB; drop some demos"
    with pytest.raises(DemoError, match="is larger than 10 MB"):
        parse_demos(b" " * 10_000_001)


def test_unreadable_file(write: Callable[[Any], Path], monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that may not be opened is refused with the system's reason."""
    path = write(EXAMPLE)

    def denied(self: Path, mode: str) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", denied)
    assert refusal(path) == "cannot be read (permission denied)"


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


# --- schema ----------------------------------------------------------------------------------


def test_stored_schema_is_current() -> None:
    """The stored schema is the one that the program uses."""
    assert json.loads((DATA / "schema.json").read_text()) == json_schema()


def test_schema_agrees_with_the_program(write: Callable[[Any], Path]) -> None:
    """The schema takes the example and refuses files that are wrong in structure."""
    validator = jsonschema.Draft202012Validator(json_schema())
    validator.check_schema(json_schema())
    assert validator.is_valid(EXAMPLE)
    for case in ("misspelt", "no kind", "kind", "version", "no correct demo", "state of three"):
        changes, _ = REFUSALS[case]
        assert not validator.is_valid(edited(*changes))


def test_docstring_example_is_sound(write: Callable[[Any], Path]) -> None:
    """The file that the module shows can be read."""
    shown = re.search(r"json\n\n(    \{.*?\n    \})\n", module.__doc__ or "", re.DOTALL)
    assert shown is not None
    assert load_demos(write(shown[1])).kinds == ("hit",)
