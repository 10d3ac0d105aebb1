"""Figures of the classifier, and of corners."""

import numpy as np
from matplotlib.figure import Figure

from ...reports.drawing import (
    CURVE_COLOUR,
    PATH_COLOUR,
    ROUTE_COLOUR,
    SOFT_COLOUR,
    WIDE,
    canvas,
    empty_figure,
    from_zero,
)
from ...reports.maps import draw_arrows, draw_map, draw_route, map_axes
from ...reports.results import StudyResults
from .corners import EVERY_6TH, MORE_IN_CORNERS
from .heading_maps import draw_heading_map, heading_maps
from .items import figure
from .study_data import StudyData


@figure("17, 23", "classifier", "Views learned and held out")
def _uses_of_views(results: StudyResults, data: StudyData) -> Figure:
    """Every 6th route view is learned (blue); the views half-way between every second pair of these are held out to test the
    classifier (red)."""
    drawn, axes = map_axes(data.route.xy)
    table = results.tables["training"]
    for use, colour in (("not used", SOFT_COLOUR), ("learned", ROUTE_COLOUR), ("held out", PATH_COLOUR)):
        rows = table[table["use"] == use]
        axes[0, 0].plot(rows["x_m"], rows["y_m"], "o", ms=1.5 if use == "not used" else 3.5, color=colour, label=use)
    axes[0, 0].legend(fontsize="small")
    draw_map(axes[0, 0], data.world, data.route.xy)
    return drawn


@figure("19", "classifier", "Views on and off the route")
def _on_and_off(results: StudyResults, data: StudyData) -> Figure:
    """For each learned view along the route (blue), one turned by 60 degrees, alternately to the left and to the right (red)."""
    table = results.tables["training"]
    rows = table[table["use"] == "learned"].head(20)
    positions = rows[["x_m", "y_m"]].to_numpy()
    drawn, axes = map_axes(positions)
    side = np.where(np.arange(len(rows)) % 2 == 0, -60, 60)
    draw_arrows(axes[0, 0], *positions.T, rows["heading_deg"], ROUTE_COLOUR)
    draw_arrows(axes[0, 0], *positions.T, rows["heading_deg"] + side, PATH_COLOUR)
    draw_map(axes[0, 0], data.world, positions)
    return drawn


@figure("21, 22", "classifier", "One view learned")
def _one_view(results: StudyResults, data: StudyData) -> Figure:
    """Confidence of a network that learned one view and one turned copy of it, at the grid position nearest to it:
    {one_place_error_deg:.2f} degrees off (thesis: 0.35)."""
    drawn, axes = canvas(WIDE, 1, 2, width_ratios=(2, 1))
    table = results.tables["one_place"]
    axes[0, 0].plot(table["turn_deg"], table["confidence"], color=CURVE_COLOUR, lw=1.2)
    axes[0, 0].set(xlabel="degrees turned left", ylabel="confidence", xlim=(0, 360), xticks=range(0, 361, 90))
    row = table.iloc[0]
    x, y, heading = data.route.poses[int(row["nearest_view"])]
    draw_arrows(axes[0, 1], [x], [y], [np.degrees(heading)], ROUTE_COLOUR)
    draw_arrows(axes[0, 1], [row["x_m"]], [row["y_m"]], [row["heading_deg"]], PATH_COLOUR)
    draw_map(axes[0, 1], data.world, np.array([(x, y), (row["x_m"], row["y_m"])]), 0.25)
    return drawn


@figure("25", "classifier", "Headings after 20 views")
def _first_20(results: StudyResults, data: StudyData) -> Figure:
    """The classifier (left) and perfect memory (right) after the route's first 20 learned views. Median error of the classifier:
    {median_error_deg_first_20:.1f} degrees (thesis: about 4)."""
    titles = {"headings_first_20": "classifier", "perfect_memory_first_20": "perfect memory"}
    return heading_maps(results.tables, data, titles)


@figure("27, 28", "classifier", "Headings after the whole route")
def _whole_route(results: StudyResults, data: StudyData) -> Figure:
    """The classifier (left) and perfect memory (right) after the same views. Median error of the classifier:
    {median_error_deg_whole_route:.1f} degrees (thesis: about 45)."""
    titles = {"headings_whole_route": "classifier", "perfect_memory_whole_route": "perfect memory"}
    return heading_maps(results.tables, data, titles)


@figure("29", "corners", "The section with corners")
def _section(results: StudyResults, data: StudyData) -> Figure:
    """The two neighbouring corners that turn the most (red: corners; dark: the section around them)."""
    drawn, axes = map_axes(data.route.xy)
    first, last = results.numbers["section_first_view"], results.numbers["section_last_view"]
    table = results.tables["selections"]
    corners = table[table["in_corner"]]
    draw_route(axes[0, 0], data.route)
    axes[0, 0].plot(*data.route.xy[first : last + 1].T, color=CURVE_COLOUR, lw=4, alpha=0.5)
    axes[0, 0].plot(corners["x_m"], corners["y_m"], ".", color=PATH_COLOUR, ms=4, zorder=3)
    draw_map(axes[0, 0], data.world, data.route.xy)
    return drawn


@figure("30", "corners", "How fast views change")
def _change(results: StudyResults, data: StudyData) -> Figure:
    """RMS difference between successive learned views along the route (line), and how much the route turns there (red); the section
    is shaded."""
    drawn, axes = canvas()
    axis, table = axes[0, 0], results.tables["change"]
    axis.plot(table["along_m"], table["rms"], "o-", ms=3, color=CURVE_COLOUR, lw=1.2)
    axis.set(xlabel="along the route (m)", ylabel="RMS difference (grey levels)")
    from_zero(axis)
    other = axis.twinx()
    other.fill_between(table["along_m"], table["turning_deg"], color=PATH_COLOUR, alpha=0.2, lw=0)
    other.set_ylabel("turning (degrees)", color=PATH_COLOUR)
    from_zero(other)
    section = table.loc[table["in_section"], "along_m"]
    axis.axvspan(section.min(), section.max(), color="#00000010", lw=0)
    return drawn


@figure("31", "corners", "Twice as many views in the corners")
def _more_views(results: StudyResults, data: StudyData) -> Figure:
    """Views learned: every 6th (blue), and every 3rd in the corners of the section (red)."""
    drawn, axes = map_axes(data.route.xy)
    table = results.tables["selections"]
    added = table[table[MORE_IN_CORNERS] & ~table[EVERY_6TH]]
    for rows, colour in ((added, PATH_COLOUR), (table[table[EVERY_6TH]], ROUTE_COLOUR)):
        axes[0, 0].plot(rows["x_m"], rows["y_m"], "o", ms=3.5, color=colour)
    draw_map(axes[0, 0], data.world, data.route.xy)
    return drawn


@figure("32", "corners", "Before and after")
def _before_and_after(results: StudyResults, data: StudyData) -> Figure:
    """Headings near the section, after learning every 6th view (left) and twice as many in its corners (right)."""
    tables = {name: results.tables[f"headings, {name}"] for name in (EVERY_6TH, MORE_IN_CORNERS)}
    tables = {name: table[table["in_section"]] for name, table in tables.items()}
    if not len(tables[EVERY_6TH]):
        return empty_figure("no grid position lies near the section")
    drawn, axes = map_axes(tables[EVERY_6TH][["x_m", "y_m"]].to_numpy(), 2)
    for axis, (name, table) in zip(axes[0], tables.items(), strict=True):
        draw_heading_map(axis, table, data, name, whole_route=False)
    return drawn
