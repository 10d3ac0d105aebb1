"""What the figures are made of: the world from above, arrows for headings, curves over the circle, error plots."""

import dataclasses
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import pandas as pd
from jaxtyping import UInt8
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tussock.world.geometry import Bounds, Route
from tussock.world.scene import World

from ...evaluation import RECOVERED_DEG
from ...reports.plots import CURVE_COLOUR, PATH_COLOUR, ROUTE_COLOUR, draw_world

GOOD_COLOUR, SOFT_COLOUR = "#2b8a6f", "#9aa3ad"
ARROW = 0.16  # m
WIDE, TALL = (7.2, 2.9), (7.2, 5.6)  # inches
MOST_WIDE, MOST_HIGH, MARGIN = 7.2, 7.0, 0.35  # of plans: inches, inches, m
PLAN_PIXELS = 900  # of a plan's longer side


def canvas(size: tuple[float, float] = WIDE, rows: int = 1, columns: int = 1, **options) -> tuple[Figure, np.ndarray]:
    """A figure and its axes, (rows, columns) of them."""
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    for each in axes.flat:
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def plans(xy: np.ndarray, columns: int = 1) -> tuple[Figure, np.ndarray]:
    """Axes side by side for plans that show the points xy (m), as large as they fit."""
    across, up = np.ptp(xy, axis=0) + 2 * MARGIN
    scale = min((MOST_WIDE - 0.7) / columns / across, MOST_HIGH / up)
    width = max(2.4 * columns, scale * across * columns + 0.7 + 0.15 * columns)  # titles need room
    return canvas((width, scale * up + 0.9), 1, columns, sharey=True)


@lru_cache(maxsize=16)
def from_above(world: World, part: Bounds) -> UInt8[np.ndarray, "h w 4"]:
    """Part of a world from above as an image."""
    low, high = world.triangles[..., :2].min(axis=1), world.triangles[..., :2].max(axis=1)
    within = (low <= part[2:]).all(axis=1) & (high >= part[:2]).all(axis=1)
    seen = dataclasses.replace(world, triangles=world.triangles[within], rgb=world.rgb[within], textured=())
    across, up = part.x_max - part.x_min, part.y_max - part.y_min
    figure = Figure(figsize=(across / max(across, up), up / max(across, up)), dpi=PLAN_PIXELS)
    drawn = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    draw_world(axes, seen)
    axes.set(xlim=(part.x_min, part.x_max), ylim=(part.y_min, part.y_max), aspect="auto")
    axes.axis("off")
    drawn.draw()
    return np.asarray(drawn.buffer_rgba()).copy()


def plan(axes: Axes, world: World | None, xy: np.ndarray, margin: float = MARGIN, *, faint: bool = True) -> None:
    """Make axes a plan (m, to scale) of the part that holds the points xy; the world lies under it where it is at hand."""
    low, high = xy.min(axis=0) - margin, xy.max(axis=0) + margin
    part = Bounds(*np.round([*low, *high], 6).tolist())
    if world is not None:
        edges = (part.x_min, part.x_max, part.y_min, part.y_max)
        axes.imshow(from_above(world, part), extent=edges, alpha=0.35 if faint else 1.0, zorder=0)
    axes.set(xlim=(part.x_min, part.x_max), ylim=(part.y_min, part.y_max), xlabel="x, east (m)", ylabel="y, north (m)")
    axes.set_aspect("equal", adjustable="box")


def draw_route(axes: Axes, route: Route, **style) -> None:
    """A route as a line with its goal."""
    axes.plot(*route.xy.T, color=ROUTE_COLOUR, lw=1.6, zorder=2, **style)
    axes.plot(*route.xy[-1], "*", color=ROUTE_COLOUR, ms=11, mec="white", zorder=3)


def arrows(axes: Axes, x, y, heading_deg, colour, length=ARROW, **style) -> None:
    """Arrows from points towards headings; lengths (m) and colours one for all or one each."""
    angle = np.radians(np.asarray(heading_deg))
    u, v = np.cos(angle) * length, np.sin(angle) * length
    axes.quiver(
        x, y, u, v, color=colour, angles="xy", scale_units="xy", scale=1, units="inches", width=0.022, headwidth=3.6, headlength=4.5,
        headaxislength=4, zorder=4, **style,
    )  # fmt: skip


def heading_diagram(
    axes: Axes, table: pd.DataFrame, route: Route, world: World | None, title: str = "", *, whole: bool = True
) -> None:
    """Recovered headings at grid places: green where they are less than 45 degrees off, red where not; the route in blue.

    whole: show all of the route, not only where the places are.
    """
    draw_route(axes, route)
    every = np.linspace(0, len(route.poses) - 1, max(4, int(route.length / 0.4))).astype(int)[:-1]
    arrows(axes, *route.xy[every].T, np.degrees(route.poses[every, 2]), ROUTE_COLOUR, 0.12)
    good = table["error_deg"] < RECOVERED_DEG
    arrows(axes, table["x_m"], table["y_m"], table["heading_deg"], np.where(good, GOOD_COLOUR, PATH_COLOUR))
    places = table[["x_m", "y_m"]].to_numpy()
    plan(axes, world, np.vstack([route.xy, places]) if whole else places)
    count = f"{int(good.sum())} of {len(good)} less than 45° off"
    axes.set_title(f"{title}\n{count}" if title else count, fontsize=9)


def around_circle(axes: Axes, degrees, values, label: str | None = None, colour: str = CURVE_COLOUR, **style) -> None:
    """A curve over all rotations, from behind over ahead to behind; 0 is the set heading."""
    axes.plot(degrees, values, color=colour, lw=1.4, label=label, **style)
    axes.axvline(0, color=ROUTE_COLOUR, lw=0.9, zorder=0)
    axes.set(xlim=(-180, 180), xticks=range(-180, 181, 90), xlabel="degrees left of the set heading")


def boxes(
    axes: Axes, table: pd.DataFrame, position: str, colour: str = ROUTE_COLOUR, shift: float = 0.0, width: float = 0.6
) -> None:
    """Box plots from quartiles and whiskers in a table; medians as lines, means as dots."""
    stats = [
        {"med": row.median_error_deg, "q1": row.lower_quartile_deg, "q3": row.upper_quartile_deg, "whislo": row.lower_whisker_deg,
         "whishi": row.upper_whisker_deg, "mean": row.mean_error_deg, "fliers": []}
        for row in table.itertuples()
    ]  # fmt: skip
    places = table[position] + shift
    axes.bxp(
        stats, positions=places, widths=width, showfliers=False, showmeans=True, patch_artist=True, manage_ticks=False,
        boxprops={"facecolor": colour + "33", "edgecolor": colour}, medianprops={"color": colour, "lw": 1.8},
        whiskerprops={"color": colour}, capprops={"color": colour},
        meanprops={"marker": "o", "markerfacecolor": colour, "markeredgecolor": "white", "markersize": 4},
    )  # fmt: skip


def lines(axes: Axes, x, curves: Mapping[str, tuple], ylabel: str = "error (degrees)") -> None:
    """Named lines (values, colour, style) over one axis."""
    for name, (values, colour, style) in curves.items():
        axes.plot(x, values, style, color=colour, label=name, ms=4, lw=1.5)
    axes.set_ylabel(ylabel)
    axes.set_ylim(bottom=0)
    axes.grid(axis="y", color="#00000018")
    axes.legend(frameon=False, fontsize=8)


def panorama(axes: Axes, view: np.ndarray, title: str = "") -> None:
    """A view (h, w, 3 or 4) or feature image (h, w), 360 degrees wide, ahead in the middle."""
    image = view[..., :3] if view.ndim == 3 else view
    axes.imshow(image, extent=(180, -180, 0, 75), cmap="gray", aspect="auto", interpolation="nearest")
    axes.set(xticks=range(-180, 181, 90), xlim=(180, -180), yticks=[], xlabel="degrees left of straight ahead")
    axes.set_title(title, fontsize=9)


def diagrams(tables: Mapping[str, pd.DataFrame], route: Route, world: World | None, names: Mapping[str, str]) -> Figure:
    """Heading diagrams of tables side by side; names: their titles."""
    shown = [tables[name][["x_m", "y_m"]].to_numpy() for name in names]
    figure, axes = plans(np.vstack([route.xy, *shown]), len(names))
    for axis, (name, title) in zip(axes[0], names.items(), strict=True):
        heading_diagram(axis, tables[name], route, world, title)
    for axis in axes[0, 1:]:
        axis.set_ylabel("")
    return figure


def nothing(why: str) -> Figure:
    """A figure that says why there is none."""
    figure, axes = canvas((7.2, 1.2))
    axes[0, 0].axis("off")
    axes[0, 0].text(0.5, 0.5, why, ha="center", va="center")
    return figure
