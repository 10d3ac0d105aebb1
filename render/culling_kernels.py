"""Loops of the CPU renderer that leave out what no ray can meet, or what is hidden. Their mathematics is in scanline.py."""

from typing import NamedTuple

import numpy as np

from .compile import compiled

LEAF = 32  # triangles in a box of the lowest level; the fastest of 16 to 64
_MAX_LOOKUPS = 4096  # pixels that are looked at to find out whether a box is hidden

# Coefficients of atan(x) / x as a polynomial in x^2 on [0, 1]. It finds candidates, which exact tests follow.
_x = np.cos(np.pi * (np.arange(200) + 0.5) / 400)
_ATAN = tuple(np.polynomial.polynomial.polyfit(_x**2, np.arctan(_x) / _x, 7).tolist())
ATAN_ERROR = 1e-6  # rad; the polynomial is within 2e-7
_ATAN_32, _HALF_TURN, _TINY = tuple(map(np.float32, _ATAN)), np.float32(np.pi), np.float32(1e-30)
_HUGE, _INF, _SLACK = np.float32(1e30), np.float32(np.inf), np.float32(1e-6)
_ATAN_ERROR_32 = 5e-6  # rad; with the rounding of what columns and rows are computed from


class View(NamedTuple):
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


@compiled(error_model="numpy", inline="always")
def _atan2(y, x):
    """arctan2 within ATAN_ERROR (rad), without branches, so that loops of it are vectorised."""
    ax, ay = abs(x), abs(y)
    q = min(ax, ay) / (max(ax, ay) + 1e-300)
    s = q * q
    end = _ATAN[4] + s * (_ATAN[5] + s * (_ATAN[6] + s * _ATAN[7]))
    angle = q * (_ATAN[0] + s * (_ATAN[1] + s * (_ATAN[2] + s * (_ATAN[3] + s * end))))
    angle = 0.5 * np.pi - angle if ay > ax else angle
    angle = np.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@compiled(inline="always")
def column_of(dx, dy, heading, width):
    """Column (fractional, not wrapped) of a point that is (dx, dy) away, within ATAN_ERROR."""
    return (np.pi - (_atan2(dy, dx) - heading)) * (width / (2 * np.pi)) - 0.5


@compiled(inline="always")
def row_of(tangent, view):
    """Row (fractional) with a tangent, within ATAN_ERROR."""
    return (view.top - _atan2(tangent, 1.0)) * view.rows_per_rad - 0.5


@compiled(error_model="numpy", inline="always")
def _atan2_32(y, x):
    """`_atan2` in float32, within _ATAN_ERROR_32 (rad)."""
    ax, ay, zero = abs(x), abs(y), np.float32(0)
    q = min(ax, ay) / (max(ax, ay) + _TINY)
    s = q * q
    end = _ATAN_32[4] + s * (_ATAN_32[5] + s * (_ATAN_32[6] + s * _ATAN_32[7]))
    angle = q * (_ATAN_32[0] + s * (_ATAN_32[1] + s * (_ATAN_32[2] + s * (_ATAN_32[3] + s * end))))
    angle = _HALF_TURN * np.float32(0.5) - angle if ay > ax else angle
    angle = _HALF_TURN - angle if x < zero else angle
    return -angle if y < zero else angle


@compiled(error_model="numpy", inline="always")
def _crossing(start, start_tangent, end, end_tangent, at, pad):
    """The least and greatest tangent of an edge within pad of a column; inf and -inf where it does not get there."""
    length, zero, one = end - start, np.float32(0), np.float32(1)
    scale = one / (length if abs(length) > _TINY else _TINY)
    share, reach = (at - start) * scale, abs(pad * scale)
    near, far = max(share - reach, zero), min(share + reach, one)
    t, u = start_tangent + near * (end_tangent - start_tangent), start_tangent + far * (end_tangent - start_tangent)
    return (min(t, u), max(t, u)) if near <= far else (_INF, -_INF)


@compiled(error_model="numpy")
def find_candidates(corners, n, view, work, found):
    """Find the triangles of a leaf that a ray may meet: all that one does meet, and few others.

    The least and greatest tangent of an edge that spans an angle s are those of its ends, times at most 1 / cos(s / 2) away from 0.

    Args:
        corners: (3, 3, LEAF) see `TriangleTree`.
        n: Triangles in the leaf.
        work: (9 * LEAF,) of float32. Some of it is to work in. The seventh LEAF numbers become the first column of each triangle
            (0..width-1), the eighth its last one (which may exceed width - 1).
        found: (LEAF,) their indices in the leaf.

    Returns:
        How many were found.
    """
    one, zero, width, start, stop = (
        np.float32(1),
        np.float32(0),
        view.width,
        np.float32(view.start),
        np.float32(view.stop),
    )
    x, y, z = view.x, view.y, view.z
    heading = np.float32(view.heading - 2 * np.pi * np.floor(view.heading / (2 * np.pi)))
    wide, turns, per_rad = np.float32(width), np.float32(1 / width), np.float32(width / (2 * np.pi))
    pad = np.float32(_ATAN_ERROR_32 * width / (2 * np.pi) + 1e-5)
    half, middle = np.float32(0.5) * wide - pad, (_HALF_TURN + heading) * per_rad - np.float32(0.5)
    top, rows_per_rad, bottom_row = np.float32(view.top), np.float32(view.rows_per_rad), np.float32(view.height - 1)
    row_pad = np.float32(_ATAN_ERROR_32 * view.rows_per_rad + 1e-5)
    for k in range(3):
        for i in range(n):  # without branches, so that it is vectorised
            dx, dy = np.float32(corners[0, k, i] - x), np.float32(corners[1, k, i] - y)
            work[k * LEAF + i] = middle - _atan2_32(dy, dx) * per_rad
            work[(3 + k) * LEAF + i] = np.float32(corners[2, k, i] - z) / (np.sqrt(dx * dx + dy * dy) + _TINY)
    for i in range(n):  # likewise
        ca, cb, cc = work[i], work[1 * LEAF + i], work[2 * LEAF + i]
        ab, bc, ac = cb - ca, cc - cb, cc - ca
        ab -= wide * np.rint(ab * turns)
        bc -= wide * np.rint(bc * turns)
        ac -= wide * np.rint(ac * turns)
        least, most = min(zero, min(ab, ac)), max(zero, max(ab, ac))
        first, last = np.ceil(ca + least - pad), np.floor(ca + most + pad)
        shift = np.floor(first * turns + np.float32(1e-6)) * wide
        # A triangle above or below the eye, or nearly so, is in every column.
        around = (abs(ab) > half) | (abs(bc) > half) | (abs(ac) > half) | (abs(ab + bc - ac) > np.float32(0.5))
        ta, tb, tc = work[3 * LEAF + i], work[4 * LEAF + i], work[5 * LEAF + i]
        low, high = min(ta, min(tb, tc)), max(ta, max(tb, tc))
        angle = (most - least) / per_rad
        slack = (_SLACK + np.float32(0.15) * angle * angle if angle < one else _HUGE) * max(abs(low), abs(high))
        at = first - ca
        low_ab, high_ab = _crossing(zero, ta, ab, tb, at, pad)
        low_bc, high_bc = _crossing(ab, tb, ac, tc, at, pad)
        low_ca, high_ca = _crossing(ac, tc, zero, ta, at, pad)
        alone = first == last
        low = (min(low_ab, min(low_bc, low_ca)) if alone else low) - slack
        high = (max(high_ab, max(high_bc, high_ca)) if alone else high) + slack
        top_row = np.ceil((top - _atan2_32(high, one)) * rows_per_rad - np.float32(0.5) - row_pad)
        last_row = np.floor((top - _atan2_32(low, one)) * rows_per_rad - np.float32(0.5) + row_pad)
        between = ((top_row > last_row) | (top_row > bottom_row) | (last_row < zero)) & (not around)
        first, last = (zero if around else first - shift), (wide - one if around else last - shift)
        work[6 * LEAF + i], work[7 * LEAF + i] = first, last
        outside = (first > last) | ((first >= stop) & (last < start + wide)) | (last < start)
        work[8 * LEAF + i] = zero if between | outside else one
    count = 0
    for i in range(n):
        found[count] = i
        count += np.int64(work[8 * LEAF + i])
    return count


@compiled(inline="always")
def key_of(nearness, label):
    """A number that orders triangles by their inverse distance (positive, rounded to float32), then by their labels."""
    return np.int64(np.float32(nearness).view(np.int32)) << 32 | label


@compiled(error_model="numpy", inline="always")
def _rows_of_box(z0, z1, near, far, view):
    """First and last row that may show a box from z0 to z1 above the eye and from near to far away, over the ground."""
    low, high = z0 / (near if z0 < 0.0 else far), z1 / (near if z1 > 0.0 else far)
    low, high = low - 1e-9 * (1 + abs(low)), high + 1e-9 * (1 + abs(high))
    pad = 1e-6 + ATAN_ERROR * view.rows_per_rad
    first = np.int64(max(np.ceil(row_of(high, view) - pad), 0.0))
    return first, np.int64(min(np.floor(row_of(low, view) + pad), view.height - 1.0))


@compiled(error_model="numpy")
def invisible(boxes, k, view, keys):
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
    middle = column_of(x0 + x1, y0 + y1, view.heading, width)
    reach = (q + (0.5 * np.pi - 1) * q * q * q + ATAN_ERROR) * width / (2 * np.pi) + 1e-6
    first, last = np.ceil(middle - reach), np.floor(middle + reach)
    shift = np.floor(first / width) * width
    first, last = np.int64(first - shift), np.int64(last - shift)
    if (last - first + 1) * (bottom_row - top_row + 1) > _MAX_LOOKUPS:  # its parts may be hidden
        return (last < start) or (first >= stop and last < start + width)
    nearest = key_of(1.000001 / near, 0) + (np.int64(1) << 32)
    for around in (0, width):
        for column in range(max(first, start + around), min(last, stop - 1 + around) + 1):
            for row in range(top_row, bottom_row + 1):
                if keys[np.uintp(column - around), np.uintp(row)] <= nearest:
                    return False
    return True
