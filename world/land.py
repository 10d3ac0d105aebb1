"""The land of a generated world with relief: the mesh of its ground, on which all else of the world stands."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32

from .errors import SettingError
from .geometry import Bounds
from .ground_cover import SPECKLE_Z, ground_corners, shades, uneven_grid
from .params import WorldParams
from .plant_parts import Plant, sunlit
from .relief import RUT_MARGIN, Relief
from .terrain import MAX_SLOPE, Terrain

HILL_WIDTH = 0.1  # m; width of the ground's triangles in the field where it has no speckles, mounds or ruts
BAND = 10  # widths of a triangle; around the field, triangles are twice as wide in each further band
ACROSS = 8  # triangles across a mound or a rut
MAX_POINTS = 2 * 10**7  # that mounds and ruts are looked for at; 112 m x 112 m with ruts or mounds that are 20 cm wide
SOIL = 0.9  # brightness of the soil of mounds and ruts


@dataclass(frozen=True, eq=False)
class Land:
    """The ground of a generated world with relief.

    Attributes:
        ground: The triangles of the ground; their front sides look up.
        surface: The same triangles, to look up heights.
        relief: The function whose heights their corners have, but for speckles.
    """

    ground: Plant
    surface: Terrain
    relief: Relief

    def height(self, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
        """Height of the ground at positions (both m), as it is drawn."""
        height = self.surface.height(xy)
        beyond = np.isnan(height)  # the end of the ground
        height[beyond] = self.relief.height(np.asarray(xy, np.float64)[beyond])
        return height

    def raised(
        self, triangles: Float32[np.ndarray, "m 3 3"], below: Float[np.ndarray, "m 3 2"]
    ) -> Float32[np.ndarray, "m 3 3"]:
        """Triangles of what is on flat ground (m), with each corner raised by the height of the ground at a position (m)."""
        lift = self.height(below.reshape(-1, 2)).reshape(-1, 3)
        return np.dstack([triangles[..., :2], triangles[..., 2] + lift.astype(np.float32)])


def land_of(p: WorldParams, rng: np.random.Generator) -> Land | None:
    """The ground of a world, or None where it is flat.

    Args:
        p: Parameters of the world.
        rng: Generator to draw from.
    """
    if not p.has_relief:
        return None
    from scipy.spatial import Delaunay  # takes half a second, which a world from a file need not wait for

    relief, (mesh, colours) = Relief.of(p, rng), rng.spawn(2)
    corners = _corners(p, relief, mesh)
    z = relief.height(corners)
    if p.speckle or p.moss_share:
        z += mesh.uniform(*SPECKLE_Z, len(corners))
    triangles = _facing_up(np.column_stack([corners, z])[Delaunay(corners).simplices])
    middle = triangles[..., :2].mean(axis=1)
    soil = shades(p, middle, colours) if p.speckle or p.moss_share else np.array(p.ground_rgb)
    rgb = soil * np.where(relief.is_dug(middle), SOIL, 1.0)[:, None]
    ground = sunlit(triangles, rgb)
    return Land(ground, Terrain(ground.triangles, np.ones(len(triangles), dtype=bool), MAX_SLOPE), relief)


def _corners(p: WorldParams, relief: Relief, rng: np.random.Generator) -> Float[np.ndarray, "n 2"]:
    """Corners of the triangles of the ground (m): close together where there are mounds and ruts, far apart outside of the field."""
    width = min(HILL_WIDTH, p.speckle_size) if p.speckle or p.moss_share else HILL_WIDTH
    margin = p.land.x_max - p.field.x_max
    corners = ground_corners(p.field, width, margin, rng, BAND)
    fine = min(p.mound_width / ACROSS if p.mound_density else width, p.rut_width / ACROSS if p.rut_depth else width)
    if fine >= width:
        return corners
    x0, y0, x1, y1 = p.field.widened(max(p.border + p.mound_width if p.mound_density else 0.0, RUT_MARGIN))
    land = p.land
    area = Bounds(max(x0, land.x_min), max(y0, land.y_min), min(x1, land.x_max), min(y1, land.y_max))
    if (points := np.prod(area.size / fine)) > MAX_POINTS:
        raise SettingError(
            f"ground as fine as {100 * fine:.2g} cm, as these mounds or ruts need, would have {points:,.0f} points in this field, and "
            f"{MAX_POINTS:,} is the limit; give wider ones or a smaller field"
        )
    details = uneven_grid(area, fine, rng)
    is_kept = ~relief.is_dug(corners) | ~area.contains(*corners.T)
    is_kept[-4:] = True  # the corners of the ground
    return np.concatenate([details[relief.is_dug(details)], corners[is_kept]])


def _facing_up(triangles: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 3 3"]:
    """The triangles, with their corners counter-clockwise as seen from above."""
    side, other = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    down = side[:, 0] * other[:, 1] < side[:, 1] * other[:, 0]
    triangles[down] = triangles[down][:, ::-1]
    return triangles
