"""Smooth random functions of position and of direction, with mean 0 and standard deviation 1."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

PlaneFunction = Callable[[Float[np.ndarray, "n 2"]], Float[np.ndarray, " n"]]  # a value at each position (m)


def random_field(scale: float, rng: np.random.Generator) -> PlaneFunction:
    """A smooth random function of position; its hills are about `scale` metres apart."""
    waves, phase = rng.normal(0, 1.6 / scale, (2, 48)), rng.uniform(0, 2 * np.pi, 48)
    return lambda xy: np.cos(xy @ waves + phase).sum(axis=1) / np.sqrt(24)


def random_ring(angles, rng: np.random.Generator) -> Float[np.ndarray, " n"]:
    """A smooth random function of direction, at some angles (rad)."""
    k = np.arange(1, 9)
    size, phase = rng.normal(0, 1, 8) * k**-0.35, rng.uniform(0, 2 * np.pi, 8)
    values = np.cos(angles[:, None] * k + phase) @ size
    return (values - values.mean()) / values.std()
