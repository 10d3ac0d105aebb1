"""A run's folder: the recording of a walk, its trajectory, summary and picture."""

import json
import os
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from tussock.render.images.source import DatabaseViews
from tussock.world.atomic import replacing
from tussock.world.errors import FileError
from tussock.world.progress import Progress, printed
from tussock.world.route_files import write_route

from ..experiment import Experiment, TrainedNavigator
from ..experiment_settings import run_command, settings_of
from ..trajectory import Trajectory
from .playback import RECORDING, UNFINISHED
from .viewer import check_viewer

TRAJECTORY, SUMMARY, PICTURE, ROUTE = "trajectory.csv", "summary.json", "overview.png", "route.csv"
FILES = (RECORDING, TRAJECTORY, SUMMARY, PICTURE, ROUTE, UNFINISHED)
IMPORTED_LATER = (f"{__package__}.log", "tussock.navigation.reports.maps", "pandas")  # pandas by pyarrow
TRAINING_SETTINGS = ("every", "learning_walk_m")  # settings that do not apply to a model from a file


def record_run(
    experiment: Experiment,
    out: str | os.PathLike,
    *,
    overwrite: bool = False,
    viewer: str | None = None,
    learning: Progress | None = None,
    walking: Progress | None = None,
) -> dict[str, Any]:
    """Learn a route, walk it, and leave the walk in a folder.

    An interrupted walk leaves its recording and trajectory, no summary, and a file that explains how to go on.

    Args:
        experiment: What is done.
        out: The folder.
        overwrite: Replace the run that the folder holds.
        viewer: Address of a running viewer to stream to as well.
        learning: Called with how many training views are drawn, of how many; None prints a line where it takes long, `no_progress` none.
        walking: Called with how many steps are made, of how many there may be; None prints a line where it takes long, `no_progress` none.

    Returns:
        The summary of the walk (see `Trajectory.summary`). Its seconds are those of the walk with its diagnosis and its
        recording, until that is complete on disk; steps_per_second are the steps in this time.

    Raises:
        InputError: Where the folder is taken or cannot be written, and for what the experiment refuses.
    """
    learning = printed(learning, "learning", "views")
    walking = printed(walking, "walking", "steps")
    out = Path(out)
    given = (experiment.world, experiment.route, experiment.route_database, experiment.grid_database)
    files = [Path(each) for each in given if isinstance(each, str | Path)]
    check_run_folder(out, overwrite=overwrite, inputs=files, viewer=viewer)
    # What is needed only later is imported while the world is made and views are drawn. Nothing waits for this thread: Ctrl-C within an
    # import here may leave a lock of Python's that it would wait for, for ever.
    threading.Thread(target=_import_all, daemon=True).start()
    with experiment.opened(learning) as trained:
        _claim(out, overwrite, run_command(experiment, str(out)) + " --overwrite")
        settings = _settings(experiment, trained)
        trajectory, seconds = _record(experiment, trained, out, viewer, settings, walking)
        summary = trajectory.summary()
        summary |= {"seconds": seconds, "steps_per_second": summary["steps"] / seconds, "recording": RECORDING}
        write_route(trained.route, out / ROUTE)
        _draw(trained, trajectory, summary, out)
    # Last of all: a folder with a summary holds a whole run.
    with replacing(out / SUMMARY) as partial:
        partial.write_text(json.dumps(summary | {"settings": settings}, indent=2, default=str) + "\n")
    (out / UNFINISHED).unlink()
    return summary | {"recording": str(out / RECORDING)}


def _draw(trained: TrainedNavigator, trajectory: Trajectory, summary: dict[str, Any], out: Path) -> None:
    """Draw the walk from above."""
    from ..reports.maps import write_overview

    renderer = trained.renderer
    views = renderer.poses[:, :2] if isinstance(renderer, DatabaseViews) else None
    write_overview(
        renderer.world, out / PICTURE, route=trained.route, walk=trajectory.xy, views=views, title=_result(summary)
    )


def _record(
    experiment: Experiment,
    trained: TrainedNavigator,
    out: Path,
    viewer: str | None,
    settings: dict[str, Any],
    walking: Progress,
) -> tuple[Trajectory, float]:
    """Walk, and record each step as it is made; returns the trajectory and the seconds."""
    from .log import Recording

    trajectory, began = Trajectory(), time.perf_counter()
    limit = experiment.stopping.step_limit(trained.route.length, experiment.body.step_length)
    with Recording(
        out / RECORDING,
        trained.renderer,
        trained.route,
        training_poses=trained.poses,
        max_deviation=experiment.stopping.max_deviation,
        live=viewer,
        about=_about(settings),
    ) as recording:
        try:
            for step, diagnosis in experiment.steps(trained):
                recording.log(step, diagnosis)
                trajectory.add(step, diagnosis)
                walking(step.index, limit)
            recording.describe(_about(settings, result=_result(trajectory.summary())))
        finally:
            trajectory.write(out / TRAJECTORY)
    return trajectory, time.perf_counter() - began


def _import_all() -> None:
    """Import what is needed only later; what cannot be imported is reported where it is needed."""
    with suppress(Exception):
        for name in IMPORTED_LATER:
            import_module(name)


def _about(settings: dict[str, Any], result: str = "") -> str:
    """What a recording says of its walk, as Markdown: the result, then what it is a result of, then all other settings."""
    first = {name: settings[name] for name in ("model", "navigator", "encoding", "world", "seed")}
    lines = [
        f"- **{name.replace('_', ' ')}**: {value}" for name, value in (first | settings).items() if value is not None
    ]
    return "\n".join(([f"**{result}**", ""] if result else []) + lines)


def _result(summary: dict[str, Any]) -> str:
    """The end of a walk in a line."""
    return f"{summary['reason']} after {summary['steps']} steps, {summary['mean_deviation_m']:.3f} m off the route on average"


def _settings(experiment: Experiment, trained: TrainedNavigator) -> dict[str, Any]:
    """The settings as the summary holds them: with what was chosen automatically."""
    settings = settings_of(experiment)
    if isinstance(experiment.model, Path):
        settings = {name: value for name, value in settings.items() if name not in TRAINING_SETTINGS}
    n_views = None if trained.poses is None else len(trained.poses)
    return settings | {"encoding": str(experiment.encoding), "renderer": trained.renderer.backend, "n_views": n_views}


def check_run_folder(
    out: Path, *, overwrite: bool = False, inputs: Sequence[Path] = (), viewer: str | None = None
) -> None:
    """Refuse, before long work, a folder that cannot be written in the end; change nothing.

    Args:
        out: The folder.
        overwrite: Whether the run that it holds may be replaced.
        inputs: Files that must not be replaced.
        viewer: Address of a viewer that must be listening.

    Raises:
        InputError: For these reasons.
    """
    if viewer is not None:
        check_viewer(viewer)
    existing = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    if not existing.is_dir():
        raise FileError(f"{out} cannot be written: {existing} is a file; give a folder for the run")
    if not os.access(existing, os.W_OK):
        raise FileError(f"{out} cannot be written: {existing} is read-only; give another --out")
    earlier = _run_files(out)
    if earlier and not overwrite:
        raise _taken(out)
    for path in earlier:
        if any(given.exists() and given.samefile(path) for given in inputs):
            raise FileError(f"{path} is used by this run and would be replaced by it; give another --out")


def _claim(out: Path, overwrite: bool, command: str) -> None:
    """Make the folder for this run alone, with a file that says that the run is not finished. Raises FileError."""
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
        raise FileError(f"{out} cannot be written ({error.strerror}); give another --out") from error


def _taken(out: Path) -> FileError:
    if (out / UNFINISHED).exists():
        return FileError(
            f"{out} already holds a run that is not finished; see {out / UNFINISHED}, or give another --out"
        )
    return FileError(f"{out} already holds a run; give another --out, or --overwrite to replace it")


def _run_files(out: Path) -> list[Path]:
    return [out / name for name in FILES if (out / name).exists()]
