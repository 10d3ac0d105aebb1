"""The interface of the renderers, and how to open one."""

from typing import Protocol, runtime_checkable

from tussock.world.errors import SettingError
from tussock.world.scene import World

from .backends import BACKENDS
from .eye import Eye
from .poses import AnyPoses, Views


@runtime_checkable
class Renderer(Protocol):
    """Draws panoramas of one world through one eye.

    Attributes:
        world: The world.
        eye: The eye.
        backend: Name of the renderer: "cpu", "cuda", "egl" or "osmesa".
    """

    world: World
    eye: Eye
    backend: str

    def render(self, poses: AnyPoses) -> Views:
        """Draw the panoramas at some poses. Several threads may call this at once, as a recording does while its walk goes on.

        Args:
            poses: (n, 3) x (m), y (m) and heading (rad) of level eyes that stand on the ground, or (n, 6) full poses, which go on
                with z (m), pitch and roll (rad), see `FullPose`.

        Returns:
            (n, height, width, 4) red, green, blue and alpha. Colour is the average over the solid angle of a pixel, the sky
            included. Alpha is the share of the pixel that something covers: 255 all of it, 0 open sky.

        Raises:
            InputError: A pose is not finite or beyond MAX_COORDINATE, or the renderer is closed.
        """
        ...

    def close(self) -> None:
        """Free what the renderer holds; it cannot be used afterwards."""
        ...

    def __enter__(self) -> "Renderer": ...

    def __exit__(self, kind, error, traceback) -> None: ...


def open_renderer(
    world: World, eye: Eye | None = None, backend: str = "auto", *, threads: int | None = None
) -> Renderer:
    """Open a renderer, for a `with` statement.

    Args:
        world: The world.
        eye: The eye; None is the default `Eye`.
        backend: "cpu" (exact), "cuda" (the same but for rounding, on an NVIDIA GPU: for many views at once), "egl" or "osmesa" (OpenGL
            through pyrender), or "auto": the CPU renderer, which begins at once, and is faster than OpenGL on every machine measured so
            far (docs/performance.md). `Renderer.backend` is the one chosen.
        threads: Threads of the CPU renderer; None uses every core that this process may run on. The others decide themselves.

    Raises:
        SettingError: The renderer's name is unknown.
        MissingDependencyError: A library or driver is missing; the message names what to install.
    """
    check_backend(backend)
    eye = eye or Eye()
    # Loading numba takes most of a second, and pyrender binds the process to one OpenGL library.
    if backend in ("auto", "cpu"):
        from .scanline import ScanlineRenderer

        return ScanlineRenderer(world, eye, threads)
    if backend == "cuda":
        from .cuda import CudaRenderer

        return CudaRenderer(world, eye)
    from .raster import RasterRenderer

    return RasterRenderer(world, eye, backend)


def check_backend(backend: str) -> None:
    """Refuse a name that is not a renderer's. Raises SettingError."""
    if backend not in BACKENDS:
        raise SettingError(f"unknown renderer {backend!r}; the renderers are {', '.join(BACKENDS)}")
