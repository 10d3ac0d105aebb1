"""What all commands have, and those that do many runs."""

from dataclasses import dataclass
from typing import Annotated

import tyro

from tussock.world.errors import SettingError


@dataclass(kw_only=True)
class Command:
    """What all commands have."""

    json: bool = False
    """Print one JSON object instead of text."""


@dataclass(kw_only=True)
class WorkerOptions(Command):
    """What does many runs."""

    scheduler: Annotated[str | None, tyro.conf.arg(metavar="tcp://HOST:PORT")] = None
    """A running Dask scheduler, whose workers do the runs. Default: workers on this machine, for this command alone."""
    workers: int | None = None
    """Number of workers on this machine. Default: one per core."""

    def chosen_workers(self) -> str | int | None:
        """What does the runs, as `run_sweep` takes it. Raises SettingError for contradicting flags."""
        if self.workers is not None and self.workers < 1:
            raise SettingError(f"--workers {self.workers}: give at least 1")
        if self.scheduler is not None and self.workers is not None:
            raise SettingError("--workers are those on this machine; a scheduler has its own: give one of the two")
        return self.workers if self.scheduler is None else self.scheduler

    def started_workers(self) -> str | int | None:
        """`chosen_workers`; those on this machine begin to start, while this process reads and checks what there is to do."""
        from ..sweeps.workers import prepare_workers

        workers = self.chosen_workers()
        if not isinstance(workers, str):
            prepare_workers()
        return workers
