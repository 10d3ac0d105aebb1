"""A world in the light of a sun and a sky: shadows and brightness become part of the colours of its triangles and of its ground.

Then every renderer draws them as any other colours. A triangle has one share of sunlight, that of POINTS points spread over it; the flat
ground has textures, with sun or shadow in each texel. The mathematics of light is in world/light.py.
"""

import dataclasses
import logging
import math

import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.errors import SettingError
from tussock.world.geometry import Bounds
from tussock.world.ground import Ground, GroundPart, shadow_picture
from tussock.world.light import Light
from tussock.world.scene import World
from tussock.world.terrain import Terrain
from tussock.world.textures import Texture, Texturing, product_table, to_display

from .shadows import in_the_sun, in_the_sun_on_a_level

log = logging.getLogger(__name__)

POINTS = {1: 4e-4, 4: 25e-4, 16: math.inf}  # points on a triangle, and the largest area of such triangles (m^2)
TEXEL = 0.01  # m; of the ground in the field and BORDER around it
BORDER = 1.0  # m
MAX_TEXELS = 1_000_000  # of a part of the ground; of a larger part, they are larger
FAR_TEXEL = 0.1  # m; of the ground farther out
MAX_FAR_TEXELS = 250_000
LIFT = 0.005  # m; rays from the ground begin on the speckles and the litter that an insect walks over


def lit(world: World, light: Light) -> World:
    """The world in a light. Its shapes and its plants stay as they are, and the same arguments give the same bytes.

    Raises SettingError for a world that is lit already.
    """
    if world.light is not None:
        raise SettingError(
            "the world is lit by a sun already; "
            + ("write it without a light, and give --light" if world.unlit is None else "light World.unlit")
        )
    if world.texturing is not None and world.texturing.may_have_holes().any():
        log.warning("triangles with holes in their textures cast whole shadows")
    reflectance = world.rgb if world.reflectance is None else world.reflectance
    brightness = np.rint(255 * to_display(light_on_triangles(world, light))).astype(np.uint8)
    rgb = product_table()[reflectance, brightness[:, None]]
    texturing = world.texturing and _shaded(world.texturing, reflectance, brightness)
    ground = world.ground and _lit_ground(world, world.ground, light)
    lit_world = dataclasses.replace(world, rgb=rgb, texturing=texturing, ground=ground, light=light, unlit=world)
    if ground is None or not isinstance(world.terrain, Terrain):
        return lit_world
    return dataclasses.replace(lit_world, terrain=_on_parts(world.terrain, lit_world))


def light_on_triangles(world: World, light: Light) -> Float[np.ndarray, " n"]:
    """Light on each triangle (0..1), see `Light.on`."""
    a, b, c = np.moveaxis(world.triangles.astype(float), 1, 0)
    across = np.cross(b - a, c - a)
    double_area = np.linalg.norm(across, axis=1)
    normals = across / np.maximum(double_area, 1e-12)[:, None]
    shares, smallest = np.zeros(len(a)), -1.0
    for count, largest in POINTS.items():
        chosen = np.flatnonzero((double_area / 2 > smallest) & (double_area / 2 <= largest))
        smallest = largest
        weights = _spread(count)
        points = np.einsum("pk,nkx->npx", weights, world.triangles[chosen].astype(float))
        free = in_the_sun(world, points.reshape(-1, 3), light.sun, chosen.repeat(count)) if light.direct else None
        shares[chosen] = 0.0 if free is None else free.reshape(-1, count).mean(axis=1)
    facing = normals @ light.sun > 0
    if not world.double_sided:  # the back of a solid is never in the sun
        shares = shares * facing
    return light.on(normals, shares)


def _spread(count: int) -> Float[np.ndarray, "count 3"]:
    """Weights of the corners for points spread evenly over a triangle: the middles of the 4, 16 .. equal parts that it is cut into."""
    parts = np.eye(3)[None]
    while len(parts) < count:
        a, b, c = np.moveaxis(parts, 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = np.concatenate(
            [np.stack(each, axis=1) for each in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return parts.mean(axis=1)


def _shaded(texturing: Texturing, rgb: UInt8[np.ndarray, "n 3"], brightness: UInt8[np.ndarray, " n"]) -> Texturing:
    """Textures on triangles of some brightness (display values): the colours of their corners are darker."""
    colours = texturing.corner_colours(rgb)
    darker = colours.copy()
    darker[..., :3] = product_table()[colours[..., :3], brightness[:, None, None]]
    return dataclasses.replace(texturing, colours=darker)


def _lit_ground(world: World, ground: Ground, light: Light) -> Ground:
    """The ground with sun and shadow on it."""
    parts = _parts(ground.bounds, world.field.widened(BORDER))
    pictures = [_ground_texture(world, ground, part, texel, light) for part, texel in parts]
    return dataclasses.replace(
        ground, parts=tuple(GroundPart(part, picture) for (part, _), picture in zip(parts, pictures, strict=True))
    )


def _on_parts(terrain: Terrain, lit_world: World) -> Terrain:
    """What agents stand on, if it is the flat ground as well: its triangles are more in a lit world."""
    n = len(lit_world.triangles)
    triangles, _ = lit_world.surfaces()
    is_ground = np.concatenate([terrain.is_ground[:n], np.full(len(triangles) - n, terrain.is_ground[n:].any())])
    return Terrain(triangles, is_ground, terrain.max_slope, terrain.part)


def _parts(ground: Bounds, fine: Bounds) -> list[tuple[Bounds, float]]:
    """The ground as rectangles with the width of their texels (m): one with the finest, and those around it."""
    x0, y0, x1, y1 = ground
    left, low, right, high = max(x0, fine[0]), max(y0, fine[1]), min(x1, fine[2]), min(y1, fine[3])
    if left >= right or low >= high:
        return [(ground, _texel(ground, FAR_TEXEL, MAX_FAR_TEXELS))]
    inner = Bounds(left, low, right, high)
    around = [
        Bounds(x0, y0, x1, low),
        Bounds(x0, high, x1, y1),
        Bounds(x0, low, left, high),
        Bounds(right, low, x1, high),
    ]
    far = [part for part in around if part.size.min() > 0]
    return [
        (inner, _texel(inner, TEXEL, MAX_TEXELS)),
        *((part, _texel(part, FAR_TEXEL, MAX_FAR_TEXELS)) for part in far),
    ]


def _texel(part: Bounds, wanted: float, most: int) -> float:
    """The width of the texels of a part of the ground (m): as wanted, or larger where they would be more than `most`."""
    return max(wanted, math.sqrt(float(np.prod(part.size)) / most))


def _ground_texture(world: World, ground: Ground, part: Bounds, texel: float, light: Light) -> Texture:
    """A part of the ground in sun and shadow, seen from above with north at the top."""
    columns, rows = np.maximum(1, np.ceil(part.size / texel)).astype(int).tolist()
    free = np.zeros((rows, columns), bool)
    if light.direct:
        free = in_the_sun_on_a_level(world, part, rows, columns, LIFT, light.sun)
    up = np.array([[0.0, 0.0, 1.0]])
    shade, sun = (np.rint(255 * to_display(light.on(up, share))).astype(np.uint8)[0] for share in (0.0, 1.0))
    rgba = np.empty((rows, columns, 4), np.uint8)
    rgba[..., :3] = product_table()[np.array(ground.rgb), np.where(free, sun, shade)[..., None]]
    rgba[..., 3] = 255
    return shadow_picture(rgba)
