"""Jitter of tracked positions: how large it seems to be, and smoothing along the path."""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from .errors import SettingError

MAX_SAMPLES = 10**6  # along a path that is smoothed


def jitter(xy: Float[np.ndarray, "n 2"]) -> float:
    """Standard deviation along each axis of noise that is independent from point to point (m).

    The third difference removes positions, velocities and accelerations; of noise it has 1 + 9 + 9 + 1 = 20 times the variance.
    """
    if len(xy) < 8:
        return 0.0
    return float(np.median(np.abs(np.diff(xy, n=3, axis=0))) / 0.6745 / np.sqrt(20))


def smoothed(xy: Float[np.ndarray, "n 2"], length: float) -> Float[np.ndarray, "n 2"]:
    """Positions averaged along the path with a Gaussian window. The first and last ones stay.

    Distance along the path is measured over chords of `length`, since row by row it grows with the jitter.

    Args:
        xy: Points (m).
        length: Standard deviation of the window (m).

    Raises:
        SettingError: Where the path has no two points so far apart.
    """
    ends = [0]
    for row in range(1, len(xy)):
        if np.hypot(*(xy[row] - xy[ends[-1]])) >= length:
            ends.append(row)
    if len(ends) < 2:
        raise SettingError(f"a route cannot be smoothed over {length:g} m: no two of its points are so far apart")
    rest = np.hypot(*(xy[-1] - xy[ends[-1]]))
    reached = np.r_[0.0, np.cumsum(np.hypot(*np.diff(xy[ends], axis=0).T))]
    if ends[-1] < len(xy) - 1:
        ends, reached = [*ends, len(xy) - 1], np.r_[reached, reached[-1] + max(rest, 1e-9)]
    along = np.interp(np.arange(len(xy)), ends, reached)
    count = int(min(max(len(xy), 10 * along[-1] / length), MAX_SAMPLES)) + 1
    even = np.linspace(0, along[-1], count)
    sigma = length / (along[-1] / (count - 1))
    margin = min(int(4 * sigma) + 1, count - 1)
    result = np.empty_like(xy)
    for axis in (0, 1):
        values = np.interp(even, along, xy[:, axis])
        before, after = 2 * values[0] - values[margin:0:-1], 2 * values[-1] - values[-2 : -margin - 2 : -1]
        filtered = gaussian_filter1d(np.r_[before, values, after], sigma, mode="nearest")[margin : margin + count]
        result[:, axis] = np.interp(along, even, filtered)
    return result
