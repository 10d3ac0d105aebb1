"""The body that carries the eye: how far it steps, how well it turns, and what stops it."""

from tussock.world.settings import choice, number, settings

COLLISIONS = ("pass", "stop", "slide")


@settings
class Body:
    """How an agent moves.

    Attributes:
        step_length: Length of a whole step (m), measured over the x-y plane, also where the ground slopes.
        heading_noise: Standard deviation of the normal noise on every turn (rad).
        collisions: What plants and stones do to a step: it may "pass" through them, "stop" where the body touches one, or "slide" along it.
        radius: Of the body, seen from above (m).
    """

    step_length: float = number(0.05, low=1e-6, unit="m")
    heading_noise: float = number(0.0, low=0, unit="rad")
    collisions: str = choice("pass", COLLISIONS)
    radius: float = number(0.005, low=0, high=1, unit="m")
