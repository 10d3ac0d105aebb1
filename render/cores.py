"""How many processor cores there are to work on."""

import os


def core_count() -> int:
    """Number of processor cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):  # Linux only
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
