"""Changes of the eye: it is mounted higher, or turned. They change no world. Light to import."""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from .settings import choice, number, settings

HEIGHT = 0.01  # m, by which the eye is higher at an amount of 1
ANGLE = math.radians(10.0)  # by which it is turned then


@dataclass(frozen=True)
class EyeMount:
    """How an eye is mounted on the body, against how it was while the body learned.

    Attributes:
        raised: How much higher it is (m).
        turn: How far it is turned to the left about the body's vertical axis (rad).
        pitch: How far its front is turned upwards (rad).
        roll: How far its right side is turned downwards (rad).
    """

    raised: float = 0.0
    turn: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0


@settings
class EyeRaised:
    """The eye is higher above the ground.

    Attributes:
        amount: 1: 1 cm higher.
    """

    name: ClassVar[str] = "eye-raised"
    amount: float = number(low=0, high=1)

    def __call__(self, world: Any, rng: Any, route: Any = None) -> Any:
        """The world, which stays as it is."""
        return world

    def mounted(self, mount: EyeMount) -> EyeMount:
        """How the eye is mounted then."""
        return replace(mount, raised=mount.raised + HEIGHT * self.amount)


@settings
class EyeTurned:
    """The eye is mounted turned.

    Attributes:
        amount: 1: turned by 10 degrees.
        axis: "turn": to the left, about the vertical axis. "pitch": its front upwards. "roll": its right side downwards.
    """

    name: ClassVar[str] = "eye-turned"
    amount: float = number(low=0, high=1)
    axis: str = choice("turn", ("turn", "pitch", "roll"))

    def __call__(self, world: Any, rng: Any, route: Any = None) -> Any:
        """The world, which stays as it is."""
        return world

    def mounted(self, mount: EyeMount) -> EyeMount:
        """How the eye is mounted then."""
        return replace(mount, **{self.axis: getattr(mount, self.axis) + ANGLE * self.amount})
