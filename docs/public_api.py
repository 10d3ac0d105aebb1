"""Makes the pages of the public API strict: what has no docstring, or an array without a shape, is a warning, and so fails the build."""

import inspect
import re
from typing import Any

from sphinx.util import logging

BARE = re.compile(
    r"(?<![\w\[.])(?:np\.ndarray|numpy\.ndarray|torch\.Tensor|Tensor)(?![\w\]])"
)  # and not Float[np.ndarray, "n h w"]

log = logging.getLogger(__name__)


def setup(app: Any) -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", check)
    app.connect("autodoc-skip-member", leave_out)
    return {"parallel_read_safe": True}


def check(app: Any, kind: str, name: str, found: Any, options: Any, lines: list[str]) -> None:
    """Warn of an object of the public API that a reader could not use from its page alone."""
    lines[:] = [line.replace("|", r"\|") for line in lines]  # |x| is an absolute value, and no substitution
    if kind not in ("class", "function", "method"):
        return
    if not any(map(str.strip, lines)):
        log.warning("%s has no docstring", name, location=name)
    if kind == "class" or not callable(found):
        return
    for each, annotation in getattr(inspect.unwrap(found), "__annotations__", {}).items():
        if BARE.search(str(annotation)):
            log.warning("%s: %s is an array without a shape (%s)", name, each, annotation, location=name)


def leave_out(app: Any, kind: str, name: str, found: Any, skip: bool, options: Any) -> bool | None:
    """Leave out what classes have from other packages, and how objects of data classes are made: their attributes say that."""
    foreign = not getattr(found, "__module__", "tussock").startswith("tussock")
    return True if name in ("__init__", "__new__") or (inspect.isroutine(found) and foreign) else None
