"""Meshes through trimesh: what the file means is decided here, and what is assumed or lost is said."""

import io
import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from ..errors import FileError, InputError, first_line
from ..file_kinds import MAKE_A_MESH, mesh_format
from ..geometry import Bounds
from ..origin import origin_of, shown
from ..scene import World
from ..world_data import DEFAULT_SKY, KEY, from_json, standing
from .appearance import appearance_of
from .axes import turned_z_up
from .gltf import prepared_gltf
from .obj import prepared_obj, stated_unit
from .ply import prepared_ply
from .reading import MeshReading
from .remarks import remarks_on_axes_and_units
from .search import Neighbours
from .upright import axis_up

log = logging.getLogger(__name__)

MAX_TRIANGLES = 10**7  # of a world; each takes a few hundred bytes while it is read
FLAT = 0.01  # of its width: a thinner mesh is a wall
MAX_MARGIN = 10.0  # m, of the field around a wall
ARCHIVES = ("zip", "bz2", "gz")  # trimesh would unpack them, whatever the size of their content
GLTF = ("glb", "gltf")


@dataclass
class MeshFile:
    """A mesh file as trimesh is given it.

    Attributes:
        kind: What trimesh calls its format.
        data: Its content.
        search: Finds the files that it names.
        own: The data of a world that tussock wrote into it, or None. Those of a glTF file are known when it is read.
        float32: Whether its format stores coordinates in 32 bits.
        step: Between neighbouring ones of these (in units of the file); 0 where they are stored with more digits.
        remarks: What is not read.
        unit: Name of the unit that the file states, or None.
    """

    kind: str
    data: bytes
    search: Neighbours
    own: Any = None
    float32: bool = False
    step: float = 0.0
    remarks: list[str] = field(default_factory=list)
    unit: str | None = None


def read_mesh(path: Path, reading: MeshReading) -> World:
    """The world in a file that trimesh reads. For the arguments and errors, see `read_world`."""
    import trimesh  # takes half a second, which a generated world need not wait for

    kind = _kind(path, trimesh.available_formats())
    file = _readable(path, lambda: _prepared(path, kind))
    if file.unit and not reading.unit_given:
        reading = attrs.evolve(reading, unit=file.unit)
        if file.unit != "m":
            log.warning(f"{path}: a comment in it says that its unit is {file.unit}; --unit m takes metres")
    scene = _readable(
        path,
        lambda: trimesh.load_scene(io.BytesIO(file.data), file_type=file.kind, resolver=file.search, process=False),
    )
    if file.kind in GLTF:
        file.own = scene.metadata.get(KEY)
    meshes = _readable(path, lambda: _placed_meshes(scene))
    file.step = _readable(path, lambda: _stored_step(scene)) if file.float32 else 0.0
    if not meshes:
        raise FileError(f"{path} holds {_other_content(scene)}")
    _say_losses(path, file, reading)
    up = _readable(path, lambda: axis_up(path, meshes, reading, gltf=file.kind in GLTF, own=file.own))
    return _readable(path, lambda: _world(path, file, meshes, reading, up))


def _kind(path: Path, known: set[str]) -> str:
    """What trimesh calls the format of a file. Raises FileError for an unknown one."""
    kind = mesh_format(path)
    if kind not in known or kind in ARCHIVES:
        raise FileError(
            f"unknown kind of world {path.suffix!r}; give .glb, .gltf, .ply, .obj, .stl, .off or AntWorld .bin"
        )
    return kind


def _readable(path: Path, read: Callable[[], Any]) -> Any:
    """What `read` gives. Raises FileError where the file is damaged: readers of meshes and textures raise errors of any class."""
    try:
        return read()
    except InputError:
        raise
    except Exception as error:
        raise FileError(f"{path} cannot be read as a mesh ({first_line(error)[:160]}); is it complete?") from error


def _prepared(path: Path, kind: str) -> MeshFile:
    """The file as trimesh reads it rightly."""
    search = Neighbours(path)
    if kind in GLTF:
        data, remarks = prepared_gltf(path, search)
        return MeshFile("glb", data, search, float32=True, remarks=remarks)
    if kind == "obj":
        data, remarks = prepared_obj(path, search)
        return MeshFile(kind, data, search, remarks=remarks, unit=stated_unit(path))
    if kind == "ply":
        data, header = prepared_ply(path)
        return MeshFile(kind, data, search, own=header.comment(KEY), float32=header.stores_float32())
    return MeshFile(kind, path.read_bytes(), search, float32=kind == "stl")


def _placed_meshes(scene) -> list:
    """The meshes of a scene, each moved to its place, in the order of their names, in which they were written."""
    nodes = sorted((scene.graph[node][1], node) for node in scene.graph.nodes_geometry)  # a node's name may be random
    places = [scene.graph[node] for _, node in nodes]
    faces = [len(getattr(scene.geometry[name], "faces", ())) for _, name in places]  # paths and points have none
    if sum(faces) > MAX_TRIANGLES:  # one mesh may be in many places
        raise FileError(f"it holds {sum(faces):,} triangles; a world has up to {MAX_TRIANGLES:,}")
    meshes = []
    for transform, name in (place for place, count in zip(places, faces, strict=True) if count):
        mesh = scene.geometry[name].copy()
        mesh.apply_transform(transform)
        meshes.append(mesh)
    return meshes


def _other_content(scene) -> str:
    """What a scene without triangles holds, and what to do."""
    kinds = [type(geometry).__name__ for geometry in scene.geometry.values()]
    points = sum(len(each.vertices) for each in scene.geometry.values() if type(each).__name__ == "PointCloud")
    if points:
        return f"no triangles: it is a point cloud of {points:,} points; {MAKE_A_MESH}"
    if kinds and all(kind.startswith("Path") for kind in kinds):
        return "no triangles, only lines; give a mesh with surfaces"
    return "no triangles; a world needs some"


def _say_losses(path: Path, file: MeshFile, reading: MeshReading) -> None:
    """Warn of what is not read, or refuse it."""
    losses = [f"{name!r} {reason}" for name, reason in file.search.missing.items()] + file.remarks
    if reading.strict and losses:
        raise FileError(f"{path}: {'; '.join(losses)} (refused, as --strict is given)")
    for name, reason in file.search.missing.items():
        log.warning(f"{path}: {name!r} {reason}; its surfaces are drawn without it (--strict refuses)")
    for remark in file.remarks:
        log.warning(f"{path} {remark} (--strict refuses)")


def _world(path: Path, file: MeshFile, meshes: list, reading: MeshReading, up: str) -> World:
    """The world of the meshes in a file, in metres with z up, near 0."""
    corners = [np.asarray(mesh.vertices, dtype=np.float64)[mesh.faces].reshape(-1, 3) for mesh in meshes]
    if file.own is None:
        for remark in remarks_on_axes_and_units(corners, reading, up):
            log.warning(f"{path}: {remark}")
    low, high = (np.array([fold(each, axis=0) for each in corners]) for fold in (np.min, np.max))
    low, high = (turned_z_up(each, up) * reading.metres for each in (low, high))
    low, high = np.minimum(low, high).min(axis=0), np.maximum(low, high).max(axis=0)
    origin = origin_of(low, high)
    if any(origin):
        _say_far(path, origin, file.step * reading.metres)
    for mesh in meshes:
        mesh.vertices = turned_z_up(np.asarray(mesh.vertices, np.float64), up) * reading.metres - np.array(origin)
    triangles = np.concatenate([mesh.triangles for mesh in meshes]).astype(np.float32)
    rgb, texturing = appearance_of(meshes, path, file.search.get)
    own = _own_data(path, file.own, triangles) if file.own is not None else None
    if own is None:
        own = {
            "ground": None,
            "sky_rgb": DEFAULT_SKY,
            "field": _field(path, triangles),
            "origin_m": origin,
        }
        return World(triangles=triangles, rgb=rgb, texturing=texturing, **own)
    return _understood(lambda: standing(World(triangles=triangles, rgb=rgb, texturing=texturing, **own), file.own))


def _field(path: Path, triangles: np.ndarray) -> Bounds:
    """Where an agent may be: the extent of the mesh; of a flat wall, in which nobody can stand, also what lies before and behind it."""
    xy = triangles.reshape(-1, 3)[:, :2].astype(float)
    low, high = xy.min(axis=0), xy.max(axis=0)
    width = float((high - low).max())
    flat = high - low < FLAT * width
    if flat.any():
        margin = np.where(flat, min(width, MAX_MARGIN), 0.0)
        low, high = low - margin, high + margin
        log.info(
            f"{path}: it is a flat wall along {'yx'[int(flat.argmax())]}, so agents may be up to {margin.max():g} m from it"
        )
    return Bounds(*low.tolist(), *high.tolist())


def _say_far(path: Path, origin: tuple[float, float, float], step: float) -> None:
    """Say that a world is made local. step: between neighbouring numbers as they are stored in its file (m)."""
    log.warning(
        f"{path}: its coordinates are far from 0, so its origin {shown(origin)} is subtracted; routes and places may be "
        "given in its own coordinates or with the origin subtracted"
    )
    if step > 0.001:
        log.warning(
            f"{path}: its format stores 32-bit numbers, which are {step:g} m apart there, so shapes are already rounded; "
            "export it with a local origin, or as OBJ or PLY with double"
        )


def _stored_step(scene) -> float:
    """The largest difference between neighbouring 32-bit numbers as the corners of a scene store them, in units of the scene."""
    steps = [0.0]
    for matrix, name in (scene.graph[node] for node in scene.graph.nodes_geometry):
        farthest = np.abs(scene.geometry[name].vertices).max(initial=0.0)
        steps.append(float(np.spacing(np.float32(farthest)) * np.linalg.norm(matrix[:3, :3], axis=0).max()))
    return max(steps)


def _own_data(path: Path, data: Any, triangles: np.ndarray) -> dict[str, Any] | None:
    """What tussock wrote into a file; None where another program has moved its mesh since."""
    own = _understood(lambda: from_json(data))
    if any(own[name] is not None and len(rows) != len(triangles) for name, rows in _rows_of(own)):
        log.warning(
            f"{path}: it holds {len(triangles)} triangles, and its {KEY} metadata are of another number; which triangles are "
            "which plant, and their colours without light, are not known"
        )
        own |= dict.fromkeys(("reflectance", "plants"))
    bounds = own["field"].widened(max(1.0, float(own["field"].size.max())))
    if bounds.contains(triangles[..., 0], triangles[..., 1]).any():
        return own
    log.warning(
        f"{path}: its triangles are not where its {KEY} metadata says ({own['field']}); the metadata are ignored"
    )
    return None


def _understood(read: Callable[[], Any]) -> Any:
    """What `read` makes of the metadata of tussock. Raises FileError where they are damaged."""
    try:
        return read()
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise FileError(
            f"its {KEY} metadata cannot be used ({first_line(error)[:160]}); write the world again"
        ) from error


def _rows_of(own: dict[str, Any]) -> list[tuple[str, Any]]:
    """What metadata hold of each triangle, by name."""
    plants = own["plants"]
    return [("reflectance", own["reflectance"]), ("plants", None if plants is None else plants.of)]
