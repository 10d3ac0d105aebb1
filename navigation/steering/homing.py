"""Homing: a scan for what looks familiar, after learning all views as they look towards the goal."""

from typing import ClassVar

import numpy as np

from tussock.world.settings import settings

from .image_gradient import turned_each
from .navigator import Images
from .places import Places, index_of_goal, needs_places
from .scan import Scan


@settings
class Homing(Scan):
    """Turns to the most familiar heading, as `Scan` does; but what it learned are views that face the goal, wherever they were seen.

    Each view is turned to where the goal is by the agent's own path integration, whichever way it faced on the learning walk. So the most
    familiar heading is that of the goal, as with nest-centred memories of ants: Graham P, Philippides A, Baddeley B (2010).
    Animal cognition: multi-modal interactions in ant learning. Current Biology 20, R639-R640.
    """

    takes_trained: ClassVar[bool] = False
    reads_senses: ClassVar[bool] = True  # it learns its places by them

    def learn(self, views: Images) -> None:
        """Refuse views without places. Raises SettingError."""
        raise needs_places("homing")

    def learn_at(self, views: Images, places: Places) -> None:
        """Learn views (n, h, w), each turned to the goal; the one that was seen nearest to the goal is learned as it is."""
        turn = np.arctan2(-places[:, 1], -places[:, 0]) - places[:, 2]
        turn[index_of_goal(places)] = 0.0
        super().learn(turned_each(views, turn))
