"""Loops of the CPU renderer that leave out what no ray can meet, or what is hidden. Their mathematics is in scanline.py."""

from typing import NamedTuple

import numpy as np

from .compile import compiled

LEAF = 32  # triangles in a box of the lowest level; the fastest of 16 to 64
FAN = 16  # boxes that are looked at together
MAX_STACK = 256  # boxes to visit; FAN of each fourth of 60 levels are fewer
_MAX_LOOKUPS = 4096  # pixels that are looked at to find out whether a box is hidden

# Coefficients of atan(x) / x as a polynomial in x^2 on [0, 1]. It finds candidates, which exact tests follow.
_x = np.cos(np.pi * (np.arange(200) + 0.5) / 400)
_ATAN = tuple(np.polynomial.polynomial.polyfit(_x**2, np.arctan(_x) / _x, 7).tolist())
ATAN_ERROR = 1e-6  # rad; the polynomial is within 2e-7
_ATAN_32, _HALF_TURN, _TINY = tuple(map(np.float32, _ATAN)), np.float32(np.pi), np.float32(1e-30)
_HUGE, _INF, _SLACK = np.float32(1e30), np.float32(np.inf), np.float32(1e-6)
_MORE, _BULGE = np.float32(1.000002), np.float32(0.5 * np.pi - 1)
ERROR_32 = np.float32(5e-6)  # rad; with the rounding of what columns and rows are computed from


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
def row_of(tangent, view):
    """Row (fractional) with a tangent, within ATAN_ERROR."""
    return (view.top - _atan2(tangent, 1.0)) * view.rows_per_rad - 0.5


@compiled(error_model="numpy")
def _atan2_32(y, x):
    """`_atan2` in float32, within ERROR_32 (rad)."""
    ax, ay, zero = abs(x), abs(y), np.float32(0)
    q = min(ax, ay) / (max(ax, ay) + _TINY)
    s = q * q
    end = _ATAN_32[4] + s * (_ATAN_32[5] + s * (_ATAN_32[6] + s * _ATAN_32[7]))
    angle = q * (_ATAN_32[0] + s * (_ATAN_32[1] + s * (_ATAN_32[2] + s * (_ATAN_32[3] + s * end))))
    angle = _HALF_TURN * np.float32(0.5) - angle if ay > ax else angle
    angle = _HALF_TURN - angle if x < zero else angle
    return -angle if y < zero else angle


@compiled(error_model="numpy")
def _crossing(start, start_tangent, end, end_tangent, at, pad):
    """The least and greatest tangent of an edge within pad of a column; inf and -inf where it does not get there."""
    length, zero, one = end - start, np.float32(0), np.float32(1)
    scale = one / (length if abs(length) > _TINY else _TINY)
    share, reach = (at - start) * scale, abs(pad * scale)
    near, far = max(share - reach, zero), min(share + reach, one)
    t, u = start_tangent + near * (end_tangent - start_tangent), start_tangent + far * (end_tangent - start_tangent)
    return (min(t, u), max(t, u)) if near <= far else (_INF, -_INF)


@compiled
def _in_float32(view):
    """Columns of a turn, columns in one radian, column of azimuth 0, elevation of the upper edge, and rows in one radian."""
    wide, per_rad = np.float32(view.width), np.float32(view.width / (2 * np.pi))
    turned = np.float32(view.heading - 2 * np.pi * np.floor(view.heading / (2 * np.pi)))
    middle = (_HALF_TURN + turned) * per_rad - np.float32(0.5)
    return wide, per_rad, middle, np.float32(view.top), np.float32(view.rows_per_rad)


@compiled
def _turn_of(column, wide):
    """What to take from a column (-width..2 width) so that it becomes 0..width."""
    zero = np.float32(0)
    return -wide if column < zero else (wide if column >= wide else zero)


@compiled
def _row_32(tangent, top, rows_per_rad):
    """`row_of` in float32."""
    return (top - _atan2_32(tangent, np.float32(1))) * rows_per_rad - np.float32(0.5)


@compiled(error_model="numpy")
def _find_corners(corners, n, view, work):
    """Write the columns (not wrapped) of the three corners of the triangles of a leaf, and then their tangents, into work."""
    _, per_rad, middle, _, _ = _in_float32(view)
    for k in range(3):
        for i in range(n):  # without branches, so that it is vectorised
            dx, dy = np.float32(corners[0, k, i] - view.x), np.float32(corners[1, k, i] - view.y)
            work[k * LEAF + i] = middle - _atan2_32(dy, dx) * per_rad
            work[(3 + k) * LEAF + i] = np.float32(corners[2, k, i] - view.z) / (np.sqrt(dx * dx + dy * dy) + _TINY)


@compiled(error_model="numpy")
def find_candidates(corners, n, view, work, found):
    """Find the triangles of a leaf that a ray may meet: all that one does meet, and few others.

    Along an edge, t over the azimuth is a sine, t'' = -t. So over an angle s it is within (1 / cos(s / 2) - 1) max |t| of the straight
    line between its ends, which is less than 0.15 s^2 max |t| for s < 1. Most triangles are in one column: its rays meet the triangle
    between the least and the greatest t at which edges cross it. For others the least and the greatest t of the corners must do.

    Args:
        corners: (3, 3, LEAF) see `TriangleTree`; for a tilted eye in its own frame.
        n: Triangles in the leaf.
        work: (9 * LEAF,) of float32. Some of it is to work in. The seventh LEAF numbers become the first column of each triangle
            (0..width-1), the eighth its last one (which may exceed width - 1).
        found: (LEAF,) their indices in the leaf.

    Returns:
        How many were found.
    """
    zero, one, start, stop = np.float32(0), np.float32(1), np.float32(view.start), np.float32(view.stop)
    wide, per_rad, _, top, rows_per_rad = _in_float32(view)
    pad, row_pad = ERROR_32 * per_rad + np.float32(1e-5), ERROR_32 * rows_per_rad + np.float32(1e-5)
    turns, bottom_row, half = np.float32(1 / view.width), np.float32(view.height - 1), np.float32(0.5) * wide - pad
    _find_corners(corners, n, view, work)
    for i in range(n):  # without branches, so that it is vectorised
        ca, cb, cc = work[i], work[LEAF + i], work[2 * LEAF + i]
        ab, bc, ac = cb - ca, cc - cb, cc - ca
        ab, bc, ac = ab - wide * np.rint(ab * turns), bc - wide * np.rint(bc * turns), ac - wide * np.rint(ac * turns)
        least, most = min(zero, min(ab, ac)), max(zero, max(ab, ac))
        first, last = np.ceil(ca + least - pad), np.floor(ca + most + pad)
        turn = _turn_of(first, wide)
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
        top_row = np.ceil(_row_32(high, top, rows_per_rad) - row_pad)
        last_row = np.floor(_row_32(low, top, rows_per_rad) + row_pad)
        between = ((top_row > last_row) | (top_row > bottom_row) | (last_row < zero)) & (not around)
        first, last = (zero if around else first - turn), (wide - one if around else last - turn)
        work[6 * LEAF + i], work[7 * LEAF + i] = first, last
        outside = (first > last) | ((first >= stop) & (last < start + wide)) | (last < start)
        work[8 * LEAF + i] = zero if between | outside else one
    return _marked(work[8 * LEAF :], n, found)


@compiled
def _marked(marks, n, found):
    """Write the indices of the marks that are 1, not 0, into found; how many they are."""
    count = 0
    for i in range(n):
        found[count] = i
        count += np.int64(marks[i])
    return count


@compiled(inline="always")
def key_of(nearness, label):
    """A number that orders triangles by their inverse distance (positive, rounded to float32), then by their labels."""
    return np.int64(np.float32(nearness).view(np.int32)) << 32 | label


@compiled(inline="always")
def _turned_box(boxes, k, frame, axis):
    """The least and the greatest coordinate of a box along an axis (1..3) of the frame of a tilted eye."""
    u, v, w = frame[axis, 0], frame[axis, 1], frame[axis, 2]
    x0, y0, z0 = np.float64(boxes[0, k]), np.float64(boxes[1, k]), np.float64(boxes[2, k])
    dx, dy, dz = boxes[3, k] - x0, boxes[4, k] - y0, boxes[5, k] - z0
    at = u * (x0 - frame[0, 0]) + v * (y0 - frame[0, 1]) + w * (z0 - frame[0, 2])
    low = at + min(u, 0.0) * dx + min(v, 0.0) * dy + min(w, 0.0) * dz
    high = at + max(u, 0.0) * dx + max(v, 0.0) * dy + max(w, 0.0) * dz
    empty = dx < 0.0
    return (_INF if empty else np.float32(low)), (-_INF if empty else np.float32(high))


@compiled(error_model="numpy")
def find_boxes(boxes, begin, n, view, frame, work):
    """Find out in which pixels boxes begin..begin+n-1 may be seen: all of those, and few others.

    A circle around a box, of radius r at the distance d, has the angle 2 asin(q), q = r / d; asin(q) <= q + (pi / 2 - 1) q^3.

    Args:
        work: (8 * FAN,) of float32. Its first parts of FAN numbers become the first and the last column (see `find_candidates`),
            the first and the last row, the distance of the nearest point (m) and the square of that of the middle (m^2), over the
            ground, and 1 where a pixel is left, else 0.
    """
    zero, one, start, stop = np.float32(0), np.float32(1), np.float32(view.start), np.float32(view.stop)
    x, y, z, bottom = view.x, view.y, view.z, np.float32(view.height - 1)
    wide, per_rad, middle, top, rows_per_rad = _in_float32(view)
    pad, row_pad = ERROR_32 + np.float32(1e-5), ERROR_32 * rows_per_rad + np.float32(1e-5)
    for i in range(n):  # without branches, so that it is vectorised
        k = begin + i
        if frame is None:
            x0, y0, z0 = np.float32(boxes[0, k] - x), np.float32(boxes[1, k] - y), np.float32(boxes[2, k] - z)
            x1, y1, z1 = np.float32(boxes[3, k] - x), np.float32(boxes[4, k] - y), np.float32(boxes[5, k] - z)
        else:
            x0, x1 = _turned_box(boxes, k, frame, 1)
            y0, y1 = _turned_box(boxes, k, frame, 2)
            z0, z1 = _turned_box(boxes, k, frame, 3)
        nx, ny, fx, fy = max(zero, max(x0, -x1)), max(zero, max(y0, -y1)), max(-x0, x1), max(-y0, y1)
        near, far = np.sqrt(nx * nx + ny * ny), np.sqrt(fx * fx + fy * fy)
        dx, dy, sx, sy = x1 - x0, y1 - y0, x0 + x1, y0 + y1
        away = sx * sx + sy * sy
        q = np.sqrt((dx * dx + dy * dy) / (away + _TINY)) * _MORE
        around = (near <= zero) | (q >= one)
        low, high = z0 / ((near if z0 < zero else far) + _TINY), z1 / ((near if z1 > zero else far) + _TINY)
        first_row = np.ceil(_row_32(high, top, rows_per_rad) - row_pad)
        last_row = np.floor(_row_32(low, top, rows_per_rad) + row_pad)
        first_row, last_row = (zero if around else max(first_row, zero)), (bottom if around else min(last_row, bottom))
        column, reach = middle - _atan2_32(sy, sx) * per_rad, (q + _BULGE * q * q * q + pad) * per_rad
        first, last = np.ceil(column - reach), np.floor(column + reach)
        turn = _turn_of(first, wide)
        first, last = (zero if around else first - turn), (wide - one if around else last - turn)
        outside = (first > last) | ((first >= stop) & (last < start + wide)) | (last < start)
        work[i], work[FAN + i], work[2 * FAN + i], work[3 * FAN + i] = first, last, first_row, last_row
        work[4 * FAN + i], work[5 * FAN + i] = near, away
        work[6 * FAN + i] = zero if outside | (first_row > last_row) | (x0 > x1) else one


@compiled
def push_parts(boxes, box, view, frame, work, stack, size):
    """Put the parts of a box on the stack, the nearest on top, if they may be seen.

    Args:
        box: Its index.
        work: (8 * FAN,) of float32.
        stack: (MAX_STACK, 6) of boxes: index, first and last column, first and last row, distance of the nearest point (m).
        size: Boxes on the stack.

    Returns:
        Boxes on the stack then.
    """
    begin, n = 2 * box, 2
    while n < FAN and begin < boxes.shape[1] // 2:  # parts of parts
        begin, n = 2 * begin, 2 * n
    find_boxes(boxes, begin, n, view, frame, work)
    bottom = size
    for k in range(n):
        if work[6 * FAN + k] == 0:
            continue
        away, at = work[5 * FAN + k], size
        while at > bottom and work[7 * FAN + at - 1 - bottom] < away:
            work[7 * FAN + at - bottom] = work[7 * FAN + at - 1 - bottom]
            for i in range(6):
                stack[at, i] = stack[at - 1, i]
            at -= 1
        work[7 * FAN + at - bottom], stack[at, 0] = away, begin + k
        for i in range(5):
            stack[at, 1 + i] = work[i * FAN + k]
        size += 1
    return size


@compiled(error_model="numpy")
def hidden(stack, k, view, keys):
    """Whether each pixel in which box k of the stack may be seen shows something nearer."""
    first, last = np.int64(stack[k, 1]), np.int64(stack[k, 2])
    top_row, bottom_row = np.int64(stack[k, 3]), np.int64(stack[k, 4])
    if (last - first + 1) * (bottom_row - top_row + 1) > _MAX_LOOKUPS:  # its parts may be hidden
        return False
    nearest = key_of(1.000003 / stack[k, 5], 0) + (np.int64(1) << 32)
    for around in (0, view.width):
        for column in range(max(first, view.start + around), min(last, view.stop - 1 + around) + 1):
            for row in range(top_row, bottom_row + 1):
                if keys[np.uintp(column - around), np.uintp(row)] <= nearest:
                    return False
    return True
