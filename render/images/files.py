"""The two text files of an image database, and the units in them: entries (CSV) and metadata (YAML of OpenCV's kind)."""

import csv
import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float

from tussock.world.atomic import replacing
from tussock.world.errors import InputError

from ..poses import Poses, as_poses

ENTRIES = "database_entries.csv"
METADATA = "database_metadata.yaml"

LARGEST = 1e9  # of a number in a file; within it nanometres are whole float64 numbers
FULL_TURN = 360e9  # in billionths of a degree
MOST_COLUMNS = 1000  # every row has a cell in each, however short its line
DEEPEST = 1000  # levels of nesting, at the most; OpenCV's parser overflows its stack somewhere above 10,000
PLAIN = re.compile(r"[A-Za-z_]([A-Za-z0-9_ -]*[A-Za-z0-9_])?")  # text that YAML takes for text without quotes ..
NOT_TEXT = ("true", "false", "null", "nan", "inf", "yes", "no", "on", "off", "y", "n")  # .. but for these
MATRIX = {"rows", "cols", "dt", "data"}

Columns = dict[str, tuple[str, ...]]


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, unless it is there. Raises InputError where it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the folder {folder} cannot be made ({error.strerror}); give another") from error


def read_entries(path: Path) -> tuple[Columns, list[int]]:
    """The columns of an entries file as text, in their order, and the line that each row stands in.

    Cells are stripped; those missing at a row's end are empty. Raises InputError naming the line that cannot be used.
    """
    if not os.path.isfile(path):  # False for names too long, too
        raise InputError(f"there is no {path}; an image database is a folder with {ENTRIES} and {METADATA}")
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
                    raise InputError(
                        f"{path}, line {reader.line_num}: {len(row)} cells under {len(header)} columns; repair the line"
                    )
                rows.append((row + [""] * len(header))[: len(header)])
                lines.append(reader.line_num)
    except (csv.Error, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as CSV ({error}); is it a database's?") from error
    columns = zip(*rows, strict=True) if rows else [()] * len(header)
    return dict(zip(header, columns, strict=True)), lines


def _header(cells: list[str], path: Path) -> list[str]:
    header = [name.strip() for name in cells]
    while header and not header[-1]:  # a comma at the line's end
        header.pop()
    if len(header) > MOST_COLUMNS:
        raise InputError(f"{path}, line 1: {len(header)} columns; a database has up to {MOST_COLUMNS}")
    twice = [name for name in header if header.count(name) > 1]
    if twice:
        raise InputError(f"{path}, line 1: the column {twice[0]!r} stands twice; rename one")
    return header


def write_entries(path: Path, columns: Columns) -> None:
    """Write an entries file, with a comma and a space between cells."""
    rows = [list(columns), *zip(*columns.values(), strict=True)]
    text = "".join(", ".join(map(_cell, row)) + "\n" for row in rows)
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="")


def _cell(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if re.search(r'[,"\r\n]', text) else text


def numbers(path: Path, columns: Columns, name: str, lines: list[int]) -> Float[np.ndarray, " n"]:
    """A column's numbers, nan where a cell is empty or there is no such column. Raises InputError for what is no number."""
    numbers = np.full(len(lines), np.nan)
    for row, cell in enumerate(columns.get(name, ())):
        if not cell:
            continue
        with suppress(ValueError):
            numbers[row] = float(cell)
        if not abs(numbers[row]) < LARGEST:
            raise InputError(f"{path}, line {lines[row]}: {name} is {cell!r}; give a number under {LARGEST:.0e}")
    return numbers


def as_kept(poses: Poses) -> Float[np.ndarray, "n 3"]:
    """Poses as a database keeps them: to 1e-9 m and 1e-9 degrees. Reading what was written gives these to the last bit."""
    return poses_of(billionths(poses))


def billionths(poses: Poses) -> Float[np.ndarray, "n 3"]:
    """Poses as whole nanometres and billionths of a degree of bearing, in [0, 360) degrees."""
    poses = as_poses(poses)
    if (np.abs(poses[:, :2]) * 1e3 >= LARGEST).any():
        raise InputError(f"a database keeps places within {LARGEST / 1e3:g} m of x = y = 0")
    bearing = np.rint((90 - np.degrees(poses[:, 2])) * 1e9) % FULL_TURN
    return np.column_stack([np.rint(poses[:, :2] * 1e9), bearing])


def poses_of(billionths: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """The poses (m, rad) that `billionths` writes so."""
    left = 90e9 - billionths[:, 2]
    heading = np.radians(((left + FULL_TURN / 2) % FULL_TURN - FULL_TURN / 2) / 1e9)
    return np.column_stack([billionths[:, :2] / 1e9, heading]) + 0.0  # + 0.0: no -0.0


def decimal(billionths: float, places: int) -> str:
    """A whole number of units of the last of so many decimal places, exactly."""
    whole, rest = divmod(abs(int(billionths)), 10**places)
    text = f"{whole}.{rest:0{places}d}".rstrip("0").rstrip(".")
    return f"-{text}" if billionths < 0 else text


def read_metadata(path: Path) -> dict[str, Any]:
    """What a metadata file holds under its root: nested dicts and lists of text, numbers and None.

    Raises InputError where it is missing or damaged, with the line if known.
    """
    if not os.path.isfile(path):  # False for names too long, too
        raise InputError(f"there is no {path}; an image database is a folder with {ENTRIES} and {METADATA}")
    try:
        return _parse(path.read_text(encoding="utf-8-sig"))
    except (ValueError, SystemError, cv2.error) as error:
        found = re.search(r"\((\d+)\): ([^'\n]+)", str(error.__cause__ or error))
        line, reason = (f", line {found[1]}", found[2]) if found else ("", str(error).splitlines()[0])
        raise InputError(f"{path}{line} cannot be read as a database's YAML ({reason}); repair it") from error


def write_metadata(path: Path, metadata: dict[str, Any]) -> None:
    """Write a metadata file. Raises InputError for what would not come back from it."""
    text = "%YAML:1.0\n---\n" + "\n".join(_block({"metadata": metadata}, "")) + "\n"
    try:
        kept = repr(_parse(text)) == repr(metadata)  # repr, because nan is not equal to itself
    except (ValueError, SystemError, cv2.error):
        kept = False
    if not kept:
        raise InputError(f"{path}: this metadata cannot be kept as OpenCV's YAML; use plain names, text and numbers")
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="")


def _parse(text: str) -> dict[str, Any]:
    """The map under `metadata` of a YAML text. Raises ValueError, cv2.error or SystemError (cv2's way) where there is none."""
    in_a_line = max(len(line) - len(line.lstrip(" ")) + line.count("-") + line.count(":") for line in text.split("\n"))
    if in_a_line + sum(map(text.count, "[{<")) > DEEPEST:
        raise ValueError("nested too deeply")
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    root = storage.getNode("metadata")
    if not root.isMap():
        raise ValueError("it holds no 'metadata'")
    return _value(root)


def _value(node: Any) -> Any:
    if node.isMap():
        return {key: _value(node.getNode(key)) for key in node.keys()}  # noqa: SIM118 (no dict)
    if node.isSeq():
        return [_value(node.at(i)) for i in range(node.size())]
    if node.isInt():
        return int(node.real())
    if node.isReal():
        return node.real()
    return node.string() if node.isString() else None


# OpenCV's own writer leaves text such as 'true' or 'trailing ' without quotes, and another version writes other bytes.
def _block(values: dict[str, Any], indent: str) -> list[str]:
    lines = []
    for key, value in values.items():
        if isinstance(value, dict) and value:
            tag = " !!opencv-matrix" if set(value) == MATRIX else ""
            lines += [f"{indent}{key}:{tag}", *_block(value, indent + "   ")]
        else:
            lines.append(f"{indent}{key}: {_flow(value)}")
    return lines


def _flow(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key}: {_flow(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[ " + ", ".join(map(_flow, value)) + " ]"
    if isinstance(value, str):
        return value if PLAIN.fullmatch(value) and value.lower() not in NOT_TEXT else _quoted(value)
    if isinstance(value, float):
        return repr(value).replace("inf", ".Inf").replace("nan", ".Nan")
    return "null" if value is None else str(int(value))


def _quoted(text: str) -> str:
    escapes = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\r": "\\r", "\t": "\\t"}
    return '"' + "".join(escapes.get(letter, letter) for letter in text) + '"'
