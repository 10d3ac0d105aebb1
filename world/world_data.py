"""What a mesh cannot hold of a world, as JSON in its file: ground, sky, field, and how the world was made.

A world that stands on its own triangles, or is lit, has version 3, which older versions of tussock refuse: they would let agents stand at
z = 0, and draw a sky of one colour.
"""

import base64
import io
import zlib
from typing import Any

import attrs
import numpy as np
from PIL import Image

from .errors import FileError
from .geometry import Bounds
from .ground import Ground, GroundPart, shadow_picture
from .light import Light
from .plant_groups import PlantGroups
from .scene import World
from .terrain import Part, Terrain

KEY = "tussock"  # of the data in a file that a mesh cannot hold
VERSION = 3  # 1: GLB files have z up; 2: y up, as the standard of glTF says; 3: with a terrain or a light
DEFAULT_SKY = (191, 191, 191)


def to_json(world: World) -> dict[str, Any]:
    """What a mesh cannot hold, as JSON."""
    terrain = world.terrain if isinstance(world.terrain, Terrain) and world.terrain.part is not None else None
    data = {
        "version": 2 if terrain is None and world.light is None else VERSION,
        "ground": world.ground and _ground_to_json(world.ground),
        "sky_rgb": list(world.sky_rgb),
        "field": list(world.field),
        "double_sided": world.double_sided,
        "origin": world.origin,
        "origin_m": list(world.origin_m),
    } | _of_triangles(world)
    if terrain is None or terrain.part is None:
        return data
    first, stop = terrain.part
    return data | {"terrain": {"triangles": [first, stop, len(world.triangles)], "max_slope": terrain.max_slope}}


def _ground_to_json(ground: Ground) -> dict[str, Any]:
    """A ground, with the pictures of its parts as PNG."""
    data: dict[str, Any] = {"rgb": list(ground.rgb), "bounds": list(ground.bounds)}
    if ground.parts:
        data["parts"] = [
            {"bounds": list(part.bounds), "png": base64.b64encode(_png(part.texture.rgba)).decode("ascii")}
            for part in ground.parts
        ]
    return data


def _ground_of(data: dict[str, Any]) -> Ground:
    """The ground that `_ground_to_json` saved."""
    parts = [
        GroundPart(Bounds(*part["bounds"]), shadow_picture(_rgba(base64.b64decode(part["png"]))))
        for part in data.get("parts", [])
    ]
    return Ground(tuple(data["rgb"]), Bounds(*data["bounds"]), tuple(parts))


def _png(rgba: np.ndarray) -> bytes:
    """A picture as PNG."""
    stream = io.BytesIO()
    Image.fromarray(rgba).save(stream, format="png")
    return stream.getvalue()


def _rgba(data: bytes) -> np.ndarray:
    """The picture in a PNG."""
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGBA"))


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


def _of_triangles(world: World) -> dict[str, Any]:
    """What each triangle has besides its colour, and the light on it."""
    data: dict[str, Any] = {} if world.light is None else {"light": attrs.asdict(world.light)}
    if world.reflectance is not None:
        data["reflectance"] = packed(world.reflectance)
    if world.plants is not None:
        arrays = {"of": world.plants.of, "kind": world.plants.kind, "foot": world.plants.foot}
        data["plants"] = {"kinds": list(world.plants.kinds)} | {name: packed(each) for name, each in arrays.items()}
    return data


def packed(array: np.ndarray) -> str:
    """An array as text, little-endian."""
    return base64.b64encode(zlib.compress(array.astype(array.dtype.newbyteorder("<")).tobytes(), 9)).decode("ascii")


def unpacked(text: str, kind: Any, *shape: int) -> np.ndarray:
    """The array in a text of `packed`. ValueError where it is damaged."""
    try:
        data = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.dtype(kind).newbyteorder("<"))
    except zlib.error as error:
        raise ValueError(str(error)) from error
    return data.astype(kind).reshape(shape)


def from_json(data: dict[str, Any]) -> dict[str, Any]:
    """The arguments of World that `to_json` saved. Errors of any class where the data are damaged."""
    if not isinstance(data, dict) or not isinstance(data["double_sided"], bool):
        raise TypeError("it does not describe a world")
    if data["version"] not in (1, 2, VERSION):
        raise FileError(f"written by a newer version ({data['version']})")
    ground = data["ground"]
    return {
        "ground": None if ground is None else _ground_of(ground),
        "sky_rgb": tuple(data["sky_rgb"]),
        "field": Bounds(*data["field"]),
        "double_sided": data["double_sided"],
        "origin": dict(data["origin"]),
        "origin_m": tuple(data.get("origin_m", (0.0, 0.0, 0.0))),
        "reflectance": unpacked(data["reflectance"], np.uint8, -1, 3) if "reflectance" in data else None,
        "plants": _plants(data["plants"]) if "plants" in data else None,
        "light": Light(**data["light"]) if "light" in data else None,
    }


def _plants(data: dict[str, Any]) -> PlantGroups:
    """Which triangles are which plant."""
    return PlantGroups(
        of=unpacked(data["of"], np.int32, -1),
        kinds=tuple(data["kinds"]),
        kind=unpacked(data["kind"], np.uint8, -1),
        foot=unpacked(data["foot"], np.float32, -1, 3),
    )
