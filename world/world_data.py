"""What a mesh cannot hold of a world, as JSON in its file: ground, sky, field, and how the world was made."""

from typing import Any

from .errors import FileError
from .geometry import Bounds
from .scene import Ground, World

KEY = "tussock"  # of the data in a file that a mesh cannot hold
VERSION = 2  # 1: GLB files have z up; 2: y up, as the standard of glTF says
DEFAULT_SKY = (191, 191, 191)


def to_json(world: World) -> dict[str, Any]:
    """What a mesh cannot hold, as JSON."""
    return {
        "version": VERSION,
        "ground": world.ground and {"rgb": list(world.ground.rgb), "bounds": list(world.ground.bounds)},
        "sky_rgb": list(world.sky_rgb),
        "field": list(world.field),
        "double_sided": world.double_sided,
        "origin": world.origin,
        "origin_m": list(world.origin_m),
    }


def from_json(data: dict[str, Any]) -> dict[str, Any]:
    """The arguments of World that `to_json` saved. Errors of any class where the data are damaged."""
    if not isinstance(data, dict) or not isinstance(data["double_sided"], bool):
        raise TypeError("it does not describe a world")
    if data["version"] not in (1, VERSION):
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
