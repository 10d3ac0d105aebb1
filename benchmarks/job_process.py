"""One job as a process: how long it takes, what all of its processes compute together, and how much memory they take at most."""

import ctypes
import os
import resource
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

INTERVAL = 0.25  # s between two looks at the memory
PATIENCE = 30.0  # s that processes may go on after the one that started them
PR_SET_CHILD_SUBREAPER = 36  # of Linux: processes whose parent has ended become ours, so that their times are counted


@dataclass(frozen=True, kw_only=True)
class Measured:
    """What a job took.

    Attributes:
        seconds: From start to end.
        cpu_seconds: Of all of its processes.
        peak_bytes: The most memory that its processes held at once; what several share counts once.
    """

    seconds: float
    cpu_seconds: float
    peak_bytes: int


class JobError(Exception):
    """A job that failed, with what it printed last."""


def measure(command: Sequence[str], folder: Path, environment: Mapping[str, str]) -> Measured:
    """Run a command in a folder, with its output in `folder`/output.txt. Raises JobError where it fails."""
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    output = folder / "output.txt"
    before, began, peak = _cpu_of_children(), time.perf_counter(), 0
    with output.open("wb") as file:
        job = subprocess.Popen(
            command, cwd=folder, env=dict(environment), stdout=file, stderr=file, start_new_session=True
        )
    try:
        while (ended := _reap(job.pid)) is None:
            peak = max(peak, sum(map(_memory_of, _processes_of(job.pid))))
            time.sleep(INTERVAL)
        seconds = time.perf_counter() - began
        job.returncode = ended
        while (
            _reap(0) is None and time.perf_counter() - began < seconds + PATIENCE
        ):  # servers of processes, which end by themselves
            time.sleep(INTERVAL / 10)
    finally:
        for process in _processes_of(job.pid):
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
    if ended:
        raise JobError(f"{' '.join(command)} ended with {ended}: {output.read_text(errors='replace')[-2000:]}")
    return Measured(seconds=seconds, cpu_seconds=_cpu_of_children() - before, peak_bytes=peak)


def _reap(pid: int) -> int | None:
    """Wait for children that have ended.

    Returns:
        The exit code of the process `pid`, once it has ended; for a `pid` of 0, 0 once no child is left. None before.
    """
    with suppress(ChildProcessError):
        while True:
            ended, status = os.waitpid(-1, os.WNOHANG)
            if ended == 0:
                return None
            if ended == pid:
                return os.waitstatus_to_exitcode(status)
    return 0


def _cpu_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _processes_of(session: int) -> list[int]:
    """The processes of a session, those that have ended and are not waited for aside."""
    found = []
    for process in Path("/proc").iterdir():
        with suppress(OSError, ValueError):  # it may end meanwhile, or be no process
            if os.getsid(number := int(process.name)) == session and (process / "cmdline").read_bytes():
                found.append(number)
    return found


def _memory_of(process: int) -> int:
    """Its proportional set size: of pages that processes share, each has its part (bytes)."""
    with suppress(OSError):  # it may end meanwhile
        for line in Path(f"/proc/{process}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return 1024 * int(line.split()[1])
    return 0
