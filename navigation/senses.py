"""What an agent measures of its own motion: a compass and an odometer, with the noise of published studies (sense_models.py)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tussock.world.geometry import wrap_angle

from .sense_models import Senses


@dataclass
class Readings:
    """The compass and the odometer of one agent, as it walks.

    Attributes:
        senses: How good they are.
        random: What noise is drawn from; nothing is drawn where there is none.
        drift: Of the compass so far (rad).
    """

    senses: Senses
    random: np.random.Generator
    drift: float = 0.0

    def read(
        self, headings: Float[np.ndarray, " k"], distances: Float[np.ndarray, " k"]
    ) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
        """Headings (rad) and distances (m) of the parts of a way, as they are measured one after the other."""
        senses, seconds = self.senses, distances / self.senses.speed
        headings, distances = np.array(headings, dtype=float), np.array(distances, dtype=float)
        if senses.compass_drift:
            drift = self.drift + np.cumsum(senses.compass_drift * np.sqrt(seconds) * self._normal(len(seconds)))
            headings, self.drift = headings + drift, float(drift[-1]) if len(drift) else self.drift
        if senses.compass:
            headings = headings + senses.compass * np.sqrt(seconds) * self._normal(len(seconds))
        if senses.odometry:
            distances = distances + senses.odometry * np.sqrt(distances) * self._normal(len(distances))
        return wrap_angle(headings), distances

    def _normal(self, count: int) -> Float[np.ndarray, " count"]:
        return self.random.standard_normal(count)
