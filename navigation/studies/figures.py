"""The figures of the thesis, drawn from findings alone (and the world from above, where it is at hand)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ..plots import CURVE_COLOUR, PATH_COLOUR, ROUTE_COLOUR
from .drawing import (
    GOOD_COLOUR,
    SOFT_COLOUR,
    TALL,
    WIDE,
    around_circle,
    arrows,
    boxes,
    canvas,
    draw_route,
    heading_diagram,
    lines,
    look_at,
    panorama,
    plan,
    plans,
)
from .findings import Findings
from .headings import RECOVERED_DEG
from .material import Material
from .settings import Settings

Draw = Callable[[Findings, Material, Settings], Figure]


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A figure of the report. number: the thesis's, or a word. caption: may hold names of the study's numbers in braces."""

    number: str
    study: str
    title: str
    caption: str
    draw: Draw


PICTURES: list[Picture] = []


def picture(number: str, study: str, title: str, caption: str) -> Callable[[Draw], Draw]:
    """Add a drawing to the report, in the order they are written."""

    def add(draw: Draw) -> Draw:
        PICTURES.append(Picture(number=number, study=study, title=title, caption=" ".join(caption.split()), draw=draw))
        return draw

    return add


@picture(
    "4", "setting", "The world from above",
    "The grid of {grid_views} places where views are taken (dots; the thesis has {grid_views_published}) and the route, {route_length_m:.1f} m long.",
)  # fmt: skip
def _world(found: Findings, material: Material, settings: Settings) -> Figure:
    figure, axes = plans(material.grid)
    plan(axes[0, 0], material.world, faint=False)
    axes[0, 0].plot(*material.grid.T, ".", color=PATH_COLOUR, ms=1.6, alpha=0.7)
    draw_route(axes[0, 0], material.route)
    look_at(axes[0, 0], np.vstack([material.grid, material.route.xy]), 0.2)
    return figure


@picture("5", "setting", "A view", "What an eye sees at the middle of the route, facing along it: {panorama} pixels.")
def _view(found: Findings, material: Material, settings: Settings) -> Figure:
    figure, axes = canvas((7.2, 2.0))
    panorama(axes[0, 0], material.route_views[len(material.route_views) // 2])
    return figure


@picture(
    "6", "visual-compass", "The image difference function",
    """Root-mean-square difference (grey levels) between one route view and views at the same place, nearby and far away, at every
    rotation. At the same place it is zero, nearby it has a distinct minimum, far away none to rely on.""",
)  # fmt: skip
def _idf(found: Findings, material: Material, settings: Settings) -> Figure:
    figure, axes = canvas(WIDE, 1, 3, sharey=True)
    for axis, (name, curve) in zip(axes[0], found.tables["idf"].groupby("view", sort=False), strict=True):
        around_circle(axis, curve["degrees_off"], curve["rms"])
        axis.set_title({"same": "the same place"}.get(str(name), f"{name}, {curve['distance_m'].iloc[0]:.2f} m away"))
        axis.set_ylim(bottom=0)
        axis.set_xlabel("")
    axes[0, 0].set_ylabel("RMS difference")
    figure.supxlabel("degrees left of the reference's heading", fontsize=9)
    return figure


@picture(
    "7, 8", "visual-compass", "Headings around one view",
    """Headings recovered within 0.5 m of one route view (blue). The longer an arrow, the more alike the views; red ones are over 45 degrees off.""",
)  # fmt: skip
def _headings_around(found: Findings, material: Material, settings: Settings) -> Figure:
    around = found.tables["around"]
    table = around[around["reference"] == found.numbers["reference_shown"]]
    figure, axes = plans(table[["x_m", "y_m"]].to_numpy())
    axis = axes[0, 0]
    plan(axis, material.world)
    length = 0.05 + 0.2 * (table["rms"].max() - table["rms"]) / max(1e-9, np.ptp(table["rms"]))
    colours = np.where(table["error_deg"] < RECOVERED_DEG, GOOD_COLOUR, PATH_COLOUR)
    arrows(axis, table["x_m"], table["y_m"], table["heading_deg"], colours, length)
    first = table.iloc[0]
    arrows(axis, [first["reference_x_m"]], [first["reference_y_m"]], [first["set_heading_deg"]], ROUTE_COLOUR, 0.25)
    look_at(axis, table[["x_m", "y_m"]].to_numpy())
    return figure


@picture(
    "9", "visual-compass", "A place that looks alike in several directions",
    """Image differences at two neighbouring places from the same route view. Left: one distinct minimum. Right: several, and the
    deepest is not the right one. {share_of_failures_with_several_minima:.0%} of the failures around the reference views have several minima.""",
)  # fmt: skip
def _ambiguous(found: Findings, material: Material, settings: Settings) -> Figure:
    table = found.tables["ambiguous"]
    figure, axes = canvas(WIDE, 1, 2, sharey=True)
    if not len(table):
        return _nothing("no heading failed here for want of a single minimum")
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
def _occluded(found: Findings, material: Material, settings: Settings) -> Figure:
    table = found.tables["occluded"]
    if not len(table):
        return _nothing("no heading failed here")
    row = table.iloc[0]
    figure, axes = canvas(TALL, 3, 1)
    panorama(axes[0, 0], material.place_views[int(row["place"])], f"the place: {row['covered']:.0%} covered")
    known = material.route_views[int(row["reference"])]
    panorama(
        axes[1, 0], known, f"the route view, {row['distance_m']:.2f} m away: {row['reference_covered']:.0%} covered"
    )
    around_circle(axes[2, 0], table["degrees_off"], table["rms"])
    axes[2, 0].set_ylabel("RMS difference")
    axes[2, 0].set_title(f"{row['error_deg']:.0f}° off", fontsize=9)
    for axis in axes[:2, 0]:
        axis.set_xlabel("")
    return figure


@picture(
    "11", "visual-compass", "Error against distance",
    "Heading errors around three reference views (dots) and the median over all twelve (line), in rings of 0.1 m.",
)  # fmt: skip
def _error_by_distance(found: Findings, material: Material, settings: Settings) -> Figure:
    figure, axes = canvas()
    axis, around, rings = axes[0, 0], found.tables["around"], found.tables["by_distance"]
    references = around["reference"].unique()
    for reference, colour in zip(
        references[[1, len(references) // 2, -2]], (ROUTE_COLOUR, PATH_COLOUR, GOOD_COLOUR), strict=True
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


@picture(
    "12", "frequency", "Headings along the route, perfect memory",
    "Recovered headings at the {places} grid places within 0.2 m of the route, every route view remembered.",
)  # fmt: skip
def _perfect_memory(found: Findings, material: Material, settings: Settings) -> Figure:
    return _diagrams(found, material, {"headings": ""})


@picture(
    "13",
    "frequency",
    "Place recognition",
    "Each grid place is compared with the route view nearest to it; its heading is the set one.",
)
def _place_recognition(found: Findings, material: Material, settings: Settings) -> Figure:
    figure, axes = plans(material.route.xy)
    axis, table = axes[0, 0], found.tables["headings"]
    plan(axis, material.world)
    draw_route(axis, material.route)
    nearest = material.route.xy[table["nearest_view"]]
    xy = table[["x_m", "y_m"]].to_numpy()
    axis.plot(*np.stack([xy, nearest], axis=1).T, color=SOFT_COLOUR, lw=0.9, zorder=1)
    axis.plot(*xy.T, "o", ms=3, color=CURVE_COLOUR)
    look_at(axis, np.vstack([xy, nearest]))
    return figure


@picture(
    "14",
    "frequency",
    "Error against how many views are remembered",
    "One route view in so many is remembered. Median and mean error.",
)
def _by_frequency(found: Findings, material: Material, settings: Settings) -> Figure:
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
def _frequency_boxes(found: Findings, material: Material, settings: Settings) -> Figure:
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
def _by_factor(found: Findings, material: Material, settings: Settings) -> Figure:
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
def _factor_boxes(found: Findings, material: Material, settings: Settings) -> Figure:
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
def _preprocessing(found: Findings, material: Material, settings: Settings) -> Figure:
    figure, axes = canvas((7.2, 3.4), 2, 1)
    view = material.route_views[len(material.route_views) // 2]
    panorama(axes[0, 0], view, "before")
    panorama(axes[1, 0], settings.encoding(view[None])[0].numpy(), str(settings.encoding))
    axes[0, 0].set_xlabel("")
    return figure


@picture(
    "17, 23", "classifier", "Views learned and held out",
    "One route view in six is learned (blue); those half-way between every second pair are held out to test the classifier (red).",
)  # fmt: skip
def _learned(found: Findings, material: Material, settings: Settings) -> Figure:
    figure, axes = plans(material.route.xy)
    plan(axes[0, 0], material.world)
    for use, colour in (("not used", SOFT_COLOUR), ("learned", ROUTE_COLOUR), ("held out", PATH_COLOUR)):
        rows = found.tables["training"]
        rows = rows[rows["use"] == use]
        axes[0, 0].plot(rows["x_m"], rows["y_m"], "o", ms=1.5 if use == "not used" else 3.5, color=colour, label=use)
    axes[0, 0].legend(fontsize=8)
    look_at(axes[0, 0], material.route.xy)
    return figure


@picture(
    "19", "classifier", "Views on and off the route",
    "For every learned view that faces along the route (blue), one turned by 60 degrees to one side, alternately (red).",
)  # fmt: skip
def _positives(found: Findings, material: Material, settings: Settings) -> Figure:
    rows = found.tables["training"]
    rows = rows[rows["use"] == "learned"].head(20)
    figure, axes = plans(rows[["x_m", "y_m"]].to_numpy())
    plan(axes[0, 0], material.world)
    side = np.where(np.arange(len(rows)) % 2 == 0, -60, 60)
    arrows(axes[0, 0], rows["x_m"], rows["y_m"], rows["heading_deg"], ROUTE_COLOUR)
    arrows(axes[0, 0], rows["x_m"], rows["y_m"], rows["heading_deg"] + side, PATH_COLOUR)
    look_at(axes[0, 0], rows[["x_m", "y_m"]].to_numpy())
    return figure


@picture(
    "21, 22", "classifier", "One view learned",
    "Confidence of a network that learned one view and one turned copy of it, at the grid place nearest to it: {one_place_error_deg:.2f} degrees off (thesis: 0.35).",
)  # fmt: skip
def _one_place(found: Findings, material: Material, settings: Settings) -> Figure:
    figure, axes = canvas(WIDE, 1, 2, width_ratios=(2, 1))
    table = found.tables["one_place"]
    row = table.iloc[0]
    axes[0, 0].plot(table["turn_deg"], table["confidence"], color=CURVE_COLOUR, lw=1.2)
    axes[0, 0].set(xlabel="degrees turned left", ylabel="confidence", xlim=(0, 360), xticks=range(0, 361, 90))
    nearest = material.route.poses[int(row["nearest_view"])]
    arrows(axes[0, 1], [nearest[0]], [nearest[1]], [np.degrees(nearest[2])], ROUTE_COLOUR)
    arrows(axes[0, 1], [row["x_m"]], [row["y_m"]], [row["heading_deg"]], PATH_COLOUR)
    axes[0, 1].set_aspect("equal")
    look_at(axes[0, 1], np.array([nearest[:2], (row["x_m"], row["y_m"])]), 0.25)
    axes[0, 1].set(xlabel="x (m)", ylabel="y (m)")
    return figure


@picture(
    "25", "classifier", "Headings after 20 views",
    "The classifier (left) and perfect memory (right) of the route's first 20 learned views. Median error of the classifier: {median_error_deg_first_20:.1f} degrees (thesis: about 4).",
)  # fmt: skip
def _first_20(found: Findings, material: Material, settings: Settings) -> Figure:
    return _diagrams(found, material, {"headings_first_20": "classifier", "perfect_memory_first_20": "perfect memory"})


@picture(
    "27, 28", "classifier", "Headings after the whole route",
    "The classifier (left) and perfect memory (right) of the same views. Median error of the classifier: {median_error_deg_whole_route:.1f} degrees (thesis: about 45).",
)  # fmt: skip
def _whole_route(found: Findings, material: Material, settings: Settings) -> Figure:
    names = {"headings_whole_route": "classifier", "perfect_memory_whole_route": "perfect memory"}
    return _diagrams(found, material, names)


@picture(
    "29",
    "corners",
    "The part looked at",
    "The two neighbouring corners that turn the most (red: corners; dark: the part looked at).",
)
def _section(found: Findings, material: Material, settings: Settings) -> Figure:
    figure, axes = plans(material.route.xy)
    first, last = found.numbers["section_first_view"], found.numbers["section_last_view"]
    corners = found.tables["selections"]
    corners = corners[corners["in_corner"]]
    plan(axes[0, 0], material.world)
    draw_route(axes[0, 0], material.route)
    axes[0, 0].plot(*material.route.xy[first : last + 1].T, color=CURVE_COLOUR, lw=4, alpha=0.5)
    axes[0, 0].plot(corners["x_m"], corners["y_m"], ".", color=PATH_COLOUR, ms=4, zorder=3)
    look_at(axes[0, 0], material.route.xy)
    return figure


@picture(
    "30", "corners", "How fast views change",
    "RMS difference between successive learned views along the route (line) and how much it turns there (red); the part looked at is shaded.",
)  # fmt: skip
def _change(found: Findings, material: Material, settings: Settings) -> Figure:
    figure, axes = canvas()
    axis, table = axes[0, 0], found.tables["change"]
    axis.plot(table["along_m"], table["rms"], "o-", ms=3, color=CURVE_COLOUR, lw=1.2)
    axis.set(xlabel="along the route (m)", ylabel="RMS difference (grey levels)", ylim=(0, None))
    other = axis.twinx()
    other.fill_between(table["along_m"], table["turning_deg"], color=PATH_COLOUR, alpha=0.2, lw=0)
    other.set_ylabel("turning (degrees)", color=PATH_COLOUR)
    other.set_ylim(0, 180)
    part = table.loc[table["in_section"], "along_m"]
    axis.axvspan(part.min(), part.max(), color="#00000010", lw=0)
    return figure


@picture(
    "31",
    "corners",
    "Twice as many views in the corners",
    "Views learned: one in six (blue), and one in three in the corners of the part looked at (red).",
)
def _more_views(found: Findings, material: Material, settings: Settings) -> Figure:
    figure, axes = plans(material.route.xy)
    table = found.tables["selections"]
    plan(axes[0, 0], material.world)
    plain, doubled = (name for name in table.columns[3:5])
    for rows, colour in ((table[table[doubled] & ~table[plain]], PATH_COLOUR), (table[table[plain]], ROUTE_COLOUR)):
        axes[0, 0].plot(rows["x_m"], rows["y_m"], "o", ms=3.5, color=colour)
    look_at(axes[0, 0], material.route.xy)
    return figure


@picture(
    "32", "corners", "Before and after",
    "Headings beside the part looked at, having learned one view in six (left) and twice as many in its corners (right).",
)  # fmt: skip
def _before_and_after(found: Findings, material: Material, settings: Settings) -> Figure:
    chosen = found.tables["selections"].columns[3:5]
    first = found.tables[f"headings, {chosen[0]}"]
    figure, axes = plans(first.loc[first["in_section"], ["x_m", "y_m"]].to_numpy(), 2)
    for axis, name in zip(axes[0], chosen, strict=True):
        table = found.tables[f"headings, {name}"]
        table = table[table["in_section"]]
        heading_diagram(axis, table, material.route, material.world, name)
        look_at(axis, table[["x_m", "y_m"]].to_numpy())
    return figure


@picture(
    "33", "confidence", "Confidence after a short and a long training",
    "At a place whose heading is recovered, after {iterations[0]:,} and {iterations[1]:,} iterations.",
)  # fmt: skip
def _training_time(found: Findings, material: Material, settings: Settings) -> Figure:
    return _curves(
        found, [("recovered", iterations, f"{iterations:,} iterations") for iterations in found.numbers["iterations"]]
    )


@picture(
    "34",
    "confidence",
    "Headings after a short and a long training",
    "After {iterations[0]:,} (left) and {iterations[1]:,} iterations (right).",
)
def _short_and_long(found: Findings, material: Material, settings: Settings) -> Figure:
    short, long = found.numbers["iterations"]
    return _diagrams(
        found, material, {"headings_short": f"{short:,} iterations", "headings_long": f"{long:,} iterations"}
    )


@picture(
    "35, 36", "confidence", "A heading recovered, a heading reversed",
    "Two places beside straights (circled), and the confidence at every rotation: the network was never taught what lies behind.",
)  # fmt: skip
def _reversed(found: Findings, material: Material, settings: Settings) -> Figure:
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
def _narrow_scans(found: Findings, material: Material, settings: Settings) -> Figure:
    names = {"headings_long": "360 degrees", "headings_scan_180": "180 degrees", "headings_scan_90": "90 degrees"}
    return _diagrams(found, material, names)


@picture(
    "39", "confidence", "What a narrower scan leaves out",
    "Confidence at the reversed place; the shaded rotations are those that a scan of 180 degrees about the general direction looks at.",
)  # fmt: skip
def _left_out(found: Findings, material: Material, settings: Settings) -> Figure:
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
def _beyond(found: Findings, material: Material, settings: Settings) -> Figure:
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
def _beyond_headings(found: Findings, material: Material, settings: Settings) -> Figure:
    names = [name for name in found.tables if name.startswith("headings, mlp")]
    rotation = [name for name in names if "mlp-rotation" in name][-1]
    return _diagrams(found, material, {names[0]: "the thesis's classifier", rotation: "mlp-rotation, edges"})


def _diagrams(found: Findings, material: Material, names: dict[str, str]) -> Figure:
    """Heading diagrams of tables side by side."""
    shown = [found.tables[name][["x_m", "y_m"]].to_numpy() for name in names]
    figure, axes = plans(np.vstack([material.route.xy, *shown]), len(names))
    for axis, (name, title) in zip(axes[0], names.items(), strict=True):
        heading_diagram(axis, found.tables[name], material.route, material.world, title)
    for axis in axes[0, 1:]:
        axis.set_ylabel("")
    return figure


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


def _nothing(why: str) -> Figure:
    figure, axes = canvas((7.2, 1.2))
    axes[0, 0].axis("off")
    axes[0, 0].text(0.5, 0.5, why, ha="center", va="center")
    return figure
