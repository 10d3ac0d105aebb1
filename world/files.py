"""Worlds on disk: meshes through trimesh, and AntWorld `.bin`.

A world saved as GLB or PLY carries its ground, sky, field, seed and parameters in the file (GLB: the scene's `extras`;
PLY: a header comment), and reads back equal. GLB files have y up, as the standard of glTF says; PLY files have z up.
"""

import os
from pathlib import Path

import numpy as np

from .antworld import read_antworld
from .atomic import replacing
from .errors import FileError, InputError, SettingError
from .file_kinds import refuse_other_kinds
from .meshes.axes import turned_y_up
from .meshes.export import material_writer, meshes_of
from .meshes.files import read_mesh
from .meshes.ply_header import comments_of
from .meshes.reading import MeshReading
from .params import WORLDS, check_preset, is_generated
from .registry import suggestion
from .route_files import existing_file, naming
from .scene import World
from .world_data import KEY, to_json


def open_world(name: str, seed: int = 0, reading: MeshReading | None = None) -> World:
    """The world that a name stands for: generated if it is a preset (see `is_generated`), otherwise read from a file.

    Args:
        name: Name of a preset, which parameters may follow, or of a file.
        seed: Seed of a generated world.
        reading: How a file is read; see `read_world`.

    Raises:
        InputError: Where it is neither, and where the world cannot be generated or read.
    """
    if is_generated(name):
        if reading is not None and reading.changes_coordinates:
            raise SettingError(f"up, unit and scale are for files of meshes; {name!r} is generated: leave them out")
        return World.generate(name, seed)
    if not Path(name).suffix:
        check_world(name)
    return read_world(name, reading)


def check_world(name: str | os.PathLike) -> None:
    """Refuse a world that is neither a preset with valid parameters nor a file, before long work. Raises InputError."""
    name = os.fspath(name)
    if is_generated(name):
        check_preset(name)
    elif os.path.isdir(name):
        raise FileError(f"the world {name!r} is a folder; give the file in it")
    elif not os.path.isfile(name):
        raise FileError(
            f"there is no world {name!r}{suggestion(name, WORLDS.names)}; give one of {', '.join(WORLDS.names)}, or a file"
        )


def read_world(path: str | os.PathLike, reading: MeshReading | None = None) -> World:
    """Read a world: AntWorld `.bin`, or any mesh that trimesh reads. Files of `write_world` come back complete.

    What is assumed or lost is logged as a warning, with the flag that changes it.

    Args:
        path: The file.
        reading: Which axis is up, the unit, and whether losses are refused; None is as by default.

    Raises:
        FileError: For a file that is missing or damaged or something else than a world, that has no triangles or more than
            MAX_TRIANGLES, and, where the reading is strict, for one of which something would be lost.
    """
    path, reading = Path(path), reading or MeshReading()
    if not os.path.isdir(path):
        path = existing_file(path, "world")
    try:
        refuse_other_kinds(path)
        with np.errstate(all="ignore"):  # World refuses values that are not finite
            return read_antworld(path, reading) if path.suffix.lower() == ".bin" else read_mesh(path, reading)
    except InputError as error:
        raise naming(path, error) from error


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
    """The content of a GLB, with y up; the names of its meshes keep their order."""
    import trimesh

    meshes = meshes_of(world)
    for mesh in meshes.values():
        mesh.vertices = turned_y_up(np.asarray(mesh.vertices))
    scene = trimesh.Scene(meshes)
    scene.metadata[KEY] = to_json(world)
    return bytes(scene.export(file_type="glb", tree_postprocessor=material_writer(world)))  # type: ignore[arg-type]


def _as_ply(world: World) -> bytes:
    """The content of a PLY, with comments in its header."""
    (mesh,) = meshes_of(world).values()
    data = bytes(mesh.export(file_type="ply"))  # type: ignore[arg-type]
    head, first_element, rest = data.partition(b"element vertex")
    return head + comments_of(KEY, to_json(world)).encode("ascii") + first_element + rest
