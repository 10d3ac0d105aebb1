"""Remarks where the numbers in a mesh suggest another unit, or that another axis is up."""

import numpy as np
from jaxtyping import Float

from .axes import turned_z_up
from .reading import MeshReading

WIDE = 1000.0  # m; few worlds that are walked are wider
NARROW = 0.1  # m
THIN = 0.3  # an axis on which a mesh is this much shorter than on both others is probably up
TALL = 0.95  # as high as wide
AXES = ("x", "y", "z")


def remarks_on_axes_and_units(corners: list[Float[np.ndarray, "_ 3"]], reading: MeshReading, up: str) -> list[str]:
    """What the numbers suggest, each with the flag that reads them so.

    Args:
        corners: Of the triangles of each mesh, in the axes and the unit of the file.
        reading: How the file is read.
        up: The axis of the file that is taken as up.
    """
    low = np.min([each.min(axis=0) for each in corners], axis=0)
    high = np.max([each.max(axis=0) for each in corners], axis=0)
    with np.errstate(all="ignore"):
        size = high - low
    if not np.isfinite(size).all():
        return []
    return _remarks_on_units(size, reading, up) + _remarks_on_axes(size, reading, up)


def _remarks_on_units(size: Float[np.ndarray, "3"], reading: MeshReading, up: str) -> list[str]:
    x, y, _ = np.abs(turned_z_up(size[None], up)[0]) * reading.metres
    width = max(x, y)
    if reading.unit_given:
        return []
    if width > WIDE:
        return [f"it is {width:,.0f} m wide; if it is in millimetres, give --unit mm (or cm, in, ft, or --scale)"]
    if 0 < width < NARROW:
        return [f"it is only {width:g} m wide; if its unit is longer than a metre, give --scale with the metres in it"]
    return []


def _remarks_on_axes(size: Float[np.ndarray, "3"], reading: MeshReading, up: str) -> list[str]:
    if reading.up != "auto" or size.min() <= 0:  # a flat one may be a floor or a wall
        return []
    shown = " x ".join(f"{each * reading.metres:.3g}" for each in size)
    thin = int(size.argmin())
    if AXES[thin] != up and size[thin] < THIN * np.sort(size)[1]:
        return [
            f"{AXES[thin]} seems to be up (it is {shown} m); it is read with {up} up: give --up {AXES[thin]}, or --up {up} if that is right"
        ]
    height, width = size[AXES.index(up)], np.delete(size, AXES.index(up)).max()
    if height > TALL * width:
        return [f"it is as high as wide ({shown} m) with {up} up; if another axis is up, give --up x, y or z"]
    return []
