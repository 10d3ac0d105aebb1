"""Real processes, killed while they write, and a real disk that is full: what was done before stays, and the same command goes on.

Sweeps have their own in test_sweeps.py.
"""

import json
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

from tussock.navigation.recording.log import viewer_program

TUSSOCK = str(Path(sys.executable).with_name("tussock"))
WORLD = ["--world", "tiny", "--seed", "2", "--size", "120x25"]


def tussock(*words, **options) -> subprocess.CompletedProcess:
    return subprocess.run([TUSSOCK, *map(str, words)], capture_output=True, text=True, **options)


def grow(disk: Path) -> None:
    """Make room."""
    subprocess.run(["mount", "-o", "remount,size=20m", disk], check=True)


def test_a_killed_run_says_how_to_go_on_and_its_recording_opens(tmp_path):
    out = tmp_path / "run"
    walk = [TUSSOCK, "run", *WORLD, "--step-m", "0.002", "--out", out]  # over a thousand steps
    with subprocess.Popen(walk, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as process:
        recording = out / "recording.rrd"
        while not (recording.exists() and recording.stat().st_size > 400_000):
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
    stats = subprocess.run([viewer_program(), "rrd", "stats", recording], capture_output=True, text=True)
    assert stats.returncode == 0, stats.stderr
    assert "/deviation/m" in stats.stdout
    assert not (out / "summary.json").exists()
    again = tussock("run", *WORLD, "--out", out)
    assert again.returncode == 2
    assert again.stderr.splitlines()[-1] == (
        f"tussock: {out} already holds a run that is not finished; see {out / 'UNFINISHED.txt'}, or give another --out"
    )
    (command,) = [line.strip() for line in (out / "UNFINISHED.txt").read_text().splitlines() if line.startswith("    ")]
    resumed = tussock(*shlex.split(command)[1:], "--json")
    assert resumed.returncode == 0, resumed.stderr
    assert json.loads((out / "summary.json").read_text())["steps"] == json.loads(resumed.stdout)["steps"]
    assert not (out / "UNFINISHED.txt").exists()


def test_a_run_on_a_full_disk_says_so_and_leaves_no_summary(small_disk):
    run = ["run", *WORLD, "--out", small_disk / "run"]
    done = tussock(*run)
    assert done.returncode == 2
    assert "make room" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
    assert not (small_disk / "run" / "summary.json").exists()
    grow(small_disk)
    assert tussock(*run, "--overwrite").returncode == 0
    assert (small_disk / "run" / "summary.json").exists()


def test_a_database_on_a_full_disk_keeps_its_images_and_is_completed(small_disk, tmp_path):
    grid = ["database", "grid", *WORLD[:4], "--size", "360x75", "--spacing-m", "0.3", "--json"]
    done = tussock(*grid, "--out", small_disk / "grid")
    assert done.returncode == 2
    assert "make room" in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
    before = {path: path.read_bytes() for path in (small_disk / "grid").glob("*.png")}
    assert before
    grow(small_disk)
    assert tussock(*grid, "--out", small_disk / "grid").returncode == 0
    assert all(path.read_bytes() == image for path, image in before.items())
    assert tussock(*grid, "--out", tmp_path / "grid").returncode == 0
    names = {path.name for path in (tmp_path / "grid").iterdir()}
    assert {path.name for path in (small_disk / "grid").iterdir()} == names
    assert all(
        (small_disk / "grid" / name).read_bytes() == (tmp_path / "grid" / name).read_bytes()
        for name in names
        if name.endswith("png")
    )
