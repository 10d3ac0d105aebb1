"""A database whose images were all read, so that it can be checked, and what is found wrong with it."""

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from tussock.world.errors import FileError

from .database import Database, is_outside, is_transparent, log_opaque
from .entries import ENTRIES
from .lens_metadata import needs_unwrapping
from .pictures import read_image
from .video import count_frames, frames


@dataclass(frozen=True)
class Problem:
    """Something wrong with a database.

    Attributes:
        kind: A name for programs, which stays the same.
        where: A file, with a line where there is one.
        what: A sentence.
    """

    kind: str
    where: str
    what: str


@dataclass(frozen=True)
class Inspection:
    """A database, which may be damaged, and its images.

    Attributes:
        database: The database.
        shapes: Shapes of the images of all rows, None where an image cannot be read.
        headings: How its headings were read, as `read_database` takes it.
    """

    database: Database
    shapes: list[tuple[int, ...] | None]
    headings: str

    @property
    def usual_shape(self) -> tuple[int, ...] | None:
        """Height and width of most images."""
        usual = Counter(shape[:2] for shape in self.shapes if shape).most_common(1)
        return usual[0][0] if usual else None

    @property
    def needs_unwrapping(self) -> bool:
        """Whether most images are raw pictures of a panoramic camera."""
        return self.usual_shape is not None and needs_unwrapping(self.database.metadata, *self.usual_shape)

    def line(self, row: int) -> str:
        """Where a row is, for a `Problem`."""
        return f"{ENTRIES}, line {self.database.lines[row]}"


def inspected(database: Database, headings: str) -> Inspection:
    """Read all images. Raises FileError for a video that cannot be read at all."""
    if database.frames is not None and database.video is not None:
        count = count_frames(database.video)
        shape = next(frames(database.video, [0]))[1].shape if count else None
        return Inspection(database, [shape if number < count else None for number in database.frames], headings)
    with ThreadPoolExecutor() as pool:
        images = list(pool.map(lambda name: _examined(database.folder, name), database.names))
    shapes = [shape for shape, _ in images]
    if any(shape and shape[2] == 4 for shape in shapes) and not any(transparent for _, transparent in images):
        log_opaque(database.folder)
    return Inspection(database, shapes, headings)


def _examined(folder: Path, name: str | None) -> tuple[tuple[int, ...] | None, bool]:
    """The shape of an image, None where it cannot be read, and whether any of its pixels is not opaque."""
    try:
        picture = None if name is None or is_outside(folder, name) else read_image(folder / name)
    except FileError:
        picture = None
    return (None, False) if picture is None else (picture.shape, is_transparent(picture))
