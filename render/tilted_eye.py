"""An eye that pitches and rolls with the body that carries it, or has noise on its pitch and roll.

Views at planar poses then are those of the full poses that the body gives the eye. The noise at a pose is drawn from a seed and the
pose, so it is the same however many views are drawn together, and whenever they are drawn again; views that are learned have noise of
their own, as the body comes to the same place another time.
"""

from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float

from tussock.world.errors import SettingError
from tussock.world.full_pose import slopes_under
from tussock.world.geometry import rounded

from .changed_views import at_step
from .poses import AnyPoses, Views, as_poses, poses_of_eye
from .posture import Posture
from .renderer import Renderer


class TiltedEye:
    """A renderer whose eye pitches and rolls, a `Renderer`.

    Args:
        renderer: Draws its views.
        posture: How the body holds the eye.
        seed: Of the noise.
        learns: Whether its views are to be learned: these have a noise of their own.

    Attributes:
        training: The same for the views that are learned.
    """

    def __init__(self, renderer: Renderer, posture: Posture, seed: int = 0, *, learns: bool = False):
        self._renderer, self.posture, self._seed, self._learns = renderer, posture, seed, learns
        self.world, self.eye, self.backend = renderer.world, renderer.eye, renderer.backend
        self.training = self if learns else TiltedEye(renderer, posture, seed, learns=True)

    def __reduce__(self) -> Any:
        return partial(TiltedEye, learns=self._learns), (self._renderer, self.posture, self._seed)

    def full_poses(self, poses: AnyPoses) -> Float[np.ndarray, "n 6"]:
        """The full poses of the eye at planar poses; full ones are as they are."""
        poses = as_poses(poses, full=True)
        full = poses_of_eye(self.world, self.eye, poses)
        if poses.shape[1] == 6:
            return full
        if self.posture.gaze == "body":
            full[:, 4:] = np.column_stack(slopes_under(self.world, poses, self.posture.body_length))
        if self.posture.pitch_noise or self.posture.roll_noise:
            spread = self.posture.pitch_noise, self.posture.roll_noise
            full[:, 4:] += spread * np.array([self._noise(pose) for pose in rounded(poses)]).reshape(-1, 2)
        return full

    def _noise(self, pose: Float[np.ndarray, "3"]) -> Float[np.ndarray, "2"]:
        """Two normal numbers that belong to a pose."""
        bits = (pose + 0.0).view(np.uint64).tolist()  # + 0.0: of -0.0 and 0.0 the same
        return np.random.default_rng([self._seed, int(self._learns), *bits]).standard_normal(2)

    def render(self, poses: AnyPoses) -> Views:
        """See `Renderer.render`."""
        return self._renderer.render(self.full_poses(poses))

    def close(self) -> None:
        """Close the renderer."""
        self._renderer.close()

    def __enter__(self) -> "TiltedEye":
        return self

    def __exit__(self, kind, error, traceback) -> None:
        self.close()


def check_level(renderer: Renderer) -> None:
    """Refuse an eye that pitches or rolls where views are drawn once and then turned as images. Raises SettingError."""
    if isinstance(at_step(renderer, 0), TiltedEye):
        raise SettingError(
            "headings are tested by turning views, and an eye that pitches or rolls would see something else after a turn: leave out "
            "gaze, pitch_noise_deg and roll_noise_deg; walks take them"
        )
