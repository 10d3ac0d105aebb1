"""Oscillator: an agent that swings to the left and to the right, the farther the less it knows the view."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from typing import ClassVar

import attrs
import numpy as np

from tussock.world.settings import choice, number, settings

from ..models.base import FamiliarityModel
from .memories import Memory
from .navigator import SIDES, Images, Look, Motion


@dataclass
class Phase:
    """Of an agent's oscillator (rad): it turns to the left while the sine is positive."""

    angle: float


@settings
class Oscillator:
    """Turns to both sides by an oscillator of its own, whose amplitude an unfamiliar view raises.

        turn = (base + gain unfamiliarity) sin(phase), the unfamiliarity from 0 to 1, at most max_turn

    This is klinokinesis: the view sets how much an agent turns, and not to which side. What steers is that each turn is set by the view
    before it: from a heading off the way the turn back is larger than the turn that led there. The shorter the period, the more of this
    remains (Kodzhabashev and Mangan 2015).

    Attributes:
        model: The memory is a copy of it.
        base: Amplitude in front of a familiar view (rad).
        gain: Additional amplitude by an unfamiliarity of 1 (rad).
        period: Looks of one oscillation. It and the gain were chosen in worlds of the preset tiny, seeds 100 to 109.
        max_turn: The largest turn (rad).
        first: To which side an agent turns first.
    """

    takes_trained: ClassVar[bool] = False
    reads_senses: ClassVar[bool] = False

    model: FamiliarityModel = attrs.field()
    base: float = number(radians(20.0), low=0, high=np.pi, unit="rad")
    gain: float = number(radians(90.0), low=0, unit="rad")
    period: float = number(6.0, low=2, unit="looks")
    max_turn: float = number(np.pi, above=0, high=np.pi, unit="rad")
    first: str = choice("left", tuple(SIDES))
    memory: Memory = attrs.field(init=False)

    @property
    def models(self) -> tuple[FamiliarityModel]:
        """What the memory has learned."""
        return (self.memory.model,)

    def learn(self, views: Images) -> None:
        """Learn views (n, h, w)."""
        object.__setattr__(self, "memory", Memory.of(self.model, views))

    def begin(self) -> Phase:
        """Half a look after a turn to the other side has ended, so that a period of two looks turns fully to both sides."""
        return Phase(SIDES[self.first] * np.pi / self.period)

    def decide(self, look: Look, memories: Sequence[Phase]) -> Motion:
        """Turn each agent as its oscillator and the view say."""
        unfamiliarity = self.memory.unfamiliarity(look.views)
        phase = np.array([memory.angle for memory in memories])
        amplitude = self.base + self.gain * unfamiliarity.clip(0, 1)
        for memory in memories:
            memory.angle = self._after(memory.angle)
        turn = (amplitude * np.sin(phase)).clip(-self.max_turn, self.max_turn)
        certainty = (1 - unfamiliarity).clip(0, 1)
        return Motion(turn=turn, certainty=certainty, signals={"unfamiliarity": unfamiliarity, "phase": phase})

    def _after(self, phase: float) -> float:
        """The phase one look later, in one turn (rad)."""
        step = 2 * np.pi / self.period
        return float(np.mod(phase + np.copysign(step, SIDES[self.first]) + np.pi, 2 * np.pi) - np.pi)
