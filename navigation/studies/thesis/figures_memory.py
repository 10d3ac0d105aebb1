"""Figures of perfect memory: frequency, resolution and preprocessing. Drawn from findings alone."""

import numpy as np
from matplotlib.figure import Figure

from ...reports.findings import Findings
from ...reports.plots import CURVE_COLOUR, PATH_COLOUR, ROUTE_COLOUR
from .drawing import GOOD_COLOUR, SOFT_COLOUR, WIDE, boxes, canvas, diagrams, draw_route, lines, panorama, plan, plans
from .material import Material
from .pictures import picture
from .settings import ENCODING


@picture(
    "12", "frequency", "Headings along the route, perfect memory",
    "Recovered headings at the {places} grid places within 0.2 m of the route, every route view remembered.",
)  # fmt: skip
def _perfect_memory(found: Findings, material: Material) -> Figure:
    return diagrams(found.tables, material.route, material.world, {"headings": ""})


@picture(
    "13",
    "frequency",
    "Place recognition",
    "Each grid place is compared with the route view nearest to it; its heading is the set one.",
)
def _place_recognition(found: Findings, material: Material) -> Figure:
    figure, axes = plans(material.route.xy)
    axis, table = axes[0, 0], found.tables["headings"]
    draw_route(axis, material.route)
    nearest = material.route.xy[table["nearest_view"]]
    xy = table[["x_m", "y_m"]].to_numpy()
    axis.plot(*np.stack([xy, nearest], axis=1).T, color=SOFT_COLOUR, lw=0.9, zorder=1)
    axis.plot(*xy.T, "o", ms=3, color=CURVE_COLOUR)
    plan(axis, material.world, np.vstack([xy, nearest]))
    return figure


@picture(
    "14",
    "frequency",
    "Error against how many views are remembered",
    "One route view in so many is remembered. Median and mean error.",
)
def _by_frequency(found: Findings, material: Material) -> Figure:
    figure, axes = canvas()
    table = found.tables["by_frequency"]
    lines(axes[0, 0], table["every"], {
        "median": (table["median_error_deg"], ROUTE_COLOUR, "o-"), "mean": (table["mean_error_deg"], PATH_COLOUR, "s-"),
    })  # fmt: skip
    axes[0, 0].set_xlabel("one view in so many is remembered")
    return figure


@picture(
    "15, 7.2", "frequency", "The same, as box plots",
    "Quartiles (boxes), values within 1.5 boxes of them (whiskers), medians (lines) and means (dots).",
)  # fmt: skip
def _frequency_boxes(found: Findings, material: Material) -> Figure:
    figure, axes = canvas()
    boxes(axes[0, 0], found.tables["by_frequency"], "every")
    axes[0, 0].set(
        xlabel="one view in so many is remembered", ylabel="error (degrees)", ylim=(0, 180), yticks=range(0, 181, 45)
    )
    return figure


@picture(
    "16", "resolution", "Error against the resize factor",
    """Median error when views are sampled, as cv2.resize does by default (with and without Gaussian smoothing of {smoothing_px:g} pixels
    before), when they are averaged instead, and the thesis's numbers (dashed).""",
)  # fmt: skip
def _by_factor(found: Findings, material: Material) -> Figure:
    figure, axes = canvas()
    table = found.tables["by_factor"]
    for smoothed, colour, name in ((False, PATH_COLOUR, "sampled"), (True, ROUTE_COLOUR, "sampled, smoothed")):
        rows = table[(table["resizing"] == "sampled") & (table["smoothed"] == smoothed)]
        axes[0, 0].plot(
            rows["factor"], rows["published_median_error_deg"], "--", color=colour, lw=1, label=f"{name} (thesis)"
        )
        lines(axes[0, 0], rows["factor"], {name: (rows["median_error_deg"], colour, "o-")})
    rows = table[(table["resizing"] == "averaged") & ~table["smoothed"]]
    lines(axes[0, 0], rows["factor"], {"averaged": (rows["median_error_deg"], GOOD_COLOUR, "s-")})
    axes[0, 0].set_xlabel("resize factor")
    return figure


@picture(
    "7.3", "resolution", "The same, as box plots and means",
    "Left: views sampled without (red) and with smoothing (blue). Right: mean errors beside the thesis's (dashed).",
)  # fmt: skip
def _factor_boxes(found: Findings, material: Material) -> Figure:
    figure, axes = canvas(WIDE, 1, 2)
    table = found.tables["by_factor"]
    for smoothed, colour, name in ((False, PATH_COLOUR, "sampled"), (True, ROUTE_COLOUR, "smoothed")):
        rows = table[(table["resizing"] == "sampled") & (table["smoothed"] == smoothed)]
        boxes(axes[0, 0], rows, "factor", colour, shift=0.2 if smoothed else -0.2, width=0.35)
        axes[0, 1].plot(rows["factor"], rows["published_mean_error_deg"], "--", color=colour, lw=1)
        lines(axes[0, 1], rows["factor"], {name: (rows["mean_error_deg"], colour, "o-")}, ylabel="mean error (degrees)")
    axes[0, 0].set(xlabel="resize factor", ylabel="error (degrees)", ylim=(0, 180), yticks=range(0, 181, 45))
    axes[0, 1].set_xlabel("resize factor")
    return figure


@picture(
    "18",
    "resolution",
    "Preprocessing",
    "A view before and after: grey, smoothed, resized by the factor that the thesis chose (6).",
)
def _preprocessing(found: Findings, material: Material) -> Figure:
    figure, axes = canvas((7.2, 3.4), 2, 1)
    view = material.route_views[len(material.route_views) // 2]
    panorama(axes[0, 0], view, "before")
    panorama(axes[1, 0], ENCODING(view[None])[0].numpy(), str(ENCODING))
    axes[0, 0].set_xlabel("")
    return figure
