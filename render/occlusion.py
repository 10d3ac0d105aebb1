"""How much of what an eye sees is very close to it."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from tussock.world.geometry import Pose, column_azimuths
from tussock.world.scene import World

from .eye import Eye
from .poses import poses_of_eye
from .triangle_tree import tree_of

RAY_SPACING = np.radians(5.0)  # rad


def covered_within(world: World, eye: Eye, pose: Pose, distance: float) -> float:
    """Share of what an eye sees in which something is closer than a distance; the ground does not count.

    It casts rays RAY_SPACING apart, the same for every heading, and tests them as render/scanline.py does: a ray d meets the
    triangle (a, b, c) where it passes all three edges on one side, at the distance D / (N . d). So the result depends on where
    surfaces are, not on how they are split into triangles.

    Args:
        world: The world.
        eye: Its elevations, height and visible pixels are used.
        pose: Where the eye is.
        distance: The distance (m).

    Returns:
        The share, 0 to 1.
    """
    x, y, _, z = poses_of_eye(world, eye, [pose])[0]
    position = np.array([x, y, z])
    close = tree_of(world).within(position - distance, position + distance)
    close = close[close < len(world.triangles)]  # the world's own ground is after its triangles
    if world.terrain is not None:
        close = close[~world.terrain.is_ground[close]]
    if len(close) == 0:  # as at most poses
        return 0.0
    rays, rows, azimuths = _rays(eye.top, eye.bottom)
    a, b, c = (world.triangles[close].astype(float) - position).transpose(1, 0, 2)
    volume = (a * np.cross(b, c)).sum(axis=1)
    visible = volume != 0 if world.double_sided else volume < 0
    a, b, c, volume = a[visible], b[visible], c[visible], volume[visible]
    inside = np.ones((len(rays), len(volume)), dtype=bool)
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= rays @ np.cross(start, end).T * volume >= 0
    inverse_distance = rays @ (np.cross(b - a, c - a) / volume[:, None]).T  # negative behind the eye
    covered = (inside & (inverse_distance > 1 / distance)).any(axis=1)
    if eye.masked:
        row = ((np.arange(rows) + 0.5) * eye.height / rows).astype(int)
        column = np.floor((0.5 - (azimuths - pose.heading) / (2 * np.pi)) * eye.width).astype(int) % eye.width
        seen = eye.visible()[row[:, None], column].ravel()
        covered = covered[seen] if seen.any() else covered
    return float(covered.mean())


@lru_cache(maxsize=8)
def _rays(top: float, bottom: float) -> tuple[Float[np.ndarray, "rays 3"], int, Float[np.ndarray, " columns"]]:
    """Unit vectors of the rays, row by row, between two elevations (rad); the number of rows; and the azimuths of the columns (rad)."""
    rows = max(1, round((top - bottom) / RAY_SPACING))
    elevations = Eye(height=rows, top=top, bottom=bottom).elevations()[:, None]
    azimuths = column_azimuths(round(2 * np.pi / RAY_SPACING))
    up = np.broadcast_to(np.sin(elevations), (rows, len(azimuths)))
    rays = np.stack([np.cos(elevations) * np.cos(azimuths), np.cos(elevations) * np.sin(azimuths), up]).reshape(3, -1).T
    return rays, rows, azimuths
