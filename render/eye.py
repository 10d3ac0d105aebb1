"""The eye: which part of the sphere a panorama shows, and how finely."""

import math
from typing import TYPE_CHECKING, Any

import attrs

from tussock.world.errors import FieldError
from tussock.world.settings import MAX_COORDINATE, converted, number, settings, whole

from .mask import Mask, as_mask

if TYPE_CHECKING:  # the command line reads the defaults: without numpy, its help appears at once
    import numpy as np
    from jaxtyping import Bool, Float, UInt8

MAX_RAYS = 10**8  # of a panorama; the CPU renderer uses 12 bytes a ray and thread


def _mask(value: Any, eye: Any = None) -> Mask | None:
    sized = isinstance(eye.width, int) and isinstance(eye.height, int)  # else the eye is refused
    return as_mask(value, eye.width, eye.height) if sized and value is not None else value


@settings
class Eye:
    """A panoramic eye. The default is that of the published Sussex databases.

    Renderers draw the full circle. `field` and `mask` say what of it the eye sees (`visible`): they stand still with the eye while
    it turns. `known` is of recorded images, and says what of them shows the world: it turns with the image (docs/eyes.md).

    Attributes:
        width: Columns, which cover 360 degrees.
        height: Rows, from `top` to `bottom`.
        top: Elevation of the upper edge (rad).
        bottom: Elevation of the lower edge (rad).
        z: Height of the eye above the ground (m).
        samples: n, where n x n rays in each pixel are averaged by solid angle. None means 1 where a pixel is at most one degree
            wide, else 4.
        field: Horizontal field of view, centred ahead (rad). A column counts as visible where all of it lies inside.
        mask: Which pixels are visible: a (height, width) bool array, or the file of a picture that is white where the eye sees and
            black where it does not. None means all. It is kept as a `Mask`, which holds the pixels, not the file.
        known: Which pixels of a recorded image show the world, given as `mask` is: not those behind the body of the robot, or beyond
            the field of its camera. None means all.
    """

    width: int = whole(720, low=4, high=32768, unit="pixels")
    height: int = whole(150, low=1, high=16384, unit="pixels")
    top: float = number(math.radians(60.0), low=-math.pi / 2, high=math.pi / 2, unit="rad")
    bottom: float = number(math.radians(-15.0), low=-math.pi / 2, high=math.pi / 2, unit="rad")
    z: float = number(0.01, low=-MAX_COORDINATE, high=MAX_COORDINATE, unit="m")
    samples: int | None = whole(None, low=1, high=64, optional=True)
    field: float = number(2 * math.pi, above=0, high=2 * math.pi, unit="rad")
    mask: Mask | None = converted(default=None, converter=_mask, takes_self=True)
    known: Mask | None = converted(default=None, converter=_mask, takes_self=True)

    def __attrs_post_init__(self):
        if self.bottom >= self.top:
            top, bottom = math.degrees(self.top), math.degrees(self.bottom)
            raise FieldError("Eye", "bottom", f"is {bottom:g} and top is {top:g} degrees; give bottom < top")
        if self.width * self.height * self.rays**2 > MAX_RAYS:
            raise FieldError(
                "Eye",
                "",
                f"{self.width} x {self.height} pixels of {self.rays} x {self.rays} rays are more than {MAX_RAYS:,} rays; "
                f"give fewer pixels or samples",
            )
        if self.known is not None and not self.known.visible().any():
            raise FieldError(
                "Eye", "", "known is black everywhere; give a picture that is white where images show the world"
            )
        if self.masked and not self.visible().any():
            raise FieldError(
                "Eye",
                "",
                f"nothing is visible of {self.width} x {self.height} pixels in a field of {math.degrees(self.field):g} degrees"
                f"{' behind this mask' * (self.mask is not None)}; give a wider field, more columns or another mask",
            )

    @property
    def rays(self) -> int:
        """Rays along each side of a pixel: `samples`, or its default for this width."""
        return self.samples or (1 if self.width >= 360 else 4)

    @property
    def masked(self) -> bool:
        """Whether a field or a mask is set."""
        return self.field < 2 * math.pi or self.mask is not None

    def visible(self) -> "Bool[np.ndarray, 'height width']":
        """Which pixels of a panorama the eye sees, wherever it faces."""
        import numpy as np

        visible = np.ones((self.height, self.width), dtype=bool) if self.mask is None else self.mask.visible().copy()
        edges = math.pi - np.arange(self.width + 1) * (2 * math.pi / self.width)  # of the columns, to the left of ahead
        inside = np.abs(edges) <= self.field / 2 + 1e-9
        visible &= inside[:-1] & inside[1:]
        return visible

    def hide(
        self, views: "UInt8[np.ndarray, 'n height width channels']"
    ) -> "UInt8[np.ndarray, 'n height width channels']":
        """Views as the eye sees them, for people and learners that do not turn them: 0 (black, and no alpha) where it sees nothing."""
        return views * self.visible()[..., None] if self.masked else views

    def plain(self) -> dict[str, Any]:
        """Its fields by name, for files: numbers and texts. Where all is visible, nothing is said of that, as in earlier files."""
        fields = attrs.asdict(self)
        said = {"field": self.masked, "mask": self.masked, "known": self.known is not None}
        return {name: value for name, value in fields.items() if said.get(name, True)}

    def elevations(self, rays: int = 1) -> 'Float[np.ndarray, " height_rays"]':
        """Elevations of evenly spaced rows of rays (rad), from top to bottom, `rays` of them in each row of pixels."""
        import numpy as np

        n = self.height * rays
        return self.top - (np.arange(n) + 0.5) * (self.top - self.bottom) / n
