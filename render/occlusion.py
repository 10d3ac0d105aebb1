"""How much of what an eye sees is very near to it."""

import dataclasses

import numpy as np

from tussock.world.geometry import Pose, column_azimuths
from tussock.world.scene import World

from .eye import Eye

APART = np.radians(5.0)  # between rays


def covered_within(world: World, eye: Eye, pose: Pose, distance: float) -> float:
    """Share of a panorama (0 to 1) in which a triangle of the world, the ground not among them, is nearer than `distance` (m).

    Rays of the eye's elevations, APART from each other and the same for every heading: what counts is where surfaces are, not
    how they are cut into triangles. Nearness is that of the scanlines (render/scanline.py): a ray d meets the triangle
    (a, b, c) where it passes its three edges on one side, at D / (N . d).
    """
    rows = max(1, round((eye.top - eye.bottom) / APART))
    elevations = dataclasses.replace(eye, height=rows).elevations()[:, None]
    azimuths = column_azimuths(round(2 * np.pi / APART))
    up = np.broadcast_to(np.sin(elevations), (rows, len(azimuths)))
    rays = np.stack([np.cos(elevations) * np.cos(azimuths), np.cos(elevations) * np.sin(azimuths), up]).reshape(3, -1).T
    at = np.array([pose.x, pose.y, eye.z])
    near = np.flatnonzero(
        (world.triangles.min(axis=1) < at + distance).all(axis=1)
        & (world.triangles.max(axis=1) > at - distance).all(axis=1)
    )
    a, b, c = (world.triangles[near].astype(float) - at).transpose(1, 0, 2)
    volume = (a * np.cross(b, c)).sum(axis=1)
    seen = volume != 0 if world.double_sided else volume < 0
    a, b, c, volume = a[seen], b[seen], c[seen], volume[seen]
    inside = np.ones((len(rays), len(volume)), dtype=bool)
    for one, other in ((a, b), (b, c), (c, a)):
        inside &= rays @ np.cross(one, other).T * volume >= 0
    # The nearness of what is behind is negative.
    nearness = rays @ (np.cross(b - a, c - a) / volume[:, None]).T
    return float((inside & (nearness > 1 / distance)).any(axis=1).mean())
