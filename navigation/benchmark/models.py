"""Entering familiarity models: those with a name by it, any other from Python."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from tussock.world.errors import InputError, SettingError
from tussock.world.progress import Progress, printed

from ..experiment_fields import MODEL_SUFFIX
from ..experiment_keys import key_of
from ..models import model_spec
from ..models.base import FamiliarityModel
from ..steering import NAVIGATORS
from ..sweeps.spec import Sweep
from ..sweeps.store import Store
from ..sweeps.sweep import run_sweep
from ..sweeps.work import draw, learn, walk
from .definition import BENCHMARK, ENCODING, NAVIGATOR, Benchmark
from .results import Result, check_free, result_of, write_result


def enter_named(
    names: Sequence[str],
    out: Path,
    *,
    encoding: str = ENCODING,
    navigator: str = NAVIGATOR,
    benchmark: Benchmark = BENCHMARK,
    workers: str | int | None = None,
    progress: Progress | None = None,
) -> list[tuple[Result, Path]]:
    """Enter models by their specs.

    Args:
        names: For example "mushroom-body inputs=10", or "package.module:Class".
        out: Folder for the runs, which are kept as a sweep keeps them, and for the results, in `out`/results.
        encoding: What the models get of a view.
        navigator: What steers by them; one other than a scan is part of the entry's name.
        benchmark: What is asked.
        workers: See `run_sweep`.
        progress: Called with how many runs are finished, of how many; None prints a line where it takes long, `no_progress` none.

    Returns:
        For each model the result and its file.

    Raises:
        InputError: Where there is a result of another version, or of another entry under the same name.
    """
    progress = printed(progress, "walking", "runs")
    chain = benchmark.chain(encoding)
    models = list(dict.fromkeys(map(checked_entry, names)))
    steers = str(NAVIGATORS.spec(navigator))
    entries = {model if steers == NAVIGATOR else f"{model}, {steers}": model for model in models}
    for entry in entries:
        check_free(out, benchmark, entry, chain)
    sweeps = {entry: benchmark.sweep(model, encoding, steers) for entry, model in entries.items()}
    runs = [run for sweep in sweeps.values() for run in sweep.experiments]
    try:
        run_sweep(Sweep(benchmark.name, {"model": models}, runs), out, workers=workers, progress=progress)
    except InputError:
        with suppress(InputError):  # what ended the sweep matters more
            _results(sweeps, out, benchmark, chain)  # of the entries that are complete
        raise
    return _results(sweeps, out, benchmark, chain)


def _results(sweeps: Mapping[str, Sweep], out: Path, benchmark: Benchmark, chain: str) -> list[tuple[Result, Path]]:
    """Write the results of those entries of which all runs are finished."""
    with Store(out, read_only=True) as store:
        kept = store.rows()
    results = []
    for entry, sweep in sweeps.items():
        rows = [kept[key] for run in sweep.experiments if (key := key_of(run)) in kept]
        if len(rows) == len(sweep):
            result = result_of(benchmark, entry, chain, rows)
            results.append((result, write_result(result, out, benchmark)))
    return results


def checked_entry(name: str) -> str:
    """The spec of a model without what is as by default. Raises SettingError for an invalid one, and for a trained one."""
    if name.endswith(MODEL_SUFFIX):
        raise SettingError(
            f"{name}: the test bed trains a model on each world's route; give a model's name (see tussock models)"
        )
    spec = model_spec(name)
    spec.make()  # refuses bad parameters
    return str(spec)


def enter(
    make: Callable[[int], FamiliarityModel],
    name: str,
    out: Path,
    *,
    encoding: str = ENCODING,
    benchmark: Benchmark = BENCHMARK,
    progress: Progress | None = None,
) -> tuple[Result, Path]:
    """Enter any familiarity model from Python. The runs of a world walk side by side in this process, on one thread of torch.

    Args:
        make: Gives a new, untrained model; called for each world with its seed.
        name: Of the entry.
        out: The result is written to `out`/results.
        encoding: What the model gets of a view.
        benchmark: What is asked.
        progress: Called with how many runs are finished, of how many; None prints a line where it takes long, `no_progress` none.

    Returns:
        The result and its file.

    Raises:
        InputError: As `enter_named` does.
    """
    progress = printed(progress, "walking", "runs")
    results: list[dict[str, Any]] = []
    chain = benchmark.chain(encoding)
    check_free(out, benchmark, name, chain)
    for runs in benchmark.by_world(encoding):
        drawn = draw(runs[0], runs[0].open_world_and_route())
        with drawn.renderer:
            for walked in walk(runs, learn(runs[0], drawn, make(runs[0].seed))):
                if isinstance(walked, Exception):
                    raise walked
                times = {"seconds": walked.seconds, "learn_seconds": walked.learn_seconds}
                results.append(walked.results | times | {"error": walked.refused})
        progress(len(results), len(benchmark))
    result = result_of(benchmark, name, chain, results)
    return result, write_result(result, out, benchmark)
