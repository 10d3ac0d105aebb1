"""Worlds on disk: meshes through trimesh, and AntWorld `.bin`.

A world saved as GLB or PLY carries its ground, sky, field, seed and parameters in the file (GLB: the scene's `extras`;
PLY: a header comment), and reads back equal. Coordinates are metres with z up, in every format, as they are in the file.
"""

import io
import json
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np

from .atomic import replacing
from .errors import FileError, InputError, first_line
from .geometry import Bounds
from .gltf_materials import carry_materials
from .mesh_export import material_writer, meshes_of
from .mesh_materials import appearance_of
from .obj_materials import carry_mtl
from .params import WORLDS, check_preset, is_generated
from .route_files import existing_file, naming, read_planes
from .scene import Ground, World
from .settings import MAX_COORDINATE

KEY = "tussock"  # of the data in a file that a mesh cannot hold
DEFAULT_SKY = (191, 191, 191)
MAX_TRIANGLES = 10**7  # of a world; each takes a few hundred bytes while it is read
ARCHIVES = ("zip", "bz2", "gz")  # trimesh would unpack them, whatever the size of their content

# How the original program draws its worlds: green vegetation on sand (sussex/README.md has frames of it).
ANTWORLD_TINT = (0.0, 1.0, 0.0)
ANTWORLD_GROUND = (229, 183, 90)


def open_world(name: str, seed: int = 0) -> World:
    """The world that a name stands for: generated if it is a preset (see `is_generated`), otherwise read from a file.

    Args:
        name: Name of a preset, which parameters may follow, or of a file.
        seed: Seed of a generated world.

    Raises:
        InputError: Where it is neither, and where the world cannot be generated or read.
    """
    if is_generated(name):
        return World.generate(name, seed)
    if not Path(name).suffix:
        check_world(name)
    return read_world(name)


def check_world(name: str | os.PathLike) -> None:
    """Refuse a world that is neither a preset with valid parameters nor a file, before long work. Raises InputError."""
    name = os.fspath(name)
    if is_generated(name):
        check_preset(name)
    elif not os.path.isfile(name):
        raise FileError(f"there is no world {name!r}; give one of {', '.join(WORLDS.names)}, or a file")


def read_world(path: str | os.PathLike) -> World:
    """Read a world: AntWorld `.bin`, or any mesh that trimesh reads. Files of `write_world` come back complete.

    Raises FileError for a file that is missing or damaged, that has no triangles, or more than MAX_TRIANGLES.
    """
    path = existing_file(path, "world")
    try:
        with np.errstate(all="ignore"):  # World refuses values that are not finite
            return _read_antworld(path) if path.suffix.lower() == ".bin" else _read_mesh(path)
    except InputError as error:
        raise naming(path, error) from error


def _read_mesh(path: Path) -> World:
    """The world in a file that trimesh reads."""
    import trimesh  # takes half a second, which a generated world need not wait for

    kind = path.suffix.lower().lstrip(".")
    if kind not in trimesh.available_formats() or kind in ARCHIVES:
        raise FileError(f"unknown kind of world {path.suffix!r}; give .glb, .ply, .obj, .stl or AntWorld .bin")
    try:
        if kind == "glb":
            _check_accessors(path)
        resolver = _Neighbours(path)
        data = _carried_gltf(path) if kind in ("glb", "gltf") else path.read_bytes()
        scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=resolver, process=False)  # type: ignore[arg-type]
        meshes = _placed_meshes(scene)
        triangles = np.concatenate([mesh.triangles for mesh in meshes] or [np.empty((0, 3, 3))]).astype(np.float32)
        rgb, texturing = appearance_of(meshes, path, resolver.get)
        metadata = scene.metadata.get(KEY) if kind != "ply" else _read_ply_comment(path)
    except InputError:
        raise
    except Exception as error:  # the readers of meshes and of their textures raise errors of any class
        raise FileError(f"{path} cannot be read as a mesh ({first_line(error)[:160]}); is it complete?") from error
    if len(triangles) == 0:
        raise FileError(f"{path} holds no triangles; a world needs some")
    if metadata is None:
        corners = triangles.reshape(-1, 3)[:, :2].astype(float)
        field = Bounds(*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist())
        return World(triangles=triangles, rgb=rgb, ground=None, sky_rgb=DEFAULT_SKY, field=field, texturing=texturing)
    try:
        return World(triangles=triangles, rgb=rgb, texturing=texturing, **_from_json(metadata))
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise FileError(
            f"its {KEY} metadata cannot be used ({first_line(error)[:160]}); write the world again"
        ) from error


def _carried_gltf(path: Path) -> bytes:
    """A glTF file with its materials written so that trimesh keeps them."""
    data = path.read_bytes()
    if path.suffix.lower() == ".gltf":
        tree = json.loads(data)
        carry_materials(tree)
        return json.dumps(tree).encode()
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    carry_materials(tree)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    return b"".join([data[:8], struct.pack("<II", 20 + len(text) + len(rest), len(text)), data[16:20], text, rest])


class _Neighbours:
    """The files next to a mesh, as trimesh asks for them."""

    def __init__(self, path: Path):
        self._folder = path.parent

    def get(self, name: str) -> bytes:
        """The content of a file. Raises OSError."""
        data = (self._folder / name.strip()).read_bytes()
        return carry_mtl(data) if name.strip().lower().endswith(".mtl") else data

    __getitem__ = get


def _check_accessors(path: Path) -> None:
    """Refuse a GLB with accessors that claim much data and have none; trimesh would fill them with zeros."""
    with path.open("rb") as file:
        length = int.from_bytes(file.read(20)[12:16], "little")
        tree = json.loads(file.read(length))
    empty = sum(accessor["count"] for accessor in tree.get("accessors", []) if "bufferView" not in accessor)
    if not empty <= 3 * MAX_TRIANGLES:
        raise FileError(f"it claims {empty} corners and holds none of them; write it again")


def _placed_meshes(scene) -> list:
    """The meshes of a scene, each moved to its place, in the order of their names, in which they were written."""
    places = [scene.graph[node] for node in sorted(scene.graph.nodes_geometry)]
    faces = [len(getattr(scene.geometry[name], "faces", ())) for _, name in places]  # paths and points have none
    if sum(faces) > MAX_TRIANGLES:  # one mesh may be in many places
        raise FileError(f"it holds {sum(faces):,} triangles; a world has up to {MAX_TRIANGLES:,}")
    meshes = []
    for transform, name in (place for place, count in zip(places, faces, strict=True) if count):
        mesh = scene.geometry[name].copy()
        mesh.apply_transform(transform)
        meshes.append(mesh)
    return meshes


def _read_ply_comment(path: Path) -> dict[str, Any] | None:
    """The data that `write_world` put into the header of a PLY, or None."""
    start = f"comment {KEY} ".encode("ascii")
    with path.open("rb") as file:
        for line in file:
            if line.startswith(start):
                try:
                    return json.loads(line[len(start) :])
                except (ValueError, RecursionError) as error:
                    raise FileError(f"its {KEY} comment is damaged; write the world again") from error
            if line.startswith(b"end_header"):
                break
    return None


def _read_antworld(path: Path) -> World:
    """An AntWorld `.bin`: planes x0 x1 x2 y0 y1 y2 z0 z1 z2 R G B, in green on sand as its own program draws it."""
    planes = read_planes(path, 12, "an AntWorld world")
    invalid = np.flatnonzero(~(np.abs(planes) <= MAX_COORDINATE).all(axis=0))
    if len(invalid):
        raise FileError(
            f"triangle {invalid[0]} holds a number that is not finite, or over {MAX_COORDINATE:g}; a world needs metres and colours"
        )
    shade = planes[9:]
    if shade.min() < 0 or shade.max() > 1:
        raise FileError(
            f"colours run from {shade.min():g} to {shade.max():g}; an AntWorld world has 0..1 (is it a world?)"
        )
    triangles = planes[:9].reshape(3, 3, -1).transpose(2, 1, 0)  # (xyz, corner, n) -> (n, corner, xyz)
    rgb = np.rint(255 * shade.T * ANTWORLD_TINT).astype(np.uint8)
    bounds = Bounds(*triangles[..., :2].min(axis=(0, 1)).tolist(), *triangles[..., :2].max(axis=(0, 1)).tolist())
    return World(
        triangles=np.ascontiguousarray(triangles, dtype=np.float32),
        rgb=rgb,
        ground=Ground(ANTWORLD_GROUND, bounds),
        sky_rgb=DEFAULT_SKY,
        field=bounds,
    )


def write_world(world: World, path: str | os.PathLike) -> None:
    """Write a world as `.glb` or `.ply`, complete. The same world gives the same bytes.

    Raises FileError for another suffix, for a world without triangles, and for a textured world as PLY, which cannot hold textures.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".glb", ".ply"):
        raise FileError(f"{path}: a world is written as .glb or .ply, not {suffix or 'a name without a suffix'!r}")
    if suffix == ".ply" and world.texturing is not None:
        raise FileError(f"{path}: a .ply cannot hold the textures of this world; write it as .glb")
    if len(world.triangles) == 0:
        raise FileError(f"{path}: this world holds no triangles; there is nothing to write")
    data = _as_glb(world) if suffix == ".glb" else _as_ply(world)
    with replacing(path) as partial:
        partial.write_bytes(data)


def _as_glb(world: World) -> bytes:
    """The content of a GLB; the names of its meshes keep their order."""
    import trimesh

    scene = trimesh.Scene(meshes_of(world))
    scene.metadata[KEY] = _to_json(world)
    return bytes(scene.export(file_type="glb", tree_postprocessor=material_writer(world)))  # type: ignore[arg-type]


def _as_ply(world: World) -> bytes:
    """The content of a PLY, with a comment in its header."""
    (mesh,) = meshes_of(world).values()
    data = bytes(mesh.export(file_type="ply"))  # type: ignore[arg-type]
    head, first_element, rest = data.partition(b"element vertex")
    return head + f"comment {KEY} {json.dumps(_to_json(world))}\n".encode("ascii") + first_element + rest


def _to_json(world: World) -> dict[str, Any]:
    """What a mesh cannot hold, as JSON."""
    return {
        "version": 1,
        "ground": world.ground and {"rgb": list(world.ground.rgb), "bounds": list(world.ground.bounds)},
        "sky_rgb": list(world.sky_rgb),
        "field": list(world.field),
        "double_sided": world.double_sided,
        "origin": world.origin,
    }


def _from_json(metadata: dict[str, Any]) -> dict[str, Any]:
    """The arguments of World that `_to_json` saved."""
    if not isinstance(metadata, dict) or not isinstance(metadata["double_sided"], bool):
        raise TypeError("it does not describe a world")
    if metadata["version"] != 1:
        raise FileError(f"written by a newer version ({metadata['version']})")
    ground = metadata["ground"]
    return {
        "ground": ground and Ground(tuple(ground["rgb"]), Bounds(*ground["bounds"])),
        "sky_rgb": tuple(metadata["sky_rgb"]),
        "field": Bounds(*metadata["field"]),
        "double_sided": metadata["double_sided"],
        "origin": dict(metadata["origin"]),
    }
