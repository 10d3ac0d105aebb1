"""Playing a run's recording back. Light to import: without torch, and without what makes recordings."""

import logging
from pathlib import Path
from typing import Any

from tussock.world.errors import FileError, MissingDependencyError, SettingError
from tussock.world.progress import Progress

from .viewer import has_display, save_screenshot, serve, watch

RECORDING = "recording.rrd"
UNFINISHED = "UNFINISHED.txt"  # is in the folder of a run until all else is

log = logging.getLogger(__name__)


def play(
    run: Path,
    *,
    web: bool = False,
    screenshot: Path | None = None,
    step: int | None = None,
    video: Path | None = None,
    steps_per_second: float = 10.0,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Open a run's recording in the rerun viewer, or make a picture or a film of it.

    Args:
        run: Folder of the run, or its recording.
        web: Serve the viewer to browsers on this machine instead of opening a window.
        screenshot: Write a picture (.png) of the viewer instead, without a display.
        step: What the picture shows; None means the end of the walk.
        video: Write a film (.mp4 or .gif) of the walk instead.
        steps_per_second: Its speed.
        progress: Called with how many steps of the film are drawn, of how many; None prints a line where it takes long, `no_progress` none.

    Raises:
        FileError: Where there is no recording.
        SettingError: For more than one of `web`, `screenshot` and `video`, and for a step that the walk does not have.
        MissingDependencyError: Without a display where none of these is given, and for an .mp4 without imageio-ffmpeg.
    """
    if web + (screenshot is not None) + (video is not None) > 1:
        raise SettingError("--web, --screenshot and --video each take the place of the others: give one of them")
    if step is not None and screenshot is None:
        raise SettingError("--step is that of a picture; give --screenshot FILE.png as well")
    recording = run / RECORDING if run.is_dir() else run
    if not recording.is_file():
        raise FileError(f"there is no recording {recording}; give the folder of a run")
    if (recording.parent / UNFINISHED).exists():
        log.info(f"this run is not finished; see {recording.parent / UNFINISHED}")
    if screenshot is not None and screenshot.suffix.lower() != ".png":
        raise FileError(f"{screenshot}: a picture of the viewer is written as .png")
    if screenshot is not None:
        if step is not None:
            check_step(recording, step)
        save_screenshot(recording, screenshot, step=step)
        return {"recording": str(recording), "screenshot": str(screenshot)}
    if video is not None:
        from .film import save_film

        steps = save_film(recording, video, steps_per_second=steps_per_second, progress=progress)
        return {"recording": str(recording), "video": str(video), "steps": steps}
    if web:
        serve(recording)
    elif has_display():
        watch(recording)
    else:
        raise MissingDependencyError(
            "there is no display here; add --web to watch in a browser, --screenshot FILE.png or --video FILE.mp4"
        )
    return {"recording": str(recording)}


def check_step(recording: Path, step: int) -> None:
    """Raise SettingError where a recording has no such step."""
    from .recorded_walk import read_walk

    steps = read_walk(recording).steps
    if step not in steps:
        raise SettingError(f"--step {step}: {recording} has the steps {steps[0]} to {steps[-1]}")
