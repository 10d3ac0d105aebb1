"""Figures of confidence, training time and scans, and of what goes beyond the thesis."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ...reports.drawing import GOOD_COLOUR, PATH_COLOUR, ROUTE_COLOUR, WIDE, canvas, draw_over_circle, legend_above
from ...reports.results import StudyResults
from .heading_maps import draw_heading_map, heading_maps
from .items import figure
from .study_data import StudyData


@figure("33", "confidence", "Confidence after a short and a long training")
def _training_time(results: StudyResults, data: StudyData) -> Figure:
    """At a position whose heading is recovered, after {iterations[0]:,} and {iterations[1]:,} iterations."""
    return _curves(results, [("recovered", n, f"{n:,} iterations") for n in results.numbers["iterations"]])


@figure("34", "confidence", "Headings after a short and a long training")
def _short_and_long(results: StudyResults, data: StudyData) -> Figure:
    """After {iterations[0]:,} (left) and {iterations[1]:,} iterations (right)."""
    short, long = results.numbers["iterations"]
    titles = {"headings_short": f"{short:,} iterations", "headings_long": f"{long:,} iterations"}
    return heading_maps(results.tables, data, titles)


@figure("35, 36", "confidence", "A heading recovered, a heading reversed")
def _reversed(results: StudyResults, data: StudyData) -> Figure:
    """The positions near straights with the smallest and the largest heading error (circled), and the confidence at every rotation
    there. The network was not trained on views behind it."""
    drawn, axes = canvas((7.2, 3.8), 1, 2, width_ratios=(1, 1.6))
    table = results.tables["headings_long"]
    draw_heading_map(axes[0, 0], table, data)
    for name, colour in (("recovered", GOOD_COLOUR), ("reversed", PATH_COLOUR)):
        row = table[table["place"] == results.numbers[f"place_{name}"]].iloc[0]
        axes[0, 0].plot(row["x_m"], row["y_m"], "o", ms=16, mfc="none", mec=colour, mew=1.8, zorder=5)
        curve = _curve(results, name, results.numbers["iterations"][1])
        draw_over_circle(axes[0, 1], curve["degrees_off"], curve["confidence"], name, colour)
    axes[0, 1].set_ylabel("confidence")
    legend_above(axes[0, 1])
    return drawn


@figure("37, 38", "confidence", "Scans about the general direction")
def _narrow_scans(results: StudyResults, data: StudyData) -> Figure:
    """Headings from scans of 360, 180 and 90 degrees about the direction from start to goal ({general_direction_deg:.0f} degrees)."""
    titles = {"headings_long": "360 degrees", "headings_scan_180": "180 degrees", "headings_scan_90": "90 degrees"}
    return heading_maps(results.tables, data, titles)


@figure("39", "confidence", "What a narrower scan leaves out")
def _left_out(results: StudyResults, data: StudyData) -> Figure:
    """Confidence at the position with the largest error; the rotations of a scan of 180 degrees about the general direction are
    shaded."""
    drawn = _curves(results, [("reversed", results.numbers["iterations"][1], "")])
    set_heading = np.degrees(data.set_headings[results.numbers["place_reversed"]])
    middle = results.numbers["general_direction_deg"] - set_heading
    for turn in (-360, 0, 360):
        drawn.axes[0].axvspan(middle + turn - 90, middle + turn + 90, color=GOOD_COLOUR, alpha=0.15, lw=0)
    return drawn


@figure("beyond", "beyond", "Step by step from the thesis's network")
def _beyond(results: StudyResults, data: StudyData) -> Figure:
    """Median error over the full circle (bars), in corners and on straights (dots)."""
    table = results.tables["by_model"].iloc[::-1]
    drawn, axes = canvas((7.2, 4.2))
    axis, rows = axes[0, 0], np.arange(len(table))
    axis.barh(rows, table["median_error_deg"], color=ROUTE_COLOUR + "55", height=0.7)
    axis.plot(table["median_error_deg_corners"], rows, "o", color=PATH_COLOUR, ms=4, label="in corners")
    axis.plot(table["median_error_deg_straights"], rows, "o", color=GOOD_COLOUR, ms=4, label="on straights")
    axis.set_yticks(rows, [f"{row.model}, {row.encoding}, {row.views}" for row in table.itertuples()])
    axis.set_xlabel("median error (degrees)")
    axis.set_xlim(left=0)
    legend_above(axis)
    return drawn


@figure("beyond headings", "beyond", "The same positions, the full circle")
def _beyond_headings(results: StudyResults, data: StudyData) -> Figure:
    """Headings of the thesis's classifier (left) and of mlp-rotation on edges (right), both over 360 degrees."""
    titles = {
        "headings, mlp, grey, every 6th": "the thesis's classifier",
        "headings, mlp-rotation, edges, every 6th": "mlp-rotation, edges",
    }
    return heading_maps(results.tables, data, titles)


def _curves(results: StudyResults, chosen: list[tuple[str, int, str]]) -> Figure:
    """Confidence curves side by side. chosen: position, iterations and title of each."""
    drawn, axes = canvas(WIDE, 1, len(chosen), sharey=True)
    for axis, (position, iterations, title) in zip(axes[0], chosen, strict=True):
        curve = _curve(results, position, iterations)
        draw_over_circle(axis, curve["degrees_off"], curve["confidence"])
        axis.set_title(title)
    axes[0, 0].set_ylabel("confidence")
    return drawn


def _curve(results: StudyResults, position: str, iterations: int) -> pd.DataFrame:
    table = results.tables["curves"]
    return table[(table["place"] == position) & (table["iterations"] == iterations)]
