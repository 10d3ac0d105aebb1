"""A scan of headings that are a step apart."""

import math

import numpy as np
from jaxtyping import Bool

from tussock.world.geometry import columns_of_turn, wrap_angle
from tussock.world.settings import number, settings, switch

from .navigator import Look
from .scan import Scan


@settings
class SteppedScan(Scan):
    """Compares only headings that are multiples of a step away from the middle of the window, and turns to the most familiar of these.

    Attributes:
        step: Angle between headings (rad); they are rounded to whole columns of the view.
    """

    refine: bool = switch(False)
    step: float = number(math.radians(10.0), above=0, high=2 * math.pi, unit="rad")

    def _windows(self, width: int, look: Look) -> Bool[np.ndarray, "n w"]:
        middle = np.zeros(len(look)) if self.about is None else wrap_angle(self.about - look.compass)
        steps = math.floor(self.width / 2 / self.step + 1e-9)
        turns = middle[:, None] + self.step * np.arange(-steps, steps + 1)
        columns = np.rint(columns_of_turn(turns, width)).astype(int) % width
        windows = np.zeros((len(look), width), dtype=bool)
        np.put_along_axis(windows, columns, True, axis=1)
        return windows
