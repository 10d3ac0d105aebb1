"""The triangles of a world, sorted in space under a tree of boxes, so that a renderer can leave out many of them at once."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int64, UInt64

from tussock.world.scene import World, once_per_world

from .culling_kernels import LEAF

COARSE = 256  # boxes from which a search begins: to test all of them takes no longer than one


@dataclass(frozen=True, kw_only=True)
class TriangleTree:
    """A binary tree without pointers: box 1 is the box of all, and box k contains boxes 2 k and 2 k + 1.

    The last half of the boxes are the leaves. Box `len(boxes) // 2 + i` contains the triangles i leaf to (i + 1) leaf - 1. A
    triangle takes about 47 bytes. The corners of a leaf are together in memory: to read them costs more than to compute with them.

    Attributes:
        leaf: Triangles in a leaf.
        order: Index of each triangle in the world.
        corners: x, y, z of the three corners of each triangle of each leaf (m); 0 where the last leaf has fewer.
        boxes: Least x, y, z and greatest x, y, z (m); inf and -inf where a box is empty.
    """

    leaf: int
    order: Int64[np.ndarray, " n"]
    corners: Float32[np.ndarray, "leaves 3 3 leaf"]
    boxes: Float32[np.ndarray, "m 6"]

    @classmethod
    def of(cls, triangles: Float32[np.ndarray, "n 3 3"], leaf: int) -> "TriangleTree":
        """The tree of some triangles, with `leaf` neighbours along a Z-curve over the ground in each leaf."""
        order = np.argsort(_z_curve(triangles[:, :, :2].mean(axis=1, dtype=float)), kind="stable")
        starts = np.arange(0, len(order), leaf)
        leaves = 1 << max(0, len(starts) - 1).bit_length()
        boxes = np.tile(np.repeat(np.array([np.inf, -np.inf], dtype=np.float32), 3), (2 * leaves, 1))
        if len(starts):
            boxes[leaves : leaves + len(starts), :3] = np.minimum.reduceat(triangles.min(axis=1)[order], starts)
            boxes[leaves : leaves + len(starts), 3:] = np.maximum.reduceat(triangles.max(axis=1)[order], starts)
        corners = np.zeros((max(1, len(starts)) * leaf, 3, 3), dtype=np.float32)
        corners[: len(order)] = triangles[order]
        corners = np.ascontiguousarray(corners.reshape(-1, leaf, 3, 3).transpose(0, 3, 2, 1))
        while leaves > 1:
            below = boxes[leaves : 2 * leaves].reshape(-1, 2, 6)
            leaves //= 2
            boxes[leaves : 2 * leaves] = np.hstack([below[:, :, :3].min(axis=1), below[:, :, 3:].max(axis=1)])
        return cls(leaf=leaf, order=order, corners=corners, boxes=boxes)

    def within(
        self, low: Float[np.ndarray, "k 3"], high: Float[np.ndarray, "k 3"]
    ) -> tuple[Int64[np.ndarray, " pairs"], Int64[np.ndarray, " pairs"]]:
        """The triangles whose bounding boxes overlap the insides of boxes from `low` to `high` (m).

        Returns:
            Pairs of a box and the index of a triangle in the world, ascending.
        """
        leaves = len(self.boxes) // 2
        coarse = min(leaves, COARSE)
        which, found = np.divmod(np.arange(len(low) * coarse), coarse)
        found += coarse
        while True:
            boxes = self.boxes[found]
            overlap = ((boxes[:, :3] < high[which]) & (boxes[:, 3:] > low[which])).all(axis=1)
            which, found = which[overlap], found[overlap]
            if len(found) == 0 or found[0] >= leaves:
                break
            which, found = np.tile(which, 2), np.concatenate([2 * found, 2 * found + 1])
        places = ((found - leaves)[:, None] * self.leaf + np.arange(self.leaf)).ravel()
        which, places = np.repeat(which, self.leaf)[places < len(self.order)], places[places < len(self.order)]
        corners = self.corners[places // self.leaf, :, :, places % self.leaf]
        close = ((corners.min(axis=2) < high[which]) & (corners.max(axis=2) > low[which])).all(axis=1)
        which, found = which[close], self.order[places[close]]
        ascending = np.lexsort((found, which))
        return which[ascending], found[ascending]


@once_per_world
def tree_of(world: World) -> TriangleTree:
    """The tree of the surfaces of a world."""
    return TriangleTree.of(world.surfaces()[0], LEAF)


def _z_curve(points: Float[np.ndarray, "n 2"]) -> UInt64[np.ndarray, " n"]:
    """Position of points along a Z-curve: 16 bits of x and of y, interleaved."""
    if len(points) == 0:
        return np.empty(0, dtype=np.uint64)
    low = points.min(axis=0)
    cells = ((points - low) * (65535 / max(np.ptp(points, axis=0).max(), 1e-300))).astype(np.uint64)
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        cells = (cells | cells << np.uint64(shift)) & np.uint64(mask)
    return cells[:, 0] | cells[:, 1] << np.uint64(1)
