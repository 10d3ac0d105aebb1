"""A new object in view. For `Change`, of change.py."""

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from jaxtyping import Float

from .obstacles import clearance
from .plant_parts import hull, sunlit
from .scene import World
from .settings import choice, number, settings
from .world_plants import appended, ground_heights

if TYPE_CHECKING:
    from .geometry import Route

HEIGHT, WIDTH = 1.0, 0.3  # m, at an amount of 1
NEAR, FAR = 0.3, 0.5  # m from the middle of the route to that of the object
RGB = (86, 84, 82)  # grey, as of a box or a post that somebody put there
SIDES = 16  # of a cylinder
SINK = 0.02  # m that an object is below the ground, so that it has no gap to a slope
TRIES = 20  # positions, of which the best one is taken


@settings
class NewObject:
    """A new object stands next to the middle of the route, 0.3 to 0.5 m from it, where a route is known, or else in the field.

    Attributes:
        amount: At 1 it is 1 m high and 0.3 m wide; both are proportional to this.
        shape: "cylinder" or "box".
    """

    name: ClassVar[str] = "object"
    amount: float = number(low=0, high=1)
    shape: str = choice("cylinder", ("cylinder", "box"))

    def __call__(self, world: World, rng: np.random.Generator, route: "Route | None" = None) -> World:
        """The changed world."""
        xy = _place(world, rng, route, WIDTH * self.amount)
        turn = rng.uniform(-np.pi, np.pi)
        z = float(np.nan_to_num(ground_heights(world, xy[None])[0]))
        sides = SIDES if self.shape == "cylinder" else 4
        radius = WIDTH / 2 * self.amount * (1 if self.shape == "cylinder" else math.sqrt(2))
        angle = turn + np.arange(sides) * 2 * np.pi / sides
        ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
        corners = np.concatenate(
            [np.column_stack([ring, np.full(sides, height)]) for height in (-SINK, HEIGHT * self.amount)]
        )
        faces = hull(corners + np.array([*xy, z]))
        made = sunlit(faces, np.array(RGB))
        return appended(world, made.triangles, made.rgb, made.reflectance)


def _place(world: World, rng: np.random.Generator, route: "Route | None", width: float) -> Float[np.ndarray, "2"]:
    """Where an object of some width (m) stands (m): of several positions that have ground, the one with most room, off the route."""
    field = world.field
    if route is None:
        xy = np.array(field[:2]) + field.size * rng.uniform(0.25, 0.75, (TRIES, 2))
        off = np.zeros(TRIES)
    else:
        x, y, heading = route.at(route.length / 2)[0].tolist()
        side, distance = rng.choice([-1, 1], TRIES), rng.uniform(NEAR, FAR, TRIES)
        left = np.array([-math.sin(heading), math.cos(heading)])
        xy = np.array([x, y]) + (side * distance)[:, None] * left
        off = np.minimum(route.nearest(xy)[0], NEAR)  # all that are far enough are equal, and the first is taken
    off = off + np.minimum(clearance(world, xy), width)  # it may stand in a plant where there is no other room
    off = np.where(np.isnan(ground_heights(world, xy)), -1.0, off)
    return xy[off.argmax()]
