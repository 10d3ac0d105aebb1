"""Worlds far from 0, such as scans in UTM coordinates: they are made local, and what is given in the file's coordinates with them.

The coordinates in the file of a world are its own plus `World.origin_m`.
"""

import logging
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    from .geometry import Route
    from .scene import World

log = logging.getLogger(__name__)

FAR = 8192.0  # m from 0; beyond it, neighbouring float32 numbers are a millimetre apart
ROUND = 10.0  # m; an origin is a multiple of it


def origin_of(low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]) -> tuple[float, float, float]:
    """The origin of a world that lies between two corners (m): 0 along an axis on which float32 holds it to a millimetre."""
    x, y, z = (_origin_along(float(a), float(b)) for a, b in zip(low, high, strict=True))
    return x, y, z


def _origin_along(low: float, high: float) -> float:
    """A round number just below `low`, or 0 where taking it off would not bring the coordinates nearer to 0."""
    farthest = max(abs(low), abs(high))
    if not (math.isfinite(farthest) and farthest > FAR and high - low < farthest / 2):
        return 0.0
    return math.floor(low / ROUND) * ROUND


def local_xy(world: "World", xy: Any, what: str) -> Float[np.ndarray, "n 2"]:
    """Places (m) in the world's own coordinates.

    Places that lie outside the field as they are given, and inside it with the world's origin subtracted, are taken as coordinates
    of the world's file. That is logged.

    Args:
        world: The world.
        xy: (n, 2) The places, either in its own coordinates or in those of its file.
        what: What they are, for the log: "the route r.csv".
    """
    xy = np.asarray(xy, dtype=np.float64)
    origin = np.array(world.origin_m[:2])
    if not origin.any():
        return xy
    moved = xy - origin
    inside, inside_moved = (np.count_nonzero(world.field.contains(*each.T)) for each in (xy, moved))
    if inside_moved <= inside:
        return xy
    log.warning(f"{what}: in the coordinates of the world's file; the world's origin ({shown(origin)}) is subtracted")
    return moved


def local_route(world: "World", route: "Route", what: str) -> "Route":
    """The route in the world's own coordinates; see `local_xy`."""
    from .geometry import Route

    xy = local_xy(world, route.xy, what)
    if np.array_equal(xy, route.xy):
        return route  # in the world's own coordinates, its heights too
    heights = None if route.heights is None else route.heights - world.origin_m[2]
    return Route(np.column_stack([xy, route.poses[:, 2]]), heights)


def shown(place: Iterable[float]) -> str:
    """A place (m) with all its digits, as it can be given again: "x 500000, y 5638660 m"."""
    return ", ".join(f"{axis} {value:.10g}" for axis, value in zip("xyz", place, strict=False)) + " m"
