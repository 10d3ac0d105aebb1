"""What a navigator gets to learn: views, and, where it learns places, where the agent believes that it saw them."""

import numpy as np
from jaxtyping import Float

from tussock.world.geometry import Route
from tussock.world.light import Light

from .models.base import Images
from .senses import Readings, Senses, measured_places
from .steering.navigator import LearningPlaces, Navigator

STREAM = 1  # of random numbers, other than that of the walk after it


def learn_views(
    navigator: Navigator,
    views: Images,
    poses: Float[np.ndarray, "n 3"],
    *,
    route: Route,
    senses: Senses,
    seed: int,
    light: Light | None = None,
) -> None:
    """Let a navigator learn the views of a route or of a walk about its end.

    Args:
        navigator: Learns them.
        views: (n, h, w) In their order.
        poses: (n, 3) Where they were taken (m, m, rad).
        route: Whose end is the goal.
        senses: By which the agent measures where they were taken, as it walks from the goal through the poses.
        seed: Of the noise of these.
        light: Of the sky, for a compass that sees it.
    """
    if isinstance(navigator, LearningPlaces):
        readings = Readings(senses, np.random.default_rng((seed, STREAM)), light)
        navigator.learn_at(views, measured_places(poses, np.array(route.goal[:2]), readings))
    else:
        navigator.learn(views)
