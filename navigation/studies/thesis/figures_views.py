"""Figures of the world, its views, and one snapshot as a compass."""

import numpy as np
from matplotlib.figure import Figure

from ...evaluation import RECOVERED_DEG
from ...reports.drawing import (
    CURVE_COLOUR,
    GOOD_COLOUR,
    PATH_COLOUR,
    ROUTE_COLOUR,
    TALL,
    WIDE,
    canvas,
    draw_over_circle,
    draw_panorama,
    empty_figure,
    from_zero,
    label_errors,
)
from ...reports.maps import draw_arrows, draw_map, draw_route, map_axes
from ...reports.results import StudyResults
from .items import figure
from .study_data import StudyData


@figure("4", "setting", "The world from above")
def _world(results: StudyResults, data: StudyData) -> Figure:
    """The grid of {grid_views} positions where views are taken (dots; the thesis has {grid_views_published}) and the route,
    {route_length_m:.1f} m long."""
    drawn, axes = map_axes(data.grid)
    axes[0, 0].plot(*data.grid.T, ".", color=PATH_COLOUR, ms=1.6, alpha=0.7)
    draw_route(axes[0, 0], data.route)
    draw_map(axes[0, 0], data.world, np.vstack([data.grid, data.route.xy]), 0.2, faint=False)
    return drawn


@figure("5", "setting", "A view")
def _view(results: StudyResults, data: StudyData) -> Figure:
    """The view from the middle of the route, facing along it: {panorama} pixels."""
    drawn, axes = canvas((7.2, 2.0))
    draw_panorama(axes[0, 0], data.route_views[len(data.route_views) // 2])
    return drawn


@figure("6", "visual-compass", "The image difference function")
def _image_differences(results: StudyResults, data: StudyData) -> Figure:
    """Root-mean-square difference (grey levels) between one route view and views at the same position, nearby and far away, at
    every rotation. At the same position it is zero; nearby it has a distinct minimum; far away it has no reliable one."""
    drawn, axes = canvas(WIDE, 1, 3, sharey=True)
    curves = results.tables["idf"]
    shown = curves[curves["reference"] == results.numbers["reference_shown"]]
    for axis, (name, curve) in zip(axes[0], shown.groupby("view", sort=False), strict=True):
        draw_over_circle(axis, curve["degrees_off"], curve["rms"])
        away = f"{name}, {curve['distance_m'].iloc[0]:.2f} m away"
        axis.set_title("the same position" if name == "same" else away)
        from_zero(axis)
        axis.set_xlabel("")
    axes[0, 0].set_ylabel("RMS difference")
    drawn.supxlabel("degrees left of the reference's heading", fontsize="medium")
    return drawn


@figure("7, 8", "visual-compass", "Headings around one view")
def _headings_around(results: StudyResults, data: StudyData) -> Figure:
    """Headings recovered within 0.5 m of one route view (blue). The more similar the views, the longer the arrow; red arrows are
    over 45 degrees off."""
    around = results.tables["around"]
    table = around[around["reference"] == results.numbers["reference_shown"]]
    positions = table[["x_m", "y_m"]].to_numpy()
    drawn, axes = map_axes(positions)
    length = 0.05 + 0.2 * (table["rms"].max() - table["rms"]) / max(1e-9, np.ptp(table["rms"]))
    colours = np.where(table["error_deg"] < RECOVERED_DEG, GOOD_COLOUR, PATH_COLOUR)
    draw_arrows(axes[0, 0], table["x_m"], table["y_m"], table["heading_deg"], colours, length)
    first = table.iloc[0]
    reference = first[["reference_x_m", "reference_y_m", "set_heading_deg"]].to_numpy(float)
    draw_arrows(axes[0, 0], *reference[:, None], ROUTE_COLOUR, 0.25)
    draw_map(axes[0, 0], data.world, positions)
    return drawn


@figure("9", "visual-compass", "A position that looks similar in several directions")
def _ambiguous(results: StudyResults, data: StudyData) -> Figure:
    """Image differences at two neighbouring positions from the same route view. Left: one distinct minimum. Right: several, and the
    lowest is not the right one. {share_of_failures_with_several_minima:.0%} of the failures around the reference views have
    several minima."""
    table = results.tables["ambiguous"]
    if not len(table):
        return empty_figure("no heading failed here because of several minima")
    drawn, axes = canvas(WIDE, 1, 2, sharey=True)
    for axis, (_, curve) in zip(axes[0], table.groupby("view", sort=False), strict=True):
        draw_over_circle(axis, curve["degrees_off"], curve["rms"])
        row = curve.iloc[0]
        position = f"({row['x_m']:.1f}, {row['y_m']:.1f}) m"
        minima = "1 minimum" if row["minima"] == 1 else f"{row['minima']:.0f} minima"
        axis.set_title(f"{position}: {minima}, {row['error_deg']:.0f}° off")
    axes[0, 0].set_ylabel("RMS difference")
    return drawn


@figure("10", "visual-compass", "A position behind an object")
def _occluded(results: StudyResults, data: StudyData) -> Figure:
    """The failed position whose view is covered the most: its view, the route view, and the image difference between the two."""
    table = results.tables["occluded"]
    if not len(table):
        return empty_figure("no heading failed here")
    row = table.iloc[0]
    drawn, axes = canvas(TALL, 3, 1)
    title = f"the position: {row['covered']:.0%} covered"
    draw_panorama(axes[0, 0], data.grid_views[int(row["place"])], title)
    title = f"the route view, {row['distance_m']:.2f} m away: {row['reference_covered']:.0%} covered"
    draw_panorama(axes[1, 0], data.route_views[int(row["reference"])], title)
    draw_over_circle(axes[2, 0], table["degrees_off"], table["rms"])
    axes[2, 0].set(ylabel="RMS difference", xlim=(180, -180))  # left on the left, as in the panoramas
    axes[2, 0].set_title(f"{row['error_deg']:.0f}° off")
    for axis in axes[:2, 0]:
        axis.set_xlabel("")
    return drawn


@figure("11", "visual-compass", "Error against distance")
def _error_by_distance(results: StudyResults, data: StudyData) -> Figure:
    """Heading errors around three reference views (dots), and the median over all twelve in rings of 0.1 m (line)."""
    drawn, axes = canvas()
    axis, around, rings = axes[0, 0], results.tables["around"], results.tables["by_distance"]
    references = around["reference"].unique()
    shown = references[[0, len(references) // 2, -1]]
    for reference, colour in zip(shown, (ROUTE_COLOUR, PATH_COLOUR, GOOD_COLOUR), strict=True):
        table = around[around["reference"] == reference]
        axis.plot(table["distance_m"], table["error_deg"], "o", ms=3.5, color=colour, alpha=0.8)
    axis.plot(rings["from_m"] + 0.05, rings["median_error_deg"], "-", color=CURVE_COLOUR, lw=2)
    axis.set_xlabel("distance from the reference view (m)")
    label_errors(axis)
    return drawn
