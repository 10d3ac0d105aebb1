"""Changes of the light: hours later, or clouds. They change no shape. Light to import."""

from typing import Any, ClassVar

import attrs

from .light import Light
from .settings import number, settings


@settings
class SunMoved:
    """The sun has moved on (see `Light.later`), and with it shadows and sky.

    Attributes:
        amount: Share of the hours that have passed.
        hours: At an amount of 1; negative: earlier.
    """

    name: ClassVar[str] = "sun"
    amount: float = number(1.0, low=0, high=1)
    hours: float = number(4.0, low=-24, high=24, unit="h")

    def __call__(self, world: Any, rng: Any, route: Any = None) -> Any:
        """The world, which stays as it is."""
        return world

    def lit(self, light: Light) -> Light:
        """The light then. Raises SettingError at night."""
        return light.later(self.amount * self.hours) if self.amount else light


@settings
class Clouded:
    """Clouds have come: of what was clear of the sky, a share is covered.

    Attributes:
        amount: The share.
    """

    name: ClassVar[str] = "clouds"
    amount: float = number(low=0, high=1)

    def __call__(self, world: Any, rng: Any, route: Any = None) -> Any:
        """The world, which stays as it is."""
        return world

    def lit(self, light: Light) -> Light:
        """The light then."""
        return attrs.evolve(light, clouds=light.clouds + self.amount * (1 - light.clouds)) if self.amount else light
