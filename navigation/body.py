"""The body that carries the eye: how far it steps, and how well it turns."""

import math

from tussock.world.geometry import Pose, wrap_angle
from tussock.world.settings import number, settings

HEADING_STEP = math.radians(0.01)  # of headings
POSITION_DECIMALS = 9  # of positions in metres


@settings
class Body:
    """How an agent moves.

    Attributes:
        step_length: Length of a whole step (m), measured over the x-y plane, also where the ground slopes.
        heading_noise: Standard deviation of the normal noise on every turn (rad).
    """

    step_length: float = number(0.05, low=1e-6, unit="m")
    heading_noise: float = number(0.0, low=0, unit="rad")


def rounded(pose: Pose) -> Pose:
    """A pose whose heading is a multiple of 0.01 degrees, and whose position is one of a nanometre.

    The last bits of a sine, or of what a scan interpolates, differ from processor to processor; along a walk they would add up.
    """
    heading = float(wrap_angle(round(pose.heading / HEADING_STEP) * HEADING_STEP))
    return Pose(round(pose.x, POSITION_DECIMALS), round(pose.y, POSITION_DECIMALS), heading)
