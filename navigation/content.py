"""Digests of what settings name: files, image databases, and worlds and routes in memory."""

import dataclasses
import hashlib
from functools import lru_cache
from pathlib import Path
from typing import Any

from tussock.world.errors import FileError


def label_of(source: Any, kind: str) -> str:
    """How settings name a world or a route. kind: what it is."""
    return str(source) if isinstance(source, str | Path) else f"a {kind} in memory ({content_of(source)})"


def content_of(source: Any) -> str:
    """Digest of a file and those that it refers to (see `files_of_mesh`), of an image database, or of an object in memory."""
    if not isinstance(source, str | Path):
        import joblib

        return str(joblib.hash([getattr(source, each.name) for each in dataclasses.fields(source)]))
    if Path(source).is_dir():
        from tussock.render.images.folders import digest_of

        return digest_of(Path(source))
    from tussock.world.meshes.references import files_of_mesh

    digests = [_digest_of(path) for path in files_of_mesh(Path(source))]
    return digests[0] if len(digests) == 1 else hashlib.sha256(" ".join(digests).encode()).hexdigest()


def _digest_of(path: Path) -> str:
    try:
        status = path.stat()
        return _file_digest(path, status.st_size, status.st_mtime_ns)
    except OSError as error:
        raise FileError(f"{path} cannot be read ({error.strerror}); check that it is there") from error


@lru_cache(maxsize=1024)  # every run of a sweep names the same few files
def _file_digest(path: Path, size: int, changed: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
