"""What must be true of every figure in a report."""

from itertools import combinations
from pathlib import Path
from unittest import mock

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from tussock.navigation.reports.drawing import Image
from tussock.navigation.reports.layout import fit_texts

SLACK = 1.0  # pixels
FAIR_SHARE = 0.5  # of an axis that its data fill

SAVE_FIGURE = "tussock.navigation.reports.report.save_figure"  # what draws the figures of a page


def not_drawn(figure: Figure, folder: Path, name: str) -> Image:
    """Takes its place where the words and numbers of a page are tested: the figure is made, but takes no time to be drawn."""
    return Image(data="", width=1, height=1)


def check_figure(figure: Figure) -> None:
    """Fail where a text lies outside of a figure or over another text, and where axes show no data, parts of them, or a corner full."""
    fit_texts(figure)
    texts = drawn_texts(figure)
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts]
    width, height = figure.bbox.size
    for name, box in boxes:
        assert min(box.x0, box.y0) >= -SLACK, f"{name!r} is cut off"
        assert max(box.x1 - width, box.y1 - height) <= SLACK, f"{name!r} is cut off"
    for (first, a), (second, b) in combinations(boxes, 2):
        apart = min(a.x1, b.x1) - max(a.x0, b.x0) <= SLACK or min(a.y1, b.y1) - max(a.y0, b.y0) <= SLACK
        assert apart, f"{first!r} lies over {second!r}"
    for axes in figure.axes:
        if axes.axison and axes.get_label() != "<colorbar>":
            _check_axes(axes)


def drawn_texts(figure: Figure) -> list[Text]:
    """The texts that matplotlib draws, whatever they belong to."""
    drawn: list[Text] = []
    draw = Text.draw

    def recorded(text: Text, renderer, *arguments, **options) -> None:
        drawn.append(text)
        draw(text, renderer, *arguments, **options)

    FigureCanvasAgg(figure)
    with mock.patch.object(Text, "draw", recorded):
        figure.draw_without_rendering()
    return [text for text in drawn if text.get_visible() and text.get_text().strip()]


def _check_axes(axes: Axes) -> None:
    where = axes.get_title() or axes.get_ylabel()
    curves = [line.get_xydata() for line in axes.lines if line.get_transform() == axes.transData]
    points = [np.asarray(each, float) for each in curves] + [
        np.asarray(each.get_offsets(), float) for each in axes.collections
    ]
    in_view = [_in_view(axes, each) for each in points]
    assert axes.images or axes.patches or axes.containers or any(each.any() for each in in_view), (
        f"{where!r} shows no data"
    )
    if axes.get_aspect() != "auto":
        return  # a map may show a part of its route
    for each in in_view[: len(curves)]:
        assert each.all(), f"{where!r} leaves data out"
    if axes.images or axes.get_ylabel().startswith("share"):
        return  # they show their whole range
    for name in "xy":
        siblings = getattr(axes, f"get_shared_{name}_axes")().get_siblings(axes)
        ends = [getattr(each.dataLim, f"interval{name}") for each in siblings]
        low, high = getattr(axes, f"get_{name}bound")()
        filled = (np.max(ends) - np.min(ends)) / (high - low)
        assert filled >= FAIR_SHARE, f"data fill {filled:.0%} of the {name} axis of {where!r}"


def _in_view(axes: Axes, points: np.ndarray) -> np.ndarray:
    """Whether each known point lies within the limits of axes."""
    known = points[np.isfinite(points).all(axis=1)]
    low, high = np.transpose([axes.get_xbound(), axes.get_ybound()])
    slack = 1e-6 * (high - low)
    return ((known >= low - slack) & (known <= high + slack)).all(axis=1)
