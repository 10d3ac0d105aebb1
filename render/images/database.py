"""Image databases in the BoB format: a folder of panoramas, where each was taken, and how.

The format is used at Sussex, Sheffield and Imperial. A row of a route has the bearing of the segment that led to it, and its image
was taken facing there.
"""

import dataclasses
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
from tussock.world.errors import FileError
from tussock.world.headings import convert

from .entries import ENTRIES, Columns, read_entries, write_entries
from .metadata import METADATA, read_metadata, write_metadata

KINDS = ("route", "grid")
FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "WEBP")
MAX_PIXELS = 8 * 10**7  # of an image, because a small file may claim any size; Pillow itself warns above 89 million


@dataclass(frozen=True, kw_only=True, eq=False)
class Database:
    """An image database in a folder. Images are read when `views` asks for them.

    Attributes:
        folder: The folder.
        kind: "route" or "grid".
        metadata: All that the metadata file has.
        poses: x (m), y (m) and heading (rad) of each row, nan where a cell is empty.
        z: Heights (m), nan where a cell is empty.
        names: Image files in the folder, None where a cell is empty.
        columns: All columns of the entries as text, unknown ones too.
        lines: Line of the entries file for each row.
    """

    folder: Path
    kind: str
    metadata: dict[str, Any]
    poses: Float[np.ndarray, "n 3"]
    z: Float[np.ndarray, " n"]
    names: tuple[str | None, ...]
    columns: Columns
    lines: list[int]

    def __len__(self) -> int:
        return len(self.names)

    def views(
        self, rows: slice | Sequence[int] | np.ndarray | None = None
    ) -> UInt8[np.ndarray, "m height width channels"]:
        """Read the images of some rows, or of all.

        Args:
            rows: Which rows; None is all.

        Returns:
            RGB, or RGBA as the renderers give it. Grey images have three equal channels.

        Raises:
            FileError: An image is missing, damaged, or of another size than the first.
        """
        chosen = np.arange(len(self))[slice(None) if rows is None else rows].tolist()
        paths = [self._path(row) for row in chosen]
        with ThreadPoolExecutor() as pool:
            views = list(pool.map(read_image, paths))
        for path, view in zip(paths, views, strict=True):
            if view.shape != views[0].shape:
                raise FileError(
                    f"{path} is {_size(view)}, {paths[0].name} is {_size(views[0])}; give images of one size"
                )
        return np.stack(views) if views else np.empty((0, 0, 0, 3), dtype=np.uint8)

    def _path(self, row: int) -> Path:
        name = self.names[row]
        if name is None:
            raise FileError(f"{self.folder / ENTRIES}: row {row} names no image; choose other rows")
        return self.folder / name

    def write(self, folder: str | os.PathLike) -> "Database":
        """Copy the database: images byte for byte, entries and metadata completely.

        Args:
            folder: A new or empty folder.

        Raises:
            FileError: The folder is not empty, or an image is missing.
        """
        folder = Path(folder)
        names = dict.fromkeys(name for name in self.names if name is not None)
        for name in names:
            _check_exists(self.folder / name)
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise FileError(f"{folder} exists already and is not empty; give a new folder")
        make_folder(folder)
        write_metadata(folder / METADATA, self.metadata)
        for name in names:
            make_folder((folder / name).parent)
            with replacing(folder / name) as partial:
                partial.write_bytes((self.folder / name).read_bytes())
        write_entries(folder / ENTRIES, self.columns)
        return read_database(folder)


def read_database(folder: str | os.PathLike, headings: str = "auto") -> Database:
    """Open the image database in a folder.

    Args:
        folder: The folder.
        headings: How its headings are meant, one of `tussock.world.headings.HEADINGS`; "auto" and "as-is" are bearings.

    Raises:
        FileError: Its entries or metadata are missing or damaged, list no images, or name files outside the folder.
    """
    folder = Path(folder)
    entries = read_entries(folder / ENTRIES)
    for name, line in zip(entries.names, entries.lines, strict=True):
        if name is not None and is_outside(folder, name):
            raise FileError(f"{folder / ENTRIES}, line {line}: {name!r} is not in the folder; name files inside it")
    metadata = read_metadata(folder / METADATA)
    kind = metadata.get("type")
    if kind not in KINDS:
        raise FileError(f"{folder / METADATA}: the type is {kind!r}; give {' or '.join(KINDS)}")
    entries = dataclasses.replace(entries, poses=convert(entries.poses, headings, "bearing"))
    return Database(folder=folder, kind=kind, metadata=metadata, **vars(entries))


def is_outside(folder: Path, name: str) -> bool:
    """Whether a file name leads out of a folder, or of a copy of it: it is absolute, or has `..` or a link that does."""
    if Path(name).is_absolute() or ".." in Path(name).parts:
        return True
    try:
        return not (folder / name).resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # a name that is too long or has a NUL; links in a circle
        return True


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, unless they exist. Raises FileError if that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"the folder {folder} cannot be made ({error.strerror}); give another") from error


def read_image(path: Path) -> UInt8[np.ndarray, "height width channels"]:
    """Read an image as RGB or RGBA. Raises FileError if it is missing, too large or cannot be read to its end."""
    _check_exists(path)
    damaged = f"{path} cannot be read as an image of 8 bits; replace it"
    try:
        with Image.open(path, formats=FORMATS) as header:  # reads the header only
            width, height = header.size
    except Image.DecompressionBombError as error:
        raise FileError(f"{path} is too large; give images of up to {MAX_PIXELS:,} pixels") from error
    except Exception as error:  # Pillow raises whatever its parsers raise
        raise FileError(damaged) from error
    if width * height > MAX_PIXELS:
        raise FileError(f"{path} is {width} x {height}; give images of up to {MAX_PIXELS:,} pixels")
    try:
        data = path.read_bytes()
        # libpng complains on standard error about a file that is cut off.
        whole = data[1:4] != b"PNG" or b"IEND" in data[-12:]
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if whole else None
    except (cv2.error, OSError):
        image = None
    if image is None or image.dtype != np.uint8 or image.ndim not in (2, 3):
        raise FileError(damaged)
    if image.ndim == 2:
        return cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
    return cv2.cvtColor(image, cv2.COLOR_BGRA2RGBA if image.shape[2] == 4 else cv2.COLOR_BGR2RGB)


def _check_exists(path: Path) -> None:
    if not os.path.isfile(path):  # unlike Path.is_file, False for names that are too long
        raise FileError(f"there is no image {path}; a check of the database lists all that are missing")


def _size(view: np.ndarray) -> str:
    return f"{view.shape[1]} x {view.shape[0]} x {view.shape[2]}"
