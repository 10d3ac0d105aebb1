"""Which views of a route are learned."""

from tussock.world.settings import number, settings, whole

# Between the route views of a database and of the thesis study (m): docs/report.md derives it from the thesis.
ROUTE_SPACING = 0.02


@settings
class TrainingSetup:
    """Which views of a route are learned; see `tussock.navigation.training.training_poses`.

    Attributes:
        spacing: Distance between route views (m).
        every: Learn every N-th of these.
        learning_walk: Reach of the learning walk to both sides of the route (m); 0 is training on the route only, as in the thesis.
    """

    spacing: float = number(0.04, above=0, unit="m")
    every: int = whole(1)
    learning_walk: float = number(0.2, low=0, unit="m")
