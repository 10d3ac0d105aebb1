"""Processes that are killed while they write, and a full disk: what was done before stays, and the same command goes on.

Those of sweeps are in test_sweeps.py.
"""

import json
import shlex
import signal
import subprocess
import threading
import time
from pathlib import Path

import pytest
from commands import TUSSOCK, Process, process, process_json

from tussock.navigation.recording import disk
from tussock.navigation.recording.log import Recording
from tussock.navigation.recording.viewer import viewer_program
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.errors import DiskFullError
from tussock.world.routes import generate_route
from tussock.world.scene import World

WORLD = ["--world", "tiny", "--seed", "2", "--size", "120x25", "--samples", "1"]


def enlarge(disk: Path) -> None:
    """Make room on it."""
    subprocess.run(["mount", "-o", "remount,size=20m", disk], check=True)


@pytest.mark.slow
def test_a_killed_run_explains_how_to_go_on_and_its_recording_opens(tmp_path):
    out = tmp_path / "run"
    walk = [TUSSOCK, "run", *WORLD, "--step-m", "0.002", "--out", out]  # over a thousand steps
    with Process(walk, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as running:
        recording = out / "recording.rrd"
        while not (recording.exists() and recording.stat().st_size > 400_000):
            assert running.poll() is None
            time.sleep(0.02)
        running.send_signal(signal.SIGKILL)
    stats = subprocess.run([viewer_program(), "rrd", "stats", recording], capture_output=True, text=True)
    assert stats.returncode == 0, stats.stderr
    assert "/deviation/m" in stats.stdout
    assert not (out / "summary.json").exists()
    again = process("run", *WORLD, "--out", out)
    assert again.returncode == 2
    last = again.stderr.splitlines()[-1]
    assert all(
        word in last for word in (f"{out} already holds a run", "not finished", str(out / "UNFINISHED.txt"), "--out")
    )
    (command,) = [line.strip() for line in (out / "UNFINISHED.txt").read_text().splitlines() if line.startswith("    ")]
    resumed = process_json(*shlex.split(command)[1:])
    assert json.loads((out / "summary.json").read_text())["steps"] == resumed["steps"]
    assert not (out / "UNFINISHED.txt").exists()


@pytest.mark.slow
def test_a_run_on_a_full_disk_is_reported_and_leaves_no_summary(small_disk):
    run = ["run", *WORLD, "--out", small_disk / "run"]
    done = process(*run)
    assert done.returncode == 2
    assert "make room" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
    assert not (small_disk / "run" / "summary.json").exists()
    enlarge(small_disk)
    assert process(*run, "--overwrite").returncode == 0
    assert (small_disk / "run" / "summary.json").exists()


@pytest.mark.slow
def test_a_database_on_a_full_disk_keeps_its_images_and_is_completed(small_disk, tmp_path):
    grid = ["database", "grid", *WORLD[:4], "--size", "360x75", "--spacing-m", "0.3", "--json"]
    done = process(*grid, "--out", small_disk / "grid")
    assert done.returncode == 2
    assert "make room" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
    before = {path: path.read_bytes() for path in (small_disk / "grid").glob("*.png")}
    assert before
    enlarge(small_disk)
    assert process(*grid, "--out", small_disk / "grid").returncode == 0
    assert all(path.read_bytes() == image for path, image in before.items())
    assert process(*grid, "--out", tmp_path / "grid").returncode == 0
    names = {path.name for path in (tmp_path / "grid").iterdir()}
    assert {path.name for path in (small_disk / "grid").iterdir()} == names
    assert all(
        (small_disk / "grid" / name).read_bytes() == (tmp_path / "grid" / name).read_bytes()
        for name in names
        if name.endswith("png")
    )


class Silent:
    """A stream of rerun whose writer has ended without an answer."""

    def flush(self, *, timeout_sec: float = float("inf")) -> None:
        assert timeout_sec < 1000, "it would wait for ever"
        raise RuntimeError("timed out")

    def disconnect(self) -> None:
        pass


def test_a_recording_does_not_wait_for_ever_for_its_disk(tmp_path):
    world = World.generate("tiny", 2)
    with open_renderer(world, Eye(width=60, height=12), "cpu") as renderer:
        recording = Recording(tmp_path / "r.rrd", renderer, generate_route(world, 2))
        (stream,), recording._streams = recording._streams, [Silent()]
        stream.disconnect()
        with pytest.raises(DiskFullError, match=r"r\.rrd .+ make room"):
            recording.close()


def test_a_writer_that_gives_no_answer_holds_up_neither_the_recording_nor_the_end_of_the_process(monkeypatch, caplog):
    released = threading.Event()
    unregistered = []
    stream = Silent()
    monkeypatch.setattr(stream, "disconnect", released.wait, raising=False)
    monkeypatch.setattr(disk, "CLOSE_SECONDS", 0.05)
    monkeypatch.setattr(disk.rr, "unregister_shutdown", lambda: unregistered.append(True))
    disk.close(stream)
    released.set()
    assert "did not close" in caplog.text
    assert unregistered
