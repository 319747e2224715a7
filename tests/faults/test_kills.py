"""Kills and interruptions: nothing is lost or computed twice, and no process stays."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from replication.files import PROJECT
from tests.faults.checkout import (
    PATIENCE,
    TASKS,
    TRIALS,
    Checkout,
    Ended,
    Reference,
    alive,
    drafts,
    gone,
    wait,
)


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
    process.communicate(timeout=PATIENCE)  # until nobody holds the pipes
    # Orphans notice within seconds, and publish nothing.
    before = _published(checkout)
    assert gone(checkout.mark)
    assert _published(checkout) == before


def _published(checkout: Checkout) -> list[Path]:
    """Return all that is neither a draft nor in one."""
    return sorted((checkout.folder / "figures").glob("[!.]*/[!.]*"))


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
    assert not list(checkout.scratch.glob("replicate-*"))
    assert "fresh" in checkout.run("run").out


def test_kills_lose_and_repeat_nothing(tmp_path: Path, reference: Reference) -> None:
    """After three kills a run gives the undisturbed bytes and computes only what was not stored."""
    _killed(tmp_path / "checkout", reference, kills=3, seed=1)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(20))
def test_a_hundred_kills_lose_and_repeat_nothing(
    tmp_path: Path, reference: Reference, seed: int
) -> None:
    """The same for a hundred kills, in twenty series of five."""
    _killed(tmp_path / "checkout", reference, kills=5, seed=100 + seed)


@pytest.mark.parametrize("times", [1, pytest.param(2, marks=pytest.mark.long)])
def test_ctrl_c_keeps_what_is_finished(
    checkout: Checkout, reference: Reference, times: int
) -> None:
    """Ctrl-C, also an impatient one, has one line and code 130; the same command goes on."""
    checkout.gate.touch()
    process = checkout.start("run", "--jobs", "2")
    assert wait(lambda: checkout.stored)
    for _ in range(times):
        os.killpg(process.pid, signal.SIGINT)
        time.sleep(0.2)
    said, complained = process.communicate(timeout=PATIENCE)
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


WAITING = """
import os, time

def compute(*_, **__):
    while os.path.exists(os.environ["TOY_GATE"]):
        time.sleep(0.02)
"""

SOUND = """
verify_folder = verify_records = lambda *_: []
verify_outputs = lambda *_, **__: []
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_verification_leaves_no_workers(checkout: Checkout, number: signal.Signals) -> None:
    """However verify is ended while it recomputes trials, so are the processes that do."""
    demos = PROJECT / "data" / "demos" / "open_maze.json"
    shutil.copy2(demos, checkout.folder / "data" / "demos")
    rows = [f"open-maze,unified,printed,none,{k},1\n" for k in range(100)]
    table = checkout.folder / "figures" / "toy" / "trials.csv"
    table.parent.mkdir(parents=True)
    table.write_text("task,method,reading,set,trial,seed\n" + "".join(rows))
    path = checkout.folder / "notebooks" / "toy.ipynb"
    document = json.loads(path.read_text())
    document["metadata"]["replication"] |= {"data": ["curves.csv"], "trials": True}
    path.write_text(json.dumps(document))
    for module, code in (("evidence/recompute.py", WAITING), ("pipeline/verify.py", SOUND)):
        with (checkout.folder / "replication" / module).open("a") as file:
            file.write(code)
    checkout.gate.touch()
    process = checkout.start("verify", "--jobs", "2")
    assert wait(lambda: len(alive(checkout.mark)) >= 3 or process.poll() is not None)
    process.send_signal(number)
    complained = process.communicate(timeout=PATIENCE)[1]
    if number == signal.SIGKILL:
        assert process.returncode == -signal.SIGKILL
    else:
        assert (process.returncode, complained) == (130, "error: interrupted\n")
    assert gone(checkout.mark)


@pytest.mark.long
def test_a_second_run_waits_for_the_first(checkout: Checkout, reference: Reference) -> None:
    """Of two runs at once, the second says that it waits, and then finds everything fresh."""
    checkout.gate.touch()
    first = checkout.start("run")
    assert wait(lambda: checkout.computed)
    second = checkout.start("run")
    assert second.stdout is not None
    waits = second.stdout.readline()
    assert re.fullmatch(r"another run writes to .*: waiting until it ends\n", waits)
    checkout.gate.unlink()
    said = [process.communicate(timeout=PATIENCE)[0] for process in (first, second)]
    assert (first.returncode, second.returncode) == (0, 0)
    assert "waiting" not in said[0]
    assert said[1].startswith("toy: fresh, nothing to do\n")
    assert len(checkout.computed) == TASKS * TRIALS
    assert checkout.results() == reference.results
