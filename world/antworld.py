"""AntWorld `.bin` worlds, as the original program saves them."""

from pathlib import Path

import numpy as np

from .errors import FileError
from .geometry import Bounds
from .meshes.axes import turned_z_up
from .meshes.reading import MeshReading
from .route_files import read_planes
from .scene import Ground, World
from .settings import MAX_COORDINATE
from .world_data import DEFAULT_SKY

# How the original program draws its worlds: green vegetation on sand (sussex/README.md has frames of it).
ANTWORLD_TINT = (0.0, 1.0, 0.0)
ANTWORLD_GROUND = (229, 183, 90)


def read_antworld(path: Path, reading: MeshReading) -> World:
    """An AntWorld `.bin`: planes x0 x1 x2 y0 y1 y2 z0 z1 z2 R G B, in green on sand as its own program draws it."""
    planes = read_planes(path, 12, "an AntWorld world")
    invalid = np.flatnonzero(~(np.abs(planes) <= MAX_COORDINATE).all(axis=0))
    if len(invalid):
        raise FileError(
            f"triangle {invalid[0]} holds a number that is not finite, or over {MAX_COORDINATE:g}; a world needs metres and colours"
        )
    shade = planes[9:]
    if shade.min() < 0 or shade.max() > 1:
        raise FileError(
            f"colours run from {shade.min():g} to {shade.max():g}; an AntWorld world has 0..1 (is it a world?)"
        )
    corners = planes[:9].reshape(3, 3, -1).transpose(2, 1, 0).reshape(-1, 3)  # (xyz, corner, n) -> (n corners, xyz)
    up = "z" if reading.up == "auto" else reading.up
    triangles = (turned_z_up(corners, up) * reading.metres).reshape(-1, 3, 3)
    rgb = np.rint(255 * shade.T * ANTWORLD_TINT).astype(np.uint8)
    bounds = Bounds(*triangles[..., :2].min(axis=(0, 1)).tolist(), *triangles[..., :2].max(axis=(0, 1)).tolist())
    return World(
        triangles=np.ascontiguousarray(triangles, dtype=np.float32),
        rgb=rgb,
        ground=Ground(ANTWORLD_GROUND, bounds),
        sky_rgb=DEFAULT_SKY,
        field=bounds,
    )
