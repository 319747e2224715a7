"""Faults that a regeneration must survive: kills, full disks, foreign kernels, mutated files."""

import atexit
import errno
import json
import os
import re
import resource
import shlex
import shutil
import signal
import socket
import sqlite3
import stat
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from nbformat.v4 import new_code_cell, new_notebook
from typer.testing import CliRunner

from replication import Demos, cli, demonstrate, files, save_demos
from replication.envs.maze import Maze
from replication.files import PROJECT, write_file
from replication.paper.params import Params
from replication.pipeline.notebook import Notebook
from replication.trials.condition import Condition
from replication.trials.results import Results
from replication.trials.run import run_trials
from replication.trials.store import Store

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")

TASKS, TRIALS = 12, 3
"""The toy notebook's trials: so many tasks, each a chunk of so many trials."""

PARAMETERS = (
    f'out = "figures"\nstore = "build/trials.sqlite"\ndemos = "data/demos/small.json"\n'
    f"trials = {TRIALS}\njobs = 1\nseed = 5"
)

# Each chunk is noted in a file, so that a test sees what is computed. It may take a while, and all
# but the first ones wait while there is a gate, so that a test knows that the run is not over.
TOY = (
    """
import os, time
from pathlib import Path
from replication import load_demos
from replication import trials as computing
from replication.params import Params
from replication.condition import Condition
from replication.store import Store

compute = computing.compute

def noted(*given, **options):
    time.sleep(float(os.environ.get("TOY_PAUSE", "0")))
    while os.path.exists(os.environ["TOY_NOTES"]) and os.path.exists(os.environ["TOY_GATE"]):
        time.sleep(0.02)
    found = compute(*given, **options)
    with open(os.environ["TOY_NOTES"], "a") as notes:
        notes.write("".join(key + "\\n" for key, _ in found))
    return found

computing.compute = noted
""",
    f"""
drive = load_demos(demos)
settings = [
    Setting(drive, "unified", Params.of(episodes=60 + n, horizon=40, max_iterations=40))
    for n in range({TASKS})
]
results = computing.run_trials(settings, trials=trials, store=Store(store), jobs=jobs, seed=seed)
""",
    """
rows = [f"{d.hex()}" for condition in conditions for d in results.errors(condition).ravel().tolist()]
(Path(out) / "curves.csv").write_text("\\n".join(rows))
results.frame().to_csv(Path(out) / "trials.csv", index=False)
print(len(rows), "numbers in", out)
""",
)

PROGRAM = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "from replication.cli import app; app()"
)

SMALL = "\n".join((".......", ".....G.", "...#...", ".......", ".S.....", "......."))


def notebook(path: Path, *cells: str, outputs: list[str], parameters: str = PARAMETERS) -> None:
    """Write a notebook."""
    nodes = [new_code_cell(parameters), *(new_code_cell(cell.strip()) for cell in cells)]
    nodes[0].metadata["tags"] = ["parameters"]
    for number, node in enumerate(nodes):
        node["id"] = f"cell-{number}"
    path.parent.mkdir(parents=True, exist_ok=True)
    nbformat.write(new_notebook(cells=nodes, metadata={"replication": {"outputs": outputs}}), path)


# Compiles what the toy notebook needs, so that no test waits for it.
WARM = f"""
from replication import Maze, demonstrate, fit
from replication.params import Params
params = Params.of(episodes=60, horizon=40, max_iterations=4)
fit(demonstrate("small", Maze.from_text({SMALL!r})), method="unified", params=params, seed=1)
"""


@cache
def _snapshot() -> Path:
    """Copy the package once: whoever edits it while the tests run does not disturb them."""
    folder = Path(tempfile.mkdtemp(prefix="faults-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    project = PROJECT
    shutil.copytree(project / "replication", folder / "replication")
    shutil.copy2(project / "environment.lock", folder)
    subprocess.run([sys.executable, "-c", WARM], cwd=folder, check=True, timeout=600)
    return folder


@dataclass
class Checkout:
    """A copy of the package with the notebook `toy`, and the command `replicate` in it."""

    folder: Path
    environment: dict[str, str] = field(default_factory=dict)
    prefix: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.mark = uuid.uuid4().hex
        self.scratch = self.folder.with_name(self.folder.name + "-scratch")
        self.scratch.mkdir(parents=True)
        for part in ("replication", "environment.lock"):
            source, target = _snapshot() / part, self.folder / part
            if source.is_dir():
                shutil.copytree(source, target)  # numba's cache, too: its stamps are the files'
            else:
                shutil.copy2(source, target)
        (self.folder / "data" / "demos").mkdir(parents=True)
        save_demos(
            demonstrate("small", Maze.from_text(SMALL)), self.folder / "data/demos/small.json"
        )
        notebook(
            self.folder / "notebooks" / "toy.ipynb", *TOY, outputs=["curves.csv", "trials.csv"]
        )

    @property
    def notes(self) -> Path:
        """The file in which the toy notebook notes what it computes."""
        return self.scratch / "notes"

    @property
    def gate(self) -> Path:
        """The file that keeps a run from ending, as long as it exists."""
        return self.scratch / "gate"

    @property
    def computed(self) -> list[str]:
        """The keys of all trials that were computed since the notes were removed."""
        return self.notes.read_text().split() if self.notes.exists() else []

    @property
    def stored(self) -> set[str]:
        """The keys in the store."""
        if not (self.folder / "build" / "trials.sqlite").exists():
            return set()
        connection = sqlite3.connect(self.folder / "build" / "trials.sqlite")
        try:
            return {key for (key,) in connection.execute("SELECT key FROM trials")}
        except sqlite3.OperationalError:  # it is just being made
            return set()
        finally:
            connection.close()

    def start(self, *words: str | Path, **options: Any) -> "subprocess.Popen[str]":
        """Start `replicate`, as the leader of a process group."""
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("JUPYTER", "IPYTHON"))}
        own = {
            "FAULTS_MARK": self.mark,
            "PYTHONPATH": str(self.folder),
            "TMPDIR": str(self.scratch),
            "TOY_NOTES": str(self.notes),
            "TOY_GATE": str(self.gate),
        }
        return subprocess.Popen(
            [*self.prefix, sys.executable, "-c", PROGRAM, *map(str, words)],
            cwd=self.folder,
            env=kept | own | self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            process_group=0,
            **options,
        )

    def run(self, *words: str | Path, code: int = 0, **options: Any) -> "Ended":
        """Run `replicate` to its end and expect an exit code; no process may survive."""
        process = self.start(*words, **options)
        said, complained = process.communicate(timeout=600)
        assert process.returncode == code, complained
        assert gone(self.mark)
        return Ended(said, complained)

    def results(self, out: str = "figures") -> dict[str, bytes]:
        """Return the outputs, their manifest and the executed notebook, by name."""
        executed = "build/executed/paper" if out == "figures" else f"{out}/executed"
        names = [f"{out}/curves.csv", f"{out}/trials.csv", f"{out}/provenance.json"]
        names += [f"{executed}/toy.ipynb"]
        return {Path(name).name: (self.folder / name).read_bytes() for name in names}


@dataclass(frozen=True)
class Ended:
    """What a command printed."""

    out: str
    err: str

    @property
    def error(self) -> str:
        """The one error line, which must be the last."""
        lines = [line for line in self.err.splitlines() if line.startswith("error: ")]
        assert [*lines] == self.err.splitlines()[-1:]
        return lines[0]


def alive(mark: str) -> list[int]:
    """Return the processes that carry a mark in their environment."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if f"FAULTS_MARK={mark}".encode() in (folder / "environ").read_bytes():
                found.append(int(folder.name))
        except OSError:
            continue
    return found


def gone(mark: str, seconds: float = 60) -> bool:
    """Wait until no process carries a mark."""
    return wait(lambda: not alive(mark), seconds)


def wait(condition: Callable[[], object], seconds: float = 60) -> bool:
    """Wait until a condition holds; return whether it does."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def drafts(*folders: Path) -> list[Path]:
    """Return what is neither an output nor the lock but begins with a dot."""
    return [path for folder in folders for path in folder.rglob(".*") if path.name not in {".lock"}]


@dataclass(frozen=True)
class Reference:
    """What an undisturbed run leaves, and how many seconds it took."""

    results: dict[str, bytes]
    seconds: float


@pytest.fixture(scope="session")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Reference:
    """Run the toy notebook undisturbed."""
    checkout = Checkout(tmp_path_factory.mktemp("reference") / "checkout")
    checkout.environment["TOY_PAUSE"] = "0.1"
    began = time.monotonic()
    checkout.run("run", "--jobs", "2")
    seconds = time.monotonic() - began
    assert len(checkout.computed) == len(checkout.stored) == TASKS * TRIALS
    assert drafts(checkout.folder / "figures", checkout.folder / "build") == []
    return Reference(checkout.results(), seconds)


@pytest.fixture
def checkout(tmp_path: Path) -> Checkout:
    """Copy the package."""
    return Checkout(tmp_path / "checkout")


# --- killed ----------------------------------------------------------------------------------


def _kill(checkout: Checkout, rng: np.random.Generator, seconds: float) -> None:
    """Kill a run at a random moment: its parent alone, its process group, or all at once."""
    process = checkout.start("run", "--jobs", "2")
    time.sleep(seconds * rng.uniform(0.3, 1.05))
    what = rng.integers(3)
    if what == 0:
        process.kill()
    elif what == 1:
        os.killpg(process.pid, signal.SIGKILL)
    else:
        for pid in alive(checkout.mark):
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
    process.communicate(timeout=60)  # until nobody holds the pipes
    # Orphans notice within seconds, and publish nothing.
    before = sorted((checkout.folder / "figures").glob("*"))
    assert gone(checkout.mark)
    assert sorted((checkout.folder / "figures").glob("*")) == before


def _killed(folder: Path, reference: Reference, *, kills: int, seed: int) -> None:
    checkout = Checkout(folder)
    checkout.environment["TOY_PAUSE"] = "0.1"
    rng = np.random.default_rng(seed)
    seen: set[str] = set()
    for _ in range(kills):
        _kill(checkout, rng, reference.seconds)
        assert checkout.stored >= seen
        seen = checkout.stored
    checkout.notes.unlink(missing_ok=True)
    ended = checkout.run("run", "--jobs", "2")
    assert checkout.results() == reference.results
    assert len(checkout.stored) == TASKS * TRIALS
    assert not seen & set(checkout.computed)
    if "fresh" not in ended.out:  # the last kill may have come too late
        assert len(checkout.computed) == TASKS * TRIALS - len(seen)
    assert drafts(checkout.folder / "figures", checkout.folder / "build") == []
    assert "fresh" in checkout.run("run").out


def test_kills_lose_and_repeat_nothing(tmp_path: Path, reference: Reference) -> None:
    """After five kills a run gives the undisturbed bytes and computes only what was not stored."""
    _killed(tmp_path / "checkout", reference, kills=5, seed=1)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(20))
def test_a_hundred_kills_lose_and_repeat_nothing(
    tmp_path: Path, reference: Reference, seed: int
) -> None:
    """The same for a hundred kills, in twenty series of five."""
    _killed(tmp_path / "checkout", reference, kills=5, seed=100 + seed)


def test_a_killed_kernel_is_named(checkout: Checkout) -> None:
    """A kernel that is killed is reported with its likely cause, and earlier outputs stay."""
    kill = "if trials < 0: import os; os.kill(os.getpid(), 9)"
    write = "from pathlib import Path\n(Path(out) / 'a.txt').write_text(str(trials))"
    notebook(checkout.folder / "notebooks" / "toy.ipynb", write, kill, outputs=["a.txt"])
    checkout.run("run", "--out", "here")
    error = checkout.run("run", "--out", "here", "-p", "trials", "-1", code=1).error
    assert re.search(
        r"toy\.ipynb: cell 3: the kernel was killed, perhaps for want of memory", error
    )
    assert (checkout.folder / "here" / "a.txt").read_text() == str(TRIALS)
    assert drafts(checkout.folder / "here") == []


def test_a_cell_over_its_time_is_named(checkout: Checkout) -> None:
    """A cell that takes too long is ended and named, with the way to allow it more."""
    path = checkout.folder / "notebooks" / "toy.ipynb"
    notebook(path, "import time\ntime.sleep(60)", outputs=[])
    error = checkout.run("run", "--timeout", "8", code=1).error
    assert error.endswith("cell 2 took more than 8 seconds; allow more with --timeout")


@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c_keeps_what_is_finished(
    checkout: Checkout, reference: Reference, times: int
) -> None:
    """Ctrl-C, also an impatient one, has one line and code 130; the same command goes on."""
    checkout.gate.touch()
    process = checkout.start("run", "--jobs", "2")
    assert wait(lambda: checkout.stored, 300)
    for _ in range(times):
        os.killpg(process.pid, signal.SIGINT)
        time.sleep(0.2)
    said, complained = process.communicate(timeout=60)
    assert process.returncode == 130
    error = Ended(said, complained).error
    assert "finished notebooks and trials are kept" in error
    assert "the same command goes on from there" in error
    assert "Traceback" not in complained
    assert gone(checkout.mark)
    assert [path.name for path in (checkout.folder / "figures").iterdir()] == [".lock"]
    assert not list(checkout.scratch.glob("replicate-*"))
    kept = checkout.stored
    assert 0 < len(kept) < TASKS * TRIALS
    checkout.notes.unlink()
    checkout.gate.unlink()
    checkout.run("run", "--jobs", "2")
    assert checkout.results() == reference.results
    assert len(checkout.computed) == TASKS * TRIALS - len(kept)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_verification_leaves_no_workers(checkout: Checkout, number: signal.Signals) -> None:
    """However verify is ended, so are the processes that compute for it."""
    demos = PROJECT / "data" / "demos" / "open_maze.json"
    shutil.copy2(demos, checkout.folder / "data" / "demos")
    rows = [f"open-maze,unified,{k},1,9,True,9,,sha256:0\n" for k in range(2000)]
    (checkout.folder / "figures").mkdir()
    (checkout.folder / "figures" / "trials.csv").write_text(
        "task,method,trial,seed,iterations,converged,steps,choices,digest\n" + "".join(rows)
    )
    process = checkout.start("verify", "--jobs", "2")
    assert wait(lambda: len(alive(checkout.mark)) >= 3, 300)
    process.send_signal(number)
    complained = process.communicate(timeout=60)[1]
    if number == signal.SIGKILL:
        assert process.returncode == -signal.SIGKILL
    else:
        assert process.returncode == 130
        assert complained == "error: interrupted\n"
    assert gone(checkout.mark)


def test_a_second_run_waits_for_the_first(checkout: Checkout, reference: Reference) -> None:
    """Of two runs at once, the second says that it waits, and then finds everything fresh."""
    checkout.gate.touch()
    first = checkout.start("run")
    assert wait(lambda: checkout.computed, 300)
    second = checkout.start("run")
    assert second.stdout is not None
    waits = second.stdout.readline()
    assert re.fullmatch(r"another run writes to .*: waiting until it ends\n", waits)
    checkout.gate.unlink()
    said = [process.communicate(timeout=300)[0] for process in (first, second)]
    assert (first.returncode, second.returncode) == (0, 0)
    assert "waiting" not in said[0]
    assert said[1].startswith("toy: fresh, nothing to do\n")
    assert len(checkout.computed) == TASKS * TRIALS
    assert checkout.results() == reference.results


# --- places and machines ---------------------------------------------------------------------

FILL = """
import resource, os
from pathlib import Path
(Path(out) / "a.txt").write_text("new" * 100_000 if trials in (1, 2) else "old")
if trials in (2, 3):
    resource.prlimit(os.getppid(), resource.RLIMIT_FSIZE, (100_000, 100_000))
if trials == 3:
    print("much\\n" * 50_000)
"""


@pytest.mark.parametrize("trials", [1, 2, 3])
def test_a_full_disk_leaves_the_old_output(checkout: Checkout, trials: int) -> None:
    """Where a cell, publishing or the executed notebook finds no room, nothing is half-written."""
    notebook(checkout.folder / "notebooks" / "toy.ipynb", FILL, outputs=["a.txt"])
    checkout.run("run", "--out", "here", "-p", "trials", "0")
    before = {path: path.read_bytes() for path in (checkout.folder / "here").glob("*.*")}
    limit: dict[str, Any] = {}
    if trials == 1:
        limit["preexec_fn"] = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100_000,) * 2)
    words = ("run", "--out", "here", "-p", "trials", str(trials))
    error = checkout.run(*words, code=1, **limit).error
    assert "file too large" in error.lower()
    assert before == {path: path.read_bytes() for path in (checkout.folder / "here").glob("*.*")}
    assert drafts(checkout.folder / "here", checkout.folder / "build") == []
    assert not list(checkout.scratch.glob("replicate-*"))


def test_every_write_may_fail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever write finds the disk full: one error line, whole files, and a later run mends."""
    notebook(tmp_path / "notebooks" / "toy.ipynb", "1", outputs=["a.txt"], parameters='out = "x"')
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    content = {"text": "old"}

    def execute(notebook: Notebook, _: object, stage: Path, *, executed: Path, **__: Any) -> None:
        (stage / "a.txt").write_text(content["text"])
        write_file(executed, notebook.text)

    monkeypatch.setattr(execute, "execute", execute)
    (tmp_path / "environment.lock").touch()
    words = ["run"]
    assert CliRunner().invoke(cli.app, words).exit_code == 0
    write_bytes, left = Path.write_bytes, [0]

    def full(path: Path, data: bytes) -> int:
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, "No space left on device")  # as a write has it: no name
        return write_bytes(path, data)

    for allowed in range(10):
        content["text"] = f"new {allowed}"
        left[0] = allowed
        with monkeypatch.context() as patched:
            patched.setattr(Path, "write_bytes", full)
            result = CliRunner().invoke(cli.app, [*words, "--force"])
        if result.exit_code == 0:
            break
        assert "Traceback" not in result.output
        assert re.fullmatch(r"error: .*no space left on device\n", result.stderr, re.IGNORECASE)
        assert (tmp_path / "figures" / "a.txt").read_text() in ("old", content["text"])
        assert drafts(tmp_path / "figures", tmp_path / "build") == []
        content["text"] = "old"
        assert CliRunner().invoke(cli.app, words).exit_code == 0
        assert (tmp_path / "figures" / "a.txt").read_text() == "old"
        assert "fresh" in CliRunner().invoke(cli.app, words).stdout
    assert allowed >= 3


@pytest.fixture
def public() -> Iterator[Path]:
    """Make a folder that every user may enter and write."""
    folder = Path(tempfile.mkdtemp(prefix="faults-"))
    folder.chmod(0o777)
    yield folder
    for path in [folder, *folder.rglob("*")]:
        if path.is_dir() and not path.is_symlink():
            path.chmod(0o777)
    shutil.rmtree(folder)


def test_a_read_only_checkout_needs_no_root(public: Path, reference: Reference) -> None:
    """A user who can write neither project nor home gets all in --out, bit for bit."""
    checkout = Checkout(public / "checkout")
    shutil.rmtree(checkout.folder / "replication" / "__pycache__", ignore_errors=True)
    home, out = public / "home", public / "out"
    home.mkdir(mode=0o555)
    out.mkdir()
    for folder in (out, checkout.scratch):
        folder.chmod(0o777)
    for path in [checkout.folder, *checkout.folder.rglob("*")]:
        path.chmod(stat.S_IMODE(path.stat().st_mode) & ~0o222 | (0o555 if path.is_dir() else 0o444))
    checkout.environment |= {"HOME": str(home)}
    if os.getuid() == 0:
        if shutil.which("setpriv") is None:
            pytest.skip("root needs setpriv to be another user")
        # It may read everything, or it could not read an interpreter below /root.
        user = ("--reuid=65534", "--regid=65534", "--clear-groups")
        reads = ("--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search")
        checkout.prefix = ("setpriv", *user, *reads)
    before = sorted(checkout.folder.rglob("*"))
    ended = checkout.run("run", "--jobs", "2", "--out", out)
    assert ended.out.count(str(out)) >= 2
    found = {name: (out / name).read_bytes() for name in ("curves.csv", "trials.csv")}
    assert found.items() <= reference.results.items()
    with sqlite3.connect(out / "trials.sqlite") as connection:
        assert connection.execute("SELECT COUNT(*) FROM trials").fetchone() == (TASKS * TRIALS,)
    connection.close()
    executed = (out / "executed" / "toy.ipynb").read_bytes()
    assert (
        executed.replace(b"in out", b"in figures").replace(
            b'out = \\"out\\"', b'out = \\"figures\\"'
        )
        == reference.results["toy.ipynb"]
    )
    assert sorted(checkout.folder.rglob("*")) == before
    assert not list(home.iterdir())


GUARD = """
import os, sys

def guard(event, given):
    if event in ("socket.connect", "socket.bind", "socket.sendto"):
        address = given[1]
        local = ("127.", "::1", "localhost")
        if isinstance(address, tuple) and not str(address[0]).startswith(local):
            refused(event, address)
    elif event in ("socket.getaddrinfo", "socket.gethostbyname"):
        if given[0] not in (None, "127.0.0.1", "localhost", "::1", b"127.0.0.1", b"localhost"):
            refused(event, given)

def refused(event, given):
    with open(os.environ["GUARD_LOG"], "a") as log:
        log.write(f"{event} {given}\\n")
    raise OSError("there is no network")

sys.addaudithook(guard)
"""


def _site(checkout: Checkout, code: str) -> None:
    """Let every Python process of a checkout run some code first."""
    folder = checkout.scratch / "site"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(code)
    checkout.environment["PYTHONPATH"] = f"{folder}{os.pathsep}{checkout.folder}"


def _listening(mark: str) -> set[str]:
    """Return the addresses at which processes with a mark listen."""
    own = set()
    for pid in alive(mark):
        for link in Path(f"/proc/{pid}/fd").glob("*"):
            try:
                own.update(re.findall(r"socket:\[(\d+)\]", str(link.readlink())))
            except OSError:
                continue
    found = set()
    for name, family in (("tcp", socket.AF_INET), ("tcp6", socket.AF_INET6)):
        table = Path("/proc/net") / name
        for line in table.read_text().splitlines()[1:] if table.exists() else []:
            words = line.split()
            if words[3] == "0A" and words[9] in own:
                raw = bytes.fromhex(words[1].partition(":")[0])
                order = [raw[at : at + 4][::-1] for at in range(0, len(raw), 4)]
                found.add(socket.inet_ntop(family, b"".join(order)))
    return found


def test_no_network_is_used(checkout: Checkout, reference: Reference) -> None:
    """With all but loopback cut off a run is the same, and nothing listens elsewhere."""
    log = checkout.scratch / "refused"
    checkout.environment |= {"GUARD_LOG": str(log), "TOY_PAUSE": "0.1"}
    _site(checkout, GUARD)
    process = checkout.start("run", "--jobs", "2")
    seen: set[str] = set()
    while process.poll() is None:
        seen |= _listening(checkout.mark)
        time.sleep(0.1)
    assert process.communicate()[1] is not None
    assert process.returncode == 0
    assert seen == {"127.0.0.1"}
    assert not log.exists()
    assert checkout.results() == reference.results


def test_the_cluster_of_the_readme(checkout: Checkout, reference: Reference) -> None:
    """Its commands listen on loopback only; with a worker killed on the way, no byte differs."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    text = (PROJECT / "README.md").read_text(encoding="utf-8")
    commands = re.findall(r"^ +\.venv/bin/dask (.+) &$", text.replace("8786", port), re.MULTILINE)
    environment = os.environ | {
        "FAULTS_MARK": checkout.mark,
        "PYTHONPATH": str(checkout.folder),
        "TMPDIR": str(checkout.scratch),
        "TOY_NOTES": str(checkout.notes),
        "TOY_GATE": str(checkout.gate),
    }
    cluster = [
        subprocess.Popen(
            [sys.executable, "-m", "dask", *shlex.split(command)],
            cwd=checkout.scratch,
            env=environment | {"TOY_PAUSE": "0.3"},
            stderr=subprocess.DEVNULL,
        )
        for command in commands
    ]
    try:
        assert len(cluster) == 2
        assert wait(lambda: len(_children(cluster[1].pid)) == 2)
        run = checkout.start("run", "--scheduler", f"tcp://127.0.0.1:{port}")
        assert wait(lambda: checkout.computed)
        assert _listening(checkout.mark) == {"127.0.0.1"}
        os.kill(_children(cluster[1].pid)[0], signal.SIGKILL)
        complained = run.communicate(timeout=120)[1]
        assert run.returncode == 0, complained
        assert checkout.results() == reference.results
    finally:
        for process in reversed(cluster):
            process.terminate()
            process.wait(timeout=60)
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


CLOCK = """
import itertools, time

real, real_ns, calls = time.time, time.time_ns, itertools.count()
time.time = lambda: real() - 3600 * (next(calls) // 5)
time.time_ns = lambda: real_ns() - 3_600_000_000_000 * (next(calls) // 5)
"""


def test_a_clock_that_goes_backwards_changes_nothing(
    checkout: Checkout, reference: Reference
) -> None:
    """Times decide nothing: not those of a clock that jumps back, not those of files."""
    _site(checkout, CLOCK)
    checkout.run("run", "--jobs", "2")
    assert checkout.results() == reference.results
    (inside,) = (checkout.folder / "build").glob("executed/*/toy.ipynb")
    for number, path in enumerate(
        [*(checkout.folder / "figures").iterdir(), *checkout.folder.glob("*/*.*"), inside]
    ):
        os.utime(path, (0, 0) if number % 2 else (2**32, 2**32))
    assert "toy: fresh" in checkout.run("run").out
    assert "toy: fresh" in checkout.run("status").out
    (checkout.folder / "figures" / "curves.csv").write_text("other")
    assert "curves.csv is changed" in checkout.run("status").out


def test_paths_with_spaces_and_accents(tmp_path: Path, reference: Reference) -> None:
    """Project, --out and demonstrations may have any name, also where the locale is C."""
    checkout = Checkout(tmp_path / "Mes données" / "projet n° 1 – %s {x}")
    checkout.environment |= {"LC_ALL": "C"}
    drive = checkout.folder / "data" / "demos" / "démo à moi.json"
    (checkout.folder / "data" / "demos" / "small.json").rename(drive)
    out = "où ça / là"
    checkout.run("run", "--jobs", "2", "--out", out, "-p", "demos", f"data/demos/{drive.name}")
    for name in ("curves.csv", "trials.csv"):
        assert (checkout.folder / out / name).read_bytes() == reference.results[name]
    again = checkout.run("run", "--out", out, "-p", "demos", f"data/demos/{drive.name}")
    assert "toy: fresh" in again.out


def test_foreign_kernels_are_not_used(checkout: Checkout, reference: Reference) -> None:
    """Other kernels of any name, and start-up files of the user, leave a run as it is."""
    home = checkout.scratch / "home"
    spec = {"argv": ["false"], "display_name": "foreign", "language": "python"}
    for place in ("path", "data", "home/.local/share/jupyter"):
        for name in ("replication", "python3", "python"):
            folder = checkout.scratch / place / "kernels" / name
            folder.mkdir(parents=True)
            (folder / "kernel.json").write_text(json.dumps(spec))
    startup = home / ".ipython" / "profile_default" / "startup" / "00-mine.py"
    startup.parent.mkdir(parents=True)
    startup.write_text("raise SystemExit('foreign')")
    checkout.environment |= {
        "HOME": str(home),
        "IPYTHONDIR": str(home / ".ipython"),
        "JUPYTER_DATA_DIR": str(checkout.scratch / "data"),
        "JUPYTER_PATH": str(checkout.scratch / "path"),
        "JUPYTER_PREFER_ENV_PATH": "1",
    }
    checkout.run("run", "--jobs", "2")
    assert checkout.results() == reference.results


# --- the store -------------------------------------------------------------------------------


def _results(demos: Demos, path: Path) -> Results:
    conditions = [
        Condition(demos, "unified", Params.of(episodes=60 + n, horizon=40, max_iterations=40))
        for n in range(4)
    ]
    return run_trials(conditions, trials=3, store=Store(path), seed=5)


def _bits(results: Results) -> list[bytes]:
    return [
        array.tobytes()
        for condition in results.conditions
        for k in range(results.trials)
        for trial in [results.trial(condition, k)]
        for array in (trial.errors, trial.weights, trial.q, trial.values, *sum(trial.episodes, ()))
    ]


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, list[bytes]]:
    """Return the bytes of a sound store, and what it holds."""
    path = tmp_path_factory.mktemp("sound") / "trials.sqlite"
    found = _bits(_results(demonstrate("small", Maze.from_text(SMALL)), path))
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
    content, bits = sound
    garbage = np.random.default_rng(1).bytes(len(content) - 8192)
    damaged = {
        "garbage": content[:4096] + garbage + content[-4096:],
        "half": content[: len(content) // 2],
        "header": b"\0" * 100 + content[100:],
        "text": b"not a database, but long enough to be read as one" * 100,
    }[how]
    path = tmp_path / "trials.sqlite"
    path.write_bytes(damaged)
    assert _bits(_results(small_demos, path)) == bits
    assert re.search(
        r"trials\.sqlite is damaged \(.*set aside as \S+; .*again\n", capfd.readouterr().err
    )
    (aside,) = tmp_path.glob("*.damaged")
    assert aside.read_bytes() == damaged
    assert _bits(_results(small_demos, path)) == bits
    assert capfd.readouterr().err == ""


def test_an_empty_store_is_a_new_one(
    small_demos: Demos, tmp_path: Path, sound: tuple[bytes, list[bytes]]
) -> None:
    """A file of no bytes holds nothing that could be set aside; it is filled."""
    (tmp_path / "trials.sqlite").touch()
    assert _bits(_results(small_demos, tmp_path / "trials.sqlite")) == sound[1]


def _check_random_damage(
    demos: Demos, folder: Path, sound: tuple[bytes, list[bytes]], numbers: range
) -> None:
    content, bits = sound
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
        assert _bits(_results(demos, path)) == bits, number


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
    assert _bits(_results(small_demos, path)) == sound[1]
    with sqlite3.connect(path) as connection:
        (short,) = connection.execute("SELECT COUNT(*) FROM trials WHERE length(record) < 60")
    connection.close()
    assert short == (0,)


# --- demonstration files ---------------------------------------------------------------------

# Run in a process of its own, which may take 1 GB more than it has when it begins.
MUTANTS = r"""
import json, pathlib, resource, sys, tempfile, time, warnings
import numpy as np
from replication.demos import DemoError, content_hash, load_demos, save_demos

first, last, *sources = sys.argv[1:]
warnings.simplefilter("ignore")
originals = [pathlib.Path(source).read_bytes() for source in sources]
ODD = [None, True, False, 0, -1, 1, 7, 10**6, 10**15, 10**30, 1.5, 1e308, -0.0, float("nan"),
       float("inf"), "", "up", "correct", "x" * 100_000, "\ud800", "\n\u2028", [], {}, [[]],
       [0] * 100_000, [[0, 0]] * 1000, {"a": {}}, ["up"] * 50_000]

def places(value, found):
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        found.append((value, key))
        if isinstance(item, (dict, list)):
            places(item, found)
    return found

def json_mutant(content, rng):
    document = json.loads(content)
    if document["incorrect"] and rng.random() < 0.3:  # most of these are valid
        demo = document["incorrect"][int(rng.integers(len(document["incorrect"])))]
        demo.pop("states", None)
        demo["actions"] = demo["actions"][: int(rng.integers(1, 1 + len(demo["actions"])))]
        return json.dumps(document).encode()
    for _ in range(int(rng.integers(1, 3))):
        found = places(document, [])
        # by depth, or nearly all would be single states
        depth = [place for place in found if isinstance(place[0], dict)]
        if not found:
            break
        pool = depth if depth and rng.random() < 0.5 else found
        holder, key = pool[int(rng.integers(len(pool)))]
        how = int(rng.integers(7))
        if how == 0:
            del holder[key]
        elif how == 1:
            holder[key] = ODD[int(rng.integers(len(ODD)))]
        elif how == 2 and isinstance(holder, list):
            holder.insert(key, holder[int(rng.integers(len(holder)))])
        elif how == 3 and isinstance(holder[key], int):
            holder[key] += int(rng.choice([-1, 1, 2**31, 2**63]) if rng.random() < 0.5 else 1)
        elif how == 4:
            for _ in range(int(rng.choice([3, 50, 2000]))):
                holder[key] = [holder[key]]
            break  # too deep for what follows
        elif how == 5 and isinstance(holder, dict):
            holder[str(rng.choice(["states", "kind", "x", "version", "map"]))] = holder[key]
        else:
            other, there = found[int(rng.integers(len(found)))]
            try:
                holder[key] = json.loads(json.dumps(other[there]))
            except (KeyError, IndexError):  # was removed just now
                continue
    try:
        return json.dumps(document, ensure_ascii=False).encode(errors="surrogatepass")
    except RecursionError:
        return b"[" * 100_000

def byte_mutant(content, rng):
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        at, size = int(rng.integers(len(data) + 1)), int(2 ** rng.integers(0, 11))
        how = int(rng.integers(7))
        if how == 0 and data:
            data[min(at, len(data) - 1)] ^= 1 << int(rng.integers(8))
        elif how == 1:
            del data[at : at + size]
        elif how == 2:
            data[at:at] = data[at : at + size]
        elif how == 3:
            data[at:at] = rng.bytes(min(size, 16))
        elif how == 4:
            del data[at:]
        elif how == 5:
            data[at:at] = b"0123456789"[: 1 + size % 10] * (size // 4 + 1)
        else:
            data[at:at] = [b"[" * 100_000, b"9" * 5000, b"\xef\xbb\xbf", b"\0", b"\\u0000", b"-",
                           b"1e999", b"NaN"][int(rng.integers(8))]
    return bytes(data)

grown = int(pathlib.Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (grown + 2**30,) * 2)
folder = pathlib.Path(tempfile.mkdtemp())
path, copy = folder / "mutant.json", folder / "copy.json"
count = {"same": 0, "other": 0, "refused": 0}
hashes = {}
for number in range(int(first), int(last)):
    rng = np.random.default_rng(number)
    which = number % len(originals)
    mutate = byte_mutant if rng.random() < 0.5 else json_mutant
    path.write_bytes(mutate(originals[which], rng))
    began = time.process_time()
    try:
        demos = load_demos(path)
    except DemoError as error:
        text = str(error)
        assert text.startswith(f"{path}: "), (number, text)
        assert len(text.splitlines()) == 1 and text.isprintable(), (number, text)
        assert len(text) < 2000, (number, len(text))
        count["refused"] += 1
    except BaseException as error:
        raise AssertionError(f"mutant {number}") from error
    else:
        if which not in hashes:
            (folder / "original.json").write_bytes(originals[which])
            hashes[which] = content_hash(load_demos(folder / "original.json"))
        same = content_hash(demos) == hashes[which]
        count["same" if same else "other"] += 1
        for demo in demos.correct + demos.incorrect:
            if type(demos.environment).__name__ == "Maze":
                state = demos.environment.start
                for action, due in zip(demo.actions, demo.states, strict=False):
                    assert state == due, number
                    state = demos.environment.next_state[state, action]
                assert state == demo.states[-1], number
        save_demos(demos, copy)
        assert content_hash(load_demos(copy)) == content_hash(demos), number
    assert time.process_time() - began < 5, (number, "is slow")
print(json.dumps(count))
"""


def _check_mutants(folder: Path, small: Demos, bounds: list[tuple[int, int]]) -> None:
    save_demos(small, folder / "small.json")
    stored = PROJECT / "data" / "demos"
    sources = [folder / "small.json"]
    sources += [stored / f"{name}.json" for name in ("obstacle_maze", "soccer", "open_maze")]
    running = [
        subprocess.Popen(
            [sys.executable, "-c", MUTANTS, *map(str, (*bound, *sources))],
            env=os.environ | {"TMPDIR": str(folder), "OPENBLAS_NUM_THREADS": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for bound in bounds
    ]
    for process, (said, complained) in [(p, p.communicate(timeout=1500)) for p in running]:
        assert process.returncode == 0, complained
        count = json.loads(said)
        assert min(count.values()) > 0, count


def test_mutated_demos_load_or_are_refused(tmp_path: Path, small_demos: Demos) -> None:
    """A mutated file is valid, or refused in a line that names it, in 5 s and 1 GB."""
    _check_mutants(tmp_path, small_demos, [(0, 200), (200, 400)])


@pytest.mark.long
def test_ten_thousand_mutated_demos(tmp_path: Path, small_demos: Demos) -> None:
    """The same for ten thousand mutants."""
    _check_mutants(tmp_path, small_demos, [(1000, 6000), (6000, 11_000)])
