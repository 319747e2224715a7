"""A copy of the package with a toy notebook, in which the fault tests run `replicate`."""

from __future__ import annotations

import atexit
import os
import re
import shutil
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from replication import Demos, demonstrate, save_demos
from replication.envs.maze import Maze
from replication.files import PROJECT
from replication.paper.params import Params
from replication.pipeline.manifest import RUNS
from replication.trials.condition import Condition
from replication.trials.results import Results
from replication.trials.run import run_trials
from replication.trials.store import Store
from tests.notebooks import write_notebook

PATIENCE = 1200
"""Seconds after which something hangs, on however slow a machine."""

TASKS, TRIALS = 12, 3
"""The toy notebook's trials: so many conditions, and so many trials of each."""

PARAMETERS = (
    f'out = "figures"\nstore = "build/trials.sqlite"\ndemos = "data/demos/small.json"\n'
    f"trials = {TRIALS}\njobs = 1\nseed = 5"
)

# Each trial is noted in a file, so that a test sees what is computed. It may take a while, and all
# but the first ones wait while there is a gate, so that a test knows that the run is not over.
TOY = (
    """
import os, time
from pathlib import Path
from replication import load_demos
from replication.paper.params import Params
from replication.trials import run as computing
from replication.trials.condition import Condition
from replication.trials.measures import measure_trials
from replication.trials.store import Store

compute = computing.compute

def noted(*given, **options):
    time.sleep(float(os.environ.get("TOY_PAUSE", "0")))
    while os.path.exists(os.environ["TOY_NOTES"]) and os.path.exists(os.environ["TOY_GATE"]):
        time.sleep(0.02)
    found = compute(*given, **options)
    with open(os.environ["TOY_NOTES"], "a") as notes:
        notes.write(found[0] + "\\n")
    return found

computing.compute = noted
""",
    f"""
drive = load_demos(demos)
conditions = [
    Condition(drive, "unified", Params.of(episodes=60 + n, horizon=40, max_iterations=40))
    for n in range({TASKS})
]
results = computing.run_trials(conditions, trials=trials, store=Store(store), jobs=jobs, seed=seed)
""",
    """
every = [results.trial(condition, k) for condition in conditions for k in range(trials)]
errors = [d for trial in every for d in trial.errors.tolist()]
rows = [d.hex() for d in errors]
(Path(out) / "curves.csv").write_text("\\n".join(rows))
measure_trials(results, conditions).to_csv(Path(out) / "trials.csv", index=False)
print(len(rows), "numbers in", out)
""",
)

PROGRAM = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    "from replication.__main__ import main; main()"
)

SMALL = "\n".join((".......", ".....G.", "...#...", ".......", ".S.....", "......."))


def notebook(path: Path, *cells: str, data: list[str], parameters: str = PARAMETERS) -> None:
    """Write a notebook."""
    sources = [cell.strip() for cell in cells]
    write_notebook(path, *sources, parameters=parameters, data=data)


# Compiles what the toy notebook needs, so that no test waits for it.
WARM = f"""
from replication import Maze, demonstrate, fit
from replication.paper.params import Params
params = Params.of(episodes=60, horizon=40, max_iterations=4)
fit(demonstrate("small", Maze.from_text({SMALL!r})), method="unified", params=params, seed=1)
"""


@cache
def _snapshot() -> Path:
    """Copy the package once: whoever edits it while the tests run does not disturb them."""
    folder = Path(tempfile.mkdtemp(prefix="faults-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    shutil.copytree(PROJECT / "replication", folder / "replication")
    shutil.copy2(PROJECT / "environment.lock", folder)
    subprocess.run([sys.executable, "-c", WARM], cwd=folder, check=True)
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
        shutil.copytree(_snapshot(), self.folder)  # numba's cache, too: its stamps are the files'
        (self.folder / "data" / "demos").mkdir(parents=True)
        save_demos(
            demonstrate("small", Maze.from_text(SMALL)), self.folder / "data/demos/small.json"
        )
        notebook(self.folder / "notebooks" / "toy.ipynb", *TOY, data=["curves.csv", "trials.csv"])

    @property
    def notes(self) -> Path:
        """The file in which the toy notebook notes what it computes."""
        return self.scratch / "notes"

    @property
    def gate(self) -> Path:
        """The file that keeps a run from ending, as long as it exists."""
        return self.scratch / "gate"

    @property
    def variables(self) -> dict[str, str]:
        """The environment variables of all that runs here."""
        return {
            "FAULTS_MARK": self.mark,
            "PYTHONPATH": str(self.folder),
            "TMPDIR": str(self.scratch),
            "TOY_NOTES": str(self.notes),
            "TOY_GATE": str(self.gate),
        }

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

    def start(self, *words: str | Path, **options: Any) -> subprocess.Popen[str]:
        """Start `replicate`, as the leader of a process group."""
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("JUPYTER", "IPYTHON"))}
        return subprocess.Popen(
            [*self.prefix, sys.executable, "-c", PROGRAM, *map(str, words)],
            cwd=self.folder,
            env=kept | self.variables | self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            process_group=0,
            **options,
        )

    def run(self, *words: str | Path, code: int = 0, **options: Any) -> Ended:
        """Run `replicate` to its end and expect an exit code; no process may survive."""
        process = self.start(*words, **options)
        said, complained = process.communicate(timeout=PATIENCE)
        assert process.returncode == code, f"{said}\n{complained}"
        assert gone(self.mark)
        return Ended(said, complained)

    def results(self, out: str = "figures") -> dict[str, bytes]:
        """Return the outputs, their manifest and the executed notebook, by name."""
        return {path.name: path.read_bytes() for path in (self.folder / out / "toy").iterdir()}


def run_few(demos: Demos, path: Path, number: int = TASKS) -> Results:
    """Run a few trials of some conditions in this process, or where the environment says."""
    conditions = [
        Condition(demos, "unified", Params.of(episodes=60 + n, horizon=40, max_iterations=40))
        for n in range(number)
    ]
    return run_trials(conditions, trials=TRIALS, store=Store(path), seed=5)


def bits(results: Results) -> list[bytes]:
    """Return all arrays of all trials."""
    return [
        array.tobytes()
        for condition in results.conditions
        for k in range(results.trials)
        for trial in [results.trial(condition, k)]
        for array in (trial.errors, trial.weights, trial.q, trial.values, *sum(trial.episodes, ()))
    ]


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


def gone(mark: str) -> bool:
    """Wait until no process carries a mark."""
    return wait(lambda: not alive(mark))


def wait(condition: Callable[[], object]) -> bool:
    """Wait until a condition holds; return whether it does."""
    end = time.monotonic() + PATIENCE
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def drafts(*folders: Path) -> list[Path]:
    """Return what begins with a dot and is neither the lock nor the record of runs."""
    kept = {".lock", RUNS}
    return [path for folder in folders for path in folder.rglob(".*") if path.name not in kept]


@dataclass(frozen=True)
class Reference:
    """What an undisturbed run leaves, and how many seconds it took."""

    results: dict[str, bytes]
    seconds: float


def run_first(checkout: Checkout, code: str) -> None:
    """Let every Python process of a checkout run some code first."""
    folder = checkout.scratch / "site"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(code)
    checkout.environment["PYTHONPATH"] = f"{folder}{os.pathsep}{checkout.folder}"


def listening(mark: str) -> set[str]:
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
