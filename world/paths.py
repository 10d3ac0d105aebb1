"""Where paths between obstacles lead: the clearance of a world on a grid, and the cheapest paths over its nodes.

The cheapest path between two positions is searched for near them first, and the result is the same as in the whole field.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from .geometry import Bounds
from .obstacles import footprints
from .scene import World

MIN_CLEARANCE = 0.04  # m from every obstacle
PREFERRED_CLEARANCE = 0.12  # m; with less, a path costs more than twice its length

CELL = 0.02  # m, of the grid of clearances
MARGIN = 20  # cells around the field, so that obstacles just outside it count
NODE_SPACING = 3  # cells between the nodes through which paths are planned
NODE_CELL = NODE_SPACING * CELL  # m
# Rows and columns of nodes to each neighbour; as many are in the opposite directions.
TO_NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1))

Window = tuple[int, int, int, int]  # of nodes: rows from, rows to, columns from, columns to
# Numbers of the nodes that edges go from and to, and costs.
Edges = tuple[Int[np.ndarray, " edges"], Int[np.ndarray, " edges"], Float[np.ndarray, " edges"]]


@dataclass(frozen=True, eq=False)
class Paths:
    """The grid through which paths are planned.

    Attributes:
        grid: Clearance of each cell (m), to about a cell; rows run along y.
        corner: x and y of the first cell (m).
    """

    grid: Float[np.ndarray, "rows columns"]
    corner: Float[np.ndarray, "2"]

    @classmethod
    def of(cls, world: World, inside: Bounds) -> "Paths":
        """The paths of a world within bounds (m)."""
        return cls(_clearance_grid(world, inside), np.array(inside[:2]))

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of nodes."""
        rows, columns = self.grid[::NODE_SPACING, ::NODE_SPACING].shape
        return rows, columns

    @cached_property
    def nodes(self) -> Int[np.ndarray, " n"]:
        """Numbers of the nodes, row by row, from which a path leads anywhere."""
        leads = np.zeros(self.shape, dtype=bool)
        for (down, right), narrowest in _between_nodes(self.grid):
            row, column = np.nonzero(narrowest > MIN_CLEARANCE)
            leads[row, column] = leads[row + down, column + right] = True
        return np.flatnonzero(leads)

    @cached_property
    def _xy_of_nodes(self) -> Float[np.ndarray, "n 2"]:
        return self.xy(self.nodes)

    def xy(self, nodes: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n 2"]:
        """Positions of nodes (m)."""
        rows, columns = np.divmod(nodes, self.shape[1])
        return np.column_stack([columns, rows]) * NODE_CELL + self.corner

    def nearest(self, xy: Float[np.ndarray, "2"]) -> int:
        """The node nearest to a position (m)."""
        x, y = (self._xy_of_nodes - xy).T
        squared = x * x + y * y
        nearest = np.flatnonzero(squared <= squared.min() * (1 + 1e-9))
        index = nearest[0] if len(nearest) == 1 else KDTree(self._xy_of_nodes).query(xy)[1]  # it decides between equals
        return int(self.nodes[index])

    def through(self, corners: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "k 2"] | None:
        """The cheapest path over the nodes by way of each corner (m); None if there is none."""
        stops = [self.nearest(corner) for corner in corners]
        path = [stops[:1]]
        for start, stop in pairwise(stops):
            leg = self._cheapest(start, stop)
            if leg is None:
                return None
            path.append(leg)
        return self.xy(np.concatenate(path).astype(np.int64))

    def _cheapest(self, start: int, stop: int) -> list[int] | None:
        """The nodes of the cheapest path after `start`; None if there is none.

        No path of some cost leaves the ellipse of points whose distances to both ends add up to that. So a path that was found
        in a window around the ellipse of its own cost is the cheapest. Between paths of equal cost the search in the whole
        field decides, whose order depends on all nodes.
        """
        whole = (0, self.shape[0], 0, self.shape[1])
        ends = self.xy(np.array([start, stop]))
        bound = 1.5 * float(np.hypot(*(ends[1] - ends[0]))) + 1.0
        for _ in range(2):
            window = self._window(ends, bound)
            cost, path, is_unique = self._search(window, start, stop)
            if window == whole or (cost <= bound and is_unique):
                return path
            if not (np.isfinite(cost) and is_unique):
                break
            bound = cost
        return self._search(whole, start, stop)[1]

    def _window(self, ends: Float[np.ndarray, "2 2"], bound: float) -> Window:
        """The nodes around the ellipse with foci at `ends` whose distances to it add up to `bound` (m)."""
        apart = ends[1] - ends[0]
        half = np.sqrt(np.maximum(bound**2 - (apart[::-1] ** 2), 0)) / 2  # of its extent along x and y
        middle = ends.mean(axis=0) - self.corner
        low = np.floor((middle - half) / NODE_CELL).astype(int) - 1
        high = np.ceil((middle + half) / NODE_CELL).astype(int) + 2
        (left, bottom), (right, top) = np.maximum(low, 0).tolist(), np.minimum(high, self.shape[::-1]).tolist()
        return bottom, top, left, right

    def _search(self, window: Window, start: int, stop: int) -> tuple[float, list[int] | None, bool]:
        """The cheapest path within a window: its cost, its nodes after `start`, and whether no other path costs the same."""
        bottom, top, left, right = window
        part = self.grid[
            bottom * NODE_SPACING : (top - 1) * NODE_SPACING + 1, left * NODE_SPACING : (right - 1) * NODE_SPACING + 1
        ]
        width = right - left
        here, there, costs = _edges(part)
        source, target = ((n // self.shape[1] - bottom) * width + n % self.shape[1] - left for n in (start, stop))
        size = (top - bottom) * width
        graph = csr_array((costs, (here, there)), shape=(size, size))
        cost, before = dijkstra(graph, directed=False, indices=source, return_predecessors=True)
        if not np.isfinite(cost[target]):
            return np.inf, None, True
        backwards = [target]
        while backwards[-1] != source:
            backwards.append(int(before[backwards[-1]]))
        local = np.array(backwards[-2::-1], dtype=np.int64)
        path = (local // width + bottom) * self.shape[1] + local % width + left
        return float(cost[target]), path.tolist(), _is_unique(cost, before, local, (here, there, costs))


def _is_unique(
    cost: Float[np.ndarray, " n"], before: Int[np.ndarray, " n"], path: Int[np.ndarray, " k"], edges: Edges
) -> bool:
    """Whether any search finds this path: each of its nodes is reached at its cost from one node only.

    From several, it is the one that is cheaper itself, which a search visits first.
    """
    here, there, costs = edges
    is_on_path = np.zeros(len(cost), dtype=bool)
    is_on_path[path] = True
    found = 0
    for first, second in ((here, there), (there, here)):
        enters = np.flatnonzero(is_on_path[second])
        first, second, step = first[enters], second[enters], costs[enters]
        found += int(((cost[first] + step == cost[second]) & (cost[first] == cost[before[second]])).sum())
    return found == len(path)


def _between_nodes(
    grid: Float[np.ndarray, "rows columns"],
) -> Iterator[tuple[tuple[int, int], Float[np.ndarray, "nodes_down nodes_right"]]]:
    """To each neighbour, the least clearance between each node and its neighbour; none beyond the grid."""
    rows, columns = grid[::NODE_SPACING, ::NODE_SPACING].shape
    pad = 2 * NODE_SPACING
    padded = np.pad(grid, pad)
    for down, right in TO_NEIGHBOURS:
        starts = [(pad + down * s, pad + right * s) for s in range(NODE_SPACING + 1)]
        between = [
            padded[
                row : row + rows * NODE_SPACING : NODE_SPACING, column : column + columns * NODE_SPACING : NODE_SPACING
            ]
            for row, column in starts
        ]
        yield (down, right), np.minimum.reduce([part[:rows, :columns] for part in between])


def _edges(grid: Float[np.ndarray, "rows columns"]) -> Edges:
    """Each two near nodes of a grid with a path between them, and its cost: its length, more where it is tight."""
    here, there, cost = [], [], []
    for (down, right), narrowest in _between_nodes(grid):
        free = narrowest > MIN_CLEARANCE
        nodes = np.flatnonzero(free)
        here.append(nodes)
        there.append(nodes + down * free.shape[1] + right)
        length = NODE_CELL * np.hypot(down, right)
        cost.append(length * (1 + (PREFERRED_CLEARANCE / narrowest[free]) ** 2))
    return np.concatenate(here), np.concatenate(there), np.concatenate(cost)


def _clearance_grid(world: World, inside: Bounds) -> Float[np.ndarray, "rows columns"]:
    """Clearance (m), to about a cell, on a grid from the lower left corner of `inside`; rows run along y."""
    size = np.ceil(inside.size / CELL).astype(int) + 1 + 2 * MARGIN
    free = np.full((size[1], size[0]), 255, np.uint8)
    cells = (footprints(world) - np.array(inside[:2])) / CELL + MARGIN
    visible = np.logical_and(cells.max(axis=1) > 0, cells.min(axis=1) < size).all(axis=1)
    for shape in np.round(cells[visible] * 16).astype(np.int32):
        cv2.fillConvexPoly(free, shape, 0, shift=4)
    if world.terrain is not None:
        free[_is_off_ground(world, inside, size)] = 0
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * CELL
    return distance[MARGIN:-MARGIN, MARGIN:-MARGIN]


def _is_off_ground(world: World, inside: Bounds, size: Int[np.ndarray, "2"]) -> Bool[np.ndarray, "rows columns"]:
    """Which cells of the grid of clearances have no ground, or ground that is too steep to a neighbour."""
    assert world.terrain is not None
    x, y = (np.arange(-MARGIN, n - MARGIN) * CELL + low for n, low in zip(size, inside[:2], strict=True))
    height = world.terrain.height_on_grid(x, y)
    off = np.isnan(height)
    for axis in (0, 1):
        here, there = off.swapaxes(0, axis)[:-1], off.swapaxes(0, axis)[1:]  # views: they change `off`
        steep = world.terrain.is_too_steep(CELL, np.diff(height, axis=axis)).swapaxes(0, axis)
        here |= steep
        there |= steep
    return off
