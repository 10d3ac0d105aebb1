"""Bodies that do not walk through obstacles: how far a step gets, and how it goes on along what it meets.

A body is a disc. It moves along a straight step, and obstacles are the footprints of a world (obstacles.py): convex shapes on the
ground, many of them without area, such as a blade of grass. The first contact is exact: the disc touches a shape where its middle
comes within its radius of an edge or a corner.

A body that begins a step closer to an obstacle than its radius, such as at a start among stems, is for this step as small as its
clearance there. Its clearance never falls below that, and it gets out wherever a body of that size finds a way. Where
its middle is inside a footprint, it may not go farther away from the nearest edge of that. Without area there is no inside:
from exactly on a blade of grass it may go to either side. A body inside a stone, whose footprints share edges, may so be held.

The distance to a convex shape is a convex function along a line. So a step that does not come closer at first never does, and a
shape that the body touches matters only if the step leads towards it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from .obstacles import MIN_AREA, footprints, footprints_within
from .scene import World

MARGIN = (
    1e-6  # m; a body stops this much before it touches, which is far more than what poses and distances are rounded by
)
TOLERANCE = 1e-9  # m; distances that differ by less are the same
MAX_SLIDES = (
    4  # contacts in one step after which a body still goes on; enough for bends, and between two stems it stops anyway
)


@dataclass(frozen=True, eq=False)
class Contact:
    """Where steps end, and what they met.

    Attributes:
        positions: (n, 2) Where each body comes to (m): the end of its step if nothing hinders it.
        touched: (n,) Whether it met an obstacle.
        normals: (n, 2) Unit vector from the obstacle towards the body where it met the first; nan if it met none.
    """

    positions: Float[np.ndarray, "n 2"]
    touched: Bool[np.ndarray, " n"]
    normals: Float[np.ndarray, "n 2"]


def stopped(
    world: World,
    start: Float[np.ndarray, "n 2"],
    end: Float[np.ndarray, "n 2"],
    radius: float | Float[np.ndarray, " n"],
) -> Contact:
    """How far bodies get that stop at the first obstacle.

    On its whole way, no body has less clearance than its radius, or than at its start where that is less.

    Args:
        world: The world whose footprints are obstacles. Steep ground and the edge of the ground do not count.
        start: (n, 2) Where each body is (m).
        end: (n, 2) Where its step leads (m).
        radius: Of each body, or of all (m); 0 is a point.
    """
    return _move(world, start, end, radius, slides=0)


def slid(
    world: World,
    start: Float[np.ndarray, "n 2"],
    end: Float[np.ndarray, "n 2"],
    radius: float | Float[np.ndarray, " n"],
) -> Contact:
    """How far bodies get that slide along obstacles.

    At a contact, what is left of the step goes on along the surface: without its part towards the obstacle. So the whole way is
    not longer than the step, a body that meets a surface head-on stops, and one that meets a bend goes on, up to MAX_SLIDES times.
    It also stops where the surface leads back against the step, as in a corner. Clearance is kept as by `stopped`.

    Args:
        world: As for `stopped`.
        start: (n, 2) Where each body is (m).
        end: (n, 2) Where its step leads (m).
        radius: Of each body, or of all (m); 0 is a point.
    """
    return _move(world, start, end, radius, slides=MAX_SLIDES)


def _move(world: World, start, end, radius, slides: int) -> Contact:
    """Move bodies to their first contact, and on along the surface for as many contacts as `slides`."""
    start, end = (np.asarray(each, dtype=np.float64).reshape(-1, 2) for each in (start, end))
    step = end - start
    size = np.broadcast_to(radius, len(start)) + MARGIN
    body, which = footprints_within(world, start, np.hypot(*step.T) + size)
    shapes = footprints(world)[which]
    room = np.full(len(start), np.inf)
    np.minimum.at(room, body, _facing(shapes, start[body], step[body])[0])
    size = np.clip(room, MARGIN, size)

    position, left = start, step
    touched, normals = np.zeros(len(start), dtype=bool), np.full_like(start, np.nan)
    for _ in range(slides + 1):
        share, normal = _first_contact(shapes, body, position, left, size)
        hit = np.isfinite(share)
        normals = np.where((hit & ~touched)[:, None], normal, normals)
        touched = touched | hit
        made = np.where(hit, share, 1.0)[:, None]
        position, rest = position + made * left, (1 - made) * left
        rest = rest - _dot(rest, normal)[:, None] * normal
        on = hit & (_dot(rest, step) > 0)
        if not on.any():
            break
        left = np.where(on[:, None], rest, 0.0)
        body, shapes = body[on[body]], shapes[on[body]]
    return Contact(np.where(touched[:, None], position, end), touched, normals)


def _first_contact(
    shapes: Float[np.ndarray, "m 6 2"],
    body: Int[np.ndarray, " m"],
    xy: Float[np.ndarray, "n 2"],
    step: Float[np.ndarray, "n 2"],
    size: Float[np.ndarray, " n"],
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 2"]]:
    """The share of each body's step up to its first contact, inf if there is none, and the normal there.

    Args:
        shapes: Footprints (m).
        body: Which body each of them may hinder, in order.
        xy: Where each body is (m).
        step: Where each is going (m).
        size: Distance at which each touches (m).
    """
    distance, normal = _facing(shapes, xy[body], step[body])
    touching = distance <= size[body] + TOLERANCE
    towards = _dot(normal, step[body]) < -TOLERANCE
    share = np.where(touching, np.where(towards, 0.0, np.inf), _time_to_touch(shapes, xy[body], step[body], size[body]))
    order = np.lexsort((share, body))
    bodies, first = np.unique(body[order], return_index=True)
    pair = order[first]
    pair, bodies = pair[share[pair] <= 1], bodies[share[pair] <= 1]
    shares, normals = np.full(len(xy), np.inf), np.full_like(xy, np.nan)
    shares[bodies] = share[pair]
    touch = xy[bodies] + share[pair][:, None] * step[bodies]
    normals[bodies] = _facing(shapes[pair], touch, step[bodies])[1]
    return shares, normals


def _time_to_touch(
    shapes: Float[np.ndarray, "m 6 2"],
    xy: Float[np.ndarray, "m 2"],
    step: Float[np.ndarray, "m 2"],
    size: Float[np.ndarray, " m"],
) -> Float[np.ndarray, " m"]:
    """The share of each step (m) after which its body is within `size` (m) of the shape of the same row; inf if it never is.

    It begins farther away. It first touches a circle around a corner, or a line at that distance from an edge.
    """
    side, offset = np.roll(shapes, -1, axis=1) - shapes, xy[:, None] - shapes
    step, size = step[:, None], size[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        approach, beyond = -_dot(offset, step), _dot(offset, offset) - size**2
        root = approach**2 - _dot(step, step) * beyond
        corner = np.where((approach > 0) & (root >= 0), beyond / (approach + np.sqrt(root)), np.inf)

        edge = side / np.hypot(side[..., 0], side[..., 1])[..., None]  # nan where a corner is repeated
        height, rise = _cross(edge, offset), _cross(edge, step)
        share = (np.abs(height) - size) / -(np.sign(height) * rise)
        along = _dot(edge, offset) + share * _dot(edge, step)
        line = np.where((share >= 0) & (along >= 0) & (along <= _dot(edge, side)), share, np.inf)
    return np.minimum(corner, line).min(axis=1)


def _facing(
    shapes: Float[np.ndarray, "m 6 2"], xy: Float[np.ndarray, "m 2"], step: Float[np.ndarray, "m 2"]
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m 2"]]:
    """Distance (m) from the shape of the same row to each position, 0 inside, and the unit vector in which it grows.

    Inside, it is the way out by the nearest edge; of several equally near, the one by which the step (m) leads out most.
    On a shape without area it is 0: every way leads away.
    """
    side, offset = np.roll(shapes, -1, axis=1) - shapes, xy[:, None] - shapes
    length = np.hypot(side[..., 0], side[..., 1])
    unit = side / np.where(length > 0, length, 1.0)[..., None]
    gap = offset - np.clip(_dot(unit, offset), 0, length)[..., None] * unit
    distance = np.hypot(gap[..., 0], gap[..., 1])
    rows, nearest = np.arange(len(xy)), distance.argmin(axis=1)
    gap, distance = gap[rows, nearest], distance[rows, nearest]
    normal = gap / np.where(distance > TOLERANCE, distance, np.inf)[:, None]

    area = _cross(side, offset).sum(axis=1)  # twice, positive if the corners are counter-clockwise
    depth = np.where(length > 0, np.sign(area)[:, None] * _cross(unit, offset), np.inf)
    inside = (depth >= -TOLERANCE).all(axis=1) & (np.abs(area) > MIN_AREA)
    outward = np.sign(area)[:, None, None] * np.stack([unit[..., 1], -unit[..., 0]], axis=2)
    leaving = np.where(depth <= depth.min(axis=1, keepdims=True) + TOLERANCE, _dot(outward, step[:, None]), -np.inf)
    out = outward[rows, leaving.argmax(axis=1)]
    return np.where(inside, 0.0, distance), np.where(inside[:, None], out, normal)


def _dot(a, b):
    """Inner product of vectors (.., 2)."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]


def _cross(a, b):
    """Twice the area of the triangle of vectors (.., 2), positive if b is to the left of a."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
