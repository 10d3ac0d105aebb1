"""The files that the file of a mesh refers to: material files, textures, buffers."""

import re
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..file_kinds import mesh_format
from .gltf import read_tree
from .obj import USED_MAPS, decoded, map_options
from .search import Neighbours

MAX_HEADER = 2**20  # bytes of a PLY that are searched for the name of its texture


def files_of_mesh(path: Path) -> list[Path]:
    """The file of a mesh, and those that it refers to, as far as they are found. Of any other file, the file alone.

    A damaged file refers to none: its reader reports what is wrong with it.
    """
    status = path.stat()
    search = Neighbours(path)
    found = {search.find(name) for name in _names_in(path, status.st_size, status.st_mtime_ns)}
    others = sorted(each for each in found if each is not None and each != path)
    materials = [each for other in others if other.suffix.lower() == ".mtl" for each in files_of_mesh(other)]
    return list(dict.fromkeys([path, *others, *materials]))


@lru_cache(
    maxsize=1024
)  # a large mesh is searched once, unless it changes; where its names lead is looked up each time
def _names_in(path: Path, size: int, changed: int) -> tuple[str, ...]:
    try:
        names = {"obj": _in_obj, "mtl": _in_mtl, "gltf": _in_gltf, "glb": _in_gltf, "ply": _in_ply}.get(
            mesh_format(path)
        )
        return tuple(names(path)) if names is not None else ()
    except Exception:  # a damaged file leads to errors of any class
        return ()


def _in_obj(path: Path) -> list[str]:
    """Material files. A line may hold one name with spaces, or several names."""
    text = decoded(path.read_bytes()).replace("\\\r\n", " ").replace("\\\n", " ")
    lines = re.findall(r"^[ \t]*mtllib[ \t]+([^\r\n]+)", text, re.MULTILINE)
    return [name for line in lines for name in (line.strip(), *line.split())]


def _in_mtl(path: Path) -> list[str]:
    lines = [line.replace("\t", " ").strip().partition(" ") for line in decoded(path.read_bytes()).splitlines()]
    return [map_options(rest)[1] for key, _, rest in lines if key.lower() in USED_MAPS]


def _in_gltf(path: Path) -> list[str]:
    tree: dict[str, Any] = read_tree(path)[0]
    uris = [each.get("uri", "data:") for each in (*tree.get("buffers", ()), *tree.get("images", ()))]
    return [uri for uri in uris if not uri.startswith("data:")]


def _in_ply(path: Path) -> list[str]:
    with path.open("rb") as file:
        header = file.read(MAX_HEADER).partition(b"end_header")[0].decode("utf-8", errors="replace")
    return re.findall(r"^comment TextureFile[ \t]+([^\r\n]+)", header, re.MULTILINE | re.IGNORECASE)
