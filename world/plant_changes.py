"""Plants that are gone, stand elsewhere, are more, or have grown. For `Change`, of change.py."""

import dataclasses
from typing import TYPE_CHECKING, Any, ClassVar

import attrs
import numpy as np
from jaxtyping import Float

from .plant_groups import PlantGroups
from .scene import World
from .settings import number, settings
from .world_plants import (
    TRIES,
    NewTriangles,
    moved_triangles,
    plants_of,
    plants_of_kinds,
    share_of,
    spots,
    with_triangles,
    without_plants,
)

if TYPE_CHECKING:
    from .geometry import Route

HIGHER, WIDER = 2.0, 1.5  # factors of growth at an amount of 1
NOT_GROWING = ("stone", "pebble", "litter", "leaf")  # kinds that PlantGroups calls plants


def _names(value: Any) -> Any:
    """Names of kinds: one, or several."""
    return (value,) if isinstance(value, str) else tuple(value) if isinstance(value, list | tuple) else value


def _kinds() -> Any:
    """A field for names of kinds of plants."""
    texts = attrs.validators.deep_iterable(attrs.validators.instance_of(str), attrs.validators.instance_of(tuple))
    return attrs.field(default=(), converter=_names, validator=texts)


@settings
class Removed:
    """A share of the plants is gone. With the same seed, what is gone at a smaller amount is gone at a larger one.

    Attributes:
        amount: The share.
        kinds: Kinds of plants that it is a share of, such as tussock or tussock,grass; all where none is named.
    """

    name: ClassVar[str] = "removed"
    amount: float = number(low=0, high=1)
    kinds: tuple[str, ...] = _kinds()

    def __call__(self, world: World, rng: np.random.Generator, route: "Route | None" = None) -> World:
        """The changed world."""
        plants = plants_of(world)
        gone = share_of(plants_of_kinds(plants, self.kinds), self.amount, rng)
        kept = np.flatnonzero(~np.isin(plants.of, gone))
        return with_triangles(world, NewTriangles(kept, world.triangles[kept]), without_plants(plants, kept))


@settings
class Moved:
    """A share of the plants stands elsewhere. A plant stays where it was if there is no ground around it.

    Attributes:
        amount: The share.
        distance: No plant is farther than this from where it was (m).
        kinds: As of `Removed`.
    """

    name: ClassVar[str] = "moved"
    amount: float = number(low=0, high=1)
    distance: float = number(0.5, above=0, high=1000, unit="m")
    kinds: tuple[str, ...] = _kinds()

    def __call__(self, world: World, rng: np.random.Generator, route: "Route | None" = None) -> World:
        """The changed world."""
        plants = plants_of(world)
        chosen = share_of(plants_of_kinds(plants, self.kinds), self.amount, rng)
        angle, radius = rng.uniform(-np.pi, np.pi, (TRIES, len(plants))), rng.random((TRIES, len(plants)))
        offset = self.distance * np.sqrt(radius)[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        feet = plants.foot[chosen].astype(np.float64)
        shift = np.zeros((len(plants), 3))
        shift[chosen] = spots(world, feet, feet[:, :2] + offset[:, chosen]) - feet
        moved = dataclasses.replace(plants, foot=(plants.foot + shift).astype(np.float32))
        rows = np.flatnonzero(np.isin(plants.of, chosen))
        triangles = world.triangles.astype(np.float64)
        triangles[rows] += shift[plants.of[rows], None]
        return dataclasses.replace(moved_triangles(world, triangles), plants=moved)


@settings
class Added:
    """More plants: copies of those in the field, each turned, at new positions in the field. They keep the colours of what they copy.

    Attributes:
        amount: How many there are more, as a share of the plants in the field.
        kinds: As of `Removed`.
    """

    name: ClassVar[str] = "added"
    amount: float = number(low=0, high=1)
    kinds: tuple[str, ...] = _kinds()

    def __call__(self, world: World, rng: np.random.Generator, route: "Route | None" = None) -> World:
        """The changed world."""
        plants, field = plants_of(world), world.field
        those = plants_of_kinds(plants, self.kinds)
        inside = those[field.contains(*plants.foot[those, :2].T)]
        chosen = share_of(inside, self.amount, rng)
        xy = np.array(field[:2]) + field.size * rng.random((TRIES, len(inside), 2))
        turn = rng.uniform(-np.pi, np.pi, len(inside))[: len(chosen)]
        feet = plants.foot[chosen].astype(np.float64)
        new = spots(world, feet, xy[:, : len(chosen)])
        rows, copy = _rows_of(plants, chosen)
        triangles = world.triangles[rows] - feet[copy, None]
        triangles = _turned(triangles, turn[copy]) + new[copy, None]
        groups = PlantGroups(
            of=np.concatenate([plants.of, len(plants) + copy]).astype(np.int32),
            kinds=plants.kinds,
            kind=np.concatenate([plants.kind, plants.kind[chosen]]),
            foot=np.concatenate([plants.foot, new.astype(np.float32)]),
        )
        source = np.concatenate([np.arange(len(world.triangles)), rows])
        corners = np.concatenate([world.triangles, triangles.astype(np.float32)])
        return with_triangles(world, NewTriangles(source, corners), groups, copied=len(rows))


def _rows_of(plants: PlantGroups, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The triangles of some plants, and the place of the plant of each among these."""
    place = np.full(len(plants), -1)
    place[chosen] = np.arange(len(chosen))
    of = plants.per_triangle(place, -1)
    rows = np.flatnonzero(of >= 0)
    return rows, of[rows]


def _turned(triangles: Float[np.ndarray, "n 3 3"], turn: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 3 3"]:
    """Triangles turned to the left about the vertical axis (rad)."""
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    x, y, z = np.moveaxis(triangles, -1, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)


@settings
class Grown:
    """All plants are higher and wider: at an amount of 1, twice as high and one and a half times as wide. Stones, litter and fallen
    leaves do not grow.

    Attributes:
        amount: Of this growth.
        kinds: As of `Removed`.
    """

    name: ClassVar[str] = "grown"
    amount: float = number(low=0, high=1)
    kinds: tuple[str, ...] = _kinds()

    def __call__(self, world: World, rng: np.random.Generator, route: "Route | None" = None) -> World:
        """The changed world."""
        plants = plants_of(world)
        chosen = plants_of_kinds(plants, self.kinds)
        if not self.kinds:
            chosen = chosen[[plants.kinds[k] not in NOT_GROWING for k in plants.kind[chosen]]]
        rows = np.flatnonzero(np.isin(plants.of, chosen))
        wider, higher = (1 + self.amount * (factor - 1) for factor in (WIDER, HIGHER))
        triangles = world.triangles.astype(np.float64)
        foot = plants.foot[plants.of[rows], None].astype(np.float64)
        triangles[rows] = foot + (triangles[rows] - foot) * [wider, wider, higher]
        return moved_triangles(world, triangles)
