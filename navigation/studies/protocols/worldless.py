"""What a published experiment is that needs neither a world nor images, as of a circuit in flights."""

from collections.abc import Callable

from tussock.world.progress import Progress
from tussock.world.settings import settings

from ...reports.results import StudyResults
from .protocol import WalklessProtocol


@settings
class WorldlessProtocol(WalklessProtocol):
    """A published experiment without a world, in which nothing is seen.

    Attributes:
        measure: Computes the results from a seed, whether it is a first look, and a function that is called with how much is done.
    """

    measure: Callable[[int, bool, Progress], StudyResults]
