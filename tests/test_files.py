from __future__ import annotations

import fcntl
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from replication import files
from replication.errors import UserError
from replication.files import (
    DEEPEST,
    ROOM,
    FileError,
    check_writable,
    open_lock,
    parse_json,
    read_file,
    read_json,
    read_text,
    read_toml,
    scratch_folder,
    shown_as,
    stored,
    write_file,
)
from tests.conftest import Spoil

# --- reading ---------------------------------------------------------------------------------


def test_what_is_no_file_of_ours_is_refused_at_once(tmp_path: Path, spoil: Spoil) -> None:
    """A pipe, a device, a folder, a huge file, and JSON that is none, have one line each."""
    spoil(tmp_path / "file.json")
    with pytest.raises(FileError, match=r"file\.json: (is|cannot be) [^\n]+") as caught:
        read_json(tmp_path / "file.json")
    assert str(caught.value).isprintable()
    assert str(caught.value) == f"{tmp_path / 'file.json'}: {caught.value.reason}"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("none", "none: cannot be read (no such file or directory)"),
        ("a\0b", r"a\x00b': cannot be read"),
        ("x" * 5000, "cannot be read (file name too long)"),
        ("\ud800", r"\ud800': cannot be read"),
    ],
)
def test_what_is_not_there_is_refused(tmp_path: Path, name: str, message: str) -> None:
    """A file that does not exist, and cannot, is named in one line that any terminal shows."""
    with pytest.raises(FileError, match=re.escape(message)) as caught:
        read_file(f"{tmp_path}/{name}")
    assert str(caught.value).isprintable()


def test_no_more_is_read_than_is_allowed(tmp_path: Path) -> None:
    """A file of just the allowed size is read, a byte more is refused."""
    path = write_file(tmp_path / "file", b"0" * 1000)
    assert read_file(path, 1000) == b"0" * 1000
    assert read_file(str(path)) == b"0" * 1000
    with pytest.raises(FileError, match=r"file: is larger than .*; give a smaller file"):
        read_file(path, 999)


def test_text_is_utf_8(tmp_path: Path) -> None:
    """Other bytes are refused with their place."""
    assert read_text(write_file(tmp_path / "file", "a\r\nä")) == "a\r\nä"
    with pytest.raises(FileError, match=r"file: is not UTF-8 text \(byte 2\); save it as UTF-8"):
        read_text(write_file(tmp_path / "file", b"a\xff"))


def test_toml_is_one_door_further(tmp_path: Path, spoil: Spoil) -> None:
    """It is read as other text is; what is no TOML has its line named."""
    assert read_toml(write_file(tmp_path / "a.toml", "b = 1\n")) == {"b": 1}
    with pytest.raises(FileError, match=r"a\.toml: is not TOML: [^\n]+line 1[^\n]+$"):
        read_toml(write_file(tmp_path / "a.toml", "[1, 2]"))
    (tmp_path / "a.toml").unlink()
    spoil(tmp_path / "a.toml")
    with pytest.raises(FileError, match=r"a\.toml: (is|cannot be) [^\n]+"):
        read_toml(tmp_path / "a.toml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "Expecting value"),
        ('{"a": 1, "b": {"c": 1, "c": 2}}', "the field 'c' appears twice in one object; keep one"),
        ("[" * 100_000, "it is nested too deeply"),
        ('{"a":' * 100_000 + "1" + "}" * 100_000, "it is nested too deeply"),
        ("[" * (DEEPEST + 1) + "]" * (DEEPEST + 1), "it is nested too deeply; 100 levels"),
    ],
)
def test_json_with_a_doubtful_meaning_is_refused(text: str, message: str) -> None:
    """What is no JSON, says two things, or is deeper than any reader goes is one line."""
    for content in (text, text.encode()):
        with pytest.raises(ValueError, match=re.escape(message)) as caught:
            parse_json(content)
        assert "\n" not in str(caught.value)


def test_json_is_read_as_elsewhere() -> None:
    """As many levels as are allowed, and a byte order mark, do no harm."""
    assert parse_json('{"a": [1, 2.5, null], "b": {"a": "ä"}}') == {
        "a": [1, 2.5, None],
        "b": {"a": "ä"},
    }
    assert parse_json(b"\xef\xbb\xbf3") == 3
    assert parse_json("[" * DEEPEST + "]" * DEEPEST)
    with pytest.raises(UnicodeDecodeError):
        parse_json("3".encode("utf-16"))


def test_a_lock_does_not_wait_for_a_pipe(tmp_path: Path) -> None:
    """A file is made to be locked, and a pipe in its place, which nobody writes to, serves too."""
    os.mkfifo(tmp_path / "pipe")
    for name in ("pipe", "new", "new"):
        with open_lock(tmp_path / name) as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)


# --- writing ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "due"),
    [("a\nä\r\n", b"a\n\xc3\xa4\r\n"), (b"\x00\xff\r\n", b"\x00\xff\r\n"), ("", b"")],
)
def test_content_is_written_as_it_is(content: str | bytes, due: bytes, tmp_path: Path) -> None:
    """Text is written as UTF-8 with its own line ends, bytes as they are; the path comes back."""
    target = tmp_path / "new" / "folder" / "file"
    assert write_file(str(target), content) == target
    assert target.read_bytes() == due
    assert list(target.parent.iterdir()) == [target]


def test_an_old_file_is_replaced(tmp_path: Path) -> None:
    """A longer old file leaves nothing behind."""
    target = write_file(tmp_path / "file", "long old content")
    write_file(target, "new")
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_a_new_file_has_the_usual_permissions(tmp_path: Path) -> None:
    """Others may read a file as they may one that is written directly."""
    (tmp_path / "direct").write_text("x")
    written = write_file(tmp_path / "drafted", "x")
    assert written.stat().st_mode == (tmp_path / "direct").stat().st_mode


@pytest.mark.parametrize("step", ["write_bytes", "replace"])
def test_a_write_that_fails_leaves_the_old_file(
    step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether the disk is full or the exchange fails: the old file is whole, no draft is left."""
    target = write_file(tmp_path / "file", "old")

    def half(self: Path, content: bytes | Path) -> None:
        if isinstance(content, bytes):
            with self.open("wb") as file:
                file.write(content[:1])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, step, half)
    with pytest.raises(OSError, match="No space"):
        write_file(target, "new")
    monkeypatch.undo()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_that_can_be_written_is_made(tmp_path: Path) -> None:
    """The check makes the folder and leaves nothing in it."""
    check_writable(tmp_path / "new" / "folder")
    assert list((tmp_path / "new" / "folder").iterdir()) == []


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    """A file in its place, and a disk without room, are named in one line, and nothing is left."""
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(UserError, match=r"file.* cannot be written: it is not a folder; .*"):
            check_writable(folder)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM - 1, before[1]))
    try:
        with pytest.raises(UserError, match=r"full cannot be written: file too large; .*"):
            check_writable(tmp_path / "full")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list((tmp_path / "full").iterdir()) == []


def test_as_much_room_is_asked_for_as_is_needed(tmp_path: Path) -> None:
    """A limit between what is usual and what is needed refuses only the latter."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM + 1, before[1]))
    try:
        check_writable(tmp_path)
        with pytest.raises(UserError, match="cannot be written: file too large"):
            check_writable(tmp_path, ROOM + 2)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_text_that_is_not_unicode_leaves_the_old_file(tmp_path: Path) -> None:
    """Text that UTF-8 cannot hold is an error before anything is written."""
    target = write_file(tmp_path / "file", "old")
    with pytest.raises(UnicodeEncodeError):
        write_file(target, "\ud800")
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_places_that_take_no_file(tmp_path: Path) -> None:
    """A folder is not replaced, and a file is not taken for a folder."""
    taken = write_file(tmp_path / "taken", "x")
    (tmp_path / "folder" / "inner").mkdir(parents=True)
    for target in (taken / "file", tmp_path / "folder"):
        with pytest.raises(OSError, match=r"."):
            write_file(target, "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "taken"]


def test_a_reader_never_sees_half_a_file(tmp_path: Path) -> None:
    """While two threads write, every read finds one whole content."""
    contents = {letter * 200_000 for letter in "ab"}
    target = write_file(tmp_path / "file", "a" * 200_000)
    writers = [
        threading.Thread(target=lambda c=c: [write_file(target, c) for _ in range(50)])
        for c in contents
    ]
    for writer in writers:
        writer.start()
    seen = set()
    while any(writer.is_alive() for writer in writers):
        seen.add(target.read_text())
    for writer in writers:
        writer.join()
    assert seen | {target.read_text()} <= contents
    assert list(tmp_path.iterdir()) == [target]


# --- what is not finished --------------------------------------------------------------------

KILLED = """
import os, sys
from pathlib import Path
from replication.files import scratch_folder
with scratch_folder(Path(sys.argv[1]) if sys.argv[1:] else None) as folder:
    (folder / "half").touch()
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize("hidden", [True, False])
def test_what_a_killed_process_left_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hidden: bool
) -> None:
    """The next process removes it, and nothing of a process that lives, or of another machine."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    parent = tmp_path if hidden else None
    process = subprocess.Popen(
        [sys.executable, "-c", KILLED, *[str(tmp_path)] * hidden],
        env=os.environ | {"TMPDIR": str(tmp_path)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    left = Path(process.stdout.readline().strip())
    assert left.parent == tmp_path
    elsewhere = left.with_name(left.name.replace("-", "-other", 1))
    others = [elsewhere, tmp_path / "replicate-mine", tmp_path / ".draft-mine"]
    for other in others:
        shutil.copytree(left, other)
    with scratch_folder(parent) as folder:
        assert {*tmp_path.iterdir()} == {folder, left, *others}
        assert len(folder.name) == len(left.name)
        process.send_signal(signal.SIGKILL)
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # it stays as a zombie
        with scratch_folder(parent) as second:
            assert {*tmp_path.iterdir()} == {folder, second, *others}
    assert {*tmp_path.iterdir()} == {*others}
    process.communicate()


def test_a_write_removes_the_drafts_of_killed_ones(tmp_path: Path) -> None:
    """What a process left that was killed while it wrote goes with the next file there."""
    command = [sys.executable, "-c", KILLED, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.kill()
    assert len(list(tmp_path.iterdir())) == 1
    target = write_file(tmp_path / "file", "x")
    assert list(tmp_path.iterdir()) == [target]


# --- places ----------------------------------------------------------------------------------


def test_paths_are_shown_from_the_project_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the project is, or another folder, is not shown."""
    monkeypatch.setattr(files, "PROJECT", tmp_path / "project")
    assert shown_as(tmp_path / "project" / "build" / "quick") == "build/quick"
    assert shown_as(tmp_path / "project" / ".." / "elsewhere") == "elsewhere"


@pytest.mark.parametrize("name", files.STORED)
def test_stored_demonstrations_are_those_of_the_project(name: str) -> None:
    """They are the files of `data/demos`, which notebooks read, and not copies."""
    assert stored(name).samefile(files.PROJECT / "data" / "demos" / f"{name}.json")


def test_stored_demonstrations_come_with_the_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no project has them they are the package's own, a link or not."""
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    assert stored("soccer") == Path(files.__file__).parent / "stored" / "soccer.json"
    mine = write_file(tmp_path / "data" / "demos" / "soccer.json", "{}")
    assert stored("soccer") == mine


def test_other_demonstrations_are_not_stored() -> None:
    """A name that is not known is answered with those that are."""
    with pytest.raises(UserError, match=r"'open_mase' \(did you mean 'open_maze'\?\); known: "):
        stored("open_mase")


def test_paths_prefer_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file here wins over one in the project; an absolute path stays as it is."""
    monkeypatch.chdir(tmp_path)
    name = "data/demos/open_maze.json"
    assert files.resolve(name) == files.PROJECT / name
    write_file(tmp_path / name, "")
    assert files.resolve(name) == tmp_path / name
    assert files.resolve(tmp_path / "none") == tmp_path / "none"
