"""How well agents measure their own motion: models of the noise of a compass and an odometer, by name. Light to import.

A spec names one, and may change it: "ideal", "ant", "robot compass_drift_deg=0".
"""

from functools import partial
from math import radians
from typing import Any

from tussock.world.errors import SettingError
from tussock.world.registry import Registry
from tussock.world.settings import number, settings
from tussock.world.specs import Spec


@settings
class Senses:
    """How well an agent measures its heading and the distance that it walks.

    Errors of the odometer and drift grow with the square root of distance and time, whatever the length of a step. Those of the compass
    are new at each reading, so that more and shorter steps average more of them; an agent that has not moved reads it exactly.

    Attributes:
        odometry: Standard deviation of the measured distance (m) after 1 m.
        compass: Standard deviation of the heading over 1 s (rad), new at each reading, as of a sky compass.
        compass_drift: Standard deviation of the heading after 1 s (rad), which adds up, as of a gyroscope.
        speed: At which the agent walks (m/s): the time that a step takes.
    """

    odometry: float = number(0.0, low=0, unit="m")
    compass: float = number(0.0, low=0, unit="rad")
    compass_drift: float = number(0.0, low=0, unit="rad")
    speed: float = number(0.1, above=0, unit="m/s")

    @property
    def noisy(self) -> bool:
        """Whether they are not exact."""
        return max(self.odometry, self.compass, self.compass_drift) > 0


# Noise of the odometer (per root metre) and of the heading (degrees per root second), as Bee-Nav (2026) compares them. Ants and bees have a
# compass in the sky, so theirs does not add up; robots turn by gyroscopes and images. Speeds are chosen here, but that of the bee.
ROBOT = partial(Senses, odometry=0.10, compass_drift=radians(0.63), speed=0.5)
SVO_GTSAM = partial(Senses, odometry=0.015, compass_drift=radians(0.25), speed=0.5)
STANKIEWICZ_WEBB = partial(Senses, odometry=0.15, compass=radians(5.5), speed=0.5)
ANT = partial(Senses, odometry=0.38, compass=radians(57.0), speed=0.3)
BEE = partial(Senses, odometry=0.38, compass=radians(34.5), speed=2.5)

SENSES = Registry(
    "senses",
    "model of senses",
    {
        "ideal": f"{__name__}:Senses",
        "robot": f"{__name__}:ROBOT",
        "svo-gtsam": f"{__name__}:SVO_GTSAM",
        "stankiewicz-webb": f"{__name__}:STANKIEWICZ_WEBB",
        "ant": f"{__name__}:ANT",
        "bee": f"{__name__}:BEE",
        "dorsal-rim": "tussock.navigation.sky_compass:DorsalRim",
    },
)
COMPARED = ("ideal", "robot", "svo-gtsam", "stankiewicz-webb", "ant", "bee")  # by Bee-Nav (2026)


def as_senses(value: Any) -> Spec:
    """The spec of senses from a text, a spec or `Senses`. Raises SettingError."""
    spec = SENSES.spec(value) if isinstance(value, str) else value if isinstance(value, Spec) else SENSES.spec_of(value)
    if not isinstance(spec.make(), Senses):  # refuses bad parameters, too
        raise SettingError(f"{str(spec)!r} is not a model of senses; name one, such as 'ant'")
    return spec
