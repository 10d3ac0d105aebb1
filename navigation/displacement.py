"""An agent that is carried to the side in the middle of its walk."""

from tussock.world.settings import number, settings


@settings
class Displacement:
    """Where an agent is carried to the side of the route, once.

    Attributes:
        at: Share of the route, 0 to 1, after which it is carried.
        left: How far, to the left of the route (m; negative: to the right). 0: it is not carried.
    """

    at: float = number(0.5, low=0, high=1)
    left: float = number(0.0, unit="m")
