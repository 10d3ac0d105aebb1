"""The rounding of what an encoding makes of a view, so that it is the same on every processor."""

import attrs
import numpy as np

from .encoding_steps import Images, PixelStep

LEVELS = 4096  # of the values of a feature image from 0 to 1; a view has 256


@attrs.frozen
class Round(PixelStep):
    """Each value rounded to a multiple of 1 / LEVELS.

    What differs in the last bits from processor to processor goes no further. And in float64, sums of products of such values are
    exact in any order: where two views differ equally from a third, they do so on every processor.
    """

    def __call__(self, images: Images) -> Images:
        levels = images * np.float32(LEVELS)
        np.rint(levels, out=levels)
        levels *= np.float32(1 / LEVELS)
        return levels

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        return np.floor(low * LEVELS) / LEVELS, np.ceil(high * LEVELS) / LEVELS
