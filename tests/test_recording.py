"""Recordings, in the real rerun: they verify, they open, and a crash leaves what there was."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from tussock.navigation.encoding import Encoding
from tussock.navigation.models import PerfectMemory
from tussock.navigation.recording.log import Recording, viewer_program
from tussock.navigation.recording.run_folder import play
from tussock.navigation.training import learn, training_poses
from tussock.navigation.walk import Agent
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.errors import InputError
from tussock.world.routes import generate_route
from tussock.world.scene import World

RERUN = viewer_program()
ENTITIES = (
    "/world/mesh", "/world/route", "/world/path", "/world/agent", "/view", "/recognised", "/familiarity", "/deviation/m", "/error/degrees",
)  # fmt: skip


def rerun(*arguments: str | Path) -> str:
    done = subprocess.run(
        [RERUN, *map(str, arguments)], capture_output=True, text=True, timeout=60, env={"RERUN_ANALYTICS": "false"}
    )
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def walk():
    """An agent at its start, and the poses it knows."""
    with open_renderer(World.generate("tiny", 2), Eye(width=180, height=40), "cpu") as renderer:
        route = generate_route(renderer.world, 2).resampled(0.05)
        encoding, model = Encoding.named("edges"), PerfectMemory()
        poses = learn(model, encoding, renderer, training_poses(route, learning_walk=0.2))
        yield Agent(renderer=renderer, encoding=encoding, model=model, route=route), poses


@pytest.fixture(scope="module")
def recorded(walk, tmp_path_factory):
    agent, poses = walk
    path = tmp_path_factory.mktemp("run") / "recording.rrd"
    with Recording(
        path, agent.renderer.world, agent.route, renderer=agent.renderer, training_poses=poses, title="a walk"
    ) as recording:
        for step in agent.walk(agent.start(0.05)):
            recording.log(step)
    return path


def test_a_recording_verifies_and_holds_all_it_should(recorded):
    rerun("rrd", "verify", recorded)
    printed = rerun("rrd", "print", "-v", recorded)
    assert all(entity in printed for entity in ENTITIES)
    assert "/viewport" in printed  # the blueprint


def test_a_recording_opens_in_the_viewer(walk, recorded, tmp_path):
    try:
        play(recorded, screenshot=tmp_path / "viewer.png")
    except InputError as error:
        if "Vulkan" in str(error) and not os.environ.get("TUSSOCK_REQUIRE_GL"):
            pytest.skip(str(error))
        raise
    picture = cv2.imread(str(tmp_path / "viewer.png"))
    height, width = picture.shape[:2]
    views = picture[height // 25 : height // 3, : width // 2]
    sky = np.array(walk[0].renderer.world.sky_rgb)[::-1]
    assert (np.abs(views.astype(int) - sky).max(axis=-1) <= 2).mean() > 0.05  # the panoramas are shown
    assert [path.name for path in tmp_path.iterdir()] == ["viewer.png"]


def test_a_killed_walk_leaves_a_recording_up_to_there(tmp_path):
    script = f"""
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {str(Path(__file__).parent)!r})
from tussock.navigation.walk import Agent
from tussock.navigation.encoding import Encoding
from tussock.navigation.models import PerfectMemory
from tussock.navigation.recording import log as recordings
from render import Eye, open_renderer
from tussock.world import World
from tussock.world.routes import generate_route
renderer = open_renderer(World.generate("tiny", 2), Eye(width=180, height=40), "cpu")
route = generate_route(renderer.world, 2).resampled(0.05)
encoding = Encoding.named("edges")
model = PerfectMemory().fit(encoding(renderer.render(route.poses)))
agent = Agent(renderer=renderer, encoding=encoding, model=model, route=route)
recordings.FLUSH_SECONDS = 0.0
recording = recordings.Recording(Path({str(tmp_path / "cut.rrd")!r}), renderer.world, route, renderer=renderer, training_poses=route.poses)
for step in agent.walk(agent.start()):
    recording.log(step)
    if step.index == 10:
        os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", script]).returncode == -signal.SIGKILL
    # What is there is whole: rerun adds the index that only a finished recording has.
    rerun("rrd", "merge", tmp_path / "cut.rrd", "-o", tmp_path / "whole.rrd")
    rerun("rrd", "verify", tmp_path / "whole.rrd")
    printed = rerun("rrd", "print", "-v", tmp_path / "whole.rrd")
    assert all(entity in printed for entity in ENTITIES)


def wait_until(true, seconds: float = 20) -> None:
    until = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < until
        time.sleep(0.1)


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def test_a_live_walk_reaches_a_running_viewer(walk, tmp_path):
    agent, _ = walk
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    url = f"rerun+http://127.0.0.1:{port}/proxy"
    with pytest.raises(InputError, match="no rerun viewer listens"):
        Recording(tmp_path / "a.rrd", agent.renderer.world, agent.route, live=url)
    received = tmp_path / "received.rrd"
    command = [RERUN, "--bind", "127.0.0.1", "--port", str(port), "--save", str(received)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, env={"RERUN_ANALYTICS": "false"}) as viewer:
        try:
            wait_until(lambda: listens(port))
            with Recording(tmp_path / "b.rrd", agent.renderer.world, agent.route, live=url) as recording:
                for step in agent.walk(agent.start()):
                    recording.log(step)
            size = (tmp_path / "b.rrd").stat().st_size
            wait_until(lambda: received.exists() and received.stat().st_size > 0.5 * size)
        finally:
            viewer.terminate()
    assert "/world/path" in rerun("rrd", "print", "-v", received)


def test_playing_what_is_not_there_is_refused(tmp_path, recorded, monkeypatch):
    with pytest.raises(InputError, match="no recording"):
        play(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(InputError, match="--web"):
        play(recorded)


def test_a_walk_goes_on_when_its_live_viewer_is_closed(walk, tmp_path):
    agent, _ = walk
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [RERUN, "--bind", "127.0.0.1", "--port", str(port), "--save", str(tmp_path / "received.rrd")]

    def walk_on(viewer: subprocess.Popen, url: str) -> None:
        with Recording(tmp_path / "r.rrd", agent.renderer.world, agent.route, live=url) as recording:
            for step in agent.walk(agent.start()):
                recording.log(step)
                if step.index == 5:
                    viewer.kill()
                    viewer.wait()

    with subprocess.Popen(command, stderr=subprocess.DEVNULL, env={"RERUN_ANALYTICS": "false"}) as viewer:
        wait_until(lambda: listens(port))
        with pytest.warns(UserWarning, match="viewer is gone"):
            walk_on(viewer, f"rerun+http://127.0.0.1:{port}/proxy")
    rerun("rrd", "verify", tmp_path / "r.rrd")
