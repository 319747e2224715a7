"""What holds for every picture, whatever it shows."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from PIL import Image

from replication import Demos
from replication.evidence.experiments import NONE, Key
from replication.evidence.tables import kinds_table, read_table, sets_table, write_csv
from replication.paper.published import FIGURE_5, TABLE_1
from replication.report import errors, field, iterations, maze, values, why
from replication.report.learned import fit_figure
from replication.report.picture import Picture
from replication.report.sets import savings
from replication.report.style import save_figure
from replication.trials.condition import Condition
from replication.trials.measures import Report, measure_trials
from replication.trials.results import Results

KINDS = [
    *("map", "map without incorrect", "values", "errors", "errors of one", "iterations"),
    *("sets", "why", "field", "soccer", "soccer without incorrect"),
]


SHOWN = {"none", "hit", "detour", "near-detour", "far-detour", "opposite"}


@pytest.fixture(scope="module")
def pictures(
    small_demos: Demos,
    soccer_demos: Demos,
    conditions: dict[Key, Condition],
    sets: dict[Key, Condition],
    results: Results,
    trials: pd.DataFrame,
) -> dict[str, Picture]:
    """Make each kind of picture once, of a few trials in a small maze and of the soccer field."""
    every = {**conditions, **sets}
    saved = sets_table(measure_trials(results, every.values()), every)
    key = "unified", "printed", NONE
    traced = results.trial(conditions[key], 0, snapshots=True)
    unified = [conditions["unified", reading, NONE] for reading in ("printed", "updated")]
    along = measure_trials(results, unified, path=True)
    one = trials[trials["method"] == "adaboost"]
    return {
        "map": maze.demonstrations(small_demos),
        "map without incorrect": maze.demonstrations(small_demos.select("none")),
        "values": values.values(traced, small_demos, Report(), along),
        "errors": errors.falling(trials, FIGURE_5),
        "errors of one": errors.falling(one, {}, median=True),
        "iterations": iterations.per_trial(trials, TABLE_1),
        "sets": savings(saved, TABLE_1),
        "why": why.why(kinds_table(trials), saved, {key: traced}, small_demos),
        "field": field.start(soccer_demos.environment),
        "soccer": field.demonstrations(soccer_demos),
        "soccer without incorrect": field.demonstrations(soccer_demos.select("none")),
    }


@pytest.fixture(scope="module")
def tables(
    pictures: dict[str, Picture], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, pd.DataFrame]:
    """Read the numbers of each picture back from its file."""
    path = tmp_path_factory.mktemp("tables") / "numbers.csv"
    return {kind: read_table(write_csv(pictures[kind].numbers, path)) for kind in pictures}


@pytest.fixture(scope="module")
def drawings(
    pictures: dict[str, Picture],
    tables: dict[str, pd.DataFrame],
    small_demos: Demos,
    soccer_demos: Demos,
) -> dict[str, Figure]:
    """Draw each picture from its file, and what was learned from a user's own demonstrations."""
    weights, errors = np.linspace(-1, 1, 42 * 4).reshape(42, 4), np.linspace(2, 0, 9)
    one, other = small_demos.correct[0], soccer_demos.incorrect[0]
    fits = {
        "fit": fit_figure(small_demos, one.states, one.actions, weights, errors),
        "soccer fit": fit_figure(soccer_demos, other.states, other.actions, weights, errors),
    }
    return {**fits, **{kind: pictures[kind].draw(tables[kind]) for kind in pictures}}


@pytest.mark.parametrize("kind", KINDS)
def test_a_picture_is_redrawn_by_its_code_and_its_file(
    kind: str, pictures: dict[str, Picture], tables: dict[str, pd.DataFrame], tmp_path: Path
) -> None:
    """The named function draws from the file what it draws from the numbers, in any style.

    Ten digits may shift the shade of a pixel by one step.
    """
    module, _, name = pictures[kind].code.rpartition(".")
    draw: Callable[[pd.DataFrame], Figure] = getattr(importlib.import_module(module), name)
    (exact,) = save_figure(draw(pictures[kind].numbers), tmp_path / "numbers", ["png"])
    once = save_figure(draw(tables[kind]), tmp_path / "file")
    with mpl.rc_context({"font.size": 20, "axes.facecolor": "black", "savefig.dpi": 30}):
        again = save_figure(draw(tables[kind]), tmp_path / "styled")
    for path, other in zip(once, again, strict=True):
        assert path.read_bytes() == other.read_bytes()
    shades = [np.asarray(Image.open(path).convert("RGB"), dtype=int) for path in (exact, once[0])]
    assert np.abs(shades[0] - shades[1]).max() <= 1


@pytest.mark.parametrize("kind", ["map", "fit", "soccer fit"])
def test_files_depend_on_the_figure_alone(
    kind: str, drawings: dict[str, Figure], tmp_path: Path
) -> None:
    """Saving twice gives the same PNG and SVG, without a time or a version in them."""
    once, twice = (
        [path.read_bytes() for path in save_figure(drawings[kind], tmp_path / name)]
        for name in ("a", "b")
    )
    assert once == twice
    assert b"Matplotlib" not in once[0]
    assert b"dc:date" not in once[1]


@pytest.mark.parametrize("kind", [*KINDS, "fit", "soccer fit"])
def test_nothing_is_cut_off_or_covered(kind: str, drawings: dict[str, Figure]) -> None:
    """All that is drawn lies within the figure, and no legend covers a panel or its labels."""
    figure = drawings[kind]
    box = figure.get_tightbbox(figure.canvas.get_renderer())  # type: ignore[attr-defined]
    width, height = figure.get_size_inches()
    assert min(box.x0, box.y0) > -0.01
    assert box.x1 < width + 0.01
    assert box.y1 < height + 0.01
    for legend in figure.legends:
        top = legend.get_window_extent().y1
        boxes = [panel.get_tightbbox() for panel in figure.axes]
        assert all(box is not None and box.y0 > top for box in boxes)


@pytest.mark.parametrize("kind", KINDS)
def test_files_hold_keys(kind: str, tables: dict[str, pd.DataFrame]) -> None:
    """Columns are plain names, and methods and readings are called by their keys."""
    table = tables[kind]
    assert all(name.isidentifier() for name in table.columns)
    if "method" in table:
        assert set(table["method"]) <= {"", "adaboost", "unified", "unified-incorrect"}
        assert set(table["reading"]) <= {"", "printed", "updated", "at-once"}
        assert all({*name.split("+")} <= SHOWN for name in set(table["set"]) - {""})


def test_positions_do_not_depend_on_addresses(pictures: dict[str, Picture]) -> None:
    """Axes stand at rounded positions, so that equal numbers give equal bytes in every process."""
    for picture in pictures.values():
        for axes in picture.draw(picture.numbers).axes:
            bounds = axes.get_position(original=True).bounds
            assert [round(value, 9) for value in bounds] == pytest.approx(bounds, abs=1e-15)
