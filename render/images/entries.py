"""The entries of an image database: a CSV file with one row for each image, and the units in it.

Files have millimetres and compass bearings (degrees, 0 = +y, clockwise); everything else has metres and headings.
"""

import csv
import os
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tussock.world.atomic import replacing
from tussock.world.errors import FileError, SettingError

from ..poses import Poses, as_poses
from .pictures import check_content

ENTRIES = "database_entries.csv"
X, Y, Z, HEADING, FILENAME = "X [mm]", "Y [mm]", "Z [mm]", "Heading [degrees]", "Filename"
FRAME = "Frame"  # of a video, instead of a file name

MAX_NUMBER = 1e9  # in a file that is written; up to here nanometres are whole float64 numbers
MAX_POSITION = 1e11  # mm in a file that is read; metres from the equator (UTM) are up to 1e10 mm
MAX_COLUMNS = 1000  # each row has a cell in each, however short its line is
FULL_TURN = 360e9  # in 1e-9 degrees

Columns = dict[str, tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class Entries:
    """The rows of an entries file.

    Attributes:
        columns: All columns as text, unknown ones too, in their order.
        lines: Line of the file for each row.
        names: Names of the images in the folder, None where the cell is empty or the rows are frames.
        frames: Frame of a video for each row, None where the rows name images.
        poses: x (m), y (m) and heading (rad), nan where the cell is empty.
        z: Heights (m), nan where the cell is empty.
    """

    columns: Columns
    lines: list[int]
    names: tuple[str | None, ...]
    frames: tuple[int, ...] | None
    poses: Float[np.ndarray, "n 3"]
    z: Float[np.ndarray, " n"]


def read_entries(path: Path) -> Entries:
    """Read an entries file. Raises FileError with the line that cannot be used."""
    if not os.path.isfile(path):  # unlike Path.is_file, False for names that are too long
        raise FileError(f"there is no {path}; an image database is a folder that contains this file")
    check_content(path)
    columns, lines = _read_columns(path)
    is_video = FILENAME not in columns and FRAME in columns
    for name in (X, Y) if is_video else (X, Y, FILENAME):
        if name not in columns:
            raise FileError(
                f"{path}, line 1: there is no column {name!r}; a database has {X}, {Y} and {FILENAME} (or {FRAME}). "
                "tussock database import makes a database of other tables"
            )
    for name, line in zip(columns.get(FILENAME, ()), lines, strict=False):
        if "\0" in name or len(name.splitlines()) > 1:
            raise FileError(f"{path}, line {line}: {name!r} is not a valid file name; give one without line breaks")
    x, y, z = (_numbers(path, columns, name, lines, MAX_POSITION) for name in (X, Y, Z))
    bearing = _numbers(path, columns, HEADING, lines)
    poses = from_file_units(np.rint(np.column_stack([x * 1e6, y * 1e6, bearing * 1e9])))
    names = (None,) * len(lines) if is_video else tuple(name or None for name in columns[FILENAME])
    frames = _frames(path, columns, lines) if is_video else None
    return Entries(columns, lines, names, frames, poses, z / 1e3)


def is_grid(columns: Columns) -> bool:
    """Whether columns are those of a grid."""
    return any(name in columns for name in ("Grid X", "Grid Y", "Grid Z"))


def _frames(path: Path, columns: Columns, lines: list[int]) -> tuple[int, ...]:
    """The frame of each row."""
    numbers = _numbers(path, columns, FRAME, lines)
    for number, line in zip(numbers, lines, strict=True):
        if not (number >= 0 and number == int(number)):
            raise FileError(f"{path}, line {line}: {FRAME} is not a whole number from 0; give one")
    return tuple(int(number) for number in numbers)


def _read_columns(path: Path) -> tuple[Columns, list[int]]:
    """The columns as text, without spaces around cells, and the line of each row. Cells missing at the end of a row are empty."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file, skipinitialspace=True)
            header = _header(next(reader, []), path)
            rows, lines = [], []
            for cells in reader:
                row = [cell.strip() for cell in cells]
                if not any(row):
                    continue
                if any(row[len(header) :]):
                    raise FileError(
                        f"{path}, line {reader.line_num}: {len(row)} cells under {len(header)} columns; repair the line"
                    )
                rows.append((row + [""] * len(header))[: len(header)])
                lines.append(reader.line_num)
    except (csv.Error, UnicodeDecodeError, OSError) as error:
        raise FileError(f"{path} cannot be read as CSV ({error}); give the entries of a database") from error
    columns = zip(*rows, strict=True) if rows else [()] * len(header)
    return dict(zip(header, columns, strict=True)), lines


def _header(cells: list[str], path: Path) -> list[str]:
    """Names of the columns."""
    header = [name.strip() for name in cells]
    while header and not header[-1]:  # a comma at the end of the line
        header.pop()
    if len(header) > MAX_COLUMNS:
        raise FileError(f"{path}, line 1: {len(header)} columns; a database has up to {MAX_COLUMNS}")
    repeated = [name for name in header if header.count(name) > 1]
    if repeated:
        raise FileError(f"{path}, line 1: the column {repeated[0]!r} appears twice; rename one")
    return header


def _numbers(
    path: Path, columns: Columns, name: str, lines: list[int], limit: float = MAX_NUMBER
) -> Float[np.ndarray, " n"]:
    """The numbers in a column, nan where a cell is empty or the column is missing."""
    numbers = np.full(len(lines), np.nan)
    for row, cell in enumerate(columns.get(name, ())):
        if not cell:
            continue
        with suppress(ValueError):
            numbers[row] = float(cell)
        if not abs(numbers[row]) < limit:
            raise FileError(f"{path}, line {lines[row]}: {name} is {cell!r}; give a number under {limit:.0e}")
    return numbers


def write_entries(path: Path, columns: Columns) -> None:
    """Write an entries file, with a comma and a space between cells."""
    rows = [list(columns), *zip(*columns.values(), strict=True)]
    text = "".join(", ".join(map(_cell, row)) + "\n" for row in rows)
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="")


def _cell(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if re.search(r'[,"\r\n]', text) else text


def stored_poses(poses: Poses) -> Float[np.ndarray, "n 3"]:
    """Poses as a database stores them, rounded to 1e-9 m and 1e-9 degrees. Reading what was written gives exactly these."""
    return from_file_units(to_file_units(poses))


def to_file_units(poses: Poses) -> Float[np.ndarray, "n 3"]:
    """x and y in nanometres, and the bearing in 1e-9 degrees from 0 to under 360 degrees, all whole. Raises SettingError if too far."""
    poses = as_poses(poses)
    if (np.abs(poses[:, :2]) * 1e3 >= MAX_NUMBER).any():
        raise SettingError(f"a pose is too far away for a database; give x and y up to {MAX_NUMBER / 1e3:g} m")
    return np.column_stack([np.rint(poses[:, :2] * 1e9), bearings_in_file(poses[:, 2])])


def bearings_in_file(headings: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Bearings of headings (rad) in 1e-9 degrees, from 0 to under 360 degrees, all whole."""
    return np.rint((90 - np.degrees(headings)) * 1e9) % FULL_TURN


def from_file_units(values: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """The poses (m, rad) of which `to_file_units` makes these values."""
    left = 90e9 - values[:, 2]
    heading = np.radians(((left + FULL_TURN / 2) % FULL_TURN - FULL_TURN / 2) / 1e9)
    return np.column_stack([values[:, :2] / 1e9, heading]) + 0.0  # + 0.0: no -0.0


def format_decimal(value: float, places: int) -> str:
    """A whole number of units of the last decimal place, as an exact decimal number."""
    whole, rest = divmod(abs(int(value)), 10**places)
    text = f"{whole}.{rest:0{places}d}".rstrip("0").rstrip(".")
    return f"-{text}" if value < 0 else text
