"""The world of an experiment, opened: what agents stand or fly on, and its light."""

import dataclasses
from typing import TYPE_CHECKING

import attrs
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
    """The world in its light. One in memory that is lit already stands on the ground that is asked for, and is lit anew."""
    light = None if surroundings.light is None else surroundings.light.make()
    given = surroundings.world if isinstance(surroundings.world, World) else None
    if given is None or given.unlit is None or light is not None:
        world = world_and_ground(surroundings, given)
    else:
        before = given.without_light()
        world, light = world_and_ground(surroundings, before), given.light
        if world is before:
            return given
    if light is None:
        return world
    from tussock.render.lighting import lit  # loads numba, which a world without a light need not wait for

    return lit(world, light)


def world_and_ground(surroundings: "Surroundings", world: World | None) -> World:
    """The world, with what agents stand or fly on. world: the one in memory; None: it is opened."""
    surroundings.check_reading()
    in_memory = world is not None
    if world is None:
        seed = surroundings.seed if surroundings.world_seed is None else surroundings.world_seed
        world = open_world(str(surroundings.world), seed, surroundings.reading)
    world = dataclasses.replace(world, double_sided=False) if surroundings.cull_back_faces else world
    if surroundings.ground == "mesh":
        return world.on_mesh(surroundings.max_slope)
    if surroundings.ground == "route" or surroundings.altitude is not None:
        return world.flown(flight_in(surroundings, world))
    if world.terrain is not None:
        keeps = in_memory and surroundings.max_slope == attrs.fields_dict(type(surroundings))["max_slope"].default
        return world if keeps else world.on_mesh(surroundings.max_slope)
    if not in_memory and not is_generated(surroundings.world):
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
