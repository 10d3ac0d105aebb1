"""Frames of a video.

They are counted while they are read from the beginning: the position that a video is asked to seek to is another frame with some
codecs, and the number of frames that a file claims is often wrong. So a video is read forward, and again from its beginning for an
earlier frame.
"""

import logging
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from weakref import WeakSet

import cv2
import numpy as np

from tussock.world.errors import FileError

from .entries import ENTRIES
from .pictures import Picture, check_content, check_exists, check_size

log = logging.getLogger(__name__)

SUFFIXES = (".avi", ".mp4", ".mov", ".mkv", ".m4v", ".webm", ".mpg", ".mpeg", ".wmv", ".ogv", ".ts", ".mts")
# How videos begin, by the offset of the bytes. A playlist, which names other files, is not among them.
BEGINNINGS = (
    (0, b"RIFF"), (4, b"ftyp"), (4, b"moov"), (4, b"mdat"), (4, b"wide"), (4, b"free"), (4, b"skip"),
    (0, b"\x1a\x45\xdf\xa3"), (0, b"\x00\x00\x01\xba"), (0, b"\x00\x00\x01\xb3"), (0, b"\x47"), (4, b"\x47"),
    (0, b"\x30\x26\xb2\x75"), (0, b"OggS"), (0, b"FLV"),
)  # fmt: skip


class VideoReader:
    """Reads frames of a video, and keeps it open between them: the next frame, or one farther ahead, is reached from the last one.

    Threads may share a reader; they take turns. A copy, a pickled one and one in a forked process begin anew.
    """

    def __init__(self, path: Path):
        """Prepare to read a video, which is opened at the first frame."""
        self.path = path
        self._lock = Lock()
        # The open video, the number of its next frame, and the stamp of the file.
        self._state: tuple[cv2.VideoCapture, int, tuple[int, ...]] | None = None
        _readers.add(self)

    @property
    def position(self) -> int:
        """The first frame that is reached without beginning again."""
        state = self._state
        return 0 if state is None else max(0, state[1] - 1)

    def read(self, number: int) -> Picture:
        """Read a frame, counted from 0, as RGB. Raises FileError if the video is missing or damaged, or ends before it."""
        with self._lock:
            # While it moves, the capture is only in a local variable: after an interrupt, its position would not be known.
            state, self._state = self._state, None
            if state is None or number < state[1] - 1 or state[2] != _stamp(self.path):
                state = None  # closed before the next one is opened
                stamp = _stamp(self.path)
                state = _open(self.path), 0, stamp
            capture, position, stamp = state
            while position <= number:
                if not capture.grab():
                    raise FileError(f"{self.path} has {position} frames that can be read; there is no frame {number}")
                position += 1
            done, frame = capture.retrieve()
            if not done or frame.dtype != np.uint8 or frame.ndim != 3:
                raise FileError(f"{self.path}: frame {number} cannot be read; repair the video")
            self._state = capture, position, stamp
        return cv2.cvtColor(frame, cv2.COLOR_BGR2RGB)

    def close(self) -> None:
        """Close the video; the next frame opens it again."""
        with self._lock:
            self._state = None

    def __reduce__(self):
        return type(self), (self.path,)


_readers: WeakSet[VideoReader] = WeakSet()
_held: list[VideoReader] = []


def _before_fork() -> None:
    """Close all videos: processes would share the position in a file, and the threads of a decoder do not exist in a forked one."""
    for reader in list(_readers):
        reader._lock.acquire()
        _held.append(reader)
        reader._state = None


def _after_fork() -> None:
    while _held:
        _held.pop()._lock.release()


if hasattr(os, "register_at_fork"):  # not on Windows
    os.register_at_fork(before=_before_fork, after_in_parent=_after_fork, after_in_child=_after_fork)


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
    reader = VideoReader(path)
    try:
        for number in sorted(set(numbers)):
            yield number, reader.read(number)
    finally:
        reader.close()


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


def frames_of_rows(path: Path, numbers: tuple[int, ...]) -> tuple[int, ...]:
    """The frame of each row of a database; some recorders write the counter of a tracker, and their rows are the frames in order."""
    try:
        count = claimed_frames(path)
    except FileError:  # reported when the images are read
        return numbers
    if len(numbers) != count or max(numbers) < count:
        return numbers
    log.warning(
        "%s: Frame counts to %d and the video has %d frames, as many as there are rows: the rows are taken as its frames in order",
        path.parent / ENTRIES,
        max(numbers),
        count,
    )
    return tuple(range(count))


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
    capture = _open(path)
    try:
        yield capture
    finally:
        capture.release()


def _open(path: Path) -> cv2.VideoCapture:
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
    if not capture.isOpened():
        raise FileError(damaged)
    check_size(path, capture.get(cv2.CAP_PROP_FRAME_WIDTH), capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
    return capture


def _stamp(path: Path) -> tuple[int, ...]:
    """What changes when a file is written again; nothing where it is missing."""
    try:
        status = os.stat(path)
    except OSError:
        return ()
    return status.st_ino, status.st_size, status.st_mtime_ns
