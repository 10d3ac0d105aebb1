"""The steps that an encoding is made of: from panoramas to images, and from images to images.

Images are (n, h, w) float32. Every step treats an image as the ring that it is, so that turning the eye rolls the result: exactly,
where the factor of a resize divides both the turn and the width. `Clahe` is the one step whose tiles turn with the eye.
"""

from abc import ABC, abstractmethod
from typing import ClassVar

import attrs
import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

from tussock.world.errors import SettingError
from tussock.world.settings import number

from .block_means import block_means

Views = UInt8[np.ndarray, "n height width channels"]
Images = Float32[np.ndarray, "n h w"]
Visible = Bool[np.ndarray, "_ _"]


class EncodingStep(ABC):
    """One step of an encoding. Its parameters are numbers, in the order in which a chain lists them.

    Attributes:
        name: Of a step of tussock, in a chain. A step from outside is named where it is registered.
        takes_views: It begins a chain: it takes panoramas (n, height, width, 3 or 4) uint8. All other steps take images.
        estimates_sky: It estimates the sky from the whole view, where views have no alpha.
        takes_unit_range: It takes values from 0 to 1 only, so it cannot follow `Normalise`.
    """

    name: ClassVar[str] = ""
    takes_views: ClassVar[bool] = False
    estimates_sky: ClassVar[bool] = False
    takes_unit_range: ClassVar[bool] = False

    @abstractmethod
    def __call__(self, images: np.ndarray) -> Images:
        """The images after this step."""

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        """The range of the values after this step, but for rounding.

        Args:
            low: Least value before it.
            high: Greatest value before it.
            pixels: Of an image after it.
        """
        return low, high

    def visible(self, mask: Visible) -> Visible:
        """Which pixels after this step depend on visible ones (rows, columns) alone. Raises SettingError where that is not known."""
        raise SettingError(
            f"{self.name or type(self).__name__} makes each pixel of hidden ones too, so it cannot be used with a field or mask; "
            "leave it out, or give it a method visible(mask)"
        )


class PixelStep(EncodingStep):
    """A step that makes each pixel of the one pixel in its place."""

    def visible(self, mask: Visible) -> Visible:
        """The same pixels."""
        return mask


class AveragingStep(EncodingStep):
    """A step whose pixels are sums of other ones with weights that are not negative."""

    def visible(self, mask: Visible) -> Visible:
        """Those pixels to which no hidden one adds anything."""
        return self((~mask)[None].astype(np.float32))[0] == 0


@attrs.frozen
class Grey(PixelStep):
    """Brightness, 0..1 (ITU-R BT.601 weights, as OpenCV converts)."""

    name: ClassVar[str] = "grey"
    takes_views: ClassVar[bool] = True

    def __call__(self, images: Views) -> Images:
        red, green, blue = np.array([0.299, 0.587, 0.114], dtype=np.float32) / np.float32(255)
        return images[..., 0] * red + images[..., 1] * green + images[..., 2] * blue  # faster than a matrix product


@attrs.frozen
class ForegroundMask(PixelStep):
    """Share of each pixel that is not open sky, 0..1: exact where views have alpha, else estimated from their colours.

    The estimate takes the median colour of the top rows as the sky, and Otsu's threshold on the distance from it.
    """

    name: ClassVar[str] = "foreground-mask"
    takes_views: ClassVar[bool] = True
    estimates_sky: ClassVar[bool] = True

    def __call__(self, images: Views) -> Images:
        if images.shape[-1] == 4:
            return images[..., 3] * np.float32(1 / 255)
        masks = np.empty(images.shape[:3], dtype=np.float32)
        for view, mask in zip(images, masks, strict=True):
            top = view[: max(1, len(view) // 10)].reshape(-1, view.shape[-1])
            away = np.abs(view.astype(np.int16) - np.median(top, axis=0).astype(np.int16)).max(axis=-1).astype(np.uint8)
            threshold, _ = cv2.threshold(away, 0, 1, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
            mask[:] = away > threshold
        return masks


@attrs.frozen
class Blur(AveragingStep):
    """Gaussian smoothing; around the ring, mirrored at top and bottom.

    Attributes:
        sigma: Standard deviation (pixels).
    """

    name: ClassVar[str] = "blur"
    sigma: float = number(above=0, high=100, unit="pixels")

    def __call__(self, images: Images) -> Images:
        margin = int(np.ceil(4 * self.sigma))
        wrapped = np.pad(images, ((0, 0), (0, 0), (margin, margin)), mode="wrap")
        size = (2 * margin + 1, 2 * margin + 1)
        blurred = [cv2.GaussianBlur(image, size, self.sigma, borderType=cv2.BORDER_REFLECT) for image in wrapped]
        return np.stack(blurred)[:, :, margin:-margin] if len(images) else images


@attrs.frozen
class Resize(AveragingStep):
    """Area average down to 1 / `factor` of the width and height (rounded, at least 4 x 1)."""

    name: ClassVar[str] = "resize"
    factor: float = number(low=1, high=1000)

    def __call__(self, images: Images) -> Float32[np.ndarray, "n rows columns"]:
        n, height, width = images.shape
        h, w = resized(height, width, self.factor)
        if (h, w) == (height, width) or n == 0:
            return images[:, :h, :w]
        if height % h == 0 and width % w == 0:
            return block_means(images, height // h, width // w)
        return np.stack([cv2.resize(image, (w, h), interpolation=cv2.INTER_AREA) for image in images])


@attrs.frozen
class Sample(AveragingStep):
    """Bilinear samples `factor` pixels apart without averaging: fine structure aliases, as in cv2.resize by default.

    The thesis resized its views so. Width and height as with `Resize`.
    """

    name: ClassVar[str] = "sample"
    factor: float = number(low=1, high=1000)

    def __call__(self, images: Images) -> Float32[np.ndarray, "n rows columns"]:
        h, w = resized(images.shape[1], images.shape[2], self.factor)
        if (h, w) == images.shape[1:] or len(images) == 0:
            return images[:, :h, :w]
        return np.stack([cv2.resize(image, (w, h), interpolation=cv2.INTER_LINEAR) for image in images])


@attrs.frozen
class Invert(PixelStep):
    """Bright becomes dark: 1 minus each value."""

    name: ClassVar[str] = "invert"
    takes_unit_range: ClassVar[bool] = True

    def __call__(self, images: Images) -> Images:
        return np.float32(1) - images

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        return 1 - high, 1 - low


@attrs.frozen
class Clahe(EncodingStep):
    """Contrast limited adaptive histogram equalisation, as cv2.createCLAHE does it in 256 levels.

    Tiles on both sides of the seam are neighbours as all others are. They turn with the eye: a turn by whole tiles rolls the image,
    but for one level in one of some 30,000 pixels, by rounding; a turn by half a tile rolls it to one level on average and 24
    at most (measured on generated views of 720 x 150, clip 2, 8 tiles).

    Attributes:
        clip: Limit of the contrast; 256 is none.
        tiles: Number of tiles across, and down. It must divide the width.
    """

    name: ClassVar[str] = "clahe"
    takes_unit_range: ClassVar[bool] = True
    clip: float = number(above=0, high=256)
    tiles: float = number(low=1, high=256)

    def __attrs_post_init__(self):
        check_whole(self, "tiles", self.tiles)

    def __call__(self, images: Images) -> Images:
        height, width = images.shape[1:]
        tiles = int(self.tiles)
        if width % tiles:
            raise SettingError(
                f"clahe {self.clip:g} {tiles}: {width} columns cannot be cut into {tiles} equal tiles; give a divisor of {width}"
            )
        levels = np.rint(images * 255).clip(0, 255).astype(np.uint8)
        # OpenCV would pad the columns too where only the rows do not fill whole tiles.
        levels = np.pad(levels, ((0, 0), (0, -height % tiles), (0, 0)), mode="reflect")
        margin = width // tiles  # one tile
        wrapped = np.pad(levels, ((0, 0), (0, 0), (margin, margin)), mode="wrap")
        equaliser = cv2.createCLAHE(self.clip, (tiles + 2, tiles))
        equalised = [equaliser.apply(image)[:height, margin:-margin] for image in wrapped]
        return np.stack(equalised) * np.float32(1 / 255) if len(images) else images

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        return 0.0, 1.0


@attrs.frozen
class Widen(AveragingStep):
    """Each pixel averaged with its neighbours to the right: pixels become `columns` wide, and there is still one per column.

    So a view of coarse pixels can be turned by less than one of them.
    """

    name: ClassVar[str] = "widen"
    columns: float = number(low=1, high=1000)

    def __attrs_post_init__(self):
        check_whole(self, "columns", self.columns)

    def __call__(self, images: Images) -> Images:
        total = images.copy()
        for shift in range(1, int(self.columns)):
            total += np.roll(images, -shift, axis=-1)
        return total / np.float32(self.columns)


@attrs.frozen
class Scale(PixelStep):
    """Each value times `factor`: less contrast, for models whose learning rate needs it."""

    name: ClassVar[str] = "scale"
    factor: float = number(above=0, high=1)

    def __call__(self, images: Images) -> Images:
        return images * np.float32(self.factor)

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        return self.factor * low, self.factor * high


@attrs.frozen
class VerticalEdges(EncodingStep):
    """Strength of vertical edges: the absolute difference between each pixel and its neighbour to the right."""

    name: ClassVar[str] = "vertical-edges"

    def __call__(self, images: Images) -> Images:
        return np.abs(np.roll(images, -1, axis=-1) - images)

    def visible(self, mask: Visible) -> Visible:
        """Those that are visible together with their neighbours to the right."""
        return mask & np.roll(mask, -1, axis=-1)

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        return 0.0, high - low


@attrs.frozen
class Normalise(EncodingStep):
    """Each image shifted to mean 0 and scaled to unit variance (an image without contrast becomes 0)."""

    name: ClassVar[str] = "normalise"

    def __call__(self, images: Images) -> Images:
        centred = images - images.mean(axis=(1, 2), keepdims=True, dtype=np.float64)
        deviation = np.sqrt(np.square(centred).mean(axis=(1, 2), keepdims=True))
        # Where there is hardly any contrast, the rounding of the mean would lead out of the bounds.
        low, high = self.bounds(0.0, 1.0, images.shape[1] * images.shape[2])
        return (centred / np.where(deviation > 1e-6, deviation, np.inf)).clip(low, high).astype(np.float32)

    def bounds(self, low: float, high: float, pixels: int) -> tuple[float, float]:
        most = float(np.sqrt(pixels - 1))  # of one pixel that differs from all others
        return -most, most


STEPS = (Grey, ForegroundMask, Blur, Resize, Sample, Widen, Scale, Invert, Clahe, VerticalEdges, Normalise)


def resized(height: int, width: int, factor: float) -> tuple[int, int]:
    """Rows and columns of an image that is reduced by a factor."""
    return max(1, round(height / factor)), max(4, round(width / factor))


def check_whole(step: EncodingStep, parameter: str, value: float) -> None:
    """Refuse a number that is not whole. Raises SettingError."""
    if value != round(value):
        raise SettingError(f"{step.name}: {parameter} is {value:g}; give a whole number")
