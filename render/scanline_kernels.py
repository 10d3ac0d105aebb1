"""The loops of the CPU renderer. Their mathematics is in scanline.py.

colour_kernels.py has what makes colours of their keys; functions that call it say so, because numba notices a change in the file of a
function, but not in the files of those that it calls. `lookup` is None in a plain world, and `frame` for a level eye: numba compiles the
loops anew for these, without the parts for textures or for turning. Arrays are passed on one by one, because numba counts the references
to each array of a tuple.
"""

import numpy as np

from . import colour_kernels, culling_kernels
from .colour_kernels import average, colour_rays, opaque, weights_along
from .compile import compiled
from .culling_kernels import ATAN_ERROR, FAN, LEAF, MAX_STACK, View, find_candidates, hidden, key_of, push_parts, row_of

_SPANS = 512  # spans that are collected before they are drawn


@compiled(inline="always")
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled(inline="always")
def corner(corners, k, i, view):
    """Corner k of triangle i, seen from the eye."""
    return corners[0, k, i] - view.x, corners[1, k, i] - view.y, corners[2, k, i] - view.z


@compiled
def _turn_corners(corners, frame, turned):
    """Write the corners of a leaf in the frame of a tilted eye, which is at its origin, into turned (3, 3, LEAF)."""
    for k in range(3):
        for axis in range(3):
            x, y, z = frame[1 + axis]
            for i in range(LEAF):  # without branches, so that it is vectorised
                dx, dy, dz = (
                    corners[0, k, i] - frame[0, 0],
                    corners[1, k, i] - frame[0, 1],
                    corners[2, k, i] - frame[0, 2],
                )
                turned[axis, k, i] = x * dx + y * dy + z * dz


@compiled(error_model="numpy", inline="always")
def bound(a, b, volume):
    """The bound p cos az + q sin az + (low or high) on t by the edge (a, b). A bound from below has high = inf, others low = -inf."""
    nx, ny, nz = cross(a, b)
    upright = abs(nz) < 1e-200  # then the bound is about +-1e200 and allows all of a column or nothing ..
    nz = 1e-200 if upright else nz
    slack = 1e150 if upright else 0.0  # .. but all of a column that lies in the plane
    below = (nz > 0.0) == (volume > 0.0)
    scale = -1.0 / nz
    return scale * nx, scale * ny, -slack if below else -np.inf, np.inf if below else slack


@compiled(inline="always")
def covered(ab, bc, ca, cos, sin):
    """The least and the greatest t in a column between the bounds of three edges; the triangle is not in it where least > greatest."""
    t0, t1, t2 = ab[0] * cos + ab[1] * sin, bc[0] * cos + bc[1] * sin, ca[0] * cos + ca[1] * sin
    return max(t0 + ab[2], t1 + bc[2], t2 + ca[2]), min(t0 + ab[3], t1 + bc[3], t2 + ca[3])


@compiled(error_model="numpy", inline="always")
def depth_plane(a, b, c, volume):
    """The vector whose product with a ray is the inverse distance."""
    # It is also the sum of the edges' normals, but only the differences of corners give it precisely.
    gx, gy, gz = cross((b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2]))
    scale = 1.0 / volume
    return gx * scale, gy * scale, gz * scale


@compiled(error_model="numpy", uses=(colour_kernels, culling_kernels))
def _draw_spans(count, pairs, spans, directions, tangents, view, frame, keys, lookup):
    """Draw `count` spans of rows, see `_draw`."""
    lows, highs, bases, slopes, first_rows, last_rows = spans[0], spans[1], spans[2], spans[3], spans[4], spans[5]
    pad, height = 1e-6 + ATAN_ERROR * view.rows_per_rad, view.height
    if lookup is not None:
        corners, index, holes, uv, corner_colours, texels, textures, thresholds, _ = lookup
    for s in range(count):  # without branches, so that it is vectorised
        first_rows[s] = np.ceil(row_of(highs[s], view) - pad)
        last_rows[s] = np.floor(row_of(lows[s], view) + pad)
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
                weights = weights_along(corners, label, view, frame, directions[0, j], directions[1, j])
                for row in range(first, last + 1):
                    r = np.uintp(row)
                    t, key = tangents[r], key_of(base + slope * tangents[r], label)
                    if key > keys[j, r] and opaque(
                        uv, corner_colours, texels, textures, thresholds, label, k, weights, t
                    ):
                        keys[j, r] = key
                continue
        for row in range(first, last + 1):
            r = np.uintp(row)
            keys[j, r] = max(keys[j, r], key_of(base + slope * tangents[r], label))


@compiled(error_model="numpy", uses=(colour_kernels, culling_kernels))
def _draw_leaf(corners, labels, cull, memory, directions, tangents, view, frame, keys, lookup):
    """Draw the triangles of a leaf, which have these labels, see `_draw`."""
    work, found, pairs, spans = memory
    width, start, stop = view.width, view.start, view.stop
    candidates = find_candidates(corners, len(labels), view, work, found)
    count = np.int64(0)  # not a literal, for which numba would compile another `_draw_spans`
    for k in range(candidates):
        i = found[k]
        first, last = np.int64(work[6 * LEAF + i]), np.int64(work[7 * LEAF + i])
        a, b, c = corner(corners, 0, i, view), corner(corners, 1, i, view), corner(corners, 2, i, view)
        nx, ny, nz = cross(b, c)
        volume = a[0] * nx + a[1] * ny + a[2] * nz
        if abs(volume) < 1e-200 or (cull and volume > 0.0):  # seen from its edge, or from its back
            continue
        ab, bc, ca = bound(a, b, volume), bound(b, c, volume), bound(c, a, volume)
        gx, gy, gz = depth_plane(a, b, c, volume)
        if last < width:
            first, last = max(first, start), min(last, stop - 1)
        for column in range(first, last + 1):
            wrapped = column - width if column >= width else column
            cos, sin = directions[0, np.uintp(wrapped)], directions[1, np.uintp(wrapped)]
            low, high = covered(ab, bc, ca, cos, sin)
            pairs[0, count], pairs[1, count] = wrapped, labels[i]
            spans[0, count], spans[1, count], spans[2, count], spans[3, count] = low, high, gx * cos + gy * sin, gz
            count += (low <= high) & (wrapped >= start) & (wrapped < stop)
            if count == _SPANS:
                _draw_spans(count, pairs, spans, directions, tangents, view, frame, keys, lookup)
                count = 0
    _draw_spans(count, pairs, spans, directions, tangents, view, frame, keys, lookup)


@compiled(error_model="numpy", uses=(colour_kernels, culling_kernels))
def _draw(triangles, directions, tangents, view, frame, keys, lookup):
    """Draw all triangles. Boxes are visited from near to far, so that near ones hide far ones.

    directions: (2, width) cosines and sines of the azimuths of the columns. Spans are collected and drawn together; each has
    a column and a label (pairs), least and greatest tangent, base and slope of the inverse distance, and two rows to work in (spans).
    """
    blocks, labels, boxes, cull = triangles
    leaves = boxes.shape[1] // 2
    memory = (
        np.empty(9 * LEAF, np.float32),
        np.empty(LEAF, np.int64),
        np.empty((2, _SPANS), np.int64),
        np.empty((6, _SPANS)),
    )
    parts, stack, turned = np.empty(8 * FAN, np.float32), np.empty((MAX_STACK, 6)), np.empty((3, 3, LEAF))
    stack[0], size = (1, 0, view.width - 1, 0, view.height - 1, 0), 1  # the box of all
    while size:
        size -= 1
        if hidden(stack, size, view, keys):
            continue
        box = np.int64(stack[size, 0])
        if box < leaves:
            size = push_parts(boxes, box, view, frame, parts, stack, size)
            continue
        leaf = box - leaves
        of_leaf = labels[leaf * LEAF : (leaf + 1) * LEAF]
        if frame is None:
            _draw_leaf(blocks[leaf], of_leaf, cull, memory, directions, tangents, view, frame, keys, lookup)
        else:
            _turn_corners(blocks[leaf], frame, turned)
            _draw_leaf(turned, of_leaf, cull, memory, directions, tangents, view, frame, keys, lookup)


@compiled
def find_directions(azimuths, heading, directions):
    """Write the cosines and sines of the azimuths of columns in the world, relative to the heading (rad), into directions (2, width)."""
    for j in range(len(azimuths)):  # by elements: numba compiles a check of shapes, with its message, for 2 s
        directions[0, j], directions[1, j] = np.cos(azimuths[j] + heading), np.sin(azimuths[j] + heading)


@compiled(uses=(colour_kernels, culling_kernels))
def find_hits(triangles, rays, lookup, pose, frame, keys):
    """Write the `key_of` of what each ray of a view meets into keys (width, height). The arguments are those of `draw_views`."""
    azimuths, tangents, top, rows_per_rad, _ = rays
    width, height = keys.shape
    directions = np.empty((2, width))
    if frame is None:
        view = View(pose[0], pose[1], pose[3], pose[2], top, rows_per_rad, width, height, 0, width)
    else:
        view = View(0.0, 0.0, 0.0, 0.0, top, rows_per_rad, width, height, 0, width)
    find_directions(azimuths, view.heading, directions)
    keys[:] = 0
    _draw(triangles, directions, tangents, view, frame, keys, lookup)


@compiled(uses=(colour_kernels, culling_kernels))
def _draw_view(triangles, rays, paint, lookup, view, frame, directions, keys, pixels):
    """Draw one view, see `draw_views`. frame: that of a tilted eye, or None."""
    azimuths, tangents, _, _, n = rays
    colours, weights = paint
    find_directions(azimuths, view.heading, directions)
    keys[view.start : view.stop] = 0
    _draw(triangles, directions, tangents, view, frame, keys, lookup)
    if lookup is None:
        average(keys, n, colours, weights, view.start // n, view.stop // n, pixels)
    else:
        colour_rays(lookup, colours, directions, tangents, view, frame, keys)
        average(keys, n, None, weights, view.start // n, view.stop // n, pixels)


@compiled(uses=(colour_kernels, culling_kernels))
def draw_views(triangles, rays, paint, lookup, poses, frames, start, stop, keys, views):
    """Draw columns start..stop-1 of views.

    Args:
        triangles, rays, paint: `Triangles`, `Rays` and `Paint` as plain tuples, which numba accepts faster.
        lookup: `Lookup` likewise; None in a plain world.
        poses: (n, 6) x (m), y (m), heading (rad), height (m), pitch and roll (rad) of the eye.
        frames: (n, 4, 3) of tilted eyes: position (m), and the directions ahead, left and up. None for level ones.
        start, stop: Columns of pixels.
        keys: (width, height) of rays, int64, to work in: the `key_of` of the nearest triangle so far, 0 for the sky.
        views: (n, height, width) of pixels, which become red, green, blue and alpha in 8 bits each, red lowest.
    """
    _, _, top, rows_per_rad, n = rays
    width, height = keys.shape
    directions = np.empty((2, width))
    for i in range(len(poses)):
        if frames is None:
            x, y, heading, z = poses[i, 0], poses[i, 1], poses[i, 2], poses[i, 3]
            view = View(x, y, z, heading, top, rows_per_rad, width, height, start * n, stop * n)
            _draw_view(triangles, rays, paint, lookup, view, None, directions, keys, views[i])
        else:  # what is seen is turned into the frame of the eye
            view = View(0.0, 0.0, 0.0, 0.0, top, rows_per_rad, width, height, start * n, stop * n)
            _draw_view(triangles, rays, paint, lookup, view, frames[i], directions, keys, views[i])
