"""The geometry of the lenses of panoramic cameras: which pixel of a raw picture shows each direction.

Directions are azimuths relative to ahead (rad, counter-clockwise) and elevations (rad). Pixels are (x, y) from the top left of the
picture, where whole numbers are the centres of pixels; nan where the picture does not show a direction.
"""

import math

import numpy as np
from jaxtyping import Float

from tussock.world.errors import FieldError, SettingError
from tussock.world.settings import choice, number, numbers, settings, switch, whole

Pixels = Float[np.ndarray, "height width 2"]
LOOKING = ("up", "down", "ahead")
MAX_SIZE = 32766  # pixels along a side that OpenCV's remap can address
MAX_PIXEL = 1e6


@settings
class Ring:
    """The ring that a lens or a mirror draws, with elevation linear in the radius.

    The panorama starts at the lower edge of the picture and goes around clockwise, as that of BoB robotics: ahead is up.

    Attributes:
        centre: x and y of the centre (pixels).
        inner: Radius of the inner circle (pixels).
        outer: Radius of the outer circle (pixels).
        offset: Where ahead is in the picture, clockwise from up (rad).
        flip: The outer circle is the upper edge of the panorama instead of the inner one, as under a mirror that looks down.
        mirrored: Clockwise in the picture is to the left, as for a lens that looks up.
        top: Elevation of the upper edge (rad).
        bottom: Elevation of the lower edge (rad).
    """

    centre: tuple[float, ...] = numbers((0.0, 0.0), low=-MAX_PIXEL, high=MAX_PIXEL, unit="pixels")
    inner: float = number(low=0, high=MAX_PIXEL, unit="pixels")
    outer: float = number(above=0, high=MAX_PIXEL, unit="pixels")
    offset: float = number(0.0, low=-100, high=100, unit="rad")
    flip: bool = switch(False)
    mirrored: bool = switch(False)
    top: float = number(math.radians(60), low=-math.pi / 2, high=math.pi / 2, unit="rad")
    bottom: float = number(math.radians(-15), low=-math.pi / 2, high=math.pi / 2, unit="rad")

    def __attrs_post_init__(self):
        if len(self.centre) != 2 or self.outer - self.inner < 1 or self.top <= self.bottom:
            raise FieldError(
                "Ring",
                "",
                f"centre {self.centre}, inner radius {self.inner:g}, outer radius {self.outer:g}, "
                f"{math.degrees(self.bottom):g} to {math.degrees(self.top):g} degrees; "
                "give x and y, an outer radius that is larger by at least a pixel, and bottom < top",
            )

    @property
    def around(self) -> float:
        """Length of the circle halfway between the two (pixels)."""
        return math.pi * (self.inner + self.outer)

    def pixels(self, azimuth: Float[np.ndarray, " width"], elevation: Float[np.ndarray, " height"]) -> Pixels:
        """Where each direction is in the picture; nan above the top and below the bottom."""
        share = (self.top - elevation) / (self.top - self.bottom)
        share = np.where((share >= 0) & (share <= 1), 1 - share if self.flip else share, np.nan)
        radius = (self.inner + share * (self.outer - self.inner))[:, None]
        clockwise = self.offset + (azimuth if self.mirrored else -azimuth)  # from up
        x, y = self.centre
        return np.stack([x + radius * np.sin(clockwise), y - radius * np.cos(clockwise)], axis=2)


@settings
class Panorama:
    """A picture that is a panorama already. One from -90 to 90 degrees is equirectangular.

    Attributes:
        width: Columns, which cover 360 degrees.
        height: Rows, from `top` to `bottom`.
        offset: Where ahead is in the picture, to the right of its middle (rad).
        mirrored: Columns from left to right turn to the left.
        top: Elevation of the upper edge (rad).
        bottom: Elevation of the lower edge (rad).
    """

    width: int = whole(high=MAX_SIZE, unit="pixels")
    height: int = whole(high=MAX_SIZE, unit="pixels")
    offset: float = number(0.0, low=-100, high=100, unit="rad")
    mirrored: bool = switch(False)
    top: float = number(math.pi / 2, low=-math.pi / 2, high=math.pi / 2, unit="rad")
    bottom: float = number(-math.pi / 2, low=-math.pi / 2, high=math.pi / 2, unit="rad")

    def __attrs_post_init__(self):
        if self.top <= self.bottom:
            top, bottom = math.degrees(self.top), math.degrees(self.bottom)
            raise SettingError(f"Panorama: bottom is {bottom:g} and top is {top:g} degrees; give bottom < top")

    def pixels(self, azimuth: Float[np.ndarray, " width"], elevation: Float[np.ndarray, " height"]) -> Pixels:
        """Where each direction is in the picture; nan above the top and below the bottom."""
        turn = (self.offset + (azimuth if self.mirrored else -azimuth)) / (2 * math.pi) + 0.5
        share = (self.top - elevation) / (self.top - self.bottom)
        y = np.where((share >= 0) & (share <= 1), np.clip(share * self.height - 0.5, 0, self.height - 1), np.nan)
        x = turn % 1 * self.width - 0.5
        return np.stack(np.broadcast_arrays(x, y[:, None]), axis=2)


@settings
class PanoramaPart(Panorama):
    """A picture that is a part of a panorama, with columns evenly spaced in azimuth, as of a camera that sees 180 degrees.

    Attributes:
        field: Horizontal field of view, about the middle of the picture (rad). `width` columns cover it.
    """

    field: float = number(math.pi, above=0, high=2 * math.pi, unit="rad")

    def pixels(self, azimuth: Float[np.ndarray, " width"], elevation: Float[np.ndarray, " height"]) -> Pixels:
        """Where each direction is in the picture; nan above the top, below the bottom and outside of the field."""
        x, y = np.moveaxis(super().pixels(azimuth, elevation), 2, 0)
        off = ((x + 0.5) / self.width - 0.5) * (
            2 * math.pi / self.field
        )  # shares of the picture to the right of its middle
        inside = np.clip((off + 0.5) * self.width - 0.5, 0, self.width - 1)
        return np.stack([np.where(np.abs(off) <= 0.5 + 1e-9, inside, np.nan), y], axis=2)


@settings
class Calibrated:
    """What calibrated lenses have in common.

    Attributes:
        matrix: fx, fy, cx, cy and the skew (pixels), of K.
        distortion: Four numbers, of D.
        looking: What the middle of the picture shows: up, down or ahead. Where it is up or down, the picture's upper side is ahead.
        offset: Where ahead is in the picture, clockwise from up (rad). Looking ahead: to the right of the middle.
        mirrored: The picture is a mirror image.
    """

    matrix: tuple[float, ...] = numbers((1.0, 1.0, 0.0, 0.0, 0.0), low=-MAX_PIXEL, high=MAX_PIXEL, unit="pixels")
    distortion: tuple[float, ...] = numbers((0.0, 0.0, 0.0, 0.0), low=-1e6, high=1e6)
    looking: str = choice("up", LOOKING)
    offset: float = number(0.0, low=-100, high=100, unit="rad")
    mirrored: bool = switch(False)

    def __attrs_post_init__(self):
        if len(self.matrix) != 5 or len(self.distortion) != 4:
            raise SettingError(f"{type(self).__name__}: give fx, fy, cx, cy and the skew of K, and four numbers of D")


@settings
class Fisheye(Calibrated):
    """A fisheye lens as OpenCV calibrates it (`cv2.fisheye`), with k1 to k4."""

    def pixels(self, azimuth: Float[np.ndarray, " width"], elevation: Float[np.ndarray, " height"]) -> Pixels:
        """Where each direction is in the picture; nan beyond the angle up to which the calibration is one to one."""
        x, y, z = _camera_directions(self, azimuth, elevation)
        across = np.hypot(x, y)
        angle = np.arctan2(across, z)
        k = self.distortion
        angles = np.linspace(0, math.pi, 3601)
        radii = angles * (1 + k[0] * angles**2 + k[1] * angles**4 + k[2] * angles**6 + k[3] * angles**8)
        turns = np.flatnonzero(np.diff(radii) <= 0)
        limit = angles[turns[0]] if len(turns) else math.pi
        radius = angle * (1 + k[0] * angle**2 + k[1] * angle**4 + k[2] * angle**6 + k[3] * angle**8)
        scale = np.where(angle < limit, radius / np.maximum(across, 1e-12), np.nan)
        return _on_sensor(self.matrix, x * scale, y * scale)


@settings
class Omnidirectional(Calibrated):
    """A catadioptric or very wide lens as OpenCV calibrates it (`cv2.omnidir`, the model of Mei and Rives 2007), with k1, k2, p1 and p2.

    A camera under a mirror looks down, at itself, and its picture is a mirror image.

    Attributes:
        xi: Distance of the projection's centre from that of the unit sphere.
    """

    xi: float = number(low=0, high=1e3)

    def pixels(self, azimuth: Float[np.ndarray, " width"], elevation: Float[np.ndarray, " height"]) -> Pixels:
        """Where each direction is in the picture; nan where the model is not one to one."""
        x, y, z = _camera_directions(self, azimuth, elevation)
        least = -1 / self.xi if self.xi > 1 else -self.xi
        depth = np.where(z > least + 1e-9, z + self.xi, np.nan)
        x, y = x / depth, y / depth
        k1, k2, p1, p2 = self.distortion
        square = x * x + y * y
        radial = 1 + k1 * square + k2 * square * square
        return _on_sensor(
            self.matrix,
            x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x),
            y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y,
        )


def _camera_directions(
    lens: Calibrated, azimuth: np.ndarray, elevation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions as unit vectors in the frame of a camera: x to the right of its picture, y down, z out of the lens."""
    turned = azimuth + (lens.offset if (lens.looking == "up") != lens.mirrored else -lens.offset)
    level = np.cos(elevation)[:, None]
    ahead, left = level * np.cos(turned), level * np.sin(turned)
    up = np.broadcast_to(np.sin(elevation)[:, None], ahead.shape)
    right, down, out = {
        "up": (left, -ahead, up),  # who lies on his back, head to the north, has the west on the right
        "down": (-left, -ahead, -up),
        "ahead": (-left, -up, ahead),
    }[lens.looking]
    return (-right if lens.mirrored else right), down, out


def _on_sensor(matrix: tuple[float, ...], x: np.ndarray, y: np.ndarray) -> Pixels:
    fx, fy, cx, cy, skew = matrix
    return np.stack([fx * x + skew * y + cx, fy * y + cy], axis=2)
