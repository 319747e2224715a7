from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from replication.files import PROJECT, write_file

TASKS = ("open_maze", "obstacle_maze", "soccer")


@pytest.fixture
def document(exported: Mapping[str, bytes]) -> dict[str, Any]:
    """Return the description of the data."""
    return dict(json.loads(exported["croissant.json"]))


def test_every_file_is_what_is_published(document: dict[str, Any]) -> None:
    """The trials and demonstrations of each task are there, with size and hash of their files."""
    named = {each["contentUrl"]: each for each in document["distribution"]}
    assert named.keys() >= {f"figures/{task}/trials.csv" for task in TASKS}
    assert named.keys() >= {f"data/demos/{task}.json" for task in TASKS}
    for name, entry in named.items():
        content = (PROJECT / name).read_bytes()
        assert entry["sha256"] == hashlib.sha256(content).hexdigest()
        assert entry["contentSize"] == f"{len(content)} B"


@pytest.mark.parametrize("task", TASKS)
def test_every_column_is_a_field(document: dict[str, Any], task: str) -> None:
    """The fields of a table are its columns, in order, each with a type and in words."""
    (records,) = (each for each in document["recordSet"] if each["name"] == task)
    header = list(pd.read_csv(PROJECT / "figures" / task / "trials.csv", nrows=0))
    assert [field["name"] for field in records["field"]] == header
    assert all(field["dataType"] and field["description"] for field in records["field"])


@pytest.mark.usefixtures("no_network")
@pytest.mark.filterwarnings("ignore")  # of the validator's own making
def test_it_is_valid_and_its_records_load(exported: Mapping[str, bytes], tmp_path: Path) -> None:
    """The reference reader has nothing to say, and reads the rows and the demonstrations."""
    mlcroissant = pytest.importorskip("mlcroissant")
    for name in ("croissant.json", "figures/soccer/trials.csv", "data/demos/soccer.json"):
        write_file(tmp_path / name, exported[name])
    dataset = mlcroissant.Dataset(tmp_path / "croissant.json")
    issues = dataset.metadata.ctx.issues
    assert (issues.errors, issues.warnings) == (set(), set())

    trials = list(dataset.records("soccer"))
    table = pd.read_csv(PROJECT / "figures" / "soccer" / "trials.csv")
    assert [row["soccer/steps"] for row in trials] == list(table["steps"])

    demos = json.loads((PROJECT / "data" / "demos" / "soccer.json").read_text())
    for part in ("correct", "incorrect"):
        read = list(islice(dataset.records(f"soccer-{part}"), 100))
        actions = [[a.decode() for a in demo[f"soccer-{part}/actions"]] for demo in read]
        assert actions == [demo["actions"] for demo in demos[part]]
    assert [demo["soccer-incorrect/kind"].decode() for demo in read] == [
        demo["kind"] for demo in demos["incorrect"]
    ]
