"""Worlds and routes on disk: meshes through trimesh, AntWorld `.bin`, routes as CSV.

A world saved as GLB or PLY carries its ground, sky, field, seed and parameters in the file (GLB: the scene's `extras`;
PLY: a header comment), and reads back equal. Coordinates are metres with z up, in every format, as they stand in the file.
"""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from .atomic import replacing
from .errors import FileError, InputError
from .geometry import FARTHEST, Bounds
from .mesh_materials import face_rgb, texture_of
from .params import PRESETS, WorldParams, is_generated
from .route_files import existing, naming, read_planes, reason
from .scene import Ground, World

KEY = "tussock"  # under which a file carries what a mesh cannot hold
DEFAULT_SKY = (191, 191, 191)
MOST_TRIANGLES = 10**7  # of a world: a few hundred bytes each while it is read
ARCHIVES = ("zip", "bz2", "gz")  # trimesh would unpack them, however large what is in them

# How the original program draws its worlds: green vegetation on sand (sussex/README.md has the frames it drew).
ANTWORLD_TINT = (0.0, 1.0, 0.0)
ANTWORLD_GROUND = (229, 183, 90)


def open_world(name: str, seed: int = 0) -> World:
    """A world by name: a preset's, which parameters may follow, grown from the seed, or a file's. Raises InputError for neither."""
    if is_generated(name):
        return World.generate(name, seed)
    if not Path(name).suffix and not Path(name).exists():
        raise InputError(f"unknown world {name!r}; give one of {', '.join(PRESETS)}, or a file")
    return read_world(name)


def check_world(name: str | os.PathLike) -> None:
    """Refuse a world that is neither a preset with good parameters nor a file, before long work. Raises InputError."""
    if is_generated(str(name)):
        WorldParams.named(str(name))
    elif not Path(name).is_file():
        raise FileError(f"there is no world {str(name)!r}; give one of {', '.join(PRESETS)}, or a file")


def read_world(path: str | os.PathLike) -> World:
    """Read a world: `.bin` (AntWorld) or any mesh trimesh reads; GLB and PLY written by `write_world` come back whole.

    Raises InputError where the file is missing, damaged, or holds no triangles, or over MOST_TRIANGLES.
    """
    path = existing(path, "world")
    try:
        with np.errstate(all="ignore"):  # whatever the file holds: a world refuses what is not finite
            return _read_antworld(path) if path.suffix.lower() == ".bin" else _read_mesh(path)
    except InputError as error:
        raise naming(path, error) from error


def _read_mesh(path: Path) -> World:
    import trimesh  # late: half a second that a generated world does not need

    kind = path.suffix.lower().lstrip(".")
    if kind not in trimesh.available_formats() or kind in ARCHIVES:
        raise InputError(f"{path}: unknown kind of world {path.suffix!r}; give .glb, .ply, .obj, .stl or AntWorld .bin")
    try:
        if kind == "glb":
            _check_accessors(path)
        scene = trimesh.load_scene(path, process=False)
        meshes = _in_order(scene)
        triangles = np.concatenate([mesh.triangles for mesh in meshes] or [np.empty((0, 3, 3))]).astype(np.float32)
        rgb = np.concatenate([face_rgb(mesh) for mesh in meshes] or [np.empty((0, 3), np.uint8)])
        textured = tuple(meshes) if any(texture_of(mesh) is not None for mesh in meshes) else ()
        kept = scene.metadata.get(KEY) if kind != "ply" else _read_ply_comment(path)
    except InputError:
        raise
    except Exception as error:  # trimesh's readers, and those of its textures, raise whatever their parsers do
        raise InputError(f"{path} cannot be read as a mesh ({reason(error)}); is it complete?") from error
    if len(triangles) == 0:
        raise InputError(f"{path} holds no triangles; a world needs some")
    if kept is None:
        corners = triangles.reshape(-1, 3)[:, :2].astype(float)
        field = Bounds(*corners.min(axis=0).tolist(), *corners.max(axis=0).tolist())
        return World(triangles=triangles, rgb=rgb, ground=None, sky_rgb=DEFAULT_SKY, field=field, textured=textured)
    try:
        return World(triangles=triangles, rgb=rgb, textured=textured, **_from_json(kept))
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{path}: its {KEY} metadata cannot be used ({reason(error)}); write the world again"
        ) from error


def _check_accessors(path: Path) -> None:
    """Refuse a GLB whose accessors point to no data, which are read as zeros, where they say that there is much of it."""
    with path.open("rb") as file:
        length = int.from_bytes(file.read(20)[12:16], "little")
        tree = json.loads(file.read(length))
    empty = sum(accessor["count"] for accessor in tree.get("accessors", []) if "bufferView" not in accessor)
    if not empty <= 3 * MOST_TRIANGLES:
        raise InputError(f"{path} says that it has {empty} corners and holds none of them; write it again")


def write_world(world: World, path: str | os.PathLike) -> None:
    """Write a world as `.glb` or `.ply`, nothing lost. The same world gives the same bytes.

    Raises InputError for another ending, and for a textured world as PLY, which cannot hold textures.
    """
    import trimesh

    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".glb", ".ply"):
        raise InputError(f"{path}: a world is written as .glb or .ply, not {suffix or 'a name without an ending'!r}")
    if suffix == ".ply" and world.textured:
        raise InputError(f"{path}: a .ply cannot hold this world's textures; write it as .glb")
    if len(world.triangles) == 0:
        raise InputError(f"{path}: this world holds no triangles; there is nothing to write")
    if suffix == ".glb":
        meshes = world.textured or (_as_mesh(world),)
        scene = trimesh.Scene({f"{i:06d}": mesh for i, mesh in enumerate(meshes)})
        scene.metadata[KEY] = _to_json(world)
        data = bytes(scene.export(file_type="glb"))  # type: ignore[arg-type]
    else:
        data = bytes(_as_mesh(world).export(file_type="ply"))  # type: ignore[arg-type]
        head, first_element, rest = data.partition(b"element vertex")
        data = head + f"comment {KEY} {json.dumps(_to_json(world))}\n".encode("ascii") + first_element + rest
    with replacing(path) as partial:
        partial.write_bytes(data)


def _as_mesh(world: World) -> Any:
    """The world's triangles as a trimesh mesh that shares no corners, each corner in its triangle's colour."""
    import trimesh

    n = len(world.triangles)
    rgba = np.column_stack([world.rgb, np.full(n, 255, np.uint8)])
    corners, faces = world.triangles.reshape(-1, 3), np.arange(3 * n).reshape(n, 3)
    return trimesh.Trimesh(corners, faces, vertex_colors=np.repeat(rgba, 3, axis=0), process=False)


def _read_antworld(path: Path) -> World:
    """An AntWorld `.bin`: planes x0 x1 x2 y0 y1 y2 z0 z1 z2 R G B, drawn in green on sand as its own program does."""
    planes = read_planes(path, 12, "an AntWorld world")
    bad = np.flatnonzero(~(np.abs(planes) <= FARTHEST).all(axis=0))
    if len(bad):
        raise InputError(
            f"{path}: triangle {bad[0]} holds a number that is not finite, or over {FARTHEST:g}; a world needs metres and colours"
        )
    shade = planes[9:]
    if shade.min() < 0 or shade.max() > 1:
        raise InputError(
            f"{path}: colours run from {shade.min():g} to {shade.max():g}; an AntWorld world has 0..1 (is it a world?)"
        )
    triangles = planes[:9].reshape(3, 3, -1).transpose(2, 1, 0)  # (xyz, corner, n) -> (n, corner, xyz)
    rgb = np.rint(255 * shade.T * ANTWORLD_TINT).astype(np.uint8)
    (x0, y0), (x1, y1) = triangles[..., :2].min(axis=(0, 1)).tolist(), triangles[..., :2].max(axis=(0, 1)).tolist()
    bounds = Bounds(x0, y0, x1, y1)
    return World(
        triangles=np.ascontiguousarray(triangles, dtype=np.float32), rgb=rgb, ground=Ground(ANTWORLD_GROUND, bounds),
        sky_rgb=DEFAULT_SKY, field=bounds,
    )  # fmt: skip


def _to_json(world: World) -> dict[str, Any]:
    ground = world.ground and {"rgb": list(world.ground.rgb), "bounds": list(world.ground.bounds)}
    return {
        "version": 1, "ground": ground, "sky_rgb": list(world.sky_rgb), "field": list(world.field),
        "double_sided": world.double_sided, "origin": world.origin,
    }  # fmt: skip


def _from_json(kept: dict[str, Any]) -> dict[str, Any]:
    if not isinstance(kept, dict) or not isinstance(kept["double_sided"], bool):
        raise TypeError("it is no description of a world")
    if kept["version"] != 1:
        raise InputError(f"written by a newer version ({kept['version']})")
    ground = kept["ground"]
    return {
        "ground": ground and Ground(tuple(ground["rgb"]), Bounds(*ground["bounds"])), "sky_rgb": tuple(kept["sky_rgb"]),
        "field": Bounds(*kept["field"]), "double_sided": bool(kept["double_sided"]), "origin": dict(kept["origin"]),
    }  # fmt: skip


def _read_ply_comment(path: Path) -> dict[str, Any] | None:
    """What `write_world` left in a PLY's header, or None."""
    start = f"comment {KEY} ".encode("ascii")
    with path.open("rb") as file:
        for line in file:
            if line.startswith(start):
                try:
                    return json.loads(line[len(start) :])
                except (ValueError, RecursionError) as error:
                    raise InputError(f"{path}: its {KEY} comment is damaged; write the world again") from error
            if line.startswith(b"end_header"):
                break
    return None


def _in_order(scene) -> list:
    """A scene's meshes where they stand, in the order of their names, which is the order they were written in."""
    places = [scene.graph[node] for node in sorted(scene.graph.nodes_geometry)]
    faces = [len(getattr(scene.geometry[name], "faces", ())) for _, name in places]  # paths and points have none
    if sum(faces) > MOST_TRIANGLES:  # one mesh may stand in many places
        raise InputError(f"it holds {sum(faces):,} triangles; a world has up to {MOST_TRIANGLES:,}")
    meshes = []
    for transform, name in (place for place, count in zip(places, faces, strict=True) if count):
        mesh = scene.geometry[name].copy()
        mesh.apply_transform(transform)
        meshes.append(mesh)
    return meshes
