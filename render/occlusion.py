"""How much of what an eye sees is very close to it."""

from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int64

from tussock.world.full_pose import eye_axes
from tussock.world.geometry import column_azimuths
from tussock.world.scene import World

from .eye import Eye
from .poses import AnyPoses, poses_of_eye
from .triangle_tree import tree_of

RAY_SPACING = np.radians(5.0)  # rad


def covered_within(world: World, eye: Eye, poses: AnyPoses, distance: float) -> Float[np.ndarray, " n"]:
    """Share of what an eye sees in which something is closer than a distance; the ground does not count.

    It casts rays RAY_SPACING apart, the same for every heading, and tests them as render/scanline.py does: a ray d meets the
    triangle (a, b, c) where it passes all three edges on one side, at the distance D / (N . d). So the result depends on where
    surfaces are, not on how they are split into triangles.

    Args:
        world: The world.
        eye: Its elevations, height and visible pixels are used.
        poses: (n, 3) or (n, 6) Where the eye is.
        distance: The distance (m).

    Returns:
        (n,) The shares, 0 to 1.
    """
    poses = poses_of_eye(world, eye, poses)
    position = poses[:, [0, 1, 3]]
    which, close = tree_of(world).within(position - distance, position + distance)
    solid = _is_object(world, close)
    which, close = which[solid], close[solid]
    shares = np.zeros(len(poses))
    for k in np.unique(which).tolist():  # a few; nothing is close to most
        triangles, heading = world.triangles[close[which == k]].astype(float) - position[k], poses[k, 2]
        if poses[k, 4:].any():  # a tilted eye looks ahead along x in its own frame
            triangles, heading = triangles @ eye_axes(poses[k : k + 1])[0].T, 0.0
        shares[k] = _covered(triangles, eye, heading, distance, world.double_sided)
    return shares


def _is_object(world: World, index: Int64[np.ndarray, " k"]) -> Bool[np.ndarray, " k"]:
    """Whether triangles, by their index among the surfaces of a world, are not of its ground."""
    own = index >= len(world.triangles)
    return ~own if world.terrain is None else ~own & ~world.terrain.consists_of(index)


def _covered(
    triangles: Float[np.ndarray, "m 3 3"], eye: Eye, heading: float, distance: float, double_sided: bool
) -> float:
    """The share for an eye at the origin."""
    rays, rows, azimuths = _rays(eye.top, eye.bottom)
    a, b, c = triangles.transpose(1, 0, 2)
    volume = (a * np.cross(b, c)).sum(axis=1)
    visible = volume != 0 if double_sided else volume < 0
    a, b, c, volume = a[visible], b[visible], c[visible], volume[visible]
    inside = np.ones((len(rays), len(volume)), dtype=bool)
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= rays @ np.cross(start, end).T * volume >= 0
    inverse_distance = rays @ (np.cross(b - a, c - a) / volume[:, None]).T  # negative behind the eye
    covered = (inside & (inverse_distance > 1 / distance)).any(axis=1)
    if eye.masked:
        row = ((np.arange(rows) + 0.5) * eye.height / rows).astype(int)
        column = np.floor((0.5 - (azimuths - heading) / (2 * np.pi)) * eye.width).astype(int) % eye.width
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
