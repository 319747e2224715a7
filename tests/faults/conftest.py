"""Fault tests: a checkout to run in, and what an undisturbed run leaves."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from tests.faults.checkout import TASKS, TRIALS, Checkout, Reference, drafts


@pytest.fixture(autouse=True)
def linux() -> None:
    """Leave the tests out where there is no /proc."""
    if not sys.platform.startswith("linux"):
        pytest.skip("looks into /proc")


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
