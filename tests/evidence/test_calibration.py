from __future__ import annotations

import itertools
from collections.abc import Collection
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, stats

from replication.evidence import calibration
from replication.evidence.calibration import (
    FINAL_SEED,
    FINAL_TRIALS,
    PAIR,
    PLAINEST,
    POINTS,
    SCREEN_SEED,
    SCREEN_TRIALS,
    TRACE,
    WORLD,
    WORLDS,
    Point,
    calibration_table,
    chosen,
    condition,
    finalists,
    judged_table,
    kl_divergence,
    left_out,
    nearest,
    points,
    rule_follows,
    stages,
    worlds,
)
from replication.evidence.claims import load_claims
from replication.evidence.experiments import EXPERIMENTS
from replication.evidence.statistics import mean_prediction, sd_prediction
from replication.evidence.tables import read_table
from replication.files import PROJECT
from replication.irl.methods import TRACES
from replication.paper.published import Published
from replication.paper.register import load_choices
from replication.trials.compute import trial_key
from replication.trials.measures import factors

COLUMNS = [*WORLD, *TRACE, "F-INDEX"]


def table_of(divergences: dict[Point, float], fits: Collection[Point] = ()) -> pd.DataFrame:
    """Make a table of one stage up: points with their divergences, the nearest first."""
    rows = [
        {**dict(zip(COLUMNS, point, strict=True)), "kl_divergence": d, "fits": point in fits}
        for point, d in divergences.items()
    ]
    return pd.DataFrame(rows).sort_values("kl_divergence", kind="stable", ignore_index=True)


def world_points(world: tuple[Any, ...], trace: str) -> list[Point]:
    """Return the points of a world under a trace, in the order of all points."""
    return [point for point in points() if (point[:3], point[-1]) == (world, trace)]


ALL_WORLDS = list(dict.fromkeys(point[:3] for point in points()))


# --- the criterion ---------------------------------------------------------------------------


@pytest.mark.parametrize(("mean", "sd"), [(40.1, 4.73), (39.1, 5.2), (45.0, 3.0), (30.0, 9.0)])
def test_kl_divergence_by_integration(mean: float, sd: float) -> None:
    """It is the integral of p log(p / q), p being the published one; infinite with no spread."""
    p, q = stats.norm(PAIR.mean, PAIR.sd), stats.norm(mean, sd)
    expected, _ = integrate.quad(
        lambda x: p.pdf(x) * (p.logpdf(x) - q.logpdf(x)),
        PAIR.mean - 12 * PAIR.sd,
        PAIR.mean + 12 * PAIR.sd,
    )
    assert kl_divergence(mean, sd, PAIR) == pytest.approx(expected, abs=1e-7)
    for out in ((mean, 0.0), (np.nan, np.nan), (mean, np.nan)):
        assert kl_divergence(*out, PAIR) == np.inf


@given(st.floats(1, 100), st.floats(0.1, 50), st.floats(1, 100), st.floats(0.1, 50))
def test_kl_divergence_is_least_at_the_published_pair(
    mean: float, sd: float, paper_mean: float, paper_sd: float
) -> None:
    """It is zero at the pair itself, nowhere below, and grows with the distance of the means."""
    paper = Published("here", paper_mean, paper_sd)
    assert kl_divergence(paper_mean, paper_sd, paper) == pytest.approx(0.0, abs=1e-12)
    assert kl_divergence(mean, sd, paper) >= -1e-12
    further = paper_mean + 2 * (mean - paper_mean)
    assert kl_divergence(further, sd, paper) >= kl_divergence(mean, sd, paper)


def test_kl_divergence_is_the_likelihood_of_the_published_sample() -> None:
    """Of two points the nearer one makes a sample with the published mean and SD likelier."""
    sample = stats.zscore(np.random.default_rng(1).normal(size=100)) * PAIR.sd + PAIR.mean
    points = [(39.1, 5.2), (41.0, 4.0), (36.0, 4.7), (40.1, 9.0)]
    likelihoods = [stats.norm(*point).logpdf(sample).mean() for point in points]
    kl_divergences = [kl_divergence(*point, PAIR) for point in points]
    for (a, one), (b, other) in itertools.combinations(
        zip(likelihoods, kl_divergences, strict=True), 2
    ):
        assert a - b == pytest.approx(other - one)


# --- the points ------------------------------------------------------------------------------


def test_points_are_all_registered_values() -> None:
    """Every value of five choices under both traces, but for the ablation ALPHA = 0."""
    found = points()
    assert len(found) == len(set(found)) == 5 * 2 * 2 * 4 * 3 * 2
    for at, id in enumerate((*WORLD, *TRACE)):
        entry = load_choices()[id]
        values = {entry.default, *entry.alternatives} - ({0.0} if id == "ALPHA" else set())
        assert {point[at] for point in found} == values
    assert {point[-1] for point in found} == set(TRACES)
    assert {(*PLAINEST, trace) for trace in TRACES} <= set(found)
    calibrated = {id for id, one in load_choices().items() if one.rule.startswith("Calibrated")}
    assert calibrated == {*WORLD, *TRACE}


def test_points_do_not_depend_on_the_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    """A new default changes no point's number, by which its trials are filed."""
    before = list(points())
    register = dict(load_choices())
    for id in (*WORLD, *TRACE):
        entry = register[id]
        other, *others = [value for value in entry.alternatives if value != 0]
        values = {"default": other, "alternatives": (entry.default, *others)}
        register[id] = type(entry)(**{**vars(entry), **values})
    monkeypatch.setattr(calibration, "load_choices", lambda: register)
    assert points.__wrapped__() == before


def test_chosen_points_are_the_plainest() -> None:
    """No point fits, so both traces have the register's values, which are the plainest point's."""
    for trace in TRACES:
        assert chosen(trace) == (*PLAINEST, trace)


def test_chosen_points_are_those_of_the_experiments() -> None:
    """The conditions that are judged have the values that the calibration calls chosen."""
    own = EXPERIMENTS["open-maze"].conditions()
    for trace in TRACES:
        ours, theirs = condition(chosen(trace)), own["unified", trace, "none"]
        assert trial_key(ours, 1, 2) == trial_key(theirs, 1, 2)


def test_condition_of_a_point() -> None:
    """It is the unified method on the open maze with the point's six values, all else default."""
    for point in points()[::37]:
        leg, ties, q_start, alpha, f_start, trace = point
        made = condition(point)
        changed = made.params.differences()
        assert changed.keys() <= {*WORLD[1:], *TRACE, "F-INDEX"}
        learner, update = made.params.learner, made.params.update
        assert (learner.ties, learner.q_start) == (ties, q_start)
        assert (update.alpha, update.f_start, update.f_index) == (alpha, f_start, trace)
        expected = {"task": "open-maze", "method": "unified", "reading": trace, "set": "none"}
        assert factors(made) == expected
        assert made.demos.correct == condition((leg, *chosen("printed")[1:])).demos.correct
    assert len({condition(point).demos.correct for point in points()}) == 5


# --- the first stage -------------------------------------------------------------------------


def test_divergence_of_a_world_is_the_sum_over_traces() -> None:
    """The least of each trace, added; a world that lacks a trace, or is out, comes last."""
    a, b, c, d = ALL_WORLDS[:4]
    divergences: dict[Point, float] = {}
    for world, printed, updated in (
        (a, (0.5, 0.1, 0.9), (0.3, 0.2)),  # 0.1 + 0.2
        (b, (0.05,), (0.4, 0.15)),  # 0.05 + 0.15
        (c, (0.01,), (np.inf, 0.6)),  # 0.01 + 0.6
        (d, (0.001,), (np.inf,)),
    ):
        for trace, values in (("printed", printed), ("updated", updated)):
            divergences |= dict(zip(world_points(world, trace), values, strict=False))
    found = worlds(table_of(divergences))
    assert list(found.index) == [b, a, c, d]
    assert found.tolist() == pytest.approx([0.2, 0.3, 0.61, np.inf])
    without = {point: value for point, value in divergences.items() if point[-1] == "printed"}
    alone = worlds(table_of(without | {world_points(c, "updated")[0]: 2.0}))
    assert alone.index[0] == c
    assert alone.isna().sum() == 3


def test_finalists_by_hand() -> None:
    """The 5 nearest worlds, and of each the 4 nearest points under each trace, in this order."""
    order = [7, 2, 11, 0, 16, 4, 9]  # of worlds, from the nearest
    divergences: dict[Point, float] = {}
    for rank, at in enumerate(order):
        for trace in TRACES:
            own = world_points(ALL_WORLDS[at], trace)
            for place, point in enumerate(own):
                # Within a world the nearest points are the 3rd, 4th, 5th, ...; the traces differ.
                step = (place - 2 - (trace == "updated")) % len(own)
                divergences[point] = 1.0 + rank**2 + 0.01 * step
    # A single point that is nearer than any other does not bring its world in.
    divergences[world_points(ALL_WORLDS[9], "printed")[5]] = 0.9
    expected = []
    for at in order[:5]:
        for trace, first in (("printed", 2), ("updated", 3)):
            expected += world_points(ALL_WORLDS[at], trace)[first : first + 4]
    shuffled = dict(sorted(divergences.items(), key=lambda item: str(item[0])[::-1]))
    table = table_of(shuffled)
    assert finalists(table) == expected
    assert len(expected) == WORLDS * POINTS * len(TRACES) == 40
    assert left_out(table.assign(fits=True)) == len(table) - 40
    best = [point in expected for point in table[COLUMNS].itertuples(index=False, name=None)]
    assert left_out(table.assign(fits=best)) == 0


# --- the second stage ------------------------------------------------------------------------


def test_nearest_by_hand() -> None:
    """The world by the sum of both traces, and in it each trace's own nearest point."""
    a, b = ALL_WORLDS[3], ALL_WORLDS[8]
    divergences = {
        **dict(zip(world_points(a, "printed"), (0.01, 0.02), strict=False)),  # nearest of all
        **dict(zip(world_points(a, "updated"), (0.9, 0.8), strict=False)),
        **dict(zip(world_points(b, "printed"), (0.3, 0.1), strict=False)),
        **dict(zip(world_points(b, "updated"), (0.5, 0.7, 0.2), strict=False)),
    }
    expected = {"printed": world_points(b, "printed")[1], "updated": world_points(b, "updated")[2]}
    fitting = {world_points(a, "updated")[0]}  # the farthest: one is enough, wherever it is
    assert nearest(table_of(divergences, fitting)) == expected
    assert nearest(table_of(divergences, {*divergences})) == expected


def test_nothing_fits() -> None:
    """If no finalist fits, the plainest point is taken, whatever is nearest."""
    divergences = dict.fromkeys(world_points(ALL_WORLDS[3], "printed"), 0.01)
    divergences |= dict.fromkeys(world_points(ALL_WORLDS[3], "updated"), 0.02)
    found = nearest(table_of(divergences))
    assert found == {trace: (4, "random", "kept", 0.5, 0.5, trace) for trace in TRACES}


def test_rule_follows_if_the_defaults_are_nearest(monkeypatch: pytest.MonkeyPatch) -> None:
    """The register follows from a table whose nearest points are its defaults, from no other."""
    mine = {chosen(trace): 0.1 for trace in TRACES}
    other = {world_points(ALL_WORLDS[0], trace)[0]: 0.3 for trace in TRACES}
    assert ALL_WORLDS[0] != chosen("printed")[:3]
    assert rule_follows(table_of(mine | other, {*mine}))
    assert not rule_follows(table_of(mine | dict.fromkeys(other, 0.05), {*mine}))
    nothing_fits = table_of(mine | other)
    assert rule_follows(nothing_fits)
    monkeypatch.setattr(calibration, "PLAINEST", other_world := (*ALL_WORLDS[0], 0.1, 0.1))
    assert nearest(nothing_fits) == {trace: (*other_world, trace) for trace in TRACES}
    assert not rule_follows(nothing_fits)


# --- tables ----------------------------------------------------------------------------------


def sample(mean: float, sd: float, n: int, seed: int = 1) -> Any:
    """Return numbers with just this mean and SD."""
    draw = np.random.default_rng(seed).normal(size=n)
    return mean + sd * (draw - draw.mean()) / draw.std(ddof=1)


def trials_of(part: str, number: int, counts: Any, *, converged: Any = 1) -> pd.DataFrame:
    """Make the trials of one point up."""
    columns = {"part": part, "number": number, "trial": np.arange(len(counts))}
    return pd.DataFrame({**columns, "iterations": counts, "converged": converged})


def test_table_of_a_stage() -> None:
    """Each point has its own trials' numbers; it fits if mean and SD both do; caps are out."""
    made = {
        0: sample(PAIR.mean + 0.3, PAIR.sd, 40),
        1: sample(PAIR.mean, 3 * PAIR.sd, 40),  # the mean alone fits
        2: sample(PAIR.mean + 5, PAIR.sd, 40),  # the SD alone
        3: sample(PAIR.mean, PAIR.sd, 40),  # a trial at the cap
        points().index(chosen("printed")): sample(PAIR.mean - 0.9, 1.1 * PAIR.sd, 40),
        5: np.full(40, 40.0),
    }
    trials = pd.concat(
        [trials_of("final", k, counts, converged=int(k != 3)) for k, counts in made.items()]
        + [trials_of("screen", 7, made[0]), trials_of("final", 9, made[0]).iloc[:0]]
    )
    table = calibration_table(trials.sample(frac=1.0, random_state=2), "final")
    assert len(table) == 6
    numbers = [points().index(tuple(row)) for row in table[COLUMNS].itertuples(index=False)]
    order = [0, points().index(chosen("printed")), 2, 1]
    assert numbers[0] == 0
    assert set(numbers[:4]) == set(order)
    assert set(numbers[4:]) == {3, 5}
    assert table["kl_divergence"].is_monotonic_increasing
    assert np.isinf(table["kl_divergence"].to_numpy()[4:]).all()
    assert dict(zip(numbers, table["fits"], strict=True)) == {
        k: k in (0, points().index(chosen("printed"))) for k in made
    }
    assert table["default"].sum() == 1
    for number, row in zip(numbers[:4], table.to_dict("records"), strict=False):
        counts = made[number]
        assert (row["n"], row["capped"]) == (40, 0)
        assert (row["mean"], row["sd"]) == pytest.approx((counts.mean(), counts.std(ddof=1)))
        assert row["low"] < row["mean"] < row["high"]
        assert row["sd_low"] < row["sd"] < row["sd_high"]
        assert row["kl_divergence"] == kl_divergence(row["mean"], row["sd"], PAIR)
        assert row["default"] == (number == points().index(chosen("printed")))
    only = calibration_table(trials, "screen")
    assert points().index(tuple(only[COLUMNS].iloc[0])) == 7


def test_the_judging_run_is_a_point_like_the_others() -> None:
    """Its trials of the unified method without incorrect demonstrations stand at the defaults."""
    made = {"printed": sample(36.0, 7.0, 40), "updated": sample(33.0, 5.0, 40)}
    parts = [
        trials_of("", 0, counts + more).assign(part=np.nan, method=method, reading=reading)
        for reading, counts in made.items()
        for more, method in enumerate(("unified", "unified-incorrect"))
    ]
    table = judged_table(pd.concat(parts, ignore_index=True)).set_index("F-INDEX")
    assert table["default"].all()
    assert set(table.index) == set(made)
    for reading, counts in made.items():
        mean, sd = table.loc[reading, ["mean", "sd"]]
        assert (mean, sd) == pytest.approx((counts.mean(), counts.std(ddof=1)))


@pytest.mark.parametrize("off", [-1e-6, 1e-6])
def test_border_of_what_fits(off: float) -> None:
    """A point fits up to the borders of the prediction of mean and of SD, each with 95 %."""
    _, mean_to = mean_prediction(PAIR.mean, PAIR.sd, PAIR.n, 50)
    _, sd_to = sd_prediction(PAIR.sd, PAIR.n, sample(0, 1, 50))
    for mean, sd in ((mean_to + off, PAIR.sd), (PAIR.mean, sd_to + off)):
        table = calibration_table(trials_of("final", 0, sample(mean, sd, 50)), "final")
        assert table["fits"].tolist() == [off < 0]


def test_the_borders_themselves_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """A mean and an SD that are predicted to the bit are within the prediction."""
    counts = sample(PAIR.mean, PAIR.sd, 50)
    mean, sd = counts.mean(), counts.std(ddof=1)
    monkeypatch.setattr(calibration, "mean_prediction", lambda *_: (mean, mean))
    monkeypatch.setattr(calibration, "sd_prediction", lambda *_: (sd, sd))
    assert calibration_table(trials_of("final", 0, counts), "final")["fits"].tolist() == [True]


# --- what is run -----------------------------------------------------------------------------


def test_calibration_is_apart_from_the_judging_run() -> None:
    """Its root seeds are known ones; it chose nothing, so the pair is judged."""
    judging = load_claims().judging
    known = {seed for run in load_claims().known for seed in run.root_seeds}
    assert (SCREEN_SEED, FINAL_SEED) == (21, 22)
    assert {SCREEN_SEED, FINAL_SEED} <= known
    assert judging.root_seed not in (SCREEN_SEED, FINAL_SEED)
    for id in ("MEAN-UNIFIED-OPEN", "SD-UNIFIED-OPEN"):
        claim = load_claims().by_id(id)
        assert not claim.used
        assert claim.paper["unified"][0] == PAIR.mean


def test_stages_are_as_the_register_says() -> None:
    """All points with 10 trials; then 40 finalists with 200."""
    (one, screen), (two, final) = stages()
    assert (one, two) == (SCREEN_SEED, FINAL_SEED)
    first = screen(pd.DataFrame())
    assert len(first) == len(points())
    assert {group.trials for group in first} == {SCREEN_TRIALS} == {10}
    assert [group.labels for group in first[:2]] == [
        {"part": "screen", "number": 0},
        {"part": "screen", "number": 1},
    ]
    rng = np.random.default_rng(5)
    trials = pd.concat(
        trials_of("screen", k, sample(rng.normal(40, 3), PAIR.sd, 10, seed=k))
        for k in range(len(points()))
    )
    second = final(trials)
    expected = [points().index(p) for p in finalists(calibration_table(trials, "screen"))]
    assert [group.labels["number"] for group in second] == expected
    assert {group.trials for group in second} == {FINAL_TRIALS} == {200}
    for group in (*first[::100], *second[::10]):
        (own,) = group.conditions
        again = condition(points()[int(group.labels["number"])])
        assert trial_key(again, 1, 2) == trial_key(own, 1, 2)
        assert own.method == "unified"


def test_trials_of_the_stages_can_be_fewer() -> None:
    """A quick look has fewer trials of each condition."""
    (_, screen), (_, final) = stages(screen_trials=2, final_trials=3)
    assert {group.trials for group in screen(pd.DataFrame())} == {2}
    table = pd.concat(
        trials_of("screen", k, sample(40, 1 + k % 7, 10)) for k in range(len(points()))
    )
    assert {group.trials for group in final(table)} == {3}
    assert {group.labels["part"] for group in final(table)} == {"final"}


# --- what is published -----------------------------------------------------------------------

FIGURES = PROJECT / "figures"


@pytest.fixture(scope="module")
def stored() -> dict[str, pd.DataFrame]:
    """Read the published tables."""
    folder = FIGURES / "calibration"
    if not (folder / "final.csv").exists():
        pytest.skip("the calibration in two stages is not published yet")
    names = ("trials", "screen", "final")
    return {name: read_table(folder / f"{name}.csv") for name in names}


def assert_alike(one: pd.DataFrame, other: pd.DataFrame) -> None:
    """Assert that two tables are equal, to the digits of a file."""
    pd.testing.assert_frame_equal(one, other, check_dtype=False, rtol=1e-8)


def test_published_defaults_follow_from_the_published_trials(
    stored: dict[str, pd.DataFrame],
) -> None:
    """From the trials to the register: points, finalists, and the defaults of both traces."""
    screen, final = (calibration_table(stored["trials"], part) for part in ("screen", "final"))
    assert_alike(stored["screen"], screen)
    assert_alike(stored["final"], final)
    assert set(screen["n"]) == {SCREEN_TRIALS}
    assert set(final["n"]) == {FINAL_TRIALS}
    assert len(screen) == len(points())
    found = {tuple(row) for row in final[COLUMNS].itertuples(index=False)}
    assert found == {*finalists(screen)}
    assert rule_follows(final)
    seeds = stored["trials"].groupby("part")["seed"].unique()
    used = {part: own.tolist() for part, own in seeds.items()}
    assert used == {"screen": [SCREEN_SEED], "final": [FINAL_SEED]}
