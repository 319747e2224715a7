from __future__ import annotations

import re
from itertools import combinations, product
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from replication.evidence.rounding import settings, variants
from replication.report.rounding import MARKS, profile, readable_rounding, tolerances
from tests.report.legible import assert_legible

SETTINGS = settings()


def some_rounding() -> pd.DataFrame:
    """Make up how the iterations depend on tolerance and arithmetic."""
    rng = np.random.default_rng(np.random.SeedSequence(1))
    rows = []
    for (task, method, reading), (tolerance, arithmetic) in product(SETTINGS, variants()):
        mean, double = rng.uniform(30, 50), arithmetic == "double"
        difference = 0.0 if double else rng.normal(0, 3)
        row: dict[str, Any] = {"task": task, "method": method, "reading": reading}
        row |= {"tolerance": tolerance, "arithmetic": arithmetic}
        row |= {"n": 100, "mean": mean, "sd": 5.0, "difference": difference}
        row |= {"low": difference - 1, "high": difference + 1, "equal": float(double)}
        p = np.nan if double else 0.0004
        rows.append(row | {"p": p, "p_holm": p})
    return pd.DataFrame(rows)


def some_profile() -> pd.DataFrame:
    """Make up where along the path rounding decides."""
    keys = dict.fromkeys((method, reading) for _, method, reading in SETTINGS)
    columns = ["method", "reading", "step", "tables", "tied", "rounded"]
    rows = [
        (method, reading, step, 40, 0.01 * step, 0.02 + number / 100)
        for number, (method, reading) in enumerate(keys)
        for step in range(31)
    ]
    return pd.DataFrame(rows, columns=columns)


TABLE, PROFILE = some_rounding(), some_profile()


@pytest.fixture(scope="module")
def figure() -> Figure:
    """Draw the iterations."""
    return tolerances(TABLE).draw(TABLE)


@pytest.fixture(scope="module")
def along() -> Figure:
    """Draw the path."""
    return profile(PROFILE).draw(PROFILE)


def texts_of(panel: Axes) -> str:
    """Return the title of a panel in one line."""
    return panel.get_title(loc="left").replace("\n", ", ")


def test_means_stand_at_their_values(figure: Figure) -> None:
    """Each setting has a panel, in which each arithmetic has its means over the tolerances."""
    titles = [texts_of(panel) for panel in figure.axes]
    assert titles == [
        f"({letter}) {task}, {method}"
        for letter, (task, method) in zip(
            "abcdef",
            product(
                ("open maze", "obstacles"),
                ("AdaBoost-IRL", "Unified, Fᵢ (printed)", "Unified, Fᵢ₊₁ (updated)"),
            ),
            strict=True,
        )
    ]
    steps = sorted(TABLE["tolerance"].unique())
    for panel, (task, method, reading) in zip(figure.axes, SETTINGS, strict=True):
        own = TABLE[(TABLE[["task", "method", "reading"]] == [task, method, reading]).all(axis=1)]
        spans = [one for one in panel.collections if isinstance(one, LineCollection)]
        for line, span, (name, look) in zip(panel.lines, spans, MARKS.items(), strict=True):
            rows = own[own["arithmetic"] == name].sort_values("tolerance")
            assert (line.get_marker(), line.get_color()) == look
            assert np.asarray(line.get_ydata()).tolist() == rows["mean"].tolist()
            places = np.round(np.asarray(line.get_xdata()))
            assert places.tolist() == list(range(len(steps)))
            ends = np.array([np.asarray(segment)[:, 1] for segment in span.get_segments()])
            np.testing.assert_allclose(ends.mean(axis=1), rows["mean"])
            np.testing.assert_allclose(ends[:, 1] - ends[:, 0], 2 * 1.96 * 0.5)
    labels = [label.get_text() for label in figure.axes[-1].get_xticklabels()]
    assert labels == ["0", "10⁻¹²", "10⁻⁹", "10⁻⁶", "10⁻³"]
    assert steps == pytest.approx([0, 1e-12, 1e-9, 1e-6, 1e-3])


def test_marks_of_one_tolerance_stand_side_by_side(figure: Figure) -> None:
    """Arithmetics that agree do not hide one another."""
    places = [np.asarray(line.get_xdata()) for line in figure.axes[0].lines]
    assert all((np.abs(one - other) > 0.1).all() for one, other in combinations(places, 2))


def test_bars_are_the_shares_along_the_path(along: Figure) -> None:
    """Each step has the share that rounding decides, and on top of it that of exact ties."""
    groups = PROFILE.groupby(["method", "reading"], sort=False)
    for panel, (_, own) in zip(along.axes, groups, strict=True):
        rounded, tied = panel.containers
        assert [bar.get_height() for bar in rounded] == pytest.approx(100 * own["rounded"])
        assert [bar.get_height() for bar in tied] == pytest.approx(100 * own["tied"])
        assert [bar.get_y() for bar in tied] == pytest.approx(100 * own["rounded"])
        assert [round(bar.get_x() + bar.get_width() / 2) for bar in rounded] == list(range(31))
        (legend,) = along.legends
        colours = [to_rgba(handle.get_color()) for handle in legend.get_lines()]
        assert [bars[0].get_facecolor() for bars in (rounded, tied)] == colours


@pytest.mark.parametrize("kind", ["figure", "along"])
def test_texts_are_legible(kind: str, request: pytest.FixtureRequest) -> None:
    """Titles, labels and the legend of narrow panels have room."""
    assert_legible(request.getfixturevalue(kind))


def test_words_have_the_numbers() -> None:
    """The means in double precision are told by tolerance, and how often rounding decides."""
    words = tolerances(TABLE).words
    double = TABLE[TABLE["arithmetic"] == "double"]
    found = [float(number) for number in re.findall(r"([\d.]+) at ", words)]
    assert found == pytest.approx(double["mean"].tolist(), abs=0.05)
    assert "obstacles, Unified, without incorrect, Fᵢ₊₁ (updated): " in words
    assert (
        "AdaBoost-IRL (R1): rounding decides in 2.0% and an exact tie in 15.0% of the choices"
        in profile(PROFILE).words
    )


def test_readable_rounding_by_hand() -> None:
    """A row an arithmetic other than double, with the mean of double beside it."""
    keys = {"task": "open-maze", "method": "adaboost", "reading": "", "tolerance": 0.0, "sd": 4.126}
    double = {"arithmetic": "double", "mean": 44.0, "difference": 0.0, "equal": 1.0}
    fused = {"arithmetic": "fused", "mean": 45.5, "difference": 1.5, "equal": 0.125}
    table = pd.DataFrame([keys | double, keys | fused]).assign(
        low=0.5, high=2.5, p_holm=0.0004, wrong=7.04
    )
    readable = readable_rounding(table)
    assert readable.columns.tolist()[:3] == ["Task", "Method", "Tolerance"]
    assert [" | ".join(row) for row in readable.to_numpy()] == [
        "open maze | AdaBoost-IRL (R1) | 0 | 44.00 (4.13) | fused | 1.50 [0.50, 2.50] | 12% | "
        "< 0.001 | 7.0"
    ]
