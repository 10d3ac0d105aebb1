"""The eye: which part of the sphere a panorama shows, and how finely."""

import math
from typing import TYPE_CHECKING

from tussock.world.errors import SettingError
from tussock.world.settings import MAX_COORDINATE, number, settings, whole

if TYPE_CHECKING:  # the command line reads the defaults: without numpy, its help appears at once
    import numpy as np
    from jaxtyping import Float

MAX_RAYS = 10**8  # of a panorama; the CPU renderer uses 12 bytes a ray and thread


@settings
class Eye:
    """A panoramic eye. The default is that of the published Sussex databases.

    Attributes:
        width: Columns, which cover 360 degrees.
        height: Rows, from `top` to `bottom`.
        top: Elevation of the upper edge (rad).
        bottom: Elevation of the lower edge (rad).
        z: Height of the eye above the ground (m).
        samples: n, where n x n rays in each pixel are averaged by solid angle. None means 1 where a pixel is at most one degree
            wide, else 4.
    """

    width: int = whole(720, low=4, high=32768, unit="pixels")
    height: int = whole(150, low=1, high=16384, unit="pixels")
    top: float = number(math.radians(60.0), low=-math.pi / 2, high=math.pi / 2, unit="rad")
    bottom: float = number(math.radians(-15.0), low=-math.pi / 2, high=math.pi / 2, unit="rad")
    z: float = number(0.01, low=-MAX_COORDINATE, high=MAX_COORDINATE, unit="m")
    samples: int | None = whole(None, low=1, high=64, optional=True)

    def __attrs_post_init__(self):
        if self.bottom >= self.top:
            top, bottom = math.degrees(self.top), math.degrees(self.bottom)
            raise SettingError(f"Eye: bottom is {bottom:g} and top is {top:g} degrees; give bottom < top")
        if self.width * self.height * self.rays**2 > MAX_RAYS:
            raise SettingError(
                f"Eye: {self.width} x {self.height} pixels of {self.rays} x {self.rays} rays are more than {MAX_RAYS:,} rays; "
                f"give fewer pixels or samples"
            )

    @property
    def rays(self) -> int:
        """Rays along each side of a pixel: `samples`, or its default for this width."""
        return self.samples or (1 if self.width >= 360 else 4)

    def elevations(self, rays: int = 1) -> 'Float[np.ndarray, " height_rays"]':
        """Elevations of evenly spaced rows of rays (rad), from top to bottom, `rays` of them in each row of pixels."""
        import numpy as np

        n = self.height * rays
        return self.top - (np.arange(n) + 0.5) * (self.top - self.bottom) / n
