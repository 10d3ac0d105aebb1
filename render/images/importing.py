"""Making a database of pictures or a video, and a table of where they were taken."""

import hashlib
import logging
import os
from pathlib import Path
from typing import Any

import attrs
import numpy as np
from jaxtyping import Bool

from tussock.world.atomic import replacing
from tussock.world.errors import FileError, InputError, SettingError
from tussock.world.heading_names import HEADINGS
from tussock.world.progress import Progress, no_progress
from tussock.world.settings import MAX_COORDINATE, choice, number, settings, text, whole

from ..eye import Eye
from ..mask import MIN_BRIGHT, fitted, read_mask
from .camera import Camera
from .completing import check_folder, complete, discard, metadata_of, missing_rows, start_or_resume
from .database import KINDS, Database, check_video_name, read_database
from .entries import ENTRIES, FILENAME, HEADING, Columns, X, Y, Z, bearings_in_file, format_decimal
from .lens_metadata import needs_unwrapping, stated_unwrapping, unwrapper_in
from .metadata import METADATA, group_in, read_metadata
from .pictures import Picture, encoded
from .sources import check_source, is_video_file, label, read_panoramas, sample
from .taken import Taken, taken_from_folder, taken_from_video
from .track import Track, read_track
from .unwrapping import Unwrapping

log = logging.getLogger(__name__)

MASK = "mask.png"
FORMATS = ("png", "jpg")
MAX_LATTICE = 0.05  # of the spacing by which positions of a grid may be off


@settings
class ImportSettings:
    """How a table and pictures become a database.

    Attributes:
        kind: route or grid; None is what the metadata of a database says, or route.
        columns: As `read_track` takes them.
        unit: Of positions without a unit.
        headings: How headings are meant.
        every: Every N-th row; of a video: every N-th frame, at positions between the rows. None is one picture a row.
        start: Time in the track at which a video begins (s); None is that of the first row.
        height: Height of the eye above z = 0 (m); None takes it from the table, or 0.
        mask: Picture that is black where the eye is covered, of the size of the pictures or of the panoramas.
        format: Of the images: png, or jpg.
        quality: Of JPEG images.
    """

    kind: str | None = choice(None, KINDS, optional=True)
    columns: str | None = text(None, optional=True)
    unit: str | None = text(None, optional=True)
    headings: str = choice("auto", HEADINGS)
    every: int | None = whole(None, low=1, optional=True)
    start: float | None = number(None, unit="s", optional=True)
    height: float | None = number(None, low=-MAX_COORDINATE, high=MAX_COORDINATE, unit="m", optional=True)
    mask: Path | None = attrs.field(default=None)
    format: str = choice("png", FORMATS)
    quality: int = whole(80, low=1, high=100)


def import_database(
    out: Path,
    source: Path,
    track: Path | None = None,
    camera: Camera | None = None,
    settings: ImportSettings | None = None,
    progress: Progress = no_progress,
) -> tuple[Database, int]:
    """Make an image database of pictures and a table. A folder that an interrupted call left is completed.

    Args:
        out: A new or empty folder, or one to complete.
        source: Folder of pictures, video, or database whose images are to be unwrapped.
        track: Table with a row for each picture, or from which positions are interpolated; None is the entries of a database.
        camera: How panoramas are made of the pictures.
        settings: How table and pictures are read.
        progress: Called now and then with the number of images that are done, and of all.

    Returns:
        The database, and how many images were written by this call.

    Raises:
        InputError: Anything cannot be read or does not fit together, or `out` holds anything else. Then nothing is changed, unless images
            before one that cannot be read are listed already.
    """
    camera, settings = camera or Camera(), settings or ImportSettings()
    check_folder(out)
    check_source(source)
    origin = _metadata_of(source)
    kind = settings.kind or str(origin.get("type", "route"))
    if kind not in KINDS:
        raise FileError(f"{source / METADATA}: the type is {kind!r}; give {' or '.join(KINDS)}")
    if track is None and not origin:
        raise FileError(f"there is no table of where the pictures of {source} were taken; give one with --track")
    rows = _rows(track or source / ENTRIES, kind, settings)
    metadata_path = source / METADATA
    if origin.get("videoFile"):
        check_video_name(source, origin)
        source = source / str(origin["videoFile"])
    if is_video_file(source):
        taken = taken_from_video(source, rows, settings.every, settings.start)
    elif settings.start is not None:
        raise SettingError(f"a start is the time at which a video begins, and {source} is a folder; leave it out")
    else:
        taken = taken_from_folder(source, rows, settings.every)
    pictures = sample(source, taken.references)
    unwrapping = _unwrapping(origin, metadata_path, camera, pictures)
    return _imported(out, source, taken, pictures[0].shape, unwrapping, kind, settings, progress)


def _imported(
    out: Path,
    source: Path,
    taken: Taken,
    shape: tuple[int, ...],
    unwrapping: Unwrapping,
    kind: str,
    settings: ImportSettings,
    progress: Progress,
) -> tuple[Database, int]:
    """Write the database of pictures of a shape, and return what `import_database` does."""
    seen = _seen(unwrapping, settings.mask, shape)
    height = float(np.median(taken.z)) if settings.height is None else settings.height
    eye = Eye(width=unwrapping.width, height=unwrapping.height, top=unwrapping.top, bottom=unwrapping.bottom, z=height)
    columns, lattice = _columns(taken, kind, settings.format)
    stored = eye.plain() | {"samples": eye.rays} | ({} if seen is None else {"mask": MASK})
    digest = _digest(source, taken, unwrapping, seen, settings)
    tussock = {"source": digest, "views": len(taken.references), "eye": stored}
    start_or_resume(out, metadata_of(kind, "imported", eye, tussock, lattice))
    if seen is not None:
        with replacing(out / MASK) as partial:
            partial.write_bytes(encoded(_grey(seen), ".png"))
    missing = missing_rows(out, columns)
    missing.sort(key=lambda row: taken.references[row] if isinstance(taken.references[row], int) else row)
    panoramas = read_panoramas(source, [taken.references[row] for row in missing], unwrapping, shape)
    try:
        complete(out, columns, missing, lambda rows: [next(panoramas) for _ in rows], progress, settings.quality)
    except InputError:  # with the picture that cannot be read replaced, it is another source, and refused as such
        if not (out / ENTRIES).exists():
            discard(out, [METADATA, MASK, *columns[FILENAME]])
        raise
    return read_database(out), len(missing)


def _metadata_of(source: Path) -> dict[str, Any]:
    """The metadata of a source that is a database itself, or nothing."""
    is_database = os.path.isfile(source / METADATA) and os.path.isfile(source / ENTRIES)
    return read_metadata(source / METADATA) if is_database else {}


def _rows(path: Path, kind: str, settings: ImportSettings) -> Track:
    """Where the pictures of a route or a grid were taken. Raises FileError, SettingError."""
    if not os.path.isfile(path):
        raise FileError(f"there is no table {path} of where the pictures were taken; give one with --track")
    return read_track(path, settings.columns, settings.unit, settings.headings, along_path=kind == "route")


def _unwrapping(origin: dict[str, Any], path: Path, camera: Camera, pictures: list[Picture]) -> Unwrapping:
    """How panoramas are made of pictures.

    Args:
        origin: The metadata of the database that they are from, or nothing. What they state holds where the camera says nothing else.
        path: The file of the metadata.
        camera: What is given.
        pictures: Some of the pictures.
    """
    height, width = pictures[0].shape[:2]
    if camera.stated_lens == "auto" and unwrapper_in(origin) and needs_unwrapping(origin, height, width):
        return stated_unwrapping(origin, height, width, path)
    eye = group_in(origin, "tussock", "eye")
    edges = {edge: eye.get(edge) for edge in ("top", "bottom") if getattr(camera, edge) is None}
    edges = {edge: float(value) for edge, value in edges.items() if isinstance(value, int | float)}
    return attrs.evolve(camera, **edges).unwrapping(pictures)


def _seen(unwrapping: Unwrapping, mask: Path | None, shape: tuple[int, ...]) -> Bool[np.ndarray, "height width"] | None:
    """Which pixels of the panorama show the world; None where all do."""
    seen = unwrapping.seen(*shape[:2])
    if not seen.all():
        log.warning(
            "%.0f %% of the panorama is not in the pictures: it is black, and kept as a mask of the eye",
            100 * (1 - seen.mean()),
        )
    if mask is not None:
        drawn = read_mask(mask)
        if drawn.shape == shape[:2]:
            drawn = unwrapping(_grey(drawn))[..., 0] >= MIN_BRIGHT
        elif abs(drawn.shape[1] * seen.shape[0] / (drawn.shape[0] * seen.shape[1]) - 1) > 0.02:
            raise FileError(
                f"{mask} is {drawn.shape[1]} x {drawn.shape[0]}; give a mask of the size of the pictures ({shape[1]} x {shape[0]}) "
                f"or of the panoramas ({seen.shape[1]} x {seen.shape[0]})"
            )
        drawn = fitted(drawn, unwrapping.width, unwrapping.height)
        log.warning(
            "%s covers %.0f %% of the panorama: kept as %s of the eye; what is behind is not known",
            mask,
            100 * (1 - drawn.mean()),
            MASK,
        )
        seen &= drawn
    if not seen.any():
        raise SettingError(
            "the mask covers the whole panorama; a mask is white where the eye sees, and black where it is covered"
        )
    return None if seen.all() else seen


def _columns(taken: Taken, kind: str, suffix: str) -> tuple[Columns, dict[str, Any] | None]:
    """The entries of the complete database; and the metadata of a grid, if its positions are a complete one."""
    n = len(taken.references)
    nanometres = np.rint(np.column_stack([taken.poses[:, :2], taken.z]) * 1e9)
    bearing = bearings_in_file(taken.poses[:, 2])
    if not (np.isfinite(nanometres).all() and np.abs(nanometres).max() < 1e20):
        raise FileError("a position is too far away for a database; give x, y and z up to 1e+08 m")
    mm = np.rint(nanometres / 1e6).astype(int)
    names = ["image_" + "_".join(f"{each:+07d}" for each in row) + f".{suffix}" for row in mm.tolist()]
    if kind == "route" or len(set(names)) < n:
        names = [f"image_{row:05d}.{suffix}" for row in range(n)]
    columns: Columns = {
        name: tuple(format_decimal(value, 6) for value in nanometres[:, axis]) for axis, name in enumerate((X, Y, Z))
    }
    columns |= {HEADING: tuple(format_decimal(value, 9) for value in bearing), FILENAME: tuple(names)}
    if kind == "route":
        return columns, None
    axes = [_lattice(mm[:, axis]) for axis in range(3)]
    if any(axis is None for axis in axes):
        log.warning("the positions are not those of a regular grid, so that no Grid X and Grid Y are written")
        return columns, None
    found = [axis for axis in axes if axis is not None]
    columns |= {
        f"Grid {name}": tuple(map(str, index.tolist())) for name, (_, _, index) in zip("XYZ", found, strict=True)
    }
    size = [int(index.max()) + 1 for _, _, index in found]
    if np.prod(size) != n:
        return columns, None
    return columns, {
        "beginAtMM": [begin for begin, _, _ in found],
        "separationMM": [step for _, step, _ in found],
        "size": size,
    }


def _lattice(mm: np.ndarray) -> tuple[float, float, np.ndarray] | None:
    """Begin, spacing and index of positions along an axis (mm), None where they are not evenly spaced."""
    values = np.unique(mm)
    if len(values) == 1:
        return float(values[0]), 0.0, np.zeros(len(mm), dtype=int)
    step = np.diff(values)
    spacing = float(np.median(step[step > 0.5 * np.median(step)]))
    index = (mm - values[0]) / spacing
    regular = np.abs(index - np.rint(index)).max() <= MAX_LATTICE
    return (float(values[0]), spacing, np.rint(index).astype(int)) if regular else None


def _digest(
    source: Path, taken: Taken, unwrapping: Unwrapping, seen: np.ndarray | None, settings: ImportSettings
) -> str:
    """What decides the images: only the same is completed."""
    sizes = [os.path.getsize(source / each) if isinstance(each, str) else 0 for each in taken.references]
    parts = [unwrapping, settings.format, settings.quality, [label(each) for each in taken.references], sizes]
    if is_video_file(source):
        parts.append(os.path.getsize(source))
    scene = repr(parts).encode() + taken.poses.tobytes() + taken.z.tobytes() + (b"" if seen is None else seen.tobytes())
    return hashlib.sha256(scene).hexdigest()


def _grey(visible: Bool[np.ndarray, "height width"]) -> Picture:
    """A mask as a picture, white where the eye sees."""
    return np.repeat(np.uint8(255) * visible[..., None], 3, axis=2)
