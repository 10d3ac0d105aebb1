"""Polygons as triangles."""

import numpy as np
from jaxtyping import Float, Int


def triangulated(
    points: Float[np.ndarray, "corners 3"], counts: Int[np.ndarray, " polygons"]
) -> tuple[Int[np.ndarray, "n 3"], Int[np.ndarray, " n"]]:
    """Triangles that cover polygons, concave ones as well; they keep the polygons' fronts.

    Args:
        points: The corners of all polygons, one polygon after the other (m).
        counts: How many corners each has. Those of fewer than 3 give no triangles.

    Returns:
        The corners of each triangle, as rows of `points`, and the polygon that it belongs to.
    """
    pieces = np.maximum(counts - 2, 0)
    starts = np.cumsum(counts) - counts
    polygon = np.repeat(np.arange(len(counts)), pieces)
    within = np.arange(len(polygon)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    first = starts[polygon]
    triangles = np.column_stack([first, first + within + 1, first + within + 2])  # fans
    a, b, c = (points[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    whole = np.zeros((len(counts), 3))
    np.add.at(whole, polygon, normals)
    for each in np.unique(polygon[(normals * whole[polygon]).sum(axis=1) < 0]):  # a fan leaves a concave polygon
        rows = np.flatnonzero(polygon == each)
        corners = points[starts[each] : starts[each] + counts[each]]
        triangles[rows] = starts[each] + np.array(_ears(corners, whole[each]))
    return triangles, polygon


def _ears(corners: Float[np.ndarray, "k 3"], normal: Float[np.ndarray, "3"]) -> list[tuple[int, int, int]]:
    """Triangles of one polygon, by cutting off corners that hold no other corner ("ears")."""
    flat = np.delete(corners, np.abs(normal).argmax(), axis=1)  # seen along the axis that it faces most
    x, y = flat.T
    if np.dot(x, np.roll(y, -1)) < np.dot(y, np.roll(x, -1)):  # clockwise as it is seen
        x = -x

    def area(i: int, j: int, k: int) -> float:
        return (x[j] - x[i]) * (y[k] - y[i]) - (x[k] - x[i]) * (y[j] - y[i])

    left, triangles = list(range(len(corners))), []
    while len(left) > 3:
        ears = [(left[at - 1], left[at], left[(at + 1) % len(left)]) for at in range(len(left))]
        ear = next((ear for ear in ears if area(*ear) > 0 and not _holds_any(ear, left, area)), ears[0])
        triangles.append(ear)
        left.remove(ear[1])
    return [*triangles, (left[0], left[1], left[2])]


def _holds_any(ear: tuple[int, int, int], others: list[int], area) -> bool:
    i, j, k = ear
    return any(area(i, j, p) >= 0 and area(j, k, p) >= 0 and area(k, i, p) >= 0 for p in others if p not in ear)
