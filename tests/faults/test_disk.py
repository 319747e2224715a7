"""Disks that are full and checkouts that cannot be written: whole files or none."""

from __future__ import annotations

import errno
import os
import re
import resource
import shutil
import sqlite3
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from replication import cli, files
from replication.pipeline import execute as execution
from replication.pipeline.notebook import Notebook
from tests.faults.checkout import TASKS, TRIALS, Checkout, Reference, drafts, notebook

FILL = """
import resource, psutil
from pathlib import Path
(Path(out) / "a.txt").write_text("new" * 1_000_000 if trials in (1, 2) else "old")
if trials in (2, 3):
    parents = psutil.Process().parents()  # the driver, and the run itself
    pid = parents[0 if trials == 3 else 1].pid
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (100_000, 100_000))
    print("much\\n" * 50_000)
"""


@pytest.mark.parametrize("trials", [1, pytest.param(2, marks=pytest.mark.long), 3])
def test_a_full_disk_leaves_the_old_output(checkout: Checkout, trials: int) -> None:
    """Where a cell, publishing or the executed notebook finds no room, nothing is half-written."""
    notebook(checkout.folder / "notebooks" / "toy.ipynb", FILL, data=["a.txt"])
    checkout.run("run", "--out", "here", "-p", "trials", "0")
    before = checkout.results("here")
    limit: dict[str, Any] = {}
    if trials == 1:
        limit["preexec_fn"] = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2_000_000,) * 2)
    words = ("run", "--out", "here", "-p", "trials", str(trials))
    error = checkout.run(*words, code=1, **limit).error
    assert "file too large" in error.lower()
    assert checkout.results("here") == before
    assert drafts(checkout.folder / "here", checkout.folder / "build") == []
    assert not list(checkout.scratch.glob("replicate-*"))


def test_every_write_may_fail(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever write finds the disk full: one error line, whole files, a later run is whole."""
    notebook(tmp_path / "notebooks" / "toy.ipynb", "1", data=["a.txt"], parameters='out = "x"')
    monkeypatch.setattr(files, "PROJECT", tmp_path)
    content = {"text": "old"}

    def execute(notebook: Notebook, _: object, stage: Path, **__: Any) -> str:
        (stage / "a.txt").write_text(content["text"])
        return notebook.text

    monkeypatch.setattr(execution, "execute", execute)
    (tmp_path / "environment.lock").touch()
    words = ["run"]
    assert CliRunner().invoke(cli.app, words).exit_code == 0
    write_bytes, left, before = Path.write_bytes, [0], "old"

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
        left_over = (tmp_path / "figures" / "toy" / "a.txt").read_text()
        assert left_over in (before, content["text"])
        assert drafts(tmp_path / "figures", tmp_path / "build") == []
        content["text"] = before = left_over
        assert CliRunner().invoke(cli.app, words).exit_code == 0
        assert (tmp_path / "figures" / "toy" / "a.txt").read_text() == before
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
    assert str(out) in ended.out
    found = {path.name: path.read_bytes() for path in (out / "toy").iterdir()}
    with sqlite3.connect(out / "trials.sqlite") as connection:
        assert connection.execute("SELECT COUNT(*) FROM trials").fetchone() == (TASKS * TRIALS,)
    connection.close()
    # the folder outside the project is shown by its name only
    found["notebook.ipynb"] = found["notebook.ipynb"].replace(b"toy", b"figures/toy")
    for name in ("curves.csv", "trials.csv", "notebook.ipynb"):
        assert found[name] == reference.results[name], name
    assert sorted(checkout.folder.rglob("*")) == before
    assert not list(home.iterdir())
