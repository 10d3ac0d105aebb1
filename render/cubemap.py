"""A cube of square pictures around the eye, and the unwrapping of its faces into a panorama. No GL in here.

The cube turns with the eye, so the middle of the face called "ahead" is the heading and the lookup tables hold at every
pose. Faces live in the eye's frame: x ahead, y left, z up. Only the faces, and of each only the rows, that the eye sees
are kept; they are stacked in one tall picture, the atlas, whose row 0 is the bottom one, as OpenGL counts.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.geometry import column_azimuths

from .eye import Eye

# A face's right, up and forward in the eye's frame. The order decides who gets a ray on an edge, no more.
_AXES = {
    "ahead": ((0, -1, 0), (0, 0, 1), (1, 0, 0)),
    "left": ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    "behind": ((0, 1, 0), (0, 0, 1), (-1, 0, 0)),
    "right": ((-1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "above": ((0, -1, 0), (-1, 0, 0), (0, 0, 1)),
    "below": ((0, -1, 0), (1, 0, 0), (0, 0, -1)),
}


# OpenGL's pictures end at 16384 pixels, and an atlas may be five faces high. Eyes of over 1900 columns get coarser views.
LARGEST_FACE = 3072


@dataclass(frozen=True)
class Face:
    """One face of the cube: a square picture 90 degrees wide, of which a band of rows is kept.

    axes: (3, 3) unit vectors right, up and forward in the eye's frame, one a row.
    bottom, rows: the lowest pixel row that is kept, and how many of them.
    offset: the row of the atlas where they begin.
    """

    name: str
    axes: Float[np.ndarray, "3 3"]
    bottom: int
    rows: int
    offset: int


class Cubemap:
    """Which faces an eye needs, and which of their pixels each of its rays meets.

    size: pixels along the edge of a face. A ray takes the pixel it falls into, so it looks up to half a pixel aside.
    faces: the needed faces; rows: height of the atlas they stack up to.
    """

    def __init__(self, eye: Eye, size: int):
        self.eye, self.size = eye, size
        rays = _rays(eye)  # (height * rays, width * rays, 3)
        axes = np.array(list(_AXES.values()), dtype=np.float64)  # (6, 3, 3)
        owner = (rays @ axes[:, 2].T).argmax(axis=-1)
        self._pixels = np.empty(owner.shape, dtype=np.intp)
        faces, self.rows = [], 0
        for number in np.unique(owner):
            mine = owner == number
            right, up, forward = axes[number] @ rays[mine].T
            column, row = (
                np.clip(np.floor((1 + side / forward) * (size / 2)), 0, size - 1).astype(np.intp)
                for side in (right, up)
            )
            bottom, rows = int(row.min()), int(row.max() - row.min() + 1)
            faces.append(Face(list(_AXES)[number], axes[number], bottom, rows, self.rows))
            self._pixels[mine] = (row - bottom + self.rows) * size + column
            self.rows += rows
        self.faces = tuple(faces)
        weights = np.cos(eye.elevations(eye.rays)).reshape(eye.height, 1, eye.rays, 1)
        self._weights = (weights / (weights.sum(axis=2, keepdims=True) * eye.rays)).astype(np.float32)

    def unwrap(self, atlas: UInt8[np.ndarray, "rows size 4"]) -> UInt8[np.ndarray, "height width 4"]:
        """The panorama of the faces in `atlas`: each pixel the average of its rays by solid angle."""
        eye, n = self.eye, self.eye.rays
        seen = np.take(atlas.view(np.uint32).ravel(), self._pixels).view(np.uint8)
        if n == 1:
            return seen.reshape(eye.height, eye.width, 4)
        across = seen.reshape(eye.height, n, eye.width, n, 4).sum(axis=3, dtype=np.uint16)
        mean = np.matmul(self._weights.transpose(0, 1, 3, 2), across.reshape(eye.height, 1, n, -1).astype(np.float32))
        return (mean + 0.5).astype(np.uint8).reshape(eye.height, eye.width, 4)


def face_size_for(eye: Eye) -> int:
    """The edge of a face (pixels) that keeps under 2 % of an eye's pixels more than 8 grey levels off the exact ones.

    Measured in generated worlds full of small leaves at 720 x 150: 2.8 % are off with faces of 512, 2.1 % with 768, 1.7 %
    with 1024, 1.3 % with 1280; this gives 1152. In the Sussex world 512 comes to 0.6 %. The time grows with the area.
    """
    rays_per_radian = eye.rays * max(eye.width / (2 * np.pi), eye.height / (eye.top - eye.bottom))
    face_pixels_per_ray = 5.0  # in the middle of a face, where they are largest
    size = 2 * rays_per_radian * face_pixels_per_ray  # 2: a face spans tan(-45)..tan(45 degrees)
    return min(16 * int(np.ceil(size / 16)), LARGEST_FACE)


def _rays(eye: Eye) -> Float[np.ndarray, "rows columns 3"]:
    """Unit vectors in the eye's frame along which each ray of each pixel looks."""
    azimuth = column_azimuths(eye.width * eye.rays)
    elevation = eye.elevations(eye.rays)[:, None]
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation) + 0 * azimuth], axis=-1)
