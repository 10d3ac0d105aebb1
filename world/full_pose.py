"""Full poses: an eye at any height, pitched and rolled, and how a body stands on a slope.

A full pose is x (m), y (m), heading (rad), z (m), pitch (rad) and roll (rad). z is the height of the eye over z = 0, not over the
ground. The eye turns to its heading, then pitches (its front upwards), then rolls (its right side downwards). The heading is that of
geometry.py, of the direction ahead as seen from above.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    from .scene import World


class FullPose(NamedTuple):
    """Position, heading and attitude of an eye. Renderers take `np.asarray([full_pose, ...])`, (n, 6), as they take planar poses.

    Attributes:
        x: Position to the east (m).
        y: Position to the north (m).
        heading: Direction ahead as seen from above (rad, counter-clockwise from +x).
        z: Height over z = 0 (m).
        pitch: Elevation of the direction ahead (rad).
        roll: Turn about the direction ahead (rad); positive where the right side is down.
    """

    x: float
    y: float
    heading: float
    z: float
    pitch: float = 0.0
    roll: float = 0.0


def eye_axes(poses: Float[np.ndarray, "n 6"]) -> Float[np.ndarray, "n 3 3"]:
    """The directions ahead, left and up of the eyes at full poses, as unit vectors in the world: a vector v is `axes @ v` for the eye."""
    _, _, heading, _, pitch, roll = poses.T
    (ch, sh), (cp, sp), (cr, sr) = ((np.cos(angle), np.sin(angle)) for angle in (heading, pitch, roll))
    ahead = np.stack([ch * cp, sh * cp, sp], axis=-1)
    level_left = np.stack([-sh, ch, np.zeros_like(sh)], axis=-1)
    level_up = np.stack([-ch * sp, -sh * sp, cp], axis=-1)
    cr, sr = cr[:, None], sr[:, None]
    return np.stack([ahead, cr * level_left + sr * level_up, cr * level_up - sr * level_left], axis=1)


def slopes_under(
    world: "World", poses: Float[np.ndarray, "n 3"], length: float
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Pitch and roll (rad) of a body that stands on the ground: on a plane, its upward axis is the normal of the plane.

    The slopes are those between its ends ahead and behind, left and right. Only ends count that have ground which is not too
    steep to step on, so none beyond a ledge. With one such end the slope is that from the middle to it; without any it is 0.

    Args:
        world: The world.
        poses: x (m), y (m) and heading (rad).
        length: Of the body, which is taken to be as wide as long (m).
    """
    terrain = world.terrain
    if terrain is None:
        return np.zeros(len(poses)), np.zeros(len(poses))
    here, reach = world.ground_height(poses[:, :2]), length / 2

    def rise(direction: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Rise for each metre in a direction."""
        away = reach * np.column_stack([np.cos(direction), np.sin(direction)])
        rises = np.stack([side * (world.ground_height(poses[:, :2] + side * away) - here) for side in (1, -1)])
        counts = np.isfinite(rises) & ~terrain.is_too_steep(reach, np.nan_to_num(rises))
        return np.where(counts, rises, 0).sum(axis=0) / np.maximum(counts.sum(axis=0), 1) / reach

    pitch = np.arctan(rise(poses[:, 2]))
    return pitch, np.arctan(rise(poses[:, 2] + np.pi / 2) * np.cos(pitch))
