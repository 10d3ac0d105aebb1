"""What a navigator steers by, as a recording shows it: numbers as lines, activities as heat maps, ways as arrows in the world."""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float, Float32

from ..walker import Step
from .columns import heat_map_columns

LINES, MAPS = "signals", "activity"  # where they are logged
ARROW_COLOUR = (40, 170, 90)
HISTORY = 60  # steps that a heat map shows
EAST, NORTH = (
    "_x_m",
    "_y_m",
)  # endings of the names of two numbers that are a way; two values in one signal are named ..vector

Send = Callable[[str, list[Step], Iterable[rr.ComponentColumn]], None]
Log = Callable[..., None]


def line_names(signals: Mapping[str, Any]) -> list[str]:
    """Names of the signals that are numbers."""
    return [name for name, value in signals.items() if np.ndim(value) == 0]


def map_names(signals: Mapping[str, Any]) -> list[str]:
    """Names of the signals that are several values, such as the activity of neurons."""
    return [name for name, value in signals.items() if np.ndim(value) > 0 and not _is_way(name, value)]


def ways(signals: Mapping[str, Any]) -> dict[str, Float[np.ndarray, "2"]]:
    """The signals that are ways (m, east and north), by their names: home of home_x_m and home_y_m, or of home_vector."""
    found = {name: np.asarray(value, dtype=float) for name, value in signals.items() if _is_way(name, value)}
    for name in line_names(signals):
        base = name.removesuffix(EAST)
        if base != name and base + NORTH in signals:
            found[base] = np.array([signals[name], signals[base + NORTH]], dtype=float)
    return found


def entity(where: str, name: str) -> str:
    """Where a signal is logged."""
    return f"{where}/{rr.escape_entity_path_part(name)}"


class SignalLog:
    """Logs the signals of steps. `send` and `log` are those of a recording."""

    def __init__(self, send: Send, log: Log):
        self._send, self._log = send, log
        self._known: set[str] = set()  # signals whose constants are logged
        self._history: dict[str, deque[np.ndarray]] = {}

    def write(self, steps: list[Step], places: Mapping[int, tuple[float, float, float]]) -> None:
        """Log the signals of some steps.

        Args:
            steps: The steps.
            places: Where the agent is at each of them, by their indices: the beginning of arrows.
        """
        for name in dict.fromkeys(name for step in steps for name in line_names(step.signals)):
            having = [step for step in steps if name in step.signals]
            at = entity(LINES, name)
            self._once(at, rr.SeriesLines(names=name))
            self._send(at, having, rr.Scalars.columns(scalars=[float(step.signals[name]) for step in having]))
        for name in dict.fromkeys(name for step in steps for name in map_names(step.signals)):
            having = [step for step in steps if name in step.signals]
            maps = np.stack([self._heat_map(name, step.signals[name]) for step in having])
            self._send(entity(MAPS, name), having, heat_map_columns(maps, "value", "step"))
        for name in dict.fromkeys(name for step in steps for name in ways(step.signals)):
            having = [step for step in steps if name in ways(step.signals)]
            vectors = [(*ways(step.signals)[name], 0.0) for step in having]
            at, origins = entity("world", name), [places[step.index] for step in having]
            self._once(at, rr.Arrows3D.from_fields(colors=ARROW_COLOUR, radii=0.01))
            self._send(at, having, rr.Arrows3D.columns(origins=origins, vectors=vectors))

    def _once(self, at: str, constants: Any) -> None:
        """Log what stays the same at an entity, the first time."""
        if at not in self._known:
            self._known.add(at)
            self._log(at, constants, static=True)

    def _heat_map(self, name: str, values: np.ndarray) -> Float32[np.ndarray, "k history"]:
        """Values of the last HISTORY steps, the present one on the right; before the first step they are as at the first."""
        past = self._history.setdefault(name, deque(maxlen=HISTORY))
        past.append(values.astype(np.float32).ravel())
        return np.pad(np.stack(past, axis=1), ((0, 0), (HISTORY - len(past), 0)), mode="edge")


def _is_way(name: str, value: Any) -> bool:
    return name.endswith("vector") and np.shape(value) == (2,)
