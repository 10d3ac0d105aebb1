"""Wind: plants bend. For `Change`, of change.py.

A plant turns about its foot, towards where the wind blows, by an angle that grows with the distance from the foot. Blades of tussocks
turn about their own feet. The distance of every point from the foot stays the same, so that the length of a blade hardly changes.
"""

import dataclasses
import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from jaxtyping import Float, Int

from .geometry import wrap_angle
from .plant_groups import PlantGroups
from .scene import World
from .settings import number, settings
from .terrain import pieces
from .world_plants import moved_triangles, plants_of

if TYPE_CHECKING:
    from .geometry import Route

STATES = 8  # of a gusty wind
FLATTEST = math.radians(85.0)  # inclination of a blade in the strongest wind, if it has no strength at all
# Slender plants: share of the angle between their inclination and FLATTEST by which they turn at an amount of 1.
SLENDER = {"grass": 0.65, "culm": 0.65, "tussock": 0.55}
# Bushy ones: angle by which their top turns (rad).
BUSHY = {"herb": 0.4, "bush": 0.2, "tree": 0.08}
STIFF = ("stone", "pebble", "litter", "leaf")  # kinds that do not bend; litter and fallen leaves lie on the ground
BY_BLADE = ("tussock",)  # kinds whose blades have feet of their own
GROWTH_OF_ANGLE = 0.1  # exponent, over the distance from the foot; small, as the length of a blade changes with it
SLENDERNESS = 3.0  # a plant of an unknown kind is slender where its height is this many times its width
LOW, TALL = 0.02, 1.0  # m; plants of unknown kinds bend as bushes between these heights, as trees above, and not below
VARIATION = 0.2  # plants bend by up to this share more or less than others of their kind
VEERING = math.radians(30.0)  # standard deviation of the direction of gusts of strength 1


@settings
class Wind:
    """Blades, leaves and stems bend about the foot of their plant, slender kinds more than bushes and trees, and stones not at all.

    Attributes:
        amount: 1: an upright blade of grass is inclined by about 55 degrees.
        direction: Where the wind blows to (rad, counter-clockwise from east).
        gusts: From 0 to 1. 0: the wind is the same all the time. Otherwise each step of a walk has one of 8 states of the wind, whose
            amounts differ by up to this share, and whose directions differ by 30 degrees times this (standard deviation).
    """

    name: ClassVar[str] = "wind"
    amount: float = number(low=0, high=1)
    direction: float = number(0.0, low=-2 * math.pi, high=2 * math.pi, unit="rad")
    gusts: float = number(0.0, low=0, high=1)

    @property
    def states(self) -> int:
        """How many states the wind has."""
        return STATES if self.gusts and self.amount else 1

    def in_state(self, state: int, rng: np.random.Generator) -> "Wind":
        """The wind in one of its states. `rng` is drawn from for all of them, so that the plants differ alike in each."""
        strength, veer = rng.uniform(-1, 1, STATES)[state], rng.normal(0, VEERING, STATES)[state]
        return Wind(
            amount=float(np.clip(self.amount * (1 + self.gusts * strength), 0, 1)),
            direction=float(wrap_angle(self.direction + self.gusts * veer)),
        )

    def __call__(self, world: World, rng: np.random.Generator, route: "Route | None" = None) -> World:
        """The changed world."""
        plants = plants_of(world)
        flexibility = 1 + VARIATION * rng.uniform(-1, 1, len(plants))
        triangles = world.triangles.astype(np.float64)
        for these, strength in _by_law(world, plants, self.amount * flexibility):
            triangles[these.rows] = these.bent(triangles[these.rows], strength, self.direction)
        return moved_triangles(world, triangles)


@dataclasses.dataclass(frozen=True, eq=False)
class _Bending:
    """Triangles that bend in the same way.

    Attributes:
        rows: Which they are.
        group: (n,) The plant or blade that each belongs to, from 0.
        slender: Whether these are slender.
        floor: (n,) Height of the ground beneath each (m).
    """

    rows: Int[np.ndarray, " n"]
    group: Int[np.ndarray, " n"]
    slender: bool
    floor: Float[np.ndarray, " n"]

    def bent(
        self, triangles: Float[np.ndarray, "n 3 3"], strength: Float[np.ndarray, " n"], direction: float
    ) -> Float[np.ndarray, "n 3 3"]:
        """The triangles in the wind.

        Args:
            triangles: Corners (m).
            strength: Of each: a share for slender ones, and an angle for others (rad).
            direction: Where the wind blows to (rad).
        """
        corner, group = triangles.reshape(-1, 3), np.repeat(self.group, 3)
        foot = feet_of(corner, group)[group]
        ahead = np.array([math.cos(direction), math.sin(direction), 0.0])
        offset = corner - foot
        along, up = offset @ ahead, offset[:, 2]
        distance = np.linalg.norm(offset, axis=1)
        longest = np.zeros(group.max(initial=-1) + 1)
        np.maximum.at(longest, group, distance)
        share = distance / np.maximum(longest[group], 1e-9)
        turn = np.repeat(strength, 3)
        if self.slender:
            inclined = np.full(len(longest), -np.pi / 2)
            far = share > 0.3  # the corners at the foot do not tell how a blade is inclined
            np.maximum.at(inclined, group[far], np.arctan2(along[far], up[far]))
            turn = turn * np.maximum(FLATTEST - inclined[group], 0.0)
        turn = turn * share ** (GROWTH_OF_ANGLE if self.slender else 1.0)
        c, s = np.cos(turn), np.sin(turn)
        new = corner + ((c - 1) * along + s * up)[:, None] * ahead
        new[:, 2] = foot[:, 2] + c * up - s * along
        lowest = np.minimum(corner[:, 2], np.repeat(self.floor, 3))
        new[:, 2] = np.maximum(new[:, 2], lowest)
        return new.reshape(-1, 3, 3)


def feet_of(corner: Float[np.ndarray, "n 3"], group: Int[np.ndarray, " n"]) -> Float[np.ndarray, "groups 3"]:
    """Where groups of corners stand (m): the mean of their lowest corners, to half a millimetre."""
    count = int(group.max(initial=-1)) + 1
    low = np.full(count, np.inf)
    np.minimum.at(low, group, corner[:, 2])
    lowest = corner[:, 2] <= low[group] + 0.0005
    number = np.bincount(group[lowest], minlength=count)
    x, y, z = (np.bincount(group[lowest], corner[lowest, axis], minlength=count) / number for axis in range(3))
    return np.column_stack([x, y, z])


def _by_law(
    world: World, plants: PlantGroups, strength: Float[np.ndarray, " plants"]
) -> "list[tuple[_Bending, Float[np.ndarray, ' n']]]":
    """Triangles that bend in the same way, and how strongly each."""
    slender, angle = _flexibility(world, plants)
    blades = np.array([kind in BY_BLADE for kind in plants.kinds], dtype=bool)[plants.kind]
    laws = []
    for is_slender, by_blade in ((True, True), (True, False), (False, False)):
        chosen = (slender == is_slender) & (blades == by_blade) & (angle > 0)
        rows = np.flatnonzero(plants.per_triangle(chosen, False))
        if len(rows) == 0:
            continue
        of = plants.of[rows]
        group = pieces(world.triangles[rows].astype(np.float64)) if by_blade else of
        bending = _Bending(rows, np.unique(group, return_inverse=True)[1], is_slender, plants.foot[of, 2].astype(float))
        laws.append((bending, (strength * angle)[of]))
    return laws


def _flexibility(world: World, plants: PlantGroups) -> "tuple[np.ndarray, Float[np.ndarray, ' plants']]":
    """Of each plant, whether it is slender, and its share or angle at an amount of 1; by its kind, or else by its shape."""
    low, high = np.full((len(plants), 3), np.inf), np.full((len(plants), 3), -np.inf)
    inside = plants.of >= 0
    np.minimum.at(low, plants.of[inside], world.triangles[inside].min(axis=1))
    np.maximum.at(high, plants.of[inside], world.triangles[inside].max(axis=1))
    size = np.maximum(high - low, 0)
    width, height = size[:, :2].max(axis=1), size[:, 2]
    slender = height > SLENDERNESS * width
    angle = np.where(slender, SLENDER["grass"], np.where(height > TALL, BUSHY["tree"], BUSHY["bush"]))
    angle[height < LOW] = 0.0
    for number_, kind in enumerate(plants.kinds):
        here = plants.kind == number_
        if kind in SLENDER or kind in BUSHY or kind in STIFF:
            slender[here], angle[here] = kind in SLENDER, SLENDER.get(kind, BUSHY.get(kind, 0.0))
    return slender, angle
