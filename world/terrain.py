"""The ground of a mesh: which of its triangles an agent can stand on, and how high they are.

A triangle is walkable where it is not steeper than a limit, whichever side it shows. Steep triangles that form a piece up to
STEP_HEIGHT high, such as a pebble or a kerb, are walked over, so they are walkable too. Walkable triangles that share a corner
form a piece. The ground consists of the piece that covers the largest area, and of each piece that covers at least MIN_SHARE of
that. So the top of a post, a leaf or a boulder with steep sides is not ground: an agent stands on what is under it. Pieces that
face down are ceilings or undersides, and count only where no large piece faces up. Where ground lies above ground, an agent
stands on the highest. Where it is known which triangles are the ground, as in a generated world, the others do not count.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int64

from .errors import InputError
from .geometry import place_text

Part = tuple[int, int]  # of the triangles of a mesh: the first, and the one after the last

MAX_SLOPE = np.radians(45.0)
STEP_HEIGHT = 0.008  # m; an insect walks over what is lower
MIN_SHARE = 0.1  # of the area of the largest piece: posts, boulders and bushes are far below it, the parts of a broken scan above it
WELD_DIGITS = 4  # corners that are equal to a tenth of a millimetre are one
MIN_LEVEL = -10  # the finest grid has cells of 2 ** -10 m
BATCH = 20_000  # points that are looked up at once


@dataclass(frozen=True, eq=False)
class Terrain:
    """The ground of a mesh.

    Attributes:
        triangles: (n, 3, 3) All triangles of the mesh (m).
        is_ground: (n,) Which of them are ground.
        max_slope: Slope up to which a triangle is walkable (rad).
        part: The first of the triangles that the ground is made of, be they walkable or not, and the one after the last; None: unknown.
    """

    triangles: Float[np.ndarray, "n 3 3"]
    is_ground: Bool[np.ndarray, " n"]
    max_slope: float
    part: Part | None = None

    @classmethod
    def of(
        cls,
        triangles: Float[np.ndarray, "n 3 3"],
        field_area: float = np.inf,
        max_slope: float = MAX_SLOPE,
        part: Part | None = None,
    ) -> "Terrain":
        """The ground of some triangles.

        Args:
            triangles: (n, 3, 3) Corners (m).
            field_area: Area where agents may be (m2). A piece counts as no larger than this.
            max_slope: Slope up to which a triangle is walkable (rad).
            part: Where the ground is among the triangles; None: it is looked for. See `Terrain`.

        Raises:
            InputError: Where nothing is walkable.
        """
        those = slice(*part) if part else slice(None)
        corners = triangles[those].astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        up = normals[:, 2] / 2  # the area as seen from above, negative where it faces down
        level = (up != 0) & (2 * np.abs(up) >= np.cos(max_slope) * np.linalg.norm(normals, axis=1))
        steep = np.flatnonzero(~level)
        walkable = level.copy()
        walkable[steep] = _heights_of_pieces(corners[steep]) <= STEP_HEIGHT
        is_ground = np.zeros(len(corners), dtype=bool)
        is_ground[walkable] = _is_in_large_piece(corners[walkable], up[walkable], field_area)
        if not (is_ground & (up != 0)).any():
            instead = "lower hills, mounds or ruts" if part else "--ground flat"
            raise InputError(
                f"the world's mesh has no surface to stand on: nothing of it slopes by less than {np.degrees(max_slope):g} degrees; "
                f"give {instead}, or a greater --max-slope-deg"
            )
        of_all = np.zeros(len(triangles), dtype=bool)
        of_all[those] = is_ground
        return cls(triangles, of_all, max_slope, part)

    def __reduce__(self):
        """Without its grids, so that the same terrain always has the same bytes."""
        return Terrain, (self.triangles, self.is_ground, self.max_slope, self.part)

    def height(self, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
        """Height of the highest ground at positions (m); nan where there is none.

        It is interpolated in each triangle in float64. Borders belong to a triangle, and two triangles leave no gap between them.
        """
        xy = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        highest = np.full(len(xy), -np.inf)
        for start in range(0, len(xy), BATCH):
            part = slice(start, start + BATCH)
            for grid in self._grids:
                point, triangle = grid.candidates(xy[part])
                height = _height_in(self._ground[triangle], xy[part][point])
                np.maximum.at(highest[part], point, np.where(np.isnan(height), -np.inf, height))
        return np.where(np.isneginf(highest), np.nan, highest)

    def height_on_grid(
        self, x: Float[np.ndarray, " columns"], y: Float[np.ndarray, " rows"]
    ) -> Float[np.ndarray, "rows columns"]:
        """Heights as of `height` where columns x and rows y cross (m, ascending): each triangle is looked up once."""
        highest = np.full(len(y) * len(x), -np.inf)
        low, high = self._ground[..., :2].min(axis=1), self._ground[..., :2].max(axis=1)
        left, right = np.searchsorted(x, low[:, 0], "left"), np.searchsorted(x, high[:, 0], "right")
        bottom, top = np.searchsorted(y, low[:, 1], "left"), np.searchsorted(y, high[:, 1], "right")
        width = right - left
        count = width * (top - bottom)
        first = count.cumsum() - count  # the points in the boxes of triangles, numbered one after the other
        for start in range(0, int(count.sum()), BATCH):
            number = np.arange(start, min(start + BATCH, int(count.sum())))
            triangle = np.searchsorted(first, number, "right") - 1
            row, column = np.divmod(number - first[triangle], width[triangle])
            row, column = bottom[triangle] + row, left[triangle] + column
            height = _height_in(self._ground[triangle], np.column_stack([x[column], y[row]]))
            np.maximum.at(highest, row * len(x) + column, np.where(np.isnan(height), -np.inf, height))
        return np.where(np.isneginf(highest), np.nan, highest).reshape(len(y), len(x))

    def consists_of(self, index: Int64[np.ndarray, " k"]) -> Bool[np.ndarray, " k"]:
        """Whether triangles, by their index, are ground."""
        return self.is_ground[index]

    def is_too_steep(self, distance, rise):
        """Whether the ground is too steep between points some distance apart (m, over the x-y plane) that rises so much (m).

        Works on arrays. A rise up to STEP_HEIGHT never is.
        """
        return np.abs(rise) > np.maximum(np.tan(self.max_slope) * distance, STEP_HEIGHT)

    def is_steep(self, x: float, y: float) -> bool:
        """Whether the mesh is too steep to be ground at a position (m). Takes long: it looks at every triangle."""
        those = slice(*self.part) if self.part else slice(None)
        triangles = self.triangles[those]
        here = (triangles[..., :2].min(axis=1) <= (x, y)).all(axis=1) & ~self.is_ground[those]
        here &= (triangles[..., :2].max(axis=1) >= (x, y)).all(axis=1)
        corners = triangles[here].astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        steep = np.abs(normals[:, 2]) < np.cos(self.max_slope) * np.linalg.norm(normals, axis=1)
        return bool(np.isfinite(_height_in(corners[steep], np.tile((x, y), (int(steep.sum()), 1)))).any())

    def problem(self, x: float, y: float) -> str:
        """Why nothing can stand at a position (m), for a message."""
        if self.is_steep(x, y):
            return f"the mesh is steeper than {np.degrees(self.max_slope):g} degrees at {place_text(x, y)}"
        return f"the mesh has no ground at {place_text(x, y)}"

    @cached_property
    def _ground(self) -> Float[np.ndarray, "k 3 3"]:
        """The triangles that heights are looked up in: those of the ground that are not upright."""
        ground = self.triangles[self.is_ground].astype(np.float64)
        a, b, c = np.moveaxis(ground[..., :2], 1, 0)
        return ground[_cross(b - a, c - a) != 0]

    @cached_property
    def _grids(self) -> "list[_Grid]":
        """One grid for each size of triangles, in powers of two: a triangle is in up to four cells, however sizes are mixed."""
        low, high = self._ground[..., :2].min(axis=1), self._ground[..., :2].max(axis=1)
        level = np.maximum(np.frexp((high - low).max(axis=1))[1], MIN_LEVEL)  # 2 ** level is more than the size
        members = [(number, np.flatnonzero(level == number)) for number in np.unique(level).tolist()]
        return [_Grid.of(2.0**number, which, low[which], high[which]) for number, which in members]


@dataclass(frozen=True, eq=False)
class _Grid:
    """Triangles that are smaller than a cell, by the cells that they touch.

    Attributes:
        cell: Edge of a cell (m).
        keys: (m,) Numbers of cells, in ascending order; a cell comes once for each of its triangles.
        triangles: (m,) The triangles.
    """

    cell: float
    keys: Int64[np.ndarray, " m"]
    triangles: Int64[np.ndarray, " m"]

    @classmethod
    def of(cls, cell: float, triangles, low: Float[np.ndarray, "k 2"], high: Float[np.ndarray, "k 2"]) -> "_Grid":
        """The grid of triangles that reach from low to high (m)."""
        first, last = (np.floor(edge / cell).astype(np.int64) for edge in (low, high))
        entries = []
        for step in np.array([(0, 0), (0, 1), (1, 0), (1, 1)]):
            here = (first + step <= last).all(axis=1)
            entries.append((_key(first[here] + step), triangles[here]))
        keys, members = (np.concatenate(parts) for parts in zip(*entries, strict=True))
        order = np.argsort(keys, kind="stable")
        return cls(cell, keys[order], members[order])

    def candidates(self, xy: Float[np.ndarray, "n 2"]) -> tuple[Int64[np.ndarray, " k"], Int64[np.ndarray, " k"]]:
        """Pairs of a point (m) and a triangle that may be there: indices of both."""
        keys = _key(np.floor(xy / self.cell).astype(np.int64))
        first, stop = (np.searchsorted(self.keys, keys, side) for side in ("left", "right"))
        count = stop - first
        point = np.repeat(np.arange(len(xy)), count)
        offset = np.arange(len(point)) - np.repeat(count.cumsum() - count, count)
        return point, self.triangles[np.repeat(first, count) + offset]


def _key(cells: Int64[np.ndarray, "n 2"]) -> Int64[np.ndarray, " n"]:
    """One number for the column and row of a cell; both are within 2 ** 34, of which 32 bits tell cells apart that are near."""
    return (cells[:, 0] << 32) + (cells[:, 1] & 0xFFFFFFFF)


def _cross(a: Any, b: Any) -> Any:
    """The z of the cross product of vectors."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _height_in(triangles: Float[np.ndarray, "n 3 3"], xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """Height (m) of each triangle at the point of the same row; nan outside of it.

    The weight of a corner is the area between the point and the opposite edge. Two triangles that share an edge compute the same
    area to the last bit, but for its sign, so a point at the edge is in one of them at least.
    """
    a, b, c = np.moveaxis(triangles[..., :2] - xy[:, None], 1, 0)
    u, v, w = _cross(b, c), _cross(c, a), _cross(a, b)
    total = u + v + w
    inside = (np.minimum(np.minimum(u, v), w) >= 0) | (np.maximum(np.maximum(u, v), w) <= 0)
    inside &= total != 0
    z = triangles[..., 2]
    height = (u * z[:, 0] + v * z[:, 1] + w * z[:, 2]) / np.where(inside, total, 1.0)
    return np.where(inside, height, np.nan)


def pieces(corners: Float[np.ndarray, "n 3 3"]) -> Int64[np.ndarray, " n"]:
    """The number of the piece of each triangle; triangles that share a corner are in one piece."""
    # They take half a second, which a flat world need not wait for.
    import trimesh
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    if len(corners) == 0:
        return np.empty(0, dtype=np.int64)
    number = trimesh.grouping.unique_rows(corners.reshape(-1, 3), digits=WELD_DIGITS)[1].reshape(-1, 3)
    edges = number[:, :2].ravel(), number[:, 1:].ravel()
    n = int(number.max()) + 1
    graph = coo_array((np.ones(len(edges[0]), dtype=np.int8), edges), shape=(n, n))
    return np.unique(connected_components(graph, directed=False)[1][number[:, 0]], return_inverse=True)[1]


def _heights_of_pieces(corners: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, " n"]:
    """Height, from its lowest to its highest corner, of the piece of each triangle (m)."""
    piece = pieces(corners)
    n = int(piece.max(initial=-1)) + 1
    low, high = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(low, piece, corners[..., 2].min(axis=1))
    np.maximum.at(high, piece, corners[..., 2].max(axis=1))
    return (high - low)[piece]


def _is_in_large_piece(
    corners: Float[np.ndarray, "n 3 3"], up: Float[np.ndarray, " n"], field_area: float
) -> Bool[np.ndarray, " n"]:
    """Which walkable triangles are in a piece that is large and faces up; see the top of this module."""
    if len(corners) == 0:
        return np.empty(0, dtype=bool)
    piece = pieces(corners)
    area = np.minimum(np.bincount(piece, np.abs(up)), field_area)
    large = area >= MIN_SHARE * area.max()
    faces_up = large & (np.bincount(piece, up) >= 0)
    return (faces_up if faces_up.any() else large)[piece]
