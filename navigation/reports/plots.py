"""Pictures for people. Only this module, the pages, and the drawing and figures of `studies` import matplotlib."""

import os
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from tussock.world.atomic import replacing
from tussock.world.geometry import Route, turn_of_columns, wrap_angle
from tussock.world.scene import World

matplotlib.rcParams.update({"font.family": "DejaVu Sans", "font.size": 9})

ROUTE_COLOUR, PATH_COLOUR = "#2f6bff", "#e6352b"
CURVE_COLOUR = "#333333"


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


def familiarity_curves(
    path: str | os.PathLike, scans: Sequence[tuple[str, Float[np.ndarray, " w"], float]], *, title: str = ""
) -> None:
    """Write a picture (.png or .svg) of how familiar one model finds every heading, a panel a place.

    scans: for each place its name, the familiarity of each rotation, and how far to the left of the route's heading the eye
    faced (rad). In the picture the route's heading is 0. title: comes before the places' names.
    """
    from ..scan import best_turn  # late: it loads torch, which a picture of a world does not need

    with matplotlib.rc_context({"font.size": 11, "axes.titlesize": 11}):
        figure = Figure(figsize=(8, 2.3), layout="constrained")
        panels = figure.subplots(1, len(scans), sharey=True, squeeze=False)[0]
        for axes, (place, familiarity, facing) in zip(panels, scans, strict=True):
            width = len(familiarity)
            headings = np.degrees(wrap_angle(facing + turn_of_columns(np.arange(width), width)))
            order = headings.argsort()
            x, y = headings[order], familiarity[order]
            axes.plot(np.r_[x[-1] - 360, x, x[0] + 360], np.r_[y[-1], y, y[0]], color=CURVE_COLOUR, lw=1.4)
            error = float(np.degrees(wrap_angle(facing + best_turn(familiarity[None])[0])))
            axes.axvline(0, color=ROUTE_COLOUR, lw=1)
            axes.plot(error, y.max(), "o", color=PATH_COLOUR, ms=7, mec="white", zorder=3)
            words = f"{abs(error):.0f} degree{'' if round(abs(error)) == 1 else 's'} off"
            corner, align = (0.02, "left") if error > 45 else (0.99, "right")  # away from the dot
            axes.text(corner, 1, words, color=PATH_COLOUR, ha=align, va="top", transform=axes.transAxes)
            axes.set(xlim=(-180, 180), xticks=range(-180, 181, 90), title=f"{title} {place}".strip())
            axes.spines[["top", "right"]].set_visible(False)
            axes.margins(y=0.2)
        panels[0].set_ylabel("familiarity")
        figure.supxlabel("degrees to the left of the route's heading (negative: to the right)", fontsize=11)
        figure.get_layout_engine().set(wspace=0.06)  # type: ignore[union-attr]
        with replacing(path) as partial:
            figure.savefig(partial, dpi=120, format=Path(path).suffix.lstrip(".").lower())
