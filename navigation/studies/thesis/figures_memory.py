"""Figures of perfect memory: frequency, resolution and preprocessing."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...reports.drawing import (
    CURVE_COLOUR,
    GOOD_COLOUR,
    PATH_COLOUR,
    ROUTE_COLOUR,
    SOFT_COLOUR,
    WIDE,
    canvas,
    draw_lines,
    draw_panorama,
    label_errors,
    legend_above,
)
from ...reports.maps import draw_map, draw_route, map_axes
from ...reports.results import StudyResults
from .heading_maps import heading_maps
from .items import figure
from .parameters import ENCODING
from .study_data import StudyData

EVERY_NTH = "N: every N-th view is remembered"


@figure("12", "frequency", "Headings along the route, perfect memory")
def _perfect_memory(results: StudyResults, data: StudyData) -> Figure:
    """Recovered headings at the {places} grid positions within 0.2 m of the route; every route view is remembered."""
    return heading_maps(results.tables, data, {"headings": ""})


@figure("13", "frequency", "Place recognition")
def _place_recognition(results: StudyResults, data: StudyData) -> Figure:
    """Each grid position is compared with the route view nearest to it; the heading of that view is the set heading."""
    drawn, axes = map_axes(data.route.xy)
    axis, table = axes[0, 0], results.tables["headings"]
    draw_route(axis, data.route)
    nearest = data.route.xy[table["nearest_view"]]
    positions = table[["x_m", "y_m"]].to_numpy()
    axis.plot(*np.stack([positions, nearest], axis=1).T, color=SOFT_COLOUR, lw=0.9, zorder=1)
    axis.plot(*positions.T, "o", ms=3, color=CURVE_COLOUR)
    draw_map(axis, data.world, np.vstack([positions, nearest]))
    return drawn


@figure("14", "frequency", "Error against the spacing of the remembered views")
def _by_frequency(results: StudyResults, data: StudyData) -> Figure:
    """Median and mean error when every N-th route view is remembered."""
    drawn, axes = canvas()
    table = results.tables["by_frequency"]
    curves = {
        "median": (table["median_error_deg"], ROUTE_COLOUR, "o-"),
        "mean": (table["mean_error_deg"], PATH_COLOUR, "s-"),
    }
    draw_lines(axes[0, 0], table["every"], curves)
    axes[0, 0].set_xlabel(EVERY_NTH)
    legend_above(axes[0, 0])
    return drawn


@figure("15, 7.2", "frequency", "The same as box plots")
def _frequency_boxes(results: StudyResults, data: StudyData) -> Figure:
    """Quartiles (boxes), values within 1.5 box lengths of them (whiskers), medians (lines) and means (dots)."""
    drawn, axes = canvas()
    _draw_error_boxes(axes[0, 0], results.tables["by_frequency"], "every")
    axes[0, 0].set_xlabel(EVERY_NTH)
    label_errors(axes[0, 0])
    return drawn


@figure("16", "resolution", "Error against the resize factor")
def _by_factor(results: StudyResults, data: StudyData) -> Figure:
    """Median error when views are sampled, as cv2.resize does by default (with and without Gaussian smoothing of {smoothing_px:g}
    pixels before), when they are averaged instead, and the thesis's numbers (dashed)."""
    drawn, axes = canvas()
    axis, table = axes[0, 0], results.tables["by_factor"]
    for smoothed, colour, name in ((False, PATH_COLOUR, "sampled"), (True, ROUTE_COLOUR, "sampled, smoothed")):
        rows = table[(table["resizing"] == "sampled") & (table["smoothed"] == smoothed)]
        thesis = rows["published_median_error_deg"]
        axis.plot(rows["factor"], thesis, "--", color=colour, lw=1, label=f"{name} (thesis)")
        draw_lines(axis, rows["factor"], {name: (rows["median_error_deg"], colour, "o-")})
    rows = table[(table["resizing"] == "averaged") & ~table["smoothed"]]
    draw_lines(axis, rows["factor"], {"averaged": (rows["median_error_deg"], GOOD_COLOUR, "s-")})
    axis.set_xlabel("resize factor")
    legend_above(axis)
    return drawn


@figure("7.3", "resolution", "The same as box plots and means")
def _factor_boxes(results: StudyResults, data: StudyData) -> Figure:
    """Left: views sampled without (red) and with smoothing (blue). Right: mean errors, and those of the thesis (dashed)."""
    drawn, axes = canvas(WIDE, 1, 2)
    table = results.tables["by_factor"]
    for smoothed, colour, name in ((False, PATH_COLOUR, "sampled"), (True, ROUTE_COLOUR, "smoothed")):
        rows = table[(table["resizing"] == "sampled") & (table["smoothed"] == smoothed)]
        _draw_error_boxes(axes[0, 0], rows, "factor", colour, shift=0.2 if smoothed else -0.2, width=0.35)
        axes[0, 1].plot(rows["factor"], rows["published_mean_error_deg"], "--", color=colour, lw=1)
        means = {name: (rows["mean_error_deg"], colour, "o-")}
        draw_lines(axes[0, 1], rows["factor"], means, ylabel="mean error (degrees)")
    label_errors(axes[0, 0])
    for axis in axes[0]:
        axis.set_xlabel("resize factor")
    legend_above(axes[0, 1])
    return drawn


@figure("18", "resolution", "Preprocessing")
def _preprocessing(results: StudyResults, data: StudyData) -> Figure:
    """A view before and after: grey, smoothed, resized by the factor that the thesis chose (6)."""
    drawn, axes = canvas((7.2, 3.4), 2, 1)
    view = data.route_views[len(data.route_views) // 2]
    draw_panorama(axes[0, 0], view, "before")
    draw_panorama(axes[1, 0], ENCODING(view[None])[0].numpy(), str(ENCODING))
    axes[0, 0].set_xlabel("")
    return drawn


def _draw_error_boxes(
    axes: Axes, table: pd.DataFrame, position: str, colour: str = ROUTE_COLOUR, shift: float = 0.0, width: float = 0.6
) -> None:
    """Draw box plots of heading errors, medians as lines and means as dots.

    Args:
        axes: Where to draw.
        table: One box per row, with the columns of `box_of` (degrees).
        position: Column of the boxes' positions.
        colour: Colour of the boxes.
        shift: Added to each position.
        width: Width of a box.
    """
    keys = {
        "med": "median_error_deg",
        "q1": "lower_quartile_deg",
        "q3": "upper_quartile_deg",
        "whislo": "lower_whisker_deg",
        "whishi": "upper_whisker_deg",
        "mean": "mean_error_deg",
    }
    stats = [{key: row[column] for key, column in keys.items()} | {"fliers": []} for _, row in table.iterrows()]
    axes.bxp(
        stats,
        positions=table[position] + shift,
        widths=width,
        showfliers=False,
        showmeans=True,
        patch_artist=True,
        manage_ticks=False,
        boxprops={"facecolor": colour + "33", "edgecolor": colour},
        medianprops={"color": colour, "lw": 1.8},
        whiskerprops={"color": colour},
        capprops={"color": colour},
        meanprops={"marker": "o", "markerfacecolor": colour, "markeredgecolor": "white", "markersize": 4},
    )
