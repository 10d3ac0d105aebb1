"""What a file is, by its content and its name, before a reader takes it for something else."""

import logging
import os
import re
import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .errors import FileError

log = logging.getLogger(__name__)

HEAD = 4096  # bytes that are looked at


class Kind(NamedTuple):
    """What a file is by its content.

    Attributes:
        group: "pointer", "world", "image", "video", "archive", "page", "json", or "other".
        name: What it is, for messages.
        remedy: How the points of a route can be had from it; empty where it holds none.
    """

    group: str
    name: str
    remedy: str = ""


POINTER = Kind("pointer", "a pointer of Git LFS, not the file itself", "run: git lfs pull")
BEGINNINGS = (
    (b"version https://git-lfs.github.com/spec/", POINTER),
    (b"glTF", Kind("world", "GLB")),
    (b"ply\n", Kind("world", "PLY")),
    (b"ply\r", Kind("world", "PLY")),
    (b"\x89HDF", Kind("other", "an HDF5 file (MATLAB's -v7.3)", "save it with -v7, or as CSV")),
    (b"\x89PNG", Kind("image", "an image (PNG)")),
    (b"\xff\xd8\xff", Kind("image", "an image (JPEG)")),
    (b"GIF8", Kind("image", "an image (GIF)")),
    (b"II*\0", Kind("image", "an image (TIFF)")),
    (b"MM\0*", Kind("image", "an image (TIFF)")),
    (b"BM", Kind("image", "an image (BMP)")),
    (b"%PDF", Kind("other", "a PDF")),
    (b"\xd0\xcf\x11\xe0", Kind("other", "a spreadsheet (.xls)", "save it as CSV")),
    (b"PK\x03\x04", Kind("archive", "a ZIP archive, as spreadsheets are (.xlsx, .ods)", "save it as CSV")),
    (b"\x1f\x8b\x08", Kind("archive", "compressed (gzip)", "unpack it")),
    (b"7z\xbc\xaf", Kind("archive", "compressed (7-Zip)", "unpack it")),
    (b"Rar!", Kind("archive", "compressed (RAR)", "unpack it")),
    (b"BZh", Kind("archive", "compressed (bzip2)", "unpack it")),
    (b"SQLite format 3\0", Kind("other", "a database (SQLite, as ROS 2 bags are)", "export its poses as CSV")),
    (b"#ROSBAG", Kind("other", "a ROS bag", "export its poses as CSV")),
)
PAGE = re.compile(rb"\s*(<!doctype html|<html)", re.IGNORECASE)
OBJ_LINE = re.compile(rb"(mtllib|usemtl|o|g|s|vn|vt|vp)\s|v(\s+[-+.\deE]+){3,}\s*$|f(\s+-?\d+[\d/-]*){3,}\s*$")
# Formats that only the programs they belong to read well, and these programs.
PROGRAMS = {
    ".blend": "Blender", ".fbx": "Blender, or the program that wrote it", ".dae": "Blender", ".usd": "Blender", ".usda": "Blender",
    ".usdc": "Blender", ".usdz": "Blender", ".max": "3ds Max", ".3ds": "Blender", ".skp": "SketchUp", ".ma": "Maya", ".mb": "Maya",
    ".c4d": "Cinema 4D", ".x3d": "Blender", ".wrl": "Blender or MeshLab", ".step": "FreeCAD", ".stp": "FreeCAD", ".iges": "FreeCAD",
    ".igs": "FreeCAD", ".dxf": "FreeCAD", ".dwg": "FreeCAD", ".ifc": "Blender", ".3mf": "Blender", ".abc": "Blender", ".lwo": "Blender",
    ".uasset": "Unreal", ".unity": "Unity", ".prefab": "Unity", ".sdf": "Blender", ".wbt": "Webots", ".drc": "Blender",
}  # fmt: skip
CLOUDS = (".e57", ".las", ".laz", ".xyz", ".pcd", ".pts", ".ptx", ".asc")
MAKE_A_MESH = "make a mesh of it, for example by Poisson reconstruction in MeshLab or CloudCompare"
# Kinds that are not worlds, with what to do; {} is the name of the kind.
REFUSED = {
    "archive": "a compressed archive; unpack it and give the mesh that is in it",
    "page": "a web page, not a mesh (was a link saved in its place?); download the file itself",
    "image": "an image; give the mesh of a world",
    "video": "{}; give the mesh of a world",
    "other": "{}; give the mesh of a world",
}


def kind_of(data: bytes) -> Kind | None:
    """What a file is, by its content; None where it may be a table of numbers.

    Args:
        data: The whole file, or its beginning.
    """
    for start, kind in BEGINNINGS:
        if data.startswith(start) and (start != b"BM" or b"\0" in data[:14]):
            return kind
    if data.startswith(b"RIFF") and data[8:12] in (b"WEBP", b"AVI "):
        return Kind("image", "an image (WebP)") if data[8:12] == b"WEBP" else Kind("video", "a video (AVI)")
    if data[4:8] == b"ftyp":
        return Kind("video", "a video (MP4)")
    if PAGE.match(data):
        return Kind("page", "a web page (was a link saved in its place?)", "download the file itself")
    if len(data) >= 84 and len(data) == 84 + 50 * struct.unpack_from("<I", data, 80)[0]:
        return Kind("world", "STL")
    head = data[:HEAD].lstrip()
    if head.startswith(b"solid") and b"facet" in head:
        return Kind("world", "STL")
    if head.startswith(b"{"):
        is_gltf = b'"asset"' in data[:100_000]
        return Kind("world", "glTF") if is_gltf else Kind("json", "JSON", "save the points as CSV")
    lines = [line.strip() for line in head.splitlines()[:40]]
    lines = [line for line in lines if line and not line.startswith(b"#")]
    if len(lines) > 1 and all(OBJ_LINE.match(line) for line in lines[:-1]):  # the last one may be cut
        return Kind("world", "OBJ")
    return None


def refuse_other_kinds(path: Path) -> None:
    """Refuse a file that is not a world, with what it is and what to do. Raises FileError."""
    if os.path.isdir(path):
        raise FileError(f"{path} is a folder; give the file of the world in it")
    suffix, head = path.suffix.lower(), head_of(path)
    if not head:
        raise FileError(f"{path} is empty (0 bytes); copy or export it again")
    kind = kind_of(head)
    if kind is POINTER:
        raise FileError(f"{path} is {POINTER.name}; {POINTER.remedy}")
    if suffix in CLOUDS:
        raise FileError(f"{path} is a point cloud{_count_of_lines(path)}; {MAKE_A_MESH}")
    if program := PROGRAMS.get(suffix) or _program_of(head):
        raise FileError(f"{path} cannot be read as {suffix or 'this kind'}; export it as GLB from {program}")
    if kind is not None and kind.group in REFUSED:
        raise FileError(f"{path} is {REFUSED[kind.group].format(kind.name)}")
    numbers = numbers_in(path) if suffix == ".bin" and path.stat().st_size % 8 == 0 else np.empty(0)
    if looks_like_both(numbers):
        log.warning(
            f"{path}: read as an AntWorld world of {len(numbers) // 12} triangles; its numbers may also be a route of "
            f"{len(numbers) // 3} points: if it is one, give it with --route"
        )
    if suffix == ".csv" or looks_like_route(numbers):
        raise FileError(
            f"{path} seems to be a route or a table, not a world; give it with --route, and a mesh as the world"
        )


def head_of(path: Path) -> bytes:
    """The first bytes of a file."""
    with path.open("rb") as file:
        return file.read(HEAD)


def mesh_format(path: Path) -> str:
    """The format of a mesh, as the suffix of its file; of a GLB or a PLY by its content."""
    content = kind_of(head_of(path))
    if content is not None and content.name in ("GLB", "PLY"):
        return content.name.lower()
    return path.suffix.lower().lstrip(".")


def numbers_in(path: Path) -> Float[np.ndarray, " n"]:
    """The numbers of an AntWorld `.bin`."""
    return np.fromfile(path, dtype="<f8")


def is_lfs_pointer(content: bytes) -> bool:
    """Whether a file holds only the pointer of Git LFS to its content."""
    return kind_of(content) is POINTER


def looks_like_route(numbers: Float[np.ndarray, " n"]) -> bool:
    """Whether the numbers of a `.bin` that is given as a world are those of an AntWorld route. In doubt they are not.

    A route has x and y (cm) and headings (degrees), one array after the other. Where its headings could also be colours, because all
    are the same number, a long one is known by its corners: as a world, its triangles are large.
    """
    if not _may_be_route(numbers):
        return False
    return not _may_be_world(numbers) or (_same_headings(numbers) and _is_long(numbers) and not _is_fine(numbers))


def looks_like_world(numbers: Float[np.ndarray, " n"]) -> bool:
    """Whether the numbers of a `.bin` that is given as a route are those of an AntWorld world. In doubt they are not.

    A world has small triangles, with colours from 0 to 1 that differ.
    """
    return bool(_may_be_world(numbers) and np.ptp(numbers.reshape(12, -1)[9:]) and _is_fine(numbers))


def looks_like_both(numbers: Float[np.ndarray, " n"]) -> bool:
    """Whether the numbers of a `.bin` may well be those of an AntWorld route, and also those of a world."""
    if (
        not (_may_be_route(numbers) and _may_be_world(numbers))
        or looks_like_route(numbers)
        or looks_like_world(numbers)
    ):
        return False
    return _same_headings(numbers) or _is_long(numbers)


def _may_be_route(numbers: Float[np.ndarray, " n"]) -> bool:
    """Whether they are points at small steps, with headings."""
    if len(numbers) < 6 or len(numbers) % 3:
        return False
    planes = numbers.reshape(3, -1)
    x, y, heading = planes
    if not np.isfinite(planes).all() or (np.abs(heading) > 720).any():
        return False
    with np.errstate(all="ignore"):
        extent, steps = np.ptp(planes[:2], axis=1), np.hypot(np.diff(x), np.diff(y))
        return bool(extent.any() and (not _is_long(numbers) or np.median(steps) < 0.25 * np.hypot(*extent)))


def _may_be_world(numbers: Float[np.ndarray, " n"]) -> bool:
    """Whether they are triangles with colours."""
    if not len(numbers) or len(numbers) % 12:
        return False
    return bool(np.isfinite(numbers).all() and _are_colours(numbers.reshape(12, -1)[9:]))


def _is_long(numbers: Float[np.ndarray, " n"]) -> bool:
    """Whether a route of these numbers has enough steps to see that they are small."""
    return len(numbers) // 3 > 8


def _same_headings(numbers: Float[np.ndarray, " n"]) -> bool:
    """Whether all headings of a route of these numbers are the same; as a world it is of one colour, with corners at that height."""
    return not np.ptp(numbers.reshape(3, -1)[2])


def _is_fine(numbers: Float[np.ndarray, " n"]) -> bool:
    """Whether most triangles of a world of these numbers are small."""
    with np.errstate(all="ignore"):
        x, y, z = numbers.reshape(12, -1)[:9].reshape(3, 3, -1)
        size = np.median([np.ptp(each, axis=0) for each in (x, y)], axis=1)
        extent = np.array([np.ptp(x), np.ptp(y)])
        return bool((size <= 0.2 * extent.max()).all() and np.ptp(z) <= 2 * extent.max())


def _are_colours(values: np.ndarray) -> bool:
    return bool(np.isfinite(values).all() and values.min() >= 0 and values.max() <= 1)


def _program_of(head: bytes) -> str:
    """The program to export from, of a format with a wrong suffix."""
    if head.startswith(b"BLENDER"):
        return PROGRAMS[".blend"]
    if head.startswith((b"Kaydara FBX", b"; FBX")):
        return PROGRAMS[".fbx"]
    return PROGRAMS[".usd"] if head.startswith((b"PXR-USDC", b"#usda")) else ""


def _count_of_lines(path: Path) -> str:
    """The words " of N points" for a point cloud with one point per line."""
    if path.suffix.lower() not in (".xyz", ".asc", ".pts"):
        return ""
    with path.open("rb") as file:
        return f" of {sum(bool(line.strip()) for line in file):,} points"
