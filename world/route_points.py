"""The points of a route in a file of any kind that is known, before it is decided what their headings mean."""

import logging
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from .errors import FileError, SettingError
from .file_kinds import kind_of, looks_like_both, looks_like_world
from .route_arrays import read_mat, read_npy, read_npz
from .route_columns import (
    Column,
    chosen_column,
    find_columns,
    find_height,
    find_quaternion,
    parse_columns,
    refuse_several_tracks,
)
from .route_tables import TextTable, columns_of, decode, read_table
from .settings import MAX_COORDINATE

logger = logging.getLogger(__name__)

WORLD = "it is not a route: it is a world ({}); give it as --world"
MAX_GAPS = 0.05  # of the rows may lack a number
POSES = re.compile(r"scorer,|[^\n]*\binstance\.score\b")  # how tables of DeepLabCut and SLEAP begin
FLAT = 0.1  # of the extent in z; a path that is flatter in y may be one over x and z
TEXT_SUFFIXES = (".csv", ".txt", ".tsv", ".dat", ".asc", ".tab", ".log", "")


@dataclass
class Points:
    """The points of a route as a file has them.

    Attributes:
        xy: Positions (m).
        heading: Its numbers, as if they were counter-clockwise from +x in the unit of the file (rad), or None.
        bearing: Whether the file states that they are compass bearings.
        radians: Whether the file states that they are radians.
        unstated: Names of the columns whose unit is not stated: they were taken to be metres.
        planes: Whether the file is an AntWorld .bin.
        gaps: Lines without a position, which are left out.
        heights: Numbers of a column z (m), where each point has one; else None.
    """

    xy: Float[np.ndarray, "n 2"]
    heading: Float[np.ndarray, " n"] | None
    bearing: bool = False
    radians: bool = False
    unstated: str = ""
    planes: bool = False
    gaps: list[int] = field(default_factory=list)
    heights: Float[np.ndarray, " n"] | None = None


def read_points(path: Path, columns: str | None) -> Points:
    """The points in a file; its kind is known by its content, then by its suffix.

    Args:
        path: The file.
        columns: Names of its columns, as `read_route` takes them.

    Raises:
        FileError: For a file that is not a route.
        SettingError: For invalid names of columns.
    """
    data, suffix = path.read_bytes(), path.suffix.lower()
    if not data:
        raise FileError("line 1: it is empty; a route needs x_m,y_m,heading_deg")
    if data.startswith(b"\x93NUMPY"):
        return _of_arrays(read_npy(data), columns)
    if suffix == ".npz" and data.startswith(b"PK"):
        return _of_arrays(read_npz(data), columns)
    if data.startswith(b"MATLAB") or (suffix == ".mat" and kind_of(data) is None):
        return _of_arrays(read_mat(data), columns)
    if suffix == ".bin":
        if columns is not None:
            raise SettingError("--columns are for tables and arrays; an AntWorld .bin has none")
        return _of_planes(path, data)
    _refuse_other_kinds(data)
    if suffix not in TEXT_SUFFIXES and not suffix[1:].isdigit():
        raise FileError(f"unknown kind of route {suffix!r}; give .csv, .txt, .mat, .npy or AntWorld .bin")
    return _of_text(decode(data), columns)


def _of_text(text: str, columns: str | None) -> Points:
    """The points in a table; rows with gaps are left out while they are few."""
    if columns is None and POSES.match(text):
        raise FileError(
            "it is of DeepLabCut or SLEAP, in pixels; write x and y of one body part, times the metres of a pixel, as x_m,y_m"
        )
    table = read_table(text, None if columns is None else parse_columns(columns))
    found = columns_of(table)
    values = np.array([table.column(index, column) for index, column in found.values()])
    if "heading" in found and values.size and np.isnan(values[2]).all():
        logger.warning("the column %r is empty: each point faces the next one", found.pop("heading")[1].name)
        values = values[:2]
    if "heading" not in found and (quaternion := find_quaternion(table.names or [])):
        found["heading"] = quaternion[2], Column("heading", (table.names or [])[quaternion[2]], 1.0, "radians", True)
        values = np.vstack([values[:2], _yaw(*(table.column(index, found["heading"][1]) for index in quaternion))])
    _remark_on_y_up(table, found["y"][1], values)
    lost: np.ndarray = np.asarray(np.isnan(values).any(axis=0))
    if lost.sum() > MAX_GAPS * len(lost):
        row = int(lost.argmax())
        index, column = list(found.values())[int(np.isnan(values[:, row]).argmax())]
        more = f" ({lost.sum()} of {len(lost)} rows lack a number; complete or remove them)" if lost.sum() > 1 else ""
        raise FileError(f"line {table.lines[row]}: {table.refused(row, index, column)}{more}")
    points = _of_columns({axis: column for axis, (_, column) in found.items()}, values[:, ~lost])
    points.gaps = [table.lines[row] for row in np.flatnonzero(lost)]
    points.heights = _heights(table, ~lost)
    return points


def _heights(table: TextTable, kept: Bool[np.ndarray, " n"]) -> Float[np.ndarray, " m"] | None:
    """The column z (m) of the rows that are kept, where each has a number."""
    names = table.names or []
    if (index := find_height(names)) is None:
        return None
    try:
        column = chosen_column(names[index], "y")
        heights = column.factor * table.column(index, column)[kept]
    except FileError:  # its unit is that of a picture, say
        return None
    return heights if (np.abs(heights) <= MAX_COORDINATE).all() else None  # False for nan


def _yaw(x, y, z, w) -> Float[np.ndarray, " n"]:
    """Heading (rad, counter-clockwise from +x) of orientations as quaternions; nan where all of one is 0, as where a tracker lost it."""
    yaw = np.arctan2(2 * (w * z + x * y), w**2 + x**2 - y**2 - z**2)
    return np.where(x**2 + y**2 + z**2 + w**2 > 0, yaw, np.nan)


def _remark_on_y_up(table: TextTable, y: Column, values: Float[np.ndarray, "axes n"]) -> None:
    """Warn of a path over x and z: y is up in motion capture and in game engines."""
    index = find_height(table.names or [])
    if index is None or np.isnan(values[:2]).all():
        return
    z = chosen_column((table.names or [])[index], "y")
    x_extent, y_extent = np.nanmax(values[:2], axis=1) - np.nanmin(values[:2], axis=1)
    numbers = table.column(index, z)
    z_extent = 0.0 if np.isnan(numbers).all() else float(np.nanmax(numbers) - np.nanmin(numbers))
    if y_extent < FLAT * z_extent and x_extent < z_extent / FLAT:
        logger.warning(
            "%r varies by %.3g and %r by %.3g: if y is up, export the track with z up, or give --columns with y for %r (which mirrors it "
            "where x, y, z are right-handed)",
            y.name,
            y_extent,
            z.name,
            z_extent,
            z.name,
        )


def _of_columns(columns: dict[str, Column], values: Float[np.ndarray, "axes n"]) -> Points:
    """The points of which columns have the values."""
    scaled = [column.factor * each for column, each in zip(columns.values(), values, strict=True)]
    heading = columns.get("heading")
    return Points(
        np.column_stack(scaled[:2]),
        scaled[2] if heading else None,
        bearing=bool(heading and heading.bearing),
        radians=bool(heading and heading.unit == "radians"),
        unstated=" and ".join(repr(columns[axis].name) for axis in "xy" if not columns[axis].stated),
    )


def _of_planes(path: Path, data: bytes) -> Points:
    """The points in an AntWorld .bin: x (cm), y (cm) and heading (degrees), one after the other."""
    if len(data) % 24:
        _refuse_other_kinds(data)
        raise FileError(f"it has {len(data)} bytes; an AntWorld route has a multiple of 24 (is it truncated?)")
    planes = np.frombuffer(data, dtype="<f8")
    if looks_like_world(planes):
        raise FileError(WORLD.format("AntWorld .bin"))
    if looks_like_both(planes):
        logger.warning(
            "%s: read as an AntWorld route of %d points; its numbers may also be a world of %d triangles: if it is one, give it as --world",
            path,
            len(planes) // 3,
            len(planes) // 12,
        )
    x, y, heading = planes.reshape(3, -1)
    with np.errstate(all="ignore"):  # any bytes are numbers
        return Points(np.column_stack([x, y]) / 100, np.radians(heading), planes=True)


def _refuse_other_kinds(data: bytes) -> None:
    """Refuse a file that is known to be something else than a table, with what it is. Raises FileError."""
    kind = kind_of(data)
    if kind is not None:
        is_world = kind.group == "world"
        raise FileError(
            WORLD.format(kind.name) if is_world else f"it is not a route: it is {'; '.join(filter(None, kind[1:]))}"
        )


def _of_arrays(arrays: dict[str, np.ndarray], columns: str | None) -> Points:
    """The points in arrays with names: vectors x, y and heading, or one matrix with a point in each row."""
    array, _, names = (columns or "").rpartition(":")
    chosen = [name.strip() for name in names.split(",")]
    if names and not array and set(chosen) <= arrays.keys():
        if len(chosen) in (2, 3):
            axes = dict(zip(("x", "y", "heading"), chosen, strict=False))
            return _of_columns(
                {axis: chosen_column(name.rpartition(".")[2], axis) for axis, name in axes.items()},
                _stacked(arrays, chosen),
            )
        array, names = chosen[0], ""
    vectors = [name for name, each in arrays.items() if each.ndim == 1]
    if not array and not names:
        labels = [name.rpartition(".")[2] for name in vectors]
        found = find_columns(labels)
        if {"x", "y"} <= found.keys():
            used = [vectors[index] for index, _ in found.values()]
            refuse_several_tracks(labels, lambda index: arrays[vectors[index]].tolist())
            return _of_columns({axis: column for axis, (_, column) in found.items()}, _stacked(arrays, used))
    name, matrix = _matrix(arrays, array, any_width=bool(names))
    header = parse_columns(names) if names else ["x", "y", "heading"][: matrix.shape[1]]
    if len(header) > matrix.shape[1]:
        raise FileError(f"{name} has {matrix.shape[1]} columns, and --columns names {len(header)}")
    found = find_columns(header)
    rows = matrix[:, [index for index, _ in found.values()]].T
    return _of_columns({axis: column for axis, (_, column) in found.items()}, _complete(rows, name))


def _matrix(arrays: dict[str, np.ndarray], name: str, any_width: bool) -> tuple[str, np.ndarray]:
    """The matrix of this name, or the only one, with a point in each row. any_width: not only of 2 or 3 columns."""
    matrices = {key: each for key, each in arrays.items() if each.ndim == 2 and name in ("", key)}
    if not any_width:
        upright = {key: each if each.shape[1] in (2, 3) else each.T for key, each in matrices.items()}
        matrices = {key: each for key, each in upright.items() if each.shape[1] in (2, 3)}
    if len(matrices) != 1:
        listed = ", ".join(f"{key} ({' x '.join(map(str, each.shape))})" for key, each in list(arrays.items())[:12])
        raise FileError(
            f"it holds {listed or 'no arrays of numbers'}; choose the matrix of points, or x, y and heading: --columns NAME, "
            "--columns X,Y,HEADING or --columns NAME:x,y,heading"
        )
    return next(iter(matrices.items()))


def _stacked(arrays: dict[str, np.ndarray], names: list[str]) -> Float[np.ndarray, "axes n"]:
    """Vectors of one length. Raises FileError where they differ."""
    vectors = [arrays[name].ravel() for name in names]
    if len({len(each) for each in vectors}) > 1:
        sizes = ", ".join(f"{name} {len(each)}" for name, each in zip(names, vectors, strict=True))
        raise FileError(f"its arrays have different lengths ({sizes}); choose others with --columns")
    return _complete(np.array(vectors), " and ".join(names))


def _complete(values: Float[np.ndarray, "axes n"], name: str) -> Float[np.ndarray, "axes n"]:
    """The values without columns that hold nan, while they are few. Raises FileError."""
    lost: np.ndarray = np.logical_not(np.isfinite(values).all(axis=0))
    if lost.sum() > MAX_GAPS * len(lost):
        raise FileError(
            f"{name}: {lost.sum()} of {len(lost)} points are not finite, the first is number {lost.argmax() + 1}; complete them"
        )
    if lost.any():
        logger.warning("%s: %d of %d points are not finite, and left out", name, lost.sum(), len(lost))
    return values[:, ~lost]
