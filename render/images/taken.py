"""Which picture was taken where: the rows of a track, and pictures in a folder or frames of a video."""

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from tussock.world.errors import FileError, SettingError

from .sources import Reference, frames_of, name_in, picture_names
from .track import Track
from .video import frame_rate

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Taken:
    """Pictures and where they were taken, one row each.

    Attributes:
        references: The pictures.
        poses: x (m), y (m) and heading (rad).
        z: Heights (m).
    """

    references: list[Reference]
    poses: Float[np.ndarray, "n 3"]
    z: Float[np.ndarray, " n"]


def taken_from_folder(folder: Path, track: Track, every: int | None) -> Taken:
    """A picture for each row: those that it names, or all in the folder, in order."""
    names = picture_names(folder) if track.names is None else []
    if track.names is None and len(names) != len(track):
        raise FileError(
            f"{track.path} has {len(track)} rows without names of pictures, and {folder} holds {len(names)} pictures; "
            "give as many rows as pictures, or a column filename"
        )
    if track.names is None:
        log.warning("%s names no pictures: its rows are taken for %s to %s, in order", track.path, names[0], names[-1])
    for text, line in zip(track.names or (), track.lines, strict=False):
        name = name_in(folder, text)
        if name is None:
            raise FileError(f"{track.path}, line {line}: there is no picture {text!r} in {folder}; correct the name")
        names.append(name)
    rows = np.arange(len(track))[:: every or 1]
    return Taken([names[row] for row in rows], track.poses[rows], track.z[rows])


def taken_from_video(video: Path, track: Track, every: int | None, start: float | None) -> Taken:
    """A frame for each row, or every N-th frame with a pose between the rows."""
    clock = _frame_clock(video, track, start)
    if every is None:
        frames = np.rint(clock).astype(int)
        if (frames < 0).any():
            line = track.lines[int(np.argmax(frames < 0))]
            raise FileError(f"{track.path}, line {line}: it is before the first frame of {video.name}; give --start-s")
        return Taken(frames.tolist(), track.poses, track.z)
    numbers = [each for each in frames_of(video, every) if clock.min() <= each <= clock.max()]
    if not numbers:
        raise FileError(
            f"{track.path} is of frames {clock.min():g} to {clock.max():g}, which {video.name} does not have; correct its times"
        )
    values = track.between(clock, np.array(numbers, dtype=float))
    return Taken(list(numbers), values[:, :3], values[:, 3])


def _frame_clock(video: Path, track: Track, start: float | None) -> Float[np.ndarray, " n"]:
    """The frame of each row, which may be between two."""
    if start is not None and (track.frames is not None or track.times is None):
        raise SettingError(f"a start is a time in a table, and {track.path} has no times that are used; leave it out")
    if track.frames is not None:
        return track.frames
    if track.times is not None:
        rate = frame_rate(video)
        if rate is None:
            raise FileError(f"{video} does not say how many frames it has a second; give a table with a column frame")
        begin = float(track.times[0]) if start is None else start
        log.warning(
            "%s: its first frame is taken to be of time %g s, with %g frames a second; --start-s gives another time",
            video,
            begin,
            rate,
        )
        return (track.times - begin) * rate
    count = len(frames_of(video, 1))
    if count != len(track):
        raise FileError(
            f"{track.path} has {len(track)} rows and {video.name} {count} frames; give a column frame or time, or as many rows as frames"
        )
    return np.arange(count, dtype=float)
