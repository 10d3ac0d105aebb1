"""How a body holds its eye. Light to import: tilted_eye.py has what it does to views."""

from typing import TYPE_CHECKING

from tussock.world.settings import choice, number, settings

if TYPE_CHECKING:
    from tussock.world.scene import World

GAZES = ("level", "body")


@settings
class Posture:
    """How a body holds its eye.

    Attributes:
        gaze: "level": the head keeps the eye level, however the ground slopes. "body": the eye pitches and rolls with the body, which
            stands on the slope beneath it.
        body_length: Over which the slope counts, ahead and to the side (m).
        pitch_noise: Standard deviation of the normal noise on the pitch at each place (rad), whatever the gaze.
        roll_noise: Likewise on the roll (rad).
    """

    gaze: str = choice("level", GAZES)
    body_length: float = number(0.01, above=0, high=10, unit="m")
    pitch_noise: float = number(0.0, low=0, high=1, unit="rad")
    roll_noise: float = number(0.0, low=0, high=1, unit="rad")

    def tilts(self, world: "World") -> bool:
        """Whether an eye in a world is ever tilted."""
        return self.pitch_noise > 0 or self.roll_noise > 0 or (self.gaze == "body" and world.terrain is not None)
