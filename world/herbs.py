"""Herbs and flowering grasses of a generated world. Colours include sunlight."""

import numpy as np
from jaxtyping import Float, Int

from .params import WorldParams
from .plant_parts import (
    UP,
    Plant,
    darker_below,
    directions,
    joined,
    mixed,
    points_along,
    ribbons,
    simple_leaves,
    spines,
    sunlit,
    tinted,
)
from .settings import RGB

LEAVES, STEM_LEAVES, PETALS = 6, 3, 4  # of a herb
FLOWERING = 0.6  # share of herbs


def herb(p: WorldParams, size: float, tone: float, rng: np.random.Generator) -> Plant:
    """A rosette of leaves, often with a flower. size: height of the flower (m); tone: from 0 to 1, more and more of the green of grass."""
    rgb, flowering = mixed(p.herb_rgb, p.grass_rgb, 0.5 * tone), rng.random() < FLOWERING
    angle = np.arange(LEAVES) * 2.4 + rng.uniform(-np.pi, np.pi)
    length = size * rng.uniform(0.25, 0.45, LEAVES)
    lean = rng.uniform(0.7, 1.3, LEAVES)
    rosette = ribbons(spines(np.zeros((LEAVES, 3)), angle, length, lean, np.full(LEAVES, 0.4), 2), angle, 0.35 * length)
    leaf_rgb = tinted(rgb, LEAVES, 0.15, rng).repeat(3, axis=0)
    pieces = [sunlit(rosette.reshape(-1, 3, 3), leaf_rgb, thin=True)]
    if flowering:
        pieces += _flower(p, size, rgb, rng)
    return joined(pieces)


def _flower(p: WorldParams, size: float, rgb: RGB, rng: np.random.Generator) -> list[Plant]:
    """A stalk with a few leaves, and the petals at its tip."""
    side, lean = rng.uniform(-np.pi, np.pi, 1), rng.uniform(0, 0.25, 1)
    spine = spines(np.zeros((1, 3)), side, np.array([size]), lean, rng.normal(0, 0.2, 1), 2)
    stalk = ribbons(spine, side, 0.003 + 0.02 * size).reshape(-1, 3, 3)
    height = rng.uniform(0.3, 0.8, (STEM_LEAVES, 1))
    leaves = simple_leaves(spine[0, -1] * height, directions(STEM_LEAVES, rng) + UP, 0.22 * size, rng)
    petals = simple_leaves(spine[0, -1] + np.zeros((PETALS, 3)), directions(PETALS, rng) + UP, 0.012 + 0.1 * size, rng)
    green = sunlit(np.concatenate([stalk, leaves]), tinted(rgb, len(stalk) + STEM_LEAVES, 0.1, rng), thin=True)
    return [green, sunlit(petals, tinted(p.herb_flower_rgb, PETALS, 0.08, rng), thin=True)]


def culms(
    p: WorldParams, rows: Float[np.ndarray, "culms 4"], rng: np.random.Generator
) -> tuple[Plant, Int[np.ndarray, " n"]]:
    """Thin stems of grass with a seed head.

    Args:
        p: Parameters of the world.
        rows: x, y, height (m) and tone of each; from 0 to 1, more and more of them are dry.
        rng: Generator to draw from.

    Returns:
        All culms, and the row of each triangle.
    """
    n = len(rows)
    foot = np.column_stack([rows[:, :2], np.zeros(n)])
    side = rng.uniform(-np.pi, np.pi, n)
    spine = spines(foot, side, rows[:, 2], rng.gamma(2.0, 0.06, n), rng.gamma(2.0, 0.1, n), 2)
    stems = ribbons(spine, side, 0.003 + 0.012 * rows[:, 2])
    low, tip = points_along(spine, np.full(n, 0.8)), spine[:, -1]
    half = (0.02 * rows[:, 2, None] + 0.001) * np.stack([directions(n, rng) * [1, 1, 0] for _ in range(2)])
    heads = np.stack([[low, (low + tip) / 2 + sign * across, tip] for across in half for sign in (-1, 1)])
    dry = np.clip(rows[:, 3:] + rng.normal(0, 0.25, (n, 1)), 0.2, 1.0)
    rgb = (np.array(p.grass_rgb) * (1 - dry) + np.array(p.dry_rgb) * dry) * rng.lognormal(0, 0.12, (n, 1))
    stem_rgb = darker_below(rgb, stems, rows[:, 2])
    heads = np.moveaxis(heads, 2, 0).reshape(-1, 3, 3)  # four of each culm
    pieces = [sunlit(stems.reshape(-1, 3, 3), stem_rgb, thin=True), sunlit(heads, rgb.repeat(4, axis=0), thin=True)]
    return joined(pieces), np.concatenate([np.arange(n).repeat(stems.shape[1]), np.arange(n).repeat(4)])
