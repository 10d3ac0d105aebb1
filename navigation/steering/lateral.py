"""Lateral: two memories, of views that face to the left and to the right of the way; what they say at one look steers."""

from collections.abc import Sequence
from math import radians
from typing import Any, ClassVar

import attrs
import numpy as np

from tussock.world.settings import number, numbers, settings

from ..models.base import FamiliarityModel
from .memories import Memory, turned
from .navigator import Images, Look, Motion


@settings
class Lateral:
    """Turns away from the side whose memory finds the view more familiar, after one look.

        turn = gain (unfamiliarity of the left memory - unfamiliarity of the right one), at most max_turn

    A view that the memory of views to the left of the way finds familiar faces left of the way, and the agent turns right. On the way
    both find the view equally unfamiliar. Wystrach et al. (2020) describe the idea; Steinbeck et al. (2024) and Gattaux et al. (2025)
    steer by it.

    Attributes:
        model: Of which each memory is a copy.
        gain: Turn by a difference in unfamiliarity of 1 (rad).
        bank: Angles to either side of the way at which views are learned (rad).
        max_turn: The largest turn (rad).
        slowing: How much slower the agent walks in unfamiliar places: its step is 1 - slowing x (the lower of both unfamiliarities).
        slowest: The shortest step, as a share of a whole one.
    """

    takes_trained: ClassVar[bool] = False
    reads_senses: ClassVar[bool] = False

    model: FamiliarityModel = attrs.field()
    gain: float = number(8.0, above=0, unit="rad")
    bank: tuple[float, ...] = numbers(
        tuple(map(radians, (15.0, 30.0, 45.0, 60.0, 75.0, 90.0))), low=0.0, high=np.pi, unit="rad"
    )
    max_turn: float = number(1.2, above=0, high=np.pi, unit="rad")
    slowing: float = number(0.0, low=0, high=1)
    slowest: float = number(0.2, above=0, high=1)
    left: Memory = attrs.field(init=False)
    right: Memory = attrs.field(init=False)

    @property
    def models(self) -> tuple[FamiliarityModel, FamiliarityModel]:
        """What both memories have learned."""
        return self.left.model, self.right.model

    def learn(self, views: Images) -> None:
        """Learn views (n, h, w) turned to both sides."""
        for name, side in (("left", 1.0), ("right", -1.0)):
            object.__setattr__(self, name, Memory.of(self.model, turned(views, [side * angle for angle in self.bank])))

    def begin(self) -> None:
        """An agent remembers nothing from look to look."""

    def decide(self, look: Look, memories: Sequence[Any]) -> Motion:
        """Turn each agent away from the side that it faces."""
        left, right = self.left.unfamiliarity(look.views), self.right.unfamiliarity(look.views)
        turn = (self.gain * (left - right)).clip(-self.max_turn, self.max_turn)
        step = (1 - self.slowing * np.minimum(left, right)).clip(self.slowest, 1.0)
        certainty = (1 - np.minimum(left, right)).clip(0, 1)
        return Motion(turn=turn, step=step, certainty=certainty, signals={"left": left, "right": right})
