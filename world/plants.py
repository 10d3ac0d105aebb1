"""Plants and stones, each standing at the origin with z up, as triangles with one colour each.

Every function draws from the generator it is given and returns corners in metres, (n, 3, 3) float32, and colours,
(n, 3) uint8. Sunlight is baked into the colours, so a plant may be moved but not turned.
"""

import numpy as np
from jaxtyping import Float, Float32, UInt8
from scipy.spatial import ConvexHull

from .scene import RGB

Plant = tuple[Float32[np.ndarray, "n 3 3"], UInt8[np.ndarray, "n 3"]]

SUN = np.array([0.48, -0.36, 0.80])  # unit vector towards the sun: a morning in the south-east
UP = np.array([0.0, 0.0, 1.0])


def tussock(
    *, height: float, spread: float, blades: int, rgb: RGB, dry_rgb: RGB, dry_share: float, rng: np.random.Generator
) -> Plant:
    """A clump of bent, tapering blades.

    height: of its upright blades (m). spread: radius of its foot (m). dry_share: share of dead blades, 0..1.
    """
    segments = np.array([2, 3, 4])[rng.choice(3, blades, p=[0.55, 0.35, 0.1])] if blades > 8 else np.full(blades, 2)
    outward = np.sqrt(rng.random(blades))
    angle = rng.uniform(-np.pi, np.pi, blades)
    foot = spread * outward[:, None] * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(blades)])
    dry = rng.random(blades) < dry_share
    lean = 0.05 + outward * rng.uniform(0.1, 0.75, blades) + 0.25 * dry
    bend = rng.gamma(2.0, 0.32, blades) + 0.5 * dry  # dead blades hang lower
    length = height * (1.12 - 0.35 * outward) * rng.lognormal(0, 0.22, blades) * np.where(dry, 0.85, 1.0)
    width = (0.010 + 0.04 * height) * rng.lognormal(0, 0.3, blades)
    side = angle + rng.normal(0, 0.5, blades)
    tint = np.where(dry[:, None], _tinted(dry_rgb, blades, 0.10, rng), _tinted(rgb, blades, 0.14, rng))
    pieces = []
    for k in np.unique(segments).tolist():
        these = segments == k
        spine = _spines(foot[these], side[these], length[these], lean[these], bend[these], k)
        triangles = _ribbons(spine, side[these], width[these])
        pieces.append(_bake(triangles.reshape(-1, 3, 3), _base_to_tip(tint[these], triangles, height), thin=True))
    return _joined(pieces)


def grass(*, height: float, blades: int, rgb: RGB, flower_rgb: RGB | None = None, rng: np.random.Generator) -> Plant:
    """One or a few upright blades, with a flower on the tallest if it has a colour. height: of its blades (m)."""
    side = rng.uniform(-np.pi, np.pi, blades)
    foot = np.column_stack([rng.normal(0, 0.012, (blades, 2)), np.zeros(blades)])
    length = height * rng.uniform(0.65, 1.1, blades)
    width = (0.004 + 0.036 * height) * rng.lognormal(0, 0.25, blades)
    segments = 2 if height > 0.13 else 1  # a short blade's bend is not seen
    spine = _spines(foot, side, length, rng.gamma(2.0, 0.09, blades), rng.gamma(2.0, 0.22, blades), segments)
    triangles = _ribbons(spine, side, width)
    tint = _base_to_tip(_tinted(rgb, blades, 0.16, rng), triangles, height)
    pieces = [_bake(triangles.reshape(-1, 3, 3), tint, thin=True)]
    if flower_rgb is not None:
        tip = spine[length.argmax(), -1]
        petals = _leaves(np.repeat(tip[None], 3, axis=0), _directions(3, rng) + UP, 0.022 + 0.03 * height, rng)
        pieces.append(_bake(petals, _tinted(flower_rgb, 3, 0.08, rng), thin=True))
    return _joined(pieces)


def bush(*, height: float, width: float, leaves: int, rgb: RGB, bark_rgb: RGB, rng: np.random.Generator) -> Plant:
    """Branching stems with many small leaves. height, width: of the whole, roughly (m)."""
    stems, twigs = max(3, min(7, leaves // 18)), max(2, min(5, leaves // 25))
    side = np.linspace(0, 2 * np.pi, stems, endpoint=False) + rng.uniform(0, 0.9, stems) + rng.uniform(0, 6)
    lean = np.arctan2(width / 2, height) * rng.uniform(0.2, 1.5, stems)
    length = height * rng.uniform(0.55, 1.0, stems)
    foot = np.column_stack([rng.normal(0, 0.03 * width, (stems, 2)), np.zeros(stems)])
    spine = _spines(foot, side, length, lean, rng.uniform(-0.3, 0.5, stems), 3)

    parent, share = np.repeat(np.arange(stems), twigs), rng.uniform(0.25, 0.9, stems * twigs)
    fork = _along(spine[parent], share)
    twig_side = side[parent] + rng.normal(0, 1.1, len(parent))
    twig_length = length[parent] * rng.uniform(0.25, 0.55, len(parent))
    twig = _spines(fork, twig_side, twig_length, rng.uniform(0.2, 1.2, len(parent)), rng.normal(0, 0.3, len(parent)), 1)

    on_twig = rng.random(leaves) < 0.75
    place = np.where(
        on_twig[:, None],
        _along(twig[rng.integers(len(twig), size=leaves)], rng.uniform(0.2, 1.05, leaves)),
        _along(spine[rng.integers(stems, size=leaves)], rng.uniform(0.4, 1.0, leaves)),
    ) + rng.normal(0, 0.03 * height, (leaves, 3))
    size = np.sqrt(1.7 * height * width / leaves) * rng.lognormal(0, 0.2, leaves)
    place[:, 2] = np.maximum(place[:, 2], 0.8 * size + 0.02)
    outward = place - [0, 0, 0.35 * height]
    triangles = _kites(place, outward / height + 0.8 * _directions(leaves, rng), size, rng)
    depth = 0.72 + 0.34 * np.clip(place[:, 2] / height, 0, 1) + 0.12 * _facing_sun(outward)
    wood = _bake(
        np.concatenate(
            [
                _ribbons(spine, side, 0.016 * height + 0.005).reshape(-1, 3, 3),
                _ribbons(twig, twig_side, 0.008 * height + 0.003).reshape(-1, 3, 3),
            ]
        ),
        np.array(bark_rgb),
    )
    return _joined(
        [wood, _bake(triangles, (_tinted(rgb, leaves, 0.12, rng) * depth[:, None]).repeat(2, axis=0), thin=True)]
    )


def tree(
    *, height: float, width: float, taper: float, leaves: int, rgb: RGB, bark_rgb: RGB, rng: np.random.Generator
) -> Plant:
    """A tree or tall shrub for the skyline: a bent trunk and a crown of uneven lumps.

    height, width: of the whole (m). taper: the crown's form, 0 round to 1 conical. leaves: triangles of the crown.
    """
    bare = rng.uniform(0.02, 0.22) * height  # trunk below the crown
    if leaves < 30:
        return _plain_tree(height, width, bare, leaves, rgb, bark_rgb, rng)
    lumps = int(np.clip(leaves // 9, 3, 12))
    level = (np.arange(lumps) + rng.uniform(0, 1, lumps)) / lumps  # share of the crown's height
    reach = (1 - taper) * np.sqrt(1 - (1.6 * level - 0.7) ** 2) + taper * (1.05 - level)
    angle = np.cumsum(rng.normal(2.4, 0.5, lumps))  # the golden angle, roughly: lumps to all sides
    radius = width * np.maximum(0.16, 0.30 * reach) * rng.uniform(0.75, 1.2, lumps)
    off = np.maximum(width / 2 * reach - 0.7 * radius, 0) * rng.uniform(0.4, 1.15, lumps)
    z = bare + radius * 0.6 + level * (height - bare - 1.3 * radius)
    centre = np.column_stack([off * np.cos(angle), off * np.sin(angle), z])

    spine = _spines(np.zeros((1, 3)), angle[:1], np.array([0.8 * height]), np.array([0.05]), np.array([0.12]), 2)
    fork = _along(spine.repeat(lumps, axis=0), np.clip(0.85 * z / height, 0.1, 0.95))
    limb = np.stack([fork, centre + 0.5 * radius[:, None] * UP], axis=1)
    limbs = _ribbons(limb, angle, 0.014 * height + 0.01).reshape(-1, 3, 3)
    wood = np.concatenate([_spikes(spine, 0.012 * height + 0.01), limbs])
    which = np.searchsorted(np.cumsum(radius**2) / (radius**2).sum(), (np.arange(leaves) + 0.5) / leaves)
    out = _directions(leaves, rng)
    out[:, 2] = np.where(rng.random(leaves) < 0.6, np.abs(out[:, 2]), out[:, 2])  # more leaves on the sunny side
    place = centre[which] + out * radius[which, None] * [1, 1, 0.8] * rng.uniform(0.55, 1.0, (leaves, 1))
    size = np.sqrt((2.6 + taper) * (radius**2).sum() / leaves) * rng.lognormal(0, 0.2, leaves)
    place[:, 2] = np.maximum(place[:, 2], 0.8 * size + 0.05)
    triangles = _leaves(place, out + 0.5 * _directions(leaves, rng), size, rng)
    light = (0.62 + 0.3 * place[:, 2] / height + 0.28 * _facing_sun(out)) * rng.lognormal(0, 0.08, lumps)[which]
    tint = np.clip(_tinted(rgb, leaves, 0.06, rng) * light[:, None], 0, 255)
    return _joined([_bake(wood, np.array(bark_rgb)), (triangles.astype(np.float32), tint.astype(np.uint8))])


def _plain_tree(height, width, bare, leaves: int, rgb: RGB, bark_rgb: RGB, rng: np.random.Generator) -> Plant:
    """A tree of about `leaves` triangles and a three-sided trunk: its crown is one angular lump."""
    spine = np.array([[[0, 0, 0], [0, 0, 0.8 * height]]])
    corners = max(4, leaves // 2 + 2)  # a hull of n corners has 2 n - 4 faces
    z = 1 - (2 * np.arange(corners) + 1) / corners
    angle = np.arange(corners) * 2.4 + rng.uniform(0, 2 * np.pi) + rng.normal(0, 0.25, corners)
    around = np.sqrt(1 - z**2) * width / 2 * rng.uniform(0.75, 1.3, corners)
    middle, half = (height + bare) / 2, (height - bare) / 2
    crown = _hull(np.column_stack([around * np.cos(angle), around * np.sin(angle), middle + half * z]))
    return _joined([_bake(_spikes(spine, 0.02 * height), np.array(bark_rgb)), _bake(crown, np.array(rgb))])


def leaf(*, length: float, rgb: RGB, rng: np.random.Generator) -> Plant:
    """A fallen leaf, curled, lying nearly flat. length: from stalk to tip (m)."""
    along, across = np.array([0, 0.3, 0.7, 1.0]), np.array([0, 1, 0.75, 0]) * rng.uniform(0.18, 0.3)
    edge, tip = length * rng.uniform(0.02, 0.09, 2) * np.array([1, 1.2])  # how far its edges and its tip curl up
    rib = np.column_stack([along * length, np.zeros(4), tip * along**3 + 0.001])
    left = rib[1:3] + np.column_stack([np.zeros(2), across[1:3] * length, np.full(2, edge)])
    right = rib[1:3] - np.column_stack([np.zeros(2), across[1:3] * length, np.full(2, -edge * rng.uniform(0.3, 1.0))])
    faces = [[rib[0], s[0], rib[3]] for s in (left, right)] + [[s[0], s[1], rib[3]] for s in (left, right)]
    turn = rng.uniform(-np.pi, np.pi)
    c, s = np.cos(turn), np.sin(turn)
    triangles = np.array(faces) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    return _bake(triangles, _tinted(rgb, 1, 0.15, rng).repeat(4, axis=0), thin=True)


def stone(*, size: float, corners: int, rgb: RGB, rng: np.random.Generator) -> Plant:
    """A boulder, partly sunk: the hull of random points on an uneven ellipsoid. size: its largest width (m)."""
    axes = size / 2 * np.array([1.0, rng.uniform(0.6, 0.95), rng.uniform(0.4, 0.75)])
    points = _directions(corners, rng) * rng.uniform(0.85, 1.05, (corners, 1)) * axes
    turn = rng.uniform(-np.pi, np.pi)
    points[:, :2] = points[:, :2] @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    points[:, 2] += rng.uniform(-0.25, 0.3) * axes[2]
    faces = _hull(points)
    faces = faces[faces[:, :, 2].max(axis=1) > 0]
    low = 0.88 + 0.12 * np.clip(faces[:, :, 2].mean(axis=1) / axes[2], 0, 1)
    return _bake(faces, _tinted(rgb, 1, 0.1, rng) * low[:, None])


def _spines(foot, azimuth, length, lean, bend, segments: int) -> Float[np.ndarray, "n points 3"]:
    """Middle lines of n blades: from `foot` (n, 3) m towards `azimuth`, inclined by `lean` at the foot and by
    `lean + bend` at the tip (rad from upright); `segments + 1` points each, none below the ground."""
    middle = (np.arange(segments) + 0.5) / segments
    tilt = np.minimum(lean[:, None] + bend[:, None] * middle**1.4, 2.6)
    step = (length / segments)[:, None]
    out, rise = np.cumsum(np.sin(tilt) * step, axis=1), np.cumsum(np.cos(tilt) * step, axis=1)
    rest = np.stack([out * np.cos(azimuth)[:, None], out * np.sin(azimuth)[:, None], rise], axis=2) + foot[:, None]
    rest[..., 2] = np.maximum(rest[..., 2], 0.004)
    return np.concatenate([foot[:, None], rest], axis=1)


def _ribbons(spine, azimuth, width) -> Float[np.ndarray, "n triangles 3 3"]:
    """Flat blades along spines, tapering to a point, their faces across `azimuth` and slightly twisted."""
    share = np.linspace(0, 1, spine.shape[1])
    half = np.broadcast_to(width, azimuth.shape)[:, None] / 2 * (1 - share**1.4) * (0.85 + 0.6 * share)
    turn = azimuth[:, None] + 0.5 * share * np.sin(7 * azimuth)[:, None]  # a twist that differs between blades
    across = half[..., None] * np.stack([-np.sin(turn), np.cos(turn), np.zeros_like(turn)], axis=2)
    left, right = spine - across, spine + across
    lower = np.stack([left[:, :-1], right[:, :-1], right[:, 1:]], axis=2)
    upper = np.stack([left[:, :-2], right[:, 1:-1], left[:, 1:-1]], axis=2)
    return np.concatenate([lower, upper], axis=1)


def _spikes(spine, radius: float) -> Float[np.ndarray, "triangles 3 3"]:
    """Three-sided tapering stems along spines: solid from every side."""
    thick = radius * np.linspace(1, 0, spine.shape[1])
    corners = np.arange(3) * 2 * np.pi / 3
    ring = np.stack([np.cos(corners), np.sin(corners), np.zeros(3)], axis=1)
    side = spine[:, :, None] + thick[:, None, None] * ring  # (n, points, 3 corners, 3)
    beside = np.roll(side, -1, axis=2)
    lower = np.stack([side[:, :-1], beside[:, :-1], beside[:, 1:]], axis=3)
    upper = np.stack([side[:, :-2], beside[:, 1:-1], side[:, 1:-1]], axis=3)
    return np.concatenate([lower.reshape(-1, 3, 3), upper.reshape(-1, 3, 3)])


def _leaves(place, normal, size, rng: np.random.Generator) -> Float[np.ndarray, "n 3 3"]:
    """One uneven triangle a leaf around `place` (n, 3), about `size` m long, its face towards `normal`."""
    along, across = _leaf_axes(normal, rng)
    ahead, behind, beside = (
        np.broadcast_to(size, len(place)) * rng.uniform([0.45, 0.3, 0.35], [0.75, 0.55, 0.5], (len(place), 3)).T
    )
    tip, stalk = place + along * ahead[:, None], place - along * behind[:, None]
    left, right = stalk + across * beside[:, None], stalk + along * 0.4 * behind[:, None] - across * beside[:, None]
    return np.stack([tip, left, right], axis=1)


def _kites(place, normal, size, rng: np.random.Generator) -> Float[np.ndarray, "n 3 3"]:
    """Two triangles a leaf, folded along its rib, around `place` (n, 3); else as `_leaves`."""
    along, across = _leaf_axes(normal, rng)
    size = np.broadcast_to(size, len(place))[:, None]
    tip, stalk, wide = place + 0.6 * size * along, place - 0.5 * size * along, place - 0.1 * size * along
    fold = 0.12 * size * np.cross(across, along)
    beside = size * rng.uniform(0.2, 0.3, (len(place), 1)) * across
    left, right = wide + beside + fold, wide - beside + fold
    return np.stack([np.stack([tip, left, stalk], axis=1), np.stack([tip, stalk, right], axis=1)], axis=1).reshape(
        -1, 3, 3
    )


def _leaf_axes(normal, rng: np.random.Generator):
    """Unit vectors along and across leaves whose faces are towards `normal` (n, 3), turned at random."""
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.cross(normal, _directions(len(normal), rng))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return along, np.cross(normal, along)


def _hull(points) -> Float[np.ndarray, "faces 3 3"]:
    """The convex hull's triangles, facing outwards."""
    faces = points[ConvexHull(points).simplices]
    inwards = (_normals(faces) * (faces.mean(axis=1) - points.mean(axis=0))).sum(axis=1) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    return faces


def _along(spine, share) -> Float[np.ndarray, "n 3"]:
    """Points at shares of spines (0 foot, 1 tip; a little beyond is allowed)."""
    position = share * (spine.shape[1] - 1)
    low = np.clip(position.astype(int), 0, spine.shape[1] - 2)
    rows = np.arange(len(spine))
    return spine[rows, low] + (position - low)[:, None] * (spine[rows, low + 1] - spine[rows, low])


def _directions(n: int, rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Unit vectors drawn evenly over the sphere."""
    z, angle = rng.uniform(-1, 1, n), rng.uniform(-np.pi, np.pi, n)
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


def _normals(triangles) -> Float[np.ndarray, "n 3"]:
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]  # np.cross is slow on a few rows
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)


def _facing_sun(direction) -> Float[np.ndarray, " n"]:
    """Cosine of the angle between directions (n, 3) and the sun."""
    return direction @ SUN / np.maximum(np.linalg.norm(direction, axis=1), 1e-9)


def _tinted(rgb: RGB, n: int, strength: float, rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """n shades of a colour: brightness varies by about `strength`, hue by a third of it."""
    return np.array(rgb) * rng.lognormal(0, strength, (n, 1)) * rng.lognormal(0, strength / 3, (n, 3))


def _base_to_tip(tint, triangles, height: float) -> Float[np.ndarray, "n 3"]:
    """Colours of blades' triangles (blade, triangle, corner, xyz): dark where they are shaded, near the ground."""
    rise = np.clip(triangles[..., 2].mean(axis=2) / height, 0, 1)
    return (tint[:, None] * (0.58 + 0.5 * rise**0.6)[..., None]).reshape(-1, 3)


def _bake(triangles, rgb, thin: bool = False) -> Plant:
    """Colours with sunlight in them. A thin thing lets the light through, so both its sides are as bright."""
    facing = _normals(triangles) @ SUN
    light = 0.68 + 0.4 * np.abs(facing) if thin else 0.70 + 0.4 * np.maximum(facing, 0) + 0.1 * np.minimum(facing, 0)
    rgb = np.clip(np.broadcast_to(rgb, (len(triangles), 3)) * light[:, None], 0, 255)
    return triangles.astype(np.float32), rgb.astype(np.uint8)


def _joined(pieces: list) -> Plant:
    return np.concatenate([p[0] for p in pieces]), np.concatenate([p[1] for p in pieces])
