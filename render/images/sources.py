"""Pictures in a folder, or frames in a video: which there are, and reading them in order."""

import os
import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path, PureWindowsPath

from tussock.world.errors import FileError, SettingError

from .pictures import SUFFIXES, Picture, check_content, read_image
from .video import count_frames, frames, is_video

SAMPLE = 12  # pictures in which a ring is looked for
SAMPLE_FRAMES = 300  # of a video, from which they are taken

Reference = str | int  # name of a picture, or number of a frame


def check_source(path: Path) -> None:
    """Refuse what is neither a folder nor a video. Raises FileError."""
    if os.path.isfile(path) and not is_video_file(path):
        check_content(path)
        raise FileError(f"{path} is neither a folder of pictures nor a video (AVI, MP4, MOV or MKV); give one of these")
    if not os.path.exists(path):
        raise FileError(f"there is no folder or video {path}; give a folder of pictures, or a video")


def picture_names(folder: Path) -> list[str]:
    """Names of the pictures in a folder, by the numbers in them: image2 comes before image10. Raises FileError if there are none."""
    check_source(folder)
    names = [
        path.name for path in folder.iterdir() if path.suffix.lower() in SUFFIXES and not path.name.startswith(".")
    ]
    if not names:
        raise FileError(f"{folder} holds no pictures ({', '.join(SUFFIXES)}); give another folder")
    return sorted(names, key=_by_number)


def _by_number(name: str) -> list[tuple[int, str]]:
    """What names are sorted by: their numbers as numbers."""
    parts = re.findall(r"[0-9]+|[^0-9]+", name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]


def name_in(folder: Path, text: str) -> str | None:
    """The name of a picture in a folder that a table calls `text`, which may be a path on another machine; None if it is not there."""
    parts = PureWindowsPath(text).parts
    for name in ("/".join(parts), PureWindowsPath(text).name):
        inside = name and ".." not in parts and not os.path.isabs(name) and ":" not in name and "\0" not in name
        if inside and os.path.isfile(folder / name) and (folder / name).resolve().is_relative_to(folder.resolve()):
            return name
    return None


def frames_of(video: Path, every: int) -> list[int]:
    """Every N-th frame of a video. Raises FileError, SettingError."""
    if every < 1:
        raise SettingError(f"every {every} frames; give at least 1")
    found = list(range(0, count_frames(video), every))
    if not found:
        raise FileError(f"{video} has no frames that can be read; repair the video")
    return found


def is_frames(references: Sequence[Reference]) -> bool:
    """Whether references are frames of a video."""
    return isinstance(references[0], int)


def sampled(references: Sequence[Reference]) -> list[Reference]:
    """Some of the pictures, as different as it is cheap to read."""
    if is_frames(references):
        references = [each for each in sorted(set(references)) if int(each) < int(min(references)) + SAMPLE_FRAMES]
    return list(references[:: max(1, len(references) // SAMPLE)])


def sample(source: Path, references: Sequence[Reference]) -> list[Picture]:
    """The pictures that `sampled` chooses. Raises FileError where they differ in size."""
    chosen = sampled(references)
    pictures = list(read_pictures(source, chosen))
    for reference, picture in zip(chosen, pictures, strict=True):
        check_alike(source, reference, picture, pictures[0].shape)
    return pictures


def check_alike(source: Path, reference: Reference, picture: Picture, shape: tuple[int, ...]) -> None:
    """Refuse a picture of another size than the first one. Raises FileError."""
    if picture.shape[:2] != shape[:2]:
        sizes = "{1} x {0}, and not {3} x {2} as the first".format(*picture.shape[:2], *shape[:2])
        raise FileError(f"{source}: {label(reference)} is {sizes}; give pictures of one size")


def label(reference: Reference) -> str:
    """A picture, for messages."""
    return f"frame {reference}" if isinstance(reference, int) else reference


def read_pictures(
    source: Path, references: Sequence[Reference], then: Callable[[Reference, Picture], Picture] | None = None
) -> Iterator[Picture]:
    """Read pictures in order; frames must ascend, and may repeat.

    Args:
        source: Folder, or video.
        references: Which pictures.
        then: Makes something of each picture, in threads where they are files.
    """
    made = then or (lambda _, picture: picture)
    if not references:
        return
    if is_frames(references):
        read = frames(source, [int(each) for each in references])
        number, picture = -1, None
        for reference in references:
            if reference != number:
                number, picture = next(read)
            assert picture is not None
            yield made(reference, picture)
        return
    with ThreadPoolExecutor() as pool:
        for start in range(0, len(references), 32):
            yield from pool.map(lambda name: made(name, read_image(source / str(name))), references[start : start + 32])


def read_panoramas(
    source: Path, references: Sequence[Reference], unwrapping: Callable[[Picture], Picture], shape: tuple[int, ...]
) -> Iterator[Picture]:
    """Read pictures in order, as `read_pictures`, and unwrap each. Raises FileError for one whose size is not that of a shape."""

    def panorama(reference: Reference, picture: Picture) -> Picture:
        check_alike(source, reference, picture, shape)
        return unwrapping(picture)

    return read_pictures(source, references, panorama)


def is_video_file(path: Path) -> bool:
    """Whether a path is a video, and not a picture or a folder."""
    return os.path.isfile(path) and path.suffix.lower() not in SUFFIXES and is_video(path)
