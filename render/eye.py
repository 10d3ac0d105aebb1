"""The eye: which part of the sphere a panorama shows, and how finely."""

import math
from typing import TYPE_CHECKING, Any

import attrs

from tussock.world.errors import FieldError
from tussock.world.settings import MAX_COORDINATE, choice, converted, number, settings, whole

from .compound import CompoundEye, as_compound
from .mask import Mask, as_mask
from .spectrum import HUMAN, as_spectrum

if TYPE_CHECKING:  # the command line reads the defaults: without numpy, its help appears at once
    import numpy as np
    from jaxtyping import Bool, Float, UInt8

MAX_RAYS = 10**8  # of a panorama; the CPU renderer uses 12 bytes a ray and thread


def _mask(value: Any, eye: Any = None) -> Mask | None:
    sized = isinstance(eye.width, int) and isinstance(eye.height, int)  # else the eye is refused
    return as_mask(value, eye.width, eye.height) if sized and value is not None else value


def _compound(value: Any) -> CompoundEye | None:
    return None if value is None else as_compound(value)


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
        side: "left": only what the left eye sees, from straight ahead over the left to behind. "right": likewise. "both": all.
        overlap: Width of what both eyes see ahead (rad), half of it on either side; negative: of a gap between them. Of a compound eye
            whose ommatidia belong to a left and a right eye, these count instead.
        mask: Which pixels are visible: a (height, width) bool array, or the file of a picture that is white where the eye sees and
            black where it does not. None means all. It is kept as a `Mask`, which holds the pixels, not the file.
        known: Which pixels of a recorded image show the world, given as `mask` is: not those behind the body of the robot, or beyond
            the field of its camera. None means all.
        compound: The ommatidia of a compound eye, which see parts of the panorama (`compound_eye`). None: the pixels are what it sees.
        spectrum: "human": views show red, green and blue. "insect": they show ultraviolet in place of red; "insect ground=0.2" gives
            the share of it that a material reflects (see `Insect`).
    """

    width: int = whole(720, low=4, high=32768, unit="pixels")
    height: int = whole(150, low=1, high=16384, unit="pixels")
    top: float = number(math.radians(60.0), low=-math.pi / 2, high=math.pi / 2, unit="rad")
    bottom: float = number(math.radians(-15.0), low=-math.pi / 2, high=math.pi / 2, unit="rad")
    z: float = number(0.01, low=-MAX_COORDINATE, high=MAX_COORDINATE, unit="m")
    samples: int | None = whole(None, low=1, high=64, optional=True)
    field: float = number(2 * math.pi, above=0, high=2 * math.pi, unit="rad")
    side: str = choice("both", ("both", "left", "right"))
    overlap: float = number(0.0, low=-math.pi, high=math.pi, unit="rad")
    mask: Mask | None = converted(default=None, converter=_mask, takes_self=True)
    known: Mask | None = converted(default=None, converter=_mask, takes_self=True)
    compound: CompoundEye | None = converted(default=None, converter=_compound)
    spectrum: str = converted(default=HUMAN, converter=as_spectrum)

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
        if self.compound is not None:
            self._check_compound(self.compound)
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

    def _check_compound(self, compound: CompoundEye) -> None:
        import numpy as np

        if self.mask is not None or self.known is not None:
            raise FieldError(
                "Eye", "", "a compound eye looks at all of a panorama; give no mask, and no known part of images"
            )
        elevation = compound.ommatidia().elevation
        low, high = np.degrees([elevation.min(), elevation.max()])
        top, bottom = math.degrees(self.top), math.degrees(self.bottom)
        if high > top + 1e-6 or low < bottom - 1e-6:
            raise FieldError(
                "Eye",
                "",
                f"ommatidia of {compound!r} look at elevations from {low:.1f} to {high:.1f} degrees, and the panorama is from {bottom:g} "
                f"to {top:g}; leave its edges out, or give wider ones",
            )
        if not self.ommatidia_in_field().any():
            raise FieldError("Eye", "", f"no ommatidium of {compound!r} looks at this field of view; give a wider one")

    @property
    def rays(self) -> int:
        """Rays along each side of a pixel: `samples`, or its default for this width."""
        return self.samples or (1 if self.width >= 360 else 4)

    @property
    def masked(self) -> bool:
        """Whether a field, a side or a mask is set."""
        return self.field < 2 * math.pi or self.side != "both" or self.mask is not None

    @property
    def sees_all(self) -> bool:
        """Whether every pixel of a panorama is what it sees."""
        return not self.masked and self.known is None and self.compound is None

    def visible(self) -> "Bool[np.ndarray, 'height width']":
        """Which pixels of a panorama the eye sees, wherever it faces."""
        import numpy as np

        visible = np.ones((self.height, self.width), dtype=bool) if self.mask is None else self.mask.visible().copy()
        edges = math.pi - np.arange(self.width + 1) * (2 * math.pi / self.width)  # of the columns, to the left of ahead
        inside = self._in_field(edges)
        visible &= inside[:-1] & inside[1:]
        return visible

    def _in_field(self, azimuths: "Float[np.ndarray, ' n']") -> "Bool[np.ndarray, ' n']":
        """Whether azimuths (rad, -pi to pi to the left) are in the field of view and on the side of the eye."""
        import numpy as np

        inside = np.abs(azimuths) <= self.field / 2 + 1e-9
        over = {"left": azimuths, "right": -azimuths}.get(self.side)
        return inside if over is None else inside & (over >= -self.overlap / 2 - 1e-9)

    def ommatidia_in_field(self) -> "Bool[np.ndarray, ' n']":
        """Which ommatidia of a compound eye look at its field of view."""
        import numpy as np

        assert self.compound is not None
        azimuth, _, _, side = self.compound.ommatidia()
        azimuth = np.arctan2(np.sin(azimuth), np.cos(azimuth))
        inside = self._in_field(azimuth)
        if self.side == "both":
            return inside
        from .ommatidia import EITHER, LEFT, RIGHT

        wanted = LEFT if self.side == "left" else RIGHT
        return np.where(side == EITHER, inside, (side == wanted) & (np.abs(azimuth) <= self.field / 2 + 1e-9))

    def hide(
        self, views: "UInt8[np.ndarray, 'n height width channels']"
    ) -> "UInt8[np.ndarray, 'n height width channels']":
        """Views as the eye sees them, for people and learners that do not turn them: 0 (black, and no alpha) where it sees nothing."""
        return views * self.visible()[..., None] if self.masked else views

    def plain(self) -> dict[str, Any]:
        """Its fields by name, for files: numbers and texts. What is usual and newer than the first files is left out."""
        fields = attrs.asdict(self)
        fields["compound"] = None if self.compound is None else str(self.compound)  # plain, as other libraries write it
        sides = self.side != "both"
        said = {
            "side": sides,
            "overlap": sides,
            "field": self.masked,
            "mask": self.masked,
            "known": self.known is not None,
            "compound": self.compound is not None,
            "spectrum": self.spectrum != HUMAN,
        }
        return {name: value for name, value in fields.items() if said.get(name, True)}

    def elevations(self, rays: int = 1) -> 'Float[np.ndarray, " height_rays"]':
        """Elevations of evenly spaced rows of rays (rad), from top to bottom, `rays` of them in each row of pixels."""
        import numpy as np

        n = self.height * rays
        return self.top - (np.arange(n) + 0.5) * (self.top - self.bottom) / n


def compound_eye(eye: Any, **fields: Any) -> Eye:
    """An eye of ommatidia, and the panorama that they are computed from.

    Args:
        eye: "ant", "bee", "fly ommatidia=700", "sphere ommatidia=1000", the path of a file (.eye or .csv), or `Ommatidia`.
        fields: Further fields of the `Eye`, such as `z` (m); a `width` and `height` in place of those that are fine enough.

    Raises:
        SettingError: For a name or a parameter that is not known.
        FileError: For a file that cannot be read.
    """
    compound = as_compound(eye)
    return Eye(**({**compound.panorama(), **fields, "compound": compound}))
