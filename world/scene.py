"""The world: coloured triangles, a ground and a sky."""

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float32, UInt8

from .errors import InputError
from .geometry import FARTHEST, Bounds

if TYPE_CHECKING:
    from .params import WorldParams

RGB = tuple[int, int, int]


def check_colour(name: str, value: Any) -> None:
    """Refuse what is no colour. Raises InputError."""
    whole = isinstance(value, tuple) and len(value) == 3 and all(isinstance(c, int) and 0 <= c <= 255 for c in value)
    if not whole:
        raise InputError(f"{name} is {value!r}; a colour is three whole numbers 0..255")


def check_bounds(name: str, bounds: Bounds) -> None:
    """Refuse what is no rectangle of places within FARTHEST. Raises InputError."""
    numbers = all(isinstance(b, int | float) and not isinstance(b, bool) and abs(b) <= FARTHEST for b in bounds)
    if not (numbers and bounds[0] <= bounds[2] and bounds[1] <= bounds[3]):
        raise InputError(f"{name} is {tuple(bounds)!r}; give x and y of its lower left and upper right corner (m)")


@dataclass(frozen=True)
class Ground:
    """A flat rectangle of one colour at z = 0."""

    rgb: RGB
    bounds: Bounds


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """Everything there is to see, immutable.

    triangles: (n, 3, 3) corners in metres (triangle, corner, xyz), z up, ground at z = 0.
    rgb: (n, 3) one colour a triangle.
    field: where an agent may stand.
    double_sided: False culls back faces: a triangle is seen only from the side (v1 - v0) x (v2 - v0) points to.
    origin: how the world was made (preset, seed, parameters), kept through saving and loading.
    textured: the meshes as read, where they carry textures; the GL renderers draw these.
    """

    triangles: Float32[np.ndarray, "n 3 3"]
    rgb: UInt8[np.ndarray, "n 3"]
    ground: Ground | None
    sky_rgb: RGB
    field: Bounds
    double_sided: bool = True
    origin: dict[str, Any] = dataclasses.field(default_factory=dict)
    textured: tuple[Any, ...] = ()

    def __post_init__(self):
        for name, shape, kind in (
            ("triangles", (len(self.triangles), 3, 3), np.float32),
            ("rgb", (len(self.triangles), 3), np.uint8),
        ):
            array = getattr(self, name)
            if array.shape != shape or array.dtype != kind:
                raise InputError(f"{name} of a world are {shape} {np.dtype(kind)}, got {array.shape} {array.dtype}")
            object.__setattr__(self, name, array.copy())
        near = np.abs(self.triangles) <= FARTHEST  # False for nan, too
        if not near.all():
            bad = int(near.all(axis=(1, 2)).argmin())
            raise InputError(
                f"triangle {bad} of the world has a corner that is not finite, or over {FARTHEST:g} m away; repair the mesh"
            )
        check_colour("the sky's colour", self.sky_rgb)
        check_bounds("the field", self.field)
        if self.ground is not None:
            check_colour("the ground's colour", self.ground.rgb)
            check_bounds("the ground", self.ground.bounds)
        self.triangles.flags.writeable = False
        self.rgb.flags.writeable = False

    @classmethod
    def generate(cls, params: "WorldParams | str" = "tussock-field", seed: int = 0) -> "World":
        """Grow a world from parameters, or from a preset by its name, which parameters may follow (see `WorldParams.named`).

        The same seed gives the same bytes. Raises InputError for an unknown preset (lists the known) or a seed that is no whole
        number from 0.
        """
        from .generate import generate_world
        from .params import WorldParams

        if isinstance(params, str):
            params = WorldParams.named(params)
        return generate_world(params, seed)

    def surfaces(self) -> tuple[Float32[np.ndarray, "m 3 3"], UInt8[np.ndarray, "m 3"]]:
        """Triangles and colours with the ground's two triangles (facing up) appended: what a renderer draws."""
        if self.ground is None:
            return self.triangles, self.rgb
        x0, y0, x1, y1 = self.ground.bounds
        a, b, c, d = (x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0)
        triangles = np.array([(a, b, c), (a, c, d)], dtype=np.float32)
        rgb = np.array([self.ground.rgb] * 2, dtype=np.uint8)
        return np.concatenate([self.triangles, triangles]), np.concatenate([self.rgb, rgb])
