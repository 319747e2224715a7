"""Stores that were damaged in any way: no result changes."""

from __future__ import annotations

import re
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from replication import Demos, demonstrate
from replication.envs.maze import Maze
from tests.faults.checkout import SMALL, bits, run_few


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, list[bytes]]:
    """Return the bytes of a sound store, and what it holds."""
    path = tmp_path_factory.mktemp("sound") / "trials.sqlite"
    found = bits(run_few(demonstrate("small", Maze.from_text(SMALL)), path, 4))
    with sqlite3.connect(path) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()
    return path.read_bytes(), found


@pytest.mark.parametrize("how", ["garbage", "half", "header", "text"])
def test_a_damaged_store_is_set_aside(
    small_demos: Demos,
    tmp_path: Path,
    sound: tuple[bytes, list[bytes]],
    capfd: pytest.CaptureFixture[str],
    how: str,
) -> None:
    """A store that is no sound database is set aside with a message; its trials come again."""
    content, expected = sound
    garbage = np.random.default_rng(1).bytes(len(content) - 8192)
    damaged = {
        "garbage": content[:4096] + garbage + content[-4096:],
        "half": content[: len(content) // 2],
        "header": b"\0" * 100 + content[100:],
        "text": b"not a database, but long enough to be read as one" * 100,
    }[how]
    path = tmp_path / "trials.sqlite"
    path.write_bytes(damaged)
    assert bits(run_few(small_demos, path, 4)) == expected
    assert re.search(
        r"trials\.sqlite is damaged \(.*set aside as \S+damaged; .*again", capfd.readouterr().err
    )
    aside = path.with_name("trials.sqlite.damaged")
    assert aside.read_bytes() == damaged
    assert bits(run_few(small_demos, path, 4)) == expected
    assert capfd.readouterr().err == ""


def test_an_empty_store_is_a_new_one(
    small_demos: Demos, tmp_path: Path, sound: tuple[bytes, list[bytes]]
) -> None:
    """A file of no bytes holds nothing that could be set aside; it is filled."""
    (tmp_path / "trials.sqlite").touch()
    assert bits(run_few(small_demos, tmp_path / "trials.sqlite", 4)) == sound[1]


def _check_random_damage(
    demos: Demos, folder: Path, sound: tuple[bytes, list[bytes]], numbers: range
) -> None:
    content, expected = sound
    for number in numbers:
        rng = np.random.default_rng(number)
        damaged = bytearray(content)
        if number % 5 == 0:
            del damaged[int(rng.integers(1, len(damaged))) :]
        else:
            at, size = int(rng.integers(100, len(damaged))), int(2 ** rng.integers(0, 12))
            damaged[at : at + size] = rng.bytes(len(damaged[at : at + size]))
        path = folder / f"{number}" / "trials.sqlite"
        path.parent.mkdir()
        path.write_bytes(damaged)
        assert bits(run_few(demos, path, 4)) == expected, number


def test_random_damage_changes_no_result(
    small_demos: Demos, tmp_path: Path, sound: tuple[bytes, list[bytes]]
) -> None:
    """Wherever bytes of the store are changed or cut off, the results are the same."""
    _check_random_damage(small_demos, tmp_path, sound, range(100))


@pytest.mark.long
def test_much_random_damage_changes_no_result(
    small_demos: Demos, tmp_path: Path, sound: tuple[bytes, list[bytes]]
) -> None:
    """The same for two thousand damages."""
    _check_random_damage(small_demos, tmp_path, sound, range(1000, 3000))


def test_a_damaged_record_is_computed_again(
    small_demos: Demos, tmp_path: Path, sound: tuple[bytes, list[bytes]]
) -> None:
    """One record that cannot be read costs one trial, and is whole afterwards."""
    path = tmp_path / "trials.sqlite"
    path.write_bytes(sound[0])
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE trials SET record = x'00' WHERE rowid = 2")
        connection.execute("UPDATE trials SET record = substr(record, 1, 50) WHERE rowid = 3")
    connection.close()
    assert bits(run_few(small_demos, path, 4)) == sound[1]
    with sqlite3.connect(path) as connection:
        (short,) = connection.execute("SELECT COUNT(*) FROM trials WHERE length(record) < 60")
    connection.close()
    assert short == (0,)
