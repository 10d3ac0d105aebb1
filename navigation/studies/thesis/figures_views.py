"""Figures of the world, its views, and one snapshot as a compass. Drawn from findings alone."""

import numpy as np
from matplotlib.figure import Figure

from ...evaluation import RECOVERED_DEG
from ...reports.findings import Findings
from ...reports.plots import CURVE_COLOUR, PATH_COLOUR, ROUTE_COLOUR
from .drawing import GOOD_COLOUR, TALL, WIDE, around_circle, arrows, canvas, draw_route, nothing, panorama, plan, plans
from .material import Material
from .pictures import picture


@picture(
    "4", "setting", "The world from above",
    """The grid of {grid_views} places where views are taken (dots; the thesis has {grid_views_published}) and the route,
    {route_length_m:.1f} m long.""",
)  # fmt: skip
def _world(found: Findings, material: Material) -> Figure:
    figure, axes = plans(material.grid)
    axes[0, 0].plot(*material.grid.T, ".", color=PATH_COLOUR, ms=1.6, alpha=0.7)
    draw_route(axes[0, 0], material.route)
    plan(axes[0, 0], material.world, np.vstack([material.grid, material.route.xy]), 0.2, faint=False)
    return figure


@picture("5", "setting", "A view", "What an eye sees at the middle of the route, facing along it: {panorama} pixels.")
def _view(found: Findings, material: Material) -> Figure:
    figure, axes = canvas((7.2, 2.0))
    panorama(axes[0, 0], material.route_views[len(material.route_views) // 2])
    return figure


@picture(
    "6", "visual-compass", "The image difference function",
    """Root-mean-square difference (grey levels) between one route view and views at the same place, nearby and far away, at every
    rotation. At the same place it is zero, nearby it has a distinct minimum, far away none to rely on.""",
)  # fmt: skip
def _idf(found: Findings, material: Material) -> Figure:
    figure, axes = canvas(WIDE, 1, 3, sharey=True)
    curves = found.tables["idf"]
    shown = curves[curves["reference"] == found.numbers["reference_shown"]]
    for axis, (name, curve) in zip(axes[0], shown.groupby("view", sort=False), strict=True):
        around_circle(axis, curve["degrees_off"], curve["rms"])
        axis.set_title({"same": "the same place"}.get(str(name), f"{name}, {curve['distance_m'].iloc[0]:.2f} m away"))
        axis.set_ylim(bottom=0)
        axis.set_xlabel("")
    axes[0, 0].set_ylabel("RMS difference")
    figure.supxlabel("degrees left of the reference's heading", fontsize=9)
    return figure


@picture(
    "7, 8", "visual-compass", "Headings around one view",
    """Headings recovered within 0.5 m of one route view (blue). The longer an arrow, the more alike the views; red ones are
    over 45 degrees off.""",
)  # fmt: skip
def _headings_around(found: Findings, material: Material) -> Figure:
    around = found.tables["around"]
    table = around[around["reference"] == found.numbers["reference_shown"]]
    figure, axes = plans(table[["x_m", "y_m"]].to_numpy())
    axis = axes[0, 0]
    length = 0.05 + 0.2 * (table["rms"].max() - table["rms"]) / max(1e-9, np.ptp(table["rms"]))
    colours = np.where(table["error_deg"] < RECOVERED_DEG, GOOD_COLOUR, PATH_COLOUR)
    arrows(axis, table["x_m"], table["y_m"], table["heading_deg"], colours, length)
    first = table.iloc[0]
    arrows(axis, [first["reference_x_m"]], [first["reference_y_m"]], [first["set_heading_deg"]], ROUTE_COLOUR, 0.25)
    plan(axis, material.world, table[["x_m", "y_m"]].to_numpy())
    return figure


@picture(
    "9", "visual-compass", "A place that looks alike in several directions",
    """Image differences at two neighbouring places from the same route view. Left: one distinct minimum. Right: several, and the
    deepest is not the right one. {share_of_failures_with_several_minima:.0%} of the failures around the reference views have
    several minima.""",
)  # fmt: skip
def _ambiguous(found: Findings, material: Material) -> Figure:
    table = found.tables["ambiguous"]
    figure, axes = canvas(WIDE, 1, 2, sharey=True)
    if not len(table):
        return nothing("no heading failed here for want of a single minimum")
    for axis, (_, curve) in zip(axes[0], table.groupby("view", sort=False), strict=True):
        around_circle(axis, curve["degrees_off"], curve["rms"])
        row = curve.iloc[0]
        axis.set_title(
            f"({row['x_m']:.1f}, {row['y_m']:.1f}) m: {row['minima']:.0f} minima, {row['error_deg']:.0f}° off",
            fontsize=9,
        )
    axes[0, 0].set_ylabel("RMS difference")
    return figure


@picture(
    "10", "visual-compass", "A place behind something",
    "The failed place whose view is covered the most: what it sees, what the route view sees, and the image difference between the two.",
)  # fmt: skip
def _occluded(found: Findings, material: Material) -> Figure:
    table = found.tables["occluded"]
    if not len(table):
        return nothing("no heading failed here")
    row = table.iloc[0]
    figure, axes = canvas(TALL, 3, 1)
    panorama(axes[0, 0], material.place_views[int(row["place"])], f"the place: {row['covered']:.0%} covered")
    known = material.route_views[int(row["reference"])]
    panorama(
        axes[1, 0], known, f"the route view, {row['distance_m']:.2f} m away: {row['reference_covered']:.0%} covered"
    )
    around_circle(axes[2, 0], table["degrees_off"], table["rms"])
    axes[2, 0].set(ylabel="RMS difference", xlim=(180, -180))  # left on the left, as in the panoramas
    axes[2, 0].set_title(f"{row['error_deg']:.0f}° off", fontsize=9)
    for axis in axes[:2, 0]:
        axis.set_xlabel("")
    return figure


@picture(
    "11", "visual-compass", "Error against distance",
    "Heading errors around three reference views (dots) and the median over all twelve (line), in rings of 0.1 m.",
)  # fmt: skip
def _error_by_distance(found: Findings, material: Material) -> Figure:
    figure, axes = canvas()
    axis, around, rings = axes[0, 0], found.tables["around"], found.tables["by_distance"]
    references = around["reference"].unique()
    for reference, colour in zip(
        references[[0, len(references) // 2, -1]], (ROUTE_COLOUR, PATH_COLOUR, GOOD_COLOUR), strict=True
    ):
        table = around[around["reference"] == reference]
        axis.plot(table["distance_m"], table["error_deg"], "o", ms=3.5, color=colour, alpha=0.8)
    axis.plot(rings["from_m"] + 0.05, rings["median_error_deg"], "-", color=CURVE_COLOUR, lw=2)
    axis.set(
        xlabel="distance from the reference view (m)",
        ylabel="error (degrees)",
        ylim=(-4, 184),
        yticks=range(0, 181, 45),
    )
    return figure
