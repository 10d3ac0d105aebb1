"""The command of the test bed. Heavy packages are imported where they are used."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from tussock.world.errors import SettingError

from .command import WorkerOptions
from .terminal import message, progress


@dataclass
class BenchmarkCommand(WorkerOptions):
    """Enter models in the test bed: fixed worlds, routes, starts and noise, one result per model, and a leaderboard."""

    model: str | None = None
    """all, or names separated by commas (see tussock models), after which their parameters may follow."""
    out: Path = Path("benchmark")
    """Folder for the runs and, in its folder results, for the results; runs that are finished there are not done again."""
    encoding: str = "edges"
    """What the models get of a view: edges, grey or sky, or a chain of steps. The eye is the test bed's."""
    navigator: str = "scan"
    """What steers by the models, as in 'lateral gain=4'; another than scan is named in the result."""
    test_bed: Annotated[str, tyro.conf.arg(metavar="tussock-2|tussock-3")] = "tussock-2"
    """What is asked. tussock-3 also changes light, plants, wind, head, ground and eye: what does an entry survive?"""
    quick: bool = False
    """A first look: other, fewer runs, whose results compare with no others."""
    leaderboard: Path | None = None
    """Only print the table of the results in this folder, an --out or one of results alone."""

    def run(self) -> dict[str, Any]:
        from ..benchmark.leaderboard import leaderboard, read_results

        if (self.model is None) == (self.leaderboard is None):
            raise SettingError(
                "give --model NAME to enter a model, or --leaderboard DIR to see the results in a folder"
            )
        self.chosen_workers()  # refuses contradicting flags
        if self.leaderboard is not None:
            return {"table": leaderboard(read_results(self.leaderboard))}
        files = [str(path) for path in self._enter()]
        return {"results": files, "table": leaderboard(read_results(self.out))}

    def _enter(self) -> list[Path]:
        """Enter the models; the file of each."""
        workers = self.started_workers()
        from tussock.world.specs import split_list

        from ..benchmark.definition import benchmark_of
        from ..benchmark.models import enter_named
        from ..models import MODELS

        benchmark = benchmark_of(self.test_bed, quick=self.quick)
        names = list(MODELS.builtin) if self.model == "all" else split_list(self.model or "")
        message(f"{', '.join(dict.fromkeys(names))}: {len(benchmark)} runs of {benchmark.name} each")
        with progress("walking", "runs", verbose=True) as report:
            entered = enter_named(
                names,
                self.out,
                encoding=self.encoding,
                navigator=self.navigator,
                benchmark=benchmark,
                workers=workers,
                progress=report,
            )
        for result, _ in entered:
            errors = [run.error for run in result.runs if run.error is not None]
            if errors:
                message(
                    f"{result.entry}: {len(errors)} of {len(benchmark)} runs could not be done; the first: {errors[0]}"
                )
        return [path for _, path in entered]
