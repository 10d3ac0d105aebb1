"""What a renderer is, and how to open one."""

from collections.abc import Sequence
from types import TracebackType
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.errors import InputError
from tussock.world.geometry import MAX_COORDINATE, Pose
from tussock.world.scene import World

from .eye import Eye

Poses = Float[np.ndarray, "n 3"] | Sequence[Pose | Sequence[float] | Float[np.ndarray, "3"]]
Views = UInt8[np.ndarray, "n height width 4"]

BACKENDS = ("auto", "cpu", "egl", "osmesa")


@runtime_checkable
class Renderer(Protocol):
    """Draws panoramas of one world through one eye.

    backend: what draws: "cpu", "egl" or "osmesa".
    """

    world: World
    eye: Eye
    backend: str

    def render(self, poses: Poses) -> Views:
        """Panoramas at poses (x [m], y [m], heading [rad]); one pose is a batch of one.

        Colour is the average over each pixel's solid angle, the sky included; alpha is the share of the pixel
        that something covers (255: all of it, 0: open sky). Raises InputError for poses that are not finite, or beyond MAX_COORDINATE.
        """
        ...

    def close(self) -> None:
        """Free what the renderer holds; using it afterwards is an error."""
        ...

    def __enter__(self) -> "Renderer": ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None
    ) -> None: ...


def open_renderer(
    world: World, eye: Eye | None = None, backend: str = "auto", *, threads: int | None = None
) -> Renderer:
    """Open a renderer; use it in a `with` statement.

    backend: "cpu" (the exact scanline renderer), "egl" or "osmesa" (pyrender), or "auto": the fastest one here, which is
        the CPU renderer on every machine measured so far (CHANGELOG.md). `Renderer.backend` says which it took.
    threads: of the CPU renderer; None takes every core this process may run on. OpenGL decides for itself.
    Raises InputError when an explicit choice cannot be had, naming what to install.
    """
    check_backend(backend)
    eye = eye or Eye()
    if backend in ("auto", "cpu"):
        from .scanline import ScanlineRenderer

        return ScanlineRenderer(world, eye, threads)
    from .raster import RasterRenderer

    return RasterRenderer(world, eye, backend)


def check_backend(backend: str) -> None:
    """Refuse what is no renderer's name. Raises InputError."""
    if backend not in BACKENDS:
        raise InputError(f"unknown renderer {backend!r}; the renderers are {', '.join(BACKENDS)}")


def as_poses(poses: Poses) -> Float[np.ndarray, "n 3"]:
    """Poses as a finite (n, 3) float64 array. Raises InputError otherwise."""
    try:
        array = np.asarray(poses, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"poses are rows of x, y, heading, all numbers ({error})") from error
    if array.size == 0:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"poses are rows of x, y, heading; got an array of shape {array.shape}")
    near = np.abs(array) <= MAX_COORDINATE  # False for nan, too
    if not near.all():
        row = int(near.all(axis=1).argmin())
        raise InputError(f"pose {row} is {array[row].tolist()}; a pose needs finite numbers up to {MAX_COORDINATE:g}")
    return array
