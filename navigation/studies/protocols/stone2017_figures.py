"""Figures of stone2017: errors of home vectors, flights home, and the search about the nest."""

from itertools import cycle

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from ...reports.drawing import CURVE_COLOUR, PATH_COLOUR, SOFT_COLOUR, canvas, from_zero, legend_above
from ...sweeps.model_colours import MARKERS
from .figures import COLOURS

CIRCLE = 20.0  # units about the nest
VIEWED = 80.0  # units from the nest, in the figure of the search


def draw_errors(table: pd.DataFrame) -> Figure:
    """Angle and distance of errors against the length of the way out, a line for each level of noise."""
    return _curves(table, "noise", "noise {:g}", "steps out", "steps out")


def draw_senses(table: pd.DataFrame) -> Figure:
    """Angle and distance of errors against the length of the way out, a line for each model of senses."""
    return _curves(table, "senses", "{}", "path length", "length of the way out (m)")


def draw_flights(table: pd.DataFrame) -> Figure:
    """Flights out and home, an axis for each level of noise."""
    figure, panels = _panels(table)
    for axis, (_, part) in zip(panels, table.groupby("noise"), strict=True):
        for way, colour in (("out", SOFT_COLOUR), ("home", PATH_COLOUR)):
            for _, each in part[part["part"] == way].groupby("bee"):
                axis.plot(each["x"], each["y"], color=colour, lw=0.8)
        axis.plot(0, 0, "+", color=CURVE_COLOUR, ms=9, mew=1.6)
        axis.set_aspect("equal", adjustable="datalim")
    return figure


def draw_home(table: pd.DataFrame) -> Figure:
    """Distance from the nest in the flight home, a line with quartiles for each level of noise."""
    figure, axes = canvas((7.2, 3.2))
    axis = axes[0, 0]
    for (noise, part), colour in zip(table.groupby("noise"), cycle(COLOURS), strict=False):
        axis.plot(part["steps home"], part["median"], color=colour, lw=1.6, label=f"noise {noise:g}")
        axis.fill_between(part["steps home"], part["low quartile"], part["high quartile"], color=colour, alpha=0.12)
    axis.set(xlabel="steps home", ylabel="distance from the nest")
    from_zero(axis)
    legend_above(axis)
    return figure


def draw_search(table: pd.DataFrame) -> Figure:
    """Where bees are in the search, an axis for each level of noise."""
    figure, panels = _panels(table)
    for axis, (_, part) in zip(panels, table.groupby("noise"), strict=True):
        axis.plot(part["x"], part["y"], ".", color=PATH_COLOUR, ms=2, alpha=0.3)
        axis.add_patch(Circle((0, 0), CIRCLE, fill=False, color=CURVE_COLOUR, lw=1))
        axis.set(xlim=(-VIEWED, VIEWED), ylim=(-VIEWED, VIEWED))
        axis.set_aspect("equal")
    return figure


def _panels(table: pd.DataFrame) -> tuple[Figure, list[Axes]]:
    """Axes side by side, one for each level of noise."""
    noises = sorted(table["noise"].unique())
    figure, axes = canvas((7.2, 2.2), columns=len(noises))
    for axis, noise in zip(axes[0], noises, strict=True):
        axis.set_title(f"noise {noise:g}")
        axis.set(xticks=[], yticks=[])
    return figure, list(axes[0])


def _curves(table: pd.DataFrame, by: str, label: str, x: str, xlabel: str) -> Figure:
    figure, axes = canvas((7.2, 3.4), columns=2)
    for (value, part), colour, marker in zip(
        table.groupby(by, sort=False), cycle(COLOURS), cycle(MARKERS), strict=False
    ):
        style = {"color": colour, "marker": marker, "ms": 4, "lw": 1.6, "label": label.format(value)}
        axes[0, 0].plot(part[x], part["angle (deg)"], **style)
        axes[0, 1].plot(part[x], part["error / end distance"], **style)
        axes[0, 1].fill_between(part[x], part["low quartile"], part["high quartile"], color=colour, alpha=0.1)
    axes[0, 1].axhline(0.1, ls=":", color=SOFT_COLOUR, lw=1.2)
    axes[0, 0].set(xlabel=xlabel, ylabel="angle (degrees)")
    axes[0, 1].set(xlabel=xlabel, ylabel="error / end distance")
    for axis in axes[0]:
        from_zero(axis)
        axis.grid(axis="y", color="#00000018")
    legend_above(axes[0, 0])
    return figure
