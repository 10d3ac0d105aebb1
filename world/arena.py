"""A round arena, as in laboratories: a plain floor, and around it a wall with dark bars and shapes."""

import numpy as np
from jaxtyping import Float

from .errors import SettingError
from .generate import seeded
from .geometry import Bounds
from .plant_groups import no_plants
from .plant_parts import Plant, coloured, joined
from .scene import Ground, World

SIDES = 240  # of the wall
BANDS = 6  # of the wall's brightness, from its foot to its top
THICKNESS = 0.02  # m, of the wall
IN_FRONT = 0.001  # m; so far in front of the wall are the cues
FIELD = 0.68  # half of the field's side, in radii: all of the field is inside the wall
FLOOR_MARGIN = 0.5  # m; the floor continues so far beyond the wall
FLOOR_RGB, WALL_RGB, LAMP_RGB = (176, 172, 164), (226, 224, 218), (206, 214, 222)
CUE_RGB = ((34, 34, 38), (38, 62, 112), (44, 92, 62))  # black, blue, green
SHAPES = ("disc", "triangle", "square", "cross")
LIMITS = {
    "diameter": (0.5, 50.0),
    "wall_height": (0.05, 10.0),
    "bars": (0, 100),
    "shapes": (0, 50),
    "irregular": (0.0, 1.0),
}


def arena(
    seed: int, diameter: float = 3.0, wall_height: float = 0.7, bars: int = 9, shapes: int = 4, irregular: float = 1.0
) -> World:
    """A round arena about (0, 0), with cues on its wall. The field is the square inside it.

    Args:
        seed: A whole number from 0.
        diameter: Inner diameter of the wall (m).
        wall_height: Height of the wall (m).
        bars: Number of dark vertical bars on the wall, from its foot to its top or to somewhere below.
        shapes: Number of other shapes among them: discs, triangles, squares and crosses.
        irregular: How much bars vary in position, width and height: from 0, regular stripes, to 1.

    Raises:
        SettingError: For invalid values.
    """
    values = {"diameter": diameter, "wall_height": wall_height, "bars": bars, "shapes": shapes, "irregular": irregular}
    for name, value in values.items():
        _check(name, value)
    places, looks = seeded(seed).spawn(2)
    radius = diameter / 2
    pieces = [_wall(radius, wall_height)]
    n = bars + shapes
    is_bar = np.isin(
        np.arange(n), np.floor((np.arange(bars) + places.random() * irregular) * n / max(bars, 1)).astype(int)
    )
    middle = (np.arange(n) + irregular * places.uniform(-0.2, 0.2, n)) * 2 * np.pi / max(n, 1) + places.uniform(
        -np.pi, np.pi
    )
    for angle, bar in zip(middle.tolist(), is_bar.tolist(), strict=True):
        slot = 2 * np.pi / n
        pieces.append(
            _bar(radius, wall_height, angle, slot, irregular, looks)
            if bar
            else _shape(radius, wall_height, angle, slot, looks)
        )
    half = FIELD * radius
    reach = radius + THICKNESS + FLOOR_MARGIN
    return World(
        **joined(pieces)._asdict(),
        plants=no_plants(sum(len(piece.rgb) for piece in pieces)),
        ground=Ground(FLOOR_RGB, Bounds(-reach, -reach, reach, reach)),
        sky_rgb=LAMP_RGB,
        field=Bounds(-half, -half, half, half),
        origin={"preset": "arena", "seed": int(seed), **values},
    )


def _check(name: str, value: float) -> None:
    """Refuse an invalid parameter. Raises SettingError."""
    low, high = LIMITS[name]
    whole = name in ("bars", "shapes")
    if isinstance(value, bool) or not isinstance(value, int if whole else int | float) or not low <= value <= high:
        kind = "whole number" if whole else "number"
        raise SettingError(f"the arena's {name} is {value!r}; give a {kind} from {low:g} to {high:g}")


def _wall(radius: float, height: float) -> Plant:
    """The wall, lit by lamps above: brighter at its top, and a little more on one side. Its rim is darker."""
    angle = np.linspace(-np.pi, np.pi, SIDES, endpoint=False)
    inner, outer = (r * np.column_stack([np.cos(angle), np.sin(angle)]) for r in (radius, radius + THICKNESS))
    rings = [np.column_stack([inner, np.full(SIDES, share * height)]) for share in np.linspace(0, 1, BANDS + 1)]
    rings.append(np.column_stack([outer, np.full(SIDES, height)]))
    rings.append(np.column_stack([outer, np.zeros(SIDES)]))
    lights = [*np.linspace(0.9, 1.0, BANDS), 0.5, 0.6]
    triangles, rgb = [], []
    for low, high, light in zip(rings[:-1], rings[1:], lights, strict=True):
        next_low, next_high = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        sides = [np.stack([low, next_high, next_low], axis=1), np.stack([low, high, next_high], axis=1)]
        triangles.append(np.stack(sides, axis=1).reshape(-1, 3, 3))
        rgb.append(np.array(WALL_RGB) * (light * (0.95 + 0.05 * np.cos(angle - 1.0))).repeat(2)[:, None])
    return coloured(np.concatenate(triangles), np.concatenate(rgb), np.ones(len(lights) * 2 * SIDES))


def _bar(radius: float, height: float, angle: float, slot: float, irregular: float, rng: np.random.Generator) -> Plant:
    """A vertical bar in the middle of a slot (both rad)."""
    width = slot * (0.5 + irregular * rng.uniform(-0.28, 0.1))
    top = height * (1 - irregular * max(0.0, float(rng.uniform(-0.25, 0.55))))
    parts = int(np.ceil(width / (2 * np.pi / SIDES)))  # so narrow that the bar follows the wall
    half = radius * width / parts / 2
    outline = np.array([(-half, 0.0), (half, 0.0), (half, top), (-half, top)])
    middles = angle + width * ((np.arange(parts) + 0.5) / parts - 0.5)
    return joined([_on_wall(radius, each, outline, CUE_RGB[0]) for each in middles.tolist()])


def _shape(radius: float, height: float, angle: float, slot: float, rng: np.random.Generator) -> Plant:
    """A shape in the middle of a slot (both rad), at some height on the wall."""
    kind, rgb = SHAPES[int(rng.integers(len(SHAPES)))], CUE_RGB[int(rng.integers(len(CUE_RGB)))]
    size = min(0.5 * height, 0.75 * slot * radius) * rng.uniform(0.8, 1.0)
    middle = rng.uniform(0.6 * size, height - 0.6 * size)
    outlines = [outline * size + (0.0, middle) for outline in _outlines(kind)]
    return joined([_on_wall(radius, angle, outline, rgb) for outline in outlines])


def _outlines(kind: str) -> list[Float[np.ndarray, "corners 2"]]:
    """The convex parts of a shape that is about 1 wide, counter-clockwise."""
    if kind == "cross":
        bar = np.array([(-0.5, -0.14), (0.5, -0.14), (0.5, 0.14), (-0.5, 0.14)])
        return [bar, bar[::-1, ::-1]]
    corners = {"disc": 24, "triangle": 3, "square": 4}[kind]
    turn = (np.arange(corners) + (0.5 if kind == "square" else 0.25 if kind == "triangle" else 0)) * 2 * np.pi / corners
    return [np.column_stack([np.cos(turn), np.sin(turn)]) * (0.5 if kind == "disc" else 0.6)]


def _on_wall(radius: float, angle: float, outline: Float[np.ndarray, "corners 2"], rgb: tuple[int, int, int]) -> Plant:
    """A convex shape in front of the wall.

    Args:
        radius: Of the wall (m).
        angle: Direction of its middle (rad).
        outline: Distance along the wall from there, and height (m), of its corners, as seen from inside.
        rgb: Its colour.
    """
    inside = radius * np.cos(np.pi / SIDES) - IN_FRONT
    around = angle - outline[:, 0] / radius
    corners = np.column_stack([inside * np.cos(around), inside * np.sin(around), outline[:, 1]])
    fan = np.arange(1, len(corners) - 1)
    triangles = np.stack([corners[np.zeros_like(fan)], corners[fan], corners[fan + 1]], axis=1)
    return coloured(triangles, np.tile(np.array(rgb), (len(fan), 1)), np.ones(len(fan)))
