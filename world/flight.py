"""Flight: a surface in the air that agents move on, as on the ground of a mesh (terrain.py), with nothing of it to see or to touch."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int64
from scipy.spatial import KDTree

from .errors import SettingError
from .geometry import place_text
from .terrain import Terrain

if TYPE_CHECKING:
    from .scene import World

SPACING = 0.01  # m between the points of a path whose height is looked up


@dataclass(frozen=True, eq=False)
class Flight:
    """A level, or the heights of a path: elsewhere the height is that of the path's nearest point.

    Attributes:
        xyz: (n, 3) Points of the path in their order (m). One point is a level.
    """

    xyz: Float[np.ndarray, "n 3"]

    @classmethod
    def at(cls, height: float) -> "Flight":
        """At one height over z = 0 (m)."""
        return cls(np.array([[0.0, 0.0, height]]))

    @cached_property
    def _nearest(self) -> tuple[KDTree, Float[np.ndarray, " k"]]:
        """A tree of points at most SPACING apart, and their heights."""
        along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(self.xyz[:, :2], axis=0).T))]
        places = np.union1d(along, np.arange(0.0, along[-1], SPACING))
        x, y, z = (np.interp(places, along, each) for each in self.xyz.T)
        return KDTree(np.column_stack([x, y])), z

    def __reduce__(self):
        """Without its tree, so that the same flight always has the same bytes."""
        return Flight, (self.xyz,)

    def height(self, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
        """Height over z = 0 at positions (both m)."""
        tree, z = self._nearest
        return z[tree.query(np.asarray(xy, dtype=np.float64).reshape(-1, 2))[1]]

    def height_on_grid(
        self, x: Float[np.ndarray, " columns"], y: Float[np.ndarray, " rows"]
    ) -> Float[np.ndarray, "rows columns"]:
        """Heights where columns x and rows y cross (m)."""
        return self.height(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)).reshape(len(y), len(x))

    def is_too_steep(self, distance, rise) -> np.ndarray:
        """Nowhere, however it climbs."""
        return np.zeros(np.broadcast(distance, rise).shape, dtype=bool)

    def is_steep(self, x: float, y: float) -> bool:
        """Nowhere."""
        return False

    def problem(self, x: float, y: float) -> str:
        """Never asked for: an agent can be anywhere."""
        raise AssertionError(f"an agent can fly at {x}, {y}")

    def consists_of(self, index: Int64[np.ndarray, " k"]) -> Bool[np.ndarray, " k"]:
        """Whether triangles are parts of it: none is."""
        return np.zeros(len(index), dtype=bool)


def check_flight(world: "World", places: Float[np.ndarray, "n 3"]) -> None:
    """Refuse a flight under the ground that a world is known to have. Raises SettingError.

    Args:
        world: The world.
        places: x, y and z of the eye (m) along a path; a single one is a height over all of the field.
    """
    if world.ground is not None and (low := places[:, 2].min()) <= 0:
        raise SettingError(f"a flight at z = {low:g} m is under the ground of the world; give heights over 0")
    terrain = world.terrain
    if not isinstance(terrain, Terrain) or terrain.part is None:
        return
    if len(places) == 1:
        corners = terrain.triangles[terrain.is_ground].reshape(-1, 3).astype(np.float64)
        corners = corners[world.field.contains(corners[:, 0], corners[:, 1])]
        xy, ground, z = corners[:, :2], corners[:, 2], np.full(len(corners), places[0, 2])
    else:
        xy, ground, z = places[:, :2], np.nan_to_num(terrain.height(places[:, :2]), nan=-np.inf), places[:, 2]
    if (z <= ground).any():
        lowest = int((z - ground).argmin())
        raise SettingError(
            f"a flight at z = {z[lowest]:g} m is under the ground of the world, which is {ground[lowest]:.2f} m high at "
            f"{place_text(*xy[lowest].tolist())}; give heights over that"
        )
