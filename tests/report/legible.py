"""What must hold of the texts in a figure."""

from __future__ import annotations

from itertools import combinations

from matplotlib.figure import Figure
from matplotlib.text import Text


def shown_texts(figure: Figure) -> list[Text]:
    """Return all texts that are drawn: not the labels of ticks beyond the ends of an axis."""
    texts = [*figure.texts]
    for legend in figure.legends:
        texts += [legend.get_title(), *legend.get_texts()]
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


def assert_legible(figure: Figure) -> None:
    """No text is smaller than 7 points, lies outside the figure or overlaps another."""
    boxes = {text: text.get_window_extent() for text in shown_texts(figure)}
    width, height = figure.bbox.size
    for text, box in boxes.items():
        assert float(text.get_fontsize()) >= 7, text
        assert min(box.x0, box.y0) > -0.5, text
        assert box.x1 < width + 0.5, text
        assert box.y1 < height + 0.5, text
    for one, other in combinations(boxes, 2):
        assert not boxes[one].padded(-0.5).overlaps(boxes[other].padded(-0.5)), (one, other)
