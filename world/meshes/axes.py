"""Turns between files with another axis up and z up, as in tussock. They swap and negate coordinates, so they are exact."""

import numpy as np
from jaxtyping import Float


def turned_z_up(xyz: Float[np.ndarray, "n 3"], up: str) -> Float[np.ndarray, "n 3"]:
    """Points of a file in which the axis `up` ("x", "y" or "z") points up, with z up.

    With y up, the file's x stays x, and its -z becomes y: the turn by 90 degrees about x between glTF and z-up programs.
    With x up, the axes are exchanged in turn: the file's y becomes x, and its z becomes y.
    """
    x, y, z = xyz.T
    return np.column_stack({"x": (y, z, x), "y": (x, -z, y), "z": (x, y, z)}[up])


def turned_y_up(xyz: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Points with z up as glTF wants them, with y up: the inverse of `turned_z_up(xyz, "y")`."""
    x, y, z = xyz.T
    return np.column_stack((x, z, -y))
