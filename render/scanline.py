"""The CPU renderer: exact equirectangular panoramas by scanlines, without a cube map, OpenGL or a display.

The mathematics, for an eye at the origin. All rays of a column have the same azimuth, so a ray is `d = (cos az, sin az, t)` with
`t = tan(elevation)`; its length does not matter.

- Coverage. An edge (a, b) of a triangle and the eye span a plane with the normal `n = a x b`. A ray passes inside the triangle where
  `n . d` has the sign of `D = a . (b x c)` for all three edges. Within a column that is linear in t, so each edge bounds t at
  `-(n_x cos az + n_y sin az) / n_z`, from below or from above by the sign of `n_z D`. The triangle covers the rows between the
  highest lower bound and the lowest upper bound. Two triangles that share an edge compute the same bound to the last bit, and
  both include it, so no ray passes between them.
- Depth. The ray meets the plane of the triangle, which has the normal `N = (b - a) x (c - a)`, at `d D / (N . d)`. So
  `(N / D) . d` is the inverse of the distance, and is linear in t, too: a depth test is one multiplication and one addition for each
  pixel. The largest inverse distance wins (rounded to float32; of equal ones, the first triangle of the world).
- What is far away or hidden. The triangles are sorted into a tree of boxes (triangle_tree.py), which is visited from near to far. A
  box is left out where no ray meets its outline (taken slightly too wide), or where each pixel that it may touch shows something
  nearer than its nearest corner. This changes no pixel, and the cost grows far more slowly than the number of triangles.

- Textures. Where a ray meets a triangle with a texture, the texel there gives its colour; a triangle with holes is nearer than
  what lies behind it only for rays that meet no hole.

Nothing is projected or interpolated: each pixel is what a ray caster finds. The loops are in scanline_kernels.py and colour_kernels.py.
"""

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from tussock.world.errors import InputError, SettingError
from tussock.world.geometry import column_azimuths
from tussock.world.scene import World
from tussock.world.textures import WRAPS, product_table

from .colour_kernels import PLAIN
from .cores import core_count
from .eye import Eye
from .poses import Poses, Views, poses_of_eye
from .scanline_kernels import draw_views
from .triangle_tree import tree_of


class Triangles(NamedTuple):
    """What the loops draw.

    Attributes:
        corners: (leaves, 3, 3, LEAF) x, y, z (m) of the three corners of each triangle, see `TriangleTree`.
        labels: (n,) a number over 0 for each triangle; of equally near ones, the one with the greatest label is seen.
        boxes: (6, m) the boxes of a `TriangleTree`, one coordinate after the other, so that loops over them are vectorised.
        cull: Whether triangles are seen from their front only.
    """

    corners: np.ndarray
    labels: np.ndarray
    boxes: np.ndarray
    cull: bool


class Rays(NamedTuple):
    """The rays of an eye.

    Attributes:
        azimuths: (width,) of the columns of rays, relative to the heading (rad).
        tangents: (height,) of the elevations of the rows of rays, which are evenly spaced.
        top: Elevation of the upper edge (rad).
        rows_per_rad: Rows of rays in one radian of elevation.
        per_pixel: Rays along each side of a pixel.
    """

    azimuths: np.ndarray
    tangents: np.ndarray
    top: float
    rows_per_rad: float
    per_pixel: int


class Paint(NamedTuple):
    """What makes pixels of rays.

    Attributes:
        colours: (n + 1,) by label, that of the sky (label 0) first: red, green, blue and alpha in 16 bits each, red lowest, so
            that one sum adds all four.
        weights: (height, per_pixel) of the rows of rays in each row of pixels, by solid angle; a row sums to 1 / per_pixel.
    """

    colours: np.ndarray
    weights: np.ndarray


class Lookup(NamedTuple):
    """Where rays find their colours in a textured world. The first arrays are by label, that of the sky first.

    Attributes:
        corners: (n + 1, 3, 3) of the triangles (m).
        index: (n + 1,) the texture; -1 for corner colours alone, PLAIN for one colour.
        holes: (n + 1,) whether some rays may pass through the triangle.
        uv: (n + 1, 3, 2) texture coordinates.
        corner_colours: (n + 1, 3, 4) see `Texturing`; (0, 3, 4) where there are none.
        texels: (texels,) of all textures, row by row: red, green, blue and alpha in 8 bits each, red lowest.
        textures: (k, 6) for each texture: where its texels begin, width, height, wrap across and down (index in WRAPS), and
            whether its texels are mixed.
        thresholds: (k,) `Texture.threshold`.
        products: `product_table`.
    """

    corners: np.ndarray
    index: np.ndarray
    holes: np.ndarray
    uv: np.ndarray
    corner_colours: np.ndarray
    texels: np.ndarray
    textures: np.ndarray
    thresholds: np.ndarray
    products: np.ndarray

    @classmethod
    def of(cls, world: World) -> "Lookup | None":
        """That of a world; None if it has no textures."""
        texturing = world.texturing
        if texturing is None:
            return None
        triangles, _ = world.surfaces()

        def by_label(values: np.ndarray, plain: int) -> np.ndarray:
            """Those of the triangles, the ground, and the sky, in the order of their labels."""
            rest = np.full((len(triangles) + 1 - len(values), *values.shape[1:]), plain, values.dtype)
            return np.ascontiguousarray(np.concatenate([values, rest])[::-1])

        colours, textures = texturing.colours, texturing.textures
        starts = np.cumsum([0] + [texture.rgba.shape[0] * texture.rgba.shape[1] for texture in textures])
        table = [
            (
                start,
                texture.rgba.shape[1],
                texture.rgba.shape[0],
                *map(WRAPS.index, texture.wrap),
                texture.filter == "linear",
            )
            for start, texture in zip(starts, textures, strict=False)
        ]
        return cls(
            corners=by_label(triangles, 0),
            index=by_label(
                np.where((texturing.index < 0) & (colours is None), PLAIN, texturing.index).astype(np.int32), PLAIN
            ),
            holes=by_label(texturing.may_have_holes(), 0),
            uv=by_label(texturing.uv, 0),
            corner_colours=np.empty((0, 3, 4), np.uint8) if colours is None else by_label(colours, 0),
            texels=np.concatenate([np.empty(0, "<u4"), *(texture.rgba.view("<u4").ravel() for texture in textures)]),
            textures=np.array(table, dtype=np.int64).reshape(-1, 6),
            thresholds=np.array([texture.threshold for texture in textures]),
            products=product_table(),
        )


class ScanlineRenderer:
    """Exact panoramas on the CPU, a `Renderer`. The views do not depend on the number of threads.

    Args:
        world: The world.
        eye: The eye.
        threads: Threads to draw with; None is one for each core that this process may run on.
    """

    backend = "cpu"

    def __init__(self, world: World, eye: Eye, threads: int | None = None):
        if threads is not None and threads < 1:
            raise SettingError(f"the renderer got {threads} threads; give at least 1, or None for every core")
        self.world, self.eye = world, eye
        _, rgb = world.surfaces()
        tree = tree_of(world)
        labels = len(rgb) - tree.order  # of equally near triangles the first is seen
        triangles = Triangles(tree.corners, labels, np.ascontiguousarray(tree.boxes.T), not world.double_sided)
        elevations = eye.elevations(eye.rays)
        rows_per_rad = len(elevations) / (eye.top - eye.bottom)
        azimuths = column_azimuths(eye.width * eye.rays)
        rays = Rays(azimuths, np.tan(elevations), eye.top, rows_per_rad, eye.rays)
        covered = np.column_stack([rgb, np.full(len(rgb), 255)])[::-1]
        colours = np.vstack([[*world.sky_rgb, 0], covered]).astype("<u2").view("<i8")[:, 0]
        weights = np.cos(elevations).reshape(eye.height, eye.rays)
        paint = Paint(colours, weights / weights.sum(axis=1, keepdims=True) / eye.rays)
        lookup = Lookup.of(world)
        self._scene = tuple(triangles), tuple(rays), tuple(paint), lookup and tuple(lookup)
        self._scratch: list[np.ndarray] = []  # memory for the keys of rays that no thread is using
        self._threads = threads or core_count()
        self._pool: ThreadPoolExecutor | None = ThreadPoolExecutor(self._threads)
        # Drawing nothing compiles the loops, or loads what was compiled.
        self._draw(np.empty((0, 4)), np.empty((0, eye.height, eye.width, 4), dtype=np.uint8), 0, eye.width)

    def __reduce__(self):
        """In another process it is opened anew."""
        return ScanlineRenderer, (self.world, self.eye, self._threads)

    def render(self, poses: Poses) -> Views:
        """See `Renderer.render`. Each thread draws some of the poses, or a strip of columns where there is only one."""
        if self._pool is None:
            raise InputError("this renderer is closed; open another one")
        poses = poses_of_eye(self.world, self.eye, poses)
        views = np.empty((len(poses), self.eye.height, self.eye.width, 4), dtype=np.uint8)
        if len(poses) == 1:
            edges = np.linspace(0, self.eye.width, self._threads + 1).astype(int).tolist()
            jobs = [(poses, views, start, stop) for start, stop in pairwise(edges) if start < stop]
        else:
            parts = zip(np.array_split(poses, self._threads), np.array_split(views, self._threads), strict=True)
            jobs = [(some, their_views, 0, self.eye.width) for some, their_views in parts if len(some)]
        others = [self._pool.submit(self._draw, *job) for job in jobs[1:]]
        for job in jobs[:1]:
            self._draw(*job)
        for other in others:
            other.result()
        return views

    def _draw(self, poses: Float[np.ndarray, "n 4"], views: Views, start: int, stop: int) -> None:
        """Draw columns start..stop-1 of the views at some poses."""
        try:
            keys = self._scratch.pop()
        except IndexError:
            keys = np.empty((self.eye.width * self.eye.rays, self.eye.height * self.eye.rays), dtype=np.int64)
        draw_views(*self._scene, poses, start, stop, keys, views.view("<u4")[..., 0])
        self._scratch.append(keys)  # fresh memory costs more than drawing a small view

    def close(self) -> None:
        """Stop the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def __enter__(self) -> "ScanlineRenderer":
        return self

    def __exit__(self, kind, error, traceback) -> None:
        self.close()
