"""A walk in numbers: its steps without their views."""

import csv
import io
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from tussock.world.atomic import replacing

from .failures import Cause, Diagnosis, walk_cause
from .stopping import StopReason
from .walker import Step

COLUMNS = (
    "step", "x_m", "y_m", "z_m", "heading_deg", "turn_deg", "familiarity", "deviation_m", "along_m", "error_deg",
    "match", "place", "reset", "reason", "covered", "nearest_view_m", "recognised_view_m", "turning_deg", "cause",
    "view_distance_m", "side", "goal_m", "looks", "touched", "displaced", "pitch_deg", "roll_deg",
)  # fmt: skip
OFF_ROUTE = 0.05  # m; an agent farther from the route is off it
PARALLEL = np.sin(
    np.radians(15.0)
)  # a heading within 15 degrees of the route's leads neither back to it nor away from it
RECOVERED = 0.1  # m; an agent that was carried to the side and comes this near to the route has recovered


@dataclass
class Trajectory:
    """The steps of one agent. `add` each step as it comes.

    Attributes:
        rows: One for each step, in the order of COLUMNS.
        signals: For each step the numbers that its navigator decided by; `to_csv` appends them, by name.
    """

    rows: list[tuple] = field(default_factory=list)
    signals: list[dict[str, float]] = field(default_factory=list)

    def add(self, step: Step, diagnosis: Diagnosis | None = None) -> None:
        """Append a step, and what `Diagnostics` measured there."""
        scanned = None if step.familiarity is None else float(step.familiarity[step.scanned].max())
        heading, turn, error = (float(np.degrees(angle)) for angle in (step.pose.heading, step.turn, step.error))
        row = (step.index, *step.pose[:2], step.height, heading, turn, scanned, step.deviation, step.along, error)
        row += (step.match, step.progress, step.reset, step.reason, *_measured(diagnosis), step.view_distance)
        row += (step.side, step.goal_distance, step.looks, step.touched or None, step.displaced or None)
        row += (None, None) if step.tilt is None else tuple(np.degrees(step.tilt).tolist())
        self.rows.append(tuple(map(_plain, row)))
        self.signals.append({name: float(value) for name, value in step.signals.items() if np.ndim(value) == 0})

    def __len__(self) -> int:
        return len(self.rows)

    def column(self, name: str) -> list:
        """The values of one of COLUMNS; empty texts where nothing is known."""
        place = COLUMNS.index(name)
        return [row[place] for row in self.rows]

    @property
    def xy(self) -> Float[np.ndarray, "n 2"]:
        """Positions (m)."""
        return np.array([row[1:3] for row in self.rows]).reshape(-1, 2)

    def summary(self) -> dict[str, Any]:
        """The walk in a few numbers.

        Returns:
            arrived, reason, steps, mean_deviation_m, max_deviation_m, mean_error_deg (absolute), resets; cause: why it failed (None
            where it arrived without a reset); poor_steps: how many were poor or failed; causes: how many for each cause;
            looks_per_m: headings looked at for each metre walked; touches: steps that obstacles stopped or turned; inward, outward:
            shares of the looks off the route after which the agent headed back to it, or farther away (see `off_route`); goal_m: distance
            from the goal in the end; recovered: whether it came back to the route after it was carried to the side (None where it was
            not); max_view_distance_m: how far the agent was at most from the entry of an image database whose view it saw (None in a
            world).
            A trajectory without steps has the reason None and None in place of means.
        """
        deviation, errors = np.array(self.column("deviation_m")), np.abs(self.column("error_deg"))
        reason = self.column("reason")[-1] or None if self.rows else None
        resets, causes = [value != "" for value in self.column("reset")], self.column("cause")
        failed = [*resets[1:], reason not in (None, StopReason.ARRIVED)]
        counts = Counter(label for label in causes if label)
        walked, views = bool(self.rows), [value for value in self.column("view_distance_m") if value != ""]
        return {
            "arrived": reason == StopReason.ARRIVED,
            "reason": reason,
            "steps": max(0, len(self) - 1),
            "mean_deviation_m": float(deviation.mean()) if walked else None,
            "max_deviation_m": float(deviation.max()) if walked else None,
            "mean_error_deg": float(errors.mean()) if walked else None,
            "resets": sum(resets),
            "cause": walk_cause(self.column("along_m"), causes, failed) if walked else None,
            "poor_steps": counts.total(),
            **self._of_steering(),
            "max_view_distance_m": max(views, default=None),
            "causes": {cause.value: counts[cause] for cause in Cause if counts[cause]},
        }

    def _of_steering(self) -> dict[str, Any]:
        """The part of the summary that says how it steered."""
        if not self.rows:
            return dict.fromkeys(("looks_per_m", "touches", "inward", "outward", "goal_m", "recovered"))
        walked = np.hypot(*np.diff(self.xy, axis=0).T)
        carried, put_back = ([value != "" for value in self.column(name)] for name in ("displaced", "reset"))
        metres = float(
            walked[~np.array([a or b for a, b in zip(carried, put_back, strict=True)][1:], dtype=bool)].sum()
        )
        deviation, error = np.array(self.column("deviation_m")), np.radians(self.column("error_deg"))
        inward, outward = off_route(deviation, np.array(self.column("side")), error)
        back = None
        if any(carried):
            since = carried.index(True)
            until = put_back.index(True, since + 1) if any(put_back[since + 1 :]) else len(self)
            back = deviation[since:until] <= RECOVERED
        return {
            "looks_per_m": sum(self.column("looks")) / metres if metres else None,
            "touches": sum(value != "" for value in self.column("touched")),
            "inward": inward,
            "outward": outward,
            "goal_m": self.column("goal_m")[-1],
            "recovered": None if back is None else bool(back.any()),
        }

    def to_csv(self, columns: Sequence[str] | None = None) -> str:
        """The steps as CSV. columns: Those of COLUMNS that are kept; None: all, and the signals."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        if columns is not None:
            writer.writerow(columns)
            writer.writerows(zip(*map(self.column, columns), strict=True))
            return text.getvalue()
        names = list(dict.fromkeys(name for each in self.signals for name in each))
        writer.writerow([*COLUMNS, *names])
        for row, signals in zip(self.rows, self.signals, strict=True):
            writer.writerow([*row, *(signals.get(name, "") for name in names)])
        return text.getvalue()

    def write(self, path: str | os.PathLike) -> None:
        """Write the steps as CSV."""
        with replacing(path) as partial:
            partial.write_text(self.to_csv(), encoding="utf-8", newline="")


def off_route(
    deviation: Float[np.ndarray, " n"], side: Int[np.ndarray, " n"], error: Float[np.ndarray, " n"]
) -> tuple[float | None, float | None]:
    """Shares of the looks off the route after which an agent headed back to it, and farther away from it; the others are parallel to it.

    Args:
        deviation: (n,) Distance from the route at each look (m); those within OFF_ROUTE do not count.
        side: (n,) 1 where the agent is to the left of the route, -1 to the right.
        error: (n,) Angle from the route's heading to its own after the turn (rad).

    Returns:
        None where it was never off the route.
    """
    off = deviation > OFF_ROUTE
    if not off.any():
        return None, None
    away = (side * np.sin(error))[off]
    return float((away < -PARALLEL).mean()), float((away > PARALLEL).mean())


def _plain(value: Any) -> Any:
    """A value of a row; an empty text where nothing is known."""
    return "" if value is None else value.value if isinstance(value, StrEnum) else value


def _measured(diagnosis: Diagnosis | None) -> tuple:
    """The columns from `covered` to `cause`."""
    if diagnosis is None:
        return (None,) * 5
    turning = float(np.degrees(diagnosis.turning))
    return diagnosis.covered, diagnosis.nearest, diagnosis.recognised, turning, diagnosis.cause
