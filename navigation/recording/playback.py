"""Playing a run's recording back. Light to import: without torch, and without what makes recordings."""

import logging
import os
import sys
from pathlib import Path
from typing import Any

from tussock.world.errors import FileError, MissingDependencyError

from .viewer import save_screenshot, watch

RECORDING = "recording.rrd"
UNFINISHED = "UNFINISHED.txt"  # is in the folder of a run until all else is

log = logging.getLogger(__name__)


def play(run: Path, *, web: bool = False, screenshot: Path | None = None) -> dict[str, Any]:
    """Open a run's recording in the rerun viewer.

    Args:
        run: Folder of the run, or its recording.
        web: Serve the viewer to browsers on this machine instead of opening a window.
        screenshot: Write a picture (.png) of the viewer instead, without a display.

    Raises:
        FileError: Where there is no recording.
        MissingDependencyError: Where there is no display, and neither `web` nor `screenshot`.
    """
    recording = run / RECORDING if run.is_dir() else run
    if not recording.is_file():
        raise FileError(f"there is no recording {recording}; give the folder of a run")
    if (recording.parent / UNFINISHED).exists():
        log.info(f"this run is not finished; see {recording.parent / UNFINISHED}")
    if screenshot is not None and screenshot.suffix.lower() != ".png":
        raise FileError(f"{screenshot}: a picture of the viewer is written as .png")
    if screenshot is not None:
        save_screenshot(recording, screenshot)
        return {"recording": str(recording), "screenshot": str(screenshot)}
    if not web and sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise MissingDependencyError(
            "there is no display here; add --web to watch in a browser, or --screenshot FILE.png"
        )
    watch(recording, web=web)
    return {"recording": str(recording)}
