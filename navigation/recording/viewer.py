"""The rerun viewer: in a window, in a browser, or as a picture."""

import logging
import os
import shutil
import socket
import subprocess
import sys
import time
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote, urlsplit

from tussock.world.atomic import replacing
from tussock.world.errors import MissingDependencyError

TIMELINE = "step"  # of recordings

log = logging.getLogger(__name__)


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

    port = _free_port()
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


def watch(recording: Path) -> None:
    """Open a recording in a window of the viewer and wait until it is closed."""
    with _viewer(["--bind", "127.0.0.1", str(recording)]) as viewer:
        if viewer.wait():
            raise MissingDependencyError(
                f"the viewer ended with code {viewer.returncode}; try --web, or --screenshot FILE.png"
            )


def serve(recording: Path) -> None:
    """Show a recording to browsers on this machine only, at an address that is logged, until Ctrl-C."""
    page, data = _free_port(9090), _free_port(9876)
    options = [
        "--bind",
        "127.0.0.1",
        "--port",
        str(data),
        "--serve-web",
        "--web-viewer-port",
        str(page),
        str(recording),
    ]
    with _viewer(options) as viewer:
        while not (_answers(page) and _answers(data)):
            if viewer.poll() is not None:
                raise _ended(viewer)
            time.sleep(0.1)
        address = f"http://127.0.0.1:{page}/?url={quote(f'rerun+http://127.0.0.1:{data}/proxy', safe='')}"
        log.info(f"{recording} is shown to browsers on this machine, until Ctrl-C, at\n    {address}")
        if has_display():
            webbrowser.open(address)
        with suppress(KeyboardInterrupt):
            if viewer.wait():
                raise _ended(viewer)


def _ended(viewer: subprocess.Popen) -> MissingDependencyError:
    """The error of a viewer that ended by itself."""
    return MissingDependencyError(f"the viewer ended with code {viewer.returncode}; try --screenshot FILE.png")


def has_display() -> bool:
    """Whether there is a display for windows."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _free_port(wanted: int = 0) -> int:
    """A port on this machine that nothing listens at: the wanted one, if that is free."""
    if wanted and not _answers(wanted):
        return wanted
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def _answers(port: int) -> bool:
    """Whether something listens at a port of this machine."""
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0


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
    quiet = subprocess.DEVNULL if "--headless" in options else None
    environment = {"RUST_LOG": "error"} | os.environ | {"RERUN_ANALYTICS": "false"}
    with subprocess.Popen([viewer_program(), *options], env=environment, stdout=quiet, stderr=quiet) as viewer:
        try:
            yield viewer
        finally:
            viewer.terminate()
            try:
                viewer.wait(timeout=5)
            except subprocess.TimeoutExpired:
                viewer.kill()
