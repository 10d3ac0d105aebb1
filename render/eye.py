"""The eye: what part of the sphere a panorama shows, and how finely."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tussock.world.errors import InputError
from tussock.world.geometry import MAX_COORDINATE

MOST_RAYS = 10**8  # 1.2 GB a thread to draw with


@dataclass(frozen=True, kw_only=True)
class Eye:
    """A panoramic eye. The default is that of the published Sussex databases.

    width, height: columns around 360 degrees, rows between top and bottom.
    top, bottom: elevation of the upper and lower edge (rad), within +-90 degrees.
    z: height of the eye above z = 0 (m).
    samples: rays along each side of a pixel; the pixel is their average over its solid angle. None takes 1 where
        a pixel is at most a degree wide, else 4.
    """

    width: int = 720
    height: int = 150
    top: float = np.radians(60.0)
    bottom: float = np.radians(-15.0)
    z: float = 0.01
    samples: int | None = None

    def __post_init__(self):
        for name in ("width", "height", "samples"):
            value = getattr(self, name)
            if not isinstance(value, int | np.integer) and not (name == "samples" and value is None):
                raise InputError(f"the eye's {name} is {value!r}; give a whole number")
        for name in ("top", "bottom", "z"):
            value = getattr(self, name)
            if not (isinstance(value, int | float | np.number) and abs(value) <= MAX_COORDINATE):
                raise InputError(f"the eye's {name} is {value!r}; give a finite number")
        if self.width < 4 or self.height < 1:
            raise InputError(f"a view of {self.width} x {self.height} pixels cannot be drawn; give at least 4 x 1")
        if self.width > 32768 or self.height > 16384:
            raise InputError(f"a view of {self.width} x {self.height} pixels is too large; give at most 32768 x 16384")
        if not -np.pi / 2 <= self.bottom < self.top <= np.pi / 2:
            raise InputError(
                f"elevations {np.degrees(self.bottom):g}..{np.degrees(self.top):g} degrees: give -90 <= bottom < top <= 90"
            )
        if self.samples is not None and not 1 <= self.samples <= 64:
            raise InputError(f"{self.samples} samples a pixel side; give 1 to 64")
        if self.width * self.height * self.rays**2 > MOST_RAYS:
            raise InputError(
                f"{self.width} x {self.height} pixels of {self.rays} x {self.rays} rays are over {MOST_RAYS:,}; give fewer"
            )

    @property
    def rays(self) -> int:
        """Rays along each side of a pixel: `samples`, or what its default comes to."""
        return self.samples or (1 if self.width >= 360 else 4)

    def elevations(self, rays: int = 1) -> Float[np.ndarray, " height_rays"]:
        """Elevation of each row's centre (rad), top row first; `rays` of them to a row, evenly spaced."""
        n = self.height * rays
        return self.top - (np.arange(n) + 0.5) * (self.top - self.bottom) / n
