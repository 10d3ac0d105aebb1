"""A hedge all around a generated world, where the ground ends."""

import numpy as np
from jaxtyping import Float

from .geometry import Bounds
from .params import WorldParams
from .plant_parts import NO_PLANT, Plant, directions, hazy, simple_leaves, sunlit
from .random_fields import random_ring

DISTANCE = 0.95  # share of the ground's margin between the field and the hedge
PART = 0.8  # m; length of a part of a hedge, as wide as a bush
LEAVES = 6  # triangles of foliage in front of each part
MIN_HEIGHT, MAX_HEIGHT = 0.5, 2.0  # of a part, in shares of the median height


def hedge(p: WorldParams, rng: np.random.Generator) -> Plant:
    """A wall with foliage in front of it; nothing where hedges have no height.

    It hides the end of the ground from eyes lower than a third of its median height.
    """
    if p.hedge_height == 0:
        return NO_PLANT
    distance = DISTANCE * p.ground_margin
    foot = _around(p.field, distance)
    n = len(foot)
    angles = np.linspace(-np.pi, np.pi, n, endpoint=False)
    height = p.hedge_height * np.clip(
        np.exp(0.3 * random_ring(angles, rng)) * rng.lognormal(0, 0.12, n), MIN_HEIGHT, MAX_HEIGHT
    )
    kind = 0.5 + 0.5 * np.tanh(random_ring(angles, rng))[:, None]
    rgb = kind * p.tree_rgb + (1 - kind) * p.tree_other_rgb
    part = np.arange(n).repeat(LEAVES)
    leaves, level = _foliage(foot, height, part, rng)
    leaf_rgb = rgb[part] * (rng.lognormal(0, 0.1, len(part)) * (0.7 + 0.4 * level))[:, None]
    triangles = np.concatenate([_wall(foot, height), leaves])
    leafy = sunlit(triangles, np.concatenate([0.7 * rgb.repeat(2, axis=0), leaf_rgb]), thin=True)
    return hazy(leafy, p.sky_rgb, p.haze_at(distance))


def _around(field: Bounds, distance: float) -> Float[np.ndarray, "n 2"]:
    """Points at a distance around the field (both m), PART apart, counter-clockwise; the last is next to the first."""
    turn = np.linspace(0, np.pi / 2, 17)
    x0, y0, x1, y1 = field
    corners = ((x1, y1), (x0, y1), (x0, y0), (x1, y0))
    arcs = [
        np.array(corner) + distance * np.column_stack([np.cos(angle), np.sin(angle)])
        for corner, angle in zip(corners, turn + np.pi / 2 * np.arange(4)[:, None], strict=True)
    ]
    line = np.concatenate([*arcs, arcs[0][:1]])
    arc = np.r_[0.0, np.hypot(*np.diff(line, axis=0).T).cumsum()]
    at = np.linspace(0, arc[-1], round(arc[-1] / PART), endpoint=False)
    return np.column_stack([np.interp(at, arc, line[:, i]) for i in (0, 1)])


def _wall(foot, height) -> Float[np.ndarray, "n 3 3"]:
    """Upright triangles, two for each part, from the ground to a ragged top, without a gap."""
    low = np.column_stack([foot, np.zeros(len(foot))])
    high = np.column_stack([foot, 0.8 * height])
    next_low, next_high = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
    return np.stack([np.stack([low, next_low, next_high], 1), np.stack([low, next_high, high], 1)], 1).reshape(-1, 3, 3)


def _foliage(
    foot, height, part, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "n 3 3"], Float[np.ndarray, " n"]]:
    """Leaves in front of the parts of a wall, and how high each is (share of the wall's height)."""
    along = np.roll(foot, -1, axis=0) - foot
    inwards = np.column_stack([-along[:, 1], along[:, 0], np.zeros(len(along))])[part]
    inwards /= np.linalg.norm(inwards, axis=1, keepdims=True)
    level = np.sqrt(rng.random(len(part)))
    size = 0.3 * height[part] * rng.lognormal(0, 0.2, len(part))
    position = np.column_stack([foot[part] + along[part] * rng.random((len(part), 1)), height[part] * level])
    position += inwards * size[:, None] * rng.uniform(0.75, 1.2, (len(part), 1))  # so far that none reaches through it
    leaves = simple_leaves(position, inwards + [0, 0, 0.4] + 0.8 * directions(len(part), rng), size, rng)
    leaves[..., 2] = np.maximum(leaves[..., 2], 0.0)
    return leaves, level
