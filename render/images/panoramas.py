"""Panoramas of pictures, as files."""

import logging
import os
from pathlib import Path

from tussock.world.atomic import check_writable, replacing
from tussock.world.errors import FileError, SettingError
from tussock.world.progress import Progress, printed

from .camera import Camera
from .database import check_new, make_folder
from .lenses import Ring
from .pictures import SUFFIXES, Picture, check_content, encoded
from .ring_search import draw_ring
from .sources import Reference, frames_of, is_video_file, picture_names, read_panoramas, sample, sampled
from .unwrapping import Unwrapping

log = logging.getLogger(__name__)

FORMATS = (".png", ".jpg")


def unwrap_files(
    source: Path,
    out: Path,
    camera: Camera,
    every: int = 1,
    suffix: str = ".png",
    quality: int = 80,
    drawing: Path | None = None,
    progress: Progress | None = None,
) -> tuple[Unwrapping, int]:
    """Make panoramas of the pictures of one camera. A folder that an interrupted call left is completed.

    Args:
        source: A picture, a folder of pictures, or a video.
        out: The file to write for one picture; otherwise a new or empty folder, or one to complete.
        camera: How panoramas are made.
        every: Every N-th picture or frame.
        suffix: Of the files in a folder: ".png" or ".jpg".
        quality: Of JPEG images.
        drawing: File (.png) for the first picture with the ring drawn on it, or None.
        progress: Called now and then with the number of panoramas that are done, and of all; None prints a line where it takes long,
            `no_progress` none.

    Returns:
        How they were made, and how many.

    Raises:
        InputError: Anything cannot be read, or `out` is complete or holds anything else.
    """
    progress = printed(progress, "unwrapping", "pictures")
    single = os.path.isfile(source) and not is_video_file(source)
    folder, references = _chosen(source, every, single)
    files = _files(out, source, references, single, suffix)
    if drawing is not None:
        check_writable(drawing)
    pictures = sample(folder, references)
    unwrapping = camera.unwrapping(pictures)
    there = set() if single else _earlier(files, pictures, unwrapping, quality)
    if drawing is not None:
        _draw(drawing, pictures[0], unwrapping)
    if not single:
        make_folder(out)
    missing = [reference for reference in references if reference not in there]
    panoramas = read_panoramas(folder, missing, unwrapping, pictures[0].shape)
    for done, (reference, panorama) in enumerate(zip(missing, panoramas, strict=True), len(there) + 1):
        _write(files[reference], panorama, quality)
        progress(done, len(files))
    return unwrapping, len(files)


def _chosen(source: Path, every: int, single: bool) -> tuple[Path, list[Reference]]:
    """Every N-th picture of a source, and the folder or video that it is in. Raises FileError, SettingError."""
    if every < 1:
        raise SettingError(f"every {every} pictures; give at least 1")
    if single:
        check_content(source)
        return source.parent, [source.name]
    return source, list(frames_of(source, every) if is_video_file(source) else picture_names(source)[::every])


def _files(out: Path, source: Path, references: list[Reference], single: bool, suffix: str) -> dict[Reference, Path]:
    """The file to write for each picture. Raises FileError where all are there already, or anything else is."""
    if single:
        check_writable(out)
        if out.resolve() == source.resolve():
            raise FileError(f"{out} is the picture itself; give another file to write")
        if out.suffix.lower() not in FORMATS:
            raise FileError(f"{out}: a panorama is written as .png or .jpg")
        return {references[0]: out}
    stems = [f"frame_{each:05d}" if isinstance(each, int) else Path(each).stem for each in references]
    if len(set(stems)) < len(stems):
        raise FileError(f"two pictures have the same name but for {' or '.join(SUFFIXES)}; rename one")
    files = {reference: out / f"{stem}{suffix}" for reference, stem in zip(references, stems, strict=True)}
    partial = set(out.glob(".*.partial.*"))  # of a run that was killed
    found = set(out.iterdir()) - partial if out.is_dir() else set()
    if not out.is_dir() or not found <= set(files.values()):
        check_new(out)
    if out.resolve() == source.resolve():
        raise FileError(f"{out} is the folder of the pictures; give a new folder")
    if len(found) == len(files):
        raise FileError(f"{out} holds all {len(files)} panoramas already; give a new folder")
    for path in partial:
        path.unlink(missing_ok=True)
    return files


def _earlier(
    files: dict[Reference, Path], pictures: list[Picture], unwrapping: Unwrapping, quality: int
) -> set[Reference]:
    """The pictures whose panoramas an earlier run made. Raises FileError where this one would make another of a sampled picture."""
    there = {reference for reference, file in files.items() if file.exists()}
    for reference, picture in zip(sampled(list(files)), pictures, strict=True):
        file = files[reference]
        if reference in there and file.read_bytes() != encoded(unwrapping(picture), file.suffix, quality):
            raise FileError(f"{file} was made in another way, or of another picture; give a new folder")
    if there:
        folder = next(iter(files.values())).parent
        log.warning(
            "%s holds %d of %d panoramas from an earlier run; the others are made", folder, len(there), len(files)
        )
    return there


def _draw(file: Path, picture: Picture, unwrapping: Unwrapping) -> None:
    """Draw the ring on a picture. Raises SettingError for other lenses."""
    if not isinstance(unwrapping.lens, Ring):
        raise SettingError("a drawing of what was found is of a ring; leave it out for other lenses")
    _write(file, draw_ring(picture, unwrapping.lens))


def _write(path: Path, picture: Picture, quality: int = 80) -> None:
    with replacing(path) as partial:
        partial.write_bytes(encoded(picture, path.suffix.lower(), quality))
