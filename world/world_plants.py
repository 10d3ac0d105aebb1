"""The plants of any world, and the world with other triangles: what changes of worlds are made of."""

import dataclasses
import logging
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8

from .errors import SettingError
from .plant_groups import GROUND, OTHER, PlantGroups
from .scene import World, once_per_world
from .terrain import MAX_SLOPE, MIN_SHARE, Terrain, pieces

log = logging.getLogger(__name__)

PIECE = "piece"  # kind of the plants of a world whose plants are not known
MAX_WIDTH = 0.5  # share of the field's width; a piece that is wider is ground, a wall or a hedge
TRIES = 20  # positions that are tried for a plant before it stays where it is


def plants_of(world: World) -> PlantGroups:
    """The plants of a world. Where these are not known, pieces of connected triangles count as plants.

    Pieces do not count that are ground: what agents stand on, what covers a tenth of the field, and what is wider than half of it.
    Nor does a plant of which a triangle is ground.

    Raises:
        SettingError: Where there are none.
    """
    plants = _plants_of(world)
    if len(plants) == 0:
        known = "has none" if world.plants is not None else "is in one piece with its ground, or has no other"
        raise SettingError(
            f"this change is of plants, and the world {known}; give a world with plants as separate pieces, or leave the change out"
        )
    return plants


@once_per_world
def _plants_of(world: World) -> PlantGroups:
    ground = is_ground(world)
    if world.plants is not None:
        if not ground.any():
            return world.plants
        under = np.unique(world.plants.of[ground & (world.plants.of >= 0)])
        return dataclasses.replace(
            world.plants, of=np.where(np.isin(world.plants.of, under), GROUND, world.plants.of).astype(np.int32)
        )
    of = _loose_pieces(world, ground)
    count = int(of.max(initial=-1)) + 1
    if count:
        log.warning(
            "the plants of this world are not known: its %d separate pieces of connected triangles count as plants, the %d triangles of "
            "wide pieces and of the ground do not",
            count,
            int((of < 0).sum()),
        )
    return PlantGroups(
        of=of, kinds=(PIECE,), kind=np.zeros(count, np.uint8), foot=_feet(world.triangles, of, count).astype(np.float32)
    )


def is_ground(world: World) -> Bool[np.ndarray, " n"]:
    """Which triangles of a world agents stand on."""
    n = len(world.triangles)
    return world.terrain.is_ground[:n] if isinstance(world.terrain, Terrain) else np.zeros(n, dtype=bool)


def _loose_pieces(world: World, ground: Bool[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """The number of the piece of each triangle, OTHER where it is ground or wide."""
    corners = world.triangles.astype(np.float64)
    piece = pieces(corners)
    n = int(piece.max(initial=-1)) + 1
    low, high = np.full((n, 2), np.inf), np.full((n, 2), -np.inf)
    np.minimum.at(low, piece, corners[..., :2].min(axis=1))
    np.maximum.at(high, piece, corners[..., :2].max(axis=1))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = np.abs(normal[:, 2]) >= np.cos(MAX_SLOPE) * np.linalg.norm(normal, axis=1)
    covered = np.bincount(piece, np.abs(normal[:, 2]) / 2 * level, minlength=n)
    size = world.field.size
    fixed = (high - low > MAX_WIDTH * size).any(axis=1) | (covered >= MIN_SHARE * size.prod())
    fixed[piece[ground]] = True
    number = np.where(fixed, OTHER, np.cumsum(~fixed) - 1)
    return number[piece].astype(np.int32)


def _feet(triangles: Float32[np.ndarray, "n 3 3"], of: Int[np.ndarray, " n"], count: int) -> Float[np.ndarray, "k 3"]:
    """Where pieces stand (m): their lowest height, and the mean of the corners that are as low, to a millimetre."""
    corner, piece = triangles.reshape(-1, 3).astype(np.float64), np.repeat(of, 3)
    corner, piece = corner[piece >= 0], piece[piece >= 0]
    low = np.full(count, np.inf)
    np.minimum.at(low, piece, corner[:, 2])
    lowest = corner[:, 2] <= low[piece] + 0.001
    number = np.bincount(piece[lowest], minlength=count)
    x, y = (np.bincount(piece[lowest], corner[lowest, axis], minlength=count) / number for axis in (0, 1))
    return np.column_stack([x, y, low])


def plants_of_kinds(plants: PlantGroups, kinds: Collection[str]) -> Int[np.ndarray, " k"]:
    """The numbers of the plants of some kinds that have triangles; all kinds where none is named. Raises SettingError."""
    if unknown := [kind for kind in kinds if kind not in plants.kinds]:
        raise SettingError(f"this world has no plants of the kind {unknown[0]!r}; it has {', '.join(plants.kinds)}")
    there = np.bincount(plants.of[plants.of >= 0], minlength=len(plants)) > 0
    if kinds:
        there &= np.isin(plants.kind, [plants.kinds.index(kind) for kind in kinds])
    return np.flatnonzero(there)


def share_of(numbers: Int[np.ndarray, " n"], share: float, rng: np.random.Generator) -> Int[np.ndarray, " k"]:
    """A share of some numbers, drawn; a larger share of the same generator has all of a smaller one."""
    return rng.permutation(numbers)[: round(share * len(numbers))]


@dataclass(frozen=True, eq=False)
class NewTriangles:
    """Triangles in place of those of a world.

    Attributes:
        source: (m,) The triangle of the world that each is made of: it keeps its colour, texture and plant.
        triangles: (m, 3, 3) Corners (m).
        weights: (m, 3, 3) How the texture coordinates and colours of corners (second axis) are mixed of those of the source; None:
            they are the same.
    """

    source: Int[np.ndarray, " m"]
    triangles: Float32[np.ndarray, "m 3 3"]
    weights: Float[np.ndarray, "m 3 3"] | None = None


def with_triangles(world: World, new: NewTriangles, plants: PlantGroups | None, *, copied: int = 0) -> World:
    """A world of other triangles, each made of one that it has, on the same ground.

    Args:
        world: The world.
        new: The triangles.
        plants: Which plants these are.
        copied: How many of the last triangles are copies; none of these is ground.
    """
    source, texturing = new.source, world.texturing
    if texturing is not None:
        uv, colours = texturing.uv[source], None if texturing.colours is None else texturing.colours[source]
        if new.weights is not None:
            uv = (new.weights @ uv.astype(np.float64)).astype(np.float32)
            colours = None if colours is None else np.rint(new.weights @ colours.astype(np.float64)).astype(np.uint8)
        texturing = dataclasses.replace(texturing, index=texturing.index[source], uv=uv, colours=colours)
    changed = dataclasses.replace(
        world,
        triangles=new.triangles,
        rgb=world.rgb[source],
        texturing=texturing,
        reflectance=None if world.reflectance is None else world.reflectance[source],
        plants=plants,
        terrain=None,
    )
    ground = is_ground(world)[source]
    ground[len(source) - copied :] = False
    return on_ground_of(changed, world, ground, source[: len(source) - copied])


def on_ground_of(changed: World, world: World, ground: Bool[np.ndarray, " n"], source: Int[np.ndarray, " m"]) -> World:
    """A changed world with the ground of the world before: its triangles that are ground, and the flat rectangle.

    Args:
        changed: The world, without a terrain.
        world: The world before.
        ground: Which triangles are ground now.
        source: What the first of its triangles were before, in ascending order.
    """
    terrain = world.terrain
    if isinstance(terrain, Terrain):
        flat = terrain.is_ground[len(world.triangles) :]
        part = terrain.part and tuple(np.searchsorted(source, terrain.part).tolist())
        terrain = Terrain(changed.surfaces()[0], np.concatenate([ground, flat]), terrain.max_slope, part)
    return dataclasses.replace(changed, terrain=terrain)


def moved_triangles(world: World, triangles: Float[np.ndarray, "n 3 3"]) -> World:
    """A world whose triangles have other corners (m), and stay the same in all else."""
    same = NewTriangles(np.arange(len(world.triangles)), triangles.astype(np.float32))
    return with_triangles(world, same, plants_of(world))


def without_plants(plants: PlantGroups, source: Int[np.ndarray, " m"]) -> PlantGroups:
    """The plants of some of the triangles; those that have none of them are left out, and the others numbered anew."""
    of = plants.of[source]
    left = np.bincount(plants.of[plants.of >= 0], minlength=len(plants)) == 0  # had none before
    left[of[of >= 0]] = True
    number = np.where(left, np.cumsum(left) - 1, -1)
    return PlantGroups(
        of=np.where(of >= 0, number[np.maximum(of, 0)], of).astype(np.int32),
        kinds=plants.kinds,
        kind=plants.kind[left],
        foot=plants.foot[left],
    )


def ground_heights(world: World, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """Height of the ground that plants stand on at positions (m); nan where there is none. Nothing flies."""
    if isinstance(world.terrain, Terrain):
        return world.terrain.height(xy)
    if world.ground is None and (_plants_of(world).of < 0).any():  # a mesh whose ground agents do not stand on
        return _loose_ground(world).height(xy)
    return np.zeros(len(xy))


@once_per_world
def _loose_ground(world: World) -> Terrain:
    """The triangles that are in no plant, as a ground."""
    return Terrain(world.triangles, _plants_of(world).of < 0, MAX_SLOPE)


def spots(
    world: World,
    feet: Float[np.ndarray, "n 3"],
    candidates: Float[np.ndarray, "tries n 2"],
) -> Float[np.ndarray, "n 3"]:
    """Where plants stand: at the first of some positions (m) that has ground, or else where they stood."""
    chosen, open_ = np.array(feet, dtype=np.float64), np.ones(len(feet), dtype=bool)
    before = ground_heights(world, feet[:, :2])
    for xy in candidates:
        if not open_.any():
            break
        height = ground_heights(world, xy)
        here = open_ & ~np.isnan(height)
        rise = np.where(np.isnan(before), 0.0, height - before)
        chosen[here] = np.column_stack([xy, feet[:, 2] + rise])[here]
        open_ &= ~here
    return chosen


def appended(
    world: World,
    triangles: Float32[np.ndarray, "k 3 3"],
    rgb: UInt8[np.ndarray, "k 3"],
    reflectance: UInt8[np.ndarray, "k 3"],
) -> World:
    """A world with more triangles, of one colour each, which are in no plant."""
    texturing, plants, k = world.texturing, _plants_of(world), len(rgb)
    if texturing is not None:
        own = np.concatenate([np.repeat(rgb[:, None], 3, axis=1), np.full((k, 3, 1), 255, np.uint8)], axis=2)
        texturing = dataclasses.replace(
            texturing,
            index=np.concatenate([texturing.index, np.full(k, -1, np.int32)]),
            uv=np.concatenate([texturing.uv, np.zeros((k, 3, 2), np.float32)]),
            colours=np.concatenate([texturing.corner_colours(world.rgb), own]),
        )
    plants = dataclasses.replace(plants, of=np.concatenate([plants.of, np.full(k, OTHER, np.int32)]))
    changed = dataclasses.replace(
        world,
        triangles=np.concatenate([world.triangles, triangles]),
        rgb=np.concatenate([world.rgb, rgb]),
        texturing=texturing,
        reflectance=None if world.reflectance is None else np.concatenate([world.reflectance, reflectance]),
        plants=plants,
        terrain=None,
    )
    return on_ground_of(
        changed, world, np.concatenate([is_ground(world), np.zeros(k, dtype=bool)]), np.arange(len(world.rgb))
    )
