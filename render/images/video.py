"""Frames of a video.

They are counted while they are read from the beginning: the position that a video is asked to seek to is another frame with some
codecs, and the number of frames that a file claims is often wrong.
"""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np

from tussock.world.errors import FileError

from .pictures import Picture, check_content, check_exists, check_size

SUFFIXES = (".avi", ".mp4", ".mov", ".mkv", ".m4v", ".webm", ".mpg", ".mpeg", ".wmv", ".ogv", ".ts", ".mts")
# How videos begin, by the offset of the bytes. A playlist, which names other files, is not among them.
BEGINNINGS = (
    (0, b"RIFF"), (4, b"ftyp"), (4, b"moov"), (4, b"mdat"), (4, b"wide"), (4, b"free"), (4, b"skip"),
    (0, b"\x1a\x45\xdf\xa3"), (0, b"\x00\x00\x01\xba"), (0, b"\x00\x00\x01\xb3"), (0, b"\x47"), (4, b"\x47"),
    (0, b"\x30\x26\xb2\x75"), (0, b"OggS"), (0, b"FLV"),
)  # fmt: skip


def frames(path: Path, numbers: Iterable[int]) -> Iterator[tuple[int, Picture]]:
    """Read some frames of a video, in one pass.

    Args:
        path: The video.
        numbers: Which frames, from 0, in any order; a number that is repeated is read once.

    Yields:
        Number and picture (RGB), in ascending order.

    Raises:
        FileError: The video is missing or damaged, or ends before one of the frames; the message has its number.
    """
    wanted = sorted(set(numbers))
    with _opened(path) as capture:
        position = 0
        for number in wanted:
            while position <= number:
                if not capture.grab():
                    raise FileError(f"{path} has {position} frames that can be read; there is no frame {number}")
                position += 1
            done, frame = capture.retrieve()
            if not done or frame.dtype != np.uint8 or frame.ndim != 3:
                raise FileError(f"{path}: frame {number} cannot be read; repair the video")
            yield number, cv2.cvtColor(frame, cv2.COLOR_BGR2RGB)


def count_frames(path: Path) -> int:
    """The number of frames that can be read. Raises FileError if the video is missing or damaged."""
    with _opened(path) as capture:
        count = 0
        while capture.grab():
            count += 1
    return count


def claimed_frames(path: Path) -> int:
    """The number of frames that the video claims to have; 0 where it does not. Raises FileError if it is missing or damaged."""
    with _opened(path) as capture:
        count = capture.get(cv2.CAP_PROP_FRAME_COUNT)
    return int(count) if 0 < count < 1e9 else 0


def frame_rate(path: Path) -> float | None:
    """Frames a second, as the video says; None where it does not. Raises FileError if it is missing or damaged."""
    with _opened(path) as capture:
        rate = capture.get(cv2.CAP_PROP_FPS)
    return rate if 0 < rate < 1e5 else None


def is_video(path: Path) -> bool:
    """Whether a file begins as a video does. Some of other kinds do, too: pictures in WebP begin as an AVI does."""
    try:
        with path.open("rb") as file:
            begin = file.read(16)
    except OSError:
        return False
    webp = begin[8:12] == b"WEBP"
    return not webp and any(begin[offset:].startswith(mark) for offset, mark in BEGINNINGS)


@contextmanager
def _opened(path: Path) -> Iterator[cv2.VideoCapture]:
    check_exists(path)
    check_content(path)
    damaged = f"{path} cannot be read as a video; give an AVI, MP4, MOV or MKV file"
    if not is_video(path):
        raise FileError(damaged)
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # quiet: FFmpeg prints about each damaged byte otherwise
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # and OpenCV about each damaged file
    try:
        capture = cv2.VideoCapture(os.path.abspath(path), cv2.CAP_FFMPEG)  # absolute: no name is taken for an address
    finally:
        cv2.utils.logging.setLogLevel(level)
    try:
        if not capture.isOpened():
            raise FileError(damaged)
        check_size(path, capture.get(cv2.CAP_PROP_FRAME_WIDTH), capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        yield capture
    finally:
        capture.release()
