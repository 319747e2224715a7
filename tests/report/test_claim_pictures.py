from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text

from replication.evidence.calibration import CALIBRATED, grid
from replication.evidence.claims import LABELS, load_claims
from replication.evidence.sensitivity import NOISE, shares_table
from replication.evidence.specifications import (
    default_of,
    factorial_specifications,
    load_specifications,
    single_specifications,
)
from replication.evidence.tables import read_table, write_csv
from replication.report import calibration, sensitivity, specification_curve, verdicts
from replication.report.drawing import OUTCOMES, UNITS
from replication.report.picture import Picture
from replication.report.style import save_figure

MAZES = load_specifications().mazes
FACTORIAL = factorial_specifications(MAZES.factorial)
SINGLE = single_specifications(MAZES.single.choices)
SOCCER = single_specifications(load_specifications().soccer.single.choices)
DRAWN = ["FASTER", "STEADIER", "SAVES-OPEN", "AVOIDS-OPEN"]
KICKED = ["SAVES-SOCCER", "ZERO-SOCCER", "AVOIDS-SOCCER"]


def some_effects() -> pd.DataFrame:
    """Return effects of the declared specifications, drawn at random."""
    rng = np.random.default_rng(np.random.SeedSequence(1))
    parts = []
    cases = [(id, [*SINGLE, *FACTORIAL]) for id in DRAWN] + [(id, SOCCER) for id in KICKED]
    for id, specifications in cases:
        claim = load_claims().by_id(id)
        n = len(specifications)
        ratio = claim.statistic == "sd-ratio"
        effect = np.exp(rng.normal(size=n)) if ratio else rng.normal(size=n) * 20
        parts.append(
            pd.DataFrame(
                {
                    "claim": id,
                    "statistic": claim.statistic,
                    "measure": claim.measure,
                    "margin": claim.margin,
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
        for at, reading in enumerate(load_claims().judging.readings):
            verdict = words[(number + at) % len(words)]
            effect = np.nan if verdict == "not testable" else 1.5 + number / 10 + at
            keys = ("id", "measure", "statistic", "direction", "margin")
            row = {key: getattr(claim, key) for key in keys}
            row |= {"reading": reading, "paper": claim.paper_effect, "verdict": verdict}
            rows.append(row | {"effect": effect, "low": effect - 1.2, "high": effect + 1})
    return pd.DataFrame(rows)


def some_points() -> pd.DataFrame:
    """Return a calibration table of the declared grid."""
    rng = np.random.default_rng(np.random.SeedSequence(2))
    table = pd.DataFrame(grid(), columns=list(CALIBRATED))
    table["mean"] = rng.normal(40, 6, len(table)).round(6)
    table["sd"] = rng.uniform(3, 10, len(table)).round(6)
    order = np.arange(len(table))
    return table.assign(kl_divergence=order, default=order == 3, paper_mean=40.10, paper_sd=4.73)


EFFECTS = some_effects()
VERDICTS = some_verdicts()
POINTS = some_points()
SHARES = shares_table(EFFECTS)
PAIRS = [(0, 0), (10, 75), (30, 185), (100, 365), (300, 581), (1000, 1128), (1565, 1565)]
NUMBERS = pd.DataFrame(
    [
        {"reading": reading, "number": number, "pairs": pairs, "saved": saved}
        | {"saved_low": saved - 1, "saved_high": saved + 1, "paper": 3.62}
        for slope, reading in enumerate(("printed", "updated"))
        for number, pairs in PAIRS
        for saved in [slope * np.log1p(pairs)]
    ]
)


PICTURES = {
    "claims": verdicts.verdicts(VERDICTS),
    "curve": specification_curve.curve(EFFECTS, DRAWN[0]),
    "ratios": specification_curve.curve(EFFECTS, DRAWN[1]),
    "single": sensitivity.single(EFFECTS, DRAWN),
    "soccer": sensitivity.single(EFFECTS, KICKED),
    "shares": sensitivity.shares(SHARES),
    "calibration": calibration.grid(POINTS),
    "numbers": sensitivity.numbers(NUMBERS),
}


def drawn(picture: Picture) -> Figure:
    """Draw a picture from its numbers."""
    return picture.draw(picture.numbers)


@pytest.fixture(scope="module")
def drawings() -> dict[str, Figure]:
    """Draw each kind of figure once."""
    return {name: drawn(picture) for name, picture in PICTURES.items()}


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


@pytest.mark.parametrize("kind", PICTURES)
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


@pytest.mark.parametrize("kind", PICTURES)
def test_picture_is_drawn_from_its_file(
    kind: str, drawings: dict[str, Figure], tmp_path: Path
) -> None:
    """The table that is saved beside a figure gives the same picture as the numbers themselves."""
    picture = PICTURES[kind]
    stored = read_table(write_csv(picture.numbers, tmp_path / "numbers.csv"))
    figures = {"once": drawings[kind], "twice": picture.draw(stored)}
    once, twice = (save_figure(figures[name], tmp_path / name, ["png"])[0] for name in figures)
    assert once.read_bytes() == twice.read_bytes()


@pytest.mark.parametrize("at", [0, 1])
def test_curve_is_the_sorted_effects(at: int, drawings: dict[str, Figure]) -> None:
    """The points of a curve are the effects of the factorial in order; hollow ones have caps."""
    panel = drawings[("curve", "ratios")[at]].axes[0]
    dots = [line for line in panel.lines if line.get_marker() == "o"]
    points = np.vstack([np.asarray(line.get_xydata()) for line in dots])
    own = EFFECTS[(EFFECTS["claim"] == DRAWN[at]) & (EFFECTS["group"] == "factorial")]
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
    broken = EFFECTS[EFFECTS["group"] == "factorial"].copy()
    row = broken["specification"] == FACTORIAL[0].name
    broken.loc[row, ["effect", "low", "high", "outcome"]] = [np.nan, np.nan, np.nan, "undefined"]
    figure = drawn(specification_curve.curve(broken, DRAWN[1]))
    (text,) = figure.axes[0].texts
    assert "of 239 specifications" in text.get_text()
    assert "239 specifications" in figure.axes[2].get_xlabel()
    assert "1 more have none" in figure.axes[2].get_xlabel()


def test_curve_without_any_effect_is_drawn_without_counts() -> None:
    """Where no specification has an effect, as with two trials, the curve says so and is empty."""
    nothing = {"effect": np.nan, "low": np.nan, "high": np.nan, "outcome": "undefined"}
    picture = specification_curve.curve(EFFECTS.assign(**nothing), "STEADIER")
    assert "STEADIER has no effect in any of 240 specifications" in picture.words
    figure = drawn(picture)
    assert not figure.axes[0].texts
    assert "0 specifications" in figure.axes[2].get_xlabel()
    labels = [text.get_text() for text in drawn(PICTURES["ratios"]).axes[2].texts]
    assert [text.get_text() for text in figure.axes[2].texts] == labels


def test_defaults_are_bold(drawings: dict[str, Figure]) -> None:
    """Below a curve the default value of each choice is the bold one."""
    texts = drawings["curve"].axes[2].texts
    bold = [text.get_text() for text in texts if text.get_fontweight() == "bold"]
    assert bold == [str(default_of(id)) for id in MAZES.factorial.choices]


def test_single_rows_are_the_effects(drawings: dict[str, Figure]) -> None:
    """Each panel has the effects of its claim from top to bottom, the default first."""
    for panel, claim in zip(drawings["single"].axes, DRAWN, strict=True):
        points = [np.asarray(one.get_xydata()) for one in panel.lines if one.get_marker() != "None"]
        x, y = np.vstack(points).T
        own = EFFECTS[(EFFECTS["claim"] == claim) & (EFFECTS["group"] == "single")]
        np.testing.assert_array_equal(x[y.argsort()], own["effect"])


def test_verdicts_stand_in_words(drawings: dict[str, Figure]) -> None:
    """The verdict of each reading stands beside it, whatever its colour is."""
    shown = [text.get_text() for panel in drawings["claims"].axes for text in panel.texts]
    own = VERDICTS[VERDICTS["statistic"].isin([statistic for statistic, _ in UNITS])]
    assert sorted(shown) == sorted(own["verdict"])


def test_every_comparative_claim_has_a_unit() -> None:
    """A claim with another measure or statistic needs a unit for its axis."""
    comparative = [claim for claim in load_claims().claim if claim.direction != "inside"]
    assert {(claim.statistic, claim.measure) for claim in comparative} == set(UNITS)


def test_cells_are_per_cents(drawings: dict[str, Figure]) -> None:
    """The heat map writes each share of the variance as a per cent."""
    shown = [text.get_text() for panel in drawings["shares"].axes[:2] for text in panel.texts]
    shares = SHARES.loc[~SHARES["choice"].isin(OUTCOMES), "share"]
    minus = "\N{MINUS SIGN}"
    expected = [f"{round(100 * share)}".replace("-", minus) for share in shares]
    assert sorted(text.replace("≥", "") for text in shown) == sorted(expected)


def test_noise_of_all_the_variance_is_at_least_that() -> None:
    """Noise is cut off at the whole variance, and the cell says so."""
    noisy = SHARES.copy()
    noisy.loc[noisy["choice"] == NOISE, "share"] = 1.0
    figure = drawn(sensitivity.shares(noisy))
    shown = [text.get_text() for panel in figure.axes[:2] for text in panel.texts]
    assert shown.count("≥100") == len(DRAWN)


def test_missing_effects_are_told() -> None:
    """A row without an effect says that it has none."""
    broken = EFFECTS.copy()
    row = (broken["claim"] == "STEADIER") & (broken["specification"] == "TIES=first")
    broken.loc[row, ["effect", "low", "high", "outcome"]] = [np.nan, np.nan, np.nan, "undefined"]
    panels = drawn(sensitivity.single(broken, DRAWN)).axes
    shown = [[text.get_text() for text in panel.texts].count("undefined") for panel in panels]
    assert shown == [0, 1, 0, 0]


def test_words_name_the_counts() -> None:
    """Each description has the numbers of its table."""
    rows = EFFECTS[(EFFECTS["claim"] == "FASTER")]
    factorial = rows.loc[rows["group"] == "factorial", "outcome"].value_counts()
    words = PICTURES["curve"].words
    assert f"FASTER holds in {factorial['holds']} of 240 specifications" in words
    assert f"open in {factorial['open']}, reversed in {factorial['reversed']}" in words
    uncapped = rows[(rows["group"] == "factorial") & (rows["capped"] == 0)]
    held = (uncapped["outcome"] == "holds").sum()
    assert f"without trials at the cap: holds in {held} of {len(uncapped)}" in words
    changed = rows[(rows["group"] == "single") & (rows["specification"] != "default")]
    holds = (changed["outcome"] == "holds").sum()
    words = PICTURES["single"].words
    assert f"holds in {holds} of 43 specifications" in words
    assert "0 of them have the numbers of the default" in words
    held = SHARES[SHARES["choice"] == "holds"].set_index("claim")["share"]
    assert f"FASTER in {held['FASTER']:.0%}" in PICTURES["shares"].words
    assert "3 of the points are nearer" in PICTURES["calibration"].words
    words = PICTURES["numbers"].words
    assert (
        "With the most marked pairs, 1565, incorrect demonstrations save 0.0 [-1.0, 1.0]" in words
    )
    assert "7.4 [6.4, 8.4] iterations under Fᵢ₊₁ (updated)" in words


def test_words_count_every_comparative_claim() -> None:
    """The verdicts in words name each comparative claim once, and no published number."""
    words = PICTURES["claims"].words
    assert words.startswith(f"Of {len(LABELS)} comparative claims, ")
    assert all(words.count(id) == 1 for id in LABELS)
    assert "MEAN-UNIFIED-OPEN" not in words
