"""Which way is up in a glTF file that may have been written without turning it to the y-up axes of its standard."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

LEVEL = 0.999  # of the normal's length along an axis, from which a triangle is level (within 2.6 degrees)
NEARLY_ALL = 0.95  # of the area
GROUND = 0.05  # m; what is level and as near to 0 may be the ground
FOOT = 0.01  # m; what stands on the ground begins as near to 0


def only_stands_with_z_up(corners: Sequence[Float[np.ndarray, "_ 3"]], metres: float) -> bool:
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
