"""Compilation of loops with numba."""

import logging
from collections.abc import Callable
from functools import cache, partial
from inspect import unwrap
from typing import Any

import numba


def compiled(function: Callable | None = None, **options: Any) -> Any:
    """Decorator for a function that numba compiles; other threads run while it works.

    The machine code is kept on disk for later processes. Where no folder for it can be written, for example in a read-only
    installation without a home folder, each process compiles anew, and one warning says how to avoid that.

    Args:
        function: The function, where the decorator is used without options.
        options: Further options of `numba.njit`.
    """
    if function is None:
        return partial(compiled, **options)
    function = unwrap(function)  # numba compiles the function itself, not a type checker around it
    try:
        return numba.njit(function, nogil=True, cache=True, **options)
    except RuntimeError:  # numba found no folder for its cache
        _warn_without_cache()
        return numba.njit(function, nogil=True, **options)


@cache
def _warn_without_cache() -> None:
    logging.getLogger(__name__).warning(
        "compiled code cannot be kept on disk, so each process compiles again, which takes some seconds; "
        "set NUMBA_CACHE_DIR to a writable folder"
    )
