"""Colours of triangles in binary STL files. Programs keep them in the two bytes that the format leaves unused, in one of two ways."""

from pathlib import Path

import numpy as np
from jaxtyping import UInt8, UInt16


def stl_colours(attributes: UInt16[np.ndarray, " n"], path: Path) -> UInt8[np.ndarray, "n 4"] | None:
    """The colours of the triangles, or None where the file has none.

    With `COLOR=` and four bytes in its header (Materialise Magics) these are the colour of all triangles that have none of their own;
    a triangle's has five bits each of red (lowest), green and blue, and the highest bit is 0. Otherwise (VisCAM, SolidView) it has five
    bits each of blue (lowest), green and red, and the highest bit is 1.

    Args:
        attributes: The two bytes of each triangle.
        path: The file, whose header has 80 bytes.
    """
    with path.open("rb") as file:
        _, found, after = file.read(80).partition(b"COLOR=")
    values = np.asarray(attributes).astype(np.int64).ravel()
    low, middle, high = (np.rint((values >> shift & 31) * 255 / 31).astype(np.uint8) for shift in (0, 5, 10))
    full = np.full(len(values), 255, np.uint8)
    own = values >> 15 == (0 if found else 1)
    if found and len(after) >= 4:
        return np.where(own[:, None], np.column_stack([low, middle, high, full]), np.frombuffer(after[:4], np.uint8))
    return np.where(own[:, None], np.column_stack([high, middle, low, full]), np.uint8(255)) if own.any() else None
