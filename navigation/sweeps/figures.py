"""The figures of a sweep's report."""

import numpy as np
import pandas as pd
from jaxtyping import UInt8
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tussock.world.geometry import Route
from tussock.world.scene import World

from ..intervals import Interval
from ..reports.drawing import (
    CURVE_COLOUR,
    GOOD_COLOUR,
    PATH_COLOUR,
    ROUTE_COLOUR,
    SOFT_COLOUR,
    canvas,
    draw_panorama,
    from_zero,
    legend_above,
)
from ..reports.maps import draw_map, draw_route, map_axes
from .model_colours import model_colour, model_markers
from .statistics import MEASURES, SHARES, axis_label, by_axis, choice_label

COLOURS = (ROUTE_COLOUR, PATH_COLOUR, GOOD_COLOUR, "#8a6100", "#7b4fb5", CURVE_COLOUR, SOFT_COLOUR)
MAX_LABELS = 24  # an axis with more choices has no labels
MAX_TICKS = 11  # of numbers, in steps
MAX_LABEL_LENGTH = 40


def along_axis(table: pd.DataFrame, axis: list[str], measures: list[str], by: list[str]) -> Figure:
    """Each measure over the choices of an axis, with confidence intervals.

    Args:
        table: The runs.
        axis: Settings that make the axis.
        measures: Columns to draw, one panel each.
        by: Settings that make the lines, one for each of their choices; empty for a single line.

    Returns:
        The figure.
    """
    figure, axes = canvas((7.2, 0.6 + 2.1 * len(measures)), len(measures), 1, sharex=True)
    panels = dict(zip(measures, axes[:, 0], strict=True))
    lines = (
        [(choice_label(key), part) for key, part in table.groupby(by, dropna=False, sort=True, observed=True)]
        if by
        else []
    )
    lines = lines or [("", table)]
    labels = list(by_axis(table, axis, []))
    numeric = len(axis) == 1 and pd.api.types.is_numeric_dtype(table[axis[0]]) and not bool(table[axis[0]].isna().any())
    positions = np.sort(table[axis[0]].unique().astype(float)) if numeric else np.arange(len(labels), dtype=float)
    line = "-" if numeric and not axis[0].endswith("seed") else ""
    of_models = by == ["model"]
    markers = model_markers(label for label, _ in lines) if of_models else ["o"] * len(lines)
    for number, (label, part) in enumerate(lines):
        # Among choices, lines are shifted, so that their intervals do not cover each other; numbers are where they are.
        shift = 0.0 if numeric else 0.6 * ((number + 0.5) / len(lines) - 0.5)
        intervals = {choice: each.intervals for choice, each in by_axis(part, axis, measures).items()}
        known = [k for k, choice in enumerate(labels) if choice in intervals]
        for measure, panel in panels.items():
            values = [intervals[labels[k]][measure] for k in known]
            colour = model_colour(label) if of_models else COLOURS[number % len(COLOURS)]
            fmt = markers[number] + line
            _draw_intervals(panel, positions[known] + shift, values, fmt=fmt, color=colour, label=label)
    for measure, panel in panels.items():
        panel.set_ylabel(MEASURES[measure])
        panel.grid(axis="y", color="#00000018")
        if measure in SHARES:
            panel.set_ylim(-0.05, 1.05)
        else:
            from_zero(panel)
    _label_axis(axes[-1, 0], axis, positions, None if numeric else labels)
    if by:
        legend_above(axes[0, 0])
    return figure


def _draw_intervals(axes: Axes, positions: np.ndarray, intervals: list[Interval], **style) -> None:
    """Draw means as dots, with their intervals as bars."""
    values = np.array([each.value for each in intervals])
    ends = np.array([[each.value - each.low for each in intervals], [each.high - each.value for each in intervals]])
    axes.errorbar(positions, values, yerr=ends.clip(0), ms=4, lw=1.2, elinewidth=1, capsize=2, **style)


def _label_axis(axes: Axes, axis: list[str], positions: np.ndarray, labels: list[str] | None) -> None:
    """Label a horizontal axis of numbers, or of choices with labels."""
    axes.set_xlabel(axis_label(axis))
    if labels is None:
        if np.ptp(positions) <= MAX_TICKS * np.diff(positions).min(initial=np.inf):  # each has room for its number
            axes.set_xticks(positions)
    elif len(labels) <= MAX_LABELS:
        short = [name if len(name) <= MAX_LABEL_LENGTH else f"{name[: MAX_LABEL_LENGTH - 1]}…" for name in labels]
        axes.set_xticks(positions, short)


def walk_map(world: World, route: Route, steps: pd.DataFrame, shown: int) -> Figure:
    """A walk from above.

    Args:
        world: The world.
        route: The route.
        steps: The walk's trajectory. Poor steps are drawn as dots.
        shown: Row of the step that has a ring around it.

    Returns:
        The figure.
    """
    xy = steps[["x_m", "y_m"]].to_numpy()
    points = np.vstack([route.xy, xy])
    figure, axes = map_axes(points, max_height=4.6)
    axis = axes[0, 0]
    draw_route(axis, route)
    path = xy.copy()
    path[steps["reset"].notna().to_numpy()] = np.nan  # the agent did not walk to where it was put back
    axis.plot(*path.T, color=PATH_COLOUR, lw=1.4, zorder=3)
    axis.plot(*xy[steps["cause"].notna().to_numpy()].T, ".", color=CURVE_COLOUR, ms=5, zorder=4)
    axis.plot(*xy[shown], "o", mfc="none", mec=CURVE_COLOUR, ms=13, mew=1.6, zorder=5)
    draw_map(axis, world, points)
    return figure


def view_and_match(view: UInt8[np.ndarray, "h w c"], match: UInt8[np.ndarray, "h w c"] | None) -> Figure:
    """The view at a poor step, above the learned view that the model recognised in it, where that is known."""
    rows = 1 if match is None else 2
    figure, axes = canvas((7.2, 1.5 * rows + 0.2), rows, 1, sharex=True)
    draw_panorama(axes[0, 0], view, "view")
    if match is not None:
        draw_panorama(axes[1, 0], match, "recognised")
        axes[0, 0].set_xlabel("")
    return figure
