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


def hills(step: float = 0.2, height: float = 0.3) -> np.ndarray:
    """Triangles of hills over (0, 0) to (6, 6), in squares of `step`."""
    return surface(lambda x, y: height * np.sin(1.3 * x) * np.cos(1.1 * y), step)


def surface(z, step: float = 0.2, low: float = 0.0, high: float = 6.0) -> np.ndarray:
    """Triangles, two in each square of `step`, between points of the surface z(x, y)."""
    along = np.linspace(low, high, round((high - low) / step) + 1)
    x, y = np.meshgrid(along, along)
    points = np.stack([x, y, z(x, y) + 0 * x], axis=-1)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    return np.concatenate([np.stack(each, axis=2).reshape(-1, 3, 3) for each in ((a, b, c), (a, c, d))])


def post(x: float, y: float, z: float, height: float = 0.5, width: float = 0.08) -> np.ndarray:
    """Triangles of an upright box without a bottom, with a flat top, on (x, y, z)."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * width / 2
    low = np.column_stack([corners + (x, y), np.full(4, z)])
    high = low + (0, 0, height)
    sides = [[(low[i], low[j], high[j]), (low[i], high[j], high[i])] for i, j in ((0, 1), (1, 2), (2, 3), (3, 0))]
    return np.array([*(triangle for side in sides for triangle in side), high[[0, 1, 2]], high[[0, 2, 3]]])


def mesh_world(*parts: np.ndarray, **fields) -> World:
    """A world of triangles in a colour for each part, as a mesh that somebody brings: without a ground, its field is its extent."""
    triangles = np.concatenate(parts).astype(np.float32)
    colours = np.random.default_rng(len(parts)).integers(0, 256, (len(parts), 3)).astype(np.uint8)
    low, high = triangles[..., :2].min(axis=(0, 1)), triangles[..., :2].max(axis=(0, 1))
    given = {"ground": None, "sky_rgb": (191, 191, 191), "field": Bounds(*low.tolist(), *high.tolist())}
    rgb = np.repeat(colours, [len(part) for part in parts], axis=0)
    return World(triangles=triangles, rgb=rgb, **(given | fields))


def random_poses(n: int, seed: int = 1) -> np.ndarray:
    """Poses (n, 3) inside FIELD."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-2, 2, (n, 2)), rng.uniform(-np.pi, np.pi, n)])


def full_poses(field: Bounds, n: int, seed: int = 1, tilt_deg: float = 40.0) -> np.ndarray:
    """Full poses (n, 6) over a field, 1 cm to 1 m high, pitched and rolled to any angle up to a limit."""
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = field
    xy = np.column_stack([rng.uniform(x0, x1, n), rng.uniform(y0, y1, n)])
    tilt = np.radians(rng.uniform(-tilt_deg, tilt_deg, (n, 2)))
    return np.column_stack([xy, rng.uniform(-np.pi, np.pi, n), rng.uniform(0.01, 1, n), tilt])


def views(n: int, seed: int = 0, h: int = 5, w: int = 24) -> torch.Tensor:
    """White noise. Drawn by numpy: torch's generator with the seed of a model would draw views that are the weights it begins with."""
    return torch.tensor(np.random.default_rng(seed).normal(size=(n, h, w)), dtype=torch.float32)
