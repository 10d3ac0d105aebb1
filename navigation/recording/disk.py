"""Bringing a recording to disk. Where the disk is full, rerun's writer sometimes ends without an answer: nothing here waits for ever."""

import logging
import shutil
import threading
import time
from pathlib import Path
from typing import Any

import rerun as rr

from tussock.world.errors import DiskFullError

ASK_SECONDS = 0.5  # that the writer gets to answer, before the disk is looked at
MAX_SECONDS = 120.0  # that a disk with room may take
LEAST_ROOM = 100_000  # bytes; a disk with less is full
CLOSE_SECONDS = 10.0  # that the writer gets to close a file to which all is written

log = logging.getLogger(__name__)


def flush(stream: Any, path: Path) -> None:
    """Wait until all that was logged to a stream of rerun is in its file. Raises DiskFullError where it cannot be written."""
    began = time.monotonic()
    while True:
        asked = time.monotonic()
        try:
            stream.flush(timeout_sec=ASK_SECONDS)
            return
        except RuntimeError as error:
            now = time.monotonic()
            answered = now - asked < ASK_SECONDS
            full = not path.exists() or shutil.disk_usage(path).free < LEAST_ROOM
            if answered or full or now - began > MAX_SECONDS:
                raise DiskFullError(f"{path} cannot be written any more ({error}); make room on its disk") from error


def close(stream: Any) -> None:
    """Close a stream of rerun, or leave it where its writer gives no answer: rerun would wait for it once more when the process ends."""
    closing = threading.Thread(target=stream.disconnect, daemon=True)
    closing.start()
    closing.join(timeout=CLOSE_SECONDS)
    if closing.is_alive():
        rr.unregister_shutdown()
        log.warning(
            "rerun did not close a recording within %g s; it has no index, and opens more slowly", CLOSE_SECONDS
        )
