"""What the folder of an image database stands for, where there is no world: panoramas, their eye, a route, an extent, a digest."""

import hashlib
import logging
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import attrs
import numpy as np
from jaxtyping import UInt8
from scipy.spatial import KDTree

from tussock.world.errors import FileError, InputError, SettingError, first_line
from tussock.world.geometry import Bounds, Route
from tussock.world.headings import diagnose
from tussock.world.scene import World
from tussock.world.settings import shown

from ..eye import Eye
from ..spectrum import HUMAN
from .database import Database, read_database
from .entries import ENTRIES
from .metadata import METADATA, group_in

log = logging.getLogger(__name__)

MASK_SUFFIX = ".png"


def open_database(folder: Path, headings: str = "auto") -> Database:
    """The database in a folder, with complete poses.

    Args:
        folder: The folder.
        headings: How its headings are meant; see `read_database`.

    Raises:
        FileError: Where it is damaged, has no entries, or a position or heading is missing.
    """
    stamps = tuple(path.stat().st_mtime_ns if path.is_file() else 0 for path in (folder / ENTRIES, folder / METADATA))
    return _open_database(folder.absolute(), folder, stamps, headings)


@lru_cache(maxsize=16)  # the runs of a sweep name the same few
def _open_database(absolute: Path, folder: Path, stamps: tuple[int, ...], headings: str) -> Database:
    database = read_database(folder, headings)
    if len(database) == 0:
        raise FileError(f"{folder / ENTRIES} lists no images; give a database that has some")
    missing = ~np.isfinite(database.poses)
    bad = np.flatnonzero(missing.any(axis=1))
    if len(bad):
        line = database.lines[bad[0]]
        remedy = "" if missing[bad[0], :2].any() else "; --headings path takes the direction of a route as its headings"
        raise FileError(
            f"{folder / ENTRIES}, line {line}: the position or heading is missing; each view needs both{remedy}"
        )
    return database


def eye_of(route: Path | None, grid: Path | None = None, given: Mapping[str, Any] | None = None) -> Eye:
    """The eye that saw the images of databases: from their metadata where tussock wrote it, else from the size of the images.

    Args:
        route: Image database of a route.
        grid: Image database of the views around it.
        given: Fields of `Eye` that the user states; needed where a database does not say.

    Raises:
        InputError: Where the databases have different eyes, or another one than is given.
    """
    folders = [each for each in (route, grid) if each is not None]
    found = {folder: _recorded_eye(open_database(folder, "path")) for folder in folders}  # headings may be missing
    known: dict[str, Any] = {}
    for folder, fields in found.items():
        for name, value in fields.items():
            if (
                known.setdefault(name, value) != value and name != "z"
            ):  # a height that many only assume changes no image
                raise FileError(
                    f"{folders[0]} and {folder} were seen by different eyes: {name} {_shown(name, known[name])} and "
                    f"{_shown(name, value)}; give two of one eye"
                )
    for name, value in (given or {}).items():
        if known.setdefault(name, value) != value:
            raise SettingError(
                f"the images of {folders[0]} were seen by an eye of {name} {_shown(name, known[name])}, not "
                f"{_shown(name, value)}; leave that out"
            )
    eye = Eye(**known)
    if not {"top", "bottom"} <= known.keys():
        _remark_on_elevations(folders[0], eye)
    return eye


def _shown(name: str, value: Any) -> str:
    return shown(value, attrs.fields_dict(Eye)[name].metadata)


@lru_cache(maxsize=16)  # once, not once for each run
def _remark_on_elevations(folder: Path, eye: Eye) -> None:
    top, bottom = np.degrees([eye.top, eye.bottom])
    log.warning(
        f"{folder} does not say which elevations its images show: {bottom:g} to {top:g} degrees are assumed; "
        "give --top-deg and --bottom-deg where they show others"
    )


def _recorded_eye(database: Database) -> dict[str, Any]:
    """Fields of the eye that a database records, those that are not None; at least the size of the images."""
    recorded = group_in(database.metadata, "tussock", "eye")
    if not recorded:
        height, width = first_view(database).shape[:2]
        return {"width": width, "height": height}
    names = {each.name for each in attrs.fields(Eye)}
    try:
        if unknown := recorded.keys() - names:
            raise SettingError(f"unknown field {min(unknown)!r}")
        fields: dict[str, Any] = dict(recorded)
        if str(fields.get("mask", "")).endswith(MASK_SUFFIX):  # as database import keeps it
            fields["mask"] = database.folder / str(fields["mask"])
        eye = Eye(**fields)
        if eye.mask is not None and "world" not in group_in(database.metadata, "tussock"):
            visible = eye.mask.visible()
            if (visible != visible[:, :1]).any():  # rows that are covered all around are so at every heading: a mask
                eye, recorded = attrs.evolve(eye, mask=None, known=eye.mask), {*recorded, "known"}
    except (InputError, TypeError) as error:
        raise FileError(
            f"{database.folder / METADATA}: its eye cannot be used ({first_line(error)}); repair it"
        ) from error
    known = {name: value for name, value in attrs.asdict(eye).items() if name in recorded and value is not None}
    return {"spectrum": HUMAN} | known


def first_view(database: Database) -> UInt8[np.ndarray, "height width channels"]:
    """The image of the first entry."""
    return database.views([0])[0]


def reach_of(database: Database) -> float:
    """How far from the nearest entry of a database a pose may be (m): half the diagonal of a cell of a grid, the spacing of a route.

    The spacing is measured: that of the columns and rows where positions form a lattice, else the median distance between neighbours.
    """
    xy = np.unique(database.poses[:, :2].round(6), axis=0)
    if len(xy) < 2:
        return 0.0
    lines = [np.unique(coordinates.round(3)) for coordinates in xy.T]
    if database.kind == "grid" and min(map(len, lines)) > 1 and 2 * len(xy) >= len(lines[0]) * len(lines[1]):
        return float(np.hypot(*(np.median(np.diff(each)) for each in lines)) / 2)
    between = np.asarray(KDTree(xy).query(xy, k=2)[0])[:, 1]
    return float(np.median(between)) * (np.sqrt(0.5) if database.kind == "grid" else 1.0)


def world_of(route: Path, grid: Path | None = None) -> World:
    """A world without triangles for what needs one: its field is the extent of the databases, and a reach around it."""
    databases = [open_database(each, "path") for each in (route, grid) if each is not None]  # headings may be missing
    xy = np.concatenate([each.poses[:, :2] for each in databases])
    extent = Bounds(*xy.min(axis=0).tolist(), *xy.max(axis=0).tolist())
    origin = {"route_database": str(route)} | ({} if grid is None else {"grid_database": str(grid)})
    return World(
        triangles=np.empty((0, 3, 3), dtype=np.float32),
        rgb=np.empty((0, 3), dtype=np.uint8),
        ground=None,
        sky_rgb=(255, 255, 255),
        field=extent.widened(max(map(reach_of, databases))),
        origin=origin,
    )


def route_of(folder: Path, headings: str = "auto") -> Route:
    """The route of a database.

    Args:
        folder: The folder.
        headings: How its headings are meant; see `read_database`. "auto" checks them.

    Raises:
        FileError: It is not of a route, or its headings are in another convention than that of the format.
    """
    database = open_database(folder, headings)
    if database.kind != "route":
        raise FileError(f"{folder} is a database of a {database.kind}; give one of a route")
    if len(np.unique(database.poses[:, :2], axis=0)) < 2:
        raise FileError(f"{folder} has views of one position; a route needs at least 2")
    if headings in ("as-is", "path"):
        return Route(database.poses)
    diagnosis = diagnose(database.poses, "bearing" if headings == "auto" else headings)
    if headings == "auto" and diagnosis.kind == "convention":
        raise FileError(f"{folder}: {diagnosis}; {diagnosis.flags}")
    if str(diagnosis):
        taken = "they are taken as they are, as headings that each view faces"
        log.warning(
            f"{folder}: {diagnosis}; {taken}" if headings == "auto" else f"{folder}: as --headings says, {diagnosis}"
        )
    return Route(database.poses)


def digest_of(folder: Path) -> str:
    """Digest of the contents of a database: its entries, its metadata and all images."""
    folder = folder.absolute()
    # A folder's own time changes where files are added or replaced; asking for that of each of 10,000 images takes too long.
    return _digest(folder, tuple(path.stat().st_mtime_ns for path in (folder, folder / ENTRIES, folder / METADATA)))


@lru_cache(maxsize=64)
def _digest(folder: Path, stamps: tuple[int, ...]) -> str:
    digest = hashlib.sha256()
    named = {folder / name for name in read_database(folder).names if name is not None}
    for path in sorted(named | {path for path in folder.iterdir() if path.is_file() and path.name[0] != "."}):
        if path.is_file():
            digest.update(repr((path.relative_to(folder).as_posix(), path.stat().st_size)).encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()
