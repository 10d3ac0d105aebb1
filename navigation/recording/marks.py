"""Marks in the world where something happens to an agent, and the events of a step as text."""

import math
from collections.abc import Iterator

import numpy as np
import rerun as rr
from jaxtyping import Float

from tussock.world.geometry import Pose, Route

from ..failures import Cause, Diagnosis
from ..walker import Step
from .blueprint import CARRIED, TOUCHED, cause_entity
from .signals import Send

MARKS_ABOVE = 0.04  # m; marks are drawn this high above the ground, and above all lines
SCALE_COLOUR, SCALE_BELOW = (255, 255, 255), 0.1  # of the line of a metre, and how far south of the route it is (m)
LABEL_SPACING = 0.6  # m; marks nearer than this to one with a name have none


def mark_place(step: Step, above: float = MARKS_ABOVE) -> tuple[float, float, float]:
    """Where a mark of a step is drawn."""
    return *step.pose[:2], step.height + above


class Marks:
    """Marks of the steps of a recording, whose `send` it is given."""

    def __init__(self, send: Send):
        self._send = send
        self._labelled: list[Pose] = []  # where a cause is written at its mark

    def write(self, steps: list[tuple[Step, Diagnosis | None]]) -> None:
        """Mark where some steps are poor or failed, where obstacles stopped or turned them, and where the agent was carried."""
        self._causes([(step, diagnosis) for step, diagnosis in steps if diagnosis is not None])
        for at, marked in (
            (TOUCHED, [step for step, _ in steps if step.touched]),
            (CARRIED, [step for step, _ in steps if step.displaced]),
        ):
            self._send(at, marked, rr.Points3D.columns(positions=[mark_place(step) for step in marked]))

    def _causes(self, poor: list[tuple[Step, Diagnosis]]) -> None:
        """A mark where a step is poor or failed, in the colour of its cause; the first of several close marks has its name."""
        marks: dict[Cause, list[tuple[Step, str]]] = {}
        for step, diagnosis in poor:
            close = any(math.dist(step.pose[:2], where[:2]) < LABEL_SPACING for where in self._labelled)
            marks.setdefault(diagnosis.cause, []).append((step, "" if close else diagnosis.cause.value))
            if not close:
                self._labelled.append(step.pose)
        for cause, marked in marks.items():
            steps, labels = [step for step, _ in marked], [label for _, label in marked]
            positions = [mark_place(step) for step in steps]
            shown = [label != "" for label in labels]
            columns = rr.Points3D.columns(positions=positions, labels=labels, show_labels=shown)
            self._send(cause_entity(cause), steps, columns)


def events_of(step: Step, diagnosis: Diagnosis | None, *, touching: bool) -> Iterator[str]:
    """What happened at a step, where anything did. touching: Whether an obstacle stopped or turned the step before it, too."""
    if step.reset:
        yield f"{step.reset}: put back on the route"
    if step.displaced:
        yield "carried to the side of the route"
    if step.touched and not touching:
        yield "an obstacle stops or turns it"
    if ended := step.reason or step.failure:
        yield ended
    if diagnosis is not None:
        yield str(diagnosis)


def ends_of_scale(route: Route) -> Float[np.ndarray, "2 2"]:
    """The ends of a line of a metre at the south-eastern corner of a route (m)."""
    east, south = route.xy[:, 0].max(), route.xy[:, 1].min() - SCALE_BELOW
    return np.array([[east - 1.0, south], [east, south]])


def scale(ends: Float[np.ndarray, "2 3"]) -> rr.LineStrips3D:
    """A line between places, labelled as a metre."""
    return rr.LineStrips3D([ends], colors=SCALE_COLOUR, radii=0.008, labels="1 m", show_labels=True)
