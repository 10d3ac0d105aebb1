"""Obstacles: what the triangles of a world cover on the ground, between the heights that an insect walks over and walks under."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from .flight import Flight
from .scene import World, once_per_world
from .terrain import STEP_HEIGHT, Terrain

BODY_HEIGHT = 0.06  # m; the insect walks under what is higher
MIN_LEVEL = -4  # shapes within 2 ** -4 m of their middle are of one size
SLACK = 1e-6  # m; more than the rounding of any distance
MIN_AREA = 1e-10  # m2, twice the area of a shape; a smaller one, such as an upright blade, has no inside
BATCH = 500  # positions at once, which bounds the memory of the shapes near them


def clearance(world: World, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """Exact distance from positions (m) to the nearest obstacle (m): 0 inside one, infinite if there is none.

    Steep ground and the edge of the ground do not count.
    """
    xy = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    parts = [_clearance(world, xy[at : at + BATCH]) for at in range(0, len(xy), BATCH)]
    return np.concatenate([np.zeros(0), *parts])


def _clearance(world: World, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """The clearance of positions (m). The nearest obstacle is not farther than that with the nearest middle."""
    shapes, distance = footprints(world), np.full(len(xy), np.inf)
    for size in _by_size(world):
        nearest = size.members[size.middles.query(xy)[1]]
        distance = np.minimum(distance, _distance_to(shapes[nearest], xy))
    for size in _by_size(world):
        row, shape = size.within(xy, distance)
        np.minimum.at(distance, row, _distance_to(shapes[shape], xy[row]))
    return distance


@dataclass(frozen=True, eq=False)
class _OneSize:
    """Footprints of about the same size.

    Attributes:
        members: Which footprints these are.
        middles: The mean of the corners of each.
        radius: No corner is farther than this from the middle of its footprint (m).
    """

    members: Int[np.ndarray, " n"]
    middles: KDTree
    radius: float

    def within(
        self, xy: Float[np.ndarray, "n 2"], distance: Float[np.ndarray, " n"]
    ) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
        """For each position (m), all footprints within a distance (m), and some beyond: rows of `xy`, and footprints."""
        within = self.middles.query_ball_point(xy, distance + self.radius + SLACK, return_sorted=False)
        row = np.repeat(np.arange(len(xy)), [len(each) for each in within])
        return row, self.members[np.concatenate([np.zeros(0), *within]).astype(np.int64)]


@once_per_world
def _by_size(world: World) -> list[_OneSize]:
    """The footprints of a world, by size: a few large ones would widen the search among all the small ones."""
    shapes = footprints(world)
    middle = shapes.mean(axis=1)
    radius = np.hypot(*np.moveaxis(shapes - middle[:, None], -1, 0)).max(axis=1)
    level = np.maximum(np.frexp(radius)[1], MIN_LEVEL)
    members = [np.flatnonzero(level == number) for number in np.unique(level)]
    return [_OneSize(these, KDTree(middle[these]), float(radius[these].max())) for these in members]


def footprints_within(
    world: World, xy: Float[np.ndarray, "n 2"], distance: Float[np.ndarray, " n"]
) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"]]:
    """For each position (m), all footprints within a distance (m), and some beyond.

    Returns:
        rows: (m,) Which position.
        shapes: (m,) Which footprint. The pairs are in the order of positions, and for each in the order of footprints.
    """
    none = np.zeros(0, dtype=np.int64)
    parts = [size.within(xy, distance) for size in _by_size(world)]
    rows, shapes = (np.concatenate([none, *each]) for each in (zip(*parts, strict=True) if parts else ((), ())))
    order = np.lexsort((shapes, rows))
    return rows[order], shapes[order]


@once_per_world
def footprints(world: World) -> Float[np.ndarray, "n 6 2"]:
    """The part of each triangle between ground and body height, seen from above: a convex shape, its corners in order.

    Going around the edges of a triangle, the part of each edge between the heights gives two corners. At most one edge is
    completely outside; it repeats the corner before.
    """
    triangles = world.triangles if world.terrain is None else _above_ground(world.triangles, world.terrain)
    z = triangles[:, :, 2]
    start = triangles[(z.max(axis=1) >= STEP_HEIGHT) & (z.min(axis=1) <= BODY_HEIGHT)].astype(np.float64)
    step = np.roll(start, -1, axis=1) - start
    with np.errstate(divide="ignore", invalid="ignore"):
        bounds = (np.array([0.0, BODY_HEIGHT]) - start[:, :, 2:]) / step[:, :, 2:]  # shares of the edge; nan if level
    enter, leave = np.fmax(bounds.min(axis=2), 0.0), np.fmin(bounds.max(axis=2), 1.0)
    level = step[:, :, 2] == 0
    outside = np.where(level, (start[:, :, 2] < 0) | (start[:, :, 2] > BODY_HEIGHT), enter > leave)
    enter, leave = np.where(level, 0.0, enter), np.where(level, 1.0, leave)
    first = start[:, :, :2] + enter[:, :, None] * step[:, :, :2]
    last = start[:, :, :2] + leave[:, :, None] * step[:, :, :2]
    before = np.roll(last, 1, axis=1)
    first, last = (np.where(outside[:, :, None], before, corner) for corner in (first, last))
    return np.stack([first, last], axis=2).reshape(-1, 6, 2)


def _above_ground(triangles: Float[np.ndarray, "n 3 3"], terrain: Terrain | Flight) -> Float[np.ndarray, "m 3 3"]:
    """Those triangles that are not ground, with the heights of their corners above the ground there.

    A corner off the ground takes the lowest ground under the others. A triangle that is off the ground altogether is left out:
    nothing can walk there.
    """
    others = triangles[~terrain.consists_of(np.arange(len(triangles)))].astype(np.float64)
    ground = terrain.height(others[..., :2].reshape(-1, 2)).reshape(-1, 3)
    lowest = np.fmin.reduce(ground, axis=1)
    others[..., 2] -= np.where(np.isnan(ground), lowest[:, None], ground)
    return others[np.isfinite(lowest)]


def _distance_to(shapes: Float[np.ndarray, "n 6 2"], xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """Distance (m) of each point to the convex shape of the same row; 0 inside."""
    side, offset = np.roll(shapes, -1, axis=1) - shapes, xy[:, None] - shapes
    squared = (side**2).sum(axis=2)
    share = np.clip((side * offset).sum(axis=2) / np.where(squared > 0, squared, 1.0), 0, 1)
    distance = np.hypot(*np.moveaxis(offset - share[..., None] * side, -1, 0)).min(axis=1)
    turn = side[..., 0] * offset[..., 1] - side[..., 1] * offset[..., 0]  # twice the area of (corner, corner, point)
    within = ((turn >= 0).all(axis=1) | (turn <= 0).all(axis=1)) & (np.abs(turn.sum(axis=1)) > MIN_AREA)
    return np.where(within, 0.0, distance)
