from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd
import pytest

from replication.evidence.claims import load_claims
from replication.export.entity import ids_in
from replication.files import PROJECT

VERDICTS = pd.read_csv(
    PROJECT / "figures" / "claims" / "verdicts.csv", dtype=str, keep_default_na=False
).to_dict("records")


def numbers(entities: Mapping[str, dict[str, Any]], review: dict[str, Any]) -> dict[str, Any]:
    """Return the properties of a review, by name."""
    found = (entities[id] for id in ids_in(review["additionalProperty"]))
    return {each["name"]: each for each in found}


def test_every_claim_is_there(entities: Mapping[str, dict[str, Any]]) -> None:
    """Each claim of the file is one of the paper, in its words and with our prediction."""
    claims = {id: each for id, each in entities.items() if each["@type"] == "Claim"}
    assert claims.keys() == {f"#claim/{claim.id}" for claim in load_claims().claim}
    for claim in load_claims().claim:
        own = claims[f"#claim/{claim.id}"]
        assert (own["identifier"], own["text"]) == (claim.id, claim.claim)
        assert own["appearance"] == {"@id": "#paper"}
        said = numbers(entities, own)
        assert said["place"]["value"] == claim.place
        assert said.get("prediction", {}).get("value", "") == claim.prediction


@pytest.mark.parametrize("row", VERDICTS, ids=lambda row: f"{row['id']}-{row['reading']}")
def test_every_verdict_has_its_numbers(
    entities: Mapping[str, dict[str, Any]], row: dict[str, str]
) -> None:
    """A review has the word, the interval and every other number of its row of verdicts.csv."""
    cell = "/".join(filter(None, (row["id"], row["reading"], row["set"])))
    review = entities[f"#verdict/{cell}"]
    assert review["@type"] == "ClaimReview"
    assert review["itemReviewed"] == {"@id": f"#claim/{row['id']}"}
    assert review["claimReviewed"] == row["claim"]
    assert review.get("reviewBody", "") == row["why"]
    word = entities[review["reviewRating"]["@id"]]["alternateName"] if row["verdict"] else ""
    assert word == row["verdict"]

    own = numbers(entities, review)
    told = {name: each["value"] for name, each in own.items() if "value" in each}
    for name, (low, high) in {
        "effect": ("low", "high"),
        "predicted": ("predicted_low", "predicted_high"),
    }.items():
        if name in own:
            told |= {low: own[name]["minValue"], high: own[name]["maxValue"]}
    claim = {"id", "claim", "place", "task", "measure", "statistic", "x", "y"}
    elsewhere = claim | {"verdict", "why", "criteria"}
    expected = {name: text for name, text in row.items() if text and name not in elsewhere}
    assert told.keys() == expected.keys()
    for name, text in expected.items():
        number = isinstance(told[name], int | float)
        assert told[name] == (pytest.approx(float(text), rel=1e-12) if number else text)


def test_there_are_no_other_verdicts(entities: Mapping[str, dict[str, Any]]) -> None:
    """There are as many reviews as rows."""
    reviews = [each for each in entities.values() if each["@type"] == "ClaimReview"]
    assert len(reviews) == len(VERDICTS)


def test_the_criteria_have_their_hash(entities: Mapping[str, dict[str, Any]]) -> None:
    """Every verdict is based on criteria with the published hash, whose files are there."""
    criteria = entities["#criteria"]
    assert {row["criteria"] for row in VERDICTS} == {
        entities[criteria["identifier"]["@id"]]["value"]
    }
    assert all("sha256" in entities[id] for id in ids_in(criteria["hasPart"]))
    reviews = [each for each in entities.values() if each["@type"] == "ClaimReview"]
    assert all("#criteria" in ids_in(review["isBasedOn"]) for review in reviews)
