"""Figures with published numbers next to those obtained."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...reports.drawing import GOOD_COLOUR, PATH_COLOUR, ROUTE_COLOUR, SOFT_COLOUR, canvas

OBTAINED, PUBLISHED = "obtained", "published"


def draw_beside(axes: Axes, table: pd.DataFrame, label: str, measure: str, xlabel: str) -> None:
    """Draw a measure of each row, with its interval, and the published value.

    Args:
        axes: To draw on.
        table: Columns `measure`, and `measure` with ", published", ", low" and ", high" behind it; missing numbers are not drawn.
        label: Column with the names of the rows.
        measure: Name of the measure.
        xlabel: Label of the horizontal axis.
    """
    places = np.arange(len(table))[::-1]
    value, low, high = (table[measure + end].to_numpy(float) for end in ("", ", low", ", high"))
    axes.hlines(places, low, high, color=ROUTE_COLOUR, lw=2.2, alpha=0.6)
    axes.plot(value, places, "o", color=ROUTE_COLOUR, ms=6, label=OBTAINED)
    axes.plot(table[f"{measure}, published"].to_numpy(float), places, "D", color=PATH_COLOUR, ms=5, label=PUBLISHED)
    axes.set(yticks=places, yticklabels=table[label], xlabel=xlabel, ylim=(-0.6, len(table) - 0.4))
    axes.grid(axis="x", color="#00000018")


def beside(table: pd.DataFrame, label: str, measures: Sequence[tuple[str, str]]) -> Figure:
    """`draw_beside` for several measures side by side. measures: name and label of the axis of each."""
    figure, axes = canvas((7.2, 1.0 + 0.34 * len(table)), columns=len(measures), sharey=True)
    for axis, (measure, xlabel) in zip(axes[0], measures, strict=True):
        draw_beside(axis, table, label, measure, xlabel)
    axes[0, 0].legend(frameon=False, fontsize=8, ncols=2, loc="lower left", bbox_to_anchor=(0, 1))
    return figure


def agreement(table: pd.DataFrame, group: str, unit: str) -> Figure:
    """Obtained numbers against published ones, with their intervals; on the line they are equal.

    Args:
        table: Columns "published", "obtained", "low" and "high".
        group: Column whose values have a colour each.
        unit: Of the numbers.
    """
    figure, axes = canvas((5.2, 4.6))
    axis = axes[0, 0]
    present = table.dropna(subset=[PUBLISHED, OBTAINED])
    colours = (ROUTE_COLOUR, GOOD_COLOUR, PATH_COLOUR, SOFT_COLOUR)
    for k, (name, part) in enumerate(present.groupby(group, sort=False)):
        x, y, low, high = (part[each].to_numpy(float) for each in (PUBLISHED, OBTAINED, "low", "high"))
        colour = colours[k % len(colours)]
        axis.vlines(x, low, high, color=colour, lw=1, alpha=0.4)
        axis.plot(x, y, "o", color=colour, ms=4, label=str(name))
    most = float(np.nanmax(present[[PUBLISHED, OBTAINED]].to_numpy(float), initial=1.0)) * 1.05
    axis.plot((0, most), (0, most), ":", color=SOFT_COLOUR, lw=1.2)
    axis.set(xlabel=f"published ({unit})", ylabel=f"obtained ({unit})", xlim=(0, most), ylim=(0, None))
    axis.legend(frameon=False, fontsize=8, ncols=2, loc="lower left", bbox_to_anchor=(0, 1))
    return figure
