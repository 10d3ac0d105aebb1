"""The world of an experiment, opened: what agents stand or fly on, and its light."""

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from tussock.world.errors import SettingError
from tussock.world.files import open_world
from tussock.world.flight import Flight, check_flight
from tussock.world.ground_check import remark_on_ground
from tussock.world.params import is_generated
from tussock.world.scene import World

if TYPE_CHECKING:
    from .surroundings import Surroundings


def lit_world(surroundings: "Surroundings") -> World:
    """The world in its light."""
    world = world_and_ground(surroundings)
    if surroundings.light is None:
        return world
    from tussock.render.lighting import lit  # loads numba, which a world without a light need not wait for

    return lit(world, surroundings.light.make())


def world_and_ground(surroundings: "Surroundings") -> World:
    """The world, with what agents stand or fly on."""
    surroundings.check_reading()
    seed = surroundings.seed if surroundings.world_seed is None else surroundings.world_seed
    world = (
        surroundings.world
        if isinstance(surroundings.world, World)
        else open_world(str(surroundings.world), seed, surroundings.reading)
    )
    world = dataclasses.replace(world, double_sided=False) if surroundings.cull_back_faces else world
    if surroundings.ground == "mesh":
        return world.on_mesh(surroundings.max_slope)
    if surroundings.ground == "route" or surroundings.altitude is not None:
        return world.flown(flight_in(surroundings, world))
    if world.terrain is not None:
        return world if isinstance(surroundings.world, World) else world.on_mesh(surroundings.max_slope)
    if isinstance(surroundings.world, str) and not is_generated(surroundings.world):
        remark_on_ground(world, surroundings.world, surroundings.eye.z)
    return world


def flight_in(surroundings: "Surroundings", world: World) -> Flight:
    """Where agents fly, below their eye. Raises SettingError where the route has no heights, or is under the ground."""
    if surroundings.altitude is not None:
        places = np.array([[0.0, 0.0, surroundings.altitude]])
    else:
        route = surroundings.given_route(world)
        if route is None or route.heights is None:
            raise SettingError(
                "ground route flies at the heights of a route: give one with a column z_m that has a number in each row, or an altitude"
            )
        places = np.column_stack([route.xy, route.heights])
    check_flight(world, places)
    return Flight(places - [0, 0, surroundings.eye.z])
