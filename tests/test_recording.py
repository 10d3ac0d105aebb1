"""Recordings, checked by rerun itself: they verify, they open, and a crash leaves what was recorded before it."""

import dataclasses
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from browser import screenshot_of
from commands import TUSSOCK, Process
from rerun.chunk import RrdReader

from tussock.navigation.agent import Agent
from tussock.navigation.displacement import Displacement
from tussock.navigation.encoding import Encoding
from tussock.navigation.failures import Cause, Diagnosis
from tussock.navigation.models import PerfectMemory
from tussock.navigation.recording import log
from tussock.navigation.recording.blueprint import OF_A_SCAN, Shown
from tussock.navigation.recording.columns import image_columns
from tussock.navigation.recording.log import Recording
from tussock.navigation.recording.marks import Marks
from tussock.navigation.recording.playback import play
from tussock.navigation.recording.recorded_walk import read_walk
from tussock.navigation.recording.signals import HISTORY
from tussock.navigation.recording.viewer import viewer_program
from tussock.navigation.steering.navigator import Motion
from tussock.navigation.stopping import StoppingRules
from tussock.navigation.training import train, training_poses
from tussock.navigation.walk import Walk
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.errors import DiskFullError, FileError, InputError, MissingDependencyError
from tussock.world.geometry import Pose
from tussock.world.routes import generate_route
from tussock.world.scene import World

RERUN = viewer_program()
PER_STEP = {  # columns with a row for each step, but for the path, which has none for the first
    "/world/agent@Arrows3D:origins",
    "/world/path@LineStrips3D:strips",
    "/world/recognised@Arrows3D:origins",
    "/view@Image:buffer",
    "/recognised@Image:buffer",
    "/familiarity@BarChart:values",
    "/familiarity/chosen@BarChart:values",
    "/error/guides@Scalars:scalars",
    "/deviation/m@Scalars:scalars",
    "/error/degrees@Scalars:scalars",
}
ONCE = {
    "/world/mesh@Mesh3D:vertex_positions",
    "/world/route@LineStrips3D:strips",
    "/world/goal@Points3D:positions",
    "/world/learned_views@Points3D:positions",
    "/view@Image:format",
    "/recognised@Image:format",
    "/familiarity@BarChart:abscissa",
}


def rerun(*arguments: str | Path) -> str:
    done = subprocess.run(
        [RERUN, *map(str, arguments)], capture_output=True, text=True, timeout=60, env={"RERUN_ANALYTICS": "false"}
    )
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


def rows_of(recording: Path) -> Counter[str]:
    """The number of rows of each column of a recording."""
    rows: Counter[str] = Counter()
    for count, columns in re.findall(
        r"with (\d+) rows .*data columns: \[(.*)\]", rerun("rrd", "print", "-v", recording)
    ):
        for column in columns.split():
            rows[column] += int(count)
    return rows


@pytest.fixture(scope="module")
def agent():
    """An agent that has learned a route."""
    with open_renderer(World.generate("tiny", 2), Eye(width=120, height=25), "cpu") as renderer:
        route = generate_route(renderer.world, 2)
        trained = train(
            PerfectMemory(), Encoding.named("edges"), renderer, training_poses(route, 0.05, learning_walk=0.2)
        )
        yield Agent(renderer=renderer, trained=trained, route=route)


def record(path: Path, agent: Agent, **settings) -> int:
    """Record a walk along the route of an agent; returns the number of looks."""
    with Recording(path, agent.renderer, agent.route, **settings) as recording:
        for looks, step in enumerate(agent.walk(agent.start(0.05)), start=1):  # noqa: B007
            recording.log(step)
    return looks


@pytest.fixture(scope="module")
def recorded(agent, tmp_path_factory):
    """A recording of a walk, written step by step, and its number of looks."""
    path = tmp_path_factory.mktemp("run") / "recording.rrd"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(log, "FLUSH_SECONDS", 0.0)
        return path, record(path, agent, training_poses=agent.trained.poses, about="a walk")


@pytest.fixture
def port() -> int:
    """A free port of this machine."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@contextmanager
def viewer_at(port: int, received: Path) -> Iterator[subprocess.Popen]:
    """A viewer that listens at a port and saves what it receives."""
    command = [RERUN, "--bind", "127.0.0.1", "--port", str(port), "--save", str(received)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, env={"RERUN_ANALYTICS": "false"}) as viewer:
        try:
            wait_until(lambda: listens(port))
            yield viewer
        finally:
            viewer.terminate()


def address(port: int) -> str:
    return f"rerun+http://127.0.0.1:{port}/proxy"


def test_a_recording_verifies_and_holds_every_step(recorded):
    path, looks = recorded
    rerun("rrd", "verify", path)
    rows = rows_of(path)
    assert {column: rows[column] for column in ONCE} == dict.fromkeys(ONCE, 1)
    per_step = dict.fromkeys(PER_STEP, looks) | {"/world/path@LineStrips3D:strips": looks - 1}
    assert {column: rows[column] for column in PER_STEP} == per_step
    assert "/viewport" in rerun("rrd", "print", "-v", path)  # the blueprint


def values_in(recording: Path, column: str) -> dict[int, Any]:
    """The values of a column of an entity, by step."""
    values = {}
    for chunk in RrdReader(recording).stream():
        table = chunk.to_record_batch()
        entity, _, name = column.partition("@")
        if chunk.entity_path == entity and {"step", name} <= {*table.schema.names}:
            rows = zip(table.column("step").to_pylist(), table.column(name).to_pylist(), strict=True)
            values |= {step: value[0] for step, value in rows if value is not None}
    return values


@pytest.mark.parametrize("seconds", [0.0, 0.05, 99.0])
def test_what_is_recorded_is_what_the_agent_sees_and_recognises(agent, tmp_path, monkeypatch, seconds):
    monkeypatch.setattr(log, "FLUSH_SECONDS", seconds)
    monkeypatch.setattr(log, "BATCH", 7)
    steps = list(agent.walk(agent.start(0.05)))
    with Recording(tmp_path / "r.rrd", agent.renderer, agent.route, training_poses=agent.trained.poses) as recording:
        for step in steps:
            recording.log(step)
    images = {name: values_in(tmp_path / "r.rrd", f"/{name}@Image:buffer") for name in ("view", "recognised")}
    charts, not_compared, chosen = (
        values_in(tmp_path / "r.rrd", f"/familiarity{which}@BarChart:values")
        for which in ("", "/not_compared", "/chosen")
    )
    degrees_right = read_walk(tmp_path / "r.rrd").degrees
    assert [*charts] == [*images["view"]] == [*images["recognised"]] == [step.index for step in steps]
    for step in steps:
        assert step.view is not None
        assert step.familiarity is not None
        (learned,) = agent.renderer.render(agent.trained.poses[[step.match]])
        assert np.array_equal(images["view"][step.index], step.view[..., :3].ravel())
        assert np.array_equal(images["recognised"][step.index], learned[..., :3].ravel())
        more = step.familiarity - step.familiarity.min()
        ahead = len(more) // 2
        chart = np.array(charts[step.index]["buffer"], dtype=np.float32)
        assert charts[step.index]["shape"] == [len(more)]
        assert np.isclose(chart[ahead - 1 : ahead + 1], more[0]).any()  # ahead is the middle
        assert np.array_equal(np.sort(chart), np.sort(np.where(step.scanned, more, 0)))
        others = np.array(not_compared[step.index]["buffer"], dtype=np.float32)
        assert np.array_equal(np.sort(others), np.sort(np.where(step.scanned, 0, more)))
        (at,) = np.flatnonzero(chosen[step.index]["buffer"])
        assert chosen[step.index]["buffer"][at] == chart[at] == chart.max()
        assert abs(np.radians(degrees_right[at]) + step.aim) <= np.pi / len(more)


def test_views_without_alpha_are_recorded_as_the_eye_sees_them(tmp_path):
    eye = Eye(width=60, height=12, field=np.pi)
    views = np.random.default_rng(0).integers(0, 256, (3, 12, 60, 4), dtype=np.uint8)
    expected = eye.hide(views)[..., :3].reshape(3, -1).tolist()
    for given in (views, views[..., :3]):
        (column,) = image_columns(eye, list(given))
        assert [row[0] for row in column.as_arrow_array().to_pylist()] == expected


def test_what_goes_wrong_while_writing_ends_the_walk(agent, tmp_path, monkeypatch):
    def fail(self, steps):
        raise DiskFullError("make room")

    monkeypatch.setattr(log, "FLUSH_SECONDS", 0.0)
    steps = list(islice(agent.walk(agent.start()), 2))
    recording = Recording(tmp_path / "r.rrd", agent.renderer, agent.route)
    recording.log(steps[0])
    monkeypatch.setattr(Recording, "_send_steps", fail)
    with pytest.raises(DiskFullError, match="make room"):
        recording.log(steps[1])
    with pytest.raises(DiskFullError, match="make room"):
        recording.close()
    rerun("rrd", "verify", tmp_path / "r.rrd")
    assert rows_of(tmp_path / "r.rrd")["/world/agent@Arrows3D:origins"] == 1


def test_steps_without_a_view_and_a_scan_are_recorded(agent, tmp_path):
    with Recording(tmp_path / "r.rrd", agent.renderer, agent.route, training_poses=agent.trained.poses) as recording:
        for step in islice(agent.walk(agent.start()), 3):
            recording.log(dataclasses.replace(step, view=None, familiarity=None, scanned=None, match=None))
    rerun("rrd", "verify", tmp_path / "r.rrd")
    rows = rows_of(tmp_path / "r.rrd")
    assert rows["/world/agent@Arrows3D:origins"] == 3
    assert not any(column.startswith(("/familiarity", "/recognised")) for column in rows)


@pytest.mark.slow
def test_a_recording_opens_in_the_viewer(agent, recorded, tmp_path):
    try:
        play(recorded[0], screenshot=tmp_path / "viewer.png")
    except InputError as error:
        if "Vulkan" in str(error) and not os.environ.get("TUSSOCK_REQUIRE_GL"):
            pytest.skip(str(error))
        raise
    picture = cv2.imread(str(tmp_path / "viewer.png"))
    height, width = picture.shape[:2]
    views = picture[height // 25 : height // 3, : width // 2]
    sky = np.array(agent.renderer.world.sky_rgb)[::-1]
    assert (np.abs(views.astype(int) - sky).max(axis=-1) <= 2).mean() > 0.05  # the panoramas are shown
    assert [path.name for path in tmp_path.iterdir()] == ["viewer.png"]
    early = [tmp_path / f"{k}.png" for k in (3, 3, 20)]
    for path, step in zip(early, (3, 3, 20), strict=True):
        play(recorded[0], screenshot=path, step=step)
    panels = [cv2.imread(str(path))[height // 25 : height // 3, : width // 2] for path in early]
    assert np.array_equal(panels[0], panels[1])
    assert (panels[0] != panels[2]).mean() > 0.01  # what the agent sees at another step
    assert (panels[0] != views).mean() > 0.01


@pytest.mark.slow
def test_a_recording_opens_in_a_browser_and_its_one_address_is_printed(agent, recorded, tmp_path):
    serving = Process([TUSSOCK, "play", recorded[0], "--web"], stderr=subprocess.PIPE, text=True)
    with serving:
        assert serving.stderr is not None
        assert "until Ctrl-C" in serving.stderr.readline()
        address = serving.stderr.readline().strip()
        sky = np.array(agent.renderer.world.sky_rgb)[::-1]
        for seconds in (30, 100, 300, 1000):  # its own clock goes on while the machine is busy
            picture = screenshot_of(address, tmp_path, seconds)
            drawn = (np.abs(picture.astype(int) - sky).max(axis=-1) <= 2).mean() > 0.02  # the panoramas
            if drawn:
                break
        assert drawn
        serving.send_signal(signal.SIGINT)
        assert serving.wait(timeout=30) == 0
        assert serving.stderr.read() == ""


def test_a_step_that_there_is_not_is_refused(recorded, tmp_path):
    with pytest.raises(InputError, match=r"--step 1000: .+ has the steps 0 to "):
        play(recorded[0], screenshot=tmp_path / "viewer.png", step=1000)
    with pytest.raises(InputError, match="give --screenshot"):
        play(recorded[0], step=3)
    assert not list(tmp_path.iterdir())


def test_a_cluster_of_marks_has_one_label(agent):
    """Whatever their causes: two labels in one place cannot be read."""
    (step,) = islice(agent.walk(agent.start()), 1)
    sent = []
    marks = Marks(lambda entity, steps, columns: sent.extend(columns))
    aliasing = Diagnosis(covered=0.0, nearest=0.0, recognised=2.0, error=1.0, turning=0.0)
    occlusion, corner = (
        dataclasses.replace(aliasing, covered=1.0),
        dataclasses.replace(aliasing, recognised=0.0, turning=2.0),
    )
    places = [0.0, 0.05, 0.1, 2.0]
    steps = [
        (dataclasses.replace(step, index=k, pose=Pose(x, 0.0, 0.0)), diagnosis)
        for k, (x, diagnosis) in enumerate(zip(places, (aliasing, occlusion, aliasing, corner), strict=True))
    ]
    marks.write(steps)
    labels = [
        label
        for column in sent
        if column.component_descriptor().component == "Points3D:labels"
        for label in column.as_arrow_array().flatten().to_pylist()
    ]
    assert sorted(filter(None, labels)) == sorted([Cause.ALIASING.value, Cause.CORNER.value])


KILLED = """
import os, signal, sys
from pathlib import Path
from tussock import Agent, Encoding, Eye, PerfectMemory, World, generate_route, open_renderer, train
from tussock.navigation.recording import log

log.FLUSH_SECONDS = 0.0
with open_renderer(World.generate("tiny", 2), Eye(width=120, height=25), "cpu") as renderer:
    route = generate_route(renderer.world, 2)
    trained = train(PerfectMemory(), Encoding.named("edges"), renderer, route.resampled(0.05).poses)
    agent = Agent(renderer=renderer, trained=trained, route=route)
    recording = log.Recording(Path(sys.argv[1]), renderer, route, training_poses=trained.poses)
    for step in agent.walk(agent.start()):
        recording.log(step)
        if step.index == 10:
            os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.slow
def test_a_killed_walk_leaves_a_recording_up_to_there(tmp_path):
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "cut.rrd")])
    assert done.returncode == -signal.SIGKILL
    # It is complete but for the index that only a finished recording has; rerun adds that.
    rerun("rrd", "merge", tmp_path / "cut.rrd", "-o", tmp_path / "whole.rrd")
    rerun("rrd", "verify", tmp_path / "whole.rrd")
    rows = rows_of(tmp_path / "whole.rrd")
    assert min(rows[column] for column in PER_STEP) == 10  # the path; 11 looks were recorded


def wait_until(true, seconds: float = 20) -> None:
    until = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < until
        time.sleep(0.1)


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def test_a_live_walk_reaches_a_running_viewer(agent, tmp_path, port):
    received = tmp_path / "received.rrd"
    with viewer_at(port, received):
        record(tmp_path / "b.rrd", agent, live=address(port))
        size = (tmp_path / "b.rrd").stat().st_size
        wait_until(lambda: received.exists() and received.stat().st_size > 0.5 * size)
    assert rows_of(received)["/world/path@LineStrips3D:strips"] > 0


def test_a_live_walk_without_a_viewer_is_refused(agent, tmp_path, port):
    with pytest.raises(MissingDependencyError, match=f"127.0.0.1:{port}.*start one"):
        Recording(tmp_path / "a.rrd", agent.renderer, agent.route, live=address(port))


def test_a_recording_that_cannot_be_played_is_refused(tmp_path, recorded, monkeypatch):
    with pytest.raises(FileError, match=f"{tmp_path}.*folder of a run"):
        play(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(MissingDependencyError, match="--web"):
        play(recorded[0])


def test_a_walk_goes_on_when_its_live_viewer_is_closed(agent, tmp_path, port):
    def walk_on(viewer: subprocess.Popen) -> None:
        with Recording(tmp_path / "r.rrd", agent.renderer, agent.route, live=address(port)) as recording:
            for step in agent.walk(agent.start()):
                recording.log(step)
                if step.index == 5:
                    viewer.kill()
                    viewer.wait()

    with viewer_at(port, tmp_path / "received.rrd") as viewer, pytest.warns(UserWarning, match="viewer is gone"):
        walk_on(viewer)
    rerun("rrd", "verify", tmp_path / "r.rrd")


class Reporting:
    """A navigator that reports all kinds of signals."""

    def learn(self, views):
        pass

    def begin(self):
        return [0]

    def decide(self, look, memories):
        counts = np.array([memory[0] for memory in memories], dtype=float)
        for memory in memories:
            memory[0] += 1
        signals = {
            "left": counts / 10,
            "home_x_m": 2 - counts,
            "home_y_m": counts,
            "food_vector": np.stack([counts, -counts], axis=1),
            "tb1": counts[:, None] + np.arange(8),
        }
        return Motion(turn=np.zeros(len(look)), signals=signals)


def test_what_a_navigator_steers_by_is_recorded(agent, tmp_path):
    assert agent.trained.encoding is not None
    walk = Walk(
        renderer=agent.renderer,
        encoding=agent.trained.encoding,
        route=agent.route,
        starts=[agent.start()],
        stopping=StoppingRules(max_steps=5),
        displacement=Displacement(at=0.02, left=0.2),
    )
    steps = [step for (step,) in walk.steps(Reporting()) if step is not None]
    touched = [dataclasses.replace(step, touched=step.index in (1, 2, 4)) for step in steps]
    path = tmp_path / "r.rrd"
    with Recording(path, agent.renderer, agent.route) as recording:
        for step in touched:
            recording.log(step)
    rerun("rrd", "verify", path)
    (carried,) = [step.index for step in steps if step.displaced]
    ahead = {step.index: step.goal_distance for step in steps}
    assert values_in(path, "/goal/m@Scalars:scalars") == ahead
    assert values_in(path, "/looks/headings@Scalars:scalars") == dict.fromkeys(ahead, 1)
    assert values_in(path, "/signals/left@Scalars:scalars") == {k: k / 10 for k in ahead}
    assert values_in(path, "/world/home@Arrows3D:vectors") == {k: [2 - k, k, 0] for k in ahead}
    assert values_in(path, "/world/food_vector@Arrows3D:vectors") == {k: [k, -k, 0] for k in ahead}
    places = values_in(path, "/world/agent@Arrows3D:origins")
    assert values_in(path, "/world/home@Arrows3D:origins") == places
    assert [*values_in(path, "/world/touched@Points3D:positions")] == [1, 2, 4]
    assert [*values_in(path, "/world/carried@Points3D:positions")] == [carried]
    assert carried not in values_in(path, "/world/path@LineStrips3D:strips")
    maps = values_in(path, "/activity/tb1@Tensor:data")
    for k in ahead:
        assert (maps[k]["shape"], maps[k]["names"]) == ([8, HISTORY], ["value", "step"])
        activity = np.array(maps[k]["buffer"], dtype=np.float32).reshape(8, HISTORY)
        assert np.array_equal(activity[:, -1], k + np.arange(8))  # now is on the right
        assert np.array_equal(activity[:, -k - 1], np.arange(8))
        assert np.array_equal(activity[:, 0], np.arange(8))
    events = values_in(path, "/events@TextLog:text")
    assert [k for k, text in events.items() if "obstacle" in text] == [1, 4]  # where it begins
    printed = rerun("rrd", "print", "-vvv", path)
    assert "carried to the side" in printed


def panels_of(recording: Path) -> set[str]:
    """The names of the panels that a recording asks for, of all its layouts."""
    printed = rerun("rrd", "print", "-vvv", recording)
    return {name for name in PANELS if name in printed}


PANELS = {
    "The learned view it recognises",
    "Familiarity above the least, by degrees to the right (red: chosen, grey: not compared)",
    "What it steers by",
    "Distance from the goal (m)",
}


def test_there_are_panels_for_what_there_is_only(agent, recorded, tmp_path):
    assert panels_of(recorded[0]) == {
        "The learned view it recognises",
        "Familiarity above the least, by degrees to the right (red: chosen, grey: not compared)",
    }
    (step, *_) = agent.walk(agent.start())
    nothing = Shown()
    assert nothing.with_step(step, learned=True) == OF_A_SCAN
    assert nothing.with_step(step, learned=False) == Shown(scan=True)
    signals = {"left": 0.5, "tb1": np.zeros(8), "home_vector": np.zeros(2), "food_x_m": 1.0, "food_y_m": 2.0}
    steered = dataclasses.replace(step, match=None, familiarity=None, scanned=None, signals=signals)
    shown = nothing.with_step(steered, learned=True)
    assert shown == Shown(lines=("left", "food_x_m", "food_y_m"), maps=("tb1",), ways=("home_vector", "food"))
    assert shown.with_step(steered, learned=True) == shown
    with Recording(tmp_path / "r.rrd", agent.renderer, agent.route) as recording:
        recording.log(steered)
    assert {"What it steers by", "Distance from the goal (m)"} <= panels_of(tmp_path / "r.rrd")
