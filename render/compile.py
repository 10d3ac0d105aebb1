"""Compilation of loops with numba."""

import hashlib
import inspect
import logging
from collections.abc import Callable, Sequence
from functools import cache, partial
from types import ModuleType
from typing import Any

import numba


def compiled(function: Callable | None = None, *, uses: Sequence[ModuleType] = (), **options: Any) -> Any:
    """Decorator for a function that numba compiles; other threads run while it works.

    The machine code is kept on disk for later processes. Where no folder for it can be written, for example in a read-only
    installation without a home folder, each process compiles anew, and one warning says how to avoid that.

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
        return numba.njit(bare, nogil=True, cache=True, **options)
    except RuntimeError:  # numba found no folder for its cache
        _warn_without_cache()
        return numba.njit(bare, nogil=True, **options)


@cache
def _warn_without_cache() -> None:
    logging.getLogger(__name__).warning(
        "compiled code cannot be kept on disk, so each process compiles again, which takes some seconds; "
        "set NUMBA_CACHE_DIR to a writable folder"
    )
