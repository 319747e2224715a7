"""The page of the lab as a text; what it does is tested in a browser."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path

import pytest

from replication.files import PROJECT
from replication.lab.page import SWITCHES, lab_data, lab_page
from replication.lab.tasks import FIELDS
from replication.paper.params import Params
from replication.paper.register import load_choices

FILES = resources.files("replication.lab")
FIGURES = PROJECT / "figures"


def test_the_learner_is_made_from_its_source() -> None:
    """The committed learner is what the assembler makes of learner.wat, byte by byte."""
    wasmtime = pytest.importorskip("wasmtime", reason="the extra `wasm` assembles the learner")
    made = wasmtime.wat2wasm(FILES.joinpath("learner.wat").read_text())
    assert bytes(made) == FILES.joinpath("learner.wasm").read_bytes()


@pytest.mark.parametrize("figures", [None, FIGURES])
def test_the_page_is_one_file(figures: Path | None) -> None:
    """It weighs under 200 kB, names no address, and no mark is left in it."""
    page = lab_page(figures)
    assert len(page.encode()) < 200_000
    assert "://" not in page
    assert not re.search(r"@[A-Z]+@|\b(src|href)=", page)


def test_switches_and_parameters_are_those_of_the_register() -> None:
    """The page holds the registered values, the default among them, and nothing of its own."""
    data = lab_data()
    assert data["params"] == {name: Params().values()[name] for name in FIELDS}
    entries = {entry.field.partition(".")[2]: entry for entry in load_choices().values()}
    assert [choice["field"] for choice in data["choices"]] == list(SWITCHES)
    for choice in data["choices"]:
        entry = entries[choice["field"]]
        assert set(choice["values"]) == {entry.default, *entry.alternatives}
    assert data["published"]["groups"] == []
