"""Routes on disk: CSV with x_m, y_m, heading_deg, and AntWorld `.bin`. And what all readers of files here share."""

import csv
import os
from pathlib import Path

import numpy as np
from jaxtyping import Float

from .atomic import replacing
from .errors import FileError, InputError
from .geometry import Route

COLUMNS = {"x_m": "metres", "y_m": "metres", "heading_deg": "degrees"}  # of a route as CSV, and their units
HEADER = ",".join(COLUMNS)


def read_route(path: str | os.PathLike) -> Route:
    """Read a route: CSV with the columns x_m, y_m and (optional) heading_deg, or AntWorld `.bin`.

    Without headings each point faces the next one. Raises FileError, with the number of the line that cannot be used.
    """
    path = existing_file(path, "route")
    suffix = path.suffix.lower()
    try:
        if suffix == ".csv":
            return _read_route_csv(path)
        if suffix != ".bin":
            raise FileError(f"unknown kind of route {suffix!r}; give .csv ({HEADER}) or AntWorld .bin")
        x, y, heading = read_planes(path, 3, "an AntWorld route")
        return Route(np.column_stack([x / 100, y / 100, np.radians(heading)]))
    except csv.Error as error:
        raise FileError(f"{path} cannot be read as CSV ({error}); is it a route?") from error
    except InputError as error:
        raise naming(path, error) from error


def write_route(route: Route, path: str | os.PathLike) -> None:
    """Write a route as CSV (x_m, y_m, heading_deg)."""
    if Path(path).suffix.lower() != ".csv":
        raise FileError(f"{path}: a route is written as .csv")
    rows = np.column_stack([route.xy, np.degrees(route.poses[:, 2])]).tolist()
    with replacing(path) as partial, partial.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows)


def existing_file(path: str | os.PathLike, kind: str) -> Path:
    """The path of a file that exists. kind: what it holds, for the FileError."""
    path = Path(path)
    if not os.path.isfile(path):  # unlike Path.is_file, it is False for a name that is too long
        raise FileError(f"there is no {kind} file {path}; check the name")
    return path


def naming(path: Path, error: InputError) -> InputError:
    """The error, with the file that it is about."""
    message = str(error)
    return error if message.startswith(str(path)) else FileError(f"{path}: {message}")


def read_planes(path: Path, planes: int, what: str) -> Float[np.ndarray, "planes n"]:
    """The arrays of little-endian float64 that an AntWorld file consists of, one after the other.

    Args:
        path: The file.
        planes: Number of arrays.
        what: What the file holds, for the FileError.
    """
    size = path.stat().st_size
    if size == 0 or size % (8 * planes):
        raise FileError(f"{path} has {size} bytes; {what} has a multiple of {8 * planes} (is it truncated?)")
    return np.fromfile(path, dtype="<f8").reshape(planes, -1)


def _read_route_csv(path: Path) -> Route:
    """The route in a CSV; other columns than those of a route are ignored."""
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        reader = csv.reader(file, skipinitialspace=True)
        columns = _find_columns([name.strip() for name in next(reader, [])], path)
        rows = []
        for cells in reader:
            if any(cell.strip() for cell in cells):
                where = f"{path}, line {reader.line_num}"
                rows.append([_number(cells[i] if i < len(cells) else "", name, where) for name, i in columns.items()])
    if len(rows) < 2:
        raise FileError(f"{path} holds {len(rows)} point(s); a route needs at least 2")
    table = np.array(rows)
    if len(columns) == 2:
        return Route.through(table)
    return Route(np.column_stack([table[:, :2], np.radians(table[:, 2])]))


def _find_columns(header: list[str], path: Path) -> dict[str, int]:
    """The index of each column of a route in a header, in the order of COLUMNS."""
    for name in COLUMNS:
        numbers = [str(i) for i, other in enumerate(header, 1) if other == name]
        if len(numbers) > 1:
            raise FileError(
                f"{path}, line 1: columns {' and '.join(numbers)} are all called {name!r}; rename all but one"
            )
    columns = {name: header.index(name) for name in COLUMNS if name in header}
    if not {"x_m", "y_m"} <= columns.keys():
        raise FileError(f"{path}, line 1: the columns are {','.join(header)!r}; a route needs {HEADER}")
    return columns


def _number(cell: str, name: str, where: str) -> float:
    """The finite number in a cell."""
    try:
        value = float(cell)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise FileError(f"{where}: {name} is {cell!r}; a route needs finite {COLUMNS[name]}")
    return value
