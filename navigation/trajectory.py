"""A walk in numbers: the collected steps without their views."""

import csv
import io
import os
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from world.files import replacing

from .agent import ARRIVED, Step

COLUMNS = (
    "step", "x_m", "y_m", "heading_deg", "turn_deg", "familiarity", "deviation_m", "along_m", "error_deg",
    "match", "place", "reset", "reason",
)  # fmt: skip


@dataclass
class Trajectory:
    """Where an agent went. `add` each step as it comes."""

    rows: list[tuple] = field(default_factory=list)  # one a step, in the order of COLUMNS

    def add(self, step: Step) -> None:
        """Append one step."""
        self.rows.append((
            step.index, step.pose.x, step.pose.y, float(np.degrees(step.pose.heading)), float(np.degrees(step.turn)),
            float(step.familiarity.max()), step.deviation, step.along, float(np.degrees(step.error)),
            "" if step.match is None else step.match, "" if step.place is None else step.place, step.reset or "", step.reason or "",
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

    def summary(self) -> dict[str, object]:
        """What became of the walk: arrived, reason, steps, mean and maximal deviation (m), resets."""
        deviation = np.array(self.column("deviation_m"))
        reason = self.column("reason")[-1]
        return {
            "arrived": reason == ARRIVED,
            "reason": reason,
            "steps": len(self) - 1,
            "mean_deviation_m": float(deviation.mean()),
            "max_deviation_m": float(deviation.max()),
            "resets": sum(reset != "" for reset in self.column("reset")),
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
