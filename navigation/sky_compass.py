"""A compass in the sky: the dorsal rim of an insect's eye, which sees how the light above is polarised.

Units look up at points of a dome around the zenith of the body. Unit i, at the azimuth a_i of the body, compares light that is polarised
along its ring of the dome with light that is polarised across it. What it reads is

    S_i = d_i cos 2 (chi_i - a_i - 90 degrees)

for light of the degree of polarisation d_i with the e-vector chi_i. Above a level body the e-vectors are at right angles to the plane
through sun and zenith, so half the angle of the sum of S_i exp(2 i a_i) is the direction of that plane: the heading up to a half-turn.
The brighter half of the sky decides between the two (Labhart 1988; Lambrinos et al. 1997; the dome is that of Gkanias et al. 2019).
"""

from functools import cache

import numpy as np
from jaxtyping import Float

from tussock.render.poses import frames_of
from tussock.world.geometry import wrap_angle
from tussock.world.light import Light, polarisation, sky_luminance
from tussock.world.settings import number, settings, switch, whole

from .sense_models import Senses

MIN_SUM = 1e-6  # of a unit; a smaller sum has no direction, as under an even sky
MIN_RING = 5  # units in a ring; the sum over fewer, evenly spaced, is not 0 under an even sky


@settings
class DorsalRim(Senses):
    """A polarisation compass. It must have a sky: a world with a light. Plants above do not cover it.

    Attributes:
        units: Their number, spread over the dome in rings.
        dome: Angle from one side of the dome to the other (rad).
        unit_noise: Standard deviation of what each unit reads (of -1 to 1), new at each reading.
        sees_sun: Whether the brighter half of the sky decides between a heading and its opposite. Otherwise a walk begins with either at
            random, and an agent takes the one that is nearer to what it read before.
    """

    units: int = whole(60, low=5, high=10_000, unit="units")
    dome: float = number(np.radians(56.0), above=0, high=np.pi, unit="rad")
    unit_noise: float = number(0.01, low=0, unit="share")
    sees_sun: bool = switch(True)

    @property
    def noisy(self) -> bool:
        """Whether they are not exact."""
        return True

    def heading(
        self,
        light: Light,
        heading: float,
        tilt: tuple[float, float],
        random: np.random.Generator,
        before: float | None,
    ) -> float:
        """What it reads.

        Args:
            light: Of the sky.
            heading: The true heading (rad).
            tilt: Pitch and roll of the head (rad), which the compass does not know.
            random: What noise is drawn from.
            before: What it read before (rad), if anything.
        """
        own = _dome(self.units, self.dome)
        azimuth = np.arctan2(own[:, 1], own[:, 0])
        axes = frames_of(np.array([[0.0, 0.0, heading, 0.0, *tilt]]))[0, 1:]
        directions = own @ axes  # in the world
        degree, vectors = polarisation(light, directions)
        swings = vectors @ axes.T  # in the frame of the body
        along = np.column_stack([-np.sin(azimuth), np.cos(azimuth), 0 * azimuth])
        across = np.cross(own, along)
        reads = degree * ((swings * along).sum(axis=1) ** 2 - (swings * across).sum(axis=1) ** 2)
        total = (reads + self.unit_noise * random.standard_normal(self.units)) @ np.exp(2j * azimuth)
        if abs(total) < MIN_SUM:  # an even sky
            return float(random.uniform(-np.pi, np.pi))
        read = float(wrap_angle(light.azimuth - np.angle(total) / 2))
        if self.sees_sun:
            bright = sky_luminance(light, directions) @ np.exp(1j * azimuth)
            expected = light.azimuth - float(np.angle(bright))
        elif before is None:
            expected = read + np.pi * random.integers(2)
        else:
            expected = before
        return read if np.cos(read - expected) >= 0 else float(wrap_angle(read + np.pi))


@cache
def _dome(units: int, width: float) -> Float[np.ndarray, "units 3"]:
    """Directions of units in the frame of the body (ahead, left, up): rings about the zenith, the more units the wider they are."""
    rings = min(max(1, round(np.sqrt(units) / 2)), units // MIN_RING)
    zenith = (np.arange(rings) + 0.5) / rings * width / 2
    share = np.sin(zenith) / np.sin(zenith).sum()
    counts = MIN_RING + np.floor(share * (units - MIN_RING * rings)).astype(int)
    counts[-1] += units - counts.sum()
    directions = []
    for angle, count in zip(zenith.tolist(), counts.tolist(), strict=True):
        turn = 2 * np.pi * np.arange(count) / count
        directions.append(
            np.column_stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), np.full(count, np.cos(angle))])
        )
    return np.concatenate(directions)
