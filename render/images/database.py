"""Image databases on disk in the BoB format: a folder of panoramas, where each was taken, and how.

Used at Sussex, Sheffield and Imperial. Only here are there millimetres and compass bearings (degrees, 0 = +y, clockwise);
what these functions take and give is metres and headings as everywhere else. A row of a route holds the bearing of the
segment that led to it, and its image was taken facing there.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from tussock.world.atomic import replacing
from tussock.world.errors import InputError

from .files import (
    ENTRIES,
    METADATA,
    Columns,
    make_folder,
    numbers,
    poses_of,
    read_entries,
    read_metadata,
    write_entries,
    write_metadata,
)

KINDS = ("route", "grid")
FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "WEBP")
MOST_PIXELS = (
    8 * 10**7
)  # of an image: a small file can say that it holds any number. Pillow itself warns of over 89 million
X, Y, Z, HEADING = "X [mm]", "Y [mm]", "Z [mm]", "Heading [degrees]"


@dataclass(frozen=True, kw_only=True, eq=False)
class Database:
    """An image database in a folder.

    kind: "route" or "grid". poses: (n, 3) x m, y m, heading rad, nan where a cell is empty. z: (n,) height m, or nan.
    names: of the image files in the folder, None where a cell is empty.
    columns: every column of the entries as text, unknown ones too. metadata: all that the YAML holds.
    """

    folder: Path
    kind: str
    poses: Float[np.ndarray, "n 3"]
    z: Float[np.ndarray, " n"]
    names: tuple[str | None, ...]
    columns: Columns
    metadata: dict[str, Any]

    def __len__(self) -> int:
        return len(self.names)

    def views(
        self, rows: slice | Sequence[int] | np.ndarray | None = None
    ) -> UInt8[np.ndarray, "m height width channels"]:
        """The images of rows (all, by default) as RGB, or RGBA as the renderers give; grey ones have three equal channels.

        Raises InputError for an image that is missing or damaged, or differs in size from the others.
        """
        chosen = np.arange(len(self))[slice(None) if rows is None else rows].tolist()
        paths = [self._path(row) for row in chosen]
        with ThreadPoolExecutor() as pool:
            views = list(pool.map(read_image, paths))
        for path, view in zip(paths, views, strict=True):
            if view.shape != views[0].shape:
                raise InputError(
                    f"{path} is {_size(view)}, {paths[0].name} is {_size(views[0])}; views taken together need one size"
                )
        return np.stack(views) if views else np.empty((0, 0, 0, 3), dtype=np.uint8)

    def _path(self, row: int) -> Path:
        name = self.names[row]
        if name is None:
            raise InputError(f"{self.folder / ENTRIES}: row {row} names no image; choose other rows")
        return self.folder / name

    def write(self, folder: str | os.PathLike) -> "Database":
        """Copy the database into a new folder: images byte for byte, entries and metadata with nothing lost.

        Raises InputError where the folder holds something already, or an image is missing.
        """
        folder = Path(folder)
        names = dict.fromkeys(name for name in self.names if name is not None)
        for name in names:
            if not os.path.isfile(self.folder / name):
                raise InputError(
                    f"there is no image {self.folder / name}; tussock database check lists what is missing"
                )
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder} is there already and not empty; give a new folder")
        make_folder(folder)
        write_metadata(folder / METADATA, self.metadata)
        for name in names:
            make_folder((folder / name).parent)
            with replacing(folder / name) as partial:
                partial.write_bytes((self.folder / name).read_bytes())
        write_entries(folder / ENTRIES, self.columns)
        return read_database(folder)


def read_database(folder: str | os.PathLike) -> Database:
    """Open the image database in a folder; images are read by `views`.

    Raises InputError where its entries or metadata are missing or damaged, hold no images, or name files outside the folder.
    """
    folder = Path(folder)
    columns, lines = read_entries(folder / ENTRIES)
    names, poses, z = understood(folder / ENTRIES, columns, lines)
    for name, line in zip(names, lines, strict=True):
        if name is not None and leaves(folder, name):
            raise InputError(f"{folder / ENTRIES}, line {line}: {name!r} is not in the folder; name files beside it")
    metadata = read_metadata(folder / METADATA)
    kind = metadata.get("type")
    if kind not in KINDS:
        raise InputError(f"{folder / METADATA}: the type is {kind!r}; a database is a {' or a '.join(KINDS)}")
    return Database(folder=folder, kind=kind, poses=poses, z=z, names=names, columns=columns, metadata=metadata)


def understood(
    path: Path, columns: Columns, lines: list[int]
) -> tuple[tuple[str | None, ...], Float[np.ndarray, "n 3"], Float[np.ndarray, " n"]]:
    """Names of the images, poses and heights (m) that columns of entries hold; path and lines are for messages."""
    if "Filename" not in columns and "Frame" in columns:
        raise InputError(f"{path} lists the frames of a video; extract them into image files with a column 'Filename'")
    for name in (X, Y, "Filename"):
        if name not in columns:
            raise InputError(f"{path}, line 1: there is no column {name!r}; a database has {X}, {Y} and Filename")
    for name, line in zip(columns["Filename"], lines, strict=True):
        if "\0" in name or len(name.splitlines()) > 1:
            raise InputError(f"{path}, line {line}: {name!r} is no file's name; give it one without line breaks")
    x, y, z, bearing = (numbers(path, columns, name, lines) for name in (X, Y, Z, HEADING))
    poses = poses_of(np.rint(np.column_stack([x * 1e6, y * 1e6, bearing * 1e9])))
    return tuple(name or None for name in columns["Filename"]), poses, z / 1e3


def leaves(folder: Path, name: str) -> bool:
    """Whether a file name leads out of a folder, or a copy of it: absolute, through `..`, or through a link."""
    if Path(name).is_absolute() or ".." in Path(name).parts:
        return True
    try:
        return not (folder / name).resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # names too long, with a NUL; links in a circle
        return True


def read_image(path: Path) -> UInt8[np.ndarray, "height width channels"]:
    """An image as RGB or RGBA. Raises InputError where it is missing or cannot be read to its end."""
    if not os.path.isfile(path):  # False for names too long, too
        raise InputError(f"there is no image {path}; tussock database check lists what is missing")
    try:
        with Image.open(path, formats=FORMATS) as header:  # which reads no more than that
            size = header.size
    except Image.DecompressionBombError as error:
        raise InputError(f"{path} is too large; images have up to {MOST_PIXELS:,} pixels") from error
    except Exception as error:  # Pillow's readers raise whatever their parsers do
        raise InputError(f"{path} cannot be read as an image of 8 bits; is it complete?") from error
    if size[0] * size[1] > MOST_PIXELS:
        raise InputError(f"{path} says that it is {size[0]} x {size[1]}; images have up to {MOST_PIXELS:,} pixels")
    try:
        data = path.read_bytes()
        # libpng complains to standard error of what does not end as it should.
        whole = data[1:4] != b"PNG" or b"IEND" in data[-12:]
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if whole else None
    except (cv2.error, OSError):
        image = None
    if image is None or image.dtype != np.uint8 or image.ndim not in (2, 3):
        raise InputError(f"{path} cannot be read as an image of 8 bits; is it complete?")
    if image.ndim == 2:
        return cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
    return cv2.cvtColor(image, cv2.COLOR_BGRA2RGBA if image.shape[2] == 4 else cv2.COLOR_BGR2RGB)


def _size(view: np.ndarray) -> str:
    return f"{view.shape[1]} x {view.shape[0]} x {view.shape[2]}"
