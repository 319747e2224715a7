from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from replication.evidence.calibration import CALIBRATED, PAIR, grid
from replication.evidence.claims import LABELS, load_claims
from replication.evidence.sensitivity import outcome_shares
from replication.evidence.specifications import (
    factorial_specifications,
    load_specifications,
    single_specifications,
)
from replication.report.claim_figures import (
    OUTCOMES,
    UNITS,
    calibration_figure,
    claims_figure,
    curve_figure,
    describe_calibration,
    describe_claims,
    describe_curve,
    describe_numbers,
    describe_shares,
    describe_single,
    numbers_figure,
    shares_figure,
    single_figure,
)
from replication.report.style import save_figure

MAZES = load_specifications().mazes
FACTORIAL = factorial_specifications(MAZES.factorial)
SINGLE = single_specifications(MAZES.single.choices)
SOCCER = single_specifications(load_specifications().soccer.single.choices)
DRAWN = [load_claims().by_id(id) for id in ("FASTER", "STEADIER", "SAVES-OPEN", "AVOIDS-OPEN")]
KICKED = [load_claims().by_id(id) for id in ("SAVES-SOCCER", "ZERO-SOCCER", "AVOIDS-SOCCER")]


def some_effects() -> pd.DataFrame:
    """Return effects of the declared specifications, drawn at random."""
    rng = np.random.default_rng(np.random.SeedSequence(1))
    parts = []
    cases = [(one, [*SINGLE, *FACTORIAL]) for one in DRAWN] + [(one, SOCCER) for one in KICKED]
    for claim, specifications in cases:
        n = len(specifications)
        ratio = claim.statistic == "sd-ratio"
        effect = np.exp(rng.normal(size=n)) if ratio else rng.normal(size=n) * 20
        parts.append(
            pd.DataFrame(
                {
                    "claim": claim.id,
                    "statistic": claim.statistic,
                    "group": [one.group for one in specifications],
                    "specification": [one.name for one in specifications],
                    "n": 10,
                    "capped": rng.integers(0, 2, n),
                    "capped_x": 0,
                    "effect": effect,
                    "low": effect * 0.7 if ratio else effect - 8,
                    "high": effect * 1.4 if ratio else effect + 8,
                    "outcome": rng.choice(list(OUTCOMES), n),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def some_verdicts() -> pd.DataFrame:
    """Return a table of verdicts: one of each kind, and NaN where all trials are at the cap."""
    words = ["reproduced", "not reproduced", "reversed", "undecided", "not testable"]
    rows = []
    for number, claim in enumerate(load_claims().claim):
        for at, f in enumerate(load_claims().judging.readings):
            verdict = words[(number + at) % len(words)]
            effect = np.nan if verdict == "not testable" else 1.5 + number / 10 + at
            keys = ("id", "measure", "statistic", "direction", "margin")
            row = {key: getattr(claim, key) for key in keys}
            row |= {"F": f, "paper": claim.paper_effect, "verdict": verdict}
            rows.append(row | {"effect": effect, "low": effect - 1.2, "high": effect + 1})
    return pd.DataFrame(rows)


def some_points() -> pd.DataFrame:
    """Return a calibration table of the declared grid."""
    rng = np.random.default_rng(np.random.SeedSequence(2))
    table = pd.DataFrame(grid(), columns=list(CALIBRATED))
    table["mean"], table["sd"] = rng.normal(40, 6, len(table)), rng.uniform(3, 10, len(table))
    return table.assign(divergence=np.arange(len(table)), default=np.arange(len(table)) == 3)


EFFECTS = some_effects()
VERDICTS = some_verdicts()
POINTS = some_points()
SHARES = pd.DataFrame(
    [
        {"claim": claim.id, "choice": choice, "share": 0.7 if at == number else 0.03}
        for number, claim in enumerate(DRAWN)
        for at, choice in enumerate([*MAZES.factorial.choices, "noise", "rest"])
    ]
)
PAIRS = [(0, 0), (10, 75), (30, 185), (100, 365), (300, 581), (1000, 1128), (1565, 1565)]
NUMBERS = pd.DataFrame(
    [
        {"F": f, "number": number, "pairs": pairs, "saved": saved}
        | {"saved_low": saved - 1, "saved_high": saved + 1}
        for slope, f in enumerate(("printed", "updated"))
        for number, pairs in PAIRS
        for saved in [slope * np.log1p(pairs)]
    ]
)


@pytest.fixture(scope="module")
def drawings() -> dict[str, Figure]:
    """Draw each kind of figure once."""
    return {
        "claims": claims_figure(VERDICTS),
        "curve": curve_figure(EFFECTS, FACTORIAL, DRAWN[0]),
        "ratios": curve_figure(EFFECTS, FACTORIAL, DRAWN[1]),
        "single": single_figure(EFFECTS, DRAWN),
        "soccer": single_figure(EFFECTS, KICKED),
        "shares": shares_figure(SHARES, outcome_shares(EFFECTS)),
        "calibration": calibration_figure(POINTS, PAIR),
        "numbers": numbers_figure(NUMBERS, 3.62),
    }


KINDS = ["claims", "curve", "ratios", "single", "soccer", "shares", "calibration", "numbers"]


def shown_texts(figure: Figure) -> list[Text]:
    """Return all texts that are drawn: not the labels of ticks beyond the ends of an axis."""
    texts = [*figure.texts, *(text for legend in figure.legends for text in legend.get_texts())]
    for panel in figure.axes:
        texts += panel.texts
        texts += [panel.title, panel._left_title]  # type: ignore[attr-defined]
        for axis in (panel.xaxis, panel.yaxis) if panel.axison else ():
            low, high = sorted(axis.get_view_interval())
            texts.append(axis.label)
            for tick in axis.get_major_ticks():
                if low <= tick.get_loc() <= high:
                    texts += [tick.label1, tick.label2]
    return [text for text in texts if text.get_visible() and text.get_text()]


@pytest.mark.parametrize("kind", KINDS)
def test_texts_are_legible(kind: str, drawings: dict[str, Figure]) -> None:
    """No text is smaller than 6.5 points, lies outside the figure or overlaps another."""
    figure = drawings[kind]
    boxes = {text: text.get_window_extent() for text in shown_texts(figure)}
    width, height = figure.bbox.size
    for text, box in boxes.items():
        assert float(text.get_fontsize()) >= 6.5, text
        assert min(box.x0, box.y0) > -0.5, text
        assert box.x1 < width + 0.5, text
        assert box.y1 < height + 0.5, text
    for one, other in combinations(boxes, 2):
        assert not boxes[one].padded(-0.5).overlaps(boxes[other].padded(-0.5)), (one, other)


@pytest.mark.parametrize("kind", KINDS)
def test_equal_numbers_give_equal_bytes(
    kind: str, drawings: dict[str, Figure], tmp_path: Path
) -> None:
    """Saving twice gives the same file."""
    once, twice = (save_figure(drawings[kind], tmp_path / name, ["png"])[0] for name in "ab")
    assert once.read_bytes() == twice.read_bytes()


@pytest.mark.parametrize("at", [0, 1])
def test_curve_is_the_sorted_effects(at: int, drawings: dict[str, Figure]) -> None:
    """The points of a curve are the effects of the factorial in order; hollow ones have caps."""
    panel = drawings[("curve", "ratios")[at]].axes[0]
    dots = [line for line in panel.lines if line.get_marker() == "o"]
    points = np.vstack([np.asarray(line.get_xydata()) for line in dots])
    own = EFFECTS[(EFFECTS["claim"] == DRAWN[at].id) & (EFFECTS["group"] == "factorial")]
    np.testing.assert_array_equal(points[points[:, 0].argsort(), 1], np.sort(own["effect"]))
    hollow = [line for line in dots if line.get_markerfacecolor() == "white"]
    assert sum(len(np.asarray(line.get_xdata())) for line in hollow) == (own["capped"] > 0).sum()
    assert panel.get_yscale() == ("linear", "log")[at]


def test_choices_stand_below_their_effects(drawings: dict[str, Figure]) -> None:
    """Each column of the matrix has one tick for each choice, in the colour of its outcome."""
    matrix = drawings["curve"].axes[2]
    paths = [path for one in matrix.collections for path in one.get_paths()]
    ticks = [float(np.asarray(path.vertices)[0, 0]) for path in paths]
    columns, counts = np.unique(ticks, return_counts=True)
    np.testing.assert_array_equal(columns, np.arange(len(FACTORIAL)))
    assert set(counts) == {len(MAZES.factorial.choices)}
    assert drawings["curve"].axes[0].get_xlim() == matrix.get_xlim()


def test_curve_without_some_effects() -> None:
    """A specification whose ratio of SDs is undefined is counted, and the others are drawn."""
    broken = EFFECTS.copy()
    broken.loc[broken["specification"] == FACTORIAL[0].name, ["effect", "low", "high"]] = np.nan
    figure = curve_figure(broken[broken["group"] == "factorial"], FACTORIAL, DRAWN[1])
    (said,) = figure.axes[0].texts
    assert "of 240 specifications" in said.get_text()


def test_single_rows_are_the_effects(drawings: dict[str, Figure]) -> None:
    """Each panel has the effects of its claim from top to bottom, the default first."""
    for panel, claim in zip(drawings["single"].axes, DRAWN, strict=True):
        points = [np.asarray(one.get_xydata()) for one in panel.lines if one.get_marker() != "None"]
        x, y = np.vstack(points).T
        own = EFFECTS[(EFFECTS["claim"] == claim.id) & (EFFECTS["group"] == "single")]
        np.testing.assert_array_equal(x[y.argsort()], own["effect"])


def test_verdicts_stand_in_words(drawings: dict[str, Figure]) -> None:
    """The verdict of each reading stands beside it, whatever its colour is."""
    shown = [text.get_text() for panel in drawings["claims"].axes for text in panel.texts]
    own = VERDICTS[VERDICTS["statistic"].isin([statistic for statistic, _ in UNITS])]
    assert sorted(shown) == sorted(own["verdict"])


def test_every_comparative_claim_has_a_label_and_a_unit() -> None:
    """A claim that is added to the file has to be named here too."""
    comparative = [one for one in load_claims().claim if not one.statistic.startswith("published")]
    assert {one.id for one in comparative} == set(LABELS)
    assert {(one.statistic, one.measure) for one in comparative} == set(UNITS)


def test_cells_are_per_cents(drawings: dict[str, Figure]) -> None:
    """The heat map writes each share of the variance as a per cent."""
    shown = [text.get_text() for panel in drawings["shares"].axes[:2] for text in panel.texts]
    assert sorted(shown) == sorted(f"{100 * share:.0f}" for share in SHARES["share"])


def test_noise_of_all_the_variance_is_at_least_that() -> None:
    """Noise is cut off at the whole variance, and the cell says so."""
    noisy = SHARES.copy()
    noisy.loc[noisy["choice"] == "noise", "share"] = 1.0
    figure = shares_figure(noisy, outcome_shares(EFFECTS))
    shown = [text.get_text() for panel in figure.axes[:2] for text in panel.texts]
    assert shown.count("≥100") == len(DRAWN)


def test_missing_effects_are_told() -> None:
    """A row without an effect says that it has none."""
    broken = EFFECTS.copy()
    row = (broken["claim"] == "STEADIER") & (broken["specification"] == "TIES=first")
    broken.loc[row, ["effect", "low", "high", "outcome"]] = [np.nan, np.nan, np.nan, "undefined"]
    panels = single_figure(broken, DRAWN).axes
    shown = [[text.get_text() for text in panel.texts].count("undefined") for panel in panels]
    assert shown == [0, 1, 0, 0]


def test_words_name_the_counts() -> None:
    """Each description has the numbers of its frame."""
    own = EFFECTS[(EFFECTS["claim"] == "FASTER")]
    factorial = own.loc[own["group"] == "factorial", "outcome"].value_counts()
    said = describe_curve(EFFECTS, FACTORIAL, DRAWN[0])
    assert f"FASTER holds in {factorial['holds']} of 240 specifications" in said
    assert f"open in {factorial['open']}, reversed in {factorial['reversed']}" in said
    changed = own[(own["group"] == "single") & (own["specification"] != "default")]
    holds = (changed["outcome"] == "holds").sum()
    said = describe_single(EFFECTS, DRAWN)
    assert f"holds in {holds} of 43 specifications" in said
    assert "0 of them have the numbers of the default" in said
    uncapped = own[(own["group"] == "factorial") & (own["capped"] == 0)]
    held = (uncapped["outcome"] == "holds").sum()
    said = describe_curve(EFFECTS, FACTORIAL, DRAWN[0])
    assert f"without trials at the cap: holds in {held} of {len(uncapped)}" in said
    assert "MAP for FASTER (70%), DEMO-SHAPE for STEADIER (70%)" in describe_shares(
        SHARES, outcome_shares(EFFECTS)
    )
    assert "3 of the points are nearer" in describe_calibration(POINTS, PAIR)
    said = describe_numbers(NUMBERS)
    assert "With the most marked pairs, 1565, incorrect demonstrations save 0.0 [-1.0, 1.0]" in said
    assert "7.4 [6.4, 8.4] iterations under Fᵢ₊₁ (updated)" in said


def test_words_count_every_comparative_claim() -> None:
    """The verdicts in words name each comparative claim once, and no published number."""
    said = describe_claims(VERDICTS)
    assert said.startswith(f"Of {len(LABELS)} comparative claims, ")
    assert all(said.count(id) == 1 for id in LABELS)
    assert "MEAN-UNIFIED-OPEN" not in said
