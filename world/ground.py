"""The flat ground of a world: a rectangle of one colour, or, in a light, of parts with sun and shadow on them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float32, UInt8

from .errors import SettingError
from .geometry import Bounds
from .settings import MAX_COORDINATE, RGB
from .textures import Texture


def check_colour(label: str, value: Any) -> None:
    """Refuse an invalid colour. Raises SettingError."""
    numbers = isinstance(value, tuple) and len(value) == 3 and all(isinstance(c, int) and 0 <= c <= 255 for c in value)
    if not numbers:
        raise SettingError(f"{label} is {value!r}; give three whole numbers from 0 to 255")


def check_bounds(label: str, bounds: Bounds) -> None:
    """Refuse what is not a rectangle within MAX_COORDINATE. Raises SettingError."""
    numbers = all(isinstance(b, int | float) and not isinstance(b, bool) and abs(b) <= MAX_COORDINATE for b in bounds)
    if not (numbers and bounds[0] <= bounds[2] and bounds[1] <= bounds[3]):
        raise SettingError(f"{label} is {tuple(bounds)!r}; give x and y of its lower left and upper right corner (m)")


@dataclass(frozen=True, eq=False)
class GroundPart:
    """A rectangle of the ground with a picture on it.

    Attributes:
        bounds: Where it is (m).
        texture: The picture, seen from above with north at the top.
    """

    bounds: Bounds
    texture: Texture


@dataclass(frozen=True)
class Ground:
    """A flat rectangle at z = 0.

    Attributes:
        rgb: Its colour.
        bounds: Where it is (m).
        parts: Rectangles that cover it, with sun and shadow on them; none where there is no light.
    """

    rgb: RGB
    bounds: Bounds
    parts: tuple[GroundPart, ...] = ()

    def __post_init__(self):
        check_colour("the colour of the ground", self.rgb)
        check_bounds("the ground", self.bounds)

    def triangles(self) -> Float32[np.ndarray, "n 3 3"]:
        """Its triangles, which face up: two, or two of each part (m)."""
        quads = []
        for x0, y0, x1, y1 in [part.bounds for part in self.parts] or [self.bounds]:
            a, b, c, d = (x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0)
            quads += [(a, b, c), (a, c, d)]
        return np.array(quads, dtype=np.float32)

    def colours(self) -> UInt8[np.ndarray, "n 3"]:
        """The colour of each triangle; of a part the mean of its picture."""
        means = [np.rint(part.texture.rgba[..., :3].mean(axis=(0, 1))) for part in self.parts] or [self.rgb]
        return np.repeat(np.array(means), 2, axis=0).astype(np.uint8)


QUAD_UV = np.array([[(0, 1), (1, 1), (1, 0)], [(0, 1), (1, 0), (0, 0)]], np.float32)  # of the two triangles of a part


def shadow_picture(rgba: UInt8[np.ndarray, "h w 4"]) -> Texture:
    """The texture of a part of the ground."""
    return Texture(rgba=rgba, wrap=("clamp", "clamp"), filter="nearest")
