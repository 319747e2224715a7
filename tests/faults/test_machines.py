"""Other machines: no network, odd clocks and paths, and foreign kernels change no byte."""

from __future__ import annotations

import os
from pathlib import Path

from tests.faults.checkout import PATIENCE, Checkout, Reference, listening, run_first, wait

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


def test_no_network_is_used(checkout: Checkout, reference: Reference) -> None:
    """With all but loopback cut off a run is the same, and nothing listens elsewhere."""
    log = checkout.scratch / "refused"
    checkout.environment |= {"GUARD_LOG": str(log)}
    run_first(checkout, GUARD)
    checkout.gate.touch()
    process = checkout.start("run", "--jobs", "2")
    assert wait(lambda: checkout.computed)
    assert listening(checkout.mark) == {"127.0.0.1"}
    checkout.gate.unlink()
    complained = process.communicate(timeout=PATIENCE)[1]
    assert process.returncode == 0, complained
    assert not log.exists()
    assert checkout.results() == reference.results


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
    run_first(checkout, CLOCK)
    checkout.run("run", "--jobs", "2")
    assert checkout.results() == reference.results
    for number, path in enumerate(
        [*(checkout.folder / "figures").rglob("*"), *checkout.folder.glob("*/*.*")]
    ):
        os.utime(path, (0, 0) if number % 2 else (2**32, 2**32))
    assert "toy: fresh" in checkout.run("run").out
    assert "toy: fresh" in checkout.run("status", "--all").out
    (checkout.folder / "figures" / "toy" / "curves.csv").write_text("other")
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
        assert (checkout.folder / out / "toy" / name).read_bytes() == reference.results[name]
    again = checkout.run("run", "--out", out, "-p", "demos", f"data/demos/{drive.name}")
    assert "toy: fresh" in again.out
