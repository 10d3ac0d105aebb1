"""Arrays that all renderers take and return: poses and views."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.errors import SettingError
from tussock.world.full_pose import FullPose, eye_axes
from tussock.world.geometry import Pose
from tussock.world.scene import World
from tussock.world.settings import MAX_COORDINATE

from .eye import Eye

Poses = Float[np.ndarray, "n 3"] | Sequence[Pose | Sequence[float] | Float[np.ndarray, "3"]]
AnyPoses = Poses | Float[np.ndarray, "n 6"] | Sequence[FullPose | Float[np.ndarray, "6"]]
Views = UInt8[np.ndarray, "n height width 4"]


def as_poses(poses: AnyPoses, *, full: bool = False) -> Float[np.ndarray, "n columns"]:
    """Poses as an array.

    Args:
        poses: Rows of x (m), y (m) and heading (rad).
        full: Whether they may be full poses, whose rows go on with z (m), pitch and roll (rad).

    Returns:
        (n, 3) planar or (n, 6) full poses, as they were given.

    Raises:
        SettingError: A value is not a number, not finite or beyond MAX_COORDINATE, or a row has too many or too few.
    """
    rows = f"rows of x, y, heading{' (or x, y, heading, z, pitch, roll)' * full}"
    try:
        array = np.asarray(poses, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise SettingError(f"poses are not numbers ({error}); give {rows}") from error
    if array.size == 0:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] not in ((3, 6) if full else (3,)):
        raise SettingError(f"poses have the shape {array.shape}; give {rows}")
    valid = (np.abs(array) <= MAX_COORDINATE).all(axis=1)  # False for nan
    if not valid.all():
        row = int(valid.argmin())
        raise SettingError(f"pose {row} is {array[row].tolist()}; give finite numbers up to {MAX_COORDINATE:g}")
    return array


def poses_of_eye(world: World, eye: Eye, poses: AnyPoses) -> Float[np.ndarray, "n 6"]:
    """The full poses of an eye. At a planar pose it is level, at its height above the ground there.

    Raises:
        SettingError: A pose is not valid (see `as_poses`), or a planar one has no ground beneath it.
    """
    poses = as_poses(poses, full=True)
    if poses.shape[1] == 6:
        return poses
    ground = world.ground_height(poses[:, :2])
    if world.terrain is not None and np.isnan(ground).any():
        row = int(np.isnan(ground).argmax())
        raise SettingError(
            f"nothing can stand at pose {row}: {world.terrain.problem(*poses[row, :2].tolist())}; choose another"
        )
    return np.column_stack([poses, ground + eye.z, np.zeros((len(poses), 2))])


def frames_of(poses: Float[np.ndarray, "n 6"]) -> Float[np.ndarray, "n 4 3"]:
    """The frames of eyes at full poses: their positions (m), and the directions ahead, left and up."""
    return np.concatenate([poses[:, None, [0, 1, 3]], eye_axes(poses)], axis=1)
