"""What is wrong with an image database: files, names, places, headings, and the axes of a grid."""

import os
import re
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from tussock.world.errors import InputError
from tussock.world.geometry import wrap_angle

from .database import KINDS, Database, leaves, read_image, understood
from .files import ENTRIES, METADATA, read_entries, read_metadata
from .flow import misplaced

PLACE_NAME = re.compile(r"_([+-]\d+)_([+-]\d+)_([+-]\d+)\.\w+$")  # mm
IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
OFF_PATH = np.radians(60)  # a heading this far from the segments on both sides is wrong ..
CONVENTION = np.radians(20)  # .. and where half of them are this far, all of them mean something else


@dataclass(frozen=True)
class Problem:
    """Something wrong with a database.

    kind: a name that stays the same. where: a file, and a line where there is one. what: a sentence.
    """

    kind: str
    where: str
    what: str


@dataclass(frozen=True)
class Examined:
    """A database that may be damaged. lines: of the entries, for each row. shapes: of the rows' images, None where unreadable."""

    database: Database
    lines: list[int]
    shapes: list[tuple[int, ...] | None]

    @property
    def common(self) -> tuple[int, ...] | None:
        """Height and width of most images."""
        most = Counter(shape[:2] for shape in self.shapes if shape).most_common(1)
        return most[0][0] if most else None

    def line(self, row: int) -> str:
        return f"{ENTRIES}, line {self.lines[row]}"


def check_database(folder: str | os.PathLike) -> list[Problem]:
    """Everything found wrong with the database in a folder. Raises InputError where there is none."""
    folder = Path(folder)
    if not (folder / ENTRIES).is_file():
        raise InputError(f"there is no {folder / ENTRIES}; give the folder of an image database")
    problems, metadata = [], {}
    try:
        metadata = read_metadata(folder / METADATA)
    except InputError as error:
        problems.append(Problem("damaged-metadata", METADATA, str(error)))
    try:
        columns, lines = read_entries(folder / ENTRIES)
        names, poses, z = understood(folder / ENTRIES, columns, lines)
    except InputError as error:
        return [*problems, Problem("damaged-entries", ENTRIES, str(error))]
    kind = metadata.get("type")
    if metadata and kind not in KINDS:
        problems.append(Problem("damaged-metadata", METADATA, f"the type is {kind!r}, not {' or '.join(KINDS)}"))
    if kind not in KINDS:
        kind = "grid" if "Grid X" in columns else "route"
    database = Database(folder=folder, kind=kind, poses=poses, z=z, names=names, columns=columns, metadata=metadata)
    with ThreadPoolExecutor() as pool:
        shapes = list(pool.map(lambda name: _shape(folder, name), names))
    examined = Examined(database, lines, shapes)
    return problems + [problem for check in CHECKS for problem in check(examined)]


def _shape(folder: Path, name: str | None) -> tuple[int, ...] | None:
    try:
        return None if name is None or leaves(folder, name) else read_image(folder / name).shape
    except InputError:
        return None


def files(examined: Examined) -> Iterator[Problem]:
    """Rows without an image, with another row's, with one elsewhere, or with one that cannot be read; images without a row."""
    folder, first = examined.database.folder, {}
    for row, name in enumerate(examined.database.names):
        where = examined.line(row)
        if name is None:
            yield Problem("missing-image", where, "the row names no image")
        elif name in first:
            yield Problem("row-twice", where, f"{name} stands in line {first[name]} already")
        elif leaves(folder, name):
            yield Problem("name-leaves-folder", where, f"{name!r} is not in the folder; it was not opened")
        elif not os.path.isfile(folder / name):
            yield Problem("missing-image", where, f"there is no {name}")
        elif examined.shapes[row] is None:
            yield Problem("unreadable-image", name, "it is no image of 8 bits, or not complete")
        first.setdefault(name, examined.lines[row])
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in IMAGES and not path.name.startswith(".") and path.name not in first:
            yield Problem("unlisted-image", path.name, "no row names it")


def sizes(examined: Examined) -> Iterator[Problem]:
    """Images of another size than most, or most than the metadata says."""
    found = [None if shape is None else f"{shape[1]} x {shape[0]}" for shape in examined.shapes]
    most = None if examined.common is None else "{1} x {0}".format(*examined.common)
    said = _numbers(examined.database.metadata, "camera", "resolution")
    if said and most and f"{said[0]:g} x {said[1]:g}" != most:
        yield Problem("image-size", METADATA, f"the resolution is {said[0]:g} x {said[1]:g}, most images are {most}")
    for size, name in dict.fromkeys(zip(found, examined.database.names, strict=True)):
        if size and size != most:
            yield Problem("image-size", name or "", f"it is {size}, most images are {most}")


def names(examined: Examined) -> Iterator[Problem]:
    """Places in names (mm) that are not those in the rows."""
    database = examined.database
    matches = [PLACE_NAME.search(name or "") for name in database.names]
    named = np.array([[float(n) for n in match.groups()] if match else [np.nan] * 3 for match in matches]).reshape(
        -1, 3
    )
    given = np.column_stack([database.poses[:, :2], database.z]) * 1e3
    off = np.abs(named - given) > 1  # False for nan
    places, heights = np.flatnonzero(off[:, :2].any(axis=1)).tolist(), np.flatnonzero(off[:, 2]).tolist()
    if len(places):
        swapped = np.abs(named[places][:, [1, 0]] - given[places, :2]).max(axis=1) <= 1
        hint = "; x and y are exchanged" if swapped.mean() > 0.9 else ""
        first = places[0]
        at = "X {:g}, Y {:g}".format(*given[first, :2])
        what = f"{len(places)} rows stand elsewhere than their images' names say, the first at {at}{hint}"
        yield Problem("place-differs-from-name", examined.line(first), what)
    if len(heights):
        first = heights[0]
        what = f"Z of {len(heights)} rows is not their images' names', the first {given[first, 2]:g} for {named[first, 2]:g}"
        yield Problem("height-differs-from-name", examined.line(first), what)


def headings(examined: Examined) -> Iterator[Problem]:
    """Headings of a route that do not lead along it."""
    poses = examined.database.poses
    if examined.database.kind != "route":
        return
    off = _off_path(poses, poses[:, 2])
    meant, wrong = other_convention(poses), np.flatnonzero(off > OFF_PATH).tolist()
    if meant is not None:
        yield Problem("heading-convention", ENTRIES, meant)
    elif len(wrong):
        degrees = np.degrees(off[wrong[0]])
        what = f"{len(wrong)} headings are over 60 degrees off the path, the first by {degrees:.0f}"
        yield Problem("heading-off-path", examined.line(wrong[0]), what)


def other_convention(poses: Float[np.ndarray, "n 3"]) -> str | None:
    """A sentence on how a route's headings do not lead along it, most of them, or None where they do, or nobody can tell."""
    off = _off_path(poses, poses[:, 2])
    judged = np.isfinite(off)
    if not judged.any() or (median := np.median(off[judged])) <= CONVENTION:
        return None
    return f"headings are {np.degrees(median):.0f} degrees off the path (median){_meant(poses)}"


def _off_path(poses: Float[np.ndarray, "n 3"], heading: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Angle between each heading and the nearer of the segments before and after (rad), nan where there is none."""
    step = np.diff(poses[:, :2], axis=0)
    along = np.where(np.hypot(*step.T) > 1e-6, np.arctan2(step[:, 1], step[:, 0]), np.nan)
    return np.fmin(
        np.abs(wrap_angle(heading - np.r_[np.nan, along])), np.abs(wrap_angle(heading - np.r_[along, np.nan]))
    )


def _meant(poses: Float[np.ndarray, "n 3"]) -> str:
    """Which convention would make the headings lead along the path."""
    bearing = np.pi / 2 - poses[:, 2]
    others = {
        "counter-clockwise from +x": bearing, "clockwise from +x": -bearing,
        "counter-clockwise from +y": np.pi / 2 + bearing, "bearings backwards": poses[:, 2] + np.pi,
    }  # fmt: skip
    off = {name: float(np.nanmedian(_off_path(poses, heading))) for name, heading in others.items()}
    best = min(off, key=lambda name: off[name])
    return f"; as {best} they would fit" if off[best] < CONVENTION else ", however they are read"


def extent(examined: Examined) -> Iterator[Problem]:
    """Fewer rows than there should be, and a grid that is not where its metadata says."""
    metadata, poses = examined.database.metadata, examined.database.poses
    views = _numbers(metadata, "tussock", "views", fewest=1)
    size = _numbers(metadata, "grid", "size") if examined.database.kind == "grid" else None
    expected = views[0] if views else np.prod(size) if size else 0
    if len(poses) < expected:
        what = f"{len(poses)} rows of {expected:.0f}; was it interrupted? the same command completes it"
        yield Problem("rows-missing", ENTRIES, what)
    begin, apart = _numbers(metadata, "grid", "beginAtMM"), _numbers(metadata, "grid", "separationMM")
    if not (size and begin and apart):
        return
    with np.errstate(all="ignore"):  # whatever the metadata says
        index = (poses[:, :2] * 1e3 - begin[:2]) / np.where(np.array(apart[:2]) > 0, apart[:2], 1)
    inside = (np.abs(index - np.rint(index)) < 0.01) & (index > -0.5) & (index < np.array(size[:2]) - 0.5)
    wrong = np.flatnonzero(~inside.all(axis=1) & np.isfinite(index).all(axis=1)).tolist()
    if len(wrong):
        x, y = poses[wrong[0], :2] * 1e3
        what = f"{len(wrong)} rows are not in the grid of {METADATA}, the first at X {x:g}, Y {y:g}"
        yield Problem("grid-metadata", examined.line(wrong[0]), what)


def axes(examined: Examined) -> Iterator[Problem]:
    """Axes of a grid that are exchanged, mirrored or turned, by what its views show."""
    database = examined.database
    if database.kind == "grid" and not database.metadata.get("needsUnwrapping"):
        alike = [shape is not None and shape[:2] == examined.common for shape in examined.shapes]
        what = misplaced(database, np.flatnonzero(alike))
        if what:
            yield Problem("grid-axes", ENTRIES, what)


def _numbers(metadata: dict[str, Any], group: str, name: str, fewest: int = 2) -> list[float] | None:
    """Numbers from metadata, or None where there are none, or not enough."""
    found = metadata.get(group)
    values = found.get(name) if isinstance(found, dict) else None
    values = values if isinstance(values, list) else [values]
    numbers = [float(value) for value in values if isinstance(value, int | float) and np.isfinite(value)]
    return numbers if len(numbers) == len(values) >= fewest else None


CHECKS: tuple[Callable[[Examined], Iterator[Problem]], ...] = (files, sizes, names, headings, extent, axes)
