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

- Pitch and roll. Everything is in the eye's own frame, so a tilted eye only turns the triangles first: those of the leaves that it
  may see, and the boxes around them, which become the level boxes around the turned ones. A level eye needs none of this.

- Textures. Where a ray meets a triangle with a texture, the texel there gives its colour; a triangle with holes is nearer than
  what lies behind it only for rays that meet no hole.

Nothing is projected or interpolated: each pixel is what a ray caster finds. The loops are in scanline_kernels.py and colour_kernels.py.
"""

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int64

from tussock.world.errors import InputError, SettingError
from tussock.world.scene import World

from .cores import core_count
from .eye import Eye
from .poses import AnyPoses, Views, frames_of, poses_of_eye
from .scanline_kernels import draw_views, find_hits
from .scene_arrays import Scene
from .sky import add_sky


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
        scene = Scene.of(world, eye)
        self._scene = *map(tuple, scene[:3]), scene.lookup and tuple(scene.lookup)
        self._scratch: list[np.ndarray] = []  # memory for the keys of rays that no thread is using
        self._threads = threads or core_count()
        self._pool: ThreadPoolExecutor | None = ThreadPoolExecutor(self._threads)
        # Drawing nothing compiles the loops, or loads what was compiled.
        self._draw(np.empty((0, 6)), np.empty((0, eye.height, eye.width, 4), dtype=np.uint8), 0, eye.width)

    def __reduce__(self):
        """In another process it is opened anew."""
        return ScanlineRenderer, (self.world, self.eye, self._threads)

    def render(self, poses: AnyPoses) -> Views:
        """See `Renderer.render`. Each thread draws some of the poses, or a strip of columns where there is only one."""
        if self._pool is None:
            raise InputError("this renderer is closed; open another one")
        poses = poses_of_eye(self.world, self.eye, poses)
        views = np.empty((len(poses), self.eye.height, self.eye.width, 4), dtype=np.uint8)
        tilted = poses[:, 4:].any(axis=1)
        if tilted.any() and not tilted.all():  # a level view has the same bytes among tilted ones
            for some in (tilted, ~tilted):
                views[some] = self.render(poses[some])
            return views
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

    def _draw(self, poses: Float[np.ndarray, "n 6"], views: Views, start: int, stop: int) -> None:
        """Draw columns start..stop-1 of the views at some poses, which are all level or all tilted."""
        frames = frames_of(poses) if poses[:, 4:].any() else None
        try:
            keys = self._scratch.pop()
        except IndexError:
            keys = np.empty((self.eye.width * self.eye.rays, self.eye.height * self.eye.rays), dtype=np.int64)
        draw_views(*self._scene, poses, frames, start, stop, keys, views.view("<u4")[..., 0])
        add_sky(self.world, self.eye, poses, views, start, stop)
        self._scratch.append(keys)  # fresh memory costs more than drawing a small view

    def hits(self, poses: AnyPoses) -> tuple[Float[np.ndarray, "n height width"], Int64[np.ndarray, "n height width"]]:
        """What each pixel shows, for an eye with one ray a pixel.

        Returns:
            How far away it is (m), inf for the sky; and which triangle of `World.surfaces` it is, -1 for the sky.
        """
        if self.eye.rays != 1:
            raise SettingError(f"hits are of single rays, and this eye has {self.eye.rays} in a pixel; give samples=1")
        eyes, (width, height) = poses_of_eye(self.world, self.eye, poses), (self.eye.width, self.eye.height)
        keys = np.empty((width, height), dtype=np.int64)
        triangles, rays, _, lookup = self._scene
        away, label = np.empty((len(eyes), height, width)), np.empty((len(eyes), height, width), dtype=np.int64)
        for k in range(len(eyes)):
            frame = frames_of(eyes[k : k + 1])[0] if eyes[k, 4:].any() else None
            find_hits(triangles, rays, lookup, eyes[k], frame, keys)
            nearness = (
                (keys >> 32).astype(np.int32).view(np.float32)
            )  # the inverse distance along the first two axes of the eye
            with np.errstate(divide="ignore"):
                away[k] = (1 / nearness / np.cos(self.eye.elevations())).T
            label[k] = (keys & 0xFFFFFFFF).T
        surfaces = len(self.world.surfaces()[0])
        return away, np.where(label == 0, -1, surfaces - label)

    def close(self) -> None:
        """Stop the threads."""
        if self._pool is not None:
            self._pool.shutdown()
            self._pool = None

    def __enter__(self) -> "ScanlineRenderer":
        return self

    def __exit__(self, kind, error, traceback) -> None:
        self.close()
