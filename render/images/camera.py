"""A camera: what its pictures are, and how panoramas are made of them."""

import logging
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import attrs

from tussock.world.errors import FieldError
from tussock.world.settings import choice, number, settings, switch, whole

from .calibration import read_calibration
from .lens_metadata import MAX_COLUMNS, MIN_ASPECT, natural_size
from .lenses import LOOKING, MAX_PIXEL, MAX_SIZE, Fisheye, Omnidirectional, Panorama, PanoramaPart, Ring
from .pictures import Picture
from .ring_search import find_ring
from .unwrapping import Unwrapping

log = logging.getLogger(__name__)

LENSES = ("auto", "ring", "fisheye", "omnidirectional", "panorama", "equirectangular")
TOP, BOTTOM = math.radians(60), math.radians(-15)  # as the published Sussex databases


@settings
class Camera:
    """How panoramas are made of pictures. What is None is found out, stated by a calibration, or taken as usual.

    Attributes:
        lens: What the pictures are. auto: rings where a centre, a radius or `flip` is given, and panoramas where a field is; else
            panoramas where they are at least twice as wide as high, rings otherwise.
        calibration: File of OpenCV's with K and D of a fisheye lens, or xi, K and D of an omnidirectional one.
        looking: What the middle of the picture of a calibrated lens shows.
        centre: x and y of a ring (pixels).
        inner: Radius of the inner circle of a ring (pixels).
        outer: Radius of the outer circle of a ring (pixels).
        offset: Where ahead is in the picture: clockwise from up, or to the right of the middle of a panorama (rad).
        flip: The outer circle of a ring is the upper edge of the panorama.
        mirrored: The picture is mirrored: clockwise in a ring, or to the right in a panorama, is to the left of the eye.
        top: Elevation of the panorama's upper edge (rad); None is 60 degrees.
        bottom: Elevation of its lower edge (rad); None is -15 degrees.
        width: Columns of a panorama.
        height: Rows of a panorama.
        field: Horizontal field of pictures that are a part of a panorama (rad): their columns are evenly spaced in azimuth. None: 360
            degrees.
    """

    lens: str = choice("auto", LENSES)
    calibration: Path | None = attrs.field(default=None)
    looking: str = choice("up", LOOKING)
    centre: tuple[float, ...] | None = attrs.field(default=None)
    inner: float | None = number(None, low=0, high=MAX_PIXEL, unit="pixels", optional=True)
    outer: float | None = number(None, above=0, high=MAX_PIXEL, unit="pixels", optional=True)
    offset: float = number(0.0, low=-100, high=100, unit="rad")
    flip: bool = switch(False)
    mirrored: bool = switch(False)
    top: float | None = number(None, low=-math.pi / 2, high=math.pi / 2, unit="rad", optional=True)
    bottom: float | None = number(None, low=-math.pi / 2, high=math.pi / 2, unit="rad", optional=True)
    width: int | None = whole(None, low=4, high=MAX_SIZE, unit="pixels", optional=True)
    height: int | None = whole(None, low=1, high=MAX_SIZE, unit="pixels", optional=True)
    field: float | None = number(None, above=0, high=2 * math.pi, unit="rad", optional=True)

    def __attrs_post_init__(self):
        if self.lens in ("fisheye", "omnidirectional") and self.calibration is None:
            raise FieldError(
                "Camera", "", f"a {self.lens} lens needs a calibration; give the file of OpenCV's with K and D"
            )
        if self.field is not None and self.stated_lens != "panorama":
            raise FieldError(
                "Camera",
                "",
                f"a field is of pictures that are a part of a panorama, not of a lens {self.stated_lens!r}; leave it out",
            )
        if self.calibration is not None and self.lens not in ("fisheye", "omnidirectional"):
            raise FieldError(
                "Camera",
                "",
                f"a calibration is of a fisheye or omnidirectional lens, not of {self.lens!r}; give that lens",
            )
        if self._of_a_ring and self.stated_lens != "ring":
            raise FieldError(
                "Camera",
                "",
                f"{', '.join(self._of_a_ring)} of a ring, and the lens is {self.lens!r}; leave out one of them",
            )

    @property
    def _of_a_ring(self) -> list[str]:
        """What is given that only rings have."""
        return [name for name in ("centre", "inner", "outer", "flip") if getattr(self, name) not in (None, False)]

    @property
    def stated_lens(self) -> str:
        """The lens that is given, or that follows from what is given; "auto" where none does."""
        if self.lens == "auto" and self._of_a_ring:
            return "ring"
        return "panorama" if self.lens == "auto" and self.field is not None else self.lens

    def unwrapping(self, pictures: Sequence[Picture]) -> Unwrapping:
        """How the pictures of this camera become panoramas. What is assumed is logged.

        Args:
            pictures: Some of its pictures, of one size, in which a ring is looked for.

        Raises:
            InputError: There is no ring in them, or what was given does not fit together.
        """
        height, width = pictures[0].shape[:2]
        lens = self.stated_lens
        if lens == "auto":
            lens = "panorama" if width >= MIN_ASPECT * height else "ring"
            log.warning("the pictures are %d x %d: each is taken as a %s; --lens takes another", width, height, lens)
        top, bottom = (usual if each is None else each for each, usual in ((self.top, TOP), (self.bottom, BOTTOM)))
        if lens in ("ring", "panorama") and (self.top is None or self.bottom is None):
            log.warning(
                "the elevations of the %s's edges are not known: %g to %g degrees are assumed; --top-deg and --bottom-deg give others",
                lens,
                round(math.degrees(bottom), 3),
                round(math.degrees(top), 3),
            )
        mapping = self._lens(lens, pictures, top, bottom)
        usual = _usual_size(mapping, top, bottom)
        across = self.width or usual[0]
        return Unwrapping(mapping, across, self.height or max(1, round(usual[1] * across / usual[0])), top, bottom)

    def _lens(
        self, lens: str, pictures: Sequence[Picture], top: float, bottom: float
    ) -> Ring | Panorama | Fisheye | Omnidirectional:
        height, width = pictures[0].shape[:2]
        turned: dict[str, Any] = {"offset": self.offset, "mirrored": self.mirrored}
        if lens == "ring":
            return self._ring(pictures, turned, top, bottom)
        if lens == "panorama":
            size: dict[str, Any] = {"width": width, "height": height, "top": top, "bottom": bottom}
            return (
                Panorama(**size, **turned) if self.field is None else PanoramaPart(**size, **turned, field=self.field)
            )
        if lens == "equirectangular":
            if width != 2 * height:
                log.warning("the pictures are %d x %d; an equirectangular one is twice as wide as high", width, height)
            return Panorama(width=width, height=height, **turned)
        assert self.calibration is not None
        return read_calibration(self.calibration, lens, width, height, looking=self.looking, **turned)

    def _ring(self, pictures: Sequence[Picture], turned: dict[str, Any], top: float, bottom: float) -> Ring:
        centre, inner, outer = self.centre, self.inner, self.outer
        if centre is None or inner is None or outer is None:
            found = find_ring(pictures)
            log.warning(
                "found a ring with --centre %.1f,%.1f --inner-px %.1f --outer-px %.1f (%.0f %% of its edge seen)%s",
                *found.centre,
                found.inner,
                found.outer,
                100 * found.seen,
                "; its centre is not dark, so that the inner radius may be larger"
                if inner is None and found.inner == 0
                else "",
            )
            centre = found.centre if centre is None else centre
            inner, outer = found.inner if inner is None else inner, found.outer if outer is None else outer
        return Ring(centre=centre, inner=inner, outer=outer, flip=self.flip, top=top, bottom=bottom, **turned)


def _usual_size(lens: Ring | Panorama | Fisheye | Omnidirectional, top: float, bottom: float) -> tuple[int, int]:
    """Columns and rows of a panorama: of a panorama, or a part of one, as it is; of other pictures not more than `MAX_COLUMNS`."""
    if isinstance(lens, Ring):
        return natural_size(lens)
    if isinstance(lens, Panorama):
        share = (top - bottom) / (lens.top - lens.bottom)
        whole_sphere = share < 1
        around = round(lens.width * 2 * math.pi / lens.field) if isinstance(lens, PanoramaPart) else lens.width
        width = min(around, MAX_COLUMNS) if whole_sphere else around
        return width, max(1, round(lens.height * share * width / around))
    return MAX_COLUMNS, max(1, round(MAX_COLUMNS * (top - bottom) / (2 * math.pi)))
