"""The commands for many runs. Heavy packages are imported where they are used."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from tussock.world.errors import SettingError

from .command import Command, WorkerOptions
from .options import import_used
from .terminal import message, progress


@dataclass
class SweepCommand(WorkerOptions):
    """Do every run that a sweep file asks for: models, worlds, starts, noise, in all combinations."""

    sweep: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="SWEEP.toml")]
    """What to vary and what not (docs/sweeps.md)."""
    out: Path = Path("sweep")
    """Folder for the table of runs; runs that are finished there are not done again."""
    record: Annotated[str | None, tyro.conf.arg(metavar="worst:N")] = None
    """Keep recordings of the N worst runs."""
    use: str = ""
    """Classes of your own that files of models need, as package.module:Class; several with commas between them."""

    def run(self) -> dict[str, Any]:
        record = re.fullmatch(r"worst:(\d{1,6})", self.record or "worst:0")
        if record is None:
            raise SettingError(f"--record {self.record!r}: give worst:5, or another number")
        workers = self.started_workers()
        from ..sweeps.sweep_file import read_sweep

        import_used(self.use)
        sweep = read_sweep(self.sweep)

        from ..sweeps.sweep import record_worst, run_sweep

        message(f"{len(sweep)} runs: {sweep}")
        with progress("walking", "runs", verbose=True) as report:
            done = run_sweep(sweep, self.out, workers=workers, progress=report)
        recorded = record_worst(sweep, self.out, int(record[1])) if self.record else []
        return done | {"recordings": [str(folder) for folder in recorded]}


@dataclass
class ReportCommand(Command):
    """Report the results of a sweep: a page with success and error by each axis, models in pairs, and the worst walks."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(name="dir", metavar="DIR")]
    """Folder of the sweep; it may still go on."""
    worst: int = 5
    """How many of the worst walks to show."""

    def run(self) -> dict[str, Any]:
        from ..sweeps.report import REPORT, RESULTS, write_sweep_report

        if self.worst < 0:
            raise SettingError(f"--worst {self.worst}: give 0 or more")
        with progress("drawing", "figures") as report:
            results = write_sweep_report(self.folder, worst=self.worst, progress=report)
        return {
            "report": str(self.folder / REPORT),
            "results": str(self.folder / RESULTS),
            "runs": results["runs"],
            "worlds": results["worlds"],
            "could_not_run": len(results["could_not_run"]),
            **{measure: found["value"] for measure, found in results["measures"].items()},
        }
