"""Which views of a route are learned."""

import math

from tussock.world.errors import SettingError
from tussock.world.settings import number, settings, switch, whole

# Between the route views of a database and of the thesis study (m): docs/report.md derives it from the thesis.
ROUTE_SPACING = 0.02


@settings
class TrainingSetup:
    """Which views of a route are learned; see `tussock.navigation.training.training_poses`.

    Attributes:
        spacing: Distance between route views (m).
        every: Learn every N-th of these.
        learning_walk: Reach of the learning walk to both sides of the route (m); 0 is training on the route only, as in the thesis.
        parallel_views: Number of views at each position of the route, spread evenly over the reach of the learning walk from one side to
            the other, all facing along the route. 0: the views of a learning walk, which face the route ahead.
        goal_walk: Reach of a learning walk about the route's end (m): a spiral, from 0.1 m on, that faces the end, as about a nest. It
            is learned before the route. 0: none.
        goal_turns: Number of turns of the spiral.
        goal_views: Number of its views.
        goal_spread: They face up to this much to either side of the end, at random (rad), the same for every seed.
        goal_only: Learn only its views, and none along the route.
    """

    spacing: float = number(0.04, above=0, unit="m")
    every: int = whole(1)
    learning_walk: float = number(0.2, low=0, unit="m")
    parallel_views: int = whole(0, low=0, high=999)
    goal_walk: float = number(0.0, low=0, unit="m")
    goal_turns: float = number(2.0, above=0)
    goal_views: int = whole(25, high=9999)
    goal_spread: float = number(0.0, low=0, high=math.pi, unit="rad")
    goal_only: bool = switch(False)

    def __attrs_post_init__(self) -> None:
        if self.goal_only and not self.goal_walk:
            raise SettingError("without views along the route there must be some about its end; give --goal-walk-m")

    @property
    def is_of_worlds(self) -> bool:
        """Whether it asks for views that image databases, which have their own, cannot give."""
        return self.spacing != type(self)().spacing or self.parallel_views > 0 or self.goal_walk > 0
