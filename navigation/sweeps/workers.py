"""Processes that do the runs of a sweep on this machine, started quickly. Importing this module is light."""

import multiprocessing
import os
import sys
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
