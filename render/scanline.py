"""The CPU renderer: exact equirectangular scanline rasterisation, no cube map, no GL, no display.

The mathematics, for one eye at the origin. In a column every ray shares one azimuth, so a ray is
`d = (cos az, sin az, t)` with `t = tan(elevation)`; its length does not matter.

- Coverage. An edge (a, b) of a triangle and the eye span a plane with normal `n = a x b`. A ray passes inside the
  triangle where `n . d` has the sign of `D = a . (b x c)` for all three edges. Within a column that is linear in t, so
  each edge bounds t at `-(n_x cos az + n_y sin az) / n_z`, from below or from above by the sign of `n_z D`:
  the triangle covers the rows between the highest lower and the lowest upper bound. Triangles that share an edge compute
  the same bound to the last bit, and both own it, so no ray slips between them.
- Depth. The ray meets the triangle's plane, of normal `N = (b - a) x (c - a)`, at `d D / (N . d)`. So `(N / D) . d` is
  the inverse of the distance, again linear in t: the depth test is one multiply-add a pixel, and the largest wins.

Nothing is projected or interpolated: every pixel is what a ray caster finds.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numba
import numpy as np
from jaxtyping import Float, UInt8

from world.errors import InputError
from world.geometry import column_azimuths
from world.scene import World

from .eye import Eye
from .renderer import Poses, as_poses

# atan(x) / x as a polynomial in x^2 on [0, 1], within 2e-7: enough to find candidate columns, which exact tests follow.
_x = np.cos(np.pi * (np.arange(200) + 0.5) / 400)
_A0, _A1, _A2, _A3, _A4, _A5, _A6, _A7 = (
    float(c) for c in np.polynomial.polynomial.polyfit(_x**2, np.arctan(_x) / _x, 7)
)
_ATAN_ERROR = 1e-6


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _columns_of(x, y, eye_x, eye_y, heading, width, columns):
    """Column (unwrapped, fractional, within 2 _ATAN_ERROR width / 2 pi) in which the eye sees each place (x, y), into `columns`."""
    scale = width / (2 * np.pi)
    for k in range(x.size):  # no branches, so that it is vectorised
        dx, dy = x[k] - eye_x, y[k] - eye_y
        ax, ay = abs(dx), abs(dy)
        q = min(ax, ay) / (max(ax, ay) + 1e-300)
        s = q * q
        angle = q * (_A0 + s * (_A1 + s * (_A2 + s * (_A3 + s * (_A4 + s * (_A5 + s * (_A6 + s * _A7)))))))
        angle = 0.5 * np.pi - angle if ay > ax else angle
        angle = np.pi - angle if dx < 0.0 else angle
        angle = -angle if dy < 0.0 else angle
        columns[k] = (np.pi - (angle - heading)) * scale - 0.5


@numba.njit(cache=True, nogil=True, inline="always")
def _column_range(ca, cb, cc, width):
    """First (0..width-1) and last (may exceed width - 1) column whose centre may look at a triangle with corners in three columns."""
    pad = 1e-6 + 2 * _ATAN_ERROR * width / (2 * np.pi)
    ab, bc, ac = cb - ca, cc - cb, cc - ca
    ab -= width * np.rint(ab / width)
    bc -= width * np.rint(bc / width)
    ac -= width * np.rint(ac / width)
    half = 0.5 * width - pad
    if abs(ab) > half or abs(bc) > half or abs(ac) > half or abs(ab + bc - ac) > 0.5:
        return 0, width - 1  # the eye's vertical passes through the triangle, or as good as
    first = np.ceil(ca + min(0.0, ab, ac) - pad)
    last = np.floor(ca + max(0.0, ab, ac) + pad)
    shift = np.floor(first / width) * width
    return int(first - shift), int(last - shift)


@numba.njit(cache=True, nogil=True, inline="always")
def _bin(t, bins):
    """Place of a tangent among `bins` bins that are nearly even in elevation."""
    return int((1.0 + t / (1.0 + abs(t))) * (0.5 * bins))


def _row_table(tangents: Float[np.ndarray, " height"]) -> np.ndarray:
    """For each `_bin`: how many rows lie above it for certain. A search for a tangent's row starts there."""
    bins = 8 * len(tangents)
    u = (np.arange(1, bins + 1) + 1e-9) / bins * 2 - 1  # upper border of the bin, rounding included
    borders = np.append(u[:-1] / (1 - np.abs(u[:-1])), np.inf)
    return np.searchsorted(-tangents, -borders, side="left").astype(np.int32)


@numba.njit(cache=True, nogil=True, inline="always")
def _rows_between(low, high, tangents, table):
    """First and last row whose tan(elevation) lies in [low, high]; first > last where there is none."""
    count = tangents.size
    if low > tangents[0] or high < tangents[count - 1]:
        return 1, 0
    first = 0
    if high < tangents[0]:
        first = table[_bin(high, table.size)]
        while tangents[first] > high:
            first += 1
    last = count - 1
    if low > tangents[last]:
        last = table[_bin(low, table.size)]
        while tangents[last] >= low:
            last += 1
        last -= 1
    return first, last


@numba.njit(cache=True, nogil=True, inline="always")
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@numba.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _set_edge(k, normal, volume, p, q, side):
    """Edge k's bound on t: p cos + q sin, from below (side 1) or above (-1); side 0: a vertical plane, p cos + q sin >= 0."""
    nx, ny, nz = normal
    if abs(nz) < 1e-200:
        sign = 1.0 if volume > 0.0 else -1.0
        p[k], q[k], side[k] = sign * nx, sign * ny, 0
    else:
        p[k], q[k] = -nx / nz, -ny / nz
        side[k] = 1 if (nz > 0.0) == (volume > 0.0) else -1


@numba.njit(cache=True, nogil=True, inline="always")
def _interval(p, q, side, cos, sin):
    """The tangents that a triangle's three edges leave in a column: low > high where none."""
    low, high = -np.inf, np.inf
    for k in range(3):
        t = p[k] * cos + q[k] * sin
        if side[k] > 0:
            low = max(low, t)
        elif side[k] < 0:
            high = min(high, t)
        elif t < 0.0:
            low = np.inf
    return low, high


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _draw(triangles, columns, cull, eye, cosines, sines, tangents, table, start, stop, nearness, seen):
    """Draw all triangles into columns start..stop-1: the nearest triangle of each pixel into `seen` (-1: none).

    triangles (n, 3, 3), their corners' columns (3, n); eye (3,); cosines, sines (width,) of the columns' azimuths in the world;
    tangents (height,) of the rows' elevations and their `_row_table`; nearness, seen (width, height): inverse distance and triangle.
    """
    width = cosines.size
    nearness[start:stop] = 0.0
    seen[start:stop] = -1
    p, q, side = np.empty(3), np.empty(3), np.empty(3, np.int64)
    for i in range(triangles.shape[0]):
        first, last = _column_range(columns[0, i], columns[1, i], columns[2, i], width)
        if first > last or (first >= stop and last < start + width) or (last < start):
            continue
        a = triangles[i, 0, 0] - eye[0], triangles[i, 0, 1] - eye[1], triangles[i, 0, 2] - eye[2]
        b = triangles[i, 1, 0] - eye[0], triangles[i, 1, 1] - eye[1], triangles[i, 1, 2] - eye[2]
        c = triangles[i, 2, 0] - eye[0], triangles[i, 2, 1] - eye[1], triangles[i, 2, 2] - eye[2]
        opposite = _cross(b, c)
        volume = a[0] * opposite[0] + a[1] * opposite[1] + a[2] * opposite[2]
        if volume == 0.0 or (cull and volume > 0.0):
            continue
        _set_edge(0, _cross(a, b), volume, p, q, side)
        _set_edge(1, opposite, volume, p, q, side)
        _set_edge(2, _cross(c, a), volume, p, q, side)
        # The plane's normal is the sum of the three edges' normals, but precise only when taken from the differences.
        gx, gy, gz = _cross((b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2]))
        gx, gy, gz = gx / volume, gy / volume, gz / volume
        for column in range(first, last + 1):
            j = column if column < width else column - width
            if j < start or j >= stop:
                continue
            low, high = _interval(p, q, side, cosines[j], sines[j])
            if low > high:
                continue
            top, bottom = _rows_between(low, high, tangents, table)
            base = gx * cosines[j] + gy * sines[j]
            for r in range(top, bottom + 1):
                near = base + gz * tangents[r]
                if near > nearness[j, r]:
                    nearness[j, r] = near
                    seen[j, r] = i


@numba.njit(cache=True, nogil=True)
def _average(seen, rgba, rays, weights, start, stop, view):
    """Average the rays of each pixel of columns start..stop-1 into view (height, width, 4), by solid angle.

    seen (width * rays, height * rays); rgba (n + 1, 4) of the triangles, the sky's last; weights (height, rays) sum to 1 / rays
    over a pixel's sub-rows.
    """
    height = view.shape[0]
    for column in range(start, stop):
        for row in range(height):
            if rays == 1:
                for k in range(4):
                    view[row, column, k] = rgba[seen[column, row], k]
                continue
            red = green = blue = cover = 0.0
            for y in range(rays):
                r = g = b = a = 0
                for x in range(rays):
                    colour = rgba[seen[column * rays + x, row * rays + y]]
                    r += colour[0]
                    g += colour[1]
                    b += colour[2]
                    a += colour[3]
                weight = weights[row, y]
                red += weight * r
                green += weight * g
                blue += weight * b
                cover += weight * a
            view[row, column, 0] = np.uint8(red + 0.5)
            view[row, column, 1] = np.uint8(green + 0.5)
            view[row, column, 2] = np.uint8(blue + 0.5)
            view[row, column, 3] = np.uint8(cover + 0.5)


class ScanlineRenderer:
    """Exact panoramas on the CPU (see the module's docstring); a `Renderer`.

    threads: how many to use; None takes every core this process may run on. The result does not depend on it.
    """

    backend = "cpu"

    def __init__(self, world: World, eye: Eye, threads: int | None = None):
        self.world = world
        self.eye = eye
        triangles, rgb = world.surfaces()
        self._triangles = np.ascontiguousarray(triangles, dtype=np.float64)
        self._x, self._y = (np.ascontiguousarray(self._triangles[:, :, axis].T) for axis in (0, 1))  # (3, n)
        covered = np.column_stack([rgb, np.full(len(rgb), 255)])
        # The sky comes last: what nothing covers is seen as index -1.
        self._rgba = np.vstack([covered, [*world.sky_rgb, 0]]).astype(np.uint8)
        rays = eye.rays
        self._azimuths = column_azimuths(eye.width * rays)
        elevations = eye.elevations(rays)
        self._tangents = np.tan(elevations)
        self._row_table = _row_table(self._tangents)
        weights = np.cos(elevations).reshape(eye.height, rays)
        self._weights = weights / weights.sum(axis=1, keepdims=True) / rays
        self._scratch: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []  # not in use at the moment
        self._threads = threads or len(os.sched_getaffinity(0))
        self._pool: ThreadPoolExecutor | None = ThreadPoolExecutor(self._threads)

    def render(self, poses: Poses) -> UInt8[np.ndarray, "n height width 4"]:
        """See `Renderer.render`. Poses are shared out among threads; a single pose is cut into strips of columns."""
        if self._pool is None:
            raise InputError("this renderer is closed; open another one")
        poses = as_poses(poses)
        views = np.empty((len(poses), self.eye.height, self.eye.width, 4), dtype=np.uint8)
        if len(poses) == 0:
            return views
        if len(poses) == 1:
            edges = np.linspace(0, self.eye.width, self._threads + 1).astype(int)
            jobs = [(poses, views, int(a), int(b)) for a, b in pairwise(edges) if a < b]
        else:
            shares = zip(np.array_split(poses, self._threads), np.array_split(views, self._threads), strict=True)
            jobs = [(at, share, 0, self.eye.width) for at, share in shares if len(at)]
        others = [self._pool.submit(self._render_strip, *job) for job in jobs[1:]]
        self._render_strip(*jobs[0])
        for other in others:
            other.result()
        return views

    def _render_strip(self, poses: Float[np.ndarray, "n 3"], views: np.ndarray, start: int, stop: int) -> None:
        """Draw columns start..stop-1 of the views at poses."""
        eye, rays = self.eye, self.eye.rays
        scratch = self._scratch.pop() if self._scratch else self._new_scratch()
        columns, nearness, seen = scratch
        for (x, y, heading), view in zip(poses, views, strict=True):
            azimuths = heading + self._azimuths
            _columns_of(self._x.ravel(), self._y.ravel(), x, y, heading, eye.width * rays, columns.ravel())
            _draw(
                self._triangles, columns, not self.world.double_sided, np.array([x, y, eye.z]),
                np.cos(azimuths), np.sin(azimuths), self._tangents, self._row_table,
                start * rays, stop * rays, nearness, seen,
            )  # fmt: skip
            _average(seen, self._rgba, rays, self._weights, start, stop, view)
        self._scratch.append(scratch)

    def _new_scratch(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Memory for one thread to draw with; it is kept, because fresh memory costs more than drawing a small view."""
        shape = (self.eye.width * self.eye.rays, self.eye.height * self.eye.rays)
        return np.empty(self._x.shape), np.empty(shape), np.empty(shape, dtype=np.int32)

    def close(self) -> None:
        """Stop the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def __enter__(self) -> "ScanlineRenderer":
        return self

    def __exit__(self, kind, error, at) -> None:
        self.close()
