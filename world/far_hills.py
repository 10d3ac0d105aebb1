"""Hills far away, all around a generated world. They are the end of what is seen; nothing is behind them."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float

from .geometry import Bounds
from .params import WorldParams
from .plant_parts import NO_PLANT, Plant, hazy, joined, sunlit
from .random_fields import random_ring

DIRECTIONS = 360  # corners of a range of hills around the horizon
DISTANCE = (1.0, 1.2, 1.45)  # of the ranges, in shares of the distance of the first
HEIGHT = (0.45, 0.8, 1.25)  # of the ranges, in shares of the median height: the farther ones are seen behind the nearer
HAZE = (0.3, 0.48, 0.64)  # share of the sky's colour in each range
SUNK = 0.04  # of its height; the foot of a range is so much below the ground, so that no gap is seen


def far_hills(p: WorldParams, rng: np.random.Generator) -> Plant:
    """Three ranges of hills, one behind the other, each hazier than the one before; nothing where they have no height."""
    if p.far_hill_height == 0:
        return NO_PLANT
    ranges = []
    for distance, height, haze in zip(DISTANCE, HEIGHT, HAZE, strict=True):
        size = height * p.far_hill_height, distance * p.far_hill_distance
        ranges.append(hazy(_range_of_hills(p, *size, distance == DISTANCE[0], rng), p.sky_rgb, haze))
    return joined(ranges)


def _range_of_hills(p: WorldParams, height: float, distance: float, has_gaps: bool, rng: np.random.Generator) -> Plant:
    """The side of a range of hills that is seen from the field.

    Args:
        p: Parameters of the world.
        height: Median height of its tops (m).
        distance: From the field to its foot (m).
        has_gaps: Whether there are plains between its hills.
        rng: Generator to draw from.
    """
    angle = np.linspace(-np.pi, np.pi, DIRECTIONS, endpoint=False)
    crest = np.exp(0.45 * random_ring(angle, rng) + 0.12 * _finer_ring(angle, rng)) - (0.75 if has_gaps else 0.0)
    crest = height * np.clip(crest, 0.02, 2.5) * rng.lognormal(0, 0.03, DIRECTIONS)
    depth = 0.13 * distance * rng.uniform(0.85, 1.15, (3, DIRECTIONS))
    levels = [np.full(DIRECTIONS, -SUNK * height)]
    levels += [crest * rng.uniform(*share, DIRECTIONS) for share in ((0.25, 0.45), (0.6, 0.85))]
    rings = []
    for away, z in zip(np.vstack([np.zeros(DIRECTIONS), depth.cumsum(axis=0) / 3]), [*levels, crest], strict=True):
        x, y = _around(p.field, angle, distance + away)
        rings.append(np.column_stack([x, y, z]))
    triangles = np.concatenate([_strip(low, high) for low, high in pairwise(rings)])
    shade = rng.lognormal(0, 0.05, (len(triangles), 1))
    green = np.clip(0.35 + 0.25 * random_ring(angle, rng), 0, 0.8)[np.tile(np.arange(DIRECTIONS).repeat(2), 3)][:, None]
    colour = np.array(p.ground_rgb) * 0.72 * (1 - green) + np.array(p.tree_rgb) * green
    return sunlit(triangles, colour * shade)


def _finer_ring(angle: Float[np.ndarray, " n"], rng: np.random.Generator) -> Float[np.ndarray, " n"]:
    """A random function of direction with more detail than `random_ring`."""
    k = np.arange(9, 41)
    return np.cos(angle[:, None] * k + rng.uniform(0, 2 * np.pi, len(k))) @ (rng.normal(0, 1, len(k)) / np.sqrt(k))


def _around(field: Bounds, angle, away) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """x and y on a circle around the field, some distance away from it (m)."""
    x0, y0, x1, y1 = field
    radius = np.hypot(x1 - x0, y1 - y0) / 2 + away
    return (x0 + x1) / 2 + radius * np.cos(angle), (y0 + y1) / 2 + radius * np.sin(angle)


def _strip(low: Float[np.ndarray, "n 3"], high: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "m 3 3"]:
    """Triangles between two rings of points, facing inwards; those of one direction follow each other."""
    next_low, next_high = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
    return np.stack([np.stack([low, next_high, next_low], 1), np.stack([low, high, next_high], 1)], 1).reshape(-1, 3, 3)
