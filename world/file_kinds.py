"""What a file is, by its content and its name, before a reader takes it for something else."""

import os
import re
from pathlib import Path

import numpy as np

from .errors import FileError

HEAD = 4096  # bytes that are looked at
LFS = b"version https://git-lfs.github.com/spec/"
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
ARCHIVES = (b"PK\x03\x04", b"7z\xbc\xaf", b"Rar!", b"\x1f\x8b\x08", b"BZh")
IMAGES = (b"\x89PNG", b"\xff\xd8\xff", b"GIF8", b"BM")


def refuse_other_kinds(path: Path) -> None:
    """Refuse a file that is not a world, with what it is and what to do. Raises FileError."""
    if os.path.isdir(path):
        raise FileError(f"{path} is a folder; give the file of the world in it")
    suffix, head = path.suffix.lower(), head_of(path)
    if not head:
        raise FileError(f"{path} is empty (0 bytes); copy or export it again")
    if is_lfs_pointer(head):
        raise FileError(f"{path} is a pointer of Git LFS, not the file itself; run: git lfs pull")
    if suffix in CLOUDS:
        raise FileError(f"{path} is a point cloud{_count_of_lines(path)}; {MAKE_A_MESH}")
    if program := PROGRAMS.get(suffix) or _program_of(head):
        raise FileError(f"{path} cannot be read as {suffix or 'this kind'}; export it as GLB from {program}")
    if head.startswith(ARCHIVES):
        raise FileError(f"{path} is a compressed archive; unpack it and give the mesh that is in it")
    if re.match(rb"\s*(<!doctype html|<html)", head, re.IGNORECASE):
        raise FileError(f"{path} is a web page, not a mesh (was a link saved in its place?); download the file itself")
    if head.startswith(IMAGES):
        raise FileError(f"{path} is an image; give the mesh of a world")
    if suffix == ".csv" or (suffix == ".bin" and looks_like_route(path)):
        raise FileError(
            f"{path} seems to be a route or a table, not a world; give it with --route, and a mesh as the world"
        )


def head_of(path: Path) -> bytes:
    """The first bytes of a file."""
    with path.open("rb") as file:
        return file.read(HEAD)


def is_lfs_pointer(content: bytes) -> bool:
    """Whether a file holds only the pointer of Git LFS to its content."""
    return content.startswith(LFS)


def looks_like_world(path: Path) -> bool:
    """Whether a file holds a mesh or an AntWorld world, by its content; for readers of other files that are given one by mistake."""
    head = head_of(path)
    if head.startswith((b"glTF", b"ply\n", b"ply\r")) or (head.startswith(b"solid") and b"facet" in head):
        return True
    if re.search(rb"(?m)^v[ \t]+\S+[ \t]+\S+[ \t]+\S+", head) and re.search(
        rb"(?m)^(v|vt|vn|f|o|mtllib|usemtl)[ \t]", head
    ):
        return True
    if head.lstrip()[:1] == b"{" and b'"asset"' in head:
        return True
    planes = _planes(path, 12)
    return planes is not None and _are_colours(planes[9:]) and not looks_like_route(path)


def looks_like_route(path: Path) -> bool:
    """Whether a `.bin` holds an AntWorld route: x and y (cm) and headings (degrees), one array after the other."""
    planes = _planes(path, 3)
    if planes is None or planes.shape[1] < 2:
        return False
    whole = _planes(path, 12)
    if whole is not None and _are_colours(whole[9:]):
        return False
    x, y, heading = planes
    steps = np.hypot(np.diff(x), np.diff(y))
    return bool(
        np.isfinite(planes).all()
        and (np.abs(heading) <= 720).all()
        and np.ptp(x) + np.ptp(y) > 0
        and _smooth(x, y, steps)
    )


def _smooth(x: np.ndarray, y: np.ndarray, steps: np.ndarray) -> bool:
    """Whether the steps of a path are small against its extent; where there are few points, any."""
    return len(steps) < 8 or float(np.median(steps)) < 0.25 * float(np.hypot(np.ptp(x), np.ptp(y)))


def _planes(path: Path, count: int) -> np.ndarray | None:
    """The arrays of float64 in an AntWorld file, or None where its size does not fit."""
    size = path.stat().st_size
    return np.fromfile(path, dtype="<f8").reshape(count, -1) if size and size % (8 * count) == 0 else None


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
