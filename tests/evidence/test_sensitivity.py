from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from replication import Demos
from replication.evidence.claims import Claim, load_claims
from replication.evidence.experiments import method_conditions
from replication.evidence.sensitivity import (
    HOLDS,
    NAMES,
    OPEN,
    REVERSED,
    UNDEFINED,
    _effects,
    _outcome,
    ablations_table,
    chance,
    effects_table,
    findings,
    findings_at_once,
    level_table,
    numbers_table,
    outcome_shares,
    unchanged,
    variance_shares,
)
from replication.evidence.specifications import (
    Specification,
    factorial_specifications,
    load_specifications,
)
from replication.evidence.statistics import mean_intervals, sd_ratio_intervals, share_interval
from replication.evidence.tables import pairs_near, read_table
from replication.files import PROJECT
from replication.trials.condition import Condition
from replication.trials.measures import measure_trials
from replication.trials.results import Results
from replication.trials.run import run_trials
from replication.trials.store import Store

FEW = {"episodes": 100, "horizon": 40}
CHOICES: dict[str, tuple[Any, ...]] = {
    "ALPHA": (0.1, 0.3, 0.5, 0.9),
    "TIES": ("random", "first"),
    "F-START": (0.1, 0.5, 1.0),
}


def crossed(choices: dict[str, tuple[Any, ...]] = CHOICES, times: int = 1) -> list[Specification]:
    """Return the full factorial; TWIN tells equal ones apart where they stand several times."""
    return [
        Specification("factorial", (*zip(choices, values, strict=True), ("TWIN", twin)))
        for twin in range(times)
        for values in product(*choices.values())
    ]


def effects(
    specifications: list[Specification],
    effect: NDArray[np.float64],
    *,
    half: float = 0.0,
    statistic: str = "mean-difference",
    claim: str = "FASTER",
) -> pd.DataFrame:
    """Make effects up, with intervals of one width."""
    return pd.DataFrame(
        {
            "claim": claim,
            "statistic": statistic,
            "group": [one.group for one in specifications],
            "specification": [one.name for one in specifications],
            "n": 10,
            "capped": 0,
            "effect": effect,
            "low": effect - half,
            "high": effect + half,
            "outcome": [
                HOLDS if x + half < 0 else REVERSED if x - half > 0 else OPEN for x in effect
            ],
        }
    )


# --- outcomes --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("id", "effect", "low", "high", "expected"),
    [
        ("FASTER", -2.0, -3.0, -1.0, HOLDS),
        ("FASTER", -2.0, -4.0, 0.0, OPEN),
        ("FASTER", 2.0, 1.0, 3.0, REVERSED),
        ("STEADIER", 0.5, 0.3, 0.9, HOLDS),
        ("STEADIER", 0.9, 0.8, 1.0, OPEN),
        ("STEADIER", 1.5, 1.1, 2.0, REVERSED),
        ("Q-GROWS", 1.0, 0.5, 1.5, HOLDS),
        ("Q-GROWS", -1.0, -1.5, -0.5, REVERSED),
        ("STEADIER", math.nan, math.nan, math.nan, UNDEFINED),
        ("ZERO-OPEN", 1.0, 0.7, 1.0, HOLDS),
        ("ZERO-OPEN", 0.9, 0.7, 0.95, OPEN),
        ("ZERO-OPEN", 0.5, 0.3, 0.7, REVERSED),
    ],
)
def test_outcome_by_hand(id: str, effect: float, low: float, high: float, expected: str) -> None:
    """The whole interval lies beyond the margin; a share holds where it is itself above it."""
    assert _outcome(load_claims().by_id(id), effect, low, high) == expected


def test_effects_of_many_rows_are_those_of_each() -> None:
    """Each statistic is computed row by row, [specification, trial]."""
    rng = np.random.default_rng(1)
    x, y = rng.normal(36, 4, (4, 12)), rng.normal(40, 8, (4, 12))
    one = load_claims().by_id
    found = _effects(one("FASTER"), x, y)
    np.testing.assert_array_equal(found, ((x - y).mean(axis=1), *mean_intervals(x - y)))
    np.testing.assert_array_equal(
        _effects(one("Q-GROWS"), x, x), (x.mean(axis=1), *mean_intervals(x))
    )
    np.testing.assert_array_equal(_effects(one("STEADIER"), x, y), sd_ratio_intervals(x, y))
    done = np.array([[1.0] * 12, [0.0] * 3 + [1.0] * 9])
    effect, low, high = _effects(one("ZERO-OPEN"), done, done[::-1])
    assert effect.tolist() == [0.75, 0.75]
    assert (low[0], high[0]) == share_interval(9, 12)


def test_published_numbers_have_no_effect_here() -> None:
    """A claim about a published number cannot be evaluated under a specification."""
    with pytest.raises(AssertionError, match="MEAN-UNIFIED-OPEN has no effect"):
        _effects(load_claims().by_id("MEAN-UNIFIED-OPEN"), np.ones((1, 3)), np.ones((1, 3)))


def test_shares_of_outcomes_by_hand() -> None:
    """In two groups each outcome is counted; shares are of those with an effect."""
    table = pd.DataFrame(
        {
            "claim": "FASTER",
            "group": ["single"] * 2 + ["factorial"] * 5,
            "specification": ["default", "b", "c", "d", "e", "f", "g"],
            "capped": [0, 0, 3, 0, 1, 0, 0],
            "effect": [-1.0, -1.0, -4.0, -2.0, 1.0, 3.0, np.nan],
            "low": [-2.0, -2.0, -5.0, -3.0, -1.0, 2.0, np.nan],
            "high": [-0.5, -0.5, -3.0, -1.0, 2.0, 4.0, np.nan],
            "outcome": [HOLDS, OPEN, HOLDS, HOLDS, OPEN, REVERSED, UNDEFINED],
        }
    )
    single, factorial = outcome_shares(table).to_dict("records")
    assert (single["group"], single["specifications"]) == ("single", 2)
    assert [single[name] for name in (HOLDS, OPEN, REVERSED)] == [1, 1, 0]
    assert [factorial[name] for name in (HOLDS, OPEN, REVERSED, UNDEFINED)] == [2, 1, 1, 1]
    assert factorial["specifications"] == 5
    assert (factorial["share"], factorial["with_caps"]) == (0.5, 2)
    assert (factorial["uncapped"], factorial["holds_uncapped"]) == (2, 1)
    assert (single["unchanged"], factorial["unchanged"]) == (1, 0)
    assert (factorial["median"], factorial["lowest"], factorial["highest"]) == (-0.5, -4.0, 3.0)


# --- shares of variance ----------------------------------------------------------------------


def shares_of(table: pd.DataFrame, specifications: list[Specification]) -> dict[str, float]:
    """Return the shares of the only claim."""
    found = variance_shares(table, specifications)
    return dict(zip(found["choice"], found["share"], strict=True))


def without_twin(specifications: list[Specification]) -> list[Specification]:
    """Leave TWIN out of the first specification, so that it is no factor; names stay."""
    return [_Named(one.group, one.choices[:-1], one.name) for one in specifications]


class _Named(Specification):
    """A specification with a name of its own."""

    def __init__(self, group: str, choices: tuple[tuple[str, Any], ...], name: str) -> None:
        super().__init__(group, choices)
        object.__setattr__(self, "_own", name)

    @property
    def name(self) -> str:
        """The given name."""
        return str(self.__dict__["_own"])


@pytest.mark.parametrize("sd", [0.5, 1.0, 2.0])
def test_variance_goes_with_its_choice(sd: float) -> None:
    """Effects made of one choice and noise give the choice about its true share, the others 0."""
    specifications = without_twin(crossed(times=10))
    rng = np.random.default_rng(1)
    steps: dict[Any, float] = {0.1: -3.0, 0.3: -1.0, 0.5: 1.0, 0.9: 3.0}
    made = np.array([steps[dict(one.choices)["ALPHA"]] for one in specifications])
    table = effects(specifications, made + rng.normal(0, sd, len(made)), half=1.959964 * sd)
    found = shares_of(table, specifications)
    true = made.var() / (made.var() + sd**2)
    assert found["ALPHA"] == pytest.approx(true, abs=0.1)
    assert abs(found["TIES"]) < 0.03
    assert abs(found["F-START"]) < 0.03
    assert found["noise"] == pytest.approx(1 - true, abs=0.1)
    assert abs(found["rest"]) < 0.15
    assert sum(found.values()) == pytest.approx(1.0)


def test_two_choices_share_the_variance() -> None:
    """In a balanced design two choices without noise have the shares of their own variances."""
    specifications = without_twin(crossed())
    rows: list[dict[str, Any]] = [dict(one.choices) for one in specifications]
    made = np.array([3 * row["ALPHA"] + (row["TIES"] == "first") for row in rows])
    found = shares_of(effects(specifications, made), specifications)
    alphas, ties = 9 * np.var(CHOICES["ALPHA"]), 0.25
    assert found["ALPHA"] == pytest.approx(alphas / (alphas + ties))
    assert found["TIES"] == pytest.approx(ties / (alphas + ties))
    assert found["F-START"] == pytest.approx(0.0, abs=1e-9)
    assert (found["noise"], found["rest"]) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_choices_that_act_together_are_in_the_rest() -> None:
    """An effect of two choices together, with no effect of either alone, is nobody's own."""
    specifications = without_twin(crossed({"TIES": ("random", "first"), "Q": (0, 1)}, times=20))
    made = np.array(
        [
            1.0 if (dict(one.choices)["TIES"] == "first") == dict(one.choices)["Q"] else -1.0
            for one in specifications
        ]
    )
    found = shares_of(effects(specifications, made), specifications)
    assert found["rest"] == pytest.approx(1.0, abs=0.05)
    assert found["TIES"] == pytest.approx(0.0, abs=0.03)


def test_ratios_enter_by_their_logarithm() -> None:
    """Halving and doubling weigh alike: a ratio's shares are those of its logarithm."""
    specifications = without_twin(crossed(times=10))
    rng = np.random.default_rng(6)
    logs = rng.normal(0, 0.5, len(specifications))
    ratios = effects(specifications, np.exp(logs), statistic="sd-ratio")
    ratios["low"], ratios["high"] = np.exp(logs - 0.2), np.exp(logs + 0.2)
    other = effects(specifications, logs, half=0.2)
    assert shares_of(ratios, specifications) == pytest.approx(shares_of(other, specifications))


def test_ratio_interval_that_reaches_zero_gives_no_infinite_noise() -> None:
    """A resample may have no spread at all: such an interval says nothing of the noise."""
    specifications = without_twin(crossed(times=10))
    logs = np.random.default_rng(6).normal(0, 0.5, len(specifications))
    ratios = effects(specifications, np.exp(logs), statistic="sd-ratio")
    ratios["low"], ratios["high"] = np.exp(logs - 0.2), np.exp(logs + 0.2)
    expected = shares_of(ratios, specifications)
    ratios.loc[3, "low"] = 0.0
    assert shares_of(ratios, specifications) == pytest.approx(expected)


def test_missing_effects_are_left_out() -> None:
    """Specifications without an effect do not count, nor do those of another group."""
    specifications = without_twin(crossed(times=10))
    made = np.random.default_rng(7).normal(size=len(specifications))
    table = effects(specifications, made, half=0.5)
    more = table.head(5).assign(specification=[f"single {n}" for n in range(5)], effect=100.0)
    expected = shares_of(table.iloc[30:], specifications)
    table.loc[:29, ["effect", "low", "high"]] = np.nan
    assert shares_of(pd.concat([table, more]), specifications) == pytest.approx(expected)


def test_too_few_specifications_give_no_shares() -> None:
    """With fewer specifications than values the shares of choices are unknown, not zero."""
    few = [without_twin(crossed())[at] for at in (0, 4, 8, 12, 17, 22)]
    found = shares_of(effects(few, np.arange(6.0)), few)
    assert np.isnan([found[id] for id in (*CHOICES, "rest")]).all()


def test_effects_that_do_not_vary_have_no_shares() -> None:
    """Where all effects are equal there is no variance to share."""
    many = without_twin(crossed(times=10))
    found = variance_shares(effects(many, np.ones(len(many))), many)
    assert found.empty
    assert found.columns.tolist() == ["claim", "choice", "share"]


# --- levels ----------------------------------------------------------------------------------


def test_levels_add_up() -> None:
    """The values of each choice share the specifications, and their means are the whole's."""
    specifications = without_twin(crossed(times=10))
    made = np.random.default_rng(2).normal(size=len(specifications))
    table = effects(specifications, made, half=0.5)
    levels = level_table(table.sample(frac=1.0, random_state=1), specifications)
    assert len(levels) == sum(map(len, CHOICES.values()))
    for id, part in levels.groupby("choice"):
        assert part["specifications"].sum() == len(specifications)
        assert part["value"].tolist() == sorted(CHOICES[str(id)])
        assert part["default"].sum() == 1
        for name, expected in (
            ("mean_effect", made.mean()),
            ("holds", (table["outcome"] == HOLDS).mean()),
            ("reversed", (table["outcome"] == REVERSED).mean()),
        ):
            assert np.average(part[name], weights=part["specifications"]) == pytest.approx(expected)
    row = levels[(levels["choice"] == "TIES") & (levels["value"] == "first")].iloc[0]
    own = [dict(one.choices)["TIES"] == "first" for one in specifications]
    assert row["mean_effect"] == pytest.approx(made[own].mean())
    assert not row["default"]


# --- what is said ----------------------------------------------------------------------------

RULES: dict[str, tuple[Any, ...]] = {
    "ADABOOST-RULE": ("mismatch", "graded"),
    "TIES": ("random", "first"),
}


def ruled(claim: str, statistic: str, by_rule: dict[str, float]) -> pd.DataFrame:
    """Make effects up that the rule of AdaBoost-IRL decides, all trials of "graded" at the cap."""
    made = without_twin(crossed(RULES, times=20))
    values = [by_rule[str(dict(one.choices)["ADABOOST-RULE"])] for one in made]
    table = effects(made, np.array(values), half=0.5, statistic=statistic, claim=claim)
    graded = [dict(one.choices)["ADABOOST-RULE"] == "graded" for one in made]
    return table.assign(capped=np.where(graded, 10, 0), capped_x=0)


def test_findings_count_with_and_without_caps() -> None:
    """Each claim has its counts, whose trials are at the cap, and what is left without them."""
    made = without_twin(crossed(RULES, times=20))
    table = ruled("FASTER", "mean-difference", {"mismatch": 0.0, "graded": -150.0})
    table.loc[0, ["effect", "low", "high", "outcome"]] = [-4.0, -5.0, -3.0, HOLDS]
    zero = ruled("ZERO-OPEN", "share", {"mismatch": 1.0, "graded": 0.0})
    zero["outcome"] = np.where(zero["effect"] > 0.9, HOLDS, REVERSED)
    faster, reaches = findings_at_once(pd.concat([table, zero]), made)
    assert faster.startswith(
        "- **Faster than AdaBoost-IRL**: holds in 41 of 80 specifications (51%), is open in 39 and "
        "reversed in 0. In 40 of them trials end at the iteration cap, all of them of "
        "AdaBoost-IRL; it holds in 1 of the 40 others. It depends most on the rule of "
        "AdaBoost-IRL: 100% of the variance of the effect, "
    )
    assert faster.endswith("It holds with graded 100% (always at the cap), mismatch 2%.")
    assert "; every trial of the other method reaches zero, in every specification." in reaches


def test_caps_of_the_first_method_are_not_put_on_the_other() -> None:
    """If the claim's own method has trials at the cap nothing is said of whose they are."""
    made = without_twin(crossed(RULES, times=20))
    table = ruled("FASTER", "mean-difference", {"mismatch": 0.0, "graded": -150.0})
    table.loc[table["capped"] > 0, "capped_x"] = 1
    (said,) = findings_at_once(table, made)
    assert "end at the iteration cap; it holds in 0 of the 40 others." in said
    assert "AdaBoost-IRL; " not in said


def test_claim_that_depends_on_nothing_is_counted_alone() -> None:
    """Where no choice has a share of the variance none is named; missing effects are told."""
    many = without_twin(crossed(times=10))
    table = effects(many, np.ones(len(many)), half=0.1, claim="STEADIER").assign(capped_x=0)
    table.loc[:19, ["effect", "low", "high", "outcome"]] = [np.nan, np.nan, np.nan, UNDEFINED]
    assert findings_at_once(table, many) == [
        "- **Steadier than AdaBoost-IRL**: holds in 0 of 220 specifications (0%) that have an "
        "effect (20 do not), is open in 0 and reversed in 220."
    ]


def test_findings_say_what_one_choice_moves() -> None:
    """With one choice changed it is said what moves a claim, and how many changes cannot."""
    many = without_twin(crossed(times=10))
    names = ["default", "ALPHA=0.1", "ADABOOST-RULE=vote", "TIES=first"]
    single = pd.DataFrame(
        {
            "claim": ["FASTER"] * 4 + ["STEADIER"] * 2,
            "specification": [*names, *names[:2]],
            "effect": [-2.0, -1.0, -2.0, 2.0, 1.0, 1.1],
            "low": [-3.0, -2.0, -3.0, 1.0, 0.5, 0.6],
            "high": [-1.0, 1.0, -1.0, 3.0, 1.5, 1.6],
            "outcome": [HOLDS, OPEN, HOLDS, REVERSED, OPEN, OPEN],
        }
    )
    assert unchanged(single.head(4)).tolist() == [False, False, True, False]
    soccer = single.head(1).assign(claim="SAVES-SOCCER")
    made = effects(many, np.ones(len(many)), half=0.1).assign(capped_x=0)
    text = findings(made, many, single, soccer).splitlines()
    assert (
        "- **Faster than AdaBoost-IRL**: holds with the defaults; reversed under TIES=first; open "
        "under ALPHA=0.1. 1 of the 3 changes leave its numbers as they are."
    ) in text
    assert "open with the defaults; the same under every other value. 0 of the 1" in "".join(text)
    assert text[-1].startswith("- **Saves iterations**: holds with the defaults; the same")
    assert [line for line in text if line.endswith(":")] == [
        "All choices at once:",
        "One choice at a time, mazes:",
        "One choice at a time, soccer:",
    ]


def test_every_choice_of_the_factorial_has_a_name() -> None:
    """A choice that is added to the factorial has to be named in words, too."""
    assert set(NAMES) == set(load_specifications().mazes.factorial.choices)


def test_chance_is_read_from_a_choice_that_cannot_act() -> None:
    """The rule of AdaBoost-IRL does not act on savings: its shares differ by chance alone."""
    made = without_twin(crossed(RULES, times=20))
    table = ruled("SAVES-OPEN", "mean-difference", {"mismatch": 0.0, "graded": 0.0})
    table.loc[[0, 1, 2, 3], "outcome"] = HOLDS
    said = chance(table, made)
    held = table[table["outcome"] == HOLDS]["capped"].eq(10)
    few, most = sorted((held.sum() / 40, (~held).sum() / 40))
    assert f"with its 2 values in {few:.0%} to {most:.0%} of the specifications" in said


# --- the published effects -------------------------------------------------------------------

FIGURES = PROJECT / "figures"


def test_published_tables_follow_from_the_published_effects() -> None:
    """Outcomes, shares and levels are those of the files of effects, to the last digits."""
    together, single, soccer = (
        read_table(FIGURES / f"sensitivity_{name}.csv")
        for name in ("factorial", "single", "soccer")
    )
    made = factorial_specifications(load_specifications().mazes.factorial)
    shares = variance_shares(together, made).merge(
        variance_shares(together[together["capped"] == 0], made),
        how="left",
        on=["claim", "choice"],
        suffixes=("", "_uncapped"),
    )
    expected = {
        "outcomes": outcome_shares(pd.concat([single, together, soccer])),
        "shares": shares,
        "levels": level_table(together, made),
    }
    for name, table in expected.items():
        stored = read_table(FIGURES / f"sensitivity_{name}.csv")
        assert stored.columns.tolist() == table.columns.tolist()
        for column in table:
            if table[column].dtype.kind == "f":
                np.testing.assert_allclose(stored[column], table[column], rtol=1e-7, atol=1e-9)
            else:
                assert stored[column].astype(str).tolist() == table[column].astype(str).tolist()


def test_published_effects_have_their_outcomes() -> None:
    """Every published outcome follows from its effect and interval, by the claim's margin."""
    rows = pd.concat(
        read_table(FIGURES / f"sensitivity_{name}.csv")
        for name in ("factorial", "single", "soccer")
    )
    assert len(rows) == 8 * 240 + 8 * 44 + 3 * 19
    for row in rows.itertuples():
        assert row.outcome == _outcome(
            load_claims().by_id(row.claim), row.effect, row.low, row.high
        )


# --- tiny runs -------------------------------------------------------------------------------

Run = tuple[Results, dict[Specification, dict[tuple[str, str], Condition]]]


@pytest.fixture(scope="module")
def tiny(small_demos: Demos, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Run two specifications, the second with a cap that most trials reach, and one method less."""
    usual = method_conditions(small_demos, FEW)
    capped = method_conditions(small_demos, {**FEW, "max_iterations": 5})
    conditions = {
        Specification("single", ()): {k: one for k, one in usual.items() if k[1] != "updated"},
        Specification("single", (("ITERATION-CAP", 5),)): {
            k: one for k, one in capped.items() if k[1] != "printed" and k[0] != "adaboost"
        },
    }
    store = Store(tmp_path_factory.mktemp("sensitivity") / "trials.sqlite")
    every = [one for own in conditions.values() for one in own.values()]
    return run_trials(every, trials=6, store=store, seed=2), conditions


def test_effects_are_those_of_the_trials(tiny: Run) -> None:
    """Effects equal the statistics of the trials; capped trials count as the cap and are told."""
    results, conditions = tiny
    wanted: list[Claim] = [
        load_claims().by_id(id) for id in ("FASTER", "SAVES-OPEN", "Q-GROWS", "ZERO-OPEN")
    ]
    table = effects_table(results, conditions, wanted)
    assert table.groupby("claim", sort=False).size().to_dict() == {
        "FASTER": 1,  # the second specification has no AdaBoost-IRL
        "SAVES-OPEN": 2,
        "Q-GROWS": 2,
        "ZERO-OPEN": 1,
    }
    assert set(table["n"]) == {6}
    for row in table.itertuples():
        claim = load_claims().by_id(row.claim)
        (own,) = (one for s, one in conditions.items() if s.name == row.specification)
        trials = measure_trials(results, own)
        x = trials[trials["method"] == claim.x]
        y = trials[trials["method"] == claim.y]
        a, b = x[claim.measure].to_numpy(float), y[claim.measure].to_numpy(float)
        if claim.statistic == "share":
            assert row.effect == min(a.mean(), b.mean())
        else:
            assert row.effect == pytest.approx((a - b).mean() if claim.y else a.mean())
        assert row.low <= row.effect <= row.high
        assert row.capped_x == (x["converged"] == 0).sum()
        assert row.capped == row.capped_x + (y["converged"] == 0).sum()
        assert row.outcome == _outcome(claim, row.effect, row.low, row.high)
    second = {one: own for one, own in conditions.items() if one.choices}
    some = effects_table(results, second, wanted)
    assert some["claim"].tolist() == ["SAVES-OPEN", "Q-GROWS"]  # none has AdaBoost-IRL
    assert table[table["specification"] == "default"]["capped"].tolist() == [0] * 4
    assert (table[table["specification"] != "default"]["capped"] > 0).all()


def test_ablations_are_summaries_of_the_trials(tiny: Run) -> None:
    """Each row has the mean, SD and median of its own trials, and counts those at the cap."""
    results, conditions = tiny
    named = {
        f"{n} {key[0]}": one
        for n, own in enumerate(conditions.values())
        for key, one in own.items()
    }
    table = ablations_table(results, named)
    assert table["setting"].tolist() == list(named)
    for row, condition in zip(table.itertuples(), named.values(), strict=True):
        counts = results.iterations(condition)
        assert (row.n, row.capped) == (6, (~results.converged(condition)).sum())
        assert (row.mean, row.median) == (counts.mean(), np.median(counts))
        assert row.sd == pytest.approx(counts.std(ddof=1))
        assert row.low <= row.mean <= row.high
        more = counts - results.iterations(next(iter(named.values())))
        assert row.more == pytest.approx(more.mean())
        assert row.more_low <= row.more <= row.more_high
    assert (table.loc[0, ["more", "more_low", "more_high"]] == 0).all()
    assert table["capped"].iloc[-1] > 0


def test_numbers_save_against_none(small_demos: Demos, tiny: Run, tmp_path: Any) -> None:
    """What n incorrect demonstrations save is against none, over the same seeds and reading."""
    usual = method_conditions(small_demos, FEW)
    conditions = {
        (n, f): usual["unified-incorrect" if n else "unified", f]
        for n in (0, 9)
        for f in ("printed", "updated")
    }
    store = Store(tmp_path / "trials.sqlite")
    results = run_trials(list(conditions.values()), trials=6, store=store, seed=2)
    table = numbers_table(results, conditions)
    assert list(zip(table["number"], table["F"], strict=True)) == list(conditions)
    for row in table.itertuples():
        counts = results.iterations(conditions[row.number, row.F])
        saved = results.iterations(conditions[0, row.F]) - counts
        assert (row.mean, row.saved) == (counts.mean(), saved.mean())
        assert row.low <= row.mean <= row.high
        assert row.saved_low <= row.saved <= row.saved_high
        near = pairs_near(conditions[row.number, row.F].selected)
        assert (row.pairs, row.leaving) == (near["pairs"], near["leaving"])
    none = table[table["number"] == 0]
    assert (none[["pairs", "saved", "saved_low", "saved_high"]] == 0).all(axis=None)
