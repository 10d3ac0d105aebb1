"""The body that carries the eye: how far it steps, and how well it turns."""

from tussock.world.settings import number, settings


@settings
class Body:
    """How an agent moves.

    Attributes:
        step_length: Length of a whole step (m), measured over the x-y plane, also where the ground slopes.
        heading_noise: Standard deviation of the normal noise on every turn (rad).
    """

    step_length: float = number(0.05, low=1e-6, unit="m")
    heading_noise: float = number(0.0, low=0, unit="rad")
