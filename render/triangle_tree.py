"""The triangles of a world, sorted in space under a tree of boxes, so that a renderer can leave out many of them at once."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int64

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
        """The tree of some triangles, with `leaf` neighbours in each leaf."""
        order = _order(triangles.mean(axis=1, dtype=np.float32), leaf)
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


def _order(points: Float32[np.ndarray, "n 3"], leaf: int) -> Int64[np.ndarray, " n"]:
    """The points in an order in which each `leaf` of them are close together, as are each 2 `leaf`, 4 `leaf` and so on.

    All are cut in two along the longest side of the box around them, then each part likewise. The first part of each cut is full: it has
    `leaf` points, or 2 `leaf`, 4 `leaf` and so on.
    """
    n, order, coordinates = len(points), np.arange(len(points)), points.T.copy()
    size = leaf << max(0, -(-n // leaf) - 1).bit_length()
    while size > leaf:
        size //= 2
        whole = n - n % (2 * size)
        for begin, end, length in ((0, whole, 2 * size), (whole, n, n - whole)):
            if begin < end and length > size:
                parts = coordinates[:, begin:end].reshape(3, -1, length)
                longest = np.ptp(parts, axis=2).argmax(axis=0)
                cut = np.argpartition(parts[longest, np.arange(len(longest))], size, axis=1)
                coordinates[:, begin:end] = np.take_along_axis(parts, cut[None], axis=2).reshape(3, -1)
                order[begin:end] = np.take_along_axis(order[begin:end].reshape(-1, length), cut, axis=1).ravel()
    return order
