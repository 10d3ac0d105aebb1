"""Robots: the example that steers by the frames of a camera, and the messages of the ROS 2 node, without ROS and without a robot."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from tussock import Eye, Motion, World, generate_route, open_renderer

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(scope="module")
def node():
    """The module of the ROS 2 node; rclpy is imported by its `main` only."""
    spec = importlib.util.spec_from_file_location("route_follower", EXAMPLES / "ros2" / "route_follower.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def image_message(pixels: np.ndarray, encoding: str, padding: int = 0) -> SimpleNamespace:
    """A sensor_msgs/Image of pixels (height, width, channels), each row followed by unused bytes."""
    height, width = pixels.shape[:2]
    rows = np.hstack([pixels.reshape(height, -1), np.full((height, padding), 77, np.uint8)])
    fields = {"height": height, "width": width, "encoding": encoding, "is_bigendian": 0, "step": rows.shape[1]}
    return SimpleNamespace(**fields, data=rows.tobytes())


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "rgba8", "bgra8", "mono8"])
def test_a_ros_image_becomes_the_picture_it_holds(node, encoding, padding):
    rgb = np.random.default_rng(0).integers(0, 256, (4, 6, 3), dtype=np.uint8)
    alpha = np.full((4, 6, 1), 9, np.uint8)
    sent = {
        "rgb8": rgb,
        "bgr8": rgb[..., ::-1],
        "rgba8": np.dstack([rgb, alpha]),
        "bgra8": np.dstack([rgb[..., ::-1], alpha]),
        "mono8": rgb[..., :1],
    }
    expected = np.repeat(rgb[..., :1], 3, axis=2) if encoding == "mono8" else rgb
    assert np.array_equal(node.frame_of(image_message(sent[encoding], encoding, padding)), expected)


def test_an_unknown_encoding_of_a_ros_image_is_named(node):
    with pytest.raises(ValueError, match="yuv422"):
        node.frame_of(image_message(np.zeros((2, 2, 2), np.uint8), "yuv422"))


def test_a_motion_becomes_velocities(node):
    def velocity(turn, step=None):
        motion = Motion(turn=np.array([turn]), step=None if step is None else np.array([step]))
        return node.velocity_of(motion, speed=0.1, period=0.5, max_turn_rate=1.0)

    assert velocity(0.25) == (0.1, 0.5)  # left is positive in both
    assert velocity(-0.25, step=0.5) == (0.05, -0.5)
    assert velocity(3.0) == (0.0, 1.0)  # too much for one period: it turns on the spot
    assert velocity(-3.0) == (0.0, -1.0)


CENTRE, INNER, OUTER, SIDE = 127.5, 40, 120, 256  # of the ring, as in the example (pixels)


def ring_picture(view: np.ndarray) -> np.ndarray:
    """What a panoramic lens draws of a panorama (height, width, 3): ahead is up, clockwise is to the right, the sky is inside."""
    y, x = np.mgrid[:SIDE, :SIDE] - CENTRE
    share = (np.hypot(x, y) - INNER) / (OUTER - INNER)
    clockwise = np.arctan2(x, -y)  # from ahead
    height, width = view.shape[:2]
    column = np.floor((clockwise / (2 * np.pi) + 0.5) % 1 * width).astype(int)
    row = np.clip(np.floor(share * height).astype(int), 0, height - 1)
    return np.where(((share >= 0) & (share < 1))[..., None], view[row, column], 0).astype(np.uint8)


def write_video(path: Path, views: np.ndarray) -> None:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10, (SIDE, SIDE))
    for view in views:
        writer.write(cv2.cvtColor(ring_picture(view[..., :3]), cv2.COLOR_RGB2BGR))
    writer.release()


def test_the_camera_example_steers_back_to_the_heading_of_the_route(tmp_path):
    world = World.generate("tiny")
    poses = generate_route(world, seed=0, length=3.0).resampled(0.1).poses
    wrong = np.radians(np.random.default_rng(0).uniform(-60, 60, len(poses)))
    with open_renderer(world, Eye(width=360, height=75)) as renderer:
        write_video(tmp_path / "learn.avi", renderer.render(poses))
        write_video(tmp_path / "steer.avi", renderer.render(poses + np.outer(wrong, [0, 0, 1])))
    done = subprocess.run(
        [sys.executable, EXAMPLES / "04_camera.py", "learn.avi", "steer.avi"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    turns = np.array([float(turn) for turn in re.findall(r"turn +([+-]?[\d.]+)", done.stdout)])
    assert len(turns) == len(poses)
    assert np.median(np.abs(turns + np.degrees(wrong))) < 2  # columns are 2 degrees wide
