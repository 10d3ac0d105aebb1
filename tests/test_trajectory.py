"""A walk in numbers, computed by hand; and the page that explains them."""

import re
from math import radians
from pathlib import Path

import numpy as np
import pytest

from tussock.navigation.stopping import StopReason
from tussock.navigation.trajectory import COLUMNS, Trajectory, off_route
from tussock.navigation.walker import Step
from tussock.world.geometry import Pose

PAGE = Path(__file__).parents[1] / "docs" / "trajectory.md"


def step(index: int, x: float, y: float, **changes) -> Step:
    """A look of an agent at (x, y) m, which follows the x axis."""
    values = {
        "height": 0.0, "tilt": None,
        "view": None, "encoded": None, "looks": 1, "familiarity": None, "scanned": None, "aim": 0.0, "turn": 0.0,
        "match": None, "progress": None, "signals": {}, "touched": False, "displaced": False, "view_distance": None,
        "deviation": abs(y), "along": x, "side": 1 if y >= 0 else -1, "goal_distance": 9.0 - x, "error": 0.0, "reason": None,
        "reset": None, "failure": None,
    }  # fmt: skip
    return Step(index=index, pose=Pose(x, y, 0.0), **values | changes)


def walked(*steps: Step) -> Trajectory:
    trajectory = Trajectory()
    for each in steps:
        trajectory.add(each)
    return trajectory


def test_looks_touches_and_recovery_are_counted():
    walk = walked(
        step(0, 0.0, 0.0, looks=180),
        step(1, 1.0, 0.0, looks=20, touched=True),
        step(2, 1.0, 2.0, displaced=True),  # 2 m that it did not walk
        step(3, 2.0, 0.3),
        step(4, 3.0, 0.3, touched=True, reason=StopReason.LOST),
    )
    summary = walk.summary()
    assert summary["looks_per_m"] == pytest.approx(203 / (1.0 + np.hypot(1.0, 1.7) + 1.0))
    assert (summary["touches"], summary["goal_m"], summary["recovered"]) == (2, 6.0, False)
    assert (
        walked(step(0, 0.0, 0.0), step(1, 0.1, 0.4, displaced=True), step(2, 0.5, 0.1)).summary()["recovered"] is True
    )
    assert walked(step(0, 0.0, 0.0)).summary()["recovered"] is None  # it was not carried
    assert walked(step(0, 0.0, 0.0)).summary()["looks_per_m"] is None  # it did not walk
    assert {
        key: Trajectory().summary()[key] for key in ("looks_per_m", "inward", "recovered", "goal_m")
    } == dict.fromkeys(("looks_per_m", "inward", "recovered", "goal_m"))


@pytest.mark.parametrize(
    ("side", "error_deg", "inward", "outward"),
    [
        (1, -20, 1, 0),
        (1, 20, 0, 1),
        (-1, 20, 1, 0),
        (-1, -20, 0, 1),
        (1, 14, 0, 0),
        (1, -14, 0, 0),
        (1, 180, 0, 0),
        (-1, 160, 1, 0),
    ],
)
def test_a_heading_off_the_route_leads_back_to_it_or_away_from_it(side, error_deg, inward, outward):
    error = np.array([radians(error_deg)])
    assert off_route(np.array([0.06]), np.array([side]), error) == (inward, outward)
    assert off_route(np.array([0.04]), np.array([side]), error) == (None, None)
    mirrored = off_route(np.array([0.06]), -np.array([side]), -error)
    assert mirrored == (inward, outward)


def test_signals_are_columns_after_the_others(tmp_path):
    walk = walked(
        step(0, 0.0, 0.0, signals={"left": np.float64(0.5), "tb1": np.zeros(8)}),
        step(1, 0.1, 0.0, signals={"left": 0.25, "right": 1.0}),
    )
    walk.write(tmp_path / "trajectory.csv")
    header, *rows = [line.split(",") for line in (tmp_path / "trajectory.csv").read_text().splitlines()]
    assert header == [*COLUMNS, "left", "right"]
    assert [row[len(COLUMNS) :] for row in rows] == [["0.5", ""], ["0.25", "1.0"]]


def test_the_page_explains_every_column_and_every_number():
    table, summary, *_ = re.split(r"\n## ", PAGE.read_text())[1:]
    for part, names in ((table, COLUMNS), (summary, Trajectory().summary())):
        first_cells = " ".join(line.split("|")[1] for line in part.splitlines() if line.startswith("| `"))
        assert set(re.findall(r"`(\w+)`", first_cells)) >= set(names)
