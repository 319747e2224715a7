from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import pytest

from replication.export.entity import ids_in, types_of
from replication.files import PROJECT
from tests.export.names import NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_run_is_told_as_it_was_recorded(
    entities: Mapping[str, dict[str, Any]], name: str
) -> None:
    """Instrument, inputs, parameters and results are those of the manifest; there is no time."""
    manifest = json.loads((PROJECT / "figures" / name / "provenance.json").read_text("utf-8"))
    action = entities[f"#run/{name}"]
    assert ids_in(action["instrument"]) == [f"notebooks/{name}.ipynb"]
    assert set(ids_in(action["result"])) == {
        f"figures/{name}/{output}" for output in manifest["outputs"]
    }
    read = set(ids_in(action["object"]))
    parameters = {
        entities[id]["name"]: entities[id]["value"]
        for id in read
        if types_of(entities[id]) == ["PropertyValue"]
    }
    recorded = manifest["inputs"]["parameters"]
    assert parameters.keys() == recorded.keys()
    assert all(parameters[key] == recorded[key] for key in ("seed",) if key in recorded)
    data = {id for id in read if not id.startswith("#")}
    assert data == {
        "environment.lock",
        *(
            f"figures/{file}" if (PROJECT / "figures" / file).exists() else file
            for file in manifest["inputs"]["data"]
        ),
    }
    assert not {"startTime", "endTime"} & action.keys()


def test_a_figure_is_described_in_words(entities: Mapping[str, dict[str, Any]]) -> None:
    """A picture has the words that stand for it, and the name that readers know."""
    figure = entities["figures/open_maze/fig05.png"]
    assert figure["name"] == "Fig. 5: picture"
    assert figure["description"].startswith("The share of ")
    assert entities["figures/open_maze/trials.csv"]["name"] == "All trials, one in a row"
