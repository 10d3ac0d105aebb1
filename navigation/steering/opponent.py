"""Opponent: an attractive and a repulsive memory, and turns to the left and to the right in alternation."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from typing import ClassVar

import attrs
import numpy as np
from jaxtyping import Float

from tussock.world.settings import choice, number, settings

from ..models.base import FamiliarityModel
from .memories import Memory, turned
from .navigator import SIDES, Images, Look, Motion


@dataclass
class Side:
    """To which side an agent turns next: 1 left, -1 right."""

    sign: float


@settings
class Opponent:
    """Turns to the left and to the right in alternation; how far depends on two memories of the view after one look.

        drive = attractive unfamiliarity - repulsive unfamiliarity
        turn = +- clip(baseline + gain drive, 0, 180 degrees)

    The attractive memory has the views as they were learned, the repulsive one the same views turned by half a turn. An agent that faces
    a familiar direction walks straight on, one that faces away from it turns about, and between the two it zigzags. With one memory alone
    the drive is the attractive unfamiliarity, or minus the repulsive one (Le Moel and Wystrach 2020).

    Attributes:
        model: Of which each memory is a copy.
        baseline: Turn where the memories say the same (rad).
        gain: Additional turn by a drive of 1 (rad).
        unit: Difference in the model's familiarity that is an unfamiliarity of 1. None: that between learned views and the same views
            turned by half a turn.
        memories: Which memories there are.
        first: To which side an agent turns first.
    """

    takes_trained: ClassVar[bool] = False
    reads_senses: ClassVar[bool] = False

    model: FamiliarityModel = attrs.field()
    baseline: float = number(radians(90.0), low=0, high=np.pi, unit="rad")
    gain: float = number(radians(250.0), low=0, unit="rad")
    unit: float | None = number(None, above=0, optional=True)
    memories: str = choice("both", ("both", "attractive", "repulsive"))
    first: str = choice("left", tuple(SIDES))
    attractive: Memory | None = attrs.field(init=False, default=None)
    repulsive: Memory | None = attrs.field(init=False, default=None)

    @property
    def models(self) -> list[FamiliarityModel]:
        """What the memories have learned."""
        return [memory.model for memory in (self.attractive, self.repulsive) if memory is not None]

    def learn(self, views: Images) -> None:
        """Learn views (n, h, w), and the same views turned by half a turn."""
        for name, angle in (("attractive", 0.0), ("repulsive", np.pi)):
            if self.memories in ("both", name):
                object.__setattr__(self, name, Memory.of(self.model, turned(views, [angle])))

    def begin(self) -> Side:
        """To which side the agent turns first."""
        return Side(SIDES[self.first])

    def decide(self, look: Look, memories: Sequence[Side]) -> Motion:
        """Turn each agent to its next side."""
        drive, signals = np.zeros(len(look)), {}
        for name, sign in (("attractive", 1.0), ("repulsive", -1.0)):
            memory = getattr(self, name)
            if memory is not None:
                signals[name] = self._unfamiliarity(memory, look.views)
                drive = drive + sign * signals[name]
        amplitude = (self.baseline + self.gain * drive).clip(0, np.pi)
        side = np.array([memory.sign for memory in memories])
        for memory in memories:
            memory.sign = -memory.sign
        certainty = (1 - np.min(list(signals.values()), axis=0)).clip(0, 1)
        return Motion(turn=side * amplitude, certainty=certainty, signals=signals)

    def _unfamiliarity(self, memory: Memory, views: Images) -> Float[np.ndarray, " n"]:
        """Of views at their present heading, in the unit of this navigator."""
        if self.unit is None:
            return memory.unfamiliarity(views)
        return (memory.familiar - memory.familiarity(views)) / self.unit
