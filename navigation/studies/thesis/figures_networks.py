"""Figures of the classifier, and of corners. Drawn from findings alone."""

import numpy as np
from matplotlib.figure import Figure

from ...reports.findings import Findings
from ...reports.plots import CURVE_COLOUR, PATH_COLOUR, ROUTE_COLOUR
from .drawing import SOFT_COLOUR, WIDE, arrows, canvas, diagrams, draw_route, heading_diagram, nothing, plan, plans
from .material import Material
from .pictures import picture


@picture(
    "17, 23", "classifier", "Views learned and held out",
    "One route view in six is learned (blue); those half-way between every second pair are held out to test the classifier (red).",
)  # fmt: skip
def _learned(found: Findings, material: Material) -> Figure:
    figure, axes = plans(material.route.xy)
    for use, colour in (("not used", SOFT_COLOUR), ("learned", ROUTE_COLOUR), ("held out", PATH_COLOUR)):
        rows = found.tables["training"]
        rows = rows[rows["use"] == use]
        axes[0, 0].plot(rows["x_m"], rows["y_m"], "o", ms=1.5 if use == "not used" else 3.5, color=colour, label=use)
    axes[0, 0].legend(fontsize=8)
    plan(axes[0, 0], material.world, material.route.xy)
    return figure


@picture(
    "19", "classifier", "Views on and off the route",
    "For every learned view that faces along the route (blue), one turned by 60 degrees to one side, alternately (red).",
)  # fmt: skip
def _positives(found: Findings, material: Material) -> Figure:
    rows = found.tables["training"]
    rows = rows[rows["use"] == "learned"].head(20)
    figure, axes = plans(rows[["x_m", "y_m"]].to_numpy())
    side = np.where(np.arange(len(rows)) % 2 == 0, -60, 60)
    arrows(axes[0, 0], rows["x_m"], rows["y_m"], rows["heading_deg"], ROUTE_COLOUR)
    arrows(axes[0, 0], rows["x_m"], rows["y_m"], rows["heading_deg"] + side, PATH_COLOUR)
    plan(axes[0, 0], material.world, rows[["x_m", "y_m"]].to_numpy())
    return figure


@picture(
    "21, 22", "classifier", "One view learned",
    """Confidence of a network that learned one view and one turned copy of it, at the grid place nearest to it:
    {one_place_error_deg:.2f} degrees off (thesis: 0.35).""",
)  # fmt: skip
def _one_place(found: Findings, material: Material) -> Figure:
    figure, axes = canvas(WIDE, 1, 2, width_ratios=(2, 1))
    table = found.tables["one_place"]
    row = table.iloc[0]
    axes[0, 0].plot(table["turn_deg"], table["confidence"], color=CURVE_COLOUR, lw=1.2)
    axes[0, 0].set(xlabel="degrees turned left", ylabel="confidence", xlim=(0, 360), xticks=range(0, 361, 90))
    nearest = material.route.poses[int(row["nearest_view"])]
    arrows(axes[0, 1], [nearest[0]], [nearest[1]], [np.degrees(nearest[2])], ROUTE_COLOUR)
    arrows(axes[0, 1], [row["x_m"]], [row["y_m"]], [row["heading_deg"]], PATH_COLOUR)
    plan(axes[0, 1], material.world, np.array([nearest[:2], (row["x_m"], row["y_m"])]), 0.25)
    return figure


@picture(
    "25", "classifier", "Headings after 20 views",
    """The classifier (left) and perfect memory (right) of the route's first 20 learned views. Median error of the classifier:
    {median_error_deg_first_20:.1f} degrees (thesis: about 4).""",
)  # fmt: skip
def _first_20(found: Findings, material: Material) -> Figure:
    return diagrams(
        found.tables,
        material.route,
        material.world,
        {"headings_first_20": "classifier", "perfect_memory_first_20": "perfect memory"},
    )


@picture(
    "27, 28", "classifier", "Headings after the whole route",
    """The classifier (left) and perfect memory (right) of the same views. Median error of the classifier:
    {median_error_deg_whole_route:.1f} degrees (thesis: about 45).""",
)  # fmt: skip
def _whole_route(found: Findings, material: Material) -> Figure:
    names = {"headings_whole_route": "classifier", "perfect_memory_whole_route": "perfect memory"}
    return diagrams(found.tables, material.route, material.world, names)


@picture(
    "29",
    "corners",
    "The part looked at",
    "The two neighbouring corners that turn the most (red: corners; dark: the part looked at).",
)
def _section(found: Findings, material: Material) -> Figure:
    figure, axes = plans(material.route.xy)
    first, last = found.numbers["section_first_view"], found.numbers["section_last_view"]
    corners = found.tables["selections"]
    corners = corners[corners["in_corner"]]
    draw_route(axes[0, 0], material.route)
    axes[0, 0].plot(*material.route.xy[first : last + 1].T, color=CURVE_COLOUR, lw=4, alpha=0.5)
    axes[0, 0].plot(corners["x_m"], corners["y_m"], ".", color=PATH_COLOUR, ms=4, zorder=3)
    plan(axes[0, 0], material.world, material.route.xy)
    return figure


@picture(
    "30", "corners", "How fast views change",
    """RMS difference between successive learned views along the route (line) and how much it turns there (red); the part looked at
    is shaded.""",
)  # fmt: skip
def _change(found: Findings, material: Material) -> Figure:
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
def _more_views(found: Findings, material: Material) -> Figure:
    figure, axes = plans(material.route.xy)
    table = found.tables["selections"]
    plain, doubled = (name for name in table.columns[3:5])
    for rows, colour in ((table[table[doubled] & ~table[plain]], PATH_COLOUR), (table[table[plain]], ROUTE_COLOUR)):
        axes[0, 0].plot(rows["x_m"], rows["y_m"], "o", ms=3.5, color=colour)
    plan(axes[0, 0], material.world, material.route.xy)
    return figure


@picture(
    "32", "corners", "Before and after",
    "Headings beside the part looked at, having learned one view in six (left) and twice as many in its corners (right).",
)  # fmt: skip
def _before_and_after(found: Findings, material: Material) -> Figure:
    chosen = found.tables["selections"].columns[3:5]
    first = found.tables[f"headings, {chosen[0]}"]
    if int(first["in_section"].sum()) == 0:
        return nothing("no grid place lies beside the part looked at")
    figure, axes = plans(first.loc[first["in_section"], ["x_m", "y_m"]].to_numpy(), 2)
    for axis, name in zip(axes[0], chosen, strict=True):
        table = found.tables[f"headings, {name}"]
        table = table[table["in_section"]]
        heading_diagram(axis, table, material.route, material.world, name, whole=False)
    return figure
