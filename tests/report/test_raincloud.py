from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from replication.report.raincloud import draw_cloud


@pytest.mark.parametrize("values", [[3.0] * 5, [0.0] * 97 + [2.0, -1.0, 4.0], [20.0, 35.0, 50.0]])
def test_a_cloud_is_highest_where_most_trials_are(values: list[float]) -> None:
    """Its top is at the mode, also of a constant sample, and every trial has a dot at its value."""
    panel = Figure().subplots()
    draw_cloud(panel, 0, "k", np.array(values))
    (cloud,) = panel.collections
    outline = np.asarray(cloud.get_paths()[0].vertices)
    top = outline[outline[:, 1].argmax(), 0]
    if len(set(values)) < len(values):
        assert top == pytest.approx(max(set(values), key=values.count), abs=0.1)
    assert min(values) < outline[:, 0].mean() < max(values) or len(set(values)) == 1
    (dots,) = panel.lines
    assert np.asarray(dots.get_xdata()).tolist() == values
    assert outline[:, 1].min() > np.asarray(dots.get_ydata(), dtype=float).max()


def test_whole_numbers_give_one_hump() -> None:
    """The density of a wide sample of whole numbers has no hump for each of them."""
    panel = Figure().subplots()
    draw_cloud(panel, 0, "k", np.repeat(np.arange(20.0, 41), 5))
    outline = np.asarray(panel.collections[0].get_paths()[0].vertices)
    inner = outline[(outline[:, 0] > 25) & (outline[:, 0] < 35) & (outline[:, 1] > 0.06)]
    assert np.ptp(inner[:, 1]) < 0.02
