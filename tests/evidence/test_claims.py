from __future__ import annotations

import copy
import json
import math
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replication.evidence.claims import (
    LABELS,
    TESTS,
    Claim,
    ClaimError,
    canonical_hash,
    criteria_hash,
    evidence,
    label,
    load_claims,
    parse_claims,
    short_label,
)
from replication.evidence.experiments import EXPERIMENTS
from replication.evidence.statistics import CONFIDENCE
from replication.evidence.tables import read_table
from replication.files import PROJECT
from replication.irl import METHODS, READINGS
from replication.paper.published import FIGURE_5, FIGURE_12, TABLE_1, TABLE_2, Published
from replication.pipeline.declaration import Declaration

TEXT = (PROJECT / "replication" / "evidence" / "claims.toml").read_text(encoding="utf-8")
DOCUMENT = tomllib.loads(TEXT)
CLAIMS = load_claims().claim
NAMES = [one.id for one in CLAIMS]

DEMANDED = {
    "FASTER STEADIER REWARD-TO-GOAL Q-GROWS Q-TO-GOAL",
    "SAVES-OPEN SAVES-OBSTACLES SAVES-SOCCER",
    "ZERO-OPEN ZERO-OBSTACLES ZERO-SOCCER",
    "AVOIDS-OPEN AVOIDS-OBSTACLES AVOIDS-SOCCER",
    "MEAN-UNIFIED-OPEN MEAN-INCORRECT-OPEN MEAN-ADABOOST-OPEN",
    "MEAN-UNIFIED-OBSTACLES MEAN-INCORRECT-OBSTACLES",
    "SD-UNIFIED-OPEN SD-INCORRECT-OPEN SD-ADABOOST-OPEN",
    "SD-UNIFIED-OBSTACLES SD-INCORRECT-OBSTACLES",
    "RUN-UNIFIED-OPEN RUN-ADABOOST-OPEN RUN-UNIFIED-SOCCER RUN-INCORRECT-SOCCER",
}


def written(value: Any, shuffle: np.random.Generator | None = None) -> str:
    """Write a value as TOML in one line, tables with their keys in any order."""
    if isinstance(value, dict):
        keys = list(value)
        if shuffle:
            shuffle.shuffle(keys)
        return (
            "{" + ", ".join(f"{json.dumps(k)} = {written(value[k], shuffle)}" for k in keys) + "}"
        )
    if isinstance(value, list):
        return "[" + ", ".join(written(one, shuffle) for one in value) + "]"
    if isinstance(value, float):
        return "nan" if math.isnan(value) else repr(value)
    return json.dumps(value)


def leaves(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    """Yield the place and the value of everything that is neither a table nor a list."""
    if isinstance(value, dict | list):
        for key, one in value.items() if isinstance(value, dict) else enumerate(value):
            yield from leaves(one, (*place, key))
    else:
        yield place, value


def lines(document: dict[str, Any], shuffle: np.random.Generator | None = None) -> str:
    """Write a document as TOML, a line for each of its keys."""
    keys = list(document)
    if shuffle:
        shuffle.shuffle(keys)
    return "".join(f"{key} = {written(document[key], shuffle)}\n" for key in keys)


# --- the hash --------------------------------------------------------------------------------


@given(st.integers(0, 10**6), st.text("abc #\"'=[]", max_size=20))
@settings(deadline=None, max_examples=10)
def test_hash_is_of_what_is_said(seed: int, comment: str) -> None:
    """Layout, comments and the order of keys do not change the hash."""
    rng = np.random.default_rng(seed)
    text = lines(DOCUMENT, rng).replace("\n", f"   # {comment}\n\n")
    assert canonical_hash(text) == canonical_hash(TEXT) == criteria_hash()


def test_hash_changes_with_every_value() -> None:
    """Whatever number or word of the file is changed, the hash is another, a new one each time."""
    hashes = [criteria_hash()]
    for place, value in leaves(DOCUMENT):
        document = copy.deepcopy(DOCUMENT)
        owner = document
        for key in place[:-1]:
            owner = owner[key]
        if isinstance(value, str):
            owner[place[-1]] = value + "x"
        else:
            owner[place[-1]] = 0.25 if math.isnan(value) else value + 1
        hashes.append(canonical_hash(lines(document)))
    assert len(hashes) > 300
    assert len(set(hashes)) == len(hashes)


def test_hash_knows_the_order_of_lists() -> None:
    """The order of claims and of readings is a part of what is said."""
    for key in ("claim", "explored"):
        turned = {**DOCUMENT, key: DOCUMENT[key][::-1]}
        assert canonical_hash(lines(turned)) != criteria_hash()


# --- what is refused -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('note = "Against reconstruction R1, w', 'nota = "w', ["claim FASTER.nota", "not permit"]),
        ('task = "open-maze"', 'task = "maze"', ["claim FASTER.task", "'maze'"]),
        ('measure = "iterations"', 'measure = "steps"', ["claim FASTER.measure", "'steps'"]),
        ('statistic = "sd-ratio"', 'statistic = "var"', ["claim STEADIER.statistic", "'var'"]),
        ('test = "signed-rank"', 'test = "t-test"', ["claim FASTER.test", "'t-test'"]),
        ('test = "signed-rank"', 'test = "none"', ["claim FASTER", "'signed-rank', not 'none'"]),
        ('direction = "less"', 'direction = "fewer"', ["claim FASTER.direction", "'fewer'"]),
        ('direction = "less"', 'direction = "inside"', ["claim FASTER", "'inside' does not go"]),
        ('x = "unified"', 'x = "unifid"', ["claim FASTER", "no method 'unifid'", "adaboost"]),
        ('y = "adaboost"', 'y = "ada"', ["claim FASTER", "no method 'ada'"]),
        ('y = "adaboost"', "", ["claim FASTER", "needs y"]),
        ("adaboost = [44.94", "boosting = [44.94", ["claim FASTER", "no method 'boosting'"]),
        ("[44.94, 10.27, 100]", "[44.94, 10.27]", ["claim FASTER.paper.adaboost"]),
        ("adaboost = [44.94, 10.27, 100]", "", ["claim FASTER", "both 'unified' and 'adaboost'"]),
        ('place = "Table I, Fig. 6"', "", ["claim FASTER.place", "required"]),
        ('measure = "iterations"', "", ["claim FASTER.measure", "required"]),
        ("margin = 1.0", 'margin = "one"', ["claim STEADIER.margin", "'one'"]),
        ('id = "FASTER"', "", ["claim 0.id", "required"]),
        ('id = "FASTER"', 'id = "STEADIER"', ["'STEADIER' is there twice"]),
        ("root_seed = 2026", "root_seed = 77", ["root seed 77 was explored"]),
        ("soccer = 60", "", ["judging.trials has no 'soccer'"]),
        ("soccer = 60", "football = 60", ["judging.trials.football", "'football'"]),
        ("level = 0.05", "", ["judging.level", "required"]),
        ("level = 0.05", "level = 0.05\nlevels = 1", ["judging.levels", "not permitted"]),
        ('readings = ["printed"', 'readings = ["paper"', ["judging.readings.0", "'paper'"]),
        ("[judging]", "more = 1\n[judging]", ["more", "not permitted"]),
        ("used = {printed", "used = {print", ["claim MEAN-UNIFIED-OPEN.used.print"]),
        ("[judging]", "[judging", ["not TOML", "line"]),
        ("confidence = 0.95", "confidence = 0.9", ["judging: all intervals", "0.95, not 0.9"]),
        ("soccer = 60", "soccer = 0", ["judging.trials.soccer", "greater", "not 0"]),
        ("fewest = 30", "fewest = 0", ["judging.fewest", "greater", "not 0"]),
        ("level = 0.05", "level = 5", ["judging.level", "less than 1, not 5"]),
        ("root_seed = 2026", "root_seed = -1", ["judging.root_seed", "greater", "not -1"]),
        ('y = "adaboost"', 'y = "unified"', ["claim FASTER: x and y are both 'unified'"]),
    ],
)
def test_bad_entry_is_one_line(old: str, new: str, named: list[str]) -> None:
    """What is unknown, missing or does not fit is one line that names file, claim and key."""
    assert old in TEXT
    with pytest.raises(ClaimError) as caught:
        parse_claims(TEXT.replace(old, new, 1))
    said = str(caught.value)
    assert said.startswith("claims.toml")
    assert "\n" not in said
    for part in named:
        assert part in said


def test_published_statistic_needs_its_numbers() -> None:
    """A claim about a published mean without that mean is refused."""
    head, tail = TEXT.split('id = "MEAN-UNIFIED-OPEN"')
    tail = tail.replace("unified = [40.10, 4.73, 100]", "adaboost = [44.94, 10.27, 100]", 1)
    with pytest.raises(
        ClaimError, match=r"^claims.toml, claim MEAN-UNIFIED-OPEN: paper.unified is missing$"
    ):
        parse_claims(f'{head}id = "MEAN-UNIFIED-OPEN"{tail}')


def test_unknown_claim_has_the_nearest_named() -> None:
    """An id that does not exist is answered with the one that was probably meant."""
    assert load_claims().by_id("FASTER") == CLAIMS[0]
    with pytest.raises(ClaimError, match=r"unknown claim 'FASTR' \(did you mean 'FASTER'\?\)"):
        load_claims().by_id("FASTR")


# --- the frozen file -------------------------------------------------------------------------


def test_every_claim_is_there() -> None:
    """Each claim that the paper makes in figures, tables and abstract has its criterion."""
    assert set(NAMES) == set(" ".join(DEMANDED).split())


def published(claim: Claim, method: str) -> Published:
    """Return what replication/paper.py has for a method in the place that a claim cites."""
    if claim.statistic == "published-run" or claim.task == "soccer":
        runs = FIGURE_12 if claim.task == "soccer" else FIGURE_5
        return Published(claim.place, float(runs[method]), math.nan, 1)
    return {"open-maze": TABLE_1, "obstacle-maze": TABLE_2}[claim.task][method]


@pytest.mark.parametrize("claim", [one for one in CLAIMS if one.paper], ids=lambda one: one.id)
def test_published_numbers_are_those_of_the_paper(claim: Claim) -> None:
    """Mean, SD, number of trials and place agree with replication/paper.py."""
    for method in claim.paper:
        own, paper = claim.published(method), published(claim, method)
        assert (own.mean, own.n) == (paper.mean, paper.n)
        assert own.sd == pytest.approx(paper.sd, nan_ok=True)
        assert paper.place in own.place


def test_published_effects_by_hand() -> None:
    """The published effect is the difference of means, the ratio of SDs, the mean or the SD."""
    expected = {
        "FASTER": 40.10 - 44.94,
        "STEADIER": 4.73 / 10.27,
        "SAVES-SOCCER": 7 - 15,
        "MEAN-ADABOOST-OPEN": 44.94,
        "SD-ADABOOST-OPEN": 10.27,
        "RUN-UNIFIED-OPEN": 47,
    }
    for id, effect in expected.items():
        assert load_claims().by_id(id).paper_effect == pytest.approx(effect)
    assert math.isnan(load_claims().by_id("ZERO-OPEN").paper_effect)


@pytest.mark.parametrize("claim", CLAIMS, ids=NAMES)
def test_claim_can_be_judged(claim: Claim) -> None:
    """Its methods are run on its task, its margin is that of its test, and paper has both sides."""
    methods = EXPERIMENTS[claim.task].methods
    assert {claim.x, *filter(None, [claim.y])} <= set(methods) <= set(METHODS)
    assert claim.test == TESTS.get(claim.statistic, "none")
    neutral = {"mean-difference": 0.0, "sd-ratio": 1.0, "mean": 0.0}
    assert claim.margin == neutral.get(claim.statistic, claim.margin)
    assert set(claim.paper) in (set(), {claim.x, *filter(None, [claim.y])})


def test_numbers_of_the_criteria_are_those_of_the_code() -> None:
    """Confidence and readings are what the statistics and the notebooks use."""
    judging = load_claims().judging
    assert judging.confidence == CONFIDENCE
    assert judging.level == pytest.approx(1 - CONFIDENCE)
    assert judging.readings == READINGS
    assert min(judging.trials.values()) >= judging.fewest
    assert set(judging.trials) == set(EXPERIMENTS)


def test_comments_explain_every_measure_statistic_and_verdict() -> None:
    """The head of the file has a line for each word that the claims use."""
    head = TEXT.split("[judging]")[0]
    for one in CLAIMS:
        for word in (one.measure, one.statistic):
            assert re.search(rf"^#   {word} ", head, flags=re.MULTILINE), word


def test_criteria_are_those_of_the_judging_run() -> None:
    """The hash is that of the file by which the trials of the judging run were first judged."""
    assert criteria_hash() == "5fa3c1710dbc4e60dede829acda1c909ef734aeaf6a4c089c739c23e02327345"


def test_published_verdicts_are_by_this_file() -> None:
    """The column `criteria` of the published verdicts is the hash of the file as it is."""
    path = PROJECT / "figures" / "claims" / "verdicts.csv"
    if not path.exists():
        pytest.skip("figures/claims is not published yet")
    assert set(read_table(path)["criteria"]) == {criteria_hash()}


# --- labels and evidence ---------------------------------------------------------------------


def test_labels_are_those_of_claims() -> None:
    """A label belongs to a claim that compares; a claim without one is called by its id."""
    assert set(LABELS) <= {claim.id for claim in CLAIMS if claim.direction != "inside"}
    assert label("FASTER") == LABELS["FASTER"]
    assert label("NEW-CLAIM") == short_label("NEW-CLAIM") == "NEW-CLAIM"


@pytest.mark.parametrize("claim", CLAIMS, ids=NAMES)
def test_evidence_is_published(claim: Claim) -> None:
    """The output that a claim links to is declared by its notebook."""
    notebook, name = evidence(claim.task, claim.measure).split("/")
    text = (PROJECT / "notebooks" / f"{notebook}.ipynb").read_text(encoding="utf-8")
    declared = Declaration.model_validate(json.loads(text)["metadata"]["replication"])
    assert name in [Path(file).stem for file in declared.outputs]
