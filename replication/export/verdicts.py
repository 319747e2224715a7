"""The paper's claims and our verdicts as a fact check: Claim, ClaimReview and Rating.

The rating is the verdict in a word. The numbers behind it are properties of the review, named as
the columns of ``verdicts.csv``; an interval is the least and the largest value of its property.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from typing import Any

from replication import files
from replication.evidence.claims import DECIDING, Claim, load_claims
from replication.export.entity import Entity, properties, refs
from replication.files import read_text

TABLE = "figures/claims/verdicts.csv"
FROZEN = tuple(f"replication/evidence/{name}" for name in ("claims.toml", *DECIDING))
"""The files that the hash of the criteria covers."""

PAPER, CRITERIA = "#paper", "#criteria"

OF_CLAIM = ("task", "measure", "statistic", "x", "y", "place", "prediction")
"""Fields that are the same in all cells of a claim."""

OF_CELL = ("reading", "set", "n", "capped", "paper", "margin")
TESTS = ("p", "p_absent", "p_holm", "p_absent_holm", "consistent")


def claim_entities(author: Any) -> Iterator[Entity]:
    """Yield the claims, the verdict on each in each cell, the words of verdicts, the criteria."""
    rows = list(csv.DictReader(io.StringIO(read_text(files.PROJECT / TABLE))))
    yield from _criteria(rows[0]["criteria"])
    for word in sorted({row["verdict"] for row in rows} - {""}):
        yield {"@id": _rating(word), "@type": "Rating", "alternateName": word, "name": word}
    for claim in load_claims().claim:
        yield from _claim(claim)
    for row in rows:
        yield from _review(row, author)


def _criteria(value: str) -> Iterator[Entity]:
    (frozen,) = properties(CRITERIA, {"sha256": {"value": value}})
    yield {
        "@id": CRITERIA,
        "@type": "CreativeWork",
        "description": "They were frozen before the judging run. The hash covers the values of "
        "claims.toml, and the source that decides without its comments and docstrings.",
        "hasPart": refs(FROZEN),
        "identifier": refs([frozen["@id"]]),
        "name": "The criteria by which the claims are judged",
    }
    yield frozen


def _claim(claim: Claim) -> Iterator[Entity]:
    id = f"#claim/{claim.id}"
    given = {name: {"value": getattr(claim, name)} for name in OF_CLAIM if getattr(claim, name)}
    own = properties(id, given)
    yield {
        "@id": id,
        "@type": "Claim",
        "additionalProperty": refs(each["@id"] for each in own),
        "appearance": refs([PAPER]),
        "identifier": claim.id,
        "name": claim.claim,
        "text": claim.claim,
        **({"description": claim.note} if claim.note else {}),
    }
    yield from own


def _review(row: Mapping[str, str], author: Any) -> Iterator[Entity]:
    cell = "/".join(filter(None, (row["id"], row["reading"], row["set"])))
    id = f"#verdict/{cell}"
    numbers = properties(id, _numbers(row))
    yield {
        "@id": id,
        "@type": "ClaimReview",
        "additionalProperty": refs(each["@id"] for each in numbers),
        "author": author,
        "claimReviewed": row["claim"],
        "isBasedOn": refs([TABLE, CRITERIA]),
        "itemReviewed": refs([f"#claim/{row['id']}"]),
        "name": f"Verdict on {cell}",
        **({"reviewRating": refs([_rating(row["verdict"])])} if row["verdict"] else {}),
        **({"reviewBody": row["why"]} if row["why"] else {}),
    }
    yield from numbers


def _numbers(row: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """Return what stands in a row, but for what the claim and the review have themselves."""
    numbers = {name: {"value": _value(row[name])} for name in (*OF_CELL, *TESTS) if row[name]}
    if row["effect"]:
        numbers["effect"] = {
            "description": f"{row['statistic']} of {row['measure']}, with its 95 % interval",
            "maxValue": _value(row["high"]),
            "minValue": _value(row["low"]),
            "value": _value(row["effect"]),
        }
    if row["predicted_low"]:
        numbers["predicted"] = {
            "description": "Where 95 % of replications as precise as ours would lie, given the "
            "paper's error",
            "maxValue": _value(row["predicted_high"]),
            "minValue": _value(row["predicted_low"]),
        }
    return numbers


def _value(text: str) -> int | float | str:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text


def _rating(word: str) -> str:
    return f"#rating/{word.replace(' ', '-')}"
