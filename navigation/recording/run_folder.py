"""A run's folder: the recording of a walk, its trajectory, summary and picture; and playing it back."""

import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from tussock.world.atomic import replacing
from tussock.world.errors import InputError
from tussock.world.geometry import Pose
from tussock.world.route_files import write_route

from ..cli.terminal import say
from ..failures import Witness
from ..reports.maps import write_overview
from ..trajectory import Trajectory
from ..walk import Agent
from .log import Recording, check_viewer, watch
from .log import screenshot as save_screenshot

RECORDING, TRAJECTORY, SUMMARY, PICTURE, ROUTE = (
    "recording.rrd",
    "trajectory.csv",
    "summary.json",
    "overview.png",
    "route.csv",
)
UNFINISHED = "UNFINISHED.txt"  # is there until all the others are
FILES = (RECORDING, TRAJECTORY, SUMMARY, PICTURE, ROUTE, UNFINISHED)


def check_run_folder(
    out: Path, *, overwrite: bool = False, inputs: Sequence[Path] = (), viewer: str | None = None
) -> None:
    """Refuse, before long work, what `record_walk` would refuse after it; touch nothing. Raises InputError.

    inputs: files of the person's that must not be replaced. viewer: address of a viewer that must be listening.
    """
    if viewer is not None:
        check_viewer(viewer)
    existing = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    if not existing.is_dir():
        raise InputError(f"{out} cannot be written: {existing} is a file; give a folder for the run")
    if not os.access(existing, os.W_OK):
        raise InputError(f"{out} cannot be written: {existing} is read-only; give another --out")
    earlier = _run_files(out)
    if earlier and not overwrite:
        raise _taken(out)
    for path in earlier:
        if any(given.exists() and given.samefile(path) for given in inputs):
            raise InputError(f"{path} is used by this run and would be replaced by it; give another --out")


def _claim(out: Path, overwrite: bool, command: str) -> None:
    """Make the folder of a run, this one's alone, and say in it that the run is not finished.

    Raises InputError where another run holds it or it cannot be written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        if overwrite:
            for path in _run_files(out):
                path.unlink()
        (out / RECORDING).open("xb").close()  # fails where another run was quicker
        (out / UNFINISHED).write_text(
            f"This run goes on, or it was interrupted: then {RECORDING} opens up to where it was.\n\n"
            f"To resume it, walk again from its start, which takes the same steps:\n\n    {command}\n\n"
            "To discard it, delete this folder.\n"
        )
    except FileExistsError:
        raise _taken(out) from None
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}); give another --out") from error


def _taken(out: Path) -> InputError:
    if (out / UNFINISHED).exists():
        return InputError(
            f"{out} already holds a run that is not finished; see {out / UNFINISHED}, or give another --out"
        )
    return InputError(f"{out} already holds a run; give another --out, or --overwrite to replace it")


def _run_files(out: Path) -> list[Path]:
    return [out / name for name in FILES if (out / name).exists()]


def record_walk(
    agent: Agent, start: Pose, out: Path, *, overwrite: bool = False, training_poses: Float[np.ndarray, "n 3"] | None = None,
    settings: dict[str, Any] | None = None, command: str = "the same as before, with overwrite", viewer: str | None = None,
    progress: Callable[[int, int], object] = lambda done, total: None,
) -> dict[str, Any]:  # fmt: skip
    """Walk from start and leave the walk in the folder `out`; return its summary, whose times are those of the walk alone.

    overwrite: replace the run that the folder holds. training_poses: of the views the model knows, in their order: shows the
    recognised view in the recording, and where views were learned is part of the evidence of failures: without them the causes rest on what
    else there is. settings: kept in summary.json. progress(done, total): steps, of the most there can be.
    command: what repeats the walk. An interrupted walk leaves its recording and trajectory, no summary, and a file that says how to
    go on. Raises InputError where the folder is taken, or cannot be written to the end.
    """
    _claim(out, overwrite, command)
    world, route, trajectory = agent.renderer.world, agent.route, Trajectory()
    witness = Witness(agent.renderer, agent.encoding, route, training_poses)
    began = time.perf_counter()
    with Recording(
        out / RECORDING,
        world,
        route,
        renderer=agent.renderer,
        training_poses=training_poses,
        lost=agent.lost,
        live=viewer,
        title=_about(settings),
    ) as recording:
        try:
            for step in agent.walk(start):
                evidence = witness.evidence(step)
                recording.log(step, evidence)
                trajectory.add(step, evidence)
                progress(step.index, agent.step_limit)
        finally:
            trajectory.write(out / TRAJECTORY)
    seconds = time.perf_counter() - began
    summary = trajectory.summary()
    summary |= {"seconds": seconds, "steps_per_second": (len(trajectory) - 1) / seconds, "recording": RECORDING}
    write_route(route, out / ROUTE)
    title = f"{summary['reason']} after {summary['steps']} steps, {summary['mean_deviation_m']:.3f} m off the route on average"
    write_overview(world, out / PICTURE, route=route, walk=trajectory.xy, title=title)
    # Last of all: a folder with a summary holds a whole run.
    with replacing(out / SUMMARY) as partial:
        partial.write_text(json.dumps(summary | {"settings": settings or {}}, indent=2, default=str) + "\n")
    (out / UNFINISHED).unlink()
    return summary | {"recording": str(out / RECORDING)}


def play(run: Path, *, web: bool = False, screenshot: Path | None = None) -> dict[str, Any]:
    """Open a run's recording in the rerun viewer: a window, a browser page served on this machine only, or a picture.

    Raises InputError where there is no recording, or no display and neither `web` nor `screenshot`.
    """
    recording = run / RECORDING if run.is_dir() else run
    if not recording.is_file():
        raise InputError(f"there is no recording {recording}; give the folder of a run")
    if (recording.parent / UNFINISHED).exists():
        say(f"this run is not finished; see {recording.parent / UNFINISHED}")
    if screenshot is not None and screenshot.suffix.lower() != ".png":
        raise InputError(f"{screenshot}: a picture of the viewer is written as .png")
    if screenshot is not None:
        save_screenshot(recording, screenshot)
        return {"recording": str(recording), "screenshot": str(screenshot)}
    if not web and sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError("there is no display here; add --web to watch in a browser, or --screenshot FILE.png")
    watch(recording, web=web)
    return {"recording": str(recording)}


def _about(settings: dict[str, Any] | None) -> str:
    """Settings as a markdown list."""
    return "\n".join(
        f"- **{key.replace('_', ' ')}**: {value}" for key, value in (settings or {}).items() if value is not None
    )
