"""Steps of encodings for colour vision: planes of a view, one above the other in one image.

`GreenBlue` makes two planes of a view, what green and blue receptors see. Steps after it make the five planes of one of the
preprocessings that ApiaViz (2026) compares: three of form, then two of colour. The model `spike-overlap` takes such images with
planes=3,2; for all other models they are images like any other. Where a view has more than one column per pixel of the eye (so that it
can be turned by less than a pixel), filters take only every N-th column.
"""

from abc import abstractmethod
from typing import ClassVar

import attrs
import numpy as np
from jaxtyping import Float32

from tussock.world.errors import SettingError
from tussock.world.settings import number

from .encoding_steps import EncodingStep, Images, Views, Visible, check_whole

Planes = Float32[np.ndarray, "n planes rows columns"]
Stack = Float32[np.ndarray, "n stacked columns"]  # planes one above the other

HEXAGON = (  # neighbours (row, column) of a pixel in even and in odd rows, which are half a pixel apart
    ((0, -1), (0, 1), (-1, 0), (-1, 1), (1, 0), (1, 1)),
    ((0, -1), (0, 1), (-1, -1), (-1, 0), (1, -1), (1, 0)),
)
SURROUND, ADAPTED, EPSILON = 9, 2.0, 0.05  # ApiaViz: pixels across of the light that is adapted to, gain, least light
ARDIN_ROWS, ARDIN_COLUMNS = 10, 36  # of the view of Ardin et al. (2016), over 296 degrees


@attrs.frozen
class GreenBlue(EncodingStep):
    """What green and blue receptors see, 0..1: the green plane above the blue one."""

    name: ClassVar[str] = "green-blue"
    takes_views: ClassVar[bool] = True

    def __call__(self, images: Views) -> Images:
        return _stacked(np.moveaxis(images[..., 1:3], -1, 1).astype(np.float32) / np.float32(255))

    def visible(self, mask: Visible) -> Visible:
        """The same pixels, in both planes."""
        return np.concatenate([mask, mask])


@attrs.frozen
class Luminance(EncodingStep):
    """The mean of two planes."""

    name: ClassVar[str] = "luminance"

    def __call__(self, images: Stack) -> Images:
        return _split(images, 2, self.name).mean(axis=1)

    def visible(self, mask: Visible) -> Visible:
        """Pixels that are visible in both planes."""
        return _split(mask[None], 2, self.name)[0].all(axis=0)


class FivePlanes(EncodingStep):
    """A step that makes three planes of form and two of colour of a green and a blue plane."""

    takes_unit_range: ClassVar[bool] = True

    def __call__(self, images: Images) -> Stack:
        green, blue = np.moveaxis(_split(images, 2, self.name), 1, 0)
        return _stacked(np.stack(self.planes(green, blue), axis=1).astype(np.float32))

    @abstractmethod
    def planes(self, green: Images, blue: Images) -> list[Images]:
        """The five planes."""

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        return -np.inf, np.inf


class FivePixelPlanes(FivePlanes):
    """Such a step that makes each pixel of the two in its place."""

    def visible(self, mask: Visible) -> Visible:
        """Pixels that are visible in both planes."""
        return np.concatenate([_split(mask[None], 2, self.name)[0].all(axis=0)] * 5)


@attrs.frozen
class GreyPlanes(FivePixelPlanes):
    """ApiaViz's grey control: luminance in all five planes."""

    name: ClassVar[str] = "grey-planes"

    def planes(self, green: Images, blue: Images) -> list[Images]:
        return [(green + blue) / 2] * 5

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        return low, high


@attrs.frozen
class ColourPlanes(FivePixelPlanes):
    """ApiaViz's raw colour control: luminance, green and blue; green and blue."""

    name: ClassVar[str] = "colour-planes"

    def planes(self, green: Images, blue: Images) -> list[Images]:
        return [(green + blue) / 2, green, blue, green, blue]

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        return low, high


@attrs.frozen
class OpponentPlanes(FivePixelPlanes):
    """ApiaViz's control of simple opponency: luminance three times; green over blue, and blue over green."""

    name: ClassVar[str] = "opponent-planes"

    def planes(self, green: Images, blue: Images) -> list[Images]:
        return [(green + blue) / 2] * 3 + _opponent(green, blue)

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        return min(low, 0.0), max(high, high - low)


@attrs.frozen
class SobelPlanes(FivePlanes):
    """ApiaViz's control with edges: Sobel's x, y and magnitude of the smoothed luminance; simple opponency.

    Attributes:
        pixel: Columns from one pixel of the eye to the next.
    """

    name: ClassVar[str] = "sobel-planes"
    pixel: float = number(low=1, high=1000)

    def __attrs_post_init__(self):
        check_whole(self, "pixel", self.pixel)

    def planes(self, green: Images, blue: Images) -> list[Images]:
        smooth = _filtered((green + blue) / 2, _gaussian(5, 1.0), self.pixel)
        sobel = np.array([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]]) / 8
        x, y = (_filtered(smooth, each, self.pixel) for each in (sobel, sobel.T))
        return [x, y, np.hypot(x, y), *_opponent(green, blue)]


@attrs.frozen
class ApiaPlanes(FivePlanes):
    """The preprocessing of ApiaViz: hexagonal averages, local adaptation, centre and surround, and opponent colours.

    The form planes are the light that is brighter than its surround, the darker, and the smoothed adapted light; the colour planes
    green over blue and blue over green.

    Attributes:
        pixel: Columns from one pixel of the eye to the next.
    """

    name: ClassVar[str] = "apia-planes"
    pixel: float = number(low=1, high=1000)

    def __attrs_post_init__(self):
        check_whole(self, "pixel", self.pixel)

    def planes(self, green: Images, blue: Images) -> list[Images]:
        green, blue = (_hexagonal(each, self.pixel) for each in (green, blue))
        light = (green + blue) / 2
        around = _filtered(light, np.full((SURROUND, SURROUND), SURROUND**-2.0), self.pixel)
        adapted = np.tanh(ADAPTED * (light - around) / (np.abs(around) + EPSILON))
        centre = _gaussian(5, 1.0)
        difference = centre - _gaussian(5, 2.5)
        brighter = _filtered(adapted, difference / np.linalg.norm(difference), self.pixel)
        smooth = _filtered(adapted, centre / np.linalg.norm(centre), self.pixel)
        colours = _opponent(np.tanh(ADAPTED * (green - around)), np.tanh(ADAPTED * (blue - around)))
        return [brighter.clip(min=0), (-brighter).clip(min=0), smooth, *colours]


@attrs.frozen
class ArdinPlanes(EncodingStep):
    """An image as coarse as 36 x 10 pixels in 296 degrees, in all five planes of ApiaViz: its control in the style of Ardin et al.

    Pixels are as wide as those, and there is still one per column. Inversion and CLAHE are steps before this one.
    """

    name: ClassVar[str] = "ardin-planes"

    def __call__(self, images: Images) -> Stack:
        height, width = images.shape[1:]
        columns = max(1, round(296 / 360 * width / ARDIN_COLUMNS))
        coarse = np.einsum("rh,nhw->nrw", _area_means(ARDIN_ROWS, height), images)
        wide = np.mean([np.roll(coarse, columns // 2 - k, axis=2) for k in range(columns)], axis=0)
        return np.concatenate([wide.astype(np.float32)] * 5, axis=1)


def _split(images: np.ndarray, planes: int, name: str) -> np.ndarray:
    """Images (n, planes x h, w) as (n, planes, h, w). Raises SettingError where the rows are another number of planes."""
    n, rows, width = images.shape
    if rows % planes:
        raise SettingError(f"{name} takes {planes} planes of equal size, got {rows} rows; put green-blue before it")
    return images.reshape(n, planes, rows // planes, width)


def _stacked(planes: Planes) -> Stack:
    """Planes (n, planes, h, w) one above the other."""
    n, count, height, width = planes.shape
    return np.ascontiguousarray(planes.reshape(n, count * height, width))


def _opponent(green: Images, blue: Images) -> list[Images]:
    """By how much green is above blue, and blue above green."""
    return [(green - blue).clip(min=0), (blue - green).clip(min=0)]


def _filtered(images: Images, kernel: np.ndarray, pixel: float) -> Images:
    """Correlation with a kernel of odd size: around the ring, mirrored at top and bottom (the outermost row is not repeated).

    Args:
        images: (n, h, w)
        kernel: (rows, columns)
        pixel: Columns of the image from one column of the kernel to the next.
    """
    rows, columns = kernel.shape
    height = images.shape[1]
    total = np.zeros_like(images, dtype=np.float64)
    for row, of_row in zip(range(-(rows // 2), rows // 2 + 1), kernel, strict=True):
        from_row = images[:, _mirrored(np.arange(height) + row, height)]
        for column, weight in zip(range(-(columns // 2), columns // 2 + 1), of_row, strict=True):
            total += weight * np.roll(from_row, -column * int(pixel), axis=2)
    return total.astype(np.float32)


def _hexagonal(images: Images, pixel: float) -> Images:
    """Each pixel as the mean of its six neighbours in a hexagonal grid."""
    height = images.shape[1]
    total = np.zeros_like(images)
    for parity, neighbours in enumerate(HEXAGON):
        rows = np.arange(parity, height, 2)
        for row, column in neighbours:
            from_rows = images[:, _mirrored(rows + row, height)]
            total[:, rows] += np.roll(from_rows, -column * int(pixel), axis=2)
    return total / np.float32(6)


def _mirrored(rows: np.ndarray, height: int) -> np.ndarray:
    """Rows of an image in place of those beyond its edges."""
    if height == 1:
        return np.zeros_like(rows)
    period = 2 * (height - 1)
    rows = rows % period
    return np.minimum(rows, period - rows)


def _gaussian(size: int, sigma: float) -> np.ndarray:
    """A square Gaussian kernel of sum 1."""
    curve = np.exp(-(np.arange(-(size // 2), size // 2 + 1) ** 2) / (2 * sigma**2))
    kernel = np.outer(curve, curve)
    return kernel / kernel.sum()


def _area_means(fields: int, pixels: int) -> Float32[np.ndarray, "fields pixels"]:
    """Weights that average pixels over fields, each pixel by the share of it in the field."""
    edges = np.arange(fields + 1) * (pixels / fields)
    pixel = np.arange(pixels)
    shares = np.minimum(edges[1:, None], pixel + 1) - np.maximum(edges[:-1, None], pixel)
    return (shares.clip(min=0) * (fields / pixels)).astype(np.float32)


COLOUR_STEPS = (
    GreenBlue, Luminance, GreyPlanes, ColourPlanes, OpponentPlanes, SobelPlanes, ApiaPlanes, ArdinPlanes,
)  # fmt: skip
