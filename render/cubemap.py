"""A cube of square images around the eye, and how a panorama is put together from its faces. No OpenGL in here.

The cube turns with the eye, so the middle of the face "ahead" is the heading, and one lookup table holds at every pose. Faces are
in the eye's frame: x ahead, y left, z up. Only the faces that the eye sees, and only their rows that it sees, are kept. They are
stacked in one image, the atlas, whose row 0 is the bottom row, as in OpenGL.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.geometry import column_azimuths

from .eye import Eye

# Right, up and forward of each face in the eye's frame. A ray on an edge belongs to the first of its faces.
_AXES = {
    "ahead": ((0, -1, 0), (0, 0, 1), (1, 0, 0)),
    "left": ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    "behind": ((0, 1, 0), (0, 0, 1), (-1, 0, 0)),
    "right": ((-1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "above": ((0, -1, 0), (-1, 0, 0), (0, 0, 1)),
    "below": ((0, -1, 0), (1, 0, 0), (0, 0, -1)),
}


# OpenGL's images have at most 16384 rows, and an atlas has up to five faces. Eyes of over 1900 columns get coarser views.
MAX_FACE_SIZE = 3072


@dataclass(frozen=True)
class Face:
    """One face of the cube: a square image 90 degrees wide, of which a band of rows is kept.

    Attributes:
        name: See _AXES.
        axes: Unit vectors right, up and forward in the eye's frame, one in each row.
        bottom: Lowest row of pixels that is kept.
        rows: Number of rows that are kept.
        offset: Row of the atlas where they begin.
    """

    name: str
    axes: Float[np.ndarray, "3 3"]
    bottom: int
    rows: int
    offset: int


class Cubemap:
    """Which faces an eye needs, and which of their pixels each of its rays meets.

    Args:
        eye: The eye.
        size: Pixels along the edge of a face. A ray takes the pixel that it falls into, so it is off by up to half a pixel.

    Attributes:
        faces: The faces that are needed.
        rows: Height of the atlas (pixels).
    """

    def __init__(self, eye: Eye, size: int):
        self.eye, self.size = eye, size
        rays = _rays(eye)  # (height * rays, width * rays, 3)
        axes = np.array(list(_AXES.values()), dtype=np.float64)  # (6, 3, 3)
        owner = (rays @ axes[:, 2].T).argmax(axis=-1)
        self._pixels = np.empty(owner.shape, dtype=np.intp)
        faces, self.rows = [], 0
        for number in np.unique(owner):
            owned = owner == number
            column, row = np.floor(_places(axes[number], rays[owned], size)).clip(0, size - 1).astype(np.intp)
            bottom, rows = int(row.min()), int(row.max() - row.min() + 1)
            faces.append(Face(list(_AXES)[number], axes[number], bottom, rows, self.rows))
            self._pixels[owned] = (row - bottom + self.rows) * size + column
            self.rows += rows
        self.faces = tuple(faces)
        weights = np.cos(eye.elevations(eye.rays)).reshape(eye.height, 1, eye.rays, 1)
        self._weights = (weights / (weights.sum(axis=2, keepdims=True) * eye.rays)).astype(np.float32)

    def ray_offsets(self) -> Float[np.ndarray, "rows size 2"]:
        """How far to the right and up of the middle of each pixel of the atlas its ray is (pixels); 0 where it has none.

        A ray that shares its pixel with others near a pole may get the offset of one of these.
        """
        offsets = np.zeros((self.rows * self.size, 2), dtype=np.float32)
        rays = _rays(self.eye)
        axes = np.array(list(_AXES.values()), dtype=np.float64)
        owner = (rays @ axes[:, 2].T).argmax(axis=-1)
        for face in self.faces:
            owned = owner == list(_AXES).index(face.name)
            places = _places(face.axes, rays[owned], self.size)
            offsets[self._pixels[owned]] = (places - np.floor(places).clip(0, self.size - 1) - 0.5).T
        return offsets.reshape(self.rows, self.size, 2)

    def unwrap(self, atlas: UInt8[np.ndarray, "rows size 4"]) -> UInt8[np.ndarray, "height width 4"]:
        """The panorama of the faces in an atlas. Each pixel is the average of its rays by solid angle."""
        eye, n = self.eye, self.eye.rays
        colours = np.take(atlas.view(np.uint32).ravel(), self._pixels).view(np.uint8)
        if n == 1:
            return colours.reshape(eye.height, eye.width, 4)
        sums = colours.reshape(eye.height, n, eye.width, n, 4).sum(axis=3, dtype=np.uint16)
        mean = np.matmul(self._weights.transpose(0, 1, 3, 2), sums.reshape(eye.height, 1, n, -1).astype(np.float32))
        return (mean + 0.5).astype(np.uint8).reshape(eye.height, eye.width, 4)


def face_size_for(eye: Eye) -> int:
    """Edge of a face (pixels): five pixels for each ray of the eye, in the middle of a face.

    At 720 x 150 that is 1152, with which under 2 % of the pixels are more than 8 grey levels off the exact ones, in generated worlds
    full of small leaves, too (1.4 %; 1.7 % with 1024, 2.1 % with 768, 2.8 % with 512). Smaller eyes get smaller faces, and a
    larger error: docs/performance.md has a table. The time grows with the area.
    """
    rays_per_radian = eye.rays * max(eye.width / (2 * np.pi), eye.height / (eye.top - eye.bottom))
    face_pixels_per_ray = 5.0  # in the middle of a face, where pixels are largest
    size = 2 * rays_per_radian * face_pixels_per_ray  # 2: a face goes from tan(-45 degrees) to tan(45 degrees)
    return min(16 * int(np.ceil(size / 16)), MAX_FACE_SIZE)


def _places(axes: Float[np.ndarray, "3 3"], rays: Float[np.ndarray, "n 3"], size: int) -> Float[np.ndarray, "2 n"]:
    """Where rays meet a face with these axes: pixels from its left and its lower edge."""
    right, up, forward = axes @ rays.T
    return (1 + np.array([right, up]) / forward) * (size / 2)


def _rays(eye: Eye) -> Float[np.ndarray, "rows columns 3"]:
    """Unit vectors of all rays in the eye's frame."""
    azimuth = column_azimuths(eye.width * eye.rays)
    elevation = eye.elevations(eye.rays)[:, None]
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation) + 0 * azimuth], axis=-1)
