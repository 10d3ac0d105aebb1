"""Panoramas of the raw pictures of panoramic cameras, by the geometry of each lens (lenses.py)."""

import math
from functools import lru_cache

import attrs
import cv2
import numpy as np
from jaxtyping import Bool

from tussock.world.errors import SettingError
from tussock.world.geometry import column_azimuths

from .lenses import MAX_PIXEL, MAX_SIZE, Fisheye, Omnidirectional, Panorama, PanoramaPart, Ring
from .pictures import Picture

MAX_SAMPLES = 3 * 10**7  # looked up for one panorama
MAX_STRIDE = 16  # samples along one side of a pixel


@attrs.frozen
class Unwrapping:
    """How panoramas are made of the pictures of one camera.

    Attributes:
        lens: Maps directions to pixels.
        width: Columns of a panorama, which cover 360 degrees.
        height: Rows of a panorama.
        top: Elevation of its upper edge (rad).
        bottom: Elevation of its lower edge (rad).
    """

    lens: Ring | Panorama | Fisheye | Omnidirectional
    width: int
    height: int
    top: float
    bottom: float

    def __attrs_post_init__(self):
        if not (
            4 <= self.width <= MAX_SIZE and 1 <= self.height <= MAX_SIZE and self.width * self.height <= MAX_SAMPLES
        ):
            raise SettingError(f"a panorama of {self.width} x {self.height}; give at least 4 x 1, and fewer pixels")
        if not -math.pi / 2 <= self.bottom < self.top <= math.pi / 2:
            low, high = math.degrees(self.bottom), math.degrees(self.top)
            raise SettingError(f"a panorama from {low:g} to {high:g} degrees; give -90 <= bottom < top <= 90")

    def __call__(self, picture: Picture) -> Picture:
        """The panorama of a picture: averaged where a pixel covers several of the picture, black where it shows nothing."""
        if max(picture.shape[:2]) > MAX_SIZE:
            raise SettingError(
                f"a picture of {picture.shape[1]} x {picture.shape[0]}; give sides up to {MAX_SIZE} pixels"
            )
        x, y = _tables(self)
        around = type(self.lens) is Panorama  # its left edge is beside its right edge
        border = cv2.BORDER_WRAP if around else cv2.BORDER_CONSTANT
        samples = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=border)
        if samples.shape[:2] == (self.height, self.width):
            return samples
        return cv2.resize(samples, (self.width, self.height), interpolation=cv2.INTER_AREA)

    def seen(self, height: int, width: int) -> Bool[np.ndarray, "rows columns"]:
        """Which pixels of the panorama a picture of a size shows. They may be all."""
        samples = 3 if isinstance(self.lens, PanoramaPart) else 1  # in each column, in which its edges may be
        x, y = _base_tables(self, across=samples)
        margin = 0.5 if isinstance(self.lens, Panorama) else 0.0
        inside = (x >= -margin) & (x <= width - 1 + margin) & (y >= 0) & (y <= height - 1)  # False for nan
        return np.asarray(inside.reshape(self.height, self.width, samples).all(axis=2))


def _base_tables(unwrapping: Unwrapping, across: int = 1, down: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """x and y of each pixel of the panorama, or of `across` x `down` samples in each, nan where nothing is seen."""
    n = unwrapping.height * down
    elevation = unwrapping.top - (np.arange(n) + 0.5) * (unwrapping.top - unwrapping.bottom) / n
    with np.errstate(invalid="ignore", over="ignore"):
        pixels = unwrapping.lens.pixels(column_azimuths(unwrapping.width * across), elevation)
    return pixels[..., 0], pixels[..., 1]


@lru_cache(maxsize=4)
def _tables(unwrapping: Unwrapping) -> tuple[np.ndarray, np.ndarray]:
    """x and y of each sample, as cv2.remap takes them."""
    x, y = _base_tables(unwrapping, 2, 2)
    across, down = (_stride(2 * np.hypot(np.diff(x, axis=axis), np.diff(y, axis=axis))) for axis in (1, 0))
    while across * down > 1 and across * down * unwrapping.width * unwrapping.height > MAX_SAMPLES:
        across, down = max(1, across // 2), max(1, down // 2)
    x, y = _base_tables(unwrapping, across, down)
    outside = ~(np.isfinite(x) & np.isfinite(y))
    x, y = (np.where(outside | (np.abs(each) > MAX_PIXEL), -10, each).astype(np.float32) for each in (x, y))
    return x, y


def _stride(distances: np.ndarray) -> int:
    """How many samples a pixel needs that covers this many pixels of the picture."""
    distances = distances[np.isfinite(distances)]
    return int(np.clip(math.ceil(np.median(distances) - 0.25), 1, MAX_STRIDE)) if len(distances) else 1
