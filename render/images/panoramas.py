"""Panoramas of pictures, as files."""

import os
from pathlib import Path

from tussock.world.atomic import check_writable, replacing
from tussock.world.errors import FileError, SettingError
from tussock.world.progress import Progress, no_progress

from .camera import Camera
from .database import check_new, make_folder
from .pictures import SUFFIXES, Picture, check_content, encoded
from .ring_search import draw_ring
from .sources import frames_of, is_video_file, picture_names, read_panoramas, sample
from .unwrapping import Ring, Unwrapping

FORMATS = (".png", ".jpg")


def unwrap_files(
    source: Path,
    out: Path,
    camera: Camera,
    every: int = 1,
    suffix: str = ".png",
    quality: int = 80,
    drawing: Path | None = None,
    progress: Progress = no_progress,
) -> tuple[Unwrapping, int]:
    """Make panoramas of the pictures of one camera.

    Args:
        source: A picture, a folder of pictures, or a video.
        out: The file to write for one picture; otherwise a new or empty folder.
        camera: How panoramas are made.
        every: Every N-th picture or frame.
        suffix: Of the files in a folder: ".png" or ".jpg".
        quality: Of JPEG images.
        drawing: File (.png) for the first picture with the ring drawn on it, or None.
        progress: Called now and then with the number of panoramas that are done, and of all.

    Returns:
        How they were made, and how many.

    Raises:
        InputError: Anything cannot be read, or `out` holds anything already.
    """
    if every < 1:
        raise SettingError(f"every {every} pictures; give at least 1")
    single = os.path.isfile(source) and not is_video_file(source)
    if single:
        check_content(source)
        folder, references = source.parent, [source.name]
    elif is_video_file(source):
        folder, references = source, frames_of(source, every)
    else:
        folder, references = source, picture_names(source)[::every]
    files = _files(out, references, single, suffix)
    if drawing is not None:
        check_writable(drawing)
    pictures = sample(folder, references)
    unwrapping = camera.unwrapping(pictures)
    if drawing is not None:
        if not isinstance(unwrapping.lens, Ring):
            raise SettingError("a drawing of what was found is of a ring; leave it out for other lenses")
        _write(drawing, draw_ring(pictures[0], unwrapping.lens), quality)
    if not single:
        make_folder(out)

    panoramas = read_panoramas(folder, references, unwrapping, pictures[0].shape)
    for done, (file, made) in enumerate(zip(files, panoramas, strict=True), 1):
        _write(file, made, quality)
        progress(done, len(files))
    return unwrapping, len(files)


def _files(out: Path, references: list, single: bool, suffix: str) -> list[Path]:
    """The files to write. Raises FileError where they are there already."""
    if single:
        check_writable(out)
        if out.suffix.lower() not in FORMATS:
            raise FileError(f"{out}: a panorama is written as .png or .jpg")
        return [out]
    check_new(out)
    if isinstance(references[0], int):
        return [out / f"frame_{number:05d}{suffix}" for number in references]
    stems = [Path(name).stem for name in references]
    if len(set(stems)) < len(stems):
        raise FileError(f"two pictures have the same name but for {' or '.join(SUFFIXES)}; rename one")
    return [out / f"{stem}{suffix}" for stem in stems]


def _write(path: Path, picture: Picture, quality: int) -> None:
    with replacing(path) as partial:
        partial.write_bytes(encoded(picture, path.suffix.lower(), quality))
