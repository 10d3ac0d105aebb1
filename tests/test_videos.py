"""Frames of a video: in any order, from any thread or process, they are those that are read from its beginning."""

import os
import pickle
import random
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest

from tussock.render.images import video
from tussock.render.images.source import open_views
from tussock.render.images.video import VideoReader
from tussock.world.errors import FileError

WIDTH, HEIGHT = 64, 32


def moving_video(path: Path, codec: str, total: int = 50) -> list[np.ndarray]:
    """A video in which each frame differs from all others, and its frames (RGB), read from the beginning."""
    scene = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (64, 400, 3)).astype(np.uint8), (0, 0), 2)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), 25, (WIDTH, HEIGHT))
    for i in range(total):
        writer.write(np.ascontiguousarray(scene[i // 3 : i // 3 + HEIGHT, 3 * i : 3 * i + WIDTH]))
    writer.release()
    capture, read = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG), []
    while (frame := capture.read())[0]:
        read.append(frame[1][..., ::-1])
    assert len(read) > 0.9 * total
    return read


@pytest.fixture
def opened(monkeypatch) -> list[Path]:
    """The videos that were opened, once for each time."""
    opened = []
    monkeypatch.setattr(video, "_open", lambda path, original=video._open: opened.append(path) or original(path))
    return opened


# In MPEG program and transport streams, the position that OpenCV is asked to seek to is often another frame.
@pytest.mark.parametrize(
    ("codec", "suffix"), [("MJPG", "avi"), ("mp4v", "mp4"), ("VP80", "webm"), ("MPG2", "mpg"), ("mp2v", "ts")]
)
def test_frames_in_any_order_are_those_read_from_the_beginning(tmp_path, codec, suffix):
    expected = moving_video(tmp_path / f"v.{suffix}", codec)
    order = random.Random(1).sample(range(len(expected)), len(expected))
    order += [3, 3, 4, 6, 5, 40, 41, 41, 0, 0, len(expected) - 1, 0]
    reader = VideoReader(tmp_path / f"v.{suffix}")
    for number in order:
        assert np.array_equal(reader.read(number), expected[number]), number
    with pytest.raises(FileError, match=f"there is no frame {len(expected)}"):
        reader.read(len(expected))
    assert np.array_equal(reader.read(len(expected) - 1), expected[-1])


def test_a_frame_ahead_is_reached_from_the_last_one(tmp_path, opened):
    expected = moving_video(tmp_path / "v.avi", "MJPG", 20)
    reader = VideoReader(tmp_path / "v.avi")
    for number in (0, 0, 1, 2, 9, 9, 19):
        assert np.array_equal(reader.read(number), expected[number])
    assert len(opened) == 1
    assert np.array_equal(reader.read(17), expected[17])
    reader.close()
    assert np.array_equal(reader.read(18), expected[18])
    assert len(opened) == 3


def test_an_interrupt_does_not_shift_frames(tmp_path):
    expected = moving_video(tmp_path / "v.avi", "MJPG", 20)
    reader = VideoReader(tmp_path / "v.avi")
    reader.read(2)

    class Interrupted:
        def __init__(self, capture: cv2.VideoCapture):
            self.grab = capture.grab

        def retrieve(self):
            raise KeyboardInterrupt

    assert reader._state is not None
    reader._state = (Interrupted(reader._state[0]), *reader._state[1:])
    with pytest.raises(KeyboardInterrupt):
        reader.read(8)
    assert np.array_equal(reader.read(9), expected[9])


def test_another_file_of_the_same_name_is_read(tmp_path):
    moving_video(tmp_path / "v.avi", "MJPG", 20)
    reader = VideoReader(tmp_path / "v.avi")
    reader.read(2)
    other = moving_video(tmp_path / "w.avi", "MJPG", 25)
    os.replace(tmp_path / "w.avi", tmp_path / "v.avi")
    assert np.array_equal(reader.read(24), other[24])
    (tmp_path / "v.avi").unlink()
    with pytest.raises(FileError, match="there is no"):
        reader.read(24)


def test_threads_copies_and_forked_processes_read_the_same_frames(tmp_path):
    expected = moving_video(tmp_path / "v.mp4", "mp4v")
    reader = VideoReader(tmp_path / "v.mp4")

    def agrees(order: list[int], reader: VideoReader = reader) -> bool:
        return all(np.array_equal(reader.read(number), expected[number]) for number in order)

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(agrees, [random.Random(seed).sample(range(len(expected)), 12) for seed in range(4)]))
    assert agrees([10])
    assert agrees([7, 11], pickle.loads(pickle.dumps(reader)))
    if not hasattr(os, "fork"):
        return
    child = os.fork()
    if child == 0:
        os._exit(0 if agrees([11, 12, 3]) else 1)
    assert agrees([11, 12, 13, 3])
    ended, deadline = (0, -1), time.monotonic() + 30
    while ended[0] == 0 and time.monotonic() < deadline:
        time.sleep(0.01)
        ended = os.waitpid(child, os.WNOHANG)
    if ended[0] == 0:  # it waits for a thread that only its parent has
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    assert ended == (child, 0)


# Views of a database.


def video_route(folder: Path, total: int) -> list[np.ndarray]:
    """A database of a straight route, 0.1 m between the frames of its video; and the frames."""
    folder.mkdir()
    rows = "".join(f"{100 * i}, 0, 10, 90, {i}\n" for i in range(total))
    (folder / "database_entries.csv").write_text("X [mm], Y [mm], Z [mm], Heading [degrees], Frame\n" + rows)
    (folder / "database_metadata.yaml").write_text(
        '%YAML:1.0\n---\nmetadata:\n   type: route\n   needsUnwrapping: 0\n   videoFile: "v.avi"\n'
    )
    return moving_video(folder / "v.avi", "MJPG", total)


def test_a_walk_over_the_frames_of_a_video_goes_through_it_once(tmp_path, opened, monkeypatch):
    expected = video_route(tmp_path / "d", 40)
    read = []
    original = VideoReader.read
    monkeypatch.setattr(VideoReader, "read", lambda reader, number: read.append(number) or original(reader, number))
    with open_views(tmp_path / "d") as views:
        opened.clear()
        read.clear()
        for frame in (0, 1, 2, 3, 2, 8, 6, 20, 15, 12, 39, 30, 21, 3):
            assert np.array_equal(views.render([(0.1 * frame, 0.02, 0.0)])[0], expected[frame]), frame
        assert opened == []  # it is open since the size of its images was asked for
        assert sorted(read) == list(range(40))
    with open_views(tmp_path / "d") as views:
        for frame in (39, 36, 30, 20, 0):  # backwards
            assert np.array_equal(views.render([(0.1 * frame, 0.02, 0.0)])[0], expected[frame]), frame
    assert len(opened) == 1


def test_frames_that_are_passed_are_kept_within_the_memory(tmp_path, monkeypatch):
    expected = video_route(tmp_path / "d", 40)
    monkeypatch.setattr("tussock.render.images.source.CACHE_BYTES", 8 * WIDTH * HEIGHT * 3)
    with open_views(tmp_path / "d") as views:
        for frame in (39, 36, 30, 20, 0, 25, 24):
            assert np.array_equal(views.render([(0.1 * frame, 0.02, 0.0)])[0], expected[frame]), frame
            assert len(views._kept or ()) <= 8
