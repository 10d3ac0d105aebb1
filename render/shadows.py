"""What the sun shines on: rays from surfaces towards the sun, against the tree of a world's triangles.

A ray from a point p in the direction s meets the triangle (a, b, c) where p + t s = a + u (b - a) + v (c - a) with u, v >= 0 and
u + v <= 1 (Moeller and Trumbore 1997). Any triangle at t > SKIN hides the sun; the order does not matter, so a ray ends at the first.

On a level plane the rays of a grid of points need no search: the shadow of a triangle is the triangle itself, each corner c moved to
c - (c_z - z) / s_z s, and a point is in the shadow where it is inside.
"""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from jaxtyping import Bool, Float, Int64

from tussock.world.geometry import Bounds
from tussock.world.scene import World

from .compile import compiled
from .cores import core_count
from .culling_kernels import LEAF
from .triangle_tree import tree_of

SKIN = 1e-4  # m; what is nearer to a point is the surface that it is on, or one that it touches
DEPTH = 64  # boxes to visit at most: one for each level of a tree
BLOCK = 65536  # rays that a thread takes at a time


def in_the_sun(
    world: World,
    points: Float[np.ndarray, "n 3"],
    sun: Float[np.ndarray, "3"],
    own: Int64[np.ndarray, " n"] | None = None,
) -> Bool[np.ndarray, " n"]:
    """Whether nothing is between points of a world and the sun. Triangles cast whole shadows, whatever holes their textures have.

    Args:
        world: The world.
        points: Where (m).
        sun: Unit vector towards the sun.
        own: The triangle of `World.surfaces` that each point is on, which does not shade it; -1 or None for none.
    """
    tree = tree_of(world)
    boxes = np.ascontiguousarray(tree.boxes)
    order = np.full(tree.corners.shape[0] * LEAF, -2, dtype=np.int64)  # -2 is beyond the last triangle
    order[: len(tree.order)] = tree.order
    own = np.full(len(points), -1, dtype=np.int64) if own is None else own
    lit = np.empty(len(points), dtype=np.bool_)

    def work(start: int) -> None:
        rays = slice(start, start + BLOCK)
        _cast(boxes, tree.corners, order, np.ascontiguousarray(points[rays], np.float64), own[rays], sun, lit[rays])

    with ThreadPoolExecutor(core_count()) as pool:
        list(pool.map(work, range(0, len(points), BLOCK)))
    return lit


def in_the_sun_on_a_level(
    world: World, part: Bounds, rows: int, columns: int, z: float, sun: Float[np.ndarray, "3"]
) -> Bool[np.ndarray, "rows columns"]:
    """What `in_the_sun` finds at the middles of the cells of a grid on a level plane.

    Args:
        world: The world.
        part: Extent of the grid (m).
        rows: Of the grid, from north to south.
        columns: Of the grid, from west to east.
        z: Height of the plane (m).
        sun: Unit vector towards the sun, which is above the horizon.
    """
    lit = np.ones((rows, columns), dtype=np.bool_)
    size = float(part.size[0] / columns), float(part.size[1] / rows)
    _shade(world.surfaces()[0], sun, z + SKIN * sun[2], (part.x_min, part.y_max), size, lit)
    return lit


@compiled(error_model="numpy")
def _shade(triangles, sun, z, corner, size, lit):
    """Write False into lit where a triangle shades a cell's middle. corner: of the grid, in the north-west; size: of its cells (m)."""
    rows, columns = lit.shape
    slope_x, slope_y = sun[0] / sun[2], sun[1] / sun[2]
    xs, ys = np.empty(4), np.empty(4)  # of the shadow, in cells
    for i in range(len(triangles)):
        count = 0
        for k in range(3):  # the shadow of what is above the plane, which has up to four corners
            ax, ay, az = triangles[i, k, 0], triangles[i, k, 1], triangles[i, k, 2] - z
            m = (k + 1) % 3
            bx, by, bz = triangles[i, m, 0], triangles[i, m, 1], triangles[i, m, 2] - z
            if az > 0.0:
                xs[count], ys[count] = ax - az * slope_x, ay - az * slope_y
                count += 1
            if (az > 0.0) != (bz > 0.0):
                share = az / (az - bz)
                xs[count], ys[count] = ax + share * (bx - ax), ay + share * (by - ay)
                count += 1
        if count < 3:
            continue
        low, high = np.inf, -np.inf
        for k in range(count):
            xs[k], ys[k] = (xs[k] - corner[0]) / size[0] - 0.5, (corner[1] - ys[k]) / size[1] - 0.5
            low, high = min(low, ys[k]), max(high, ys[k])
        for row in range(math.ceil(max(low, 0.0)), math.floor(min(high, rows - 1.0)) + 1):
            left, right = np.inf, -np.inf
            for k in range(count):
                m = (k + 1) % count
                if min(ys[k], ys[m]) > row or max(ys[k], ys[m]) < row:
                    continue
                rise = ys[m] - ys[k]
                share = (row - ys[k]) / rise if rise != 0.0 else 0.0
                at = xs[k] + share * (xs[m] - xs[k])
                end = xs[m] if rise == 0.0 else at
                left, right = min(left, min(at, end)), max(right, max(at, end))
            for column in range(math.ceil(max(left, 0.0)), math.floor(min(right, columns - 1.0)) + 1):
                lit[row, column] = False


@compiled(error_model="numpy")
def _cast(boxes, blocks, order, points, own, sun, lit):
    """Write whether each ray is free into lit. The arguments are those of `in_the_sun`; boxes, blocks and order those of the tree."""
    leaves = len(boxes) // 2
    stack = np.empty(DEPTH, np.int64)
    ix, iy, iz = 1.0 / sun[0], 1.0 / sun[1], 1.0 / sun[2]  # inf where the sun is at right angles to an axis
    for ray in range(len(points)):
        x, y, z = points[ray, 0], points[ray, 1], points[ray, 2]
        lit[ray] = True
        stack[0], size = 1, 1
        while size:
            size -= 1
            box = stack[size]
            if not _meets(boxes[box], x, y, z, ix, iy, iz):
                continue
            if box < leaves:
                stack[size], stack[size + 1] = 2 * box, 2 * box + 1
                size += 2
            elif _leaf_hides(blocks[box - leaves], order, (box - leaves) * LEAF, x, y, z, sun, own[ray]):
                lit[ray] = False
                break


@compiled(inline="always")
def _meets(box, x, y, z, ix, iy, iz):
    """Whether a ray meets a box; the slabs between its sides are widened by SKIN against rounding."""
    if box[0] > box[3]:  # it is empty
        return False
    near, far = 0.0, np.inf
    for axis in range(3):
        at = x if axis == 0 else y if axis == 1 else z
        inverse = ix if axis == 0 else iy if axis == 1 else iz
        low, high = box[axis] - SKIN - at, box[3 + axis] + SKIN - at
        if abs(inverse) == np.inf:
            if low > 0.0 or high < 0.0:
                return False
            continue
        t0, t1 = low * inverse, high * inverse
        near, far = max(near, min(t0, t1)), min(far, max(t0, t1))
    return near <= far


@compiled(error_model="numpy")
def _leaf_hides(corners, order, first, x, y, z, sun, own):
    """Whether a triangle of a leaf hides the sun."""
    sx, sy, sz = sun[0], sun[1], sun[2]
    for i in range(LEAF):
        ax, ay, az = corners[0, 0, i], corners[1, 0, i], corners[2, 0, i]
        ux, uy, uz = corners[0, 1, i] - ax, corners[1, 1, i] - ay, corners[2, 1, i] - az
        vx, vy, vz = corners[0, 2, i] - ax, corners[1, 2, i] - ay, corners[2, 2, i] - az
        px, py, pz = sy * vz - sz * vy, sz * vx - sx * vz, sx * vy - sy * vx
        determinant = ux * px + uy * py + uz * pz
        if abs(determinant) < 1e-15:
            continue
        dx, dy, dz = x - ax, y - ay, z - az
        u = (dx * px + dy * py + dz * pz) / determinant
        qx, qy, qz = dy * uz - dz * uy, dz * ux - dx * uz, dx * uy - dy * ux
        v = (sx * qx + sy * qy + sz * qz) / determinant
        t = (vx * qx + vy * qy + vz * qz) / determinant
        if u >= 0.0 and v >= 0.0 and u + v <= 1.0 and t > SKIN and order[first + i] != own and order[first + i] >= 0:
            return True
    return False
