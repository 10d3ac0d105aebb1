"""Writing a database picture by picture, into a folder that can be completed after any interruption."""

import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from tussock.world.atomic import replacing
from tussock.world.errors import FileError
from tussock.world.progress import Progress

from ..eye import Eye
from .database import make_folder
from .entries import ENTRIES, FILENAME, Columns, read_entries, write_entries
from .metadata import METADATA, group_in, read_metadata, write_metadata
from .pictures import Picture, encoded

BATCH = 64  # pictures that are made while those before them are encoded


def metadata_of(
    kind: str, camera: str, eye: Eye, tussock: dict[str, Any], grid: dict[str, Any] | None = None
) -> dict[str, Any]:
    """The metadata of a database of panoramas.

    Args:
        kind: route or grid.
        camera: Its name.
        eye: Of the size of the panoramas.
        tussock: What decides the images, for `start_or_resume`.
        grid: What the metadata say about a grid.
    """
    metadata: dict[str, Any] = {"time": time.strftime("%Y-%m-%d %H:%M:%S"), "type": kind}
    if grid is not None:
        metadata["grid"] = grid
    described = {"name": camera, "resolution": [eye.width, eye.height], "isPanoramic": 0}
    return metadata | {"camera": described, "needsUnwrapping": 0, "isGreyscale": 0, "tussock": {"version": 1} | tussock}


def check_folder(folder: Path) -> None:
    """Refuse a folder that holds anything else than an image database. Raises FileError."""
    if (folder / METADATA).is_file():
        return
    if folder.exists() and (not folder.is_dir() or set(folder.iterdir()) - set(_partial_files(folder))):
        raise FileError(f"{folder} exists already and is not an image database; give a new folder")


def start_or_resume(folder: Path, metadata: dict[str, Any]) -> None:
    """Start a database in a new or empty folder, or resume the same one.

    Args:
        folder: The folder.
        metadata: Of the database. All under `tussock`, and `type`, must be the same to resume.

    Raises:
        FileError: The folder holds anything else.
    """
    if (folder / METADATA).is_file():
        theirs = read_metadata(folder / METADATA)
        for name, value in {"type": metadata["type"], **metadata["tussock"]}.items():
            group = theirs if name == "type" else group_in(theirs, "tussock")
            if group.get(name) != value:
                raise FileError(f"{folder} holds an image database that differs in its {name}; give another folder")
    else:
        check_folder(folder)
        make_folder(folder)
        write_metadata(folder / METADATA, metadata)


def discard(folder: Path, names: list[str]) -> None:
    """Delete files of a database of which no row is listed yet, and the folder if nothing else is in it."""
    for name in names:
        (folder / name).unlink(missing_ok=True)
    with suppress(OSError):
        folder.rmdir()


def missing_rows(folder: Path, columns: Columns) -> list[int]:
    """Rows that are not in the entries of the folder, or whose image is missing. Raises FileError if the entries have other columns."""
    listed = set()
    if (folder / ENTRIES).is_file():
        theirs = read_entries(folder / ENTRIES).columns
        if list(theirs) != list(columns):
            raise FileError(f"{folder / ENTRIES} was changed since it was written; give another folder")
        listed = set(zip(*theirs.values(), strict=True))
    rows = zip(*columns.values(), strict=True)
    images = {path.name for path in folder.glob("image_*")}
    return [i for i, row in enumerate(rows) if row not in listed or columns[FILENAME][i] not in images]


def complete(
    folder: Path,
    columns: Columns,
    missing: list[int],
    make: Callable[[list[int]], Iterable[Picture]],
    progress: Progress,
    quality: int = 80,
) -> None:
    """Make the images of the missing rows. The entries list each batch when all of its images are saved.

    Args:
        folder: A folder that `start_or_resume` has made.
        columns: Entries of the complete database.
        missing: Rows to make, in this order.
        make: Makes the pictures of some rows.
        progress: Called now and then with the number of images that are done, and of all.
        quality: Of JPEG images.
    """
    for path in _partial_files(folder):
        path.unlink(missing_ok=True)
    done = np.ones(len(columns[FILENAME]), dtype=bool)
    done[missing] = False

    def finish(rows: list[int], saving: list[Future]) -> None:
        for image in saving:
            image.result()
        done[rows] = True
        listed = np.flatnonzero(done).tolist()
        write_entries(folder / ENTRIES, {name: tuple(cells[i] for i in listed) for name, cells in columns.items()})
        progress(len(listed), len(done))

    if not missing:
        return
    with ThreadPoolExecutor() as pool:
        before: tuple[list[int], list[Future]] = ([], [])
        for start in range(0, len(missing), BATCH):
            rows = missing[start : start + BATCH]
            pictures = make(rows)
            finish(*before)
            paths = [folder / columns[FILENAME][row] for row in rows]
            saving = [pool.submit(_save, path, each, quality) for path, each in zip(paths, pictures, strict=True)]
            before = rows, saving
        finish(*before)


def _partial_files(folder: Path) -> list[Path]:
    """The temporary files of a call that was killed."""
    return [*folder.glob(".image_*.partial.*"), *folder.glob(".database_*.partial.*")]


def _save(path: Path, picture: Picture, quality: int) -> None:
    with replacing(path) as partial:
        partial.write_bytes(encoded(picture, os.path.splitext(path)[1], quality))
