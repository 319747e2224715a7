from __future__ import annotations

import resource
import threading
from pathlib import Path

import pytest

from replication import files
from replication.errors import UserError
from replication.files import ROOM, check_writable, shown_as, write_file


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


def test_paths_are_shown_from_the_project_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the project is, or another folder, is not shown."""
    monkeypatch.setattr(files, "PROJECT", tmp_path / "project")
    assert shown_as(tmp_path / "project" / "build" / "quick") == "build/quick"
    assert shown_as(tmp_path / "project" / ".." / "elsewhere") == "elsewhere"


def test_paths_prefer_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file here wins over one in the project; an absolute path stays as it is."""
    monkeypatch.chdir(tmp_path)
    name = "data/demos/open_maze.json"
    assert files.resolve(name) == files.PROJECT / name
    write_file(tmp_path / name, "")
    assert files.resolve(name) == tmp_path / name
    assert files.resolve(tmp_path / "none") == tmp_path / "none"
