"""The sky of a light, added to views: brighter towards the sun, as the CIE's standard skies are (world/light.py)."""

import math

import numpy as np
from jaxtyping import Float, Float32

from tussock.world.full_pose import eye_axes
from tussock.world.geometry import column_azimuths
from tussock.world.light import sky_colours
from tussock.world.scene import World, once_per_world
from tussock.world.settings import RGB

from .compile import compiled
from .eye import Eye
from .poses import Views
from .spectrum import HUMAN

PER_DEGREE = 2  # entries of the table of the sky


def add_sky(
    world: World, eye: Eye, poses: Float[np.ndarray, "n 6"], views: Views, start: int = 0, stop: int | None = None
) -> None:
    """Add the sky to views of a lit world, which were drawn with a black one; nothing where the world has no light.

    Args:
        world: The world.
        eye: The eye.
        poses: Full poses of the views.
        views: (n, height, width, 4) of them, changed in place.
        start, stop: Only columns start..stop-1 are changed.
    """
    if world.light is None:
        return
    directions, columns = (column_azimuths(eye.width), eye.elevations()), (start, eye.width if stop is None else stop)
    table = _table(world) if eye.spectrum == HUMAN else _insect_table(world)
    _add(table, *directions, poses, eye_axes(poses), *columns, views)


@once_per_world
def _table(world: World) -> Float32[np.ndarray, "rows columns 3"]:
    """Those of a world's own sky."""
    return _colours(world, world.sky_rgb)


@once_per_world
def _insect_table(world: World) -> Float32[np.ndarray, "rows columns 3"]:
    """The same with ultraviolet in place of red: as bright as a white sky is."""
    table = _table(world).copy()
    table[..., 0] = _colours(world, (255, 255, 255))[..., 0]
    return table


def _colours(world: World, sky_rgb: RGB) -> Float32[np.ndarray, "rows columns 3"]:
    """Colours of the sky (0..255): rows by elevation from the horizon up, columns by azimuth from -180 degrees to 180 degrees."""
    assert world.light is not None
    elevation = np.radians(np.arange(90 * PER_DEGREE + 1) / PER_DEGREE)[:, None]
    azimuth = np.radians(np.arange(360 * PER_DEGREE + 1) / PER_DEGREE - 180)
    level = np.cos(elevation)
    directions = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation) + 0 * azimuth], axis=-1)
    colours = sky_colours(world.light, sky_rgb, directions.reshape(-1, 3))
    return colours.reshape(*directions.shape).astype(np.float32)


@compiled(error_model="numpy")
def _add(table, azimuths, elevations, poses, axes, start, stop, views):
    """See `add_sky`. The sky in the middle of a pixel is weighed by the share of the pixel that shows it, 255 - alpha."""
    for i in range(len(views)):
        heading, is_level = poses[i, 2], poses[i, 4] == 0.0 and poses[i, 5] == 0.0
        for r in range(len(elevations)):
            rise, level = math.sin(elevations[r]), math.cos(elevations[r])
            for c in range(start, stop):
                if views[i, r, c, 3] == 255:
                    continue
                if is_level:
                    _blend(table, elevations[r], azimuths[c] + heading, views[i, r, c])
                    continue
                ahead, left = level * math.cos(azimuths[c]), level * math.sin(azimuths[c])
                x = axes[i, 0, 0] * ahead + axes[i, 1, 0] * left + axes[i, 2, 0] * rise
                y = axes[i, 0, 1] * ahead + axes[i, 1, 1] * left + axes[i, 2, 1] * rise
                z = axes[i, 0, 2] * ahead + axes[i, 1, 2] * left + axes[i, 2, 2] * rise
                _blend(table, math.asin(max(-1.0, min(1.0, z))), math.atan2(y, x), views[i, r, c])


@compiled(error_model="numpy", inline="always")
def _blend(table, elevation, azimuth, pixel):
    """Add the sky in a direction (rad) to a pixel, between the four entries of the table around it."""
    rows, columns = table.shape[0] - 1, table.shape[1] - 1
    row, turns = max(0.0, elevation * (2 / math.pi)) * rows, azimuth * (0.5 / math.pi) + 0.5
    column = (turns - math.floor(turns)) * columns
    low, near = min(int(row), rows - 1), min(int(column), columns - 1)
    up, across, share = row - low, column - near, (255 - pixel[3]) * (1 / 255)
    a, b = share * (1 - up) * (1 - across), share * (1 - up) * across
    c, d = share * up * (1 - across), share * up * across
    for k in range(3):
        sky = a * table[low, near, k] + b * table[low, near + 1, k]
        sky += c * table[low + 1, near, k] + d * table[low + 1, near + 1, k]
        pixel[k] = np.uint8(min(255.0, pixel[k] + sky + 0.5))
