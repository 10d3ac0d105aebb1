"""The familiarity of headings, as a recording shows it: bars from left to right, those that were not compared, and the chosen one."""

import numpy as np
import rerun as rr
from jaxtyping import Bool, Float32, Int64

from tussock.world.geometry import turn_of_columns

from ..walker import Step
from .columns import bar_chart_columns
from .signals import Log, Send

COMPARED, BEYOND, CHOSEN = "familiarity", "familiarity/not_compared", "familiarity/chosen"  # where they are logged
COLOURS = {COMPARED: (250, 170, 60), BEYOND: (110, 110, 110), CHOSEN: (230, 70, 60)}


class ScanLog:
    """Logs the scans of steps. `send` and `log` are those of a recording."""

    def __init__(self, send: Send, log: Log):
        self._send, self._log = send, log
        self._known: set[str] = set()  # charts whose constants are logged

    def write(self, steps: list[Step]) -> None:
        """Log the scans of some steps.

        A bar stands on zero, so bars are how much more familiar each heading is than the least familiar one.
        """
        scans = [step for step in steps if step.familiarity is not None]
        if not scans:
            return
        familiarity = np.stack([step.familiarity for step in scans if step.familiarity is not None])
        compared = np.stack([step.scanned for step in scans if step.scanned is not None])
        chosen = _chosen([step.aim for step in scans], familiarity.shape[1])
        heights = familiarity - familiarity.min(axis=1, keepdims=True)
        self._chart(COMPARED, scans, np.where(compared, heights, 0))
        if BEYOND in self._known or not compared.all():
            self._chart(BEYOND, scans, np.where(compared, 0, heights))
        self._chart(CHOSEN, scans, np.where(chosen, heights, 0))

    def _chart(self, at: str, steps: list[Step], heights: Float32[np.ndarray, "n w"]) -> None:
        """Log the bars of some steps, and their places and colour the first time."""
        order = _left_to_right(heights.shape[1])
        if at not in self._known:
            self._known.add(at)
            degrees_right = -np.degrees(turn_of_columns(order, len(order)))
            chart = rr.BarChart(heights[0], abscissa=degrees_right, color=COLOURS[at]).as_component_batches()
            constants = [each for each in chart if each.component_descriptor().component != "BarChart:values"]
            self._log(at, constants, static=True)
        self._send(at, steps, bar_chart_columns(heights[:, order]))


def _chosen(aims: list[float], width: int) -> Bool[np.ndarray, "n w"]:
    """The rotation closest to each aim (rad)."""
    agreement = np.cos(turn_of_columns(np.arange(width), width) - np.array(aims)[:, None])
    return np.arange(width) == agreement.argmax(axis=1)[:, None]


def _left_to_right(width: int) -> Int64[np.ndarray, " width"]:
    """Rotations in the order of the headings that they look to, from left to right."""
    return np.argsort(-turn_of_columns(np.arange(width), width))
