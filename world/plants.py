"""One plant or stone from the parameters of a world, each as triangles at the origin, z up, with one colour per triangle.

All functions take the parameters, the size (m), the tone (0 to 1: how colours vary over the land) and a generator; `grass` takes
all tufts at once. They draw from the generator always in the same order. Colours include sunlight, so a plant may be moved but not turned.
"""

import numpy as np
from jaxtyping import Float, Int

from .params import WorldParams
from .plant_parts import (
    NO_PLANT,
    UP,
    Plant,
    coloured,
    darker_below,
    directions,
    facing_sun,
    folded_leaves,
    hull,
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


def tussock(p: WorldParams, size: float, tone: float, rng: np.random.Generator) -> Plant:
    """A clump of bent, tapering blades. size: height of its upright blades (m)."""
    blades = round(p.tussock_blades * np.clip(size / p.tussock_height, 0.6, 1.5))
    rgb, dry_share = mixed(p.tussock_rgb, p.grass_rgb, 0.5 * tone), min(1.0, p.dry_share * (0.5 + tone))
    segments = np.array([2, 3, 4])[rng.choice(3, blades, p=[0.55, 0.35, 0.1])] if blades > 8 else np.full(blades, 2)
    outward = np.sqrt(rng.random(blades))
    angle = rng.uniform(-np.pi, np.pi, blades)
    around = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(blades)])
    foot = (0.04 + 0.14 * size) * outward[:, None] * around
    dry = rng.random(blades) < dry_share
    lean = 0.05 + outward * rng.uniform(0.1, 0.75, blades) + 0.25 * dry
    bend = rng.gamma(2.0, 0.32, blades) + 0.5 * dry  # dry blades hang lower
    length = size * (1.12 - 0.35 * outward) * rng.lognormal(0, 0.22, blades) * np.where(dry, 0.85, 1.0)
    width = (0.010 + 0.04 * size) * rng.lognormal(0, 0.3, blades)
    side = angle + rng.normal(0, 0.5, blades)
    tint = np.where(dry[:, None], tinted(p.dry_rgb, blades, 0.10, rng), tinted(rgb, blades, 0.14, rng))
    pieces = []
    for k in np.unique(segments).tolist():
        these = segments == k
        triangles = ribbons(
            spines(foot[these], side[these], length[these], lean[these], bend[these], k), side[these], width[these]
        )
        pieces.append(sunlit(triangles.reshape(-1, 3, 3), darker_below(tint[these], triangles, size), thin=True))
    return joined(pieces)


def grass(
    p: WorldParams, rows: Float[np.ndarray, "tufts 4"], rng: np.random.Generator
) -> tuple[Plant, Int[np.ndarray, " n"]]:
    """Tufts of one or a few upright blades, some with a flower on the longest, one after the other, each at its place.

    There are so many that their blades are shaped together.

    Args:
        p: Parameters of the world.
        rows: x, y, height of the blades (m) and tone of each tuft.
        rng: Generator to draw from, tuft after tuft.

    Returns:
        All tufts, and the row of each triangle.
    """
    if len(rows) == 0:
        return NO_PLANT, np.zeros(0, np.int64)
    tufts, flowers = zip(*(_tuft(p, size, tone, rng) for _, _, size, tone in rows.tolist()), strict=True)
    blades = np.array([len(tuft[0]) for tuft in tufts])
    of_tuft = np.repeat(np.arange(len(rows)), blades)
    foot, side, length, lean, bend, width, tint = map(np.concatenate, zip(*tufts, strict=True))
    segments = _grass_segments(rows[:, 2])
    per_blade = 2 * segments - 1  # triangles
    count = blades * per_blade + np.array([0 if flower is None else len(flower.rgb) for flower in flowers])
    first = count.cumsum() - count  # of each tuft's triangles
    n = int(count.sum())
    all_tufts = Plant(np.empty((n, 3, 3), np.float32), np.empty((n, 3), np.uint8), np.empty((n, 3), np.uint8))
    nth = np.arange(len(of_tuft)) - np.repeat(blades.cumsum() - blades, blades)  # of its tuft
    for k in np.unique(segments).tolist():
        these = segments[of_tuft] == k
        tuft, shape = of_tuft[these], spines(foot[these], side[these], length[these], lean[these], bend[these], k)
        blade = ribbons(shape, side[these], width[these])
        colours = darker_below(tint[these], blade, rows[tuft, 2])
        at = (first[tuft] + nth[these] * (2 * k - 1))[:, None] + np.arange(2 * k - 1)
        for whole, part in zip(all_tufts, sunlit(blade.reshape(-1, 3, 3), colours, thin=True), strict=True):
            whole[at.ravel()] = part
    for start, flower in zip((first + blades * per_blade).tolist(), flowers, strict=True):
        if flower is not None:
            for whole, part in zip(all_tufts, flower, strict=True):
                whole[start : start + len(part)] = part
    row = np.repeat(np.arange(len(rows)), count)
    offset = np.column_stack([rows[:, :2], np.zeros(len(rows))]).astype(np.float32)
    return all_tufts._replace(triangles=all_tufts.triangles + offset[row, None]), row


def _grass_segments(height):
    """Segments of blades of some height (m): the bend of a short one is not visible."""
    return np.where(height > 0.13, 2, 1)


def _tuft(p: WorldParams, size: float, tone: float, rng: np.random.Generator) -> tuple[tuple, Plant | None]:
    """The blades of a tuft of grass (foot, side, length, lean, bend, width and tint of each), and its flower, if it has one."""
    rgb = mixed(p.grass_rgb, p.dry_rgb, min(0.9, 4 * p.dry_share * max(0.0, tone - 0.4)))
    has_flower, blades = rng.random() < p.flower_share, int(rng.integers(1, p.grass_blades + 1))
    side = rng.uniform(-np.pi, np.pi, blades)
    foot = np.zeros((blades, 3))
    foot[:, :2] = rng.normal(0, 0.012, (blades, 2))
    length = size * rng.uniform(0.65, 1.1, blades)
    width = (0.004 + 0.036 * size) * rng.lognormal(0, 0.25, blades)
    lean, bend = rng.gamma(2.0, 0.09, blades), rng.gamma(2.0, 0.22, blades)
    blade = (foot, side, length, lean, bend, width, tinted(rgb, blades, 0.16, rng))
    if not has_flower:
        return blade, None
    spine = spines(foot, side, length, lean, bend, int(_grass_segments(size)))
    tip = np.repeat(spine[None, length.argmax(), -1], 3, axis=0)
    petals = simple_leaves(tip, directions(3, rng) + UP, 0.022 + 0.03 * size, rng)
    return blade, sunlit(petals, tinted(p.flower_rgb, 3, 0.08, rng), thin=True)


def bush(p: WorldParams, size: float, tone: float, rng: np.random.Generator) -> Plant:
    """Branching stems with many small leaves. size: height (m)."""
    leaves, width = max(3, round(p.bush_leaves * size / p.bush_height)), size * rng.uniform(0.8, 1.6)
    stems, twigs = max(3, min(7, leaves // 18)), max(2, min(5, leaves // 25))
    side = np.linspace(0, 2 * np.pi, stems, endpoint=False) + rng.uniform(0, 0.9, stems) + rng.uniform(0, 6)
    lean = np.arctan2(width / 2, size) * rng.uniform(0.2, 1.5, stems)
    length = size * rng.uniform(0.55, 1.0, stems)
    foot = np.column_stack([rng.normal(0, 0.03 * width, (stems, 2)), np.zeros(stems)])
    stem = spines(foot, side, length, lean, rng.uniform(-0.3, 0.5, stems), 3)

    parent, share = np.repeat(np.arange(stems), twigs), rng.uniform(0.25, 0.9, stems * twigs)
    twig_side = side[parent] + rng.normal(0, 1.1, len(parent))
    twig_length = length[parent] * rng.uniform(0.25, 0.55, len(parent))
    twig_lean, twig_bend = rng.uniform(0.2, 1.2, len(parent)), rng.normal(0, 0.3, len(parent))
    twig = spines(points_along(stem[parent], share), twig_side, twig_length, twig_lean, twig_bend, 1)

    position = _leaf_positions(stem, twig, leaves, rng) + rng.normal(0, 0.03 * size, (leaves, 3))
    leaf_size = np.sqrt(1.7 * size * width / leaves) * rng.lognormal(0, 0.2, leaves)
    position[:, 2] = np.maximum(position[:, 2], 0.8 * leaf_size + 0.02)
    outward = position - [0, 0, 0.35 * size]
    foliage = folded_leaves(position, outward / size + 0.8 * directions(leaves, rng), leaf_size, rng)
    light = 0.72 + 0.34 * np.clip(position[:, 2] / size, 0, 1) + 0.12 * facing_sun(outward)
    rgb = tinted(mixed(p.bush_rgb, p.grass_rgb, 0.5 * tone), leaves, 0.12, rng) * light[:, None]
    stem_triangles, twig_triangles = (
        ribbons(spine, azimuth, thickness).reshape(-1, 3, 3)
        for spine, azimuth, thickness in ((stem, side, 0.016 * size + 0.005), (twig, twig_side, 0.008 * size + 0.003))
    )
    wood = sunlit(np.concatenate([stem_triangles, twig_triangles]), np.array(p.bark_rgb))
    return joined([wood, sunlit(foliage, rgb.repeat(2, axis=0), thin=True)])


def _leaf_positions(stem, twig, leaves: int, rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Where the leaves of a bush are: three quarters of them on twigs, the others on stems."""
    on_twig = rng.random(leaves) < 0.75
    along_twig = points_along(twig[rng.integers(len(twig), size=leaves)], rng.uniform(0.2, 1.05, leaves))
    along_stem = points_along(stem[rng.integers(len(stem), size=leaves)], rng.uniform(0.4, 1.0, leaves))
    return np.where(on_twig[:, None], along_twig, along_stem)


def tree(p: WorldParams, size: float, tone: float, rng: np.random.Generator, haze: float = 0.0) -> Plant:
    """A tree or tall shrub of the skyline: a bent trunk, and a crown of uneven lumps.

    Args:
        p: Parameters of the world.
        size: Height (m).
        tone: 0 for a round crown, 1 for a conical one; it also mixes the two colours of trees.
        rng: Generator to draw from.
        haze: Share of the sky's colour in its own.
    """
    conical = float(np.clip(2.2 * tone - 1.1, 0, 1))
    width = size * rng.uniform(0.55, 1.05) * (1 - 0.4 * conical)
    area = size * width / (0.7 * p.tree_height**2)  # a larger crown needs more leaves, unless there are only a few
    leaves = round(p.tree_leaves * np.clip(area, 0.6, 2.2)) if p.tree_leaves >= 75 else p.tree_leaves
    crown_rgb, bark_rgb = (
        mixed(rgb, p.sky_rgb, haze) for rgb in (mixed(p.tree_rgb, p.tree_other_rgb, 1 - tone), p.bark_rgb)
    )
    trunk = rng.uniform(0.02, 0.22) * size  # its length below the crown
    if leaves < 30:
        return _plain_tree(size, width, trunk, leaves, crown_rgb, bark_rgb, rng)
    lumps = int(np.clip(leaves // 9, 3, 12))
    level = (np.arange(lumps) + rng.uniform(0, 1, lumps)) / lumps  # share of the crown's height
    reach = (1 - conical) * np.sqrt(1 - (1.6 * level - 0.7) ** 2) + conical * (1.05 - level)
    angle = np.cumsum(rng.normal(2.4, 0.5, lumps))  # about the golden angle: lumps on all sides
    radius = width * np.maximum(0.16, 0.30 * reach) * rng.uniform(0.75, 1.2, lumps)
    away = np.maximum(width / 2 * reach - 0.7 * radius, 0) * rng.uniform(0.4, 1.15, lumps)
    z = trunk + radius * 0.6 + level * (size - trunk - 1.3 * radius)
    centre = np.column_stack([away * np.cos(angle), away * np.sin(angle), z])

    spine = spines(np.zeros((1, 3)), angle[:1], np.array([0.8 * size]), np.array([0.05]), np.array([0.12]), 2)
    fork = points_along(spine.repeat(lumps, axis=0), np.clip(0.85 * z / size, 0.1, 0.95))
    limbs = ribbons(np.stack([fork, centre + 0.5 * radius[:, None] * UP], axis=1), angle, 0.014 * size + 0.01)
    wood = np.concatenate([spikes(spine, 0.012 * size + 0.01), limbs.reshape(-1, 3, 3)])
    crown = _crown(centre, radius, leaves, conical, size, crown_rgb, rng)
    return joined([sunlit(wood, np.array(bark_rgb)), crown])


def _crown(centre, radius, leaves: int, conical: float, size: float, rgb: RGB, rng: np.random.Generator) -> Plant:
    """The leaves of a tree, around its lumps of `radius` (n,) at `centre` (n, 3)."""
    lump = np.searchsorted(np.cumsum(radius**2) / (radius**2).sum(), (np.arange(leaves) + 0.5) / leaves)
    outward = directions(leaves, rng)
    outward[:, 2] = np.where(rng.random(leaves) < 0.6, np.abs(outward[:, 2]), outward[:, 2])  # more of them in the sun
    position = centre[lump] + outward * radius[lump, None] * [1, 1, 0.8] * rng.uniform(0.55, 1.0, (leaves, 1))
    leaf_size = np.sqrt((2.6 + conical) * (radius**2).sum() / leaves) * rng.lognormal(0, 0.2, leaves)
    position[:, 2] = np.maximum(position[:, 2], 0.8 * leaf_size + 0.05)
    triangles = simple_leaves(position, outward + 0.5 * directions(leaves, rng), leaf_size, rng)
    of_lump = rng.lognormal(0, 0.08, len(radius))[lump]
    tint, shade = tinted(rgb, leaves, 0.06, rng), 0.62 + 0.3 * position[:, 2] / size
    lit = coloured(triangles, tint, (shade + 0.28 * facing_sun(outward)) * of_lump)
    return lit._replace(reflectance=coloured(triangles, tint, shade * of_lump).rgb)


def _plain_tree(
    height: float, width: float, trunk: float, leaves: int, rgb: RGB, bark_rgb: RGB, rng: np.random.Generator
) -> Plant:
    """A tree of about `leaves` triangles: a three-sided trunk, and a crown of one angular lump."""
    spine = np.array([[[0, 0, 0], [0, 0, 0.8 * height]]])
    corners = max(4, leaves // 2 + 2)  # a hull of n corners has 2 n - 4 faces
    z = 1 - (2 * np.arange(corners) + 1) / corners
    angle = np.arange(corners) * 2.4 + rng.uniform(0, 2 * np.pi) + rng.normal(0, 0.25, corners)
    around = np.sqrt(1 - z**2) * width / 2 * rng.uniform(0.75, 1.3, corners)
    middle, half = (height + trunk) / 2, (height - trunk) / 2
    crown = hull(np.column_stack([around * np.cos(angle), around * np.sin(angle), middle + half * z]))
    return joined([sunlit(spikes(spine, 0.02 * height), np.array(bark_rgb)), sunlit(crown, np.array(rgb))])


def leaf(p: WorldParams, size: float, tone: float, rng: np.random.Generator) -> Plant:
    """A fallen leaf, curled, lying nearly flat. size: from stalk to tip (m)."""
    along, across = np.array([0, 0.3, 0.7, 1.0]), np.array([0, 1, 0.75, 0]) * rng.uniform(0.18, 0.3)
    edge, tip = size * rng.uniform(0.02, 0.09, 2) * np.array([1, 1.2])  # how far edges and tip curl up
    rib = np.column_stack([along * size, np.zeros(4), tip * along**3 + 0.001])
    left = rib[1:3] + np.column_stack([np.zeros(2), across[1:3] * size, np.full(2, edge)])
    right = rib[1:3] - np.column_stack([np.zeros(2), across[1:3] * size, np.full(2, -edge * rng.uniform(0.3, 1.0))])
    faces = [[rib[0], s[0], rib[3]] for s in (left, right)] + [[s[0], s[1], rib[3]] for s in (left, right)]
    turn = rng.uniform(-np.pi, np.pi)
    c, s = np.cos(turn), np.sin(turn)
    triangles = np.array(faces) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    rgb = mixed(p.leaf_rgb, p.dry_rgb, 0.6 * tone)
    return sunlit(triangles, tinted(rgb, 1, 0.15, rng).repeat(4, axis=0), thin=True)


def stone(p: WorldParams, size: float, tone: float, rng: np.random.Generator) -> Plant:
    """A boulder, partly below ground: the hull of random points on an uneven ellipsoid. size: its largest width (m)."""
    axes = size / 2 * np.array([1.0, rng.uniform(0.6, 0.95), rng.uniform(0.4, 0.75)])
    points = directions(p.stone_corners, rng) * rng.uniform(0.85, 1.05, (p.stone_corners, 1)) * axes
    turn = rng.uniform(-np.pi, np.pi)
    points[:, :2] = points[:, :2] @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    points[:, 2] += rng.uniform(-0.25, 0.3) * axes[2]
    faces = hull(points)
    faces = faces[faces[:, :, 2].max(axis=1) > 0]
    light = 0.88 + 0.12 * np.clip(faces[:, :, 2].mean(axis=1) / axes[2], 0, 1)
    return sunlit(faces, tinted(p.stone_rgb, 1, 0.1, rng) * light[:, None])
