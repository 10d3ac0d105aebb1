"""Steps of an encoding that prepare views as a published program does, where that cannot be done on the whole ring at once."""

from typing import ClassVar

import attrs
import cv2
import numpy as np
from jaxtyping import Bool, Float32

from tussock.world.errors import SettingError
from tussock.world.settings import number

from .encoding_steps import AveragingStep, EncodingStep, Images, PixelStep, Views, Visible, check_whole


@attrs.frozen
class Green(PixelStep):
    """The green channel, 0..1.

    Attributes:
        sky: What open sky counts as, where views have alpha. The program of Ardin et al. (2016) has a sky of (0, 255, 255): 1.
    """

    name: ClassVar[str] = "green"
    takes_views: ClassVar[bool] = True
    sky: float = number(low=0, high=1)

    def __call__(self, images: Views) -> Images:
        green = images[..., 1] * np.float32(1 / 255)
        if images.shape[-1] == 3:
            return green
        covered = images[..., 3] * np.float32(1 / 255)
        return covered * green + (1 - covered) * np.float32(self.sky)


@attrs.frozen
class CentreMeans(AveragingStep):
    """Mean of the central half of square blocks of pixels. Blocks overlap where there are more of them than their width allows.

    Attributes:
        block: Rows and columns of a block, a multiple of 4. It must divide the height.
        every: Columns from one block to the next, around the ring. It must divide the width.
    """

    name: ClassVar[str] = "centre-means"
    block: float = number(low=4, high=400)
    every: float = number(low=1, high=400)

    def __attrs_post_init__(self):
        for parameter in ("block", "every"):
            check_whole(self, parameter, getattr(self, parameter))
        if self.block % 4:
            raise SettingError(f"{self.name}: block is {self.block:g}; give a multiple of 4")

    def __call__(self, images: Images) -> Float32[np.ndarray, "n rows columns"]:
        n, height, width = images.shape
        block, every = int(self.block), int(self.every)
        if height % block or width % every:
            raise SettingError(
                f"{self.name} {block} {every}: views of {width} x {height} pixels; give a width that {every} divides and a height that "
                f"{block} divides"
            )
        margin = block // 4
        middle = images.reshape(n, height // block, block, width)[:, :, margin:-margin].mean(axis=2)
        total = np.zeros((n, height // block, width // every), np.float32)
        for column in range(margin, block - margin):
            total += np.roll(middle, -column, axis=-1)[..., ::every]
        return total / np.float32(block // 2)


@attrs.frozen
class HeadViews(EncodingStep):
    """What an eye with a limited field sees as it turns, equalised and reduced anew at each heading, as in Ardin et al. (2016).

    Column c holds all pixels of one such view, row by row: that of a head which faces the left edge of column c. So turning still
    rolls the result, to the last bit, and a model compares the middle column alone (`visible`). Each view is cut out of every
    `stride`-th column, then `cv2.createCLAHE` equalises it and bicubic interpolation reduces it, both on 256 levels.

    Attributes:
        columns: Width of the field, in pixels before the reduction.
        stride: Columns of the image from one of these pixels to the next.
        clip: Limit of the contrast, as OpenCV takes it.
        tiles: Number of tiles across, and down.
        width: Columns of a view after the reduction.
        height: Rows of a view after the reduction.
    """

    name: ClassVar[str] = "head-views"
    takes_unit_range: ClassVar[bool] = True
    shows_one_column: ClassVar[bool] = True  # whatever the eye sees
    columns: float = number(low=4, high=10_000)
    stride: float = number(low=1, high=1000)
    clip: float = number(above=0, high=256)
    tiles: float = number(low=1, high=256)
    width: float = number(low=1, high=1000)
    height: float = number(low=1, high=1000)

    def __attrs_post_init__(self):
        for parameter in ("columns", "stride", "tiles", "width", "height"):
            check_whole(self, parameter, getattr(self, parameter))

    def __call__(self, images: Images) -> Float32[np.ndarray, "n pixels w"]:
        n, _, w = images.shape
        levels = np.rint(images * 255).clip(0, 255).astype(np.uint8)
        size = int(self.width), int(self.height)
        equaliser = cv2.createCLAHE(self.clip, (int(self.tiles), int(self.tiles)))
        views = np.empty((n, w, size[0] * size[1]), np.uint8)
        for column in range(w):
            seen = np.ascontiguousarray(levels[:, :, self._seen(column, w)])
            for k in range(n):
                reduced = cv2.resize(equaliser.apply(seen[k]), size, interpolation=cv2.INTER_CUBIC)
                views[k, column] = reduced.ravel()
        return np.ascontiguousarray(views.transpose(0, 2, 1)) * np.float32(1 / 255)

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        return 0.0, 1.0

    def visible(self, mask: Visible) -> Bool[np.ndarray, "pixels w"]:
        """The view straight ahead. Raises SettingError where the eye does not see all of it."""
        w = mask.shape[1]
        if not mask[:, self._seen(w // 2, w)].all():
            raise SettingError(
                f"{self.name} shows {360 * self.columns * self.stride / w:g} degrees, of which the eye does not see all; give a wider field"
            )
        shown = np.zeros((int(self.width * self.height), w), bool)
        shown[:, w // 2] = True
        return shown

    def _seen(self, column: int, w: int) -> np.ndarray:
        """Columns of the image that a head sees which faces the left edge of a column."""
        if self.columns * self.stride > w:
            raise SettingError(
                f"{self.name}: {self.columns:g} pixels of {self.stride:g} columns are more than all {w}; give fewer"
            )
        columns, stride = int(self.columns), int(self.stride)
        return (column - columns * stride // 2 + stride * np.arange(columns)) % w


STEPS = (Green, CentreMeans, HeadViews)
