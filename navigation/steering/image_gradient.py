"""Image gradient: walk on while the view becomes more like the goal's, else turn."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from typing import ClassVar

import attrs
import numpy as np
import torch
from jaxtyping import Float

from tussock.world.geometry import columns_of_turn
from tussock.world.settings import choice, number, settings

from ..models.base import FamiliarityModel
from .memories import Memory
from .navigator import SIDES, Images, Look, Motion
from .places import Places, index_of_goal, needs_places


@dataclass(kw_only=True)
class LastLook:
    """What one agent remembers.

    Attributes:
        difference: Of its last view from the goal's; infinite before the first look.
    """

    difference: float = np.inf


@settings
class ImageGradient:
    """Descends in the difference of its view from the goal's: goes straight on while it falls, and turns when it does not.

    Each view is turned, by the compass, to the direction that the goal's view faces, so that only the place makes a difference; an
    agent that does not see all around turns there to look. Zeil J,
    Hofmann MI, Chahl JS (2003). Catchment areas of panoramic snapshots in outdoor scenes. Journal of the Optical Society of
    America A 20, 450-469: the difference grows smoothly with the distance from the goal, and a robot that always turns by 90 degrees
    to the same side finds the goal.

    Attributes:
        model: Learns the goal's view; the difference is how much less familiar a view is.
        angle: Turn when the difference has not fallen (rad).
        first: To which side.
    """

    takes_trained: ClassVar[bool] = False

    model: FamiliarityModel = attrs.field()
    angle: float = number(radians(90.0), above=0, high=np.pi, unit="rad")
    first: str = choice("left", tuple(SIDES))
    memory: Memory = attrs.field(init=False)
    facing: float = attrs.field(init=False)

    def learn(self, views: Images) -> None:
        """Refuse views without places. Raises SettingError."""
        raise needs_places("image-gradient")

    def learn_at(self, views: Images, places: Places) -> None:
        """Learn the view (n, h, w) that was seen nearest to the goal."""
        at = index_of_goal(places)
        object.__setattr__(self, "memory", Memory.of(self.model, views[at : at + 1]))
        object.__setattr__(self, "facing", float(places[at, 2]))

    def begin(self) -> LastLook:
        """No difference is known yet."""
        return LastLook()

    def decide(self, look: Look, memories: Sequence[LastLook]) -> Motion:
        """Go on with each agent whose difference has fallen, and turn the others."""
        views = turned_each(look.views, self.facing - look.compass)
        difference = self.memory.familiar - self.memory.familiarity(views)
        fallen = difference < [memory.difference for memory in memories]
        for memory, now in zip(memories, difference.tolist(), strict=True):
            memory.difference = now
        turn = np.where(fallen, 0.0, SIDES[self.first] * self.angle)
        looks = None if getattr(self.model, "mask", None) is None else np.full(len(look), 2)  # it turns to look, and on
        return Motion(turn=turn, looks=looks, signals={"difference": difference})


def turned_each(views: Images, angles: Float[np.ndarray, " n"]) -> Images:
    """Views (n, h, w), each as it is seen after turning left by its angle (rad), rounded to whole columns."""
    columns = np.rint(columns_of_turn(angles, views.shape[2])).astype(int).tolist()
    return torch.stack([view.roll(each, dims=1) for view, each in zip(views, columns, strict=True)])
