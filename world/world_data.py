"""What a mesh cannot hold of a world, as JSON in its file: ground, sky, field, and how the world was made.

A world that stands on its own triangles has version 3, which older versions of tussock refuse: they would let agents stand at z = 0.
"""

from typing import Any

from .errors import FileError
from .geometry import Bounds
from .scene import Ground, World
from .terrain import Part, Terrain

KEY = "tussock"  # of the data in a file that a mesh cannot hold
VERSION = 3  # 1: GLB files have z up; 2: y up, as the standard of glTF says; 3: with a terrain
DEFAULT_SKY = (191, 191, 191)


def to_json(world: World) -> dict[str, Any]:
    """What a mesh cannot hold, as JSON."""
    terrain = world.terrain if isinstance(world.terrain, Terrain) and world.terrain.part is not None else None
    data = {
        "version": 2 if terrain is None else VERSION,
        "ground": world.ground and {"rgb": list(world.ground.rgb), "bounds": list(world.ground.bounds)},
        "sky_rgb": list(world.sky_rgb),
        "field": list(world.field),
        "double_sided": world.double_sided,
        "origin": world.origin,
        "origin_m": list(world.origin_m),
    }
    if terrain is None or terrain.part is None:
        return data
    first, stop = terrain.part
    return data | {"terrain": {"triangles": [first, stop, len(world.triangles)], "max_slope": terrain.max_slope}}


def standing(world: World, data: dict[str, Any]) -> World:
    """A world that was read, on the terrain that `to_json` saved, if it did. Errors of any class where the data are damaged."""
    if data.get("terrain") is None:
        return world
    first, stop, count = data["terrain"]["triangles"]
    part: Part = (first, stop)
    if count != len(world.triangles) or not 0 <= first < stop <= count:
        raise ValueError(
            f"its ground is triangles {first} to {stop} of {count}, and it has {len(world.triangles)}: another program has changed it"
        )
    return world.on_mesh(float(data["terrain"]["max_slope"]), part)


def from_json(data: dict[str, Any]) -> dict[str, Any]:
    """The arguments of World that `to_json` saved. Errors of any class where the data are damaged."""
    if not isinstance(data, dict) or not isinstance(data["double_sided"], bool):
        raise TypeError("it does not describe a world")
    if data["version"] not in (1, 2, VERSION):
        raise FileError(f"written by a newer version ({data['version']})")
    ground = data["ground"]
    return {
        "ground": None if ground is None else Ground(tuple(ground["rgb"]), Bounds(*ground["bounds"])),
        "sky_rgb": tuple(data["sky_rgb"]),
        "field": Bounds(*data["field"]),
        "double_sided": data["double_sided"],
        "origin": dict(data["origin"]),
        "origin_m": tuple(data.get("origin_m", (0.0, 0.0, 0.0))),
    }
