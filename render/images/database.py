"""Image databases in the BoB format: a folder of panoramas, where each was taken, and how.

The format is used at Sussex, Sheffield and Imperial. A row of a route has the bearing of the segment that led to it, and its image
was taken facing there.
"""

import logging
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.atomic import replacing
from tussock.world.errors import FileError
from tussock.world.headings import convert

from .entries import ENTRIES, Columns, Entries, is_grid, read_entries, write_entries
from .lens_metadata import needs_unwrapping, stated_unwrapping
from .metadata import METADATA, read_metadata, write_metadata
from .pictures import Picture, check_exists, read_image
from .video import VideoReader, frames_of_rows

log = logging.getLogger(__name__)

KINDS = ("route", "grid")
ALPHA_SAMPLE = 16  # images by which it is decided whether alpha may be opaque in all of them


@dataclass(frozen=True, kw_only=True, eq=False)
class Database:
    """An image database in a folder. Images are read when `views` asks for them.

    Attributes:
        folder: The folder.
        kind: "route" or "grid".
        metadata: All that the metadata file has.
        poses: x (m), y (m) and heading (rad) of each row, nan where a cell is empty. Nothing is taken off positions far from 0.
        z: Heights (m), nan where a cell is empty.
        names: Image files in the folder, None where a cell is empty or the rows are frames of a video.
        frames: Frame of the video for each row, None where the rows name image files.
        columns: All columns of the entries as text, unknown ones too.
        lines: Line of the entries file for each row.
    """

    folder: Path
    kind: str
    metadata: dict[str, Any]
    poses: Float[np.ndarray, "n 3"]
    z: Float[np.ndarray, " n"]
    names: tuple[str | None, ...]
    frames: tuple[int, ...] | None
    columns: Columns
    lines: list[int]

    def __len__(self) -> int:
        return len(self.names)

    @property
    def video(self) -> Path | None:
        """The video whose frames the rows are, None where they name image files."""
        return None if self.frames is None else self.folder / str(self.metadata.get("videoFile"))

    def views(
        self, rows: slice | Sequence[int] | np.ndarray | None = None
    ) -> UInt8[np.ndarray, "m height width channels"]:
        """Read the panoramas of some rows, or of all. Raw pictures are unwrapped, if the metadata has how.

        Args:
            rows: Which rows; None is all. A video is read forward from the last frame, and from its beginning for an earlier one.

        Returns:
            RGB, or RGBA as the renderers give it. Grey images have three equal channels. Alpha that is opaque in all images of the
            database does not say what is open sky, and is dropped.

        Raises:
            FileError: An image is missing, damaged, or of another size than the first; or how to unwrap it is not known.
        """
        chosen = np.arange(len(self))[slice(None) if rows is None else rows].tolist()
        if not chosen:
            return np.empty((0, 0, 0, 3), dtype=np.uint8)
        if self._reader is not None:
            return self._frames(self._reader, chosen)
        views = self._pictures(chosen)
        if any(view.shape[2] == 4 for view in views) and self.is_opaque:
            views = [view[..., :3] for view in views]
        for row, view in zip(chosen, views, strict=True):
            if view.shape != views[0].shape:
                raise FileError(
                    f"{self.folder / self.label(row)} is {_size(view)}, {self.label(chosen[0])} is {_size(views[0])}; "
                    "give images of one size"
                )
        return np.stack([self._panorama(view) for view in views])

    def label(self, row: int) -> str:
        """The image of a row, for messages."""
        return self.names[row] or f"frame {self.frames[row]}" if self.frames else str(self.names[row])

    @cached_property
    def _reader(self) -> VideoReader | None:
        return None if self.video is None else VideoReader(self.video)

    def passed(self, row: int, limit: int) -> list[int]:
        """A row, and up to a limit of others that cost little with it: of a video, those whose frames are passed last on the way."""
        frames, reader = self.frames, self._reader
        if frames is None or reader is None:
            return [row]
        begin = reader.position if frames[row] >= reader.position else 0
        others = [other for other, each in enumerate(frames) if begin <= each < frames[row]]
        others.sort(key=lambda other: frames[other])
        return [*others[max(0, len(others) - limit) :], row]

    def close(self) -> None:
        """Close the video that is kept open between frames, if there is one. It is opened again when a frame is read."""
        if self._reader is not None:
            self._reader.close()

    def _frames(self, reader: VideoReader, rows: list[int]) -> UInt8[np.ndarray, "m height width 3"]:
        """The panoramas of rows that are frames, unwrapped one by one, as raw frames may be large."""
        numbers = [(self.frames or ())[row] for row in rows]
        views = {number: self._panorama(reader.read(number)) for number in sorted(set(numbers))}
        return np.stack([views[number] for number in numbers])

    def _panorama(self, picture: Picture) -> Picture:
        height, width = picture.shape[:2]
        if not needs_unwrapping(self.metadata, height, width):
            return picture
        return stated_unwrapping(self.metadata, height, width, self.folder / METADATA)(picture)

    def _pictures(self, rows: list[int]) -> list[Picture]:
        """The pictures of rows as they are stored."""
        paths = [self._path(row) for row in rows]
        with ThreadPoolExecutor() as pool:
            return list(pool.map(read_image, paths))

    def _path(self, row: int) -> Path:
        name = self.names[row]
        if name is None:
            raise FileError(f"{self.folder / ENTRIES}: row {row} names no image; choose other rows")
        return self.folder / name

    @cached_property
    def is_opaque(self) -> bool:
        """Whether no image has any transparent pixel, although some have alpha. Decided once; then logged."""
        names = list(dict.fromkeys(filter(None, self.names)))
        sample = names[:: max(1, len(names) // ALPHA_SAMPLE)]
        with ThreadPoolExecutor() as pool:
            for some in (sample, names):  # all are read only where a sample has no transparent pixel
                for start in range(0, len(some), 64):
                    if any(pool.map(self._is_transparent, some[start : start + 64])):
                        return False
        log_opaque(self.folder)
        return True

    def _is_transparent(self, name: str) -> bool:
        try:
            return is_transparent(read_image(self.folder / name))
        except FileError:  # reported where it is needed
            return False

    def write(self, folder: str | os.PathLike) -> "Database":
        """Copy the database: images byte for byte, entries and metadata completely.

        Args:
            folder: A new or empty folder.

        Raises:
            FileError: The folder is not empty, or an image is missing.
        """
        folder = Path(folder)
        names = [str(self.metadata.get("videoFile"))] if self.frames else list(dict.fromkeys(filter(None, self.names)))
        for name in names:
            check_exists(self.folder / name)
        check_new(folder)
        make_folder(folder)
        write_metadata(folder / METADATA, self.metadata)
        for name in names:
            make_folder((folder / name).parent)
            with replacing(folder / name) as partial:
                partial.write_bytes((self.folder / name).read_bytes())
        write_entries(folder / ENTRIES, self.columns)
        return read_database(folder)


def read_database(folder: str | os.PathLike, headings: str = "auto") -> Database:
    """Open the image database in a folder. Without a metadata file, its kind is guessed from its columns, and that is logged.

    Args:
        folder: The folder.
        headings: How its headings are meant, one of `tussock.world.heading_names.HEADINGS`; "auto" and "as-is" are bearings, which the
            format has.

    Raises:
        FileError: Its entries are missing, its files are damaged, list no images, or name files outside the folder.
        SettingError: For an unknown convention of headings.
    """
    folder = Path(folder)
    entries = read_entries(folder / ENTRIES)
    for name, line in zip(entries.names, entries.lines, strict=True):
        if name is not None and is_outside(folder, name):
            raise FileError(f"{folder / ENTRIES}, line {line}: {name!r} is not in the folder; name files inside it")
    metadata = stated_metadata(folder)
    if metadata is None:
        metadata = guessed_metadata(folder, entries.columns)
    check_kind(folder, metadata)
    return assembled(folder, entries, metadata, headings)


def stated_metadata(folder: Path) -> dict[str, Any] | None:
    """The metadata in a folder, None where there is no such file. Raises FileError for a damaged one."""
    return read_metadata(folder / METADATA) if os.path.lexists(folder / METADATA) else None


def check_kind(folder: Path, metadata: dict[str, Any]) -> None:
    """Refuse metadata of anything else than a route or a grid. Raises FileError."""
    if metadata.get("type") not in KINDS:
        raise FileError(f"{folder / METADATA}: the type is {metadata.get('type')!r}; give {' or '.join(KINDS)}")


def assembled(folder: Path, entries: Entries, metadata: dict[str, Any], headings: str) -> Database:
    """The database of entries and metadata, whose kind is guessed where the metadata have none.

    Raises:
        FileError: The rows are frames, and the metadata name no video in the folder.
        SettingError: For an unknown convention of headings.
    """
    kind = metadata["type"] if metadata.get("type") in KINDS else _guessed_kind(entries.columns)
    if entries.frames is not None:
        check_video_name(folder, metadata)
        entries = replace(entries, frames=frames_of_rows(folder / metadata["videoFile"], entries.frames))
    entries = replace(entries, poses=convert(entries.poses, headings, "bearing"))
    return Database(folder=folder, kind=kind, metadata=metadata, **vars(entries))


def check_video_name(folder: Path, metadata: dict[str, Any]) -> None:
    """Refuse metadata that does not name a video in the folder. Raises FileError."""
    name = metadata.get("videoFile")
    if not isinstance(name, str) or not name or "\0" in name:
        raise FileError(f"{folder / METADATA} names no videoFile, whose frames {ENTRIES} lists; write it there")
    if is_outside(folder, name):
        raise FileError(f"{folder / METADATA}: the videoFile {name!r} is not in the folder; name a file inside it")


def guessed_metadata(folder: Path, columns: Columns) -> dict[str, Any]:
    """Metadata of a database that has none."""
    kind = _guessed_kind(columns)
    why = "it has grid columns" if kind == "grid" else "it has no grid columns"
    log.warning("%s has no %s; it is read as a %s, because %s", folder, METADATA, kind, why)
    return {"type": kind}


def _guessed_kind(columns: Columns) -> str:
    return "grid" if is_grid(columns) else "route"


def is_transparent(picture: Picture) -> bool:
    """Whether any pixel is not opaque."""
    return picture.shape[2] == 4 and bool((picture[..., 3] < 255).any())


def log_opaque(folder: Path) -> None:
    """Log what is assumed of a database whose images have alpha that is opaque everywhere."""
    log.warning(
        "%s: alpha is 255 in all pixels of all images, so it does not say what is open sky; it is dropped, and open sky is estimated "
        "from colours",
        folder,
    )


def is_outside(folder: Path, name: str) -> bool:
    """Whether a file name leads out of a folder, or of a copy of it: it is absolute, or has `..` or a link that does."""
    if Path(name).is_absolute() or ".." in Path(name).parts:
        return True
    try:
        return not (folder / name).resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # a name that is too long or has a NUL; links in a circle
        return True


def check_new(folder: Path) -> None:
    """Refuse a folder that holds anything. Raises FileError."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise FileError(f"{folder} exists already and is not empty; give a new folder")


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, unless they exist. Raises FileError if that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"the folder {folder} cannot be made ({error.strerror}); give another") from error


def _size(view: np.ndarray) -> str:
    return f"{view.shape[1]} x {view.shape[0]} x {view.shape[2]}"
