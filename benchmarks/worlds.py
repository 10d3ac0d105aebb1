"""Worlds for the benchmarks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tussock.world import Bounds, World
from tussock.world.files import read_world
from tussock.world.textures import Texture, Texturing

SUSSEX = Path(__file__).parents[2] / "shared" / "sussex" / "world5000_gray.bin"


def everyday() -> tuple[str, World]:
    """The Sussex world where it is on this machine, else a generated one; with its name."""
    return ("Sussex", read_world(SUSSEX)) if SUSSEX.is_file() else ("tussock-field", World.generate("tussock-field", 1))


def blades(n: int) -> World:
    """A meadow of n blades, 50 per square metre: the more there are, the more of them are far away."""
    rng = np.random.default_rng(0)
    side = np.sqrt(n / 50)
    foot = rng.uniform(0, side, (n, 2))
    across = 0.02 * np.stack([np.cos(turn := rng.uniform(0, 2 * np.pi, n)), np.sin(turn)], axis=1)
    triangles = np.zeros((n, 3, 3), dtype=np.float32)
    triangles[:, 0, :2], triangles[:, 1, :2] = foot - across, foot + across
    triangles[:, 2, :2], triangles[:, 2, 2] = foot + rng.normal(0, 0.05, (n, 2)), rng.uniform(0.05, 0.5, n)
    rgb = rng.integers(0, 256, (n, 3), dtype=np.uint8)
    return World(triangles=triangles, rgb=rgb, field=Bounds(0, 0, side, side), ground=None, sky_rgb=(200, 220, 255))


def textured(world: World, *, holes: bool) -> World:
    """A world with a picture of 512 x 512 texels on each triangle; with holes, half of it is transparent, in 16 x 16 blocks."""
    rng, n = np.random.default_rng(0), len(world.triangles)
    rgba = rng.integers(0, 256, (512, 512, 4), dtype=np.uint8)
    rgba[..., 3] = 255 * np.kron(rng.integers(0, 2, (32, 32)), np.ones((16, 16))) if holes else 255
    texture = Texture(rgba=rgba, alpha="mask" if holes else "opaque")
    uv = rng.uniform(0, 1, (n, 3, 2)).astype(np.float32)
    return replace(world, texturing=Texturing(textures=(texture,), index=np.zeros(n, np.int32), uv=uv))


def poses_in(world: World, n: int, seed: int = 0) -> Float[np.ndarray, "n 3"]:
    """Random poses in the middle of a world."""
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = world.field
    share = rng.uniform(0.1, 0.9, (n, 2))
    return np.column_stack([x0 + share[:, 0] * (x1 - x0), y0 + share[:, 1] * (y1 - y0), rng.uniform(-np.pi, np.pi, n)])
