"""A walk in numbers: the collected steps without their views."""

import csv
import io
import os
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from tussock.world.atomic import replacing

from .failures import CAUSES, Evidence, cause, walk_cause
from .walk import ARRIVED, Step

COLUMNS = (
    "step", "x_m", "y_m", "heading_deg", "turn_deg", "familiarity", "deviation_m", "along_m", "error_deg",
    "match", "place", "reset", "reason", "covered", "nearest_view_m", "recognised_view_m", "turning_deg", "cause",
)  # fmt: skip


@dataclass
class Trajectory:
    """Where an agent went. `add` each step as it comes."""

    rows: list[tuple] = field(default_factory=list)  # one a step, in the order of COLUMNS

    def add(self, step: Step, evidence: Evidence | None = None) -> None:
        """Append one step, and what a `Witness` has to say of it."""
        self.rows.append((
            step.index, step.pose.x, step.pose.y, float(np.degrees(step.pose.heading)), float(np.degrees(step.turn)),
            float(step.familiarity.max()), step.deviation, step.along, float(np.degrees(step.error)),
            "" if step.match is None else step.match, "" if step.place is None else step.place, step.reset or "", step.reason or "",
            *_cells(evidence),
        ))  # fmt: skip

    def __len__(self) -> int:
        return len(self.rows)

    def column(self, name: str) -> list:
        """The values of one of COLUMNS."""
        return [row[COLUMNS.index(name)] for row in self.rows]

    @property
    def xy(self) -> Float[np.ndarray, "n 2"]:
        """Positions (m)."""
        return np.array([row[1:3] for row in self.rows]).reshape(-1, 2)

    def summary(self) -> dict[str, Any]:
        """What became of the walk: arrived, reason, steps, mean and maximal deviation (m), mean absolute heading error (degrees),
        resets; why it failed (None where it arrived without a reset), how many steps were poor or failed, and how often for each cause.
        """
        deviation, resets = np.array(self.column("deviation_m")), self.column("reset")
        reason, causes = self.column("reason")[-1], self.column("cause")
        failed = [*(reset != "" for reset in resets[1:]), reason not in ("", ARRIVED)]
        counts = Counter(label for label in causes if label)
        return {
            "arrived": reason == ARRIVED,
            "reason": reason,
            "steps": len(self) - 1,
            "mean_deviation_m": float(deviation.mean()),
            "max_deviation_m": float(deviation.max()),
            "mean_error_deg": float(np.abs(self.column("error_deg")).mean()),
            "resets": sum(reset != "" for reset in resets),
            "cause": walk_cause(self.column("along_m"), causes, failed),
            "poor_steps": counts.total(),
            "causes": {label: counts[label] for label in CAUSES if counts[label]},
        }

    def to_csv(self) -> str:
        """The steps as CSV."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(self.rows)
        return text.getvalue()

    def write(self, path: str | os.PathLike) -> None:
        """Write the steps as CSV."""
        with replacing(path) as partial:
            partial.write_text(self.to_csv(), encoding="utf-8", newline="")


def _cells(evidence: Evidence | None) -> tuple:
    """The last of COLUMNS; empty where nothing was poor, or not measured."""
    if evidence is None:
        return ("",) * 5
    measured = (evidence.covered, evidence.nearest, evidence.recognised, float(np.degrees(evidence.turning)))
    return (*("" if value is None else value for value in measured), cause(evidence))
