from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replication import DemoError, Demos, TabularTask, load_demos, read_csv
from replication.files import FileError
from tests.conftest import Spoil
from tests.demos.example import MAZE, STORED

GOOD = """\
episode,step,state,action,kind
a,0,0,right,correct
a,1,1,down,correct
a,2,4,right,correct
b,0,0,up,hit
b,1,0,1,hit
"""


def read(tmp_path: Path, text: str) -> Demos:
    """Read CSV text as demonstrations of the small maze."""
    (tmp_path / "mine.csv").write_text(text, encoding="utf-8")
    return read_csv(tmp_path / "mine.csv", MAZE, task="mine")


def refusal(tmp_path: Path, text: str) -> str | None:
    """Return why CSV text is refused, if it is."""
    try:
        read(tmp_path, text)
    except DemoError as error:
        return str(error)
    return None


def as_csv(demos: Demos) -> str:
    """Write demonstrations as CSV, with the last state in a row of its own."""
    out = io.StringIO()
    writer = csv.writer(out)
    writer.writerow(["kind", "step", "episode", "action", "state"])
    for demo in demos.correct + demos.incorrect:
        names = [*(demos.environment.actions[action] for action in demo.actions), ""]
        for step, (state, name) in enumerate(zip(demo.states, names, strict=True)):
            writer.writerow([demo.kind, step, demo.name, name, state])
    return out.getvalue()


def test_rows_become_demonstrations(tmp_path: Path) -> None:
    """Actions are named or numbered; the last state is replayed."""
    demos = read(tmp_path, GOOD)
    (correct,), (hit,) = demos.correct, demos.incorrect
    assert (correct.name, correct.states.tolist(), correct.actions.tolist()) == (
        *("episode a", [0, 1, 4, 5]),
        [2, 1, 2],
    )
    assert (hit.kind, hit.states.tolist(), hit.actions.tolist()) == ("hit", [0, 0, 3], [0, 1])


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_what_is_written_is_read(tmp_path: Path, path: Path) -> None:
    """The stored demonstrations, written as CSV, have the same states, actions and kinds."""
    before = load_demos(path)
    (tmp_path / "all.csv").write_text("\ufeff" + as_csv(before))  # as a spreadsheet writes it
    after = read_csv(tmp_path / "all.csv", before.environment)
    for old, new in zip(
        before.correct + before.incorrect, after.correct + after.incorrect, strict=True
    ):
        assert new.name == f"episode {old.name}"
        assert new.kind == old.kind
        assert new.states.tolist() == old.states.tolist()
        assert new.actions.tolist() == old.actions.tolist()


@pytest.mark.parametrize(
    "text",
    [
        "episode,step,state,action\n1,0,0,right\n1,1,1,down\n1,2,4,right\n",
        "episode,step,row,column,action\n1,1,0,0,right\n1,2,0,1,down\n1,3,1,1,2\n",
        "action , step,state,episode,kind\n\n right,0,0,1,\ndown,1,1,1,\n,,,,\nright,2,4,1,\n",
        "episode,step,state,action\r\n1,0,0,right\r\n1,1,1,down\r\n1,2,4,right\r\n1,3,5,\r\n",
    ],
)
def test_there_are_several_ways_to_write_it(tmp_path: Path, text: str) -> None:
    """Cells, steps from 1, other orders, blanks, empty lines and a last state are the same."""
    (demo,) = read(tmp_path, text).correct
    assert demo.states.tolist() == [0, 1, 4, 5]
    assert demo.actions.tolist() == [2, 1, 2]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("action", "act", "line 1: there is no column 'action'; give episode, step, state, action"),
        ("kind", "kin", r"line 1: unknown column 'kin' \(did you mean 'kind'\?\)"),
        ("kind", "step", "line 1: the column 'step' stands twice"),
        ("a,1,1,down", "a,1,1,dwn", "line 3: unknown action 'dwn' .did you mean 'down'"),
        ("b,1,0,1,", "b,1,0,4,", "line 6: unknown action '4'"),
        ("a,1,1,", "a,1,-1,", "line 3: the state is '-1'; give a whole number"),
        ("a,1,1,", "a,1,9,", r"line 3: there is no state 9; states are 0\.\.5"),
        ("a,1,1,", "a,one,1,", "line 3: the step is 'one'; give a whole number"),
        ("a,1,1,", "a,2,1,", "line 3: step 2 of episode 'a' follows step 0; write a row for each"),
        ("b,0,", "b,5,", "line 5: episode 'b' begins with step 5; begin with 0 or 1"),
        ("down,correct", "down,hit", "line 3: episode 'a' is of kind 'hit' here, and 'correct' be"),
        ("a,1,1,down", "a,1,1,", "line 4: episode 'a' goes on after a row without an action"),
        ("down,correct", "down", "line 3: there are 4 values for 5 columns"),
        ("a,2,4", "a,2,3", r"lines 2 to 4: step 2 of demo 'episode a': 'down' from \[0,1\] leads"),
        ("b,1,0,1,hit", "b,1,0,1,Hit", "line 6: episode 'b' is of kind 'Hit' here"),
        (GOOD[31:], "", "there is no correct demo"),
        (GOOD, "", "line 1: there is no column 'episode'"),
        ("down", '"do\0wn', "line"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    """One line names the file, the line, what is wrong and how to fix it."""
    assert old in GOOD
    with pytest.raises(DemoError, match=rf"mine\.csv: {message}") as caught:
        read(tmp_path, GOOD.replace(old, new, 1))
    assert "\n" not in str(caught.value)


def test_random_moves_need_their_last_state(tmp_path: Path) -> None:
    """Where an action may lead elsewhere, replaying it cannot tell where it led."""
    task = TabularTask(np.array([[[0.5, 0.5]], [[0.0, 1.0]]]), terminal=[1])
    path = tmp_path / "mine.csv"
    path.write_text("episode,step,state,action\n1,0,0,0\n1,1,0,0\n1,2,1,\n")
    assert read_csv(path, task).correct[0].states.tolist() == [0, 0, 1]
    path.write_text("episode,step,state,action\n1,0,0,0\n1,1,0,0\n")
    with pytest.raises(DemoError, match=r"mine\.csv: lines 2 to 3: .* random; end the episode by"):
        read_csv(path, task)


@given(data=st.data())
def test_a_damaged_file_is_read_or_refused(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Whatever stands in it, there are demonstrations or one line."""
    at = data.draw(st.integers(0, len(GOOD)))
    more = data.draw(st.text(st.sampled_from('0123456789ab,"\n\r\0 -é²updown'), max_size=8))
    text = GOOD[:at] + more + GOOD[at + data.draw(st.integers(0, 8)) :]
    message = refusal(tmp_path_factory.getbasetemp(), text)
    assert message is None or "\n" not in message


def test_what_is_no_file_is_refused(tmp_path: Path, spoil: Spoil) -> None:
    """Pipes, devices, folders, huge files and bytes end in one line."""
    spoil(tmp_path / "mine.csv")
    with pytest.raises((FileError, DemoError), match=r"mine\.csv"):
        read_csv(tmp_path / "mine.csv", MAZE)
