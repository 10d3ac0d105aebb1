"""How well home vectors are known with noisy senses, where all steps by compass and odometry are summed up."""

import numpy as np
from jaxtyping import Float

from tussock.world.geometry import wrap_angle

from ..senses import Readings, Senses
from ..steering.navigator import Journey
from ..steering.path_integration import PathIntegration
from .outbound_paths import HomeVectorErrors


def errors_of_senses(
    senses: Senses,
    headings: Float[np.ndarray, "n steps"],
    step: float,
    steps: np.ndarray,
    random: np.random.Generator,
) -> HomeVectorErrors:
    """How far the home vectors of the navigator `path-integration` are from the true ones, after each of some numbers of steps.

    Args:
        senses: How well the agents measure their headings and steps.
        headings: (n, steps) Of n ways out (rad).
        step: Length of every step (m).
        steps: (k,) Numbers of steps, from 1.
        random: What noise is drawn from.

    Returns:
        Errors, in metres.
    """
    distances = np.full(headings.shape[1], step)
    vectors = []
    for way in headings:
        compass, odometry = Readings(senses=senses, random=random).read(way, distances)
        vectors.append([_home(compass[:count], odometry[:count]) for count in steps])
    ends = step * np.stack([np.cos(headings), np.sin(headings)], axis=2).cumsum(axis=1)[:, steps - 1]
    home, known = -ends, np.array(vectors)
    bearing = np.arctan2(known[..., 1], known[..., 0]) - np.arctan2(home[..., 1], home[..., 0])
    return HomeVectorErrors(
        steps=steps,
        angle=wrap_angle(bearing),
        distance=np.linalg.norm(known - home, axis=2),
        end_distance=np.linalg.norm(home, axis=2),
        path_length=np.broadcast_to(step * steps, (len(headings), len(steps))).astype(float),
    )


def _home(compass: Float[np.ndarray, " k"], odometry: Float[np.ndarray, " k"]) -> Float[np.ndarray, "2"]:
    """The home vector of an agent after a way out, as its compass and odometer read it (m)."""
    navigator = PathIntegration()
    memory = navigator.begin()
    navigator.travel(memory, Journey(compass=compass, odometry=odometry))
    return memory.home
