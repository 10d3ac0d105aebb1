"""The rerun viewer: in a window, in a browser, or as a picture."""

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit

from tussock.world.atomic import replacing
from tussock.world.errors import MissingDependencyError

TIMELINE = "step"  # of recordings


def check_viewer(url: str) -> None:
    """Raise MissingDependencyError where no viewer listens."""
    at = urlsplit(url)
    try:
        socket.create_connection((at.hostname or "", at.port or 9876), timeout=2).close()
    except (OSError, ValueError) as error:
        raise MissingDependencyError(
            f"no rerun viewer listens at {url}; start one with: rerun --bind 127.0.0.1"
        ) from error


def save_screenshot(recording: Path, picture: Path, *, step: int | None = None, seconds: float = 60.0) -> None:
    """Save what the viewer shows of a recording, once it shows all of it. Needs no display.

    Args:
        recording: The `.rrd` file.
        picture: The PNG to write.
        step: What it shows; None means the last one.
        seconds: Limit of the time that it may take.

    Raises:
        MissingDependencyError: Where the viewer cannot draw, or needs longer.
    """
    from rerun.experimental import ViewerClient  # late: `watch` needs only the viewer's program

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    options = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", "1600x1000", str(recording)]
    until = time.monotonic() + seconds
    # The viewer loads in the background and gives no sign when it is done: it is done when its picture stays the same.
    earlier: list[bytes] = []
    with replacing(picture) as partial, _viewer(options) as viewer:
        while len(earlier) < 4 or len(set(earlier[-4:])) > 1:
            if viewer.poll() is not None or time.monotonic() > until:
                raise MissingDependencyError(
                    "the viewer drew no picture; it needs Vulkan (Debian: mesa-vulkan-drivers libvulkan1)"
                )
            time.sleep(0.5)
            try:
                client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
                if step is not None:
                    client.set_time(TIMELINE, sequence=step, play_state="paused")
                client.save_screenshot(str(partial.absolute()))
                earlier.append(partial.read_bytes())
            except (ConnectionError, OSError, RuntimeError, ValueError):
                continue  # not up yet


def watch(recording: Path, *, web: bool = False) -> None:
    """Open a recording in the viewer and wait until it is closed: a window, or a page served to browsers on this machine only."""
    options = ["--bind", "127.0.0.1", str(recording), *(["--web-viewer"] if web else [])]
    with _viewer(options) as viewer:
        if viewer.wait():
            raise MissingDependencyError(
                f"the viewer ended with code {viewer.returncode}; try --web, or --screenshot FILE.png"
            )


def viewer_program() -> str:
    """Path of the viewer. The command `rerun` only starts it, and would leave it running when it is ended itself."""
    package = find_spec("rerun_cli")
    folders = list(package.submodule_search_locations or []) if package else []
    program = shutil.which("rerun", path=os.pathsep.join(folders)) if folders else None
    if program is None:
        raise MissingDependencyError("the rerun viewer is not installed here; install rerun-sdk")
    return program


@contextmanager
def _viewer(options: list[str]) -> Iterator[subprocess.Popen]:
    """The viewer that came with rerun-sdk, running; ended with the block."""
    program = viewer_program()
    quiet = subprocess.DEVNULL if "--headless" in options else None
    with subprocess.Popen(
        [program, *options], env=os.environ | {"RERUN_ANALYTICS": "false"}, stdout=quiet, stderr=quiet
    ) as viewer:
        try:
            yield viewer
        finally:
            viewer.terminate()
            try:
                viewer.wait(timeout=5)
            except subprocess.TimeoutExpired:
                viewer.kill()
