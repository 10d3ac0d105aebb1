"""Routes on disk: CSV with x_m, y_m, heading_deg, and AntWorld `.bin`."""

import csv
import os
from pathlib import Path

import numpy as np
from jaxtyping import Float

from .atomic import replacing
from .errors import InputError
from .geometry import Route

ROUTE_HEADER = ["x_m", "y_m", "heading_deg"]


def read_route(path: str | os.PathLike) -> Route:
    """Read a route: CSV with columns x_m, y_m and (optional) heading_deg, or AntWorld `.bin`.

    Without a heading column each point heads towards the next. Raises InputError naming the line that cannot be used.
    """
    path = existing(path, "route")
    suffix = path.suffix.lower()
    if suffix not in (".csv", ".bin"):
        raise InputError(
            f"{path}: unknown kind of route {suffix!r}; give .csv ({','.join(ROUTE_HEADER)}) or AntWorld .bin"
        )
    try:
        if suffix == ".csv":
            return _read_route_csv(path)
        x, y, heading = read_planes(path, 3, "an AntWorld route")
        return Route(np.column_stack([x / 100, y / 100, np.radians(heading)]))
    except csv.Error as error:
        raise InputError(f"{path} cannot be read as CSV ({error}); is it a route?") from error
    except InputError as error:
        raise naming(path, error) from error


def write_route(route: Route, path: str | os.PathLike) -> None:
    """Write a route as CSV (x_m, y_m, heading_deg)."""
    if Path(path).suffix.lower() != ".csv":
        raise InputError(f"{path}: a route is written as .csv")
    rows = np.column_stack([route.xy, np.degrees(route.poses[:, 2])]).tolist()
    with replacing(path) as partial, partial.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(ROUTE_HEADER)
        writer.writerows(rows)


def existing(path: str | os.PathLike, kind: str) -> Path:
    path = Path(path)
    if not os.path.isfile(path):  # False for names too long, too
        raise InputError(f"there is no {kind} file {path}; check the name")
    return path


def naming(path: Path, error: InputError) -> InputError:
    """The error, with the file that it is about."""
    message = str(error)
    return error if message.startswith(str(path)) else InputError(f"{path}: {message}")


def reason(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:160]


def read_planes(path: Path, planes: int, what: str) -> Float[np.ndarray, "planes n"]:
    """The `planes` consecutive arrays of little-endian float64 that an AntWorld file is."""
    size = path.stat().st_size
    if size == 0 or size % (8 * planes):
        raise InputError(f"{path} has {size} bytes; {what} has a multiple of {8 * planes} (is it truncated?)")
    return np.fromfile(path, dtype="<f8").reshape(planes, -1)


def _read_route_csv(path: Path) -> Route:
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        reader = csv.reader(file, skipinitialspace=True)
        header = [name.strip() for name in next(reader, [])]
        columns = [name for name in ROUTE_HEADER if name in header]
        if columns[:2] != ROUTE_HEADER[:2]:
            raise InputError(
                f"{path}, line 1: the columns are {','.join(header)!r}; a route needs {','.join(ROUTE_HEADER)}"
            )
        rows = []
        for cells in reader:
            if not any(cell.strip() for cell in cells):
                continue
            row = dict(zip(header, cells, strict=False))
            rows.append([_number(row.get(name, ""), name, path, reader.line_num) for name in columns])
    if len(rows) < 2:
        raise InputError(f"{path} holds {len(rows)} point(s); a route needs at least 2")
    table = np.array(rows)
    if len(columns) == 2:
        return Route.through(table)
    return Route(np.column_stack([table[:, :2], np.radians(table[:, 2])]))


def _number(cell: str, name: str, path: Path, line: int) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        unit = "degrees" if name == "heading_deg" else "metres"
        raise InputError(f"{path}, line {line}: {name} is {cell!r}; a route needs finite {unit}")
    return value
