"""What covers the ground of a generated world: speckles of soil and moss, and litter.

Speckles and litter are lower than STEP_HEIGHT of terrain.py: an insect walks over them, and they are not obstacles.
Triangles are (n, 3, 3): triangle, corner, xyz (m, z up). Colours include sunlight.
"""

import numpy as np
from jaxtyping import Float, Int

from .geometry import Bounds
from .params import WorldParams
from .plant_parts import NO_PLANT, UP, Plant, directions, joined, simple_leaves, sunlit, tinted
from .random_fields import random_field

SPECKLE_Z = (0.001, 0.004)  # m; above the ground at z = 0: so low an eye sees small lumps well
LITTER_Z = (0.0035, 0.0075)  # m; on the lumps, and below STEP_HEIGHT
BAND = 4  # widths of a speckle; around the field, speckles are twice as wide in each further band


def speckles(p: WorldParams, rng: np.random.Generator) -> Plant:
    """The ground as a mosaic of triangles, each with its own shade of soil or moss; nothing for a ground of one colour.

    Speckles are `speckle_size` wide in the field, and wider towards the end of the ground, where they are seen from afar only.
    """
    if p.speckle == 0 and p.moss_share == 0:
        return NO_PLANT
    from scipy.spatial import Delaunay  # takes half a second, which a world from a file need not wait for

    corners = ground_corners(p.field, p.speckle_size, p.ground_margin, rng)
    z = rng.uniform(*SPECKLE_Z, len(corners))
    triangles = np.column_stack([corners, z])[Delaunay(corners).simplices]
    return sunlit(triangles, shades(p, triangles[..., :2].mean(axis=1), rng))


def shades(p: WorldParams, middle: Float[np.ndarray, "n 2"], rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Colours of the triangles of a ground with soil and moss, by their middles (m)."""
    n = len(middle)
    shade, moss = random_field(0.5 * p.patch_size, rng), random_field(0.5 * p.patch_size, rng)
    mossy = moss(middle) + rng.normal(0, 0.3, n)  # patches with ragged edges
    is_moss = mossy > np.quantile(mossy, 1 - p.moss_share)
    brightness = np.exp(p.speckle * np.clip(0.7 * shade(middle) + rng.normal(0, 1, n), -2.5, 1.5))
    return np.where(is_moss[:, None], p.moss_rgb, p.ground_rgb) * brightness[:, None]


def ground_corners(
    field: Bounds, width: float, ground_margin: float, rng: np.random.Generator, band: float = BAND
) -> Float[np.ndarray, "n 2"]:
    """Corners of the triangles of a ground (m): an uneven grid in the field, coarser ones around it, and the corners of the ground.

    Args:
        field: The field (m).
        width: Of the triangles in the field (m).
        ground_margin: The ground continues this far around the field (m).
        rng: Generator to draw from.
        band: Around the field, triangles are twice as wide in each further band, which has this many of their widths.
    """
    points, margin, within = [uneven_grid(field, width, rng)], 0.0, field
    while margin < ground_margin:
        width *= 2
        margin = min(margin + band * width, ground_margin)
        area = field.widened(margin)
        grid = uneven_grid(area, width, rng)
        points.append(grid[~within.contains(*grid.T)])
        within = area
    x0, y0, x1, y1 = field.widened(ground_margin)
    return np.concatenate([*points, [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]])


def uneven_grid(area: Bounds, spacing: float, rng: np.random.Generator) -> Float[np.ndarray, "n 2"]:
    """Points about `spacing` metres from each other, one in each cell of a grid."""
    columns, rows = np.ceil(area.size / spacing).astype(int).tolist()
    row, column = np.mgrid[:rows, :columns].reshape(2, -1) + rng.uniform(0.15, 0.85, (2, rows * columns))
    return np.array(area[:2]) + np.column_stack([column / columns, row / rows]) * area.size


def litter(
    p: WorldParams, rows: Float[np.ndarray, "pieces 4"], rng: np.random.Generator
) -> tuple[Plant, Int[np.ndarray, " n"]]:
    """Leaves and dead stems that lie on the ground, of one triangle each.

    Args:
        p: Parameters of the world.
        rows: x, y, length (m) and tone of each: from 0 to 1, leaves go from their own colour to that of dry grass.
        rng: Generator to draw from.

    Returns:
        All pieces, and the row of each triangle.
    """
    is_stem, is_green = rng.random((2, len(rows))) < np.array([[p.litter_stems], [p.litter_green]])
    stems, leaves = rows[is_stem], rows[~is_stem]
    position = np.column_stack([leaves[:, :2], rng.uniform(*LITTER_Z, len(leaves))])
    blades = simple_leaves(position, UP + 0.25 * directions(len(leaves), rng), leaves[:, 2], rng)
    dead_rgb = np.array(p.leaf_rgb) * (1 - leaves[:, 3:]) + np.array(p.dry_rgb) * leaves[:, 3:]
    leaf_rgb = np.where(is_green[~is_stem, None], p.herb_rgb, dead_rgb) * rng.lognormal(0, 0.15, (len(leaves), 1))
    stem_rgb = tinted(p.dry_rgb, len(stems), 0.15, rng)
    pieces = [(blades, leaf_rgb), (_lying_stems(stems, rng), stem_rgb)]
    for triangles, _ in pieces:
        triangles[..., 2] = np.clip(triangles[..., 2], *LITTER_Z)
    row = np.concatenate([np.flatnonzero(~is_stem), np.flatnonzero(is_stem)])
    return joined([sunlit(triangles, rgb, thin=True) for triangles, rgb in pieces]), row


def _lying_stems(rows: Float[np.ndarray, "n 4"], rng: np.random.Generator) -> Float[np.ndarray, "n 3 3"]:
    """Stems of one long triangle each, nearly level."""
    n = len(rows)
    angle, length, width = rng.uniform(-np.pi, np.pi, n), 2 * rows[:, 2], rng.uniform(0.002, 0.005, n)
    along, across = (
        np.column_stack([np.cos(turned), np.sin(turned), np.zeros(n)]) for turned in (angle, angle + np.pi / 2)
    )
    foot = np.column_stack([rows[:, :2], rng.uniform(*LITTER_Z, n)])
    tip = foot + length[:, None] * along
    tip[:, 2] = rng.uniform(*LITTER_Z, n)
    return np.stack([foot, foot + width[:, None] * across, tip], axis=1)
