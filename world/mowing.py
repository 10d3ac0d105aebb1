"""Plants that are mown: cut off at a height. For `Change`, of change.py."""

from typing import TYPE_CHECKING, ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int

from .plant_groups import PlantGroups
from .scene import World
from .settings import number, settings
from .world_plants import NewTriangles, plants_of, with_triangles, without_plants

if TYPE_CHECKING:
    from .geometry import Route

TALL = 1.0  # m; what is higher stays: no mower cuts trees and tall shrubs
LOWEST = 0.02  # m; what is left of all others at an amount of 1
NOT_MOWN = ("stone", "pebble")  # kinds that no mower cuts


@settings
class Mown:
    """What is above a height is cut off, exactly at that height over the foot of each plant. Plants higher than 1 m stay, and stones.

    Attributes:
        amount: Plants are cut to 1 m x 0.02 ** amount: not at all at 0, to 14 cm at 0.5, and to 2 cm at 1.
    """

    name: ClassVar[str] = "mown"
    amount: float = number(low=0, high=1)

    @property
    def height(self) -> float:
        """Of what is left (m)."""
        return TALL * (LOWEST / TALL) ** self.amount

    def __call__(self, world: World, rng: np.random.Generator, route: "Route | None" = None) -> World:
        """The changed world."""
        plants = plants_of(world)
        plane = planes(world, plants, self.height)
        new = clipped(world.triangles, plane)
        return with_triangles(world, new, without_plants(plants, new.source))


def planes(world: World, plants: PlantGroups, height: float) -> Float[np.ndarray, " n"]:
    """The height (m) at which each triangle is cut: `height` over the foot of its plant; infinite where it is not."""
    top = np.full(len(plants), -np.inf)
    of, inside = plants.of, plants.of >= 0
    np.maximum.at(top, of[inside], world.triangles[inside, :, 2].max(axis=1))
    stone = np.array([kind in NOT_MOWN for kind in plants.kinds], dtype=bool)
    cut = (top - plants.foot[:, 2] <= TALL) & ~stone[plants.kind]
    plane = np.where(cut, plants.foot[:, 2].astype(np.float64) + height, np.inf)
    return np.where(inside, plane[of], np.inf)


def clipped(triangles: Float[np.ndarray, "n 3 3"], plane: Float[np.ndarray, " n"]) -> NewTriangles:
    """What is left of triangles below level planes at some heights (m).

    A triangle with one corner above its plane becomes two, one with two corners above a smaller one; their front side stays.
    """
    plane32 = plane.astype(np.float32)
    above = triangles[..., 2] > plane32[:, None]
    count = above.sum(axis=1)
    whole = np.flatnonzero(count == 0)
    parts = [(whole, np.tile(np.eye(3), (len(whole), 1, 1)), np.zeros((len(whole), 3), dtype=bool))]
    for corners, alone in ((2, ~above), (1, above)):  # the corner that is alone on its side becomes the first one
        rows = np.flatnonzero(count == corners)
        parts += _cut(rows, triangles[rows].astype(np.float64), plane[rows], alone[rows].argmax(axis=1), corners == 2)
    source, weights, on_plane = (np.concatenate(each) for each in zip(*parts, strict=True))
    new = (weights @ triangles[source].astype(np.float64)).astype(np.float32)
    new[whole_of(source, count)] = triangles[source[whole_of(source, count)]]
    new[..., 2] = np.where(on_plane, plane32[source, None], new[..., 2])
    edges = new[:, 1:] - new[:, :1]
    real = (np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) > 0) | whole_of(source, count)
    order = np.flatnonzero(real)[np.argsort(source[real], kind="stable")]
    return NewTriangles(source[order], new[order], weights[order])


def whole_of(source: Int[np.ndarray, " m"], count: Int[np.ndarray, " n"]) -> Bool[np.ndarray, " m"]:
    """Which new triangles are of one that is not cut."""
    return count[source] == 0


def _cut(
    rows: Int[np.ndarray, " k"],
    corners: Float[np.ndarray, "k 3 3"],
    plane: Float[np.ndarray, " k"],
    first: Int[np.ndarray, " k"],
    below: bool,
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """What is left of triangles that planes cut, as the weights of the old corners.

    Args:
        rows: The numbers of the triangles.
        corners: Their corners (m).
        plane: Height of the plane of each (m).
        first: The corner that is alone on its side of the plane.
        below: Whether that side is the lower one.

    Returns:
        For one or two new triangles of each: its number, the weights (k, 3, 3) and which of its corners are on the plane (k, 3).
    """
    k = np.arange(len(rows))
    order = (first[:, None] + np.arange(3)) % 3
    unit = np.eye(3)[order]  # weights of the three corners, the one that is alone first
    a, b, c = (corners[k, order[:, j], 2] for j in range(3))
    share_b, share_c = ((plane - a) / np.where(other == a, 1.0, other - a) for other in (b, c))
    on_b = unit[:, 0] + share_b[:, None] * (unit[:, 1] - unit[:, 0])
    on_c = unit[:, 0] + share_c[:, None] * (unit[:, 2] - unit[:, 0])

    def triangle(*points: np.ndarray, plane_at: tuple[bool, bool, bool]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return rows, np.stack(points, axis=1), np.tile(plane_at, (len(rows), 1))

    if below:
        return [triangle(unit[:, 0], on_b, on_c, plane_at=(False, True, True))]
    return [
        triangle(on_b, unit[:, 1], unit[:, 2], plane_at=(True, False, False)),
        triangle(on_b, unit[:, 2], on_c, plane_at=(True, False, True)),
    ]
