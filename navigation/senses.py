"""What an agent measures of its own motion: a compass and an odometer, with the noise of published studies (sense_models.py)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tussock.world.errors import SettingError
from tussock.world.geometry import wrap_angle
from tussock.world.light import Light

from .sense_models import Senses
from .sky_compass import DorsalRim

READING = 0.5  # s between readings on a learning walk, as in Bee-Nav's simulation


@dataclass
class Readings:
    """The compass and the odometer of one agent, as it walks.

    Attributes:
        senses: How good they are.
        random: What noise is drawn from; nothing is drawn where there is none.
        light: Of the sky, for a compass that sees it.
        drift: Of the compass so far (rad).
        before: What a compass in the sky read before (rad).
    """

    senses: Senses
    random: np.random.Generator
    light: Light | None = None
    drift: float = 0.0
    before: float | None = None

    def __post_init__(self):
        if isinstance(self.senses, DorsalRim) and self.light is None:
            raise SettingError(
                "the compass of these senses is in the sky, and this world has one colour above: give --light, such as --light sun"
            )

    def read(
        self,
        headings: Float[np.ndarray, " k"],
        distances: Float[np.ndarray, " k"],
        tilt: tuple[float, float] | None = None,
    ) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
        """Headings (rad) and distances (m) of the parts of a way, as they are measured one after the other.

        tilt: Pitch and roll of the head (rad); None where it is level.
        """
        senses, seconds = self.senses, distances / self.senses.speed
        headings, distances = np.array(headings, dtype=float), np.array(distances, dtype=float)
        if isinstance(senses, DorsalRim) and self.light is not None:
            true, headings = headings.tolist(), np.empty(len(headings))
            for k, heading in enumerate(true):
                self.before = senses.heading(self.light, heading, tilt or (0.0, 0.0), self.random, self.before)
                headings[k] = self.before
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


def measured_places(
    poses: Float[np.ndarray, "n 3"], goal: Float[np.ndarray, "2"], readings: Readings
) -> Float[np.ndarray, "n 3"]:
    """Where an agent that walks from its goal through poses, straight from each to the next, believes that they are.

    It sums up the way by its compass and its odometer, which it reads every READING seconds.

    Args:
        poses: (n, 3) In the order of the walk (m, m, rad).
        goal: (2,) Where the walk begins (m).
        readings: The agent's compass and odometer.

    Returns:
        (n, 3) Of each pose: east and north of the goal (m), and the heading (rad).
    """
    legs = np.diff(np.vstack([goal, poses[:, :2]]), axis=0)
    lengths, directions = np.hypot(*legs.T), np.arctan2(legs[:, 1], legs[:, 0])
    parts = np.maximum(1, np.ceil(lengths / (READING * readings.senses.speed)).astype(int))
    last = parts.cumsum() - 1  # part of each leg
    heading, distance = readings.read(directions.repeat(parts), (lengths / parts).repeat(parts))
    way = np.cumsum(distance[:, None] * np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    return np.column_stack([way[last], wrap_angle(poses[:, 2] + heading[last] - directions)])
