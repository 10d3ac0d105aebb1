"""The loops of the CUDA renderer: those of scanline_kernels.py for a GPU, with the same mathematics (scanline.py) and the same functions.

A GPU has no need of the tree: `draw_narrow` has a thread for each triangle of each view. It draws triangles of few columns, and leaves the
others to `draw_wide`, which has a block of threads for each of them. Threads that meet in a ray keep the greatest key, in any order;
so the views do not depend on the order. `average` has a thread for each pixel.
"""

import inspect
import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import cuda as numba_cuda

from .colour_kernels import PLAIN, opaque, ray_colour, weights_along
from .compile import SIMULATED
from .culling_kernels import ATAN_ERROR, ERROR_32, LEAF, View, key_of, row_of
from .scanline_kernels import bound, corner, covered, cross, depth_plane

cuda: Any = numba_cuda  # its types are those of Python, not of kernels
THREADS = 128  # in a block
NARROW = 8  # columns that one thread draws


def _kernel(function: Callable) -> Any:
    """Decorator for what the CPU starts on the GPU."""
    return cuda.jit(inspect.unwrap(function))  # the function itself, not a type checker around it


def _device(function: Callable) -> Any:
    """Decorator for what such functions call."""
    return cuda.jit(inspect.unwrap(function), device=True)


@_device
def _plus_product(total, weight, value):
    """Rounded after each operation, as on the CPU: a GPU would round once, and take the other colour where a mean is a half."""
    if SIMULATED:  # which has no functions of the library
        return total + weight * value
    return cuda.libdevice.dadd_rn(total, cuda.libdevice.dmul_rn(weight, value))


@_device
def _view_of(eyes, numbers, v):
    top, rows_per_rad, width, height = numbers
    return View(eyes[v, 0], eyes[v, 1], eyes[v, 3], eyes[v, 2], top, rows_per_rad, width, height, 0, width)


def _tilting(tilted: bool) -> tuple[Any, Any]:
    """`corner` and `weights_along` for the eye of a view, which is level or tilted. A tilted one sees along its own axes, `frames[v]`."""

    @_device
    def corner_of(corners, k, i, view, frames, v):
        x, y, z = corner(corners, k, i, view)
        if tilted:
            ahead, left, up = frames[v, 1], frames[v, 2], frames[v, 3]
            return (
                ahead[0] * x + ahead[1] * y + ahead[2] * z,
                left[0] * x + left[1] * y + left[2] * z,
                up[0] * x + up[1] * y + up[2] * z,
            )
        return x, y, z

    @_device
    def weights_of(corners, label, view, frames, v, cos, sin):
        if tilted:
            return weights_along(corners, label, view, frames[v], cos, sin)
        return weights_along(corners, label, view, None, cos, sin)

    return corner_of, weights_of


@_device
def _apart(azimuth, other):
    """How far an azimuth lies from another one (rad)."""
    turn = np.float32(2 * math.pi)
    apart = azimuth - other
    return apart - turn * (
        np.float32(1) if apart > turn / 2 else np.float32(-1) if apart < -turn / 2 else np.float32(0)
    )


@_device
def _columns(a, b, c, view):
    """The first column (0..width-1) that a triangle may be in, and the last one, which may exceed width - 1.

    See `find_candidates`.
    """
    az_a = math.atan2(np.float32(a[1]), np.float32(a[0]))
    az_b = math.atan2(np.float32(b[1]), np.float32(b[0]))
    az_c = math.atan2(np.float32(c[1]), np.float32(c[0]))
    ab, bc, ac = _apart(az_b, az_a), _apart(az_c, az_b), _apart(az_c, az_a)
    half = np.float32(math.pi) - ERROR_32
    if abs(ab) > half or abs(bc) > half or abs(ac) > half or abs(ab + bc - ac) > np.float32(1):
        return 0, view.width - 1  # above or below the eye, or nearly so
    per_rad, pad = view.width / (2 * math.pi), ERROR_32 * view.width / (2 * math.pi)
    middle = (math.pi + view.heading - az_a) * per_rad - 0.5
    first = math.ceil(middle - max(0.0, ab, ac) * per_rad - pad)
    last = math.floor(middle - min(0.0, ab, ac) * per_rad + pad)
    turn = math.floor(first / view.width) * view.width
    return first - turn, last - turn


@_kernel
def clear(keys, queued):
    """Make all keys those of the sky, and the queue empty."""
    p, v = cuda.grid(1), cuda.blockIdx.y
    if p < keys.shape[1] * keys.shape[2]:
        keys[v, p // keys.shape[2], p % keys.shape[2]] = 0
    if p == 0 and v == 0:
        queued[0] = 0


@_device
def _set_up(a, b, c, cull):
    """Whether a triangle is seen from its front or, without `cull`, its back; its edges and its plane of depth."""
    nx, ny, nz = cross(b, c)
    volume = a[0] * nx + a[1] * ny + a[2] * nz
    seen = abs(volume) >= 1e-200 and not (cull and volume > 0.0)
    volume = volume if seen else 1.0
    return seen, (bound(a, b, volume), bound(b, c, volume), bound(c, a, volume)), depth_plane(a, b, c, volume)


def _column_drawer(textured: bool, tilted: bool) -> Any:
    """A function that draws a triangle, set up, in one column of a view."""
    _, weights_of = _tilting(tilted)

    @_device
    def draw_column(edges, plane, column, v, label, view, frames, directions, tangents, lookup, keys):
        cos, sin = directions[v, 0, column], directions[v, 1, column]
        low, high = covered(edges[0], edges[1], edges[2], cos, sin)
        if low > high:
            return
        pad, height = 1e-6 + ATAN_ERROR * view.rows_per_rad, view.height
        first = int(min(max(math.ceil(row_of(high, view) - pad), 0.0), float(height)))
        last = int(min(max(math.floor(row_of(low, view) + pad), -1.0), height - 1.0))
        while first < height and tangents[first] > high:
            first += 1
        while last >= 0 and tangents[last] < low:
            last -= 1
        base, slope = plane[0] * cos + plane[1] * sin, plane[2]
        if textured:
            corners, index, holes, uv, corner_colours, texels, textures, thresholds, _ = lookup
            has_holes, k, weights = holes[label], index[label], weights_of(corners, label, view, frames, v, cos, sin)
        for row in range(first, last + 1):
            t, key = tangents[row], key_of(base + slope * tangents[row], label)
            if key <= keys[v, column, row]:
                continue
            if textured:  # noqa: SIM102 (numba leaves the inner part out)
                if has_holes and not opaque(uv, corner_colours, texels, textures, thresholds, label, k, weights, t):
                    continue
            cuda.atomic.max(keys, (v, column, row), key)

    return draw_column


@cache
def drawing_kernels(textured: bool, tilted: bool) -> tuple[Any, Any]:
    """`draw_narrow` and `draw_wide`, for worlds with or without textures, and for level or tilted eyes.

    Their arguments: `blocks`, `labels` and `cull`, of `Triangles`; `numbers`, the upper edge (rad), rows of rays in one radian, columns
    and rows of rays; `tangents`, of `Rays`; `eyes` (n, 4), x (m), y (m), heading (rad, 0 for tilted eyes) and height (m); `frames`
    (n, 4, 3) as in `draw_views`, (0, 4, 3) for level eyes; `directions` (n, 2, width), cosines and sines of the azimuths of the columns,
    in the world or in the frame of a tilted eye; `lookup`, as `Lookup`, () in a plain world; `keys` (n, width, height) of rays, see
    `key_of`; `queue` (m,), wide triangles, each as the number of its view times the number of triangles plus its own number; and how many
    they are, `queued` (1,).
    """
    draw_column, (corner_of, _) = _column_drawer(textured, tilted), _tilting(tilted)

    @_device
    def corners_of(blocks, i, view, frames, v):
        """The corners of triangle i."""
        corners, k = blocks[i // LEAF], i % LEAF
        return (
            corner_of(corners, 0, k, view, frames, v),
            corner_of(corners, 1, k, view, frames, v),
            corner_of(corners, 2, k, view, frames, v),
        )

    @_device
    def draw(a, b, c, first, last, step, v, view, frames, label, cull, tangents, directions, lookup, keys):
        """Draw a triangle in every `step`-th column from `first` to `last`."""
        seen, edges, plane = _set_up(a, b, c, cull)
        if seen:
            for column in range(first, last + 1, step):
                at = column - view.width if column >= view.width else column
                draw_column(edges, plane, at, v, label, view, frames, directions, tangents, lookup, keys)

    @_kernel
    def draw_narrow(blocks, labels, cull, numbers, tangents, eyes, frames, directions, lookup, keys, queue, queued):
        i, v = cuda.grid(1), cuda.blockIdx.y
        if i >= len(labels):
            return
        view = _view_of(eyes, numbers, v)
        a, b, c = corners_of(blocks, i, view, frames, v)
        first, last = _columns(a, b, c, view)
        if last - first >= NARROW:
            number = cuda.atomic.add(queued, 0, 1)
            if number < len(queue):
                queue[number] = v * len(labels) + i
                return
        draw(a, b, c, first, last, 1, v, view, frames, labels[i], cull, tangents, directions, lookup, keys)

    @_kernel
    def draw_wide(blocks, labels, cull, numbers, tangents, eyes, frames, directions, lookup, keys, queue, queued):
        for number in range(cuda.blockIdx.x, min(queued[0], len(queue)), cuda.gridDim.x):
            v, i = queue[number] // len(labels), queue[number] % len(labels)
            view = _view_of(eyes, numbers, v)
            a, b, c = corners_of(blocks, i, view, frames, v)
            first, last = _columns(a, b, c, view)
            first, step = first + cuda.threadIdx.x, cuda.blockDim.x
            draw(a, b, c, first, last, step, v, view, frames, labels[i], cull, tangents, directions, lookup, keys)

    return draw_narrow, draw_wide


@cache
def averaging_kernel(textured: bool, tilted: bool) -> Any:
    """`average`, which makes pixels (n, height, width) of keys, for worlds with or without textures, and for level or tilted eyes.

    Its arguments: see `drawing_kernels`; `rays` along each side of a pixel; `colours` and `weights` of `Paint`.
    """
    _, weights_of = _tilting(tilted)

    @_device
    def colour(key, lookup, colours, view, frames, v, cos, sin, t):
        label = key & 0xFFFFFFFF
        if textured:
            corners, index, _, uv, corner_colours, texels, textures, _, products = lookup
            k = np.int64(index[label])
            if k != PLAIN:
                shares = weights_of(corners, label, view, frames, v, cos, sin)
                return ray_colour(uv, corner_colours, texels, textures, products, label, k, shares, t)
        return colours[label]

    @_kernel
    def average(numbers, tangents, eyes, frames, directions, lookup, keys, rays, colours, weights, pixels):
        p, v = cuda.grid(1), cuda.blockIdx.y
        if p >= pixels.shape[1] * pixels.shape[2]:
            return
        view, row, column = _view_of(eyes, numbers, v), p // pixels.shape[2], p % pixels.shape[2]
        r = g = b = a = 0.5
        for i in range(row * rays, (row + 1) * rays):
            total, weight = np.int64(0), weights[row, i - row * rays]
            for j in range(column * rays, (column + 1) * rays):
                cos, sin = directions[v, 0, j], directions[v, 1, j]
                total += colour(keys[v, j, i], lookup, colours, view, frames, v, cos, sin, tangents[i])
            r = _plus_product(r, weight, float(total & 0xFFFF))
            g = _plus_product(g, weight, float(total >> 16 & 0xFFFF))
            b = _plus_product(b, weight, float(total >> 32 & 0xFFFF))
            a = _plus_product(a, weight, float(total >> 48))
        pixels[v, row, column] = np.uint32(int(r) | int(g) << 8 | int(b) << 16 | int(a) << 24)

    return average
