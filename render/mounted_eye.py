"""An eye that is mounted otherwise on its body than while the body learned: higher, or turned."""

import dataclasses

import numpy as np
from jaxtyping import Float

from tussock.world.eye_change import EyeMount
from tussock.world.full_pose import eye_axes

from .poses import AnyPoses, Views, poses_of_eye
from .renderer import Renderer


class MountedEye:
    """A renderer whose poses are those of the body, a `Renderer`.

    Args:
        renderer: Draws its views.
        mount: How the eye is mounted. Its height is over that of `renderer.eye`, which stays what the body believes to have.
    """

    def __init__(self, renderer: Renderer, mount: EyeMount):
        self._renderer, self.mount = renderer, mount
        self.world, self.eye, self.backend = renderer.world, renderer.eye, renderer.backend

    def full_poses(self, poses: AnyPoses) -> Float[np.ndarray, "n 6"]:
        """The full poses of the eye where the body has some poses."""
        return mounted(poses_of_eye(self.world, self.eye, poses), self.mount)

    def render(self, poses: AnyPoses) -> Views:
        """See `Renderer.render`."""
        return self._renderer.render(self.full_poses(poses))

    def close(self) -> None:
        """Close the renderer."""
        self._renderer.close()

    def __enter__(self) -> "MountedEye":
        return self

    def __exit__(self, kind, error, traceback) -> None:
        self.close()


def mounted(poses: Float[np.ndarray, "n 6"], mount: EyeMount) -> Float[np.ndarray, "n 6"]:
    """The full poses of eyes that are mounted otherwise than at some full poses: turned in the frame of the body."""
    poses = poses + np.array([0, 0, 0, mount.raised, 0, 0])
    if mount == dataclasses.replace(EyeMount(), raised=mount.raised):
        return poses
    in_body = eye_axes(np.array([[0, 0, mount.turn, 0, mount.pitch, mount.roll]]))[0]
    ahead, left, up = np.moveaxis(in_body @ eye_axes(poses), 1, 0)
    poses[:, 2] = np.arctan2(ahead[:, 1], ahead[:, 0])
    poses[:, 4] = np.arcsin(np.clip(ahead[:, 2], -1, 1))
    poses[:, 5] = np.arctan2(left[:, 2], up[:, 2])
    return poses
