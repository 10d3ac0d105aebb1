"""Maps: a world, routes, walks and headings from above, to scale."""

import dataclasses
import os

import matplotlib
import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from tussock.world.geometry import Bounds, Route
from tussock.world.scene import World

from .drawing import PATH_COLOUR, ROUTE_COLOUR, SOFT_COLOUR, STYLE, canvas, save_picture

ARROW = 0.16  # m
MARGIN = 0.35  # m around what a map shows
MAX_WIDTH, MAX_HEIGHT = 7.2, 7.0  # inches: of a figure with maps, and of a map
MAP_PIXELS = 900  # of the longer side of a world's image
X_LABEL, Y_LABEL = "x, east (m)", "y, north (m)"


def write_overview(
    world: World,
    path: str | os.PathLike,
    *,
    route: Route | None = None,
    walk: Float[np.ndarray, "n 2"] | None = None,
    views: Float[np.ndarray, "k 2"] | None = None,
    title: str = "",
) -> None:
    """Write a picture of a world from above.

    Args:
        world: The world.
        path: File to write, .png or .svg.
        route: A route through it.
        walk: Positions along an agent's path (m).
        views: Positions of the views of an image database (m).
        title: Title of the picture.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8, 8.4), layout="constrained")
        axes = figure.add_subplot()
        draw_world(axes, world)
        if views is not None:
            axes.plot(*views.T, ".", color=SOFT_COLOUR, ms=2.5, zorder=0, label="views")
        if route is not None:
            axes.plot(*route.xy.T, color="white", lw=4, alpha=0.6)
            axes.plot(*route.xy.T, color=ROUTE_COLOUR, lw=1.8, label="route")
            axes.plot(*route.xy[-1], "*", color=ROUTE_COLOUR, ms=16, mec="white", label="goal")
        if walk is not None and len(walk):
            axes.plot(*walk.T, color=PATH_COLOUR, lw=1.4, label="path")
            axes.plot(*walk[0], "o", color=PATH_COLOUR, ms=7, mec="white", label="start")
            axes.plot(*walk[-1], "s", color=PATH_COLOUR, ms=8, mec="white", label="end")
        if route is not None or walk is not None:
            axes.legend(loc="upper left", framealpha=0.9)
        axes.set_title(title)
        save_picture(figure, path)


def map_axes(
    xy: Float[np.ndarray, "n 2"], columns: int = 1, max_height: float = MAX_HEIGHT
) -> tuple[Figure, np.ndarray]:
    """A figure with axes side by side for maps, as large as they fit.

    Args:
        xy: Points that each map shows (m).
        columns: Number of maps.
        max_height: Largest height of a map (inches).

    Returns:
        The figure, and its axes as an array (1, columns).
    """
    across, up = np.ptp(xy, axis=0) + 2 * MARGIN
    scale = min((MAX_WIDTH - 0.7) / columns / across, max_height / up)
    width = max(2.4 * columns, scale * across * columns + 0.7 + 0.15 * columns)  # titles need room
    return canvas((width, scale * up + 1.1), 1, columns, sharey=True)  # two lines of title, ticks and labels


def draw_map(
    axes: Axes, world: World | None, xy: Float[np.ndarray, "n 2"], margin: float = MARGIN, *, faint: bool = True
) -> None:
    """Make axes a map of the part of a world around points.

    Args:
        axes: Where to draw.
        world: The world; None where there are only views of it.
        xy: The points (m).
        margin: Room around the points (m).
        faint: Draw the world in pale colours.
    """
    low, high = xy.min(axis=0) - margin, xy.max(axis=0) + margin
    part = Bounds(*np.round([*low, *high], 6).tolist())
    if world is not None:
        edges = (part.x_min, part.x_max, part.y_min, part.y_max)
        axes.imshow(_image_from_above(world, part), extent=edges, alpha=0.35 if faint else 1.0, zorder=0)
    axes.set(xlim=(part.x_min, part.x_max), ylim=(part.y_min, part.y_max), xlabel=X_LABEL, ylabel=Y_LABEL)
    axes.set_aspect("equal", adjustable="box")


def draw_route(axes: Axes, route: Route, **style) -> None:
    """Draw a route as a line that ends in a star at its goal."""
    axes.plot(*route.xy.T, color=ROUTE_COLOUR, lw=1.6, zorder=2, **style)
    axes.plot(*route.xy[-1], "*", color=ROUTE_COLOUR, ms=11, mec="white", zorder=3)


def draw_arrows(axes: Axes, x, y, heading_deg, colour, length=ARROW, **style) -> None:
    """Draw arrows from points (m) towards headings (degrees). Colours and lengths (m): one for all, or one for each."""
    angle = np.radians(np.asarray(heading_deg))
    style |= {"angles": "xy", "scale_units": "xy", "scale": 1, "color": colour, "zorder": 4}
    style |= {"units": "inches", "width": 0.022, "headwidth": 3.6, "headlength": 4.5, "headaxislength": 4}
    axes.quiver(x, y, np.cos(angle) * length, np.sin(angle) * length, **style)


def draw_world(axes: Axes, world: World) -> None:
    """Draw a world from above, its field with a little around it; lower surfaces below higher ones.

    Args:
        axes: Of matplotlib, in metres.
        world: The world.
    """
    triangles, rgb = world.surfaces()
    above_ground = triangles[..., 2].max(axis=1) - np.nan_to_num(world.ground_height(triangles[..., :2].mean(axis=1)))
    order = above_ground.argsort(kind="stable")  # lower ones first, so that higher ones cover them
    surfaces = PolyCollection(
        triangles[order, :, :2],  # type: ignore[arg-type]  # an array is taken as a whole
        facecolors=rgb[order] / 255,
        edgecolors="none",
        antialiased=False,
        rasterized=True,
    )
    axes.add_collection(surfaces, autolim=False)  # the limits are those of the field
    x0, y0, x1, y1 = world.field
    margin = 0.04 * max(x1 - x0, y1 - y0)
    axes.set(xlim=(x0 - margin, x1 + margin), ylim=(y0 - margin, y1 + margin), xlabel=X_LABEL, ylabel=Y_LABEL)
    axes.set_aspect("equal")


def _image_from_above(world: World, part: Bounds) -> UInt8[np.ndarray, "h w 4"]:
    """Part of a world from above as an image."""
    low, high = world.triangles[..., :2].min(axis=1), world.triangles[..., :2].max(axis=1)
    within = (low <= part[2:]).all(axis=1) & (high >= part[:2]).all(axis=1)
    only_colours = {"texturing": None, "reflectance": None, "plants": None}
    visible = dataclasses.replace(world, triangles=world.triangles[within], rgb=world.rgb[within], **only_colours)
    across, up = part.x_max - part.x_min, part.y_max - part.y_min
    figure = Figure(figsize=(across / max(across, up), up / max(across, up)), dpi=MAP_PIXELS)
    drawn = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    draw_world(axes, visible)
    axes.set(xlim=(part.x_min, part.x_max), ylim=(part.y_min, part.y_max), aspect="auto")
    axes.axis("off")
    drawn.draw()
    return np.asarray(drawn.buffer_rgba()).copy()
