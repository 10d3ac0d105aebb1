"""Tiny worlds and views for tests."""

import dataclasses

import numpy as np
import torch

from tussock.world.geometry import Bounds
from tussock.world.scene import Ground, World
from tussock.world.textures import Texture, Texturing

FIELD = Bounds(-3.0, -3.0, 3.0, 3.0)


def random_world(seed: int = 0, n: int = 80, *, ground: bool = True, double_sided: bool = True) -> World:
    """Coloured triangles standing about at random, some very near the origin, some high above, some below the ground."""
    rng = np.random.default_rng(seed)
    foot = rng.uniform(-3, 3, (n, 1, 3)) * [1, 1, 0.2]
    triangles = (foot + rng.normal(scale=0.25, size=(n, 3, 3))).astype(np.float32)
    return world_of(triangles, rng.integers(0, 256, (n, 3)).astype(np.uint8), ground=ground, double_sided=double_sided)


def world_of(triangles: np.ndarray, rgb: np.ndarray, *, ground: bool = True, double_sided: bool = True) -> World:
    """A world of the given triangles."""
    return World(
        triangles=np.asarray(triangles, dtype=np.float32),
        rgb=np.asarray(rgb, dtype=np.uint8),
        ground=Ground((200, 180, 140), FIELD) if ground else None,
        sky_rgb=(120, 160, 250),
        field=FIELD,
        double_sided=double_sided,
    )


def random_texture(seed: int, **settings) -> Texture:
    rng = np.random.default_rng(seed)
    return Texture(rgba=rng.integers(0, 256, (*rng.integers(1, 9, 2), 4), dtype=np.uint8), **settings)


def textured_world(textures, seed: int = 0, n: int = 60, *, colours: bool = False, ground: bool = True) -> World:
    """Random triangles, of which some have no texture, with uv from -2 to 3."""
    world, rng = random_world(seed, n, ground=ground), np.random.default_rng(seed + 100)
    index = rng.integers(-1, len(textures), n).astype(np.int32)
    corner = rng.integers(0, 256, (n, 3, 4), dtype=np.uint8) if colours else None
    uv = rng.uniform(-2, 3, (n, 3, 2)).astype(np.float32)
    return dataclasses.replace(world, texturing=Texturing(textures=tuple(textures), index=index, uv=uv, colours=corner))


def random_poses(n: int, seed: int = 1) -> np.ndarray:
    """Poses (n, 3) inside FIELD."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-2, 2, (n, 2)), rng.uniform(-np.pi, np.pi, n)])


def views(n: int, seed: int = 0, h: int = 5, w: int = 24) -> torch.Tensor:
    """White noise. Drawn by numpy: torch's generator with the seed of a model would draw views that are the weights it begins with."""
    return torch.tensor(np.random.default_rng(seed).normal(size=(n, h, w)), dtype=torch.float32)
