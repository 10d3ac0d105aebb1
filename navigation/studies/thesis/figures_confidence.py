"""Figures of confidence, training time and scans, and of what goes beyond the thesis. Drawn from findings alone."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ...reports.findings import Findings
from ...reports.plots import PATH_COLOUR, ROUTE_COLOUR
from .drawing import GOOD_COLOUR, WIDE, around_circle, canvas, diagrams, heading_diagram
from .material import Material
from .pictures import picture


@picture(
    "33", "confidence", "Confidence after a short and a long training",
    "At a place whose heading is recovered, after {iterations[0]:,} and {iterations[1]:,} iterations.",
)  # fmt: skip
def _training_time(found: Findings, material: Material) -> Figure:
    return _curves(
        found, [("recovered", iterations, f"{iterations:,} iterations") for iterations in found.numbers["iterations"]]
    )


@picture(
    "34",
    "confidence",
    "Headings after a short and a long training",
    "After {iterations[0]:,} (left) and {iterations[1]:,} iterations (right).",
)
def _short_and_long(found: Findings, material: Material) -> Figure:
    short, long = found.numbers["iterations"]
    names = {"headings_short": f"{short:,} iterations", "headings_long": f"{long:,} iterations"}
    return diagrams(found.tables, material.route, material.world, names)


@picture(
    "35, 36", "confidence", "A heading recovered, a heading lost",
    """The places beside straights whose headings are the least and the most off (circled), and the confidence at every rotation
    there. The network was never taught what lies behind.""",
)  # fmt: skip
def _reversed(found: Findings, material: Material) -> Figure:
    figure, axes = canvas((7.2, 6.0), 1, 2, width_ratios=(1, 1.6))
    table = found.tables["headings_long"]
    heading_diagram(axes[0, 0], table, material.route, material.world)
    for name, colour in (("recovered", GOOD_COLOUR), ("reversed", PATH_COLOUR)):
        row = table[table["place"] == found.numbers[f"place_{name}"]].iloc[0]
        axes[0, 0].plot(row["x_m"], row["y_m"], "o", ms=16, mfc="none", mec=colour, mew=1.8, zorder=5)
        curve = _curve(found, name, found.numbers["iterations"][1])
        around_circle(axes[0, 1], curve["degrees_off"], curve["confidence"], name, colour)
    axes[0, 1].set_ylabel("confidence")
    axes[0, 1].legend(frameon=False, fontsize=8)
    return figure


@picture(
    "37, 38", "confidence", "Scans about the general direction",
    "Headings from scans of 360, 180 and 90 degrees about the direction from start to goal ({general_direction_deg:.0f} degrees).",
)  # fmt: skip
def _narrow_scans(found: Findings, material: Material) -> Figure:
    names = {"headings_long": "360 degrees", "headings_scan_180": "180 degrees", "headings_scan_90": "90 degrees"}
    return diagrams(found.tables, material.route, material.world, names)


@picture(
    "39", "confidence", "What a narrower scan leaves out",
    """Confidence at the place that is the most off; the shaded rotations are those that a scan of 180 degrees about the general
    direction looks at.""",
)  # fmt: skip
def _left_out(found: Findings, material: Material) -> Figure:
    figure = _curves(found, [("reversed", found.numbers["iterations"][1], "")])
    axis = figure.axes[0]
    middle = found.numbers["general_direction_deg"] - np.degrees(material.wanted[found.numbers["place_reversed"]])
    for turn in (-360, 0, 360):
        axis.axvspan(middle + turn - 90, middle + turn + 90, color=GOOD_COLOUR, alpha=0.15, lw=0)
    return figure


@picture(
    "beyond", "beyond", "Step by step from the thesis's network",
    "Median error over the full circle (bars), in corners and on straights (dots).",
)  # fmt: skip
def _beyond(found: Findings, material: Material) -> Figure:
    table = found.tables["by_model"].iloc[::-1]
    figure, axes = canvas((7.2, 4.2))
    axis, at = axes[0, 0], np.arange(len(table))
    axis.barh(at, table["median_error_deg"], color=ROUTE_COLOUR + "55", height=0.7)
    axis.plot(table["median_error_deg_corners"], at, "o", color=PATH_COLOUR, ms=4, label="in corners")
    axis.plot(table["median_error_deg_straights"], at, "o", color=GOOD_COLOUR, ms=4, label="on straights")
    axis.set_yticks(at, [f"{row.model}, {row.encoding}, {row.views}" for row in table.itertuples()])
    axis.set(xlabel="median error (degrees)", xlim=(0, 180), xticks=range(0, 181, 45))
    axis.legend(frameon=False, fontsize=8)
    return figure


@picture(
    "beyond headings", "beyond", "The same places, the full circle",
    "Headings of the thesis's classifier (left) and of mlp-rotation on edges (right), both over 360 degrees.",
)  # fmt: skip
def _beyond_headings(found: Findings, material: Material) -> Figure:
    names = {
        "headings, mlp, grey, every 6th": "the thesis's classifier",
        "headings, mlp-rotation, edges, every 6th": "mlp-rotation, edges",
    }
    return diagrams(found.tables, material.route, material.world, names)


def _curves(found: Findings, chosen: list[tuple[str, int, str]]) -> Figure:
    """Confidence curves side by side: place, iterations, title."""
    figure, axes = canvas(WIDE, 1, len(chosen), sharey=True)
    for axis, (place, iterations, title) in zip(axes[0], chosen, strict=True):
        curve = _curve(found, place, iterations)
        around_circle(axis, curve["degrees_off"], curve["confidence"])
        axis.set_title(title)
    axes[0, 0].set_ylabel("confidence")
    return figure


def _curve(found: Findings, place: str, iterations: int) -> pd.DataFrame:
    table = found.tables["curves"]
    return table[(table["place"] == place) & (table["iterations"] == iterations)]
