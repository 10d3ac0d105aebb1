"""Pictures on the triangles of a world: textures, and colours that change across a triangle.

All colours are display colours (sRGB), as everywhere in tussock. Materials are folded into the texels when a file is read
(meshes/appearance.py), so a renderer needs only this:

- Texture coordinates and corner colours are linear across a triangle, in space (perspective-correct in a view).
- The texel at (u, v) is the one that contains it ("nearest"), or the four around it, weighed by distance ("linear"). u goes right
  and v down, from 0 to 1 across the picture; outside it the picture is repeated, mirrored, or continued by its edge.
- A colour of texture and corners is their product in linear light (`product_table`), without a texture that of the corners alone.
- Where the product of their alphas is below the texture's threshold, nothing is there: one sees what is behind. Elsewhere the
  triangle covers all that is behind it.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Int32, UInt8

from .errors import SettingError
from .settings import MAX_COORDINATE

WRAPS = ("repeat", "mirror", "clamp")
FILTERS = ("nearest", "linear")
ALPHAS = ("opaque", "mask", "blend")
MAX_TEXELS = 2**28  # of all textures of a world; each takes 4 bytes, and 4 more while it is drawn


@dataclass(frozen=True, kw_only=True, eq=False)
class Texture:
    """A picture, and how it is put on triangles. Immutable.

    Attributes:
        rgba: (h, w, 4) texels from the top row down: red, green, blue and alpha.
        wrap: How it goes on to the left and right, and above and below: "repeat", "mirror" or "clamp".
        filter: "nearest" or "linear".
        alpha: "opaque": alpha does not matter; "mask": texels below `cutoff` are holes; "blend": the file asks for translucent
            surfaces, which are drawn as holes where alpha is below one half.
        cutoff: Least alpha that is seen where alpha is "mask", 0..1.
    """

    rgba: UInt8[np.ndarray, "h w 4"]
    wrap: tuple[str, str] = ("repeat", "repeat")
    filter: str = "linear"
    alpha: str = "opaque"
    cutoff: float = 0.5

    def __post_init__(self):
        rgba = np.asarray(self.rgba)
        if rgba.ndim != 3 or rgba.shape[2] != 4 or rgba.dtype != np.uint8 or rgba.size == 0:
            raise SettingError(f"texels are (h, w, 4) uint8, got {rgba.shape} {rgba.dtype}")
        for label, value, known in (
            ("wrap", self.wrap[0], WRAPS),
            ("wrap", self.wrap[1], WRAPS),
            ("filter", self.filter, FILTERS),
            ("alpha", self.alpha, ALPHAS),
        ):
            if value not in known:
                raise SettingError(f"the {label} of a texture is {value!r}; give one of {', '.join(known)}")
        if not 0 <= self.cutoff < np.inf:
            raise SettingError(f"the cutoff of a texture is {self.cutoff!r}; give a number from 0")
        object.__setattr__(self, "rgba", _frozen(rgba))

    @property
    def threshold(self) -> float:
        """Least alpha that is seen (0..255); 0 where all is."""
        cutoff = {"opaque": 0.0, "mask": self.cutoff, "blend": 0.5}[self.alpha]
        return max(0.0, 255 * cutoff - 0.01)  # so that rounding does not decide about an alpha that equals the cutoff


@dataclass(frozen=True, kw_only=True, eq=False)
class Texturing:
    """The textures of a world, and where they are on its triangles. Immutable.

    Attributes:
        textures: The textures.
        index: (n,) the texture of each triangle, or -1.
        uv: (n, 3, 2) texture coordinates of the corners: u to the right, v down, 0..1 across the picture.
        colours: (n, 3, 4) red, green, blue and alpha of the corners; None where no corner has a colour of its own. White and opaque
            where a triangle has a texture only; where it has neither, the colour of the triangle.
    """

    textures: tuple[Texture, ...]
    index: Int32[np.ndarray, " n"]
    uv: Float32[np.ndarray, "n 3 2"]
    colours: UInt8[np.ndarray, "n 3 4"] | None = None

    def __post_init__(self):
        n = len(self.index)
        for label, shape, kind in (
            ("index", (n,), np.int32),
            ("uv", (n, 3, 2), np.float32),
            ("colours", (n, 3, 4), np.uint8),
        ):
            array: Any = getattr(self, label)
            if label == "colours" and array is None:
                continue
            if array.shape != shape or array.dtype != kind:
                raise SettingError(
                    f"{label} of a texturing are {shape} {np.dtype(kind)}, got {array.shape} {array.dtype}"
                )
            object.__setattr__(self, label, _frozen(array))
        if n and not (self.index.min() >= -1 and self.index.max() < len(self.textures)):
            raise SettingError(f"triangles have textures from -1 to {len(self.textures) - 1}, got {self.index.max()}")
        if not (np.abs(self.uv) <= MAX_COORDINATE).all():  # False for nan
            raise SettingError(f"a texture coordinate is not finite, or over {MAX_COORDINATE:g}; repair the mesh")
        texels = sum(texture.rgba.shape[0] * texture.rgba.shape[1] for texture in self.textures)
        if texels > MAX_TEXELS:
            raise SettingError(
                f"the textures have {texels:,} texels; a world has up to {MAX_TEXELS:,}, so make them smaller"
            )

    def to_bytes(self) -> bytes:
        """All that it is, for a digest."""
        parts = [self.index.tobytes(), self.uv.tobytes(), b"" if self.colours is None else self.colours.tobytes()]
        for texture in self.textures:
            settings = (texture.rgba.shape, *texture.wrap, texture.filter, texture.alpha, texture.cutoff)
            parts += [repr(settings).encode(), texture.rgba.tobytes()]
        return b"".join(parts)

    def corner_colours(self, rgb: UInt8[np.ndarray, "n 3"]) -> UInt8[np.ndarray, "n 3 4"]:
        """`colours`, also where that is None; `rgb` are the colours of the triangles that have no texture."""
        if self.colours is not None:
            return self.colours
        colours = np.full((len(self.index), 3, 4), 255, np.uint8)
        colours[self.index < 0, :, :3] = rgb[self.index < 0, None]
        return colours

    def may_have_holes(self) -> np.ndarray:
        """(n,) whether a triangle may have holes: its texture, or its corners, have an alpha below the threshold."""
        thresholds = np.array([texture.threshold for texture in self.textures] + [0.0])
        least = np.array([int(texture.rgba[..., 3].min()) for texture in self.textures] + [255])
        corners = 255 if self.colours is None else self.colours[..., 3].min(axis=1)
        return least[self.index] / 255 * corners < thresholds[self.index]


def to_linear(display: Any) -> Float[np.ndarray, "..."]:
    """Linear light (0..1) of display values (0..1), by the sRGB standard."""
    display = np.asarray(display, dtype=float)
    return np.where(display <= 0.04045, display / 12.92, ((np.maximum(display, 0) + 0.055) / 1.055) ** 2.4)


def to_display(linear: Any) -> Float[np.ndarray, "..."]:
    """Display values (0..1) of linear light (0..1), by the sRGB standard."""
    linear = np.asarray(linear, dtype=float)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)


@cache
def product_table() -> UInt8[np.ndarray, "256 256"]:
    """The product in linear light of any two display values. That of x and 255 is x."""
    light = to_linear(np.arange(256) / 255)
    table = np.rint(255 * to_display(np.multiply.outer(light, light))).astype(np.uint8)
    table.flags.writeable = False
    return table


def _frozen(array: np.ndarray) -> np.ndarray:
    array = array.copy()
    array.flags.writeable = False
    return array
