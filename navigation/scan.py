"""Scanning: which rotations of a view are compared, and the turn to the most familiar of them."""

import numpy as np
from jaxtyping import Bool, Float

from tussock.world.errors import SettingError
from tussock.world.geometry import turn_of_columns, wrap_angle


def scan_window(width: int, angle: float, centre: float = 0.0) -> Bool[np.ndarray, " width"]:
    """Which rotations of a view a scan compares.

    Args:
        width: Columns of the view, which is the number of rotations.
        angle: Full width of the scan (rad), over 0 and up to a whole turn.
        centre: Direction of its middle (rad to the left of the present heading).
    """
    if not 0 < angle <= 2 * np.pi + 1e-9:
        raise SettingError(f"a scan of {np.degrees(angle):g} degrees; give over 0 and up to 360")
    away = np.abs(wrap_angle(turn_of_columns(np.arange(width), width) - centre))
    window = away <= angle / 2 + 1e-9
    window[away.argmin()] = True  # a window narrower than a column still has one rotation
    return window


def coarse_to_fine(
    familiarity: Float[np.ndarray, "n w"], windows: Bool[np.ndarray, "n w"], spacing: int
) -> Bool[np.ndarray, "n w"]:
    """Which rotations are looked at by a scan in two passes: each `spacing` columns within the window, counted from its middle, and then
    all between the neighbours of the most familiar of these.

    Args:
        familiarity: Of each rotation of each view.
        windows: Rotations that may be looked at; each row one stretch of the circle, or all of it.
        spacing: Columns between the rotations of the first pass.
    """
    width = windows.shape[1]
    looked = np.zeros_like(windows)
    for row, window in enumerate(windows):
        allowed = np.flatnonzero(window)
        if len(allowed) < width:  # begin after the gap, so that the stretch is in order
            gap = int(np.flatnonzero(np.diff(allowed, append=allowed[0] + width) > 1)[0])
            allowed = np.roll(allowed, -(gap + 1))
        middle = len(allowed) // 2
        coarse = allowed[middle % spacing :: spacing]
        best = int(coarse[familiarity[row, coarse].argmax()])
        about = (best + np.arange(-spacing + 1, spacing)) % width
        looked[row, coarse] = True
        looked[row, about[window[about]]] = True
    return looked


def best_turn(
    familiarity: Float[np.ndarray, "n w"], window: Bool[np.ndarray, "... w"] | None = None, interpolate: bool = True
) -> Float[np.ndarray, " n"]:
    """The turn (rad, left positive) to the most familiar rotation of each view; the first of equal ones.

    Args:
        familiarity: Of each rotation of each view.
        window: Rotations to choose from (see `scan_window`), the same for all views or one row each; None is all of them.
        interpolate: Take the peak of the parabola through the best rotation and its neighbours, which is finer than a column.
    """
    n, width = familiarity.shape
    if n == 0:
        return np.empty(0)
    within = familiarity if window is None else np.where(window, familiarity, -np.inf)
    best = within.argmax(axis=1)
    columns = best.astype(float)
    if interpolate:
        rows = np.arange(n)
        left, peak, right = (familiarity[rows, (best + step) % width].astype(float) for step in (-1, 0, 1))
        bend = left - 2 * peak + right
        local_peak = (left <= peak) & (right <= peak) & (bend < 0)
        columns += np.where(local_peak, 0.5 * (left - right) / np.where(local_peak, bend, 1.0), 0.0)
    return turn_of_columns(columns, width)
