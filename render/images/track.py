"""Where pictures were taken: a table with columns of any names, in any order and unit."""

import csv
import logging
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tussock.world.errors import FileError, InputError, SettingError
from tussock.world.heading_names import HEADINGS
from tussock.world.headings import CONVENTIONS, convert, diagnose, of_radians
from tussock.world.route_columns import LENGTHS, Column, as_of_database, chosen_column, find_columns, is_geographic
from tussock.world.route_tables import COMMENTS, decode, split_line

from .pictures import check_content

log = logging.getLogger(__name__)

ROLES = ("x", "y", "z", "heading", "filename", "frame", "time")
OTHERS = {  # names of columns that a route does not have
    "z": "z height altitude alt elevation posz zpos",
    "filename": "filename file image img picture photo imagefile imagename filepath path imagepath",
    "frame": "frame frameno framenumber frameid frameindex",
    "time": "time timestamp t stamp seconds elapsed",
}
SECONDS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
MAX_BYTES = 5 * 10**8


@dataclass(frozen=True, eq=False)
class Track:
    """Rows of a track.

    Attributes:
        path: The file.
        lines: Line of each row.
        poses: x (m), y (m) and heading (rad).
        z: Heights (m), 0 where the table has none.
        names: Picture of each row, or None.
        frames: Frame of a video of each row, or None.
        times: Time of each row (s), or None.
    """

    path: Path
    lines: list[int]
    poses: Float[np.ndarray, "n 3"]
    z: Float[np.ndarray, " n"]
    names: list[str] | None
    frames: Float[np.ndarray, " n"] | None
    times: Float[np.ndarray, " n"] | None

    def __len__(self) -> int:
        return len(self.poses)

    def at(self, rows: np.ndarray) -> "Track":
        """Some rows."""
        names = None if self.names is None else [self.names[row] for row in rows]
        frames, times = (None if each is None else each[rows] for each in (self.frames, self.times))
        lines = [self.lines[row] for row in rows]
        return replace(
            self, lines=lines, poses=self.poses[rows], z=self.z[rows], names=names, frames=frames, times=times
        )

    def between(self, clock: Float[np.ndarray, " n"], moments: Float[np.ndarray, " m"]) -> Float[np.ndarray, "m 4"]:
        """x (m), y (m), heading (rad) and z (m) at moments of a clock that each row has, linear between rows."""
        order = np.argsort(clock, kind="stable")
        turned = np.unwrap(self.poses[order, 2])
        values = [self.poses[order, 0], self.poses[order, 1], turned, self.z[order]]
        return np.column_stack([np.interp(moments, clock[order], each) for each in values])


def read_track(
    path: Path, columns: str | None = None, unit: str | None = None, headings: str = "auto", along_path: bool = True
) -> Track:
    """Read a track. What is assumed about it is logged.

    Args:
        path: A table as text.
        columns: None finds them by their names. "x=East,heading=Yaw" says which columns hold what; "x,y,-,filename" names the columns
            in their order, - for others.
        unit: Of positions whose columns do not state it: mm, cm, m, in or ft. None is metres.
        headings: A name in `tussock.world.heading_names.HEADINGS`.
        along_path: Whether the rows are a path, so that headings can be compared with its direction.

    Raises:
        FileError: It cannot be read as a table with x and y, or its headings follow another convention.
        SettingError: For invalid columns, unit or headings.
    """
    if headings not in HEADINGS:
        raise SettingError(f"headings are {headings!r}; give one of {', '.join(HEADINGS)}")
    if unit is not None and unit not in LENGTHS:
        raise SettingError(f"the unit is {unit!r}; give mm, cm, m, in or ft")
    header, rows, lines = _table(path, columns)
    try:
        found = _found(header, columns)
    except FileError as error:
        raise FileError(f"{path}: {error}") from error
    if not rows:
        raise FileError(f"{path}: there are no rows under its columns; give one row for each picture")
    texts = {role: [row[index] if index < len(row) else "" for row in rows] for role, index in found.items()}
    x, y, z = (_lengths(path, lines, header, found, texts, axis, unit) for axis in "xyz")
    names = texts.get("filename")
    frames = _numbers(path, lines, texts["frame"], "the frame") if "frame" in texts else None
    times = (
        _numbers(path, lines, texts["time"], "the time") * _seconds(header[found["time"]]) if "time" in texts else None
    )
    heading = column = None
    if "heading" in found:
        column = as_of_database(chosen_column(header[found["heading"]], "heading"), header)
        heading = column.factor * _numbers(path, lines, texts["heading"], "the heading")
    poses = _headed(path, np.column_stack([x, y]), heading, column, headings, along_path)
    return Track(path, lines, poses, z, names, frames, times)


def _table(path: Path, columns: str | None) -> tuple[list[str], list[list[str]], list[int]]:
    """Names of the columns, the cells of each row and its line."""
    check_content(path)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise FileError(f"{path} is larger than {MAX_BYTES:,} bytes; give a table of positions")
        text = decode(path.read_bytes())
    except OSError as error:
        raise FileError(
            f"{path} cannot be read ({error.strerror}); give a table of positions, with a row for each picture"
        ) from error
    except FileError as error:
        raise FileError(f"{path} is not a table: {error}") from error
    kept = [
        (number, line)
        for number, line in enumerate(text.split("\n"), 1)
        if line.strip() and not line.lstrip().startswith(COMMENTS)
    ]
    if not kept:
        raise FileError(f"{path} is empty; give a table of positions, with a row for each picture")
    separator = max((";", "\t", ","), key=lambda each: kept[0][1].count(each))
    try:
        cells = [split_line(line, separator if separator in kept[0][1] else " ") for _, line in kept]
    except csv.Error as error:
        raise FileError(f"{path} cannot be read as a table ({error}); repair it") from error
    if separator == ";":
        cells = [[re.sub(r"^([-+]?\d+),(\d+)$", r"\1.\2", cell) for cell in row] for row in cells]
    lines = [number for number, _ in kept]
    if columns is None or "=" in columns:
        return cells[0], cells[1:], lines[1:]
    header = [name.strip() for name in columns.split(",")]
    named = not any(_is_number(cell) for cell in cells[0])  # the first row has names, which --columns replaces
    return header, cells[named:], lines[named:]


def _found(header: list[str], columns: str | None) -> dict[str, int]:
    """Which column has which role."""
    chosen = {}
    if columns is not None and "=" in columns:
        for item in columns.split(","):
            role, _, name = (part.strip() for part in item.partition("="))
            if role not in ROLES or name not in header:
                raise SettingError(
                    f"--columns {item!r}: give {', '.join(ROLES)} and the name of a column, of {', '.join(header)}"
                )
            chosen[role] = header.index(name)
    rest = ["" if index in chosen.values() or name == "-" else name for index, name in enumerate(header)]
    found = chosen | {axis: index for axis, (index, _) in find_columns(rest).items() if axis not in chosen}
    for role, names in OTHERS.items():
        same = [index for index, name in enumerate(rest) if role not in chosen and _plain(name) in names.split()]
        if len(same) > 1:
            both = " and ".join(repr(header[index]) for index in same)
            raise FileError(
                f"the columns {both} may all hold the {role}; choose one, as --columns {role}={header[same[0]]}"
            )
        if same:
            found[role] = same[0]
    for axis in "xy":
        if is_geographic([header[found[axis]]] if axis in found else header):
            raise FileError(
                f"its positions are degrees on the globe ({', '.join(header)[:200]}); convert them to metres (UTM)"
            )
        if axis not in found:
            raise FileError(
                f"there is no column {axis}, only {', '.join(filter(None, header))[:200]}; name it, as --columns {axis}=NAME"
            )
    return found


def _plain(name: str) -> str:
    """A name in small letters, without its unit."""
    name = re.sub(r"[\[({].*", "", name).strip().lower()
    name = re.sub(r"[_ ](mm|cm|m|s|sec|ms|us|ns)$", "", name)
    return re.sub(r"[^a-z]", "", name)


def _seconds(name: str) -> float:
    """Seconds in the unit of a column of times."""
    unit = re.search(r"[\[({_ ]\s*(s|sec|ms|us|ns)\s*[\])}]?$", name.strip().lower())
    return SECONDS[unit[1]] if unit else 1.0


def _lengths(
    path: Path,
    lines: list[int],
    header: list[str],
    found: dict[str, int],
    texts: dict[str, list[str]],
    axis: str,
    unit: str | None,
) -> Float[np.ndarray, " n"]:
    """The numbers of an axis (m)."""
    if axis not in found:
        return np.zeros(len(lines))
    name = header[found[axis]]
    try:
        column = chosen_column(name, "x")
    except InputError as error:
        raise FileError(f"{path}: {error}") from error
    factor = column.factor if column.stated else LENGTHS[unit or "m"][0]
    if not column.stated and unit is None and axis == "x":  # y, too, and said once
        log.warning("%s: %r has no unit and is taken as metres; --unit mm, cm, in or ft takes another", path, name)
    return factor * _numbers(path, lines, texts[axis], f"{name!r}")


def _numbers(path: Path, lines: list[int], cells: list[str], what: str) -> Float[np.ndarray, " n"]:
    values = np.empty(len(cells))
    for row, cell in enumerate(cells):
        if not _is_number(cell):
            raise FileError(f"{path}, line {lines[row]}: {what} is {cell[:40]!r}; give a finite number")
        values[row] = float(cell)
    return values


def _is_number(cell: str) -> bool:
    try:
        return "_" not in cell and abs(float(cell)) < 1e15  # False for nan
    except ValueError:
        return False


def _headed(
    path: Path,
    xy: Float[np.ndarray, "n 2"],
    heading: Float[np.ndarray, " n"] | None,
    column: Column | None,
    headings: str,
    along_path: bool,
) -> Float[np.ndarray, "n 3"]:
    """Poses with headings as they are meant."""
    if heading is None or column is None or headings == "path":
        if not along_path:
            raise FileError(f"{path}: a grid needs a column of headings, which may all be the same; add one")
        if headings != "path":
            log.warning("%s has no column of headings: each picture is taken to face the next position", path)
        return convert(np.column_stack([xy, np.zeros(len(xy))]), "path")
    read_as = "bearing" if column.bearing else "ccw"
    if headings in CONVENTIONS:
        read_as = headings
    if column.unit == "radians":
        read_as = of_radians(read_as)
    poses = convert(np.column_stack([xy, heading]), read_as)
    if headings == "auto" and along_path:
        diagnosis = diagnose(poses, read_as)
        if diagnosis.kind == "convention":
            raise FileError(f"{path}: {diagnosis}; {diagnosis.flags}")
        if str(diagnosis):
            log.warning("%s: %s; they are taken as they are", path, diagnosis)
        elif not column.bearing:
            log.warning(
                "%s: headings are taken as %s; --headings takes another convention", path, CONVENTIONS[read_as].label
            )
    return poses
