from __future__ import annotations

from collections import Counter
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replication.evidence.claims import ClaimError, load_claims
from replication.evidence.experiments import GENERAL, NAMED
from replication.evidence.specifications import (
    Factorial,
    default_of,
    factorial_specifications,
    load_specifications,
    named_choices,
    parse_specifications,
    single_specifications,
    sort_key,
)
from replication.files import PROJECT
from replication.irl import READINGS
from replication.paper.register import ChoiceError, load_choices

TEXT = (PROJECT / "replication" / "evidence" / "specifications.toml").read_text(encoding="utf-8")
PLAN = load_specifications()
SINGLE = single_specifications(PLAN.mazes.single.choices)
SOCCER = single_specifications(PLAN.soccer.single.choices)
FACTORIAL = factorial_specifications(PLAN.mazes.factorial)

# --- the declared sets -----------------------------------------------------------------------


def test_enough_is_declared() -> None:
    """At least 40 specifications change one choice, at least 200 eleven at once, all distinct."""
    assert len(SINGLE) >= 40
    assert len(FACTORIAL) >= 200
    assert {len(one.choices) for one in FACTORIAL} == {11}
    for specifications in (SINGLE, FACTORIAL, SOCCER):
        assert len({one.choices for one in specifications}) == len(specifications)
        assert len({one.name for one in specifications}) == len(specifications)


def test_root_seed_is_new() -> None:
    """The trials are neither those of the verdicts nor any that were known before."""
    known = {seed for run in load_claims().known for seed in run.root_seeds}
    assert PLAN.root_seed not in {*known, load_claims().judging.root_seed}
    assert PLAN.mazes.single.trials >= load_claims().judging.fewest


def test_every_claim_with_an_effect_is_evaluated() -> None:
    """All are but the published numbers and the maze with obstacles, which is a value of MAP."""
    evaluated = [*PLAN.mazes.claims, *PLAN.soccer.claims]
    expected = [
        one.id
        for one in load_claims().claim
        if not one.is_published and one.task != "obstacle-maze"
    ]
    assert sorted(evaluated) == sorted(expected)


def test_rounding_and_all_readings_are_varied() -> None:
    """Tolerance and arithmetic, each registered value, and the three readings are among them."""
    assert PLAN.mazes.factorial.choices["F-INDEX"] == READINGS
    for choices in (PLAN.mazes.single.choices, PLAN.soccer.single.choices):
        assert {default_of("F-INDEX"), *choices["F-INDEX"]} == {*READINGS}
    for id in ("TIE-TOLERANCE", "ARITHMETIC"):
        assert {*PLAN.mazes.single.choices[id]} == {*load_choices()[id].alternatives}
    assert {NAMED, GENERAL} <= {*PLAN.mazes.factorial.choices["INCORRECT-KINDS"]}


@pytest.mark.parametrize("choices", [PLAN.mazes.single.choices, PLAN.soccer.single.choices])
def test_no_single_specification_is_the_default(choices: dict[str, Any]) -> None:
    """The default is there once, under its name; no value of a choice repeats it."""
    first, *others = single_specifications(choices)
    assert (first.choices, first.name) == ((), "default")
    assert len(others) == sum(map(len, choices.values()))
    for one in others:
        ((id, value),) = one.choices
        assert value != default_of(id)


def test_every_open_choice_of_the_mazes_is_varied() -> None:
    """What the paper leaves open and a parameter holds is in the list, but for soccer's own."""
    left_out = {
        id
        for id, one in load_choices().items()
        if one.field.split(".")[0] in ("Learner", "Loop", "Update", "Expert", "Demonstrations")
        and not one.open.startswith("stated:")
        and id not in PLAN.mazes.single.choices
    }
    assert left_out <= {"HORIZON", "ITERATION-CAP", "GOAL-VALUE", "ROLLOUTS"}


# --- the factorial ---------------------------------------------------------------------------


def test_factors_are_balanced() -> None:
    """Each value of a choice stands in equally many specifications, its default among them."""
    for id, values in PLAN.mazes.factorial.choices.items():
        counts = Counter(dict(one.choices)[id] for one in FACTORIAL)
        assert counts == dict.fromkeys(values, PLAN.mazes.factorial.size // len(values))
        assert default_of(id) in values


def test_factors_are_nearly_uncorrelated() -> None:
    """No value of one choice goes with a value of another more than by chance in 240 draws."""
    table = [dict(one.choices) for one in FACTORIAL]
    columns = {
        (id, value): np.array([row[id] == value for row in table], dtype=float)
        for id, values in PLAN.mazes.factorial.choices.items()
        for value in values
    }
    found = [
        abs(np.corrcoef(columns[one], columns[other])[0, 1])
        for one, other in combinations(columns, 2)
        if one[0] != other[0]
    ]
    assert max(found) < 4 / 240**0.5  # four standard errors
    assert np.mean(found) < 1 / 240**0.5


def test_factorial_depends_on_its_seed_alone() -> None:
    """The same seed gives the same specifications, another one others."""
    plan = PLAN.mazes.factorial
    assert factorial_specifications(plan) == FACTORIAL
    other = Factorial(**{**plan.model_dump(), "seed": plan.seed + 1})
    assert factorial_specifications(other) != FACTORIAL


# --- names -----------------------------------------------------------------------------------


def test_name_says_every_choice() -> None:
    """The choices can be read back from the name of a specification, as text."""
    for specification in (*SINGLE, *FACTORIAL, *SOCCER):
        choices = {id: str(value) for id, value in specification.choices}
        assert named_choices(specification.name) == choices


@given(st.lists(st.one_of(st.integers(-99, 99), st.floats(-9, 9), st.sampled_from("ab"))))
def test_values_sort_as_text_as_they_do_themselves(values: list[Any]) -> None:
    """Numbers come first, by size; text of a number counts as that number."""
    ordered = sorted(values, key=sort_key)
    numbers = [value for value in ordered if not isinstance(value, str)]
    assert ordered[: len(numbers)] == sorted(numbers)
    assert sorted(map(str, values), key=sort_key) == list(map(str, ordered))


# --- what is refused -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"FASTER"', '"FASTR"', "unknown claim 'FASTR' (did you mean 'FASTER'?)"),
        ('"ZERO-SOCCER"', '"ZERO"', "unknown claim 'ZERO'"),
        ('TIES = ["first"]', 'TEIS = ["first"]', "mazes.single: there is no choice 'TEIS'"),
        ('TIES = ["first"]', 'TIES = ["last"]', "mazes.single: Learner.ties = 'last' is not"),
        ('TIES = ["first"]', 'BUMP = ["x"]', "mazes.single: BUMP has no parameter"),
        ('"random-3"]', '"random-9"]', "mazes.single: MAP = 'random-9' is not accepted: use open"),
        ('16, "random"]', '16, "any"]', "mazes.factorial: Expert.leg = 'any' is not"),
        ('["bootstrap"]', '["one"]', "soccer.single: Learner.goal_value = 'one' is not"),
        ("SOCCER-EPISODES = [10]", 'SOCCER-EPISODES = ["x"]', "soccer.single: Learner.episodes"),
        ("traces = [{ALPHA = 0.0", "traces = [{ALPHA = 0.7", "ablations.traces[0]: Update.alpha"),
        (
            "size = 240",
            "size = 241",
            "mazes.factorial: 5 values of MAP cannot be balanced over 241",
        ),
        ("size = 240", "", "mazes.factorial.size: Field required"),
        ("trials = 30", "trails = 30", "mazes.single.trials: Field required"),
        ("seed = 7", "seed = 7\nmore = 1", "ablations.more: Extra inputs are not permitted"),
        ("numbers = [0", 'numbers = ["some"', "ablations.numbers.0"),
        ("[mazes]", "[mazes", "is not TOML: "),
        ('"FASTER"', '"SAVES-SOCCER"', "mazes.claims: SAVES-SOCCER is about the task 'soccer'"),
        ('"FASTER"', '"ZERO-OBSTACLES"', "mazes.claims: ZERO-OBSTACLES is about the task"),
        ('"SAVES-SOCCER"', '"SAVES-OPEN"', "soccer.claims: SAVES-OPEN is about the task"),
        ('"FASTER"', '"MEAN-UNIFIED-OPEN"', "mazes.claims: MEAN-UNIFIED-OPEN is about a publ"),
        ('W-NORM = ["unit"]', "SOCCER-ARC = [180]", "mazes.single: SOCCER-ARC changes nothing"),
        ('W-NORM = ["unit"]', "SOCCER-EPISODES = [10]", "mazes.single: SOCCER-EPISODES changes"),
        ("SOCCER-ARC = [180]", "DETOUR-WIDTH = [8]", "soccer.single: DETOUR-WIDTH changes nothing"),
        ("SOCCER-ARC = [180]", 'MAP = ["open"]', "soccer.single: MAP changes nothing in soccer"),
        (
            "SOCCER-ARC = [180]",
            'ADABOOST-RULE = ["vote"]',
            "soccer.single: ADABOOST-RULE changes nothing in soccer; it belongs to the mazes",
        ),
        ("trials = 30", "trials = 0", "mazes.single.trials: Input should be greater than or"),
        ("trials = 10", "trials = 1", "mazes.factorial.trials: Input should be greater than or"),
        ("size = 240", "size = 0", "mazes.factorial.size: Input should be greater than or"),
        ("seed = 240", "seed = -1", "mazes.factorial.seed: Input should be greater than or"),
        ("root_seed = 4052", "root_seed = -1", "root_seed: Input should be greater than or"),
        ("iteration_cap = 200", "iteration_cap = 0", "iteration_cap: Input should be greater"),
        ("numbers = [0", "numbers = [-1", "ablations.numbers.0"),
        ("numbers = [0, ", "numbers = [", "ablations.numbers: add 0"),
    ],
)
def test_bad_entry_is_one_line(old: str, new: str, said: str) -> None:
    """What is unknown, missing, not accepted or not balanced is one line that names the place."""
    assert old in TEXT
    with pytest.raises((ChoiceError, ClaimError)) as caught:
        parse_specifications(TEXT.replace(old, new, 1))
    assert str(caught.value).startswith("specifications.toml")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
