"""What navigators that home need of the places at which views were learned, as the agent measured them."""

import numpy as np
from jaxtyping import Float

from tussock.world.errors import SettingError

Places = Float[np.ndarray, "n 3"]  # from the goal (m, east and north), and the heading (rad)


def index_of_goal(places: Places) -> int:
    """Which view was seen nearest to the goal; the last of equally near ones, as a route ends there."""
    distance = np.hypot(*places[:, :2].T)
    return int(np.flatnonzero(distance == distance.min())[-1])


def needs_places(navigator: str) -> SettingError:
    """The error of a navigator that is to learn views without their places."""
    return SettingError(
        f"the navigator {navigator!r} learns views with the places at which they were seen, which are not known here; "
        "train it in a world or on an image database, or name another navigator"
    )
