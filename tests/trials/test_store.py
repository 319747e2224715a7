from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import threading
import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replication.errors import UserError
from replication.irl import Snapshots, Trial
from replication.irl.agent import Episode
from replication.trials.store import DamagedTrialError, Store

FLOATS = st.floats(width=64)
LENGTHS = st.lists(st.integers(0, 6), min_size=1, max_size=5)

# What the child processes below share: batch b holds the keys b/0 ... b/49.
CHILD = """
import os, sys
import numpy as np
from replication.irl import Trial
from replication.irl.agent import Episode
from replication.trials.store import Store

def batch(b, value):
    table, few = np.full((100, 4), float(value)), np.arange(2)
    episodes = (Episode(few, few[:1], few[:1] > 0),)
    row = table[:1].astype(np.float32)
    trial = Trial(table[0], True, value, table, table, episodes, few, row, row)
    return [(f"{b}/{k}", trial) for k in range(50)]

store = Store(sys.argv[1])
"""


def trial(
    numbers: list[float],
    moves: int,
    *,
    lengths: tuple[int, ...] = (1,),
    largest: int = 9,
    kept: int | None = None,
) -> Trial:
    """Make a trial of 2 states and 2 actions from any numbers.

    Its episodes have `lengths` and states up to `largest`; it keeps `kept` snapshots.
    """
    table = np.resize(np.array(numbers, dtype=np.float64), (2, 2))
    snapshots = None
    if kept is not None:
        snapshots = Snapshots(
            weights=np.stack([table * k for k in range(kept)]),
            q=np.stack([table - k for k in range(kept)]),
        )
    return Trial(
        errors=np.array(numbers),
        converged=moves % 2 == 0,
        steps=moves * 10**12,
        weights=table,
        q=-table,
        episodes=tuple(
            Episode(
                largest - np.arange(n + 1) % (largest + 1), np.arange(n) % 4, np.arange(n) % 3 > 0
            )
            for n in lengths
        ),
        collisions=largest - np.arange(len(lengths) - 1),
        values=np.resize(table, (len(lengths), 2)).astype(np.float32),
        rewards=np.resize(-table, (len(lengths), 2)).astype(np.float32),
        snapshots=snapshots,
    )


def assert_same(one: Trial, other: Trial) -> None:
    """Assert that two trials have the same bits, shapes and types."""
    assert (one.converged, one.steps) == (other.converged, other.steps)
    assert (type(one.converged), type(one.steps)) == (bool, int)
    names = "errors", "weights", "q", "collisions", "values", "rewards"
    pairs = [(getattr(one, name), getattr(other, name)) for name in names]
    for mine, due in zip(one.episodes, other.episodes, strict=True):
        pairs += zip(mine, due, strict=True)
    assert (one.snapshots is None) == (other.snapshots is None)
    if one.snapshots is not None and other.snapshots is not None:
        pairs += [
            (one.snapshots.weights, other.snapshots.weights),
            (one.snapshots.q, other.snapshots.q),
        ]
    for a, b in pairs:
        assert (a.shape, a.dtype) == (b.shape, b.dtype)
        assert a.tobytes() == b.tobytes()


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Return one store for many examples."""
    return Store(tmp_path_factory.mktemp("store") / "trials.sqlite")


@given(
    numbers=st.lists(FLOATS, min_size=1, max_size=5),
    moves=st.integers(0, 9),
    kept=st.none() | st.integers(1, 5),
)
@settings(max_examples=60, deadline=None)
@pytest.mark.filterwarnings("ignore:(invalid value|overflow):RuntimeWarning")
def test_round_trip(shared: Store, numbers: list[float], moves: int, kept: int | None) -> None:
    """What is stored comes back bit for bit, NaN and negative zero included."""
    stored = trial(numbers, moves, kept=kept)
    key = repr((numbers, moves, kept))
    shared.put([(key, stored)])
    assert_same(shared.get(key, snapshots=True), stored)
    assert_same(shared.get(key), replace(stored, snapshots=None))


@given(lengths=LENGTHS, largest=st.sampled_from([0, 255, 256, 65_535, 65_536, 2**31, 2**53 + 1]))
@settings(max_examples=60, deadline=None)
def test_episodes_of_any_length_come_back(shared: Store, lengths: list[int], largest: int) -> None:
    """Episodes keep their bounds, empty ones too, and any state number, as int64 and bool."""
    stored = trial([1.0], 1, lengths=tuple(lengths), largest=largest)
    key = repr((lengths, largest))
    shared.put([(key, stored)])
    assert_same(shared.get(key), stored)
    for n, episode in zip(lengths, shared.get(key).episodes, strict=True):
        assert [array.shape for array in episode] == [(n + 1,), (n,), (n,)]
        assert [array.dtype for array in episode] == [np.int64, np.int64, np.bool_]
        assert episode.states.max() == largest


def test_keys(store_path: Path) -> None:
    """A key that was never stored is a KeyError, is not in the store and is not known."""
    store = Store(store_path)
    with pytest.raises(KeyError, match="absent"):
        store.get("absent")
    store.put([("a", trial([1.0], 1)), ("b", trial([2.0], 2))])
    assert "a" in store
    assert "absent" not in store
    assert store.known(["a", "absent", "b"]) == {"a", "b"}
    assert store.known([]) == set()
    assert Store(store_path).get("b").errors.tolist() == [2.0]


def test_what_is_stored_never_changes(store_path: Path) -> None:
    """A second trial under a key is dropped, and the others of its batch are stored."""
    store = Store(store_path)
    store.put([("a", trial([1.0], 1))])
    store.put([("a", trial([9.0], 1)), ("b", trial([2.0], 1))])
    assert [store.get(key).errors.tolist() for key in "ab"] == [[1.0], [2.0]]


def test_a_batch_that_fails_half_way_stores_nothing(store_path: Path) -> None:
    """Whether a trial cannot be computed or a row not be written, its whole batch is left out."""
    store = Store(store_path)

    def broken() -> Iterator[tuple[str, Trial]]:
        yield "a", trial([1.0], 1)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        store.put(broken())
    with pytest.raises(sqlite3.Error):
        store.put([("a", trial([1.0], 1)), (object(), trial([1.0], 1))])  # type: ignore[list-item]
    assert "a" not in store
    store.put([("a", trial([1.0], 1))])
    assert "a" in store


def test_other_threads_may_read_and_write(store_path: Path) -> None:
    """Threads that open a store and fill it at the same time lose nothing."""
    keys = [f"{k}" for k in range(40)]

    def write(some: list[str]) -> None:
        store = Store(store_path)
        for key in some:
            store.put([(key, trial([float(key)], 1))])

    threads = [threading.Thread(target=write, args=(keys[k::4],)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert Store(store_path).known(keys) == set(keys)


def test_a_damaged_trial_is_never_taken_for_a_good_one(store_path: Path) -> None:
    """Whichever bit of a record is wrong, or missing, is an error or does not matter."""
    store = Store(store_path)
    store.put([("a", trial([1.0, 2.0], 1)), ("b", trial([3.0], 1))])
    connection = sqlite3.connect(store_path)
    (record,) = connection.execute("SELECT record FROM trials WHERE key = 'a'").fetchone()
    damages = [record[:at] for at in range(0, len(record), 5)]
    damages += [
        record[:at] + bytes([record[at] ^ bit]) + record[at + 1 :]
        for at in range(len(record))
        for bit in (1, 16, 128)
    ]
    refused = 0
    for damage in damages:
        connection.execute("UPDATE trials SET record = ? WHERE key = 'a'", (damage,))
        connection.commit()
        try:
            assert_same(store.get("a"), trial([1.0, 2.0], 1))  # a bit that fills the last byte
        except DamagedTrialError:
            refused += 1
    connection.close()
    assert refused > 0.95 * len(damages)
    store.drop("a")
    assert "a" not in store
    store.put([("a", trial([4.0], 1))])
    assert [store.get(key).errors.tolist() for key in "ab"] == [[4.0], [3.0]]


@pytest.mark.parametrize(
    "content",
    [
        *(b"", b"\xb8", b"[1, 2]", b"{", b"[" * 100_000, b'{"errors": 1}', b'{"errors": []}'),
        *(
            b'{"errors": ["%s", [%s]]}\n' % (kind, length)
            for kind, length in [
                *((b"<f8", length) for length in (b"9", b"-1", b"1" * 99, b'"a"', b"1e9", b"null")),
                *((b"|O", b"1"), (b"x", b"1")),
            ]
        ),
        b'{"lengths": ["<i8", [0]]}\n',
    ],
)
@pytest.mark.parametrize("compressed", [True, False])
def test_any_bytes_of_a_record_are_an_error_of_ours(
    store_path: Path, content: bytes, compressed: bool
) -> None:
    """What is no record of a trial, however it fails, is a damaged trial and nothing else."""
    store = Store(store_path)
    store.put([("a", trial([1.0, 2.0], 1, kept=2))])
    packed = zlib.compress(content) if compressed else content
    for column, snapshots in (("snapshots", True), ("record", False)):
        with sqlite3.connect(store_path) as connection:
            connection.execute(f"UPDATE trials SET {column} = ?", (packed,))
        connection.close()
        with pytest.raises(DamagedTrialError, match="trial a is damaged") as caught:
            store.get("a", snapshots=snapshots)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"no database, but as long as its header" * 9, b"\1" * 99])
def test_a_damaged_file_is_set_aside(
    store_path: Path, content: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that is no store is renamed, with a message, and a new one begun; the last is kept."""
    store_path.parent.mkdir()
    for more in (b"", b"more"):
        store_path.write_bytes(content + more)
        store = Store(store_path)
        store.put([("a", trial([1.0], 1))])
        assert "a" in store
        store._connection.close()
        aside = store_path.with_name("trials.sqlite.damaged")
        assert aside.read_bytes() == content + more
        assert f"set aside as {aside.name}" in capsys.readouterr().err
    assert len(list(store_path.parent.glob("*.damaged*"))) == 1


@pytest.mark.parametrize(
    ("sound", "damaged"),
    [
        (b"CREATE TABLE", b"CREATE T\xb8BLE"),
        (b"CREATE TABLE trials (key", b"CREATE TABLE trials \xb8key"),
        (b"record BLOB", b"rec0rd BLOB"),
        (b"tabletrials", b"t\xb8bletrials"),
        (b"tabletrials", b"tabletri\xb8ls"),
        (b"\x03\x0f\x01b\x02", b"\x03\x0f\x01b\x03"),  # the index has the row of c under b
        (b"\x03\x0f\x01b\x02", b"\x03\x0f\x01b\x09"),
    ],
)
def test_a_damaged_file_is_never_taken_for_a_good_one(
    store_path: Path, sound: bytes, damaged: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where SQLite's own description of the tables or index is damaged, the trials come again."""
    store = Store(store_path)
    store.put([(key, trial([1.0], 1)) for key in "abc"])
    store._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    store._connection.close()
    content = store_path.read_bytes()
    assert sound in content
    store_path.write_bytes(content.replace(sound, damaged, 1))
    store = Store(store_path)
    assert store.known("abc") == set()
    store.put([("b", trial([2.0], 1))])
    assert store.get("b").errors.tolist() == [2.0]
    assert len(capsys.readouterr().err.splitlines()) <= 1


@pytest.mark.parametrize("what", ["folder", "pipe", "device"])
def test_a_store_that_cannot_be_used_is_an_error(store_path: Path, what: str) -> None:
    """A folder, a pipe or a device in the place of the file is an error, and not set aside."""
    store_path.parent.mkdir()
    if what == "folder":
        store_path.mkdir()
    elif what == "pipe":
        os.mkfifo(store_path)
    else:
        store_path.symlink_to("/dev/zero")
    with pytest.raises(UserError, match="the store cannot be used: it is no regular file"):
        Store(store_path)
    assert list(store_path.parent.iterdir()) == [store_path]


def test_a_file_of_another_kind_stays(tmp_path: Path) -> None:
    """What is no database, and is not called one, is somebody's own."""
    notes = tmp_path / "notes.txt"
    notes.write_text("my notes, which are longer than a header of SQLite is, that is 100 bytes" * 2)
    before = notes.read_bytes()
    with pytest.raises(UserError, match=r"notes\.txt is no store of trials; give another file"):
        Store(notes)
    assert notes.read_bytes() == before
    assert not [*tmp_path.glob("*.damaged")]


def test_a_damaged_store_of_any_name_is_set_aside(tmp_path: Path) -> None:
    """What SQLite still takes for a database is a store, and its trials come again."""
    path = tmp_path / "mine"
    store = Store(path)
    store.put([("a", trial([1.0], 1))])
    store._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    store._connection.close()
    path.write_bytes(path.read_bytes().replace(b"CREATE TABLE", b"CREATE T\xb8BLE", 1))
    assert "a" not in Store(path)
    assert path.with_name("mine.damaged").exists()


def test_neighbours_of_a_store_are_looked_at(store_path: Path) -> None:
    """A pipe where SQLite keeps its journal would block it; a folder lets nothing be set aside."""
    store_path.parent.mkdir()
    for suffix in ("-journal", "-wal", "-shm"):
        pipe = store_path.with_name(store_path.name + suffix)
        os.mkfifo(pipe)
        with pytest.raises(UserError, match=f"{pipe.name}: the store cannot be used"):
            Store(store_path)
        pipe.unlink()
    store_path.write_bytes(b"no database, but as long as its header" * 9)
    (store_path.with_name("trials.sqlite.damaged") / "mine").mkdir(parents=True)
    with pytest.raises(UserError, match="is damaged and cannot be set aside: is a directory"):
        Store(store_path)


@pytest.mark.parametrize("content", [None, b"no database, but as long as its header" * 9])
def test_many_may_open_a_new_store_at_once(tmp_path: Path, content: bytes | None) -> None:
    """Threads and processes that open it at one instant all do, and lose nothing of each other."""
    rounds, many = 20, 4
    paths = [tmp_path / f"{n}.sqlite" for n in range(rounds)]
    for path in paths if content else []:
        path.write_bytes(content or b"")
    program = f"""
import pathlib, threading, traceback
from replication.trials.store import Store
barrier = threading.Barrier({many})

def fill(k):
    for path in {[str(path) for path in paths]!r}:
        barrier.wait()
        try:
            Store(pathlib.Path(path)).put([(f"{{sys.argv[2]}}/{{k}}", batch(0, 0)[0][1])])
        except BaseException:
            traceback.print_exc()
            os._exit(1)  # the others would wait for this thread

threads = [threading.Thread(target=fill, args=(k,)) for k in range({many})]
for thread in threads: thread.start()
for thread in threads: thread.join()
"""
    processes = [child(program, tmp_path / "any.sqlite", str(p)) for p in range(2)]
    for process in processes:
        with process:
            pass
        assert process.returncode == 0
    keys = {f"{p}/{k}" for p in range(2) for k in range(many)}
    for path in paths:
        assert Store(path).known(keys) == keys


def test_a_store_belongs_to_its_thread(store_path: Path) -> None:
    """Another thread that uses this thread's store is stopped; it has to open its own."""
    store = Store(store_path)
    errors: list[Exception] = []

    def use() -> None:
        try:
            store.known(["a"])
        except sqlite3.ProgrammingError as error:
            errors.append(error)

    thread = threading.Thread(target=use)
    thread.start()
    thread.join()
    assert len(errors) == 1


def child(program: str, path: Path, *words: str) -> subprocess.Popen[str]:
    """Start another process on the store."""
    command = [sys.executable, "-c", CHILD + program, str(path), *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def stored_batches(path: Path, n: int) -> list[int]:
    """Count the stored trials of batches 0 ... n - 1, reading each of them."""
    store = Store(path)
    batches = [store.known(f"{b}/{k}" for k in range(50)) for b in range(n)]
    for key in set().union(*batches):
        assert store.get(key).weights.shape == (100, 4)
    return [len(batch) for batch in batches]


def test_a_process_that_ends_within_a_write(store_path: Path) -> None:
    """A process that ends after it wrote rows, but before the batch is committed, leaves none."""
    program = """
store.put(batch(0, 0))
class Fatal(str):
    def __conform__(self, protocol):
        os._exit(7)
rows = batch(1, 1)
store.put([*rows[:30], (Fatal("x"), rows[0][1]), *rows[30:]])
"""
    with child(program, store_path) as process:
        assert process.wait() == 7
    assert stored_batches(store_path, 2) == [50, 0]
    store = Store(store_path)
    store.put([("1/0", store.get("0/0"))])
    assert "1/0" in store


def test_a_killed_process_leaves_whole_batches(store_path: Path) -> None:
    """After a kill in the middle of writes, each batch is there in full or not at all."""
    with child(
        "for b in range(10000): store.put(batch(b, b)); print(b, flush=True)", store_path
    ) as p:
        assert p.stdout is not None
        done = [int(p.stdout.readline()) for _ in range(5)]
        p.send_signal(signal.SIGKILL)
        done += [int(line) for line in p.stdout if line.endswith("\n")]
    assert p.returncode == -signal.SIGKILL
    counts = stored_batches(store_path, len(done) + 2)
    assert done == list(range(len(done)))
    assert counts[: len(done)] == [50] * len(done)
    assert counts[len(done)] in (0, 50)
    assert counts[len(done) + 1] == 0


def test_two_processes_write_at_once(store_path: Path) -> None:
    """Two processes that fill one store with the same keys both succeed and mix nothing up."""
    program = "for b in range(8): store.put(batch(b, {}))"
    processes = [child(program.format(value), store_path) for value in (1, 2)]
    for process in processes:
        with process:
            pass
        assert process.returncode == 0
    assert stored_batches(store_path, 8) == [50] * 8
    store = Store(store_path)
    for b in range(8):
        steps = {store.get(f"{b}/{k}").steps for k in range(50)}
        assert steps in ({1}, {2})
