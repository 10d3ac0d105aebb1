"""The minimum of an image difference function: how deep it is, and how wide.

- minimum: the least difference.
- depth: the greatest difference minus the least.
- width: the width of the valley around the minimum at half its depth, interpolated between neighbours. None where the curve does not
  rise so far on both sides.

Differences that are not compared are inf (see `differences`); they are left out of the curve.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, kw_only=True)
class Valley:
    """The minimum of an image difference function.

    Attributes:
        minimum: The least difference.
        depth: The greatest difference minus the least.
        width: At half the depth (rad of a rotation, m of a displacement); None where it does not rise so far.
    """

    minimum: float
    depth: float
    width: float | None


def greatest(curve: Float[np.ndarray, " n"]) -> float:
    """The greatest difference of those that are compared."""
    return float(curve[np.isfinite(curve)].max())


def valley_of_rotations(curve: Float[np.ndarray, " w"]) -> Valley:
    """The minimum of a rotational image difference function; its width in rad."""
    width = len(curve)
    around = np.roll(curve, width // 2 - int(curve.argmin()))  # the minimum in the middle
    return valley(np.arange(width) * 2 * np.pi / width, around)


def valley(x: Float[np.ndarray, " n"], curve: Float[np.ndarray, " n"]) -> Valley:
    """The minimum of a curve over ascending positions; it is inf where nothing is compared."""
    least, most = int(curve.argmin()), greatest(curve)
    minimum = float(curve[least])
    half = (minimum + most) / 2
    left = _crossing(x[: least + 1][::-1], curve[: least + 1][::-1], half)
    right = _crossing(x[least:], curve[least:], half)
    width = None if left is None or right is None else right - left
    return Valley(minimum=minimum, depth=most - minimum, width=width)


def _crossing(x: Float[np.ndarray, " n"], curve: Float[np.ndarray, " n"], level: float) -> float | None:
    """Where a curve first rises to a level, from its first value on; None where it stays below, or is not known up to there."""
    above = np.flatnonzero(curve >= level)
    if len(above) == 0 or above[0] == 0 or np.isinf(curve[above[0]]):
        return None
    k = int(above[0])
    return float(x[k - 1] + (level - curve[k - 1]) / (curve[k] - curve[k - 1]) * (x[k] - x[k - 1]))
