"""The CPU renderer: exact equirectangular scanline rasterisation, no cube map, no GL, no display.

The mathematics, for one eye at the origin. In a column every ray shares one azimuth, so a ray is
`d = (cos az, sin az, t)` with `t = tan(elevation)`; its length does not matter.

- Coverage. An edge (a, b) of a triangle and the eye span a plane with normal `n = a x b`. A ray passes inside the
  triangle where `n . d` has the sign of `D = a . (b x c)` for all three edges. Within a column that is linear in t, so
  each edge bounds t at `-(n_x cos az + n_y sin az) / n_z`, from below or from above by the sign of `n_z D`:
  the triangle covers the rows between the highest lower and the lowest upper bound. Triangles that share an edge compute
  the same bound to the last bit, and both own it, so no ray slips between them.
- Depth. The ray meets the triangle's plane, of normal `N = (b - a) x (c - a)`, at `d D / (N . d)`. So `(N / D) . d` is
  the inverse of the distance, again linear in t: the depth test is one multiply-add a pixel, and the largest wins (rounded to
  float32; the first of the world's triangles where they are equal).

- What is far away, or hidden. The triangles lie sorted under a tree of boxes (render/tree.py), which is walked from near to far. A box
  is left out where no ray meets its outline, taken a little too wide, or where every pixel that it may touch shows something
  nearer than its nearest corner. So the cost grows far slower than the number of triangles, and nothing changes.

Nothing is projected or interpolated: every pixel is what a ray caster finds.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numba
import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.errors import InputError
from tussock.world.geometry import column_azimuths
from tussock.world.scene import World

from .eye import Eye
from .renderer import Poses, as_poses
from .triangle_tree import TriangleTree

# atan(x) / x as a polynomial in x^2 on [0, 1], within 2e-7: enough to find candidates, which exact tests follow.
_x = np.cos(np.pi * (np.arange(200) + 0.5) / 400)
_A0, _A1, _A2, _A3, _A4, _A5, _A6, _A7 = (
    float(c) for c in np.polynomial.polynomial.polyfit(_x**2, np.arctan(_x) / _x, 7)
)
_ATAN_ERROR = 1e-6
_MOST_PIXELS = 4096  # that one look whether a box is hidden goes through
_LEAF = 32  # triangles in a box of the lowest level; of 16 to 64 the quickest
_SPANS = 512  # spans of rows that are found, then drawn, at once


@numba.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _atan(y, x):
    """Angle of the place (x, y) seen from the origin (rad), within _ATAN_ERROR; without branches, so that loops of it are vectorised."""
    ax, ay = abs(x), abs(y)
    q = min(ax, ay) / (max(ax, ay) + 1e-300)
    s = q * q
    angle = q * (_A0 + s * (_A1 + s * (_A2 + s * (_A3 + s * (_A4 + s * (_A5 + s * (_A6 + s * _A7)))))))
    angle = 0.5 * np.pi - angle if ay > ax else angle
    angle = np.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@numba.njit(cache=True, nogil=True, inline="always")
def _column(dx, dy, heading, width):
    """Column (unwrapped, fractional, within _ATAN_ERROR width / 2 pi) in which a place lies that is (dx, dy) away."""
    return (np.pi - (_atan(dy, dx) - heading)) * (width / (2 * np.pi)) - 0.5


@numba.njit(cache=True, nogil=True, inline="always")
def _row(tangent, top, rows_per_rad):
    """Row (fractional, within _ATAN_ERROR rows_per_rad) at which tan(elevation) has a value, where rows are even in elevation."""
    return (top - _atan(tangent, 1.0)) * rows_per_rad - 0.5


@numba.njit(cache=True, nogil=True, inline="always")
def _rows_between(low, high, above, below, tangents, height):
    """First and last row whose tangent lies in [low, high], which `_row` put at `above` and `below`; first > last if there is none."""
    first, last = np.int64(min(max(above, 0.0), float(height))), np.int64(min(max(below, -1.0), height - 1.0))
    # Both are right or a row too far out (more where rows are finer than the approximation).
    while first < height and tangents[np.uintp(first)] > high:
        first += 1
    while last >= 0 and tangents[np.uintp(last)] < low:
        last -= 1
    return first, last


@numba.njit(cache=True, nogil=True, inline="always")
def _column_range(ca, cb, cc, width):
    """First (0..width-1) and last (may exceed width - 1) column whose centre may look at a triangle with corners in three columns."""
    pad = 1e-6 + 2 * _ATAN_ERROR * width / (2 * np.pi)
    ab, bc, ac = cb - ca, cc - cb, cc - ca
    turns = 1.0 / width
    ab -= width * np.rint(ab * turns)
    bc -= width * np.rint(bc * turns)
    ac -= width * np.rint(ac * turns)
    half = 0.5 * width - pad
    first = np.ceil(ca + min(0.0, ab, ac) - pad)
    last = np.floor(ca + max(0.0, ab, ac) + pad)
    shift = np.floor(first * turns + 1e-9) * width
    # Where the eye's vertical passes through the triangle, or as good as, it is everywhere.
    around = (abs(ab) > half) | (abs(bc) > half) | (abs(ac) > half) | (abs(ab + bc - ac) > 0.5)
    return np.int64(0.0 if around else first - shift), np.int64(width - 1.0 if around else last - shift)


@numba.njit(cache=True, nogil=True, inline="always")
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@numba.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _bound(normal, volume):
    """The bound p cos + q sin on t that an edge sets, as (p, q, l, h): l is 0 where it is one from below, h where it is one from
    above; else they are -inf and inf. A plane that stands upright bounds columns, not t.
    """
    nx, ny, nz = normal
    upright = abs(nz) < 1e-200  # bounds of +-1e200 leave all of a column, or nothing; all of one that lies in the plane
    nz = 1e-200 if upright else nz
    slack = 1e150 if upright else 0.0
    below = (nz > 0.0) == (volume > 0.0)
    scale = -1.0 / nz
    return scale * nx, scale * ny, -slack if below else -np.inf, np.inf if below else slack


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _find_columns(corners, begin, end, x, y, heading, width, columns, firsts, lasts):
    """First and last column of triangles begin..end-1 seen from (x, y), see `_column_range`; columns (3, _LEAF): scratch."""
    for k in range(3):
        for i in range(end - begin):  # no branches, so that it is vectorised
            columns[k, i] = _column(corners[0, k, begin + i] - x, corners[1, k, begin + i] - y, heading, width)
    for i in range(end - begin):
        firsts[i], lasts[i] = _column_range(columns[0, i], columns[1, i], columns[2, i], width)


@numba.njit(cache=True, nogil=True, inline="always")
def _key(nearness, label):
    """A number that is greater the nearer a triangle is, then the greater its label. nearness: positive, rounded to float32."""
    return np.int64(np.float32(nearness).view(np.int32)) << 32 | label


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _draw_spans(count, spans, lows, highs, bases, slopes, aboves, belows, tangents, height, top, rows_per_rad, keys):
    """Draw spans: of column spans[0] and the triangle with label spans[1], the rows between tangents `lows` and `highs`.

    The inverse distance is bases + slopes t. aboves, belows: scratch.
    """
    pad = 1e-6 + _ATAN_ERROR * rows_per_rad
    for s in range(count):  # no branches, so that it is vectorised
        aboves[s] = np.ceil(_row(highs[s], top, rows_per_rad) - pad)
        belows[s] = np.floor(_row(lows[s], top, rows_per_rad) + pad)
    for s in range(count):
        first, last = _rows_between(lows[s], highs[s], aboves[s], belows[s], tangents, height)
        j, label, base, slope = np.uintp(spans[0, s]), spans[1, s], bases[s], slopes[s]
        for row in range(first, last + 1):
            r = np.uintp(row)
            keys[j, r] = max(keys[j, r], _key(base + slope * tangents[r], label))


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _out_of_sight(boxes, k, x, y, z, heading, height, top, rows_per_rad, start, stop, keys):
    """Whether no ray of columns start..stop-1 meets anything in box k: it lies between the rays, or behind what is drawn."""
    width = keys.shape[0]
    x0, y0, z0 = boxes[k, 0] - x, boxes[k, 1] - y, boxes[k, 2] - z
    x1, y1, z1 = boxes[k, 3] - x, boxes[k, 4] - y, boxes[k, 5] - z
    if x0 > x1:
        return True
    dx, dy = max(x0, -x1, 0.0), max(y0, -y1, 0.0)
    if dx == 0.0 and dy == 0.0:
        return False
    near = np.sqrt(dx * dx + dy * dy)
    dx, dy = max(-x0, x1), max(-y0, y1)
    far = np.sqrt(dx * dx + dy * dy)
    low, high = z0 / (near if z0 < 0.0 else far), z1 / (near if z1 > 0.0 else far)
    low, high = low - 1e-9 * (1 + abs(low)), high + 1e-9 * (1 + abs(high))
    pad = 1e-6 + _ATAN_ERROR * rows_per_rad
    above = np.int64(max(np.ceil(_row(high, top, rows_per_rad) - pad), 0.0))
    below = np.int64(min(np.floor(_row(low, top, rows_per_rad) + pad), height - 1.0))
    if above > below:
        return True
    # The box's circle, of radius r around a place d away, is seen under 2 asin(q), q = r / d; asin(q) <= q + (pi / 2 - 1) q^3.
    q = np.sqrt(((x1 - x0) ** 2 + (y1 - y0) ** 2) / ((x0 + x1) ** 2 + (y0 + y1) ** 2))
    if q >= 1.0:
        return False
    middle = _column(x0 + x1, y0 + y1, heading, width)
    reach = (q + (0.5 * np.pi - 1) * q * q * q + _ATAN_ERROR) * width / (2 * np.pi) + 1e-6
    first, last = np.ceil(middle - reach), np.floor(middle + reach)
    shift = np.floor(first / width) * width
    first, last = np.int64(first - shift), np.int64(last - shift)
    if (last - first + 1) * (below - above + 1) > _MOST_PIXELS:
        # Too much to look through; its parts may be hidden. But beside the strip it may be.
        return (last < start) or (first >= stop and last < start + width)
    nearest = _key(1.000001 / near, 0) + (np.int64(1) << 32)
    for around in (0, width):
        for column in range(max(first, start + around), min(last, stop - 1 + around) + 1):
            for r in range(above, below + 1):
                if keys[np.uintp(column - around), np.uintp(r)] <= nearest:
                    return False
    return True


@numba.njit(cache=True, nogil=True, inline="always")
def _squared_distance(boxes, k, x, y):
    """From (x, y) to the middle of box k, over the ground."""
    dx, dy = 0.5 * (boxes[k, 0] + boxes[k, 3]) - x, 0.5 * (boxes[k, 1] + boxes[k, 4]) - y
    return dx * dx + dy * dy


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _draw(
    corners, labels, boxes, cull, x, y, z, heading, cosines, sines, tangents, height, top, rows_per_rad, start, stop, keys
):  # fmt: skip
    """Draw all triangles into columns start..stop-1: into keys (width, height) the `_key` of each pixel's nearest, 0 where is none.

    corners (3, 3, n) and boxes as a `TriangleTree` has them; the eye is at x, y, z; cosines, sines (width,) of the columns' azimuths
    in the world; tangents (height,) of the rows' elevations, which are even from `top` down; labels (n,), over 0, say which triangle
    it is. Boxes are walked from near to far.
    """
    keys[start:stop] = 0
    width, leaves = keys.shape[0], boxes.shape[0] // 2
    columns, firsts, lasts = np.empty((3, _LEAF)), np.empty(_LEAF, np.int64), np.empty(_LEAF, np.int64)
    spans, lows, highs = np.empty((2, _SPANS), np.int64), np.empty(_SPANS), np.empty(_SPANS)
    bases, slopes, aboves, belows = np.empty(_SPANS), np.empty(_SPANS), np.empty(_SPANS), np.empty(_SPANS)
    waiting, waits = np.empty(64, np.int64), 1
    waiting[0] = 1
    while waits:
        waits -= 1
        box = waiting[waits]
        if _out_of_sight(boxes, box, x, y, z, heading, height, top, rows_per_rad, start, stop, keys):
            continue
        if box < leaves:
            near, far = 2 * box, 2 * box + 1
            if _squared_distance(boxes, far, x, y) < _squared_distance(boxes, near, x, y):
                near, far = far, near
            waiting[waits], waiting[waits + 1] = far, near
            waits += 2
            continue
        begin = (box - leaves) * _LEAF
        end = min(begin + _LEAF, corners.shape[2])
        _find_columns(corners, begin, end, x, y, heading, width, columns, firsts, lasts)
        count = 0
        for i in range(begin, end):
            first, last = firsts[i - begin], lasts[i - begin]
            if first > last or (first >= stop and last < start + width) or (last < start):
                continue
            a = corners[0, 0, i] - x, corners[1, 0, i] - y, corners[2, 0, i] - z
            b = corners[0, 1, i] - x, corners[1, 1, i] - y, corners[2, 1, i] - z
            c = corners[0, 2, i] - x, corners[1, 2, i] - y, corners[2, 2, i] - z
            opposite = _cross(b, c)
            volume = a[0] * opposite[0] + a[1] * opposite[1] + a[2] * opposite[2]
            if abs(volume) < 1e-200 or (cull and volume > 0.0):  # edge-on, or the back
                continue
            p0, q0, l0, h0 = _bound(_cross(a, b), volume)
            p1, q1, l1, h1 = _bound(opposite, volume)
            p2, q2, l2, h2 = _bound(_cross(c, a), volume)
            # The plane's normal is the sum of the three edges' normals, but precise only when taken from the differences.
            gx, gy, gz = _cross((b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2]))
            scale = 1.0 / volume
            gx, gy, gz = gx * scale, gy * scale, gz * scale
            if last < width:
                first, last = max(first, start), min(last, stop - 1)
            for column in range(first, last + 1):
                wrapped = column - width if column >= width else column
                j = np.uintp(wrapped)
                cos, sin = cosines[j], sines[j]
                t0, t1, t2 = p0 * cos + q0 * sin, p1 * cos + q1 * sin, p2 * cos + q2 * sin
                low, high = max(t0 + l0, t1 + l1, t2 + l2), min(t0 + h0, t1 + h1, t2 + h2)
                lows[count], highs[count], bases[count], slopes[count] = low, high, gx * cos + gy * sin, gz
                spans[0, count], spans[1, count] = wrapped, labels[i]
                count += (low <= high) & (wrapped >= start) & (wrapped < stop)
                if count == _SPANS:
                    _draw_spans(
                        count, spans, lows, highs, bases, slopes, aboves, belows, tangents, height, top, rows_per_rad, keys
                    )  # fmt: skip
                    count = 0
        _draw_spans(count, spans, lows, highs, bases, slopes, aboves, belows, tangents, height, top, rows_per_rad, keys)


@numba.njit(cache=True, nogil=True)
def _average(keys, colours, rays, weights, start, stop, view):
    """Average the rays of each pixel of columns start..stop-1 into view (height, width), RGBA in 32 bits, by solid angle.

    keys (width * rays, height * rays); colours (n + 1,) by label, the sky's first: four times 16 bits, red lowest, so that one sum adds
    all four; weights (height, rays) sum to 1 / rays over a pixel's sub-rows.
    """
    for block in range(start, stop, 16):  # columns whose pixels share a line of memory
        for row in range(view.shape[0]):
            for column in range(block, min(block + 16, stop)):
                if rays == 1:
                    total = colours[np.uintp(keys[np.uintp(column), np.uintp(row)] & 0xFFFFFFFF)]
                    red, green = total & 0xFF, total >> 16 & 0xFF
                    blue, cover = total >> 32 & 0xFF, total >> 48
                else:
                    r = g = b = a = 0.5
                    for y in range(rays):
                        total = 0
                        for x in range(rays):
                            label = keys[np.uintp(column * rays + x), np.uintp(row * rays + y)] & 0xFFFFFFFF
                            total += colours[np.uintp(label)]
                        weight = weights[row, y]
                        r += weight * (total & 0xFFFF)
                        g += weight * (total >> 16 & 0xFFFF)
                        b += weight * (total >> 32 & 0xFFFF)
                        a += weight * (total >> 48)
                    red, green, blue, cover = np.int64(r), np.int64(g), np.int64(b), np.int64(a)
                view[np.uintp(row), np.uintp(column)] = np.uint32(red | green << 8 | blue << 16 | cover << 24)


@numba.njit(cache=True, nogil=True)
def _draw_views(
    corners, labels, boxes, cull, poses, z, azimuths, tangents, top, rows_per_rad, start, stop, keys, colours, rays, weights, views
):  # fmt: skip
    """Columns start..stop-1 of the views (n, height, width) at poses (n, 3); see `_draw` and `_average`."""
    height = views.shape[1] * rays
    for n in range(len(poses)):
        x, y, heading = poses[n]
        around = azimuths + heading
        _draw(
            corners, labels, boxes, cull, x, y, z, heading, np.cos(around), np.sin(around), tangents, height, top, rows_per_rad,
            start * rays, stop * rays, keys,
        )  # fmt: skip
        _average(keys, colours, rays, weights, start, stop, views[n])


class ScanlineRenderer:
    """Exact panoramas on the CPU (see the module's docstring); a `Renderer`.

    threads: how many to use; None takes every core this process may run on. The result does not depend on it.
    """

    backend = "cpu"

    def __init__(self, world: World, eye: Eye, threads: int | None = None):
        self.world = world
        self.eye = eye
        triangles, rgb = world.surfaces()
        self._tree = TriangleTree.of(triangles, _LEAF)
        self._labels = len(rgb) - self._tree.order  # of equally near triangles the first is seen; 0 is the sky
        covered = np.column_stack([rgb, np.full(len(rgb), 255)])[::-1]
        by_label = np.vstack([[*world.sky_rgb, 0], covered]).astype("<u2")
        self._colours = by_label.view("<i8")[:, 0]  # see `_average`
        rays = eye.rays
        self._azimuths = column_azimuths(eye.width * rays)
        elevations = eye.elevations(rays)
        self._tangents = np.tan(elevations)
        self._rows_per_rad = eye.height * rays / (eye.top - eye.bottom)
        weights = np.cos(elevations).reshape(eye.height, rays)
        self._weights = weights / weights.sum(axis=1, keepdims=True) / rays
        self._scratch: list[np.ndarray] = []  # keys (see `_draw`) not in use at the moment
        self._threads = threads or len(os.sched_getaffinity(0))
        self._pool: ThreadPoolExecutor | None = ThreadPoolExecutor(self._threads)
        # Drawing nothing compiles what draws, where that was not done before, or loads it.
        self._render_strip(np.empty((0, 3)), np.empty((0, eye.height, eye.width, 4), dtype=np.uint8), 0, eye.width)

    def __reduce__(self):
        """Sent to another process, it is opened anew there."""
        return ScanlineRenderer, (self.world, self.eye, self._threads)

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
        eye, rays, tree = self.eye, self.eye.rays, self._tree
        try:
            keys = self._scratch.pop()
        except IndexError:
            keys = np.empty((eye.width * rays, len(self._tangents)), dtype=np.int64)
        _draw_views(
            tree.corners, self._labels, tree.boxes, not self.world.double_sided, poses, eye.z, self._azimuths, self._tangents, eye.top,
            self._rows_per_rad, start, stop, keys, self._colours, rays, self._weights, views.view("<u4")[..., 0],
        )  # fmt: skip
        self._scratch.append(keys)  # fresh memory costs more than drawing a small view

    def close(self) -> None:
        """Stop the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def __enter__(self) -> "ScanlineRenderer":
        return self

    def __exit__(self, kind, error, at) -> None:
        self.close()
