"""The loops that find the colours of rays and pixels for the CPU renderer (world/textures.py says what textures mean).

The mathematics of textures. A ray `d` meets a triangle (a, b, c), as seen from the eye, at a point that is a weighted mean of its
corners. So `d ~ w_a a + w_b b + w_c c`, and by Cramer's rule the weights are `w_a = d . (b x c)` and so on around, divided by their
sum. They are linear in `d`, so within a column of rays (`d = (cos az, sin az, t)`) each is a number plus t times another one.
"""

import math

import numpy as np

from . import culling_kernels
from .compile import compiled

PLAIN = -2  # in `Lookup.index`: a triangle of one colour


@compiled(inline="always")
def _cross(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@compiled(inline="always")
def _eye_of(view, frame):
    """Where the eye is in the world (m)."""
    if frame is None:
        return view.x, view.y, view.z
    return frame[0, 0], frame[0, 1], frame[0, 2]


@compiled(inline="always")
def _turned(p, frame):
    """A vector in the frame of the eye."""
    if frame is None:
        return p
    px, py, pz = p
    return (
        frame[1, 0] * px + frame[1, 1] * py + frame[1, 2] * pz,
        frame[2, 0] * px + frame[2, 1] * py + frame[2, 2] * pz,
        frame[3, 0] * px + frame[3, 1] * py + frame[3, 2] * pz,
    )


@compiled(inline="always")
def weights_along(corners, label, view, frame, cos, sin):
    """The weights of the corners of a triangle in a column of rays, up to a common factor: three numbers, then three slopes over t."""
    k = np.uintp(label)
    x, y, z = _eye_of(view, frame)
    ax, ay, az = corners[k, 0, 0] - x, corners[k, 0, 1] - y, corners[k, 0, 2] - z
    bx, by, bz = corners[k, 1, 0] - x, corners[k, 1, 1] - y, corners[k, 1, 2] - z
    cx, cy, cz = corners[k, 2, 0] - x, corners[k, 2, 1] - y, corners[k, 2, 2] - z
    px, py, pz = _cross(bx, by, bz, cx, cy, cz)
    qx, qy, qz = _cross(cx, cy, cz, ax, ay, az)
    rx, ry, rz = _cross(ax, ay, az, bx, by, bz)
    sign = 1.0 if ax * px + ay * py + az * pz > 0.0 else -1.0
    px, py, pz = _turned((px, py, pz), frame)
    qx, qy, qz = _turned((qx, qy, qz), frame)
    rx, ry, rz = _turned((rx, ry, rz), frame)
    cos, sin = sign * cos, sign * sin
    return px * cos + py * sin, qx * cos + qy * sin, rx * cos + ry * sin, sign * pz, sign * qz, sign * rz


@compiled(error_model="numpy", inline="always")
def _shares(weights, t):
    """The shares of the three corners where a ray meets a triangle; rounding on an edge leads to no texel beyond it."""
    a = max(weights[0] + t * weights[3], 0.0)
    b = max(weights[1] + t * weights[4], 0.0)
    c = max(weights[2] + t * weights[5], 0.0)
    total = a + b + c
    scale = 1.0 / total if total > 0.0 else 0.0
    return a * scale, b * scale, c * scale


@compiled(inline="always")
def _wrapped(i, n, wrap):
    """The texel 0..n-1 that stands at i: repeated (0), mirrored (1) or clamped to the edge (2)."""
    if wrap == 0:
        return i if 0 <= i < n else i % n
    if wrap == 1:
        i %= 2 * n
        return min(i, 2 * n - 1 - i)
    return min(max(i, 0), n - 1)


@compiled(inline="always")
def _mixed(at, shift):
    """A channel (0..255) of the mean of four texels: `at` has their places, and the weights across and down."""
    t0, t1, t2, t3, across, down = at
    upper = (t0 >> shift & 0xFF) * (1.0 - across) + (t1 >> shift & 0xFF) * across
    lower = (t2 >> shift & 0xFF) * (1.0 - across) + (t3 >> shift & 0xFF) * across
    return upper * (1.0 - down) + lower * down


@compiled(inline="always")
def _texel(texels, offset, width, column, row):
    return np.int64(texels[np.uintp(offset + row * width + column)])


@compiled(error_model="numpy", inline="always")
def _sample(texels, textures, k, u, v):
    """The texels around a place of texture k and their weights, see `_mixed`; all the same one where the nearest is taken."""
    offset, width, height = textures[k, 0], textures[k, 1], textures[k, 2]
    wrap_u, wrap_v, linear = textures[k, 3], textures[k, 4], textures[k, 5]
    x, y = u * width - 0.5 * linear, v * height - 0.5 * linear
    i, j = math.floor(x), math.floor(y)
    i0, j0 = _wrapped(i, width, wrap_u), _wrapped(j, height, wrap_v)
    t0 = _texel(texels, offset, width, i0, j0)
    if linear == 0:
        return t0, t0, t0, t0, 0.0, 0.0
    i1, j1 = _wrapped(i + 1, width, wrap_u), _wrapped(j + 1, height, wrap_v)
    t1, t2 = _texel(texels, offset, width, i1, j0), _texel(texels, offset, width, i0, j1)
    return t0, t1, t2, _texel(texels, offset, width, i1, j1), x - i, y - j


@compiled(error_model="numpy", inline="always")
def _place(uv, label, a, b, c):
    """Texture coordinates where the corners of a triangle have the shares a, b, c."""
    k = np.uintp(label)
    u = a * uv[k, 0, 0] + b * uv[k, 1, 0] + c * uv[k, 2, 0]
    return u, a * uv[k, 0, 1] + b * uv[k, 1, 1] + c * uv[k, 2, 1]


@compiled(inline="always")
def _of_corners(corner_colours, label, channel, a, b, c):
    """A channel (0..255) of the colour between the corners of a triangle."""
    k = np.uintp(label)
    return a * corner_colours[k, 0, channel] + b * corner_colours[k, 1, channel] + c * corner_colours[k, 2, channel]


@compiled(error_model="numpy", inline="always")
def opaque(uv, corner_colours, texels, textures, thresholds, label, k, weights, t):
    """Whether a ray meets something on a triangle with texture k, and not a hole in it."""
    a, b, c = _shares(weights, t)
    u, v = _place(uv, label, a, b, c)
    alpha = _mixed(_sample(texels, textures, np.uintp(k), u, v), 24)
    if len(corner_colours):
        alpha *= _of_corners(corner_colours, label, 3, a, b, c) / 255.0
    return alpha >= thresholds[np.uintp(k)]


@compiled(error_model="numpy", inline="always")
def _channel(at, has_texture, corner_colours, products, label, channel, a, b, c):
    """A channel of the colour of a ray, 0..255."""
    if len(corner_colours) == 0:
        return np.int64(_mixed(at, 8 * channel) + 0.5)
    corner = np.int64(_of_corners(corner_colours, label, channel, a, b, c) + 0.5)
    if not has_texture:
        return corner
    return np.int64(products[np.uintp(corner), np.uintp(np.int64(_mixed(at, 8 * channel) + 0.5))])


@compiled(error_model="numpy", inline="always")
def ray_colour(uv, corner_colours, texels, textures, products, label, k, weights, t):
    """The colour of a ray, packed as `Paint.colours` are."""
    a, b, c = _shares(weights, t)
    at = np.int64(0), np.int64(0), np.int64(0), np.int64(0), 0.0, 0.0
    if k >= 0:
        u, v = _place(uv, label, a, b, c)
        at = _sample(texels, textures, np.uintp(k), u, v)
    red = _channel(at, k >= 0, corner_colours, products, label, 0, a, b, c)
    green = _channel(at, k >= 0, corner_colours, products, label, 1, a, b, c)
    blue = _channel(at, k >= 0, corner_colours, products, label, 2, a, b, c)
    return red | green << 16 | blue << 32 | np.int64(255) << 48


@compiled(error_model="numpy", uses=(culling_kernels,))  # `view` is a type of that module
def colour_rays(lookup, colours, directions, tangents, view, frame, keys):
    """Replace the keys of columns view.start..view.stop-1 by the colours of their rays, packed as `colours` are."""
    corners, index, _, uv, corner_colours, texels, textures, _, products = lookup
    for column in range(view.start, view.stop):
        j = np.uintp(column)
        before, weights = np.int64(-1), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for row in range(view.height):
            r = np.uintp(row)
            label = keys[j, r] & 0xFFFFFFFF
            k = np.int64(index[np.uintp(label)])
            if k == PLAIN:
                keys[j, r] = colours[np.uintp(label)]
                continue
            if label != before:
                before, weights = label, weights_along(corners, label, view, frame, directions[0, j], directions[1, j])
            keys[j, r] = ray_colour(uv, corner_colours, texels, textures, products, label, k, weights, tangents[r])


@compiled
def _colour(key, colours):
    """The colour of a ray, see `Paint`."""
    if colours is None:
        return key
    return colours[np.uintp(key & 0xFFFFFFFF)]


@compiled
def average(keys, n, colours, weights, start, stop, pixels):
    """Average the n x n rays of each pixel of columns start..stop-1 by solid angle, into pixels (height, width).

    colours: by label; None where the keys are colours already.
    """
    for block in range(start, stop, 16):  # columns whose pixels share a line of memory
        for row in range(pixels.shape[0]):
            for column in range(block, min(block + 16, stop)):
                if n == 1:
                    total = _colour(keys[np.uintp(column), np.uintp(row)], colours)
                    red, green, blue, alpha = total & 0xFF, total >> 16 & 0xFF, total >> 32 & 0xFF, total >> 48
                else:
                    r = g = b = a = 0.5
                    for y in range(n):
                        total = 0
                        for x in range(n):
                            total += _colour(keys[np.uintp(column * n + x), np.uintp(row * n + y)], colours)
                        weight = weights[row, y]
                        r += weight * (total & 0xFFFF)
                        g += weight * (total >> 16 & 0xFFFF)
                        b += weight * (total >> 32 & 0xFFFF)
                        a += weight * (total >> 48)
                    red, green, blue, alpha = np.int64(r), np.int64(g), np.int64(b), np.int64(a)
                pixels[np.uintp(row), np.uintp(column)] = np.uint32(red | green << 8 | blue << 16 | alpha << 24)
