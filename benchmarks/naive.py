"""A first version of each computation in numpy. The project's own must give the same results, and be faster."""

import numpy as np
from jaxtyping import Float, UInt8

from tussock.render import Eye
from tussock.world import World
from tussock.world.geometry import column_azimuths


def view(
    world: World, eye: Eye, pose: Float[np.ndarray, "3"], columns: slice = slice(None)
) -> UInt8[np.ndarray, "h w 4"]:
    """Some columns of a panorama, one ray a pixel: every ray against every triangle (Moeller and Trumbore 1997)."""
    triangles, rgb = world.surfaces()
    a, b, c = (corner - np.array([pose[0], pose[1], eye.z]) for corner in triangles.astype(float).transpose(1, 0, 2))
    ab, ac = b - a, c - a
    colours = np.vstack([np.column_stack([rgb, np.full(len(rgb), 255)]), [*world.sky_rgb, 0]]).astype(np.uint8)
    elevation, strips = eye.elevations(), []
    for azimuth in (pose[2] + column_azimuths(eye.width))[columns]:
        ray = np.stack(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], axis=1
        )
        p = np.cross(ray[:, None], ac)  # (h, n, 3)
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = 1 / (p * ab).sum(axis=2)
            u = -(p * a).sum(axis=2) * scale
            q = np.cross(-a, ab)
            v = (ray @ q.T) * scale
            distance = (q * ac).sum(axis=1) * scale
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
        distance = np.where(hit, distance, np.inf)
        nearest = np.where(np.isfinite(distance.min(axis=1)), distance.argmin(axis=1), -1)
        strips.append(colours[nearest])
    return np.stack(strips, axis=1)


def scan(view: Float[np.ndarray, "h w"], snapshots: Float[np.ndarray, "m h w"]) -> Float[np.ndarray, " w"]:
    """Minus the RMS difference from the nearest snapshot, at each rotation: a loop that rolls the view."""
    rolled = (np.roll(view, k, axis=1) for k in range(view.shape[1]))
    return -np.sqrt([((turned - snapshots) ** 2).mean(axis=(1, 2)).min() for turned in rolled])


def infomax_scan(view: Float[np.ndarray, "h w"], weights: Float[np.ndarray, "units inputs"]) -> Float[np.ndarray, " w"]:
    """Minus the summed absolute activity at each rotation."""
    return -np.array([np.abs(weights @ np.roll(view, k, axis=1).ravel()).sum() for k in range(view.shape[1])])


def infomax_update(
    weights: Float[np.ndarray, "units inputs"], view: Float[np.ndarray, " inputs"], rate: float
) -> Float[np.ndarray, "units inputs"]:
    """The weights after one view, by the formula as it is printed."""
    u = weights @ view
    return weights + rate * (weights - np.outer(np.tanh(u) + u, u) @ weights)
