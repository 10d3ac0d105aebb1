"""Pictures for people. The only module that imports matplotlib."""

import os
from pathlib import Path

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from world.files import replacing
from world.geometry import Route
from world.scene import World

matplotlib.rcParams.update({"font.family": "DejaVu Sans", "font.size": 9})

ROUTE_COLOUR, PATH_COLOUR = "#2f6bff", "#e6352b"


def draw_world(axes: Axes, world: World) -> None:
    """Draw a world from above, to scale (m)."""
    triangles, rgb = world.surfaces()
    order = triangles[..., 2].max(axis=1).argsort(kind="stable")  # low things first, so that high ones cover them
    axes.add_collection(
        PolyCollection(
            list(triangles[order, :, :2]),
            facecolors=rgb[order] / 255,
            edgecolors="none",
            antialiased=False,
            rasterized=True,
        )
    )
    x0, y0, x1, y1 = world.field
    margin = 0.04 * max(x1 - x0, y1 - y0)
    axes.set(
        xlim=(x0 - margin, x1 + margin), ylim=(y0 - margin, y1 + margin), xlabel="x, east (m)", ylabel="y, north (m)"
    )
    axes.set_aspect("equal")


def overview(
    world: World,
    path: str | os.PathLike,
    *,
    route: Route | None = None,
    walk: Float[np.ndarray, "n 2"] | None = None,
    title: str = "",
) -> None:
    """Write a picture (.png or .svg) of a world from above, with a route and the path an agent took."""
    figure = Figure(figsize=(8, 8.4), layout="constrained")
    axes = figure.add_subplot()
    draw_world(axes, world)
    if route is not None:
        axes.plot(*route.xy.T, color="white", lw=4, alpha=0.6)
        axes.plot(*route.xy.T, color=ROUTE_COLOUR, lw=1.8, label="route")
        axes.plot(*route.xy[-1], "*", color=ROUTE_COLOUR, ms=16, mec="white", label="goal")
    if walk is not None and len(walk):
        axes.plot(*walk.T, color=PATH_COLOUR, lw=1.4, label="path")
        axes.plot(*walk[0], "o", color=PATH_COLOUR, ms=7, mec="white", label="start")
        axes.plot(*walk[-1], "X", color=PATH_COLOUR, ms=9, mec="white", label="end")
    if route is not None or walk is not None:
        axes.legend(loc="upper left", framealpha=0.9)
    axes.set_title(title)
    with replacing(path) as partial:
        figure.savefig(partial, dpi=120, format=Path(path).suffix.lstrip(".").lower())
