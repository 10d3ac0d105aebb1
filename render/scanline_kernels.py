"""The loops of the CPU renderer. Their mathematics is in scanline.py.

colour_kernels.py has what makes colours of their keys; functions that call it say so, because numba notices a change in the file of a
function, but not in the files of those that it calls. `lookup` is None in a plain world: numba compiles the loops anew for it, without
the parts for textures. Arrays are passed on one by one, because numba counts the references to each array of a tuple.
"""

from typing import NamedTuple

import numpy as np

from . import colour_kernels
from .colour_kernels import average, colour_rays, opaque, weights_along
from .compile import compiled

LEAF = 32  # triangles in a box of the lowest level; the fastest of 16 to 64
_MAX_LOOKUPS = 4096  # pixels that are looked at to find out whether a box is hidden
_SPANS = 512  # spans that are collected before they are drawn

# Coefficients of atan(x) / x as a polynomial in x^2 on [0, 1]. It finds candidates, which exact tests follow.
_x = np.cos(np.pi * (np.arange(200) + 0.5) / 400)
_ATAN = tuple(np.polynomial.polynomial.polyfit(_x**2, np.arctan(_x) / _x, 7).tolist())
_ATAN_ERROR = 1e-6  # rad; the polynomial is within 2e-7


class _View(NamedTuple):
    """The numbers of a view that is being drawn."""

    x: float  # of the eye (m)
    y: float
    z: float
    heading: float  # rad
    top: float  # elevation of the upper edge (rad)
    rows_per_rad: float  # rows of rays in one radian of elevation
    width: int  # columns of rays
    height: int  # rows of rays
    start: int  # only columns start..stop-1 are drawn
    stop: int


@compiled(inline="always")
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled(inline="always")
def _corner(corners, k, i, view):
    """Corner k of triangle i, seen from the eye."""
    return corners[0, k, i] - view.x, corners[1, k, i] - view.y, corners[2, k, i] - view.z


@compiled(error_model="numpy", inline="always")
def _bound(a, b, volume):
    """The bound p cos az + q sin az + (low or high) on t by the edge (a, b). A bound from below has high = inf, others low = -inf."""
    nx, ny, nz = _cross(a, b)
    upright = abs(nz) < 1e-200  # then the bound is about +-1e200 and allows all of a column or nothing ..
    nz = 1e-200 if upright else nz
    slack = 1e150 if upright else 0.0  # .. but all of a column that lies in the plane
    below = (nz > 0.0) == (volume > 0.0)
    scale = -1.0 / nz
    return scale * nx, scale * ny, -slack if below else -np.inf, np.inf if below else slack


@compiled(inline="always")
def _covered(ab, bc, ca, cos, sin):
    """The least and the greatest t in a column between the bounds of three edges; the triangle is not in it where least > greatest."""
    t0, t1, t2 = ab[0] * cos + ab[1] * sin, bc[0] * cos + bc[1] * sin, ca[0] * cos + ca[1] * sin
    return max(t0 + ab[2], t1 + bc[2], t2 + ca[2]), min(t0 + ab[3], t1 + bc[3], t2 + ca[3])


@compiled(error_model="numpy", inline="always")
def _depth_plane(a, b, c, volume):
    """The vector whose product with a ray is the inverse distance."""
    # It is also the sum of the edges' normals, but only the differences of corners give it precisely.
    gx, gy, gz = _cross((b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2]))
    scale = 1.0 / volume
    return gx * scale, gy * scale, gz * scale


@compiled(error_model="numpy", inline="always")
def _atan2(y, x):
    """arctan2 within _ATAN_ERROR (rad), without branches, so that loops of it are vectorised."""
    ax, ay = abs(x), abs(y)
    q = min(ax, ay) / (max(ax, ay) + 1e-300)
    s = q * q
    end = _ATAN[4] + s * (_ATAN[5] + s * (_ATAN[6] + s * _ATAN[7]))
    angle = q * (_ATAN[0] + s * (_ATAN[1] + s * (_ATAN[2] + s * (_ATAN[3] + s * end))))
    angle = 0.5 * np.pi - angle if ay > ax else angle
    angle = np.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@compiled(inline="always")
def _column(dx, dy, heading, width):
    """Column (fractional, not wrapped) of a point that is (dx, dy) away, within _ATAN_ERROR."""
    return (np.pi - (_atan2(dy, dx) - heading)) * (width / (2 * np.pi)) - 0.5


@compiled(inline="always")
def _row(tangent, view):
    """Row (fractional) with a tangent, within _ATAN_ERROR."""
    return (view.top - _atan2(tangent, 1.0)) * view.rows_per_rad - 0.5


@compiled(error_model="numpy")
def _find_columns(corners, begin, end, view, columns, firsts, lasts):
    """Find columns that may show triangles begin..end-1: from firsts (0..width-1) to lasts (may exceed width - 1)."""
    x, y, heading, width = view.x, view.y, view.heading, view.width
    pad, turns = 1e-6 + 2 * _ATAN_ERROR * width / (2 * np.pi), 1.0 / width
    half = 0.5 * width - pad
    for k in range(3):
        for i in range(end - begin):  # without branches, so that it is vectorised
            columns[k, i] = _column(corners[0, k, begin + i] - x, corners[1, k, begin + i] - y, heading, width)
    for i in range(end - begin):
        ca, cb, cc = columns[0, i], columns[1, i], columns[2, i]
        ab, bc, ac = cb - ca, cc - cb, cc - ca
        ab -= width * np.rint(ab * turns)
        bc -= width * np.rint(bc * turns)
        ac -= width * np.rint(ac * turns)
        first, last = np.ceil(ca + min(0.0, ab, ac) - pad), np.floor(ca + max(0.0, ab, ac) + pad)
        shift = np.floor(first * turns + 1e-9) * width
        # A triangle above or below the eye, or nearly so, is in every column.
        around = (abs(ab) > half) | (abs(bc) > half) | (abs(ac) > half) | (abs(ab + bc - ac) > 0.5)
        firsts[i] = 0.0 if around else first - shift
        lasts[i] = width - 1.0 if around else last - shift


@compiled(inline="always")
def _key(nearness, label):
    """A number that orders triangles by their inverse distance (positive, rounded to float32), then by their labels."""
    return np.int64(np.float32(nearness).view(np.int32)) << 32 | label


@compiled(error_model="numpy", uses=colour_kernels)
def _draw_spans(count, pairs, spans, directions, tangents, view, keys, lookup):
    """Draw `count` spans of rows, see `_draw`."""
    lows, highs, bases, slopes, first_rows, last_rows = spans[0], spans[1], spans[2], spans[3], spans[4], spans[5]
    pad, height = 1e-6 + _ATAN_ERROR * view.rows_per_rad, view.height
    if lookup is not None:
        corners, index, holes, uv, corner_colours, texels, textures, thresholds, _ = lookup
    for s in range(count):  # without branches, so that it is vectorised
        first_rows[s] = np.ceil(_row(highs[s], view) - pad)
        last_rows[s] = np.floor(_row(lows[s], view) + pad)
    for s in range(count):
        low, high, base, slope, j, label = lows[s], highs[s], bases[s], slopes[s], np.uintp(pairs[0, s]), pairs[1, s]
        first = np.int64(min(max(first_rows[s], 0.0), float(height)))
        last = np.int64(min(max(last_rows[s], -1.0), height - 1.0))
        # Both are right or one row too far out, or more where rows are finer than the approximation.
        while first < height and tangents[np.uintp(first)] > high:
            first += 1
        while last >= 0 and tangents[np.uintp(last)] < low:
            last -= 1
        if lookup is not None:  # noqa: SIM102 (numba leaves the inner part out where lookup is None)
            if holes[np.uintp(label)]:
                k = np.int64(index[np.uintp(label)])
                weights = weights_along(corners, label, view, directions[0, j], directions[1, j])
                for row in range(first, last + 1):
                    r = np.uintp(row)
                    t, key = tangents[r], _key(base + slope * tangents[r], label)
                    if key > keys[j, r] and opaque(
                        uv, corner_colours, texels, textures, thresholds, label, k, weights, t
                    ):
                        keys[j, r] = key
                continue
        for row in range(first, last + 1):
            r = np.uintp(row)
            keys[j, r] = max(keys[j, r], _key(base + slope * tangents[r], label))


@compiled(error_model="numpy", inline="always")
def _rows_of_box(z0, z1, near, far, view):
    """First and last row that may show a box from z0 to z1 above the eye and from near to far away, over the ground."""
    low, high = z0 / (near if z0 < 0.0 else far), z1 / (near if z1 > 0.0 else far)
    low, high = low - 1e-9 * (1 + abs(low)), high + 1e-9 * (1 + abs(high))
    pad = 1e-6 + _ATAN_ERROR * view.rows_per_rad
    first = np.int64(max(np.ceil(_row(high, view) - pad), 0.0))
    return first, np.int64(min(np.floor(_row(low, view) + pad), view.height - 1.0))


@compiled(error_model="numpy")
def _invisible(boxes, k, view, keys):
    """Whether nothing in box k can be seen in the columns drawn: it lies between the rays, or behind what is drawn already."""
    width, start, stop = view.width, view.start, view.stop
    x0, y0, z0 = boxes[k, 0] - view.x, boxes[k, 1] - view.y, boxes[k, 2] - view.z
    x1, y1, z1 = boxes[k, 3] - view.x, boxes[k, 4] - view.y, boxes[k, 5] - view.z
    if x0 > x1:  # empty
        return True
    near = np.sqrt(max(x0, -x1, 0.0) ** 2 + max(y0, -y1, 0.0) ** 2)
    far = np.sqrt(max(-x0, x1) ** 2 + max(-y0, y1) ** 2)
    # A circle around the box, of radius r at distance d, has the angle 2 asin(q), q = r / d; asin(q) <= q + (pi / 2 - 1) q^3.
    q = np.sqrt(((x1 - x0) ** 2 + (y1 - y0) ** 2) / ((x0 + x1) ** 2 + (y0 + y1) ** 2))
    if near == 0.0 or q >= 1.0:
        return False
    top_row, bottom_row = _rows_of_box(z0, z1, near, far, view)
    if top_row > bottom_row:
        return True
    middle = _column(x0 + x1, y0 + y1, view.heading, width)
    reach = (q + (0.5 * np.pi - 1) * q * q * q + _ATAN_ERROR) * width / (2 * np.pi) + 1e-6
    first, last = np.ceil(middle - reach), np.floor(middle + reach)
    shift = np.floor(first / width) * width
    first, last = np.int64(first - shift), np.int64(last - shift)
    if (last - first + 1) * (bottom_row - top_row + 1) > _MAX_LOOKUPS:  # its parts may be hidden
        return (last < start) or (first >= stop and last < start + width)
    nearest = _key(1.000001 / near, 0) + (np.int64(1) << 32)
    for around in (0, width):
        for column in range(max(first, start + around), min(last, stop - 1 + around) + 1):
            for row in range(top_row, bottom_row + 1):
                if keys[np.uintp(column - around), np.uintp(row)] <= nearest:
                    return False
    return True


@compiled(inline="always")
def _squared_distance(boxes, k, view):
    """From the eye to the middle of box k, over the ground."""
    dx, dy = 0.5 * (boxes[k, 0] + boxes[k, 3]) - view.x, 0.5 * (boxes[k, 1] + boxes[k, 4]) - view.y
    return dx * dx + dy * dy


@compiled(error_model="numpy", uses=colour_kernels)
def _draw(triangles, directions, tangents, view, keys, lookup):
    """Draw all triangles. Boxes are visited from near to far, so that near ones hide far ones.

    directions: (2, width) cosines and sines of the azimuths of the columns in the world. Spans are collected and drawn together; each has
    a column and a label (pairs), least and greatest tangent, base and slope of the inverse distance, and two rows to work in (spans).
    """
    corners, labels, boxes, cull = triangles
    width, start, stop, leaves = view.width, view.start, view.stop, boxes.shape[0] // 2
    corner_columns, firsts, lasts = np.empty((3, LEAF)), np.empty(LEAF, np.int64), np.empty(LEAF, np.int64)
    pairs, spans = np.empty((2, _SPANS), np.int64), np.empty((6, _SPANS))
    stack, size = np.ones(64, np.int64), 1  # boxes to visit, at first the box of all
    while size:
        size -= 1
        box = stack[size]
        if _invisible(boxes, box, view, keys):
            continue
        if box < leaves:
            nearer = np.int64(_squared_distance(boxes, 2 * box + 1, view) < _squared_distance(boxes, 2 * box, view))
            stack[size], stack[size + 1] = 2 * box + 1 - nearer, 2 * box + nearer
            size += 2
            continue
        begin = (box - leaves) * LEAF
        end = min(begin + LEAF, corners.shape[2])
        _find_columns(corners, begin, end, view, corner_columns, firsts, lasts)
        count = np.int64(0)  # not a literal, for which numba would compile another `_draw_spans`
        for i in range(begin, end):
            first, last = firsts[i - begin], lasts[i - begin]
            if first > last or (first >= stop and last < start + width) or (last < start):
                continue
            a, b, c = _corner(corners, 0, i, view), _corner(corners, 1, i, view), _corner(corners, 2, i, view)
            nx, ny, nz = _cross(b, c)
            volume = a[0] * nx + a[1] * ny + a[2] * nz
            if abs(volume) < 1e-200 or (cull and volume > 0.0):  # seen from its edge, or from its back
                continue
            ab, bc, ca = _bound(a, b, volume), _bound(b, c, volume), _bound(c, a, volume)
            gx, gy, gz = _depth_plane(a, b, c, volume)
            if last < width:
                first, last = max(first, start), min(last, stop - 1)
            for column in range(first, last + 1):
                wrapped = column - width if column >= width else column
                cos, sin = directions[0, np.uintp(wrapped)], directions[1, np.uintp(wrapped)]
                low, high = _covered(ab, bc, ca, cos, sin)
                pairs[0, count], pairs[1, count] = wrapped, labels[i]
                spans[0, count], spans[1, count], spans[2, count], spans[3, count] = low, high, gx * cos + gy * sin, gz
                count += (low <= high) & (wrapped >= start) & (wrapped < stop)
                if count == _SPANS:
                    _draw_spans(count, pairs, spans, directions, tangents, view, keys, lookup)
                    count = 0
        _draw_spans(count, pairs, spans, directions, tangents, view, keys, lookup)


@compiled(uses=colour_kernels)
def draw_views(triangles, rays, paint, lookup, poses, start, stop, keys, views):
    """Draw columns start..stop-1 of views.

    Args:
        triangles, rays, paint: `Triangles`, `Rays` and `Paint` as plain tuples, which numba accepts faster.
        lookup: `Lookup` likewise; None in a plain world.
        poses: (n, 4) x (m), y (m), heading (rad) and height (m) of the eye.
        start, stop: Columns of pixels.
        keys: (width, height) of rays, int64, to work in: the `_key` of the nearest triangle so far, 0 for the sky.
        views: (n, height, width) of pixels, which become red, green, blue and alpha in 8 bits each, red lowest.
    """
    azimuths, tangents, top, rows_per_rad, n = rays
    colours, weights = paint
    width, height = keys.shape
    directions = np.empty((2, width))
    for i in range(len(poses)):
        x, y, heading, z = poses[i]
        for j in range(width):  # by elements: numba compiles a check of shapes, with its message, for 2 s
            directions[0, j], directions[1, j] = np.cos(azimuths[j] + heading), np.sin(azimuths[j] + heading)
        view = _View(x, y, z, heading, top, rows_per_rad, width, height, start * n, stop * n)
        keys[start * n : stop * n] = 0
        _draw(triangles, directions, tangents, view, keys, lookup)
        if lookup is None:
            average(keys, n, colours, weights, start, stop, views[i])
        else:
            colour_rays(lookup, colours, directions, tangents, view, keys)
            average(keys, n, None, weights, start, stop, views[i])
