"""Which axis of a mesh file is up; a glTF file may have been written without turning it to the y-up axes of its standard."""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from .reading import MeshReading

log = logging.getLogger(__name__)

LEVEL = 0.999  # of the normal's length along an axis, from which a triangle is level (within 2.6 degrees)
NEARLY_ALL = 0.95  # of the area
GROUND = 0.05  # m; what is level and as near to 0 may be the ground
FOOT = 0.01  # m; what stands on the ground begins as near to 0


def axis_up(path: Path, meshes: Sequence[Any], reading: MeshReading, *, gltf: bool, own: Any) -> str:
    """The axis ("x", "y" or "z") of a file that points up: the first of these that is known.

    1. The axis that is given.
    2. z in formats other than glTF.
    3. In what tussock wrote: z in its first version, later y, as the standard of glTF says.
    4. z where the meshes stand only so, which is logged; else the standard's y.

    Args:
        path: The file, for the warning.
        meshes: Its meshes, as trimesh has them, each moved to its place.
        reading: The axis and the unit that are given.
        gltf: Whether it is a glTF file.
        own: The data that tussock wrote into it, or None.
    """
    if reading.up != "auto":
        return reading.up
    if not gltf:
        return "z"
    if own is not None:
        return "z" if isinstance(own, dict) and own.get("version") == 1 else "y"
    corners = [np.asarray(mesh.vertices, dtype=np.float64)[mesh.faces].reshape(-1, 3) for mesh in meshes]
    with np.errstate(all="ignore"):
        only_z = _only_stands_with_z_up(corners, reading.metres)
    if only_z:
        log.warning(
            f"{path}: glTF has y up, but then nearly all of it would hang level in the air, and with z up it stands on the ground; "
            "z is taken as up, and --up y takes the standard's axis"
        )
    return "z" if only_z else "y"


def _only_stands_with_z_up(corners: Sequence[Float[np.ndarray, "_ 3"]], metres: float) -> bool:
    """Whether with y up nearly all of a mesh would be level and hang in the air, and with z up it stands on z = 0.

    So do walls, fences and leaf cards in files of programs that do not turn to y up.

    Args:
        corners: Of the triangles of each mesh, three for each, in the axes and the unit of the file.
        metres: In a unit of the file.
    """
    a, b, c = (np.concatenate([each[k::3] for each in corners]) * metres for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    height = np.abs((a + b + c)[:, 1] / 3)
    hanging = (np.abs(normal[:, 1]) > LEVEL * area) & (height > GROUND)
    lowest = min(float(each[:, 2].min()) for each in (a, b, c))
    return bool(area[hanging].sum() > NEARLY_ALL * area.sum() > 0 and abs(lowest) < FOOT)
