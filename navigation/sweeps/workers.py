"""Processes that do the runs of a sweep on this machine, started quickly. Importing this module is light."""

import multiprocessing
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import ModuleSpec
from multiprocessing import forkserver

METHOD = "forkserver" if sys.platform == "linux" else "spawn"  # how these processes begin
WORK = "tussock.navigation.sweeps.work"  # what they import
# Each worker has one core, as in Dask. With PYTHONSAFEPATH (Linux only, see below) no file of the current folder is taken for a library's.
ENVIRONMENT = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "PYTHONSAFEPATH"), "1")


def prepare_workers() -> None:
    """Begin to import what workers need, in a process of its own that they are forked from later: once for all of them.

    Call it early: the imports take seconds, and go on while this process does other things.
    """
    if METHOD != "forkserver":
        return
    multiprocessing.get_context(METHOD).set_forkserver_preload([WORK])
    before = dict(os.environ)
    os.environ.update(ENVIRONMENT)
    try:
        forkserver.ensure_running()
    finally:
        for name in ENVIRONMENT:
            os.environ.pop(name)
        os.environ.update(before)


@contextmanager
def script_left_out() -> Iterator[None]:
    """While this lasts, processes begin without running the user's script again, so that a script needs no `if __name__ == ..` for them.

    Multiprocessing runs the script in each of its processes, to find classes there, unless its name is "__main__". Classes of the script
    reach the workers all the same: Dask sends them by value.
    """
    script = sys.modules["__main__"]
    before = script.__spec__
    script.__spec__ = ModuleSpec("__main__", loader=None)
    try:
        yield
    finally:
        script.__spec__ = before
