"""Trials on a Dask cluster: a scheduler and two workers on loopback, and what may go wrong."""

import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from replication import Demos
from replication.files import PROJECT
from replication.irl import Trial
from replication.progress import SCHEDULER
from replication.trials.run import WorkerError
from replication.trials.store import Store
from tests.faults.checkout import (
    PATIENCE,
    Checkout,
    Reference,
    bits,
    gone,
    listening,
    run_few,
    wait,
)

# distributed leaves sockets to the garbage collector
pytestmark = pytest.mark.filterwarnings("ignore")

CLUSTER = """
import sys
from distributed import LocalCluster

if __name__ == "__main__":
    with LocalCluster(
        n_workers=2, processes=True, threads_per_worker=1, host="127.0.0.1",
        dashboard_address=None, worker_dashboard_address=None,
    ) as cluster:
        pids = [nanny.process.pid for nanny in cluster.workers.values()]
        print(cluster.scheduler_address, *pids, flush=True)
        sys.stdin.read()
"""


@dataclass(frozen=True)
class Cluster:
    """The address of a scheduler and the processes of its workers."""

    address: str
    workers: list[int]


StartCluster = Callable[..., Cluster]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[StartCluster]:
    """Start a scheduler with two workers, whose code may be another folder's."""
    running: list[subprocess.Popen[str]] = []

    def start(code: str = "") -> Cluster:
        program = tmp_path / "cluster.py"
        program.write_text(CLUSTER)
        process = subprocess.Popen(
            [sys.executable, str(program)],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": code},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        running.append(process)
        assert process.stdout is not None
        limit = threading.Timer(PATIENCE, process.kill)  # which ends the line
        limit.start()
        address, *workers = process.stdout.readline().split()
        limit.cancel()
        return Cluster(address, [int(pid) for pid in workers])

    yield start
    for process in running:
        process.communicate(timeout=PATIENCE)  # closes its input, at which it ends


@pytest.mark.parametrize("killed", [False, True])
def test_a_cluster_does_not_change_a_bit(
    small_demos: Demos,
    tmp_path: Path,
    start: StartCluster,
    monkeypatch: pytest.MonkeyPatch,
    killed: bool,
) -> None:
    """Two workers give the bits that one process gives, also when one of them is killed."""
    alone = bits(run_few(small_demos, tmp_path / "alone.sqlite"))
    cluster = start()
    monkeypatch.setenv(SCHEDULER, cluster.address)
    put = Store.put
    killings: list[int] = []

    def put_and_kill(store: Store, found: list[tuple[str, Trial]]) -> None:
        put(store, found)
        if killed and not killings:
            killings.append(cluster.workers[0])
            os.kill(cluster.workers[0], signal.SIGKILL)

    monkeypatch.setattr(Store, "put", put_and_kill)
    assert bits(run_few(small_demos, tmp_path / "shared.sqlite")) == alone
    assert len(killings) == killed


def test_a_worker_with_other_code_is_refused(
    small_demos: Demos, tmp_path: Path, start: StartCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Workers whose code differs are found out, and nothing of theirs is stored."""
    shutil.copytree(PROJECT / "replication", tmp_path / "other" / "replication")
    with (tmp_path / "other" / "replication" / "trials" / "compute.py").open("a") as file:
        file.write("\nCHANGED = True\n")
    monkeypatch.setenv(SCHEDULER, start(str(tmp_path / "other")).address)
    with pytest.raises(WorkerError, match=r"other code.*install the same commit"):
        run_few(small_demos, tmp_path / "trials.sqlite")
    store = Store(tmp_path / "trials.sqlite")
    with store._connection as connection:
        assert connection.execute("SELECT COUNT(*) FROM trials").fetchone() == (0,)


def test_the_cluster_of_the_manual(checkout: Checkout, reference: Reference) -> None:
    """Its commands listen on loopback only; with a worker killed on the way, no byte differs."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    pages = (PROJECT / "README.md", PROJECT / "docs" / "running.md")
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    found = re.findall(r"^ *\.venv/bin/dask (.+) &$", text.replace("8786", port), re.MULTILINE)
    commands = list(dict.fromkeys(found))
    cluster = [
        subprocess.Popen(
            [sys.executable, "-m", "dask", *shlex.split(command)],
            cwd=checkout.scratch,
            env=os.environ | checkout.variables,
            stderr=subprocess.DEVNULL,
        )
        for command in commands
    ]
    try:
        assert len(cluster) == 2
        assert wait(lambda: len(_children(cluster[1].pid)) == 2)
        checkout.gate.touch()
        run = checkout.start("run", "--scheduler", f"tcp://127.0.0.1:{port}")
        assert wait(lambda: checkout.computed)
        assert listening(checkout.mark) == {"127.0.0.1"}
        os.kill(_children(cluster[1].pid)[0], signal.SIGKILL)
        checkout.gate.unlink()
        complained = run.communicate(timeout=PATIENCE)[1]
        assert run.returncode == 0, complained
        assert checkout.results() == reference.results
    finally:
        for process in reversed(cluster):
            process.terminate()
            process.wait(timeout=PATIENCE)
    assert gone(checkout.mark)


def _children(parent: int) -> list[int]:
    """Return the worker processes that `dask worker` has started."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            own = (folder / "stat").read_text().rpartition(")")[2].split()[1] == str(parent)
            if own and b"spawn_main" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except OSError:
            continue
    return found
