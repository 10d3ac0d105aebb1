"""Trees whose leaves belong to branches: a trunk that forks into branches, these into twigs, and leaves at the twigs."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from .params import WorldParams
from .plant_parts import (
    Plant,
    coloured,
    directions,
    facing_sun,
    joined,
    mixed,
    points_along,
    ribbons,
    simple_leaves,
    spikes,
    spines,
    sunlit,
    tinted,
)
from .settings import RGB

CHILDREN = (9, 4, 3, 2)  # branches that grow from one of the level below
GOLDEN_ANGLE = 2.4  # rad between branches that follow each other up a trunk


@dataclass(frozen=True)
class _Branches:
    """Branches of one level.

    Attributes:
        spine: Their middle lines (m).
        side: Direction in which each leans (rad).
        lean: Inclination of each at its foot (rad from upright).
        length: Length of each (m).
        limb: The branch of the first level that each belongs to.
    """

    spine: Float[np.ndarray, "n points 3"]
    side: Float[np.ndarray, " n"]
    lean: Float[np.ndarray, " n"]
    length: Float[np.ndarray, " n"]
    limb: Int[np.ndarray, " n"]


def branching_tree(p: WorldParams, size: float, tone: float, rng: np.random.Generator, haze: float = 0.0) -> Plant:
    """A tree that forks `tree_forks` times, at least once.

    Args:
        p: Parameters of the world.
        size: Height (m).
        tone: 0 for a round crown, 1 for a conical one; it also mixes the two colours of trees.
        rng: Generator to draw from.
        haze: Share of the sky's colour in its own.
    """
    crown_rgb, bark_rgb = (
        mixed(rgb, p.sky_rgb, haze) for rgb in (mixed(p.tree_rgb, p.tree_other_rgb, 1 - tone), p.bark_rgb)
    )
    side, lean = rng.uniform(-np.pi, np.pi, 1), rng.uniform(0, 0.1, 1)
    trunk = spines(np.zeros((1, 3)), side, np.array([0.85 * size]), lean, rng.normal(0, 0.15, 1), 4)
    branches = _limbs(trunk, size, float(np.clip(2.2 * tone - 1.1, 0, 1)), rng)
    wood = [spikes(trunk, 0.022 * size), spikes(branches.spine, 0.009 * size)]
    for level in range(1, p.tree_forks):
        branches = _forked(branches, CHILDREN[level], 2 if level == 1 else 1, rng)
        wood.append(ribbons(branches.spine, branches.side, 0.016 * size * 0.5**level).reshape(-1, 3, 3))
    leaves = max(len(branches.spine), round(p.tree_leaves * np.clip(size / p.tree_height, 0.6, 1.6)))
    return joined([sunlit(np.concatenate(wood), np.array(bark_rgb)), _leaves(branches, leaves, size, crown_rgb, rng)])


def _limbs(trunk: Float[np.ndarray, "1 points 3"], size: float, conical: float, rng: np.random.Generator) -> _Branches:
    """The branches that grow from the trunk of a tree of some height (m): wide below, upright at the top."""
    n = CHILDREN[0]
    level = (np.arange(n) + rng.uniform(0, 0.8, n)) / n  # share of the crown's height
    reach = (1 - conical) * np.sqrt(1 - (1.6 * level - 0.6) ** 2) + conical * (1.1 - level)
    side = rng.uniform(-np.pi, np.pi) + np.cumsum(rng.normal(GOLDEN_ANGLE, 0.4, n))
    lean = (1.25 - 0.9 * level) * rng.uniform(0.85, 1.15, n)
    length = 0.42 * size * np.maximum(0.3, reach) * rng.uniform(0.8, 1.2, n)
    foot = points_along(trunk.repeat(n, axis=0), 0.3 + 0.68 * level)
    return _Branches(
        spines(foot, side, length, lean, rng.normal(-0.3, 0.15, n), 2), side, lean, length, limb=np.arange(n)
    )


def _forked(branches: _Branches, children: int, segments: int, rng: np.random.Generator) -> _Branches:
    """The branches that grow from others: about half as long, to both sides of them.

    Args:
        branches: The branches that they grow from.
        children: Number of branches that grow from each.
        segments: Number of straight segments of each.
        rng: Generator to draw from.
    """
    parent = np.arange(len(branches.spine)).repeat(children)
    n = len(parent)
    share = (np.tile(np.arange(children), len(branches.spine)) + rng.uniform(0.3, 1.0, n)) / children
    side = branches.side[parent] + rng.choice([-1, 1], n) * rng.uniform(0.3, 1.1, n)
    lean = np.clip(branches.lean[parent] + rng.normal(-0.1, 0.35, n), 0.05, 1.5)
    length = branches.length[parent] * rng.uniform(0.4, 0.6, n) * (1.1 - 0.4 * share)
    foot = points_along(branches.spine[parent], 0.2 + 0.8 * share)
    spine = spines(foot, side, length, lean, rng.normal(-0.1, 0.2, n), segments)
    return _Branches(spine, side, lean, length, branches.limb[parent])


def _leaves(twigs: _Branches, leaves: int, size: float, rgb: RGB, rng: np.random.Generator) -> Plant:
    """Leaves at the twigs of a tree of some height (m), as many at each; those of one limb have one shade."""
    twig = np.arange(leaves) % len(twigs.spine)
    position = points_along(twigs.spine[twig], rng.uniform(0.3, 1.1, leaves)) + 0.02 * size * directions(leaves, rng)
    outward = (position - position.mean(axis=0)) / size
    leaf_size = size * np.sqrt(1.3 / leaves) * rng.lognormal(0, 0.25, leaves)
    triangles = simple_leaves(position, outward + 0.4 * directions(leaves, rng) + [0, 0, 0.3], leaf_size, rng)
    triangles[..., 2] = np.maximum(triangles[..., 2], 0.0)
    of_limb = rng.lognormal(0, 0.1, CHILDREN[0])[twigs.limb[twig]]
    tint, shade = tinted(rgb, leaves, 0.08, rng), 0.6 + 0.3 * position[:, 2] / size
    lit = coloured(triangles, tint, (shade + 0.28 * facing_sun(outward)) * of_limb)
    return lit._replace(reflectance=coloured(triangles, tint, shade * of_limb).rgb)
