from __future__ import annotations

import io
import json
import signal
from pathlib import Path

import gymnasium
import pytest

from replication import Maze, demonstrate, load_demos, record, save_demos
from replication.errors import UserError
from replication.recording import terminal
from tests.terminal import Typist

MAP = "....G\n.##..\nS....\n"
RIGHT, UP, DOWN = "\x1b[C", "\x1b[A", "\x1bOB"
WAY = RIGHT * 4 + UP * 2
FILE = "mine.json"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with a map."""
    (tmp_path / "map.txt").write_text(MAP)
    return tmp_path


RECORD = ("-m", "replication", "demos", "record", FILE)


def typist(folder: Path, **environment: str) -> Typist:
    """Begin to record in a maze."""
    new = Typist(*RECORD, "--map", "map.txt", cwd=folder, columns=80, lines=24, **environment)
    new.see("save and quit")
    return new


def test_a_session(folder: Path) -> None:
    """Arrows, undo, two kinds, a replay, and what is printed in the end; the terminal is as before.

    Each demonstration is in the file as soon as it is finished.
    """
    at = typist(folder)
    assert "S > @ . ." in at.press(RIGHT * 2, "step 2")
    assert "S @ . . ." in at.press("\x7f", "took back: right")
    assert "S > @ . ." in at.press("2", "step 2")
    at.press("r", "started again")
    at.press(WAY, "reaches the goal")
    at.press("\r", "> correct")
    at.press("\r", "mine: 1 correct")
    assert len(load_demos(folder / FILE).correct) == 1
    at.press(DOWN + RIGHT + "\r", "What kind of mistake")
    at.press("hit\r", "mine: 1 correct, 1 hit")
    at.press("3\r", "> hit")
    at.press("bump\r", "1 bump")
    at.press("p", "replay: step 1 of 1")
    at.press("x", "step 0, state 10")
    at.press("q", "demos: mine.json")
    assert at.end() == 0
    assert at.settings == at.before
    assert at.told.endswith("\x1b[?1049lmine: 1 correct, 1 hit, 1 bump\ndemos: mine.json\n")
    kinds = [demo.kind for demo in load_demos(folder / FILE).incorrect]
    assert kinds == ["hit", "bump"]


def test_two_who_record_in_one_file_lose_nothing(folder: Path) -> None:
    """What another has added meanwhile stays; once it is moved away, one's own can be kept."""
    one, other = typist(folder), typist(folder)
    one.press(WAY + "\r\r", "mine: 1 correct")
    other.press(WAY + "\r\r", "was changed elsewhere; move it away")
    (folder / FILE).rename(folder / "first.json")
    other.press("\r", "mine: 1 correct")
    assert len(load_demos(folder / FILE).correct) == 1
    assert len(load_demos(folder / "first.json").correct) == 1
    for at in (one, other):
        at.press("q", "demos: mine.json")
        assert at.end() == 0


def test_what_is_unusual_is_told_in_the_end(folder: Path) -> None:
    """A mistake that shows nothing wrong is saved, with the warning that `demos check` gives."""
    at = typist(folder)
    at.press(WAY + "\r\r" + RIGHT + "\rslow\rq", "has no effect")
    assert at.end() == 0


def test_a_file_is_continued(folder: Path) -> None:
    """Without a map, recording goes on in the environment of the file; all in it is kept."""
    before = demonstrate("mine", Maze.from_text(MAP))
    save_demos(before, folder / FILE)
    at = Typist(*RECORD, cwd=folder)
    at.see("mine: 1 correct")
    at.press(DOWN + "\r", "What does this show?")
    at.press("bump\r", "1 bump")
    at.press("w", "demos: mine.json")
    assert at.end() == 0
    after = load_demos(folder / FILE)
    assert after.correct == before.correct
    assert after.incorrect[:-1] == before.incorrect
    assert after.incorrect[-1].name == "bump-1"


@pytest.mark.parametrize("how", ["ctrl-c", "terminate"])
def test_an_interruption_keeps_what_was_finished(folder: Path, how: str) -> None:
    """Ctrl-C and SIGTERM end it in one line, with the terminal as before."""
    at = typist(folder)
    at.press(WAY + "\r", "> correct")
    at.press("\r", "mine: 1 correct")
    at.press(RIGHT, "step 1")
    if how == "ctrl-c":
        at.press("\x03", "interrupted")
    else:
        at.process.send_signal(signal.SIGTERM)
    assert at.end() == 130
    assert at.settings == at.before
    last = at.told.rpartition("\x1b[?1049l")[2]
    assert "error:" in last
    assert "interrupted; what was finished is in mine.json\n" in last
    assert len(load_demos(folder / FILE).correct) == 1


def test_a_closed_terminal_keeps_what_was_finished(folder: Path) -> None:
    """When the window is closed, the process ends, and the file is whole."""
    at = typist(folder)
    at.press(WAY + "\r", "> correct")
    at.press("\r", "mine: 1 correct")
    at.press(RIGHT, "step 1")
    at.close()
    at.process.wait()
    assert len(load_demos(folder / FILE).correct) == 1
    assert sorted(path.name for path in folder.iterdir()) == ["map.txt", FILE]


def test_bytes_that_are_no_text_do_no_harm(folder: Path) -> None:
    """Input that is not UTF-8, or an unknown sequence, is a key that does nothing."""
    at = typist(folder)
    at.press(b"\xff\xc3\x28\x1b[200~\x1b[99;99", "no such key")
    at.press(b"m" + WAY.encode(), "reaches the goal")
    at.press(b"q", "6 steps are not finished")
    at.press(b"q", "nothing was recorded")
    assert at.end() == 2
    assert not (folder / FILE).exists()


def test_a_quick_typist_loses_no_key(folder: Path) -> None:
    """A thousand keys at once are taken one after the other."""
    at = typist(folder)
    at.press(DOWN * 1000 + WAY, "step 1006")
    at.press("\x03", "interrupted")
    assert at.end() == 130


def test_a_single_escape_is_a_key(folder: Path) -> None:
    """It goes back from the question, though arrow keys begin with the same character."""
    at = typist(folder)
    at.press(WAY + "\r", "> correct")
    at.press("\x1b", "save and quit")
    at.press("\x03", "interrupted")
    assert at.end() == 130


@pytest.mark.parametrize(("columns", "lines"), [(12, 4), (1, 1), (300, 100)])
def test_any_size_of_terminal_works(folder: Path, columns: int, lines: int) -> None:
    """In a tiny terminal the keys still work, although not all of the screen is there."""
    at = Typist(*RECORD, "--map", "map.txt", cwd=folder, columns=columns, lines=lines)
    at.see("mine: nothing yet"[: 100 if lines > 1 else 4])
    at.press(WAY + "\r\rq", "demos: mine.json")
    assert at.end() == 0


def test_colours_can_be_switched_off(folder: Path) -> None:
    """With NO_COLOR nothing is coloured."""
    at = typist(folder, NO_COLOR="1")
    at.press(RIGHT, "step 1")
    at.press("\x03", "interrupted")
    assert at.end() == 130
    assert "\x1b[1;31m" not in at.told


def test_python_records_as_well(tmp_path: Path) -> None:
    """`record` returns what was finished, also after Ctrl-C, since no file holds it."""
    code = (
        "import gymnasium, replication\n"
        "env = gymnasium.make('FrozenLake-v1', is_slippery=False)\n"
        "demos = replication.record(env, task='ice')\n"
        "print('\\x1b[H', demos.task, [d.name for d in demos.correct + demos.incorrect])"
    )
    at = Typist("-c", code, cwd=tmp_path)
    at.see("HFFG")
    at.press("112122\r", "> correct")
    at.press("\r", "ice: 1 correct")
    at.press("21\rhole\r", "1 hole")
    at.press("\x03", "ice ['correct-1', 'hole-1']")
    assert at.end() == 0
    assert at.settings == at.before


def test_a_gymnasium_environment_is_recorded_in_a_file(tmp_path: Path) -> None:
    """The file makes the environment again, with its options and actions, and is continued.

    Nothing stands between the two but the file.
    """
    at = Typist(*RECORD, "--env", "FrozenLake-v1", "-p", "is_slippery", "false", cwd=tmp_path)
    at.see("HFFG")
    at.press("\x1b[B" * 2 + RIGHT + "\x1b[B" + RIGHT * 2 + "\r", "> correct")
    at.press("\rq", "demos: mine.json")
    assert at.end() == 0
    at = Typist(*RECORD, cwd=tmp_path)
    at.see("HFFG")
    at.press(RIGHT + DOWN + "\rhole\rq", "mine: 1 correct, 1 hole")
    assert at.end() == 0
    demos = load_demos(tmp_path / FILE)
    assert demos.environment.describe()["options"]["is_slippery"] is False
    assert demos.correct[0].states.tolist() == [0, 4, 8, 9, 13, 14, 15]
    assert demos.incorrect[0].states.tolist() == [0, 1, 5]


def test_random_moves_are_recorded_with_their_luck(tmp_path: Path) -> None:
    """On slippery ice the states are kept as they came."""
    at = Typist(*RECORD, "--env", "FrozenLake-v1", cwd=tmp_path)
    at.see("HFFG")
    at.press("1111", "step ")
    at.press("\r\rq", "demos: mine.json")
    assert at.end() == 0
    (demo,) = load_demos(tmp_path / FILE).correct
    assert demo.states[0] == 0


def test_without_a_terminal_the_other_ways_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a notebook or a pipe the error names CSV files and lists of actions."""
    monkeypatch.setattr("sys.stdin", io.StringIO("q"))
    with pytest.raises(UserError, match=r"needs a terminal; .*`read_csv`.*`make_demos`"):
        record(Maze.from_text(MAP), tmp_path / FILE)


@pytest.fixture
def pretended(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let recording begin without a terminal."""
    monkeypatch.setattr(terminal, "_check_terminal", lambda: None)


@pytest.mark.usefixtures("pretended")
def test_another_environment_is_not_mixed_in(tmp_path: Path) -> None:
    """A file keeps the environment that it has."""
    save_demos(demonstrate("mine", Maze.from_text(MAP)), tmp_path / FILE)
    with pytest.raises(UserError, match=r"mine\.json: environment: .* another one"):
        record(Maze(("S.G",)), tmp_path / FILE)
    with pytest.raises(UserError, match=r"mine\.json: environment: .* another one"):
        record(gymnasium.make("FrozenLake-v1"), tmp_path / FILE)


@pytest.mark.usefixtures("pretended")
def test_a_file_that_cannot_be_used_is_refused_at_once(tmp_path: Path) -> None:
    """Nothing is recorded for a file that is broken, or could not be written."""
    (tmp_path / FILE).write_text(json.dumps({"format": "other"}))
    with pytest.raises(UserError, match="unknown format"):
        record(Maze.from_text(MAP), tmp_path / FILE)
    with pytest.raises(UserError, match="cannot be written"):
        record(Maze.from_text(MAP), tmp_path / FILE / "below.json")
