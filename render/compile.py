"""Compilation of loops with numba."""

import hashlib
import inspect
import logging
from collections.abc import Callable, Sequence
from functools import cache, partial
from types import ModuleType
from typing import Any

import numba
from numba.core import config as numba_config
from numba.core import event

log = logging.getLogger(__name__)
config: Any = numba_config  # its attributes are set at import
SIMULATED = bool(config.ENABLE_CUDASIM)  # whether numba simulates a GPU, which is for tests


def compiled(function: Callable | None = None, *, uses: Sequence[ModuleType] = (), **options: Any) -> Any:
    """Decorator for a function that numba compiles; other threads run while it works.

    The machine code is kept on disk for later processes: next to the source, or in the user's folder for caches where the installation
    is read-only. Where there is none yet, a line of the log says that it is made. Where neither folder can be written, for example
    without a home folder, each process compiles anew, and one warning says how to avoid that.

    Args:
        function: The function, where the decorator is used without options.
        uses: Other modules whose functions it calls, or the functions that it calls do. numba notices a change in the source of a
            function's own module only; with this it compiles anew after a change in the other ones, too.
        options: Further options of `numba.njit`.
    """
    if function is None:
        return partial(compiled, uses=uses, **options)
    bare: Any = inspect.unwrap(function)  # numba compiles the function itself, not a type checker around it
    if uses:  # what numba keeps is found by this name
        sources = "".join(map(inspect.getsource, uses))
        bare.__qualname__ += "_" + hashlib.sha256(sources.encode()).hexdigest()[:12]
    try:
        dispatcher = numba.njit(bare, nogil=True, cache=True, **options)
    except RuntimeError:  # numba found no folder for its cache
        _warn_without_cache()
        return numba.njit(bare, nogil=True, **options)
    _kept.add(dispatcher)
    return dispatcher


_kept: set[Any] = set()  # what numba keeps on disk


class _Announcement(event.Listener):
    """Logs, once in a process, that functions are compiled: loading what was compiled before is no event."""

    def on_start(self, event: event.Event) -> None:
        if event.data is not None and event.data["dispatcher"] in _kept:
            _say_compiling()

    def on_end(self, event: event.Event) -> None:
        pass


@cache
def _say_compiling() -> None:
    log.info("compiling for this processor, once: this takes some seconds")


event.register("numba:compile", _Announcement())


@cache
def _warn_without_cache() -> None:
    log.warning(
        "compiled code cannot be kept on disk, so each process compiles again, which takes some seconds; "
        "set NUMBA_CACHE_DIR to a writable folder"
    )
