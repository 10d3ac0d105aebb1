"""Room for the texts of a figure: matplotlib's layout leaves none for titles and labels that are longer than their axes."""

import textwrap
from collections.abc import Iterator
from itertools import pairwise

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

ROUNDS = 6  # of changes and new layouts; two are enough for most figures
MIN_CHARACTERS = 8  # of a line
MARGIN = 0.05  # inches around a figure that was too small


def fit_texts(figure: Figure) -> None:
    """Make room for all texts of a finished figure.

    Titles and labels that are longer than their axes are broken into lines, as are tick labels that would overlap, or these are turned.
    Where a text still lies outside of the figure, the figure is enlarged.
    """
    FigureCanvasAgg(figure)  # measures texts
    for _ in range(ROUNDS):
        figure.draw_without_rendering()
        changes = [_fit_axes(axes, figure) for axes in figure.axes if axes.get_visible() and axes.axison]
        if not any(changes) and not _enlarge(figure):
            break


def _fit_axes(axes: Axes, figure: Figure) -> bool:
    """Break the title and labels of axes into lines, turn them, or leave some out; whether anything was changed."""
    slot = axes.get_position(original=True)  # with what an equal aspect takes away
    room = slot.transformed(figure.transFigure)
    changes = [
        _break_lines(axes.title, room.width),
        _break_lines(axes.xaxis.label, room.width),
        _break_lines(axes.yaxis.label, room.height),
        _fit_tick_labels(axes, figure),
        _thin_tick_labels(axes),
    ]
    return any(changes)


def _break_lines(text: Text, room: float) -> bool:
    """Break a text into lines that are no longer than the room for them (pixels)."""
    before = text.get_text()
    if not (before and text.get_visible()):
        return False
    box = text.get_window_extent()
    length = box.height if text.get_rotation() == 90 else box.width
    if length <= room:
        return False
    lines = before.split("\n")
    characters = max(MIN_CHARACTERS, int(max(map(len, lines)) * room / length))
    text.set_text("\n".join(_balanced(line, characters) for line in lines))
    return text.get_text() != before


def _balanced(line: str, characters: int) -> str:
    """A line broken into as few as needed, of similar lengths."""

    def broken(width: int) -> list[str]:
        return textwrap.wrap(line, width, break_long_words=False, break_on_hyphens=False)

    while characters > MIN_CHARACTERS and len(broken(characters - 1)) == len(broken(characters)):
        characters -= 1
    return "\n".join(broken(characters))


def _fit_tick_labels(axes: Axes, figure: Figure) -> bool:
    """Break the labels of a horizontal axis into lines where they would overlap; where that is not enough, turn them upright."""
    labels = list(tick_labels(axes, 0))
    if any(label.get_rotation() for label in labels) or not _overlap(labels, 0):
        return False
    middles = [(box.x0 + box.x1) / 2 for box in map(Text.get_window_extent, labels)]
    longest = max(label.get_window_extent().width for label in labels)
    for label in labels:
        _break_lines(label, min(right - left for left, right in pairwise(sorted(middles))))
    if _overlap(labels, 0):
        axes.tick_params(axis="x", labelrotation=90)
        figure.set_figheight(figure.get_figheight() + longest / figure.dpi)
    else:
        axes.set_xticks([label.get_position()[0] for label in labels], [label.get_text() for label in labels])
    return True


def _thin_tick_labels(axes: Axes) -> bool:
    """Leave out every second tick of a vertical axis where their labels would overlap."""
    labels = list(tick_labels(axes, 1))
    if not _overlap(labels, 1):
        return False
    axes.set_yticks([label.get_position()[1] for label in labels][::2])
    return True


def _overlap(labels: list[Text], direction: int) -> bool:
    """Whether any two texts in a row (0) or above each other (1) overlap."""
    ends = sorted(tuple(label.get_window_extent().get_points()[:, direction]) for label in labels)
    return any(low <= end for (_, end), (low, _) in pairwise(ends))


def tick_labels(axes: Axes, direction: int) -> Iterator[Text]:
    """The labels of the horizontal (0) or vertical (1) axis that are drawn: those of ticks within its limits."""
    axis = (axes.xaxis, axes.yaxis)[direction]
    low, high = sorted(axis.get_view_interval())
    slack = 1e-9 * (high - low)
    for label in axis.get_ticklabels():
        if label.get_text() and low - slack <= label.get_position()[direction] <= high + slack:
            yield label


def _enlarge(figure: Figure) -> bool:
    """Enlarge a figure by what lies outside of it; whether anything did."""
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    across = max(0.0, -box.x0) + max(0.0, box.x1 - width)
    up = max(0.0, -box.y0) + max(0.0, box.y1 - height)
    figure.set_size_inches(width + across + MARGIN * (across > 0), height + up + MARGIN * (up > 0))
    return bool(across or up)
