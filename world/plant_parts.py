"""What plants are made of: blades, leaves, stems and hulls, and their colours.

Triangles are (n, 3, 3): triangle, corner, xyz (m, z up). Colours include sunlight.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float32, UInt8

from .settings import RGB

SUN = np.array([0.48, -0.36, 0.80])  # unit vector towards the sun: a morning in the south-east
UP = np.array([0.0, 0.0, 1.0])


class Plant(NamedTuple):
    """The triangles of a plant, or of many.

    Attributes:
        triangles: (n, 3, 3) triangle, corner, xyz (m, z up).
        rgb: (n, 3) one colour per triangle, as sunlight from SUN makes it.
        reflectance: (n, 3) the colours that rgb is made of: those in even light.
    """

    triangles: Float32[np.ndarray, "n 3 3"]
    rgb: UInt8[np.ndarray, "n 3"]
    reflectance: UInt8[np.ndarray, "n 3"]


NO_PLANT = Plant(np.zeros((0, 3, 3), np.float32), np.zeros((0, 3), np.uint8), np.zeros((0, 3), np.uint8))


def spines(foot, azimuth, length, lean, bend, segments: int) -> Float[np.ndarray, "n points 3"]:
    """Middle lines of n blades or stems, `segments + 1` points each, none of them below the ground.

    Args:
        foot: (n, 3) position of the lower end (m).
        azimuth: (n,) direction in which it leans (rad).
        length: (n,) length (m).
        lean: (n,) inclination at the foot (rad from upright).
        bend: (n,) how much more it is inclined at the tip (rad).
        segments: Number of straight segments.
    """
    middle = (np.arange(segments) + 0.5) / segments
    tilt = np.minimum(lean[:, None] + bend[:, None] * middle**1.4, 2.6)
    step = (length / segments)[:, None]
    out, rise = np.cumsum(np.sin(tilt) * step, axis=1), np.cumsum(np.cos(tilt) * step, axis=1)
    rest = np.stack([out * np.cos(azimuth)[:, None], out * np.sin(azimuth)[:, None], rise], axis=2) + foot[:, None]
    rest[..., 2] = np.maximum(rest[..., 2], 0.004)
    return np.concatenate([foot[:, None], rest], axis=1)


def points_along(spine, share) -> Float[np.ndarray, "n 3"]:
    """A point on each spine, at a share of its length (0 foot, 1 tip; a little beyond is allowed)."""
    position = share * (spine.shape[1] - 1)
    low = np.clip(position.astype(int), 0, spine.shape[1] - 2)
    rows = np.arange(len(spine))
    return spine[rows, low] + (position - low)[:, None] * (spine[rows, low + 1] - spine[rows, low])


def ribbons(spine, azimuth, width) -> Float[np.ndarray, "n triangles 3 3"]:
    """Flat blades along spines, tapering to a point and slightly twisted; their faces look towards `azimuth`."""
    share = np.linspace(0, 1, spine.shape[1])
    half = np.broadcast_to(width, azimuth.shape)[:, None] / 2 * (1 - share**1.4) * (0.85 + 0.6 * share)
    turn = azimuth[:, None] + 0.5 * share * np.sin(7 * azimuth)[:, None]  # a twist that differs between blades
    across = half[..., None] * np.stack([-np.sin(turn), np.cos(turn), np.zeros_like(turn)], axis=2)
    left, right = spine - across, spine + across
    lower = np.stack([left[:, :-1], right[:, :-1], right[:, 1:]], axis=2)
    upper = np.stack([left[:, :-2], right[:, 1:-1], left[:, 1:-1]], axis=2)
    return np.concatenate([lower, upper], axis=1)


def spikes(spine, radius: float) -> Float[np.ndarray, "triangles 3 3"]:
    """Three-sided tapering stems along spines, which look solid from every side."""
    thickness = radius * np.linspace(1, 0, spine.shape[1])
    corners = np.arange(3) * 2 * np.pi / 3
    ring = np.stack([np.cos(corners), np.sin(corners), np.zeros(3)], axis=1)
    side = spine[:, :, None] + thickness[:, None, None] * ring  # (n, points, 3 corners, 3)
    following = np.roll(side, -1, axis=2)
    lower = np.stack([side[:, :-1], following[:, :-1], following[:, 1:]], axis=3)
    upper = np.stack([side[:, :-2], following[:, 1:-1], side[:, 1:-1]], axis=3)
    return np.concatenate([lower.reshape(-1, 3, 3), upper.reshape(-1, 3, 3)])


def simple_leaves(position, normal, size, rng: np.random.Generator) -> Float[np.ndarray, "n 3 3"]:
    """Leaves of one uneven triangle each, at `position` (n, 3), about `size` long (m); their faces look towards `normal`."""
    along, across = _leaf_axes(normal, rng)
    low, high = [0.45, 0.3, 0.35], [0.75, 0.55, 0.5]
    ahead, behind, half_width = np.broadcast_to(size, len(position)) * rng.uniform(low, high, (len(position), 3)).T
    tip, stalk = position + along * ahead[:, None], position - along * behind[:, None]
    left = stalk + across * half_width[:, None]
    right = stalk + along * 0.4 * behind[:, None] - across * half_width[:, None]
    return np.stack([tip, left, right], axis=1)


def folded_leaves(position, normal, size, rng: np.random.Generator) -> Float[np.ndarray, "n 3 3"]:
    """Leaves of two triangles each, folded along the rib; the arguments are those of `simple_leaves`."""
    along, across = _leaf_axes(normal, rng)
    size = np.broadcast_to(size, len(position))[:, None]
    tip, stalk, middle = position + 0.6 * size * along, position - 0.5 * size * along, position - 0.1 * size * along
    fold = 0.12 * size * np.cross(across, along)
    half_width = size * rng.uniform(0.2, 0.3, (len(position), 1)) * across
    left, right = middle + half_width + fold, middle - half_width + fold
    halves = [np.stack([tip, left, stalk], axis=1), np.stack([tip, stalk, right], axis=1)]
    return np.stack(halves, axis=1).reshape(-1, 3, 3)


def _leaf_axes(normal, rng: np.random.Generator):
    """Unit vectors along and across leaves whose faces look towards `normal` (n, 3), in random directions."""
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.cross(normal, directions(len(normal), rng))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    return along, np.cross(normal, along)


def hull(points) -> Float[np.ndarray, "faces 3 3"]:
    """The triangles of the convex hull of points (n, 3); their front sides look outwards."""
    from scipy.spatial import ConvexHull  # takes half a second, which a world from a file need not wait for

    faces = points[ConvexHull(points).simplices]
    inwards = (_normals(faces) * (faces.mean(axis=1) - points.mean(axis=0))).sum(axis=1) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    return faces


def directions(n: int, rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Unit vectors, drawn uniformly over the sphere."""
    z, angle = rng.uniform(-1, 1, n), rng.uniform(-np.pi, np.pi, n)
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), z])


def facing_sun(direction) -> Float[np.ndarray, " n"]:
    """Cosine of the angle between directions (n, 3) and the sun."""
    return direction @ SUN / np.maximum(np.linalg.norm(direction, axis=1), 1e-9)


def mixed(rgb: RGB, other: RGB, share: float) -> RGB:
    """A colour with a share of another one."""
    r, g, b = (round(a + (c - a) * share) for a, c in zip(rgb, other, strict=True))
    return r, g, b


def tinted(rgb: RGB, n: int, strength: float, rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """n shades of a colour: the log of the brightness varies by `strength` (standard deviation), the hue by a third of it."""
    return np.array(rgb) * rng.lognormal(0, strength, (n, 1)) * rng.lognormal(0, strength / 3, (n, 3))


def darker_below(rgb, triangles, height) -> Float[np.ndarray, "n 3"]:
    """Colours of the triangles of blades (blade, triangle, corner, xyz): dark near the ground, where they are shaded.

    height: that of the plant (m), or of the plant of each blade.
    """
    rise = np.clip(triangles[..., 2].mean(axis=2) / np.reshape(height, (-1, 1)), 0, 1)
    return (rgb[:, None] * (0.58 + 0.5 * rise**0.6)[..., None]).reshape(-1, 3)


def sunlit(triangles, rgb, thin: bool = False) -> Plant:
    """Triangles with sunlight in their colours. thin: light shines through, so both sides are equally bright."""
    facing = _normals(triangles) @ SUN
    light = 0.68 + 0.4 * np.abs(facing) if thin else 0.70 + 0.4 * np.maximum(facing, 0) + 0.1 * np.minimum(facing, 0)
    return coloured(triangles, np.broadcast_to(rgb, (len(triangles), 3)), light)


def coloured(triangles, rgb, light) -> Plant:
    """Triangles whose colours (n, 3) are multiplied by the light on them (n,)."""
    lit = np.clip(rgb * light[:, None], 0, 255).astype(np.uint8)
    return Plant(triangles.astype(np.float32), lit, np.clip(rgb, 0, 255).astype(np.uint8))


def hazy(plant: Plant, sky_rgb: RGB, haze: float) -> Plant:
    """What stands far away: with a share of the sky's colour in its own."""
    mixed_rgb = ((each * (1 - haze) + np.array(sky_rgb) * haze).astype(np.uint8) for each in plant[1:])
    return Plant(plant.triangles, *mixed_rgb)


def joined(pieces: list[Plant]) -> Plant:
    """Several pieces as one plant."""
    return Plant(*map(np.concatenate, zip(*pieces, strict=True)))


def _normals(triangles) -> Float[np.ndarray, "n 3"]:
    """Unit normals of triangles, towards their front side."""
    a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    normal = a[:, [1, 2, 0]] * b[:, [2, 0, 1]] - a[:, [2, 0, 1]] * b[:, [1, 2, 0]]  # np.cross is slow on a few rows
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
