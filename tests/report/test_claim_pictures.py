from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from replication.evidence.calibration import TRACE, WORLD, points
from replication.evidence.claims import LABELS, load_claims
from replication.evidence.sensitivity import JOINT, NOISE, neutral, shares_table
from replication.evidence.specifications import (
    default_of,
    factorial_specifications,
    load_specifications,
    single_specifications,
)
from replication.evidence.tables import read_table, write_csv
from replication.evidence.verdicts import (
    ABSENT,
    INCONCLUSIVE,
    NOT_TESTABLE,
    REVERSED,
    SHOWN,
    by_claim,
)
from replication.irl import READINGS
from replication.report import (
    calibration,
    sensitivity,
    specification_curve,
    sweep,
    variance,
    verdicts,
)
from replication.report.choices import acts, title, value
from replication.report.drawing import OUTCOMES, UNITS, statement
from replication.report.picture import Picture
from replication.report.readable import F_LABELS, sentence
from replication.report.style import save_figure
from tests.report.legible import assert_legible

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
        joint: dict[str, Any] = dict.fromkeys(JOINT, np.nan)
        if claim.statistic == "saved":
            joint |= {"p_family": rng.uniform(size=n), "p_median": 0.0004, "p_holds": 0.0321}
            joint |= {"null_low": np.sort(effect) - 5, "null_high": np.sort(effect) + 5}
        columns = {
            "claim": id,
            "statistic": claim.statistic,
            "measure": claim.measure,
            "neutral": neutral(claim),
            "group": [one.group for one in specifications],
            "specification": [one.name for one in specifications],
            "n": 10,
            "capped": rng.integers(0, 2, n),
            "capped_x": 0,
            "effect": effect,
            "low": effect * 0.7 if ratio else effect - 8,
            "high": effect * 1.4 if ratio else effect + 8,
            "outcome": rng.choice(list(OUTCOMES), n),
            **joint,
        }
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def some_verdicts() -> pd.DataFrame:
    """Return a table of verdicts: one of each kind, and NaN where all trials are at the cap.

    In some rows all cells agree, in others none.
    """
    words = [SHOWN, ABSENT, REVERSED, INCONCLUSIVE, NOT_TESTABLE]
    rows = []
    for number, claim in enumerate(load_claims().claim):
        for at, (reading, set) in enumerate(claim.cells()):
            verdict = words[(number + at * (number % 2)) % len(words)]
            effect = np.nan if verdict == NOT_TESTABLE else 1.5 + number / 10 + at
            effect = min(effect, 1.0) if claim.statistic == "share" else effect
            margin = claim.margin or (0.8 if claim.statistic == "sd-ratio" else 2.0)
            margin = np.nan if claim.statistic == "mean" or np.isnan(effect) else margin
            row: dict[str, Any] = {
                "id": claim.id,
                "claim": claim.claim,
                "task": claim.task,
                "measure": claim.measure,
                "statistic": claim.statistic,
                "n": 1000,
            }
            row |= {"reading": reading, "set": set}
            row |= {"paper": claim.paper_effect, "why": "some"}
            row |= {"effect": effect, "low": effect - 0.4, "high": effect + 1}
            rows.append(row | {"margin": margin, "verdict": verdict})
    return pd.DataFrame(rows)


def some_points() -> pd.DataFrame:
    """Return a table of finalists, five of which fit."""
    rng = np.random.default_rng(np.random.SeedSequence(2))
    table = pd.DataFrame(points()[:40], columns=[*WORLD, *TRACE, "F-INDEX"])
    table["mean"] = rng.normal(40, 3, len(table)).round(6)
    table["sd"] = rng.uniform(3, 8, len(table)).round(6)
    order = np.arange(len(table))
    return table.assign(
        low=table["mean"] - 0.7,
        high=table["mean"] + 0.7,
        sd_low=table["sd"] * 0.9,
        sd_high=table["sd"] * 1.1,
        n=200,
        kl_divergence=order / 10,
        fits=order < 5,
        default=order < 2,
        paper_mean=40.10,
        paper_sd=4.73,
    )


EFFECTS = some_effects()
VERDICTS = some_verdicts()
POINTS = some_points()
JUDGED = POINTS.iloc[[-2, -1]].assign(mean=[36.0, 33.0], low=35.0, high=37.0, n=1000)
JUDGED["F-INDEX"] = ["printed", "updated"]
SHARES = shares_table(EFFECTS)
PAIRS = [(0, 0), (10, 75), (30, 185), (100, 365), (300, 581), (1000, 1128), (1565, 1565)]
NUMBERS = pd.DataFrame(
    [
        {"reading": reading, "number": number, "pairs": pairs, "saved": saved}
        | {"saved_low": saved - 1, "saved_high": saved + 1, "paper": 3.62}
        for slope, reading in enumerate(READINGS)
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
    "shares": variance.shares(SHARES),
    "points": calibration.points(POINTS, JUDGED),
    "numbers": sweep.numbers(NUMBERS),
}


def drawn(picture: Picture) -> Figure:
    """Draw a picture from its numbers."""
    return picture.draw(picture.numbers)


@pytest.fixture(scope="module")
def drawings() -> dict[str, Figure]:
    """Draw each kind of figure once."""
    return {name: drawn(picture) for name, picture in PICTURES.items()}


@pytest.mark.parametrize("kind", PICTURES)
def test_texts_are_legible(kind: str, drawings: dict[str, Figure]) -> None:
    """No text is too small, lies outside the figure or overlaps another."""
    assert_legible(drawings[kind])


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
    """Each column of the matrix has one tick for each choice that is shown."""
    matrix = drawings["curve"].axes[2]
    choices = sum("of the variance" in text.get_text() for text in matrix.texts)
    paths = [path for one in matrix.collections for path in one.get_paths()]
    ticks = [float(np.asarray(path.vertices)[0, 0]) for path in paths]
    columns, counts = np.unique(ticks, return_counts=True)
    np.testing.assert_array_equal(columns, np.arange(len(FACTORIAL)))
    assert set(counts) == {choices}
    assert drawings["curve"].axes[0].get_xlim() == matrix.get_xlim()


def test_the_band_without_any_effect_is_that_of_the_ranks(drawings: dict[str, Figure]) -> None:
    """Where a claim was tested jointly the band and both p-values are shown, else neither is."""
    for kind, shown in (("curve", True), ("ratios", False)):
        figure = drawings[kind]
        (text,) = figure.axes[0].texts
        assert ("median p < 0.001, number that hold p = 0.032" in text.get_text()) == shown
        labels = [text.get_text() for text in figure.legends[0].get_texts()]
        assert ("95 % without any effect" in labels) == shown
    own = EFFECTS[(EFFECTS["claim"] == DRAWN[0]) & (EFFECTS["group"] == "factorial")]
    band = drawings["curve"].axes[0].collections[0].get_paths()[0]
    heights = np.asarray(band.vertices)[:, 1]
    assert (heights.min(), heights.max()) == (own["null_low"].min(), own["null_high"].max())
    alone = int((own["p_family"] < 0.05).sum())
    assert f"{alone} beyond chance by themselves" in drawings["curve"].axes[0].texts[0].get_text()


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


def moved(claim: str, **by: float) -> pd.DataFrame:
    """Return the effects of a claim over the factorial that single values of choices move."""
    rows = EFFECTS[(EFFECTS["claim"] == claim) & (EFFECTS["group"] == "factorial")]
    rng = np.random.default_rng(np.random.SeedSequence(3))
    effect = rng.normal(scale=0.1, size=len(rows))
    for choice, size in by.items():
        effect += size * rows["specification"].str.contains(f"{choice.replace('_', '-')}=")
        effect += size * rows["specification"].str.contains(choice.replace("__", "="), regex=False)
    return rows.assign(effect=effect, low=effect - 0.1, high=effect + 0.1)


def test_choices_that_matter_stand_first() -> None:
    """A curve shows the choices by their share of the variance, and names the others below."""
    table = moved("SAVES-OPEN", TIES__first=1.0, MAP__open=6.0, **{"ADABOOST-RULE__vote": 9.0})
    figure = drawn(specification_curve.curve(table, "SAVES-OPEN"))
    texts = [text.get_text() for text in figure.axes[2].texts]
    named = [text for text in texts if text in {title(id) for id in MAZES.factorial.choices}]
    assert named == ["map", "how ties are broken"]
    shares = [int(text.split()[0]) for text in texts if "of the variance" in text]
    assert shares == sorted(shares, reverse=True)
    assert len(shares) == 2
    note = figure.legends[0].get_title().get_text()
    assert "first weights" in note
    assert "AdaBoost" not in note  # it cannot act on the claim, whatever chance says


def test_at_most_five_choices_are_shown() -> None:
    """The others have to be looked up in the table."""
    ids = list(MAZES.factorial.choices)[:-1]
    table = moved("SAVES-OPEN", **{f"{id}__{default_of(id)}": 2.0 for id in ids})
    figure = drawn(specification_curve.curve(table, "SAVES-OPEN"))
    texts = [text.get_text() for text in figure.axes[2].texts]
    assert sum("of the variance" in text for text in texts) == 5
    assert_legible(figure)


def test_defaults_are_bold(drawings: dict[str, Figure]) -> None:
    """Below a curve the default value of each choice is the bold one."""
    texts = drawings["curve"].axes[2].texts
    bold = {text.get_text() for text in texts if text.get_fontweight() == "bold"}
    defaults = {value(id, str(default_of(id))) for id in MAZES.factorial.choices}
    assert bold
    assert bold <= defaults


def test_percentages_stand_beside_their_bars(drawings: dict[str, Figure]) -> None:
    """Each value has the share of its specifications in which the claim holds, off the bars."""
    panel = drawings["curve"].axes[3]
    shares = [bar.get_width() for group in panel.containers for bar in group]
    assert [text.get_text() for text in panel.texts] == [f"{100 * share:.0f} %" for share in shares]
    right = panel.get_window_extent().x1
    assert all(text.get_window_extent().x0 > right for text in panel.texts)


def test_single_rows_are_the_effects(drawings: dict[str, Figure]) -> None:
    """Each panel has the effects of its claim from top to bottom, if the choice can act on it."""
    for panel, claim in zip(drawings["single"].axes, DRAWN, strict=True):
        points = [np.asarray(one.get_xydata()) for one in panel.lines if one.get_marker() != "None"]
        x, y = np.vstack(points).T
        own = EFFECTS[(EFFECTS["claim"] == claim) & (EFFECTS["group"] == "single")]
        acting = [acts(name.partition("=")[0], claim) for name in own["specification"]]
        assert 0 < sum(acting) < len(own)
        np.testing.assert_array_equal(x[y.argsort()], own.loc[acting, "effect"])


def test_rows_that_change_nothing_are_named_below() -> None:
    """A row with the default's numbers in all panels is left out; in some, it says so there."""
    table = EFFECTS.copy()
    numbers = ["effect", "low", "high"]
    own = table["group"] == "single"
    for claims, name in ((DRAWN, "TIES=first"), (DRAWN[:1], "W-NORM=unit")):
        for claim in claims:
            rows = own & (table["claim"] == claim)
            default = table.loc[rows & (table["specification"] == "default"), numbers]
            same = rows & (table["specification"] == name)
            table.loc[same, numbers] = default.to_numpy()
    figure = drawn(sensitivity.single(table, DRAWN))
    labels = [text.get_text() for text in figure.axes[0].texts]
    assert title("TIES") not in labels
    assert title("W-NORM") in labels
    note = figure.legends[0].get_title().get_text()
    assert "how ties are broken (first)" in note.replace("\n", " ")
    marks = [[line.get_marker() for line in panel.lines].count("$=$") for panel in figure.axes]
    assert marks == [1, 0, 0, 0]


# --- verdicts --------------------------------------------------------------------------------


def compared(table: pd.DataFrame) -> list[tuple[Axes, pd.DataFrame]]:
    """Return each panel of the verdicts, and what it has to show in rows from the top.

    `by` is what the numbers of a row are multiplied by: shares are drawn as per cents, and so are
    effects whose margin is a share.
    """
    units = list(UNITS)
    keys = zip(table["statistic"], table["measure"], strict=True)
    order = [units.index(key) if key in units else -1 for key in keys]
    table = table.assign(order=order)[[place >= 0 for place in order]]
    table = table.sort_values("order", kind="stable")
    fraction = table["id"].map({claim.id: claim.fraction for claim in load_claims().claim})
    by = (100 * fraction.astype(float) / table["margin"]).where(fraction.notna(), 1.0)
    share, mean = table["statistic"] == "share", table["statistic"] == "mean"
    panel = table["statistic"].where(fraction.isna(), "spared")
    table = table.assign(by=by.where(~share, 100.0), panel=panel)
    assert (share | mean | fraction.notna() | table["statistic"].isin(["saved", "sd-ratio"])).all()
    parts = [part for _, part in table.groupby("panel", sort=False)]
    return list(zip(drawn(verdicts.verdicts(table)).axes, parts, strict=True))


def marks_of(panel: Axes) -> list[tuple[float, float, str]]:
    """Return the marks of a panel from the top: height, value and kind."""
    marks = [line for line in panel.lines if line.get_marker() not in ("None", "", None)]
    places = [np.asarray(mark.get_xydata())[0] for mark in marks]
    rows = [(y, x, str(m.get_marker())) for m, (x, y) in zip(marks, places, strict=True)]
    return sorted(rows)


def segments_of(panel: Axes) -> list[np.ndarray]:
    """Return the segments of a panel that have numbers, each [end, x and y]."""
    lines = [one for one in panel.collections if isinstance(one, LineCollection)]
    segments = [np.asarray(segment) for one in lines for segment in one.get_segments()]
    return [one for one in segments if len(one) and not np.isnan(one).any()]


def test_every_cell_is_drawn_at_its_effect() -> None:
    """From the top, each cell has its mark at its effect, on its interval, in its own line.

    Effects whose margin is a share are drawn as shares, in per cent.
    """
    kinds = {"printed": "o", "updated": "s", "at-once": "D", "": "o"}
    for panel, part in compared(VERDICTS):
        marks = marks_of(panel)
        assert len(marks) == len(part)
        assert len({y for y, _, _ in marks}) == len(part)
        np.testing.assert_allclose([x for _, x, _ in marks], part["effect"] * part["by"])
        assert [kind for _, _, kind in marks] == [kinds[name] for name in part["reading"]]
        level = sorted((s[0, 1], *s[:, 0]) for s in segments_of(panel) if s[0, 1] == s[1, 1])
        ends = part[["low", "high"]].mul(part["by"], axis=0).to_numpy()
        due = np.column_stack([[y for y, _, _ in marks], ends])
        np.testing.assert_allclose(level, due[~np.isnan(ends).any(axis=1)])


def beside(panel: Axes, side: int) -> list[Any]:
    """Return the texts at the left or right of a panel, from the top and from the left."""
    texts: list[Any] = [text for text in panel.texts if text.xy[0] == side]  # type: ignore[attr-defined]
    return sorted(texts, key=lambda text: (text.xy[1], text.xyann[0]))


def test_the_verdict_stands_beside_its_cell() -> None:
    """A row has the effect of each cell in the look of its verdict, and the verdict in words."""
    looks: dict[str, set[tuple[Any, ...]]] = {}
    for panel, part in compared(VERDICTS):
        texts = [text for text in beside(panel, 1) if text.xy[1] >= 0]
        for _, cells in part.groupby(["id", "set"], sort=False):
            *numbers, word = texts[: len(cells) + 1]
            texts = texts[len(cells) + 1 :]
            assert word.get_text().replace("\n", " ") == ", ".join(dict.fromkeys(cells["verdict"]))
            assert len({text.xy[1] for text in (*numbers, word)}) == 1
            for text, cell in zip(numbers, cells.itertuples(), strict=True):
                shown = float(text.get_text().replace("–", "nan").replace("\N{MINUS SIGN}", "-"))
                assert shown == pytest.approx(cell.effect * cell.by, abs=0.5, nan_ok=True)
                box = text.get_bbox_patch()
                look = (box.get_edgecolor(), box.get_facecolor(), box.get_linestyle())
                looks.setdefault(cell.verdict, set()).add(look)
        assert not texts
    assert all(len(look) == 1 for look in looks.values())
    assert len(set.union(*looks.values())) == len(looks) == 5


def test_each_claim_has_a_heading_in_its_own_words() -> None:
    """Above the rows of a claim stands what it says, on whichever task; each row names its task."""
    for panel, part in compared(VERDICTS):
        texts = beside(panel, 0)
        bold = [text.get_text() for text in texts if text.get_fontweight() == "bold"]
        claims = list(dict.fromkeys(part["claim"].map(statement)))
        assert bold == claims
        assert len(texts) == len(claims) + len(part[["id", "set"]].drop_duplicates())
    assert all(" maze" not in statement(claim) for claim in VERDICTS["claim"][:60])


def test_margins_and_no_effect_are_in_view() -> None:
    """The grey ends at the margin on both sides, within the axis, and so does no effect lie."""
    for panel, part in compared(VERDICTS):
        low, high = panel.get_xlim()
        first = part.iloc[0]
        if first["statistic"] != "share":
            assert low < float(first["statistic"] == "sd-ratio") < high
        grey = [path for c in panel.collections for path in c.get_paths() if len(path) > 3]
        ends = {
            tuple(np.round([x.min(), x.max()], 9))
            for x in (np.asarray(path.vertices)[:, 0] for path in grey)
        }
        for margin in set((part["margin"] * part["by"]).dropna().round(9)):
            other = {"share": low, "sd-ratio": 1 / margin}.get(first["statistic"], -margin)
            due = round(min(margin, other), 9), round(max(margin, other), 9)
            assert due in ends
            assert low <= due[0] + 1e-9
            assert due[1] < high
            ends.remove(due)
        assert not ends


def test_the_papers_effect_stands_in_the_rows_of_its_claim() -> None:
    """An upright line in each row whose claim has a published effect, and nowhere else."""
    for panel, part in compared(VERDICTS):
        upright = [s[0, 0] for s in segments_of(panel) if s[0, 1] != s[1, 1]]
        rows = part.drop_duplicates(["id", "set"])
        assert upright == (rows["paper"] * rows["by"]).dropna().tolist()


def test_a_claim_without_any_effect_keeps_its_rows() -> None:
    """Where all trials are at the cap, the rows say that they are not testable."""
    missing = VERDICTS.copy()
    row = missing["id"] == "SAVES-SOCCER"
    missing.loc[row, ["effect", "low", "high", "margin"]] = np.nan
    missing.loc[row, "verdict"] = NOT_TESTABLE
    (panel,) = drawn(verdicts.verdicts(missing[row])).axes
    assert [text.get_text() for text in beside(panel, 1)][-4:] == ["–", "–", "–", NOT_TESTABLE]
    assert beside(panel, 0)[-1].get_text() == "soccer, all kinds"


def test_every_comparative_claim_has_a_unit() -> None:
    """A claim with another measure or statistic needs a unit for its axis."""
    comparative = [claim for claim in load_claims().claim if not claim.is_published]
    assert {(claim.statistic, claim.measure) for claim in comparative} == set(UNITS)


# --- calibration -----------------------------------------------------------------------------


def marked(panel: Axes, marks: str) -> list[Any]:
    """Return the lines of a panel that have one of the marks."""
    return [line for line in panel.lines if str(line.get_marker()) in marks]


def test_finalists_stand_at_their_numbers() -> None:
    """Each finalist is a mark in the panel of its trace, filled if it fits.

    Its colour tells the rate of the trace and its shape the start.
    """
    looks: dict[str, set[tuple[Any, Any]]] = {"ALPHA": set(), "F-START": set()}
    for panel, (_, own) in zip(
        drawn(PICTURES["points"]).axes, POINTS.groupby("F-INDEX", sort=False), strict=True
    ):
        *dots, judged = marked(panel, "osD")
        places = [np.asarray(dot.get_xydata())[0].tolist() for dot in dots]
        assert places == own[["mean", "sd"]].to_numpy().tolist()
        assert [dot.get_markerfacecolor() != "w" for dot in dots] == own["fits"].tolist()
        looks["ALPHA"] |= {*zip(own["ALPHA"], [d.get_markeredgecolor() for d in dots], strict=True)}
        looks["F-START"] |= {*zip(own["F-START"], [d.get_marker() for d in dots], strict=True)}
        (star,) = marked(panel, "*")
        assert np.asarray(star.get_xydata()).tolist() == [[40.10, 4.73]]
        assert star.get_markerfacecolor() == "none"  # it hides no dot
        assert judged.get_color() not in {dot.get_markeredgecolor() for dot in dots}
    for choice, pairs in looks.items():
        assert len(pairs) == len({key for key, _ in pairs}) == POINTS[choice].nunique()
        assert len({look for _, look in pairs}) == len(pairs)


def test_the_judging_run_stands_beside_the_finalists() -> None:
    """It has its own mark and both intervals in each panel, and its number of trials."""
    figure = drawn(PICTURES["points"])
    for panel, (_, row) in zip(figure.axes, JUDGED.iterrows(), strict=True):
        point = marked(panel, "osD")[-1]
        assert np.asarray(point.get_xydata()).tolist() == [[row["mean"], row["sd"]]]
        level, upright = segments_of(panel)[-2:]
        assert level[:, 0].tolist() == row[["low", "high"]].tolist()
        assert upright[:, 1].tolist() == row[["sd_low", "sd_high"]].tolist()
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert f"judging run, α = {JUDGED['ALPHA'].iloc[0]} (1000 trials)" in labels
    assert "and the judging run 36.0" in PICTURES["points"].words


def test_finalists_are_a_table_too() -> None:
    """Each finalist has a row: its choices, both numbers with intervals, and what it is."""
    readable = calibration.readable_final(POINTS)
    assert readable.columns.tolist() == [
        *("F-INDEX", *WORLD, *TRACE, "Mean [95 %]", "SD [95 %]", "Divergence", "Fits", "Default")
    ]
    row = POINTS.iloc[3]
    assert readable.iloc[3].tolist() == [
        *(F_LABELS[row["F-INDEX"]], *row[[*WORLD, *TRACE]]),
        f"{row['mean']:.2f} [{row['low']:.2f}, {row['high']:.2f}]",
        f"{row['sd']:.2f} [{row['sd_low']:.2f}, {row['sd_high']:.2f}]",
        *("0.300", "yes", ""),
    ]
    assert readable["Fits"].tolist() == ["yes"] * 5 + ["no"] * 35
    assert readable["Default"].tolist() == ["yes"] * 2 + [""] * 38


# --- what the claims depend on ---------------------------------------------------------------


def cells_of(figure: Figure) -> list[str]:
    """Return the texts in the cells of the heat map."""
    return [text.get_text() for panel in figure.axes[:2] for text in panel.texts]


def test_cells_are_per_cents(drawings: dict[str, Figure]) -> None:
    """The heat map writes each share of the variance as a per cent, and none below zero."""
    table = SHARES[~SHARES["choice"].isin(OUTCOMES)]
    assert (table["share"] < 0).any()
    expected = [
        "·"
        if not acts(row.choice, row.claim)
        else "<1"
        if row.share < 0.01
        else f"{100 * row.share:.0f}"
        for row in table.itertuples()
    ]
    shown = cells_of(drawings["shares"])
    assert sorted(text.replace("≥", "") for text in shown) == sorted(expected)
    assert {"<1", "·"} < set(shown)


def test_what_is_no_choice_is_explained(drawings: dict[str, Figure]) -> None:
    """The figure says what few trials and choices together are."""
    figure = drawings["shares"]
    names = [label.get_text() for label in figure.axes[1].get_xticklabels()]
    note = figure.legends[0].get_title().get_text().lower()
    assert names == ["choices together", "few trials"]
    assert all(f"{name}:" in note.replace("\n", " ") for name in names)


def test_noise_of_all_the_variance_is_at_least_that() -> None:
    """Noise is cut off at the whole variance, and the cell says so."""
    noisy = SHARES.copy()
    noisy.loc[noisy["choice"] == NOISE, "share"] = 1.0
    assert cells_of(drawn(variance.shares(noisy))).count("≥100") == len(DRAWN)


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
    assert f"FASTER: holds in {factorial['holds']} of 240 specifications" in words
    assert f"open in {factorial['open']}, reversed in {factorial['reversed']}" in words
    uncapped = rows[(rows["group"] == "factorial") & (rows["capped"] == 0)]
    held = (uncapped["outcome"] == "holds").sum()
    assert f"without trials at the cap: holds in {held} of {len(uncapped)}" in words
    changed = rows[(rows["group"] == "single") & (rows["specification"] != "default")]
    holds = (changed["outcome"] == "holds").sum()
    words = PICTURES["single"].words
    assert f"holds in {holds} of {len(SINGLE) - 1} specifications" in words
    assert "0 of them have the numbers of the default" in words
    held = SHARES[SHARES["choice"] == "holds"].set_index("claim")["share"]
    assert f"FASTER in {held['FASTER']:.0%}" in PICTURES["shares"].words
    words = PICTURES["points"].words
    assert "Published are 40.10 (4.73). Fᵢ (printed): 20 finalists, 3 of which fit" in words
    words = PICTURES["numbers"].words
    assert (
        "With the most marked pairs, 1565, incorrect demonstrations save 0.0 [-1.0, 1.0]" in words
    )
    assert "7.4 [6.4, 8.4] iterations under Fᵢ₊₁ (updated)" in words


def test_words_have_every_comparative_claim() -> None:
    """The verdicts in words have each comparative claim with its sentence, and no published one."""
    words = PICTURES["claims"].words
    judged = dict(by_claim(VERDICTS))
    assert all(f"{label}: {sentence(judged[id])}." in words for id, label in LABELS.items())
    assert words.count("; p = ") == 0
    assert "MEAN-UNIFIED-OPEN" not in words
