"""The command line in tests: commands in this process or in one of their own, and the keys of what they print with --json."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tussock.navigation.cli.main import main

TUSSOCK = str(Path(sys.executable).with_name("tussock"))

# Scripts read these: a key may be added, none may go or change its name.
_STUDY, _DATABASE = {"report", "results", "claims"}, {"database", "type", "images", "rendered", "seconds"}
KEYS = {
    "world": {"world", "preset", "seed", "triangles"},
    "world --list": {"worlds"},
    "view": {"view", "width", "height", "renderer"},
    "route": {"route", "length_m", "start", "goal"},
    "evaluate": {
        "model", "encoding", "n_views", "n_positions", "median_error_deg", "mean_error_deg", "share_over_45", "by_distance", "clearance_m",
        "with_room", "seconds",
    },
    "train": {"file", "model", "encoding", "n_views", "memory_bytes", "fit_seconds"},
    "compare": {"encoding", "n_views", "n_positions", "n_worlds", "n_walks", "models"},
    "describe": {"world", "n_places", "measures", "skyline_spectrum", "contrast_spectrum", "figure"},
    "ridf": {"encoding", "n_references", "rotational", "translational", "figure"},
    "catchment": {
        "model", "encoding", "n_positions", "spacing_m", "area_m2", "volume", "reach_m", "descent_within_45", "descent_within_90",
        "heading_within_45", "heading_within_90", "heading_area_45_m2", "heading_area_90_m2", "figure",
    },
    "place": {
        "encoding", "n_queries", "n_references", "n_recognisable", "precision_recall_area", "recall_at_1", "recall_at_5", "recall_at_10",
        "median_distance_m", "figure",
    },
    "models": {"models"},
    "run": {
        "arrived", "reason", "steps", "mean_deviation_m", "max_deviation_m", "mean_error_deg", "resets", "cause", "poor_steps", "causes",
        "seconds", "steps_per_second", "recording", "max_view_distance_m",
        "looks_per_m", "touches", "inward", "outward", "goal_m", "recovered",
    },
    "play": {"recording", "screenshot"},
    "sweep": {"table", "runs", "done_before", "arrived", "could_not_run", "seconds", "recordings"},
    "report": {"report", "results", "runs", "worlds", "could_not_run", "arrived", "mean_deviation_m", "mean_error_deg"},
    "benchmark": {"results", "table"},
    "replicate": {"report", "results", "runs", "done_before", "could_not_run", "claims", "seconds"},
    "replicate thesis": _STUDY,
    "study": _STUDY,
    "database grid": _DATABASE,
    "database route": _DATABASE,
    "database check": {"database", "type", "images", "problems", "ok"},
    "database import": {"database", "type", "images", "written", "size", "mask"},
    "unwrap": {"out", "panoramas", "lens", "size"},  # of a ring, centre, inner and outer as well
}  # fmt: skip


def tussock(capfd, *arguments: Any) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command that runs in this process."""
    capfd.readouterr()
    code = 0
    try:
        main([str(argument) for argument in arguments])
    except SystemExit as stop:
        code = int(stop.code or 0)
    return code, *capfd.readouterr()


def printed(capfd, *arguments: Any, code: int = 0) -> dict[str, Any]:
    """What a command in this process prints with --json; it ends with this code."""
    ended, out, err = tussock(capfd, *arguments, "--json")
    assert ended == code, err
    return checked(arguments, out)


class Process(subprocess.Popen):
    """A process that is killed at the end of its `with` block, unless it has ended: one that hangs does not hold up the tests."""

    def __exit__(self, *error: Any) -> None:
        if self.poll() is None:
            self.kill()
        super().__exit__(*error)


def process(*arguments: Any, **options: Any) -> subprocess.CompletedProcess:
    """A command in a process of its own; one that hangs is killed, and fails the test, before pytest's own limit is over."""
    return subprocess.run(
        [TUSSOCK, *map(str, arguments)], capture_output=True, text=True, **{"timeout": 400, **options}
    )


def interrupted(ready: Callable[[], bool], *arguments: Any) -> tuple[int, str]:
    """Exit code and standard error of a command in a process of its own that gets Ctrl-C when something is ready."""
    running = subprocess.Popen(
        [TUSSOCK, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while not ready():
        assert running.poll() is None, running.communicate()
        time.sleep(0.002)
    running.send_signal(signal.SIGINT)
    err = running.communicate()[1]
    return running.returncode, err


def process_json(*arguments: Any, **options: Any) -> dict[str, Any]:
    """What a command in a process of its own prints with --json; it succeeds."""
    done = process(*arguments, "--json", **options)
    assert done.returncode == 0, done.stderr
    return checked(arguments, done.stdout)


def checked(arguments: tuple[Any, ...], out: str) -> dict[str, Any]:
    """The one object that a command printed; it has the keys of the command."""
    result = json.loads(out)
    first, second = (*map(str, arguments[:2]), "")[:2]
    assert set(result) == KEYS.get(f"{first} {second}", KEYS.get(first))
    return result
