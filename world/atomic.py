"""Files that are written completely or not at all."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .errors import DiskFullError, FileError

DISK_FULL = (errno.ENOSPC, errno.EDQUOT)
WRITE_ERRORS = (*DISK_FULL, errno.EFBIG, errno.EIO)  # those of writing to an open file: they do not name the file


@contextmanager
def replacing(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path to write to. It replaces `path` at the end of the block, and is deleted where the block fails.

    An error of the block that is about something else, such as a second file, is raised unchanged.

    Args:
        path: The file to write. It stays as it was until the block has ended without an error.

    Raises:
        FileError: Where the temporary file cannot be written, or cannot replace `path`.
        DiskFullError: Where the disk is full.
    """
    path = Path(path)
    check_writable(path)
    partial = path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")
    try:
        yield partial
        os.replace(partial, path)
    except OSError as error:
        if not _is_about(error, partial):
            raise
        kind, remedy = (
            (DiskFullError, "make room there") if error.errno in DISK_FULL else (FileError, "give another name")
        )
        raise kind(f"{path} cannot be written ({error.strerror or error}); {remedy}") from error
    finally:
        with suppress(OSError):  # it is gone after a success; another error must not be hidden
            partial.unlink()


def check_writable(path: Path) -> None:
    """Refuse a path that cannot become a file: a folder, or in a folder that is missing or read-only. Raises FileError."""
    if os.path.isdir(path):
        raise FileError(f"{path} is a folder; give the name of a file to write")
    if not os.path.isdir(path.parent):
        raise FileError(f"{path} cannot be written: there is no folder {path.parent}; create it first")
    if not os.access(path.parent, os.W_OK):
        raise FileError(f"{path} cannot be written: the folder {path.parent} is read-only; choose another")


def _is_about(error: OSError, file: Path) -> bool:
    """Whether an error is about a file: it names the file, or it names none and can only come from writing."""
    if isinstance(error.filename, str | bytes | os.PathLike):
        return os.path.abspath(os.fsdecode(error.filename)) == os.path.abspath(file)
    return error.errno in WRITE_ERRORS
