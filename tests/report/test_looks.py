from __future__ import annotations

import pandas as pd
import pytest

from replication.evidence.experiments import GENERAL, NAMED, NONE
from replication.irl import METHODS
from replication.report.looks import KEY, LISTED, line_handles, panels

PANELS = ["Fᵢ (printed)", "Fᵢ₊₁ (updated)", "Fᵢ, maximum at once"]


@pytest.mark.parametrize(
    ("methods", "titles"),
    [(["adaboost", "unified"], PANELS[:2]), (["adaboost", "unified", "unified-incorrect"], PANELS)],
)
def test_each_reading_has_a_panel_with_all_that_counts_in_it(
    methods: list[str], titles: list[str], trials: pd.DataFrame
) -> None:
    """AdaBoost-IRL is in every panel; the printed trials count as those with the maximum at once.

    A set of incorrect demonstrations has a look of its own.
    """
    shown = panels(trials[trials["method"].isin(methods)])
    assert list(shown) == titles
    for lines, reading in zip(shown.values(), ("printed", "updated", "at-once"), strict=False):
        trace = "printed" if reading == "at-once" else reading
        due = {
            METHODS["adaboost"].colour: ("adaboost", "", NONE),
            METHODS["unified"].colour: ("unified", trace, NONE),
            METHODS["unified-incorrect"].colour: ("unified-incorrect", reading, NAMED),
            LISTED: ("unified-incorrect", reading, GENERAL),
        }
        keys = {
            look.colour: rows[KEY].drop_duplicates().to_numpy().tolist() for look, rows in lines
        }
        assert keys == {look: [list(key)] for look, key in due.items() if key[0] in methods}


def test_the_legend_names_what_is_drawn_once(trials: pd.DataFrame) -> None:
    """Each line has one entry in its own colour, and no two lines look alike without colour."""
    handles = line_handles(panels(trials[trials["method"] != "adaboost"]))
    assert [handle.get_label() for handle in handles] == [
        "Unified, without incorrect",
        "Unified, with incorrect (named kinds)",
        "Unified, with incorrect (general list)",
    ]
    assert len({handle.get_color() for handle in handles}) == 3
    assert len({str(handle._dash_pattern) for handle in handles}) == 3  # type: ignore[attr-defined]
