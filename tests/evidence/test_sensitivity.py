from __future__ import annotations

import math
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from replication.evidence.claims import Claim, load_claims
from replication.evidence.joint import joint_test
from replication.evidence.sensitivity import (
    HOLDS,
    JOINT,
    NOISE,
    OPEN,
    REST,
    REVERSED,
    UNDEFINED,
    _effects,
    _outcome,
    effects_table,
    epsilon_squared,
    level_table,
    neutral,
    outcome_shares,
    shares_table,
    unchanged,
)
from replication.evidence.specifications import Specification
from replication.evidence.statistics import mean_interval, sd_ratio_interval, share_interval
from replication.evidence.tables import read_table
from replication.files import PROJECT
from replication.trials.measures import measure_trials
from tests.evidence.conftest import Run, table_of

CHOICES: dict[str, tuple[Any, ...]] = {
    "ALPHA": (0.1, 0.3, 0.5, 0.9),
    "TIES": ("random", "first"),
    "F-START": (0.1, 0.5, 1.0),
}


def crossed(
    choices: dict[str, tuple[Any, ...]] = CHOICES, *, times: int = 1
) -> list[Specification]:
    """Return the full factorial, several times over."""
    values = list(product(*choices.values())) * times
    return [Specification("factorial", tuple(zip(choices, row, strict=True))) for row in values]


def effects(
    specifications: list[Specification],
    effect: NDArray[np.float64],
    *,
    half: float = 0.0,
    statistic: str = "saved",
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
                HOLDS if x - half > 0 else REVERSED if x + half < 0 else OPEN for x in effect
            ],
        }
    )


# --- outcomes --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("id", "effect", "low", "high", "expected"),
    [
        ("FASTER", 2.0, 1.0, 3.0, HOLDS),
        ("FASTER", 2.0, 0.0, 4.0, OPEN),
        ("FASTER", -2.0, -3.0, -1.0, REVERSED),
        ("SAVES-SOCCER", 1.0, 0.5, 1.5, HOLDS),  # less than its margin of interest, but more than 0
        ("AVOIDS-OPEN", -1.0, -1.5, -0.5, REVERSED),
        ("STEADIER", 0.5, 0.3, 0.9, HOLDS),
        ("STEADIER", 0.9, 0.8, 1.0, OPEN),
        ("STEADIER", 1.5, 1.1, 2.0, REVERSED),
        ("Q-GROWS", 1.0, 0.5, 1.5, HOLDS),
        ("Q-GROWS", 1.0, 0.0, 2.0, OPEN),
        ("Q-GROWS", -1.0, -1.5, -0.5, REVERSED),
        ("STEADIER", math.nan, math.nan, math.nan, UNDEFINED),
        ("ZERO-OPEN", 1.0, 0.7, 1.0, HOLDS),
        ("ZERO-OPEN", 0.9, 0.7, 0.95, OPEN),
        ("ZERO-OPEN", 0.5, 0.3, 0.7, REVERSED),
    ],
)
def test_outcome_by_hand(id: str, effect: float, low: float, high: float, expected: str) -> None:
    """The whole interval lies beyond no effect; a share holds where it is above its margin."""
    assert _outcome(load_claims().by_id(id), effect, low, high) == expected


def test_no_effect_by_hand() -> None:
    """Nothing is saved at 0, SDs are equal at 1, a mean stays at 0; a share has its margin."""
    expected = {"SAVES-SOCCER": 0.0, "STEADIER": 1.0, "Q-GROWS": 0.0, "ZERO-OPEN": 0.9}
    assert {id: neutral(load_claims().by_id(id)) for id in expected} == expected


def test_effects_of_many_rows_are_those_of_each() -> None:
    """Each statistic is computed row by row, [specification, trial]; published ones have none."""
    rng = np.random.default_rng(1)
    x, y = rng.normal(36, 4, (4, 12)), rng.normal(40, 8, (4, 12))
    one = load_claims().by_id
    found = _effects(one("FASTER"), x, y)
    np.testing.assert_array_equal(found, ((y - x).mean(axis=1), *mean_interval(y - x)))
    assert (found[0] > 0).all()  # x needs fewer
    np.testing.assert_array_equal(
        _effects(one("Q-GROWS"), x, x), (x.mean(axis=1), *mean_interval(x))
    )
    np.testing.assert_array_equal(_effects(one("STEADIER"), x, y), sd_ratio_interval(x, y))
    done = np.array([[1.0] * 12, [0.0] * 3 + [1.0] * 9])
    effect, low, high = _effects(one("ZERO-OPEN"), done, done[::-1])
    assert effect.tolist() == [0.75, 0.75]
    assert (low[0], high[0]) == share_interval(9, 12)
    with pytest.raises(AssertionError, match="MEAN-UNIFIED-OPEN has no effect"):
        _effects(one("MEAN-UNIFIED-OPEN"), x, y)


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
            "p_family": [0.5, 0.6, 0.01, 0.049, 0.05, 0.2, np.nan],
            "p_median": [0.3] * 2 + [0.02] * 5,
            "p_holds": [0.4] * 2 + [0.03] * 5,
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
    assert (single["p_median"], single["p_holds"], single["alone"]) == (0.3, 0.4, 0)
    assert (factorial["p_median"], factorial["p_holds"], factorial["alone"]) == (0.02, 0.03, 2)


# --- shares of variance ----------------------------------------------------------------------


def shares_of(table: pd.DataFrame) -> dict[str, float]:
    """Return the shares of the only claim."""
    shares = epsilon_squared(table)
    return dict(zip(shares["choice"], shares["share"], strict=True))


@pytest.mark.parametrize("sd", [0.5, 1.0, 2.0])
def test_variance_goes_with_its_choice(sd: float) -> None:
    """Effects made of one choice and noise give the choice about its true share, the others 0."""
    specifications = crossed(times=10)
    rng = np.random.default_rng(1)
    steps: dict[Any, float] = {0.1: -3.0, 0.3: -1.0, 0.5: 1.0, 0.9: 3.0}
    made = np.array([steps[dict(one.choices)["ALPHA"]] for one in specifications])
    table = effects(specifications, made + rng.normal(0, sd, len(made)), half=1.959964 * sd)
    found = shares_of(table)
    true = made.var() / (made.var() + sd**2)
    assert found["ALPHA"] == pytest.approx(true, abs=0.1)
    assert abs(found["TIES"]) < 0.03
    assert abs(found["F-START"]) < 0.03
    assert found["noise"] == pytest.approx(1 - true, abs=0.1)
    assert abs(found["rest"]) < 0.15
    assert sum(found.values()) == pytest.approx(1.0)


def test_two_choices_share_the_variance() -> None:
    """In a balanced design two choices without noise have the shares of their own variances."""
    specifications = crossed()
    rows: list[dict[str, Any]] = [dict(one.choices) for one in specifications]
    made = np.array([3 * row["ALPHA"] + (row["TIES"] == "first") for row in rows])
    found = shares_of(effects(specifications, made))
    alphas, ties = 9 * np.var(CHOICES["ALPHA"]), 0.25
    assert found["ALPHA"] == pytest.approx(alphas / (alphas + ties))
    assert found["TIES"] == pytest.approx(ties / (alphas + ties))
    assert found["F-START"] == pytest.approx(0.0, abs=1e-9)
    assert (found["noise"], found["rest"]) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_choices_that_act_together_are_in_the_rest() -> None:
    """An effect of two choices together, with no effect of either alone, is nobody's own."""
    specifications = crossed({"TIES": ("random", "first"), "Q": (0, 1)}, times=20)
    made = np.array(
        [
            1.0 if (dict(one.choices)["TIES"] == "first") == dict(one.choices)["Q"] else -1.0
            for one in specifications
        ]
    )
    found = shares_of(effects(specifications, made))
    assert found["rest"] == pytest.approx(1.0, abs=0.05)
    assert found["TIES"] == pytest.approx(0.0, abs=0.03)


def test_ratios_enter_by_their_logarithm() -> None:
    """Halving and doubling weigh alike; intervals are normal, as those of many trials."""
    specifications = crossed(times=10)
    logs = np.random.default_rng(6).normal(0, 0.5, len(specifications))
    expected = shares_of(effects(specifications, logs, half=0.2).assign(n=10**9))
    ratios = effects(specifications, np.exp(logs), statistic="sd-ratio")
    ratios["low"], ratios["high"] = np.exp(logs - 0.2), np.exp(logs + 0.2)
    assert shares_of(ratios) == pytest.approx(expected)


def test_missing_effects_are_left_out() -> None:
    """Specifications without an effect do not count, nor do those of another group."""
    specifications = crossed(times=10)
    made = np.random.default_rng(7).normal(size=len(specifications))
    table = effects(specifications, made, half=0.5)
    more = table.head(5).assign(group="single", effect=100.0)
    expected = shares_of(table.iloc[30:])
    table.loc[:29, ["effect", "low", "high"]] = np.nan
    assert shares_of(pd.concat([table, more])) == pytest.approx(expected)


def test_shares_that_cannot_be_known_are_not_zero() -> None:
    """Fewer specifications than values have none, nor do effects that do not vary."""
    few = [crossed()[at] for at in (0, 4, 8, 12, 17, 22)]
    found = shares_of(effects(few, np.arange(6.0)))
    assert np.isnan([found[id] for id in (*CHOICES, "rest")]).all()
    many = crossed(times=10)
    none = epsilon_squared(effects(many, np.ones(len(many))))
    assert none.empty
    assert none.columns.tolist() == ["claim", "choice", "share"]


def test_table_of_shares_has_the_outcomes_too() -> None:
    """Below the shares of the variance stand those of the outcomes, which add up to one."""
    specifications = crossed(times=10)
    made = np.random.default_rng(3).normal(size=len(specifications))
    table = effects(specifications, made, half=0.5).assign(capped=np.arange(len(made)) % 3)
    assert shares_table(table).index.is_unique
    assert not unchanged(table).any()  # as the default is not among them
    assert unchanged(table).dtype == bool
    shares = shares_table(table).set_index("choice")
    assert shares.index.tolist() == [*CHOICES, NOISE, REST, HOLDS, OPEN, REVERSED]
    assert shares.loc[[HOLDS, OPEN, REVERSED], "share"].sum() == pytest.approx(1.0)
    assert shares.loc[HOLDS, "share"] == (table["outcome"] == HOLDS).mean()
    uncapped = shares_of(table[table["capped"] == 0])
    assert shares["share_uncapped"].dropna().to_dict() == pytest.approx(uncapped)


# --- levels ----------------------------------------------------------------------------------


def test_levels_add_up() -> None:
    """The values of each choice share the specifications, and their means are the whole's."""
    specifications = crossed(times=10)
    made = np.random.default_rng(2).normal(size=len(specifications))
    table = effects(specifications, made, half=0.5)
    levels = level_table(table.sample(frac=1.0, random_state=1))
    assert len(levels) == sum(map(len, CHOICES.values()))
    for id, part in levels.groupby("choice"):
        assert part["specifications"].sum() == len(specifications)
        assert part["value"].tolist() == list(map(str, sorted(CHOICES[str(id)])))
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


# --- all specifications at once --------------------------------------------------------------


def trials_under(specifications: int, saved: NDArray[np.float64], n: int = 20) -> pd.DataFrame:
    """Make trials up: what each specification saves, beside the same noise in all of them."""
    rng = np.random.default_rng(8)
    noise = rng.normal(0, 2, n)
    parts = []
    for number in range(specifications):
        y = 40 + rng.normal(0, 3, n)
        x = y - saved[number] - noise - rng.normal(0, 0.5, n)
        for method, counts in (("unified-incorrect", x), ("unified", y)):
            columns = {"number": number, "method": method, "iterations": counts, "converged": 1}
            parts.append(pd.DataFrame(columns | {"trial": np.arange(n), "q_growth": counts}))
    return pd.concat(parts, ignore_index=True)


def test_joint_columns_are_those_of_the_joint_test() -> None:
    """Each group is tested by itself; bounds are those of the rank; other claims have none."""
    saved = np.array([3.0, 0.0, 1.0, -2.0, 0.5, 4.0])
    trials = trials_under(6, saved)
    names = ["TIES=first", "", "ALPHA=0.1", "ALPHA=0.9", "TIES=first", "TIES=random"]
    specifications = [
        Specification(
            "single" if k < 4 else "factorial",
            tuple((id, value) for id, value in (part.split("=") for part in name.split())),
        )
        for k, name in enumerate(names)
    ]
    one = load_claims().by_id
    table = effects_table(trials, specifications, [one("SAVES-OPEN"), one("Q-GROWS")])
    columns = ["p_family", "null_low", "null_high", "p_median", "p_holds"]
    assert list(JOINT) == columns
    own = table[table["claim"] == "SAVES-OPEN"]
    assert table.loc[table["claim"] == "Q-GROWS", columns].isna().all(axis=None)
    assert own["group"].tolist() == ["single"] * 4 + ["factorial"] * 2
    pivot = trials.pivot(index=["number", "method"], columns="trial", values="iterations")
    d = (pivot.xs("unified", level=1) - pivot.xs("unified-incorrect", level=1)).to_numpy()
    assert own["effect"].tolist() == pytest.approx(d.mean(axis=1).tolist())
    for group, rows in (("single", slice(0, 4)), ("factorial", slice(4, 6))):
        part, test = own[own["group"] == group], joint_test(d[rows])
        assert part["p_family"].tolist() == pytest.approx(test.p_familywise.tolist())
        assert set(part["p_median"]) == {test.p_median}
        assert set(part["p_holds"]) == {test.p_significant}
        ranked = part.sort_values("effect")
        assert ranked["null_low"].tolist() == pytest.approx(test.null_low.tolist())
        assert ranked["null_high"].tolist() == pytest.approx(test.null_high.tolist())
    assert own["p_family"].iloc[0] < 0.05  # three iterations are found, none are not
    assert own["p_family"].iloc[1] > 0.2
    assert own["outcome"].tolist()[:4] == [HOLDS, OPEN, OPEN, REVERSED]


def test_joint_test_is_of_what_is_saved() -> None:
    """Where nothing is saved in any specification the joint p-values say so; where much, too."""
    one = load_claims().by_id("SAVES-OPEN")
    specifications = [Specification("single", (("ALPHA", k),)) for k in range(8)]
    nothing, much, lost = (
        effects_table(trials_under(8, np.full(8, saved)), specifications, [one]).iloc[0]
        for saved in (0.0, 3.0, -3.0)
    )
    assert min(nothing["p_median"], nothing["p_holds"]) > 0.05
    assert max(much["p_median"], lost["p_median"]) < 0.01
    assert much["p_holds"] < 0.05  # all of them hold in a fortieth of the flips, they are so alike
    assert lost["p_holds"] == 1.0


# --- the published effects -------------------------------------------------------------------

FIGURES = PROJECT / "figures" / "sensitivity"


@pytest.fixture(scope="module")
def published() -> pd.DataFrame:
    """Read the published effects."""
    if not FIGURES.exists():
        pytest.skip("figures/sensitivity is not published yet")
    return read_table(FIGURES / "effects.csv")


def test_published_tables_follow_from_the_published_effects(published: pd.DataFrame) -> None:
    """Outcomes, shares and levels are those of the file of effects, to the last digits."""
    tables = {
        "outcomes": outcome_shares(published),
        "shares": shares_table(published),
        "levels": level_table(published),
    }
    for name, table in tables.items():
        stored = read_table(FIGURES / f"{name}.csv")
        assert stored.columns.tolist() == table.columns.tolist()
        for column in table:
            if table[column].dtype.kind == "f":
                np.testing.assert_allclose(stored[column], table[column], rtol=1e-7, atol=1e-9)
            else:
                assert stored[column].astype(str).tolist() == table[column].astype(str).tolist()


def test_published_effects_have_their_outcomes(published: pd.DataFrame) -> None:
    """Every published outcome follows from its effect and interval, by the claim's side."""
    for row in published.itertuples():
        claim = load_claims().by_id(row.claim)
        assert (row.neutral, row.measure) == (neutral(claim), claim.measure)
        assert row.outcome == _outcome(claim, row.effect, row.low, row.high)


# --- tiny runs -------------------------------------------------------------------------------


def test_effects_are_those_of_the_trials(tiny: Run) -> None:
    """Effects equal the statistics of the trials; capped trials count as the cap and are told."""
    results, conditions = tiny
    trials = table_of(tiny)
    wanted: list[Claim] = [
        load_claims().by_id(id) for id in ("FASTER", "SAVES-OPEN", "Q-GROWS", "ZERO-OPEN")
    ]
    table = effects_table(trials, list(conditions), wanted)
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
        measured = measure_trials(results, own.values())
        x = measured[measured["method"] == claim.x]
        y = measured[measured["method"] == claim.y]
        a, b = x[claim.measure].to_numpy(float), y[claim.measure].to_numpy(float)
        if claim.statistic == "share":
            assert row.effect == min(a.mean(), b.mean())
        else:
            assert row.effect == pytest.approx((b - a).mean() if claim.y else a.mean())
        assert row.neutral == neutral(claim)
        assert row.low <= row.effect <= row.high
        assert row.capped_x == (x["converged"] == 0).sum()
        assert row.capped == row.capped_x + (y["converged"] == 0).sum()
        assert row.outcome == _outcome(claim, row.effect, row.low, row.high)
    some = effects_table(trials[trials["number"] == 1], list(conditions), wanted)
    assert some["claim"].tolist() == ["SAVES-OPEN", "Q-GROWS"]  # none has AdaBoost-IRL
    assert table[table["specification"] == "default"]["capped"].tolist() == [0] * 4
    assert (table[table["specification"] != "default"]["capped"] > 0).all()
