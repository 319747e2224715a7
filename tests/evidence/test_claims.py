from __future__ import annotations

import copy
import json
import math
import re
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replication import Demos
from replication.evidence import claims as claims_module
from replication.evidence.claims import (
    DECIDING,
    FILE,
    LABELS,
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
from replication.evidence.experiments import EXPERIMENTS, GENERAL, NAMED, NONE
from replication.evidence.statistics import CONFIDENCE
from replication.evidence.tables import read_table
from replication.files import PROJECT
from replication.irl import METHODS, READINGS
from replication.paper.params import Params
from replication.paper.published import FIGURE_5, FIGURE_12, TABLE_1, TABLE_2, Published
from replication.pipeline.declaration import Declaration
from replication.trials.condition import Condition
from replication.trials.measures import Report, trial_row

TEXT = FILE.read_text(encoding="utf-8")
DOCUMENT = tomllib.loads(TEXT)
CLAIMS = load_claims().claim
NAMES = [one.id for one in CLAIMS]

DEMANDED = {
    "FASTER STEADIER FASTER-WITH Q-GROWS REWARD-GROWS",
    "SAVES-OPEN SAVES-OBSTACLES SAVES-SOCCER",
    "ZERO-OPEN ZERO-OBSTACLES ZERO-SOCCER",
    "AVOIDS-OPEN AVOIDS-OBSTACLES AVOIDS-SOCCER",
    "ERRS-OPEN ERRS-OBSTACLES ERRS-SOCCER",
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
    assert canonical_hash(text) == canonical_hash(TEXT)


def test_hash_changes_with_every_value() -> None:
    """Whatever number or word of the file is changed, the hash is another, a new one each time."""
    hashes = [canonical_hash(TEXT)]
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
    """The order of claims and of what was known is a part of what is said."""
    for key in ("claim", "known"):
        turned = {**DOCUMENT, key: DOCUMENT[key][::-1]}
        assert canonical_hash(lines(turned)) != canonical_hash(TEXT)


Edit = Callable[[str, str, str], str]


@pytest.fixture
def edited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Edit:
    """Return a function that replaces text in a copied file and returns the criteria's hash."""
    for name in (FILE.name, *DECIDING):
        (tmp_path / name).write_bytes(FILE.with_name(name).read_bytes())
    monkeypatch.setattr(claims_module, "FILE", tmp_path / FILE.name)

    def edited(name: str, old: str, new: str) -> str:
        path = tmp_path / name
        text = path.read_text(encoding="utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), encoding="utf-8")
        found = criteria_hash()
        path.write_text(text, encoding="utf-8")
        return found

    return edited


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("claims.toml", "level = 0.05", "level = 0.06"),
        ("claims.toml", "soccer = 100", "soccer = 101"),
        ("claims.toml", 'prediction = "shown in all cells"', 'prediction = "absent"'),
        ("verdicts.py", "if p_absent < level:", "if p_absent <= level:"),
        ("verdicts.py", "d = y - x", "d = x - y"),
        ("verdicts.py", "claim.fraction * y.mean()", "claim.fraction * x.mean()"),
        ("statistics.py", "CONFIDENCE = 0.95", "CONFIDENCE = 0.94"),
        ("statistics.py", "FLIPS = 99_999", "FLIPS = 9_999"),
        ("statistics.py", "FLIP_SEED = 95", "FLIP_SEED = 96"),
    ],
)
def test_criteria_change_with_what_decides(edited: Edit, name: str, old: str, new: str) -> None:
    """A value of the file, the rule or the statistics: each changes the hash of the criteria."""
    assert edited(name, old, new) != criteria_hash()


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("claims.toml", "version = 2", "# A comment.\n\nversion = 2"),
        ("verdicts.py", '"""Judge the paper', '"""Say of the paper'),
        ("verdicts.py", "if p_absent < level:", "if p_absent < level:  # a comment"),
        ("statistics.py", '"""Statistics of trials', '"""About trials'),
        ("statistics.py", "\n\nCONFIDENCE", "\n\n# A comment.\n\nCONFIDENCE"),
    ],
)
def test_criteria_do_not_change_with_words(edited: Edit, name: str, old: str, new: str) -> None:
    """Comments, layout and docstrings are no part of the criteria."""
    assert edited(name, old, new) == criteria_hash()


# --- what is refused -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('note = "Against reconstruction R1 of', 'nota = "w', ["claim FASTER.nota", "not permit"]),
        ('task = "open-maze"', 'task = "maze"', ["claim FASTER.task", "'maze'"]),
        ('measure = "iterations"', 'measure = "steps"', ["claim FASTER.measure", "'steps'"]),
        ('statistic = "sd-ratio"', 'statistic = "var"', ["claim STEADIER.statistic", "'var'"]),
        ('x = "unified"', 'x = "unifid"', ["claim FASTER", "no method 'unifid'", "adaboost"]),
        ('y = "adaboost"', 'y = "ada"', ["claim FASTER", "no method 'ada'"]),
        ('y = "adaboost"', "", ["claim FASTER", "needs y"]),
        ('y = "adaboost"', 'y = "unified"', ["claim FASTER: x and y are both 'unified'"]),
        ("adaboost = [44.94", "boosting = [44.94", ["claim FASTER", "no method 'boosting'"]),
        ("[44.94, 10.27, 100]", "[44.94, 10.27]", ["claim FASTER.paper.adaboost", "required"]),
        ("adaboost = [44.94, 10.27, 100]", "", ["claim FASTER", "both 'unified' and 'adaboost'"]),
        ('place = "Table I, Fig. 6"', "", ["claim FASTER.place", "required"]),
        ('measure = "iterations"', "", ["claim FASTER.measure", "required"]),
        ("margin = 2.0", 'margin = "two"', ["claim SAVES-SOCCER.margin", "'two'"]),
        ("fraction = 0.1", "fraction = 1.0", ["claim AVOIDS-OPEN.fraction", "less than 1"]),
        ("fraction = 0.1", "fraction = 0.0", ["claim AVOIDS-OPEN.fraction", "greater than 0"]),
        ('id = "FASTER"', "", ["claim 0.id", "required"]),
        ('id = "FASTER"', 'id = "STEADIER"', ["'STEADIER' is there twice"]),
        ('prediction = "shown in all cells"', "", ["claim FASTER-WITH: needs a prediction, or"]),
        ('prediction = "shown in all cells"', 'prediction = ""', ["claim FASTER-WITH: needs a"]),
        ('used = "rec', 'prediction = "x"\nused = "rec', ["claim MEAN-ADABOOST-OPEN: needs a p"]),
        ("root_seed = 4051", "root_seed = 2026", ["root seed 2026 was used before"]),
        ("root_seed = 4051", "root_seed = 13", ["root seed 13 was used before"]),
        ("root_seed = 4051", "root_seed = -1", ["judging.root_seed", "greater", "not -1"]),
        ("[21, 22]", "[21, 4051]", ["root seed 4051 was used before; judge by one that never"]),
        ("version = 2", "version = 1", ["claims.toml, version", "not 1"]),
        ("version = 2", "", ["claims.toml, version", "required"]),
        ("soccer = 100", "", ["judging.trials has no 'soccer'"]),
        ("soccer = 100", "football = 60", ["judging.trials.football", "'football'"]),
        ("soccer = 100", "soccer = 0", ["judging.trials.soccer", "greater", "not 0"]),
        ("level = 0.05", "", ["judging.level", "required"]),
        ("level = 0.05", "level = 0.05\nlevels = 1", ["judging.levels", "not permitted"]),
        ("level = 0.05", "level = 5", ["judging.level", "less than 1, not 5"]),
        ("[judging]", "more = 1\n[judging]", ["more", "not permitted"]),
        ("[judging]", "[judging", ["not TOML", "line"]),
        ("confidence = 0.95", "confidence = 0.9", ["judging: all intervals", "0.95, not 0.9"]),
        ("fewest = 30", "fewest = 0", ["judging.fewest", "greater", "not 0"]),
        ("root_seeds = [2026]\nwhat", "seeds = [1]\nwhat", ["known.0.root_seeds", "required"]),
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
    assert said.endswith("required") == ("required" in named)


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
    assert load_claims().version == 2


def published(claim: Claim, method: str) -> Published:
    """Return what replication/paper has for a method in the place that a claim cites."""
    if claim.statistic == "published-run" or claim.task == "soccer":
        runs = FIGURE_12 if claim.task == "soccer" else FIGURE_5
        return Published(claim.place, float(runs[method]), math.nan, 1)
    return {"open-maze": TABLE_1, "obstacle-maze": TABLE_2}[claim.task][method]


@pytest.mark.parametrize("claim", [one for one in CLAIMS if one.paper], ids=lambda one: one.id)
def test_published_numbers_are_those_of_the_paper(claim: Claim) -> None:
    """Mean, SD, number of trials and place agree with replication/paper."""
    assert set(claim.paper) == {claim.x, *filter(None, [claim.y])}
    for method in claim.paper:
        (mean, sd, n), paper = claim.paper[method], published(claim, method)
        assert (mean, n) == (paper.mean, paper.n)
        assert sd == pytest.approx(paper.sd, nan_ok=True)
        assert paper.place in claim.place


def test_published_effects_by_hand() -> None:
    """What x needs less, positive; the ratio of SDs, x over y; the mean or the SD."""
    expected = {
        "FASTER": 44.94 - 40.10,
        "FASTER-WITH": 44.94 - 36.48,
        "STEADIER": 4.73 / 10.27,
        "SAVES-OPEN": 40.10 - 36.48,
        "SAVES-OBSTACLES": 40.82 - 35.84,
        "SAVES-SOCCER": 15 - 7,
        "MEAN-ADABOOST-OPEN": 44.94,
        "SD-ADABOOST-OPEN": 10.27,
        "RUN-UNIFIED-OPEN": 47,
    }
    for id, effect in expected.items():
        assert load_claims().by_id(id).paper_effect == pytest.approx(effect)
    for id in ("ZERO-OPEN", "Q-GROWS", "AVOIDS-OPEN"):
        assert math.isnan(load_claims().by_id(id).paper_effect)


def test_cells_by_hand() -> None:
    """A cell for each reading that x has, and each set if x is given one; no other."""
    six = [(f, set) for set in ("hit+detour", "hit+detour+opposite") for f in READINGS]
    expected = {
        "FASTER": [("printed", "none"), ("updated", "none")],
        "FASTER-WITH": six,
        "SAVES-OPEN": six,
        "AVOIDS-OBSTACLES": six,
        "SAVES-SOCCER": [("printed", "all"), ("updated", "all"), ("at-once", "all")],
        "ZERO-OPEN": [("printed", "none"), ("updated", "none")],
        "Q-GROWS": [("printed", "none"), ("updated", "none")],
        "MEAN-ADABOOST-OPEN": [("", "none")],
        "RUN-INCORRECT-SOCCER": [("printed", "all"), ("updated", "all"), ("at-once", "all")],
    }
    for id, cells in expected.items():
        assert load_claims().by_id(id).cells() == cells, id
    assert six[0] == ("printed", NAMED)
    assert six[3] == ("printed", GENERAL)
    assert sum(len(claim.cells()) for claim in CLAIMS) == 70 + 42  # claims, published numbers


@pytest.mark.parametrize("claim", CLAIMS, ids=NAMES)
def test_cells_are_run(claim: Claim) -> None:
    """Every cell's trials of x and of y are among the conditions of the experiment."""
    methods = [METHODS[name] for name in filter(None, (claim.x, claim.y))]
    experiment = EXPERIMENTS[claim.task]
    for reading, set in claim.cells():
        for method in methods:
            assert method.name in experiment.methods
            assert method.under(reading) in method.readings
            assert set in experiment.sets if method.uses_incorrect else True
        assert (set == NONE) == (not methods[0].uses_incorrect)


@pytest.mark.parametrize("claim", CLAIMS, ids=NAMES)
def test_claim_has_the_margin_of_its_statistic(claim: Claim) -> None:
    """A saving has one from a number, a fraction or the paper's SDs; a share has its own."""
    given = [claim.margin is not None, claim.fraction is not None]
    by_paper = bool(claim.paper) and not any(math.isnan(sd) for _, sd, _ in claim.paper.values())
    if claim.statistic == "saved":
        assert sum([*given, by_paper]) == 1
    elif claim.statistic == "share":
        assert given == [True, False]
    else:
        assert given == [False, False]
        assert by_paper == (claim.statistic not in ("mean", "published-run"))


def test_margin_in_soccer_is_a_quarter_as_in_the_tables() -> None:
    """Its note says that in both tables the margin is about a quarter of the saving, as 2 of 8."""
    soccer = load_claims().by_id("SAVES-SOCCER")
    assert soccer.margin == 2.0 == soccer.paper_effect / 4
    for id in ("SAVES-OPEN", "SAVES-OBSTACLES"):
        claim = load_claims().by_id(id)
        (_, sd_x, n), (_, sd_y, _) = claim.paper[claim.x], claim.paper[claim.y]
        margin = 1.53 * math.sqrt((sd_x**2 + sd_y**2) / n)
        assert margin / claim.paper_effect == pytest.approx(0.25, abs=0.01)


def test_what_was_used_is_not_judged() -> None:
    """The mean by which R1 was chosen: this number and no more."""
    used = {claim.id for claim in CLAIMS if claim.used}
    assert used == {"MEAN-ADABOOST-OPEN"}
    assert all(claim.prediction for claim in CLAIMS if not claim.used)


def test_measures_are_those_of_trials(small_condition: Condition) -> None:
    """Every measure of a claim is a column of the table of trials."""
    trial = small_condition.trial(seed=np.random.SeedSequence(1))
    row = trial_row(small_condition, Report(), errors=False)(trial, 0, 1)
    assert {claim.measure for claim in CLAIMS} <= row.keys()


@pytest.fixture
def small_condition(small_demos: Demos) -> Condition:
    """Return a condition that is run fast."""
    return Condition(small_demos, "unified", Params.of(episodes=20, horizon=30, max_iterations=2))


def test_numbers_of_the_criteria_are_those_of_the_code() -> None:
    """Confidence and level belong together, and there are enough trials of each task."""
    judging = load_claims().judging
    assert judging.confidence == CONFIDENCE
    assert judging.level == pytest.approx(1 - CONFIDENCE)
    assert min(judging.trials.values()) >= judging.fewest
    assert set(judging.trials) == set(EXPERIMENTS)


def test_comments_explain_every_measure_statistic_and_verdict() -> None:
    """The head of the file has a line for each word that the claims use."""
    head = TEXT.split("version = 2")[0]
    for one in CLAIMS:
        for word in (one.measure, one.statistic):
            assert re.search(rf"^#   {word} ", head, flags=re.MULTILINE), word
    for verdict in ("not testable", "absent", "shown", "reversed", "inconclusive"):
        assert re.search(rf"^#   {verdict} ", head, flags=re.MULTILINE), verdict


def test_criteria_are_the_frozen_ones() -> None:
    """The hash is that of the commit that froze round II, before its first trial."""
    frozen = "5c1db3f5f939773ef3ccace4b52f9667a2ff502b2d53cd579265d21c58eb6fc3"
    assert criteria_hash() == frozen


def test_published_verdicts_are_by_this_file() -> None:
    """The column `criteria` of the published verdicts is the hash of the file as it is."""
    path = PROJECT / "figures" / "claims" / "verdicts.csv"
    if not path.exists():
        pytest.skip("figures/claims is not published yet")
    assert set(read_table(path)["criteria"]) == {criteria_hash()}


# --- labels and evidence ---------------------------------------------------------------------


def test_labels_are_those_of_claims() -> None:
    """A claim that compares has a label, and no other; one without is called by its id."""
    assert set(LABELS) == {claim.id for claim in CLAIMS if not claim.is_published}
    assert len(set(LABELS.values())) == len(LABELS)
    assert label("FASTER") == LABELS["FASTER"]
    assert label("NEW-CLAIM") == short_label("NEW-CLAIM") == "NEW-CLAIM"


@pytest.mark.parametrize("claim", CLAIMS, ids=NAMES)
def test_evidence_is_published(claim: Claim) -> None:
    """The output that a claim links to is declared by its notebook."""
    notebook, name = evidence(claim.task, claim.measure).split("/")
    text = (PROJECT / "notebooks" / f"{notebook}.ipynb").read_text(encoding="utf-8")
    declared = Declaration.model_validate(json.loads(text)["metadata"]["replication"])
    assert name in [Path(file).stem for file in declared.outputs]
