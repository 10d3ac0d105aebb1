"""Materials of meshes, whatever the format: an image, what it is multiplied by, and what its alpha means."""

import itertools
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from ..errors import FileError
from ..textures import MAX_TEXELS, Texture, to_display, to_linear

_IDENTITY = np.eye(2, 3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """What a mesh is covered with.

    Attributes:
        name: Its name in the file.
        image: A PIL image, or None.
        alpha_image: A PIL image whose alpha, or else brightness, replaces the alpha of the image; or None.
        key: Names the images in the file: materials with equal keys have the same ones. None where that is unknown.
        factor: Red, green, blue and alpha (0..1) that the image, or white, is multiplied by.
        linear: Whether the factor is in linear light, as in glTF; or else in display colours, as in OBJ.
        wrap, filter, alpha, cutoff: See `Texture`.
        transform: Matrix that makes texture coordinates of (u, v, 1), v down.
        lost: What other programs show of it, and tussock does not.
    """

    name: str = ""
    image: Any = None
    alpha_image: Any = None
    key: Any = None
    factor: Float[np.ndarray, "4"] = field(default_factory=lambda: np.ones(4))
    linear: bool = False
    wrap: tuple[str, str] = ("repeat", "repeat")
    filter: str = "linear"
    alpha: str = "opaque"
    cutoff: float = 0.5
    transform: Float[np.ndarray, "2 3"] = field(default_factory=_IDENTITY.copy)
    lost: tuple[str, ...] = ()

    def times(self, colours: UInt8[np.ndarray, "*shape 4"]) -> UInt8[np.ndarray, "*shape 4"]:
        """Colours (or texels) times the factor."""
        if (self.factor == 1).all():
            return colours
        bytes_ = np.arange(256) / 255
        product = np.empty_like(colours)
        for channel, factor in enumerate(self.factor):
            light = self.linear and channel < 3
            table = to_display(to_linear(bytes_) * factor) if light else bytes_ * factor
            product[..., channel] = np.rint(255 * table).astype(np.uint8)[colours[..., channel]]
        return product

    def texture(self) -> Texture:
        """The image times the factor. Raises FileError for an image that is too large or damaged."""
        texels = rgba_of(self.image, self.name)
        if self.alpha_image is not None:
            texels = _with_alpha(texels, self.alpha_image, self.name)
        alpha = self.alpha
        if alpha != "opaque" and texels[..., 3].max() == 0:
            alpha, texels[..., 3] = "opaque", 255  # an alpha channel that was never filled
        texels = self.times(texels)
        if alpha != "opaque":
            _colour_the_edge(texels)
        return Texture(rgba=texels, wrap=self.wrap, filter=self.filter, alpha=alpha, cutoff=self.cutoff)

    @property
    def settings(self) -> tuple:
        """All but the images, for comparisons."""
        return self.factor.tobytes(), self.linear, self.wrap, self.filter, self.alpha, self.cutoff


def rgba_of(image: Any, name: str) -> UInt8[np.ndarray, "h w 4"]:
    """The texels of a PIL image. Raises FileError where it claims too many or is damaged."""
    width, height = image.size
    if width * height > MAX_TEXELS:
        raise FileError(
            f"the texture of {name!r} claims {width:,} x {height:,} pixels; make it smaller, or the file is damaged"
        )
    try:
        if image.mode.startswith("I;16"):  # PIL would cut the upper half of its range off
            return _grey((np.asarray(image) >> 8).astype(np.uint8))
        return np.array(image.convert("RGBA"))
    except (OSError, ValueError, SyntaxError, EOFError) as error:  # of the readers of PIL
        raise FileError(f"the texture of {name!r} is damaged ({error}); copy or export it again") from error


def white_image(size: tuple[int, int]) -> Any:
    """A white PIL image."""
    from PIL import Image

    return Image.new("L", size, 255)


def _grey(values: UInt8[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w 4"]:
    return np.stack([values, values, values, np.full_like(values, 255)], axis=-1)


def _with_alpha(texels: UInt8[np.ndarray, "h w 4"], image: Any, name: str) -> UInt8[np.ndarray, "height width 4"]:
    """Texels with the alpha of another image: its alpha channel, or its brightness where it has none or a full one."""
    other = rgba_of(image, name)
    alpha = other[..., 3] if other[..., 3].min() < 255 else np.asarray(image.convert("L"))
    height, width = max(texels.shape[0], alpha.shape[0]), max(texels.shape[1], alpha.shape[1])
    if height * width > MAX_TEXELS:
        raise FileError(f"the textures of {name!r} together have {width:,} x {height:,} pixels; make them smaller")
    texels, alpha = _enlarged(texels, height, width), _enlarged(alpha, height, width)
    texels[..., 3] = alpha
    return texels


def _colour_the_edge(texels: UInt8[np.ndarray, "h w 4"]) -> None:
    """Give empty texels next to others the mean colour of these, so that a mixture is not darker; many programs leave them black."""
    empty = texels[..., 3] == 0
    if not empty.any():
        return
    total, count = np.zeros((*empty.shape, 3), np.int32), np.zeros((*empty.shape, 1), np.int32)
    coloured = texels[..., :3] * ~empty[..., None]
    for shift in itertools.product((-1, 0, 1), repeat=2):
        total += np.roll(coloured, shift, axis=(0, 1))
        count += np.roll(~empty[..., None], shift, axis=(0, 1))
    edge = empty & (count[..., 0] > 0)
    texels[edge, :3] = total[edge] // count[edge]


def _enlarged(pixels: UInt8[np.ndarray, "h w *c"], height: int, width: int) -> UInt8[np.ndarray, "height width *c"]:
    """An image with each pixel repeated."""
    rows = np.arange(height) * pixels.shape[0] // height
    return pixels[rows[:, None], np.arange(width) * pixels.shape[1] // width]
