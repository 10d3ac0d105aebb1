"""Arrays that all renderers take and return: poses and views."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.errors import SettingError
from tussock.world.geometry import Pose
from tussock.world.scene import World
from tussock.world.settings import MAX_COORDINATE

from .eye import Eye

Poses = Float[np.ndarray, "n 3"] | Sequence[Pose | Sequence[float] | Float[np.ndarray, "3"]]
Views = UInt8[np.ndarray, "n height width 4"]


def as_poses(poses: Poses) -> Float[np.ndarray, "n 3"]:
    """Poses as an array.

    Args:
        poses: Rows of x (m), y (m) and heading (rad).

    Raises:
        SettingError: A value is not a number, not finite or beyond MAX_COORDINATE, or there are not three in each row.
    """
    try:
        array = np.asarray(poses, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise SettingError(f"poses are not numbers ({error}); give rows of x, y, heading") from error
    if array.size == 0:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise SettingError(f"poses have the shape {array.shape}; give rows of x, y, heading")
    valid = (np.abs(array) <= MAX_COORDINATE).all(axis=1)  # False for nan
    if not valid.all():
        row = int(valid.argmin())
        raise SettingError(f"pose {row} is {array[row].tolist()}; give finite numbers up to {MAX_COORDINATE:g}")
    return array


def poses_of_eye(world: World, eye: Eye, poses: Poses) -> Float[np.ndarray, "n 4"]:
    """Where an eye is that stands on the ground at some poses: x (m), y (m), heading (rad) and height (m).

    Raises:
        SettingError: A pose is not valid (see `as_poses`), or there is no ground beneath it.
    """
    poses = as_poses(poses)
    ground = world.ground_height(poses[:, :2])
    if world.terrain is not None and np.isnan(ground).any():
        row = int(np.isnan(ground).argmax())
        raise SettingError(
            f"nothing can stand at pose {row}: {world.terrain.problem(*poses[row, :2].tolist())}; choose another"
        )
    return np.column_stack([poses, ground + eye.z])
