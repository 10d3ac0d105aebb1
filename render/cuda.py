"""The CUDA renderer: the panoramas of the CPU renderer (scanline.py), on an NVIDIA GPU.

Both use the same functions, so that a view is the same but for rounding: the GPU rounds a product and a sum at once. So a ray that meets an
edge exactly may pass between two triangles there, of two surfaces that are equally near the other one may be seen, and a channel of a
texture may be 1 off. In the tests, and in 1,536 views of generated worlds, no byte differed.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from threading import Lock
from typing import Any

import numpy as np
from jaxtyping import Float

from tussock.world.errors import InputError, MissingDependencyError
from tussock.world.scene import World

from .compile import SIMULATED, config
from .eye import Eye
from .poses import AnyPoses, Views, frames_of, poses_of_eye
from .scanline_kernels import find_directions
from .scene_arrays import Scene
from .sky import add_sky

RAYS, VIEWS = 2**26, 2**15  # drawn at once, at most; a ray takes 8 bytes of the GPU's memory, and a column 16
WIDE = (
    2**20
)  # triangles of many columns that blocks of threads draw in a batch; further ones are drawn by one thread each
BLOCKS = 4096  # of threads that draw wide triangles


class CudaRenderer:
    """Panoramas on an NVIDIA GPU, a `Renderer`.

    Args:
        world: The world.
        eye: The eye.

    Raises:
        MissingDependencyError: Such a GPU, its driver or numba-cuda is missing.
        InputError: Its memory is too small.
    """

    backend = "cuda"

    def __init__(self, world: World, eye: Eye):
        cuda = _cuda()
        from .cuda_kernels import THREADS

        self.world, self.eye, self._cuda, self._lock = world, eye, cuda, Lock()
        scene = Scene.of(world, eye)
        self._textured, self._threads = scene.lookup is not None, THREADS
        triangles, rays, lookup = scene.triangles, scene.rays, scene.lookup or ()
        size = len(rays.azimuths), len(rays.tangents)
        self._azimuths, self._numbers = rays.azimuths, (rays.top, rays.rows_per_rad, *size)
        with _enough_memory():
            self._triangles: Any = cuda.to_device(triangles.corners), cuda.to_device(triangles.labels), triangles.cull
            self._tangents, self._lookup = cuda.to_device(rays.tangents), tuple(map(cuda.to_device, lookup))
            self._paint: Any = rays.per_pixel, *map(cuda.to_device, scene.paint)
        self._batch = min(max(1, RAYS // (size[0] * size[1])), VIEWS)
        self._memory: Any = None  # of a batch on the GPU: keys, pixels, and wide triangles

    def __reduce__(self):
        """In another process it is opened anew."""
        return CudaRenderer, (self.world, self.eye)

    def render(self, poses: AnyPoses) -> Views:
        """See `Renderer.render`. Threads take turns.

        Raises:
            InputError: Also where the memory of the GPU is too small.
        """
        eyes = poses_of_eye(self.world, self.eye, poses)
        views = np.empty((len(eyes), self.eye.height, self.eye.width, 4), dtype=np.uint8)
        tilted = eyes[:, 4:].any(axis=1)
        if tilted.any() and not tilted.all():  # a level view has the same bytes among tilted ones
            for some in (tilted, ~tilted):
                views[some] = self.render(eyes[some])
            return views
        with self._lock, _enough_memory():
            if self._triangles is None:
                raise InputError("this renderer is closed; open another one")
            for begin in range(0, len(eyes), self._batch):
                batch = slice(begin, begin + self._batch)
                self._draw(eyes[batch], views[batch])
        add_sky(self.world, self.eye, eyes, views)
        return views

    def _draw(self, eyes: Float[np.ndarray, "n 6"], views: Views) -> None:
        """Draw one batch of views."""
        from .cuda_kernels import averaging_kernel, clear, drawing_kernels

        cuda, threads, n, (*_, columns, rows) = self._cuda, self._threads, len(eyes), self._numbers
        frames, tilted = np.empty((0, 4, 3)), bool(eyes[:, 4:].any())
        if tilted:
            frames = frames_of(eyes)
            eyes = eyes * [1, 1, 0, 1, 0, 0]  # in its own frame an eye faces along the first axis
        (narrow, wide), average = drawing_kernels(self._textured, tilted), averaging_kernel(self._textured, tilted)
        directions = np.empty((n, 2, columns))
        for heading, of_view in zip(eyes[:, 2], directions, strict=True):
            find_directions(self._azimuths, heading, of_view)
        if self._memory is None or len(self._memory[0]) < n:
            self._memory = None  # the former memory is free before more is taken
            pixels = cuda.device_array((n, self.eye.height, self.eye.width), np.uint32)
            keys = cuda.device_array((n, columns, rows), np.int64)
            self._memory = keys, pixels, cuda.device_array(WIDE, np.int64), cuda.device_array(1, np.int64)
        keys, pixels, queue, queued = self._memory
        keys, pixels = keys[:n], pixels[:n]
        clear[(-(-columns * rows // threads), n), threads](keys, queued)
        where = (
            self._numbers,
            self._tangents,
            cuda.to_device(np.ascontiguousarray(eyes[:, :4])),
            cuda.to_device(frames),
            cuda.to_device(directions),
            self._lookup,
            keys,
        )
        triangles = len(self._triangles[1])
        if triangles:
            narrow[(-(-triangles // threads), n), threads](*self._triangles, *where, queue, queued)
            wide[BLOCKS, threads](*self._triangles, *where, queue, queued)
        average[(-(-pixels[0].size // threads), n), threads](*where, *self._paint, pixels)
        pixels.copy_to_host(views.view("<u4")[..., 0])

    def close(self) -> None:
        """Free the memory on the GPU."""
        with self._lock:
            self._triangles = self._tangents = self._lookup = self._paint = self._memory = None

    def __enter__(self) -> "CudaRenderer":
        return self

    def __exit__(self, kind, error, traceback) -> None:
        self.close()


def _cuda() -> Any:
    """The module numba.cuda. Raises MissingDependencyError where it cannot be used."""
    if find_spec("numba_cuda") is None and not SIMULATED:
        raise MissingDependencyError(
            "the cuda renderer needs numba-cuda; install it with pip install 'tussock[cuda]', or use the cpu renderer"
        )
    from numba import cuda

    config.CUDA_LOW_OCCUPANCY_WARNINGS = 0  # they advise to start larger jobs, and one view is a small one
    if not cuda.is_available():
        reason = " ".join(str(cuda.cuda_error() or "its compiler NVVM is missing: pip install 'tussock[cuda]'").split())
        raise MissingDependencyError(
            f"the cuda renderer needs an NVIDIA GPU and its driver ({reason}); use the cpu renderer"
        )
    return cuda


@contextmanager
def _enough_memory() -> Iterator[None]:
    """Within the block, too little memory of the GPU is an InputError."""
    try:
        yield
    except Exception as error:  # numba's own class depends on its version
        if "OUT_OF_MEMORY" not in str(error):
            raise
        raise InputError(
            "the GPU has too little free memory for these views; close what else uses it, or use the cpu renderer"
        ) from error
