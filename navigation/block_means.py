"""Means of blocks of pixels, fast; equal to numpy's to the last bit where two or more blocks are side by side."""

from functools import reduce

import numpy as np
from jaxtyping import Float32


def block_means(images: Float32[np.ndarray, "n height width"], rows: int, columns: int) -> Float32[np.ndarray, "n h w"]:
    """Means of blocks of pixels.

    Args:
        images: Their sides are multiples of a block's.
        rows: Of pixels in a block.
        columns: Likewise.
    """
    n, height, width = images.shape
    blocks = images.reshape(n, height // rows, rows, width // columns, columns)
    if columns >= 8:  # then numpy adds in another order
        return blocks.mean(axis=(2, 4), dtype=np.float32)
    # numpy adds up the columns of each row of a block, and then its rows. Whole images are added here: 8 to 20 times faster.
    sums = reduce(np.add, (blocks[..., column] for column in range(columns)))
    return reduce(np.add, (sums[:, :, row] for row in range(rows))) / np.float32(rows * columns)
