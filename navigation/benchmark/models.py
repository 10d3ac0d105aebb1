"""Entering familiarity models: those of this project by their spelling, any other from Python."""

from collections.abc import Callable
from pathlib import Path

from tussock.world.errors import InputError

from ..cli.run_options import FILE_SUFFIX
from ..models import make_model
from ..models.base import FamiliarityModel
from ..sweeps.store import Store
from ..sweeps.sweep import run_sweep
from ..sweeps.work import run_key, teach, walk
from .definition import BENCHMARK, ENCODING, Benchmark
from .results import Result, check_free, line_of, result_of, write_result


def enter_named(
    name: str, out: Path, *, encoding: str = ENCODING, benchmark: Benchmark = BENCHMARK, scheduler: str | None = None,
    workers: int | None = None, progress: Callable[[int, int], object] = lambda done, total: None,
) -> tuple[Result, Path]:  # fmt: skip
    """Enter a model by its spelling: "mushroom-body inputs=10"; returns the result and its file, in `out`/results.

    Runs that are finished are kept in `out`, as a sweep keeps them, and not done again. scheduler, workers: see `run_sweep`.
    Raises InputError where there is a result of another version, or of another entry under the same name.
    """
    entry = checked_entry(name)
    sweep = benchmark.sweep(entry, encoding)
    runs = list(sweep.runs())
    runs[0].check()
    chain = benchmark.chain(encoding)
    check_free(out, benchmark, entry, chain)
    run_sweep(sweep, out, scheduler=scheduler, workers=workers, progress=progress)
    with Store(out, read_only=True) as store:
        kept = store.rows()
    rows = [kept[run_key(run)] for run in runs]
    done = [row for row in rows if row["error"] is None]
    result = result_of(
        benchmark, entry, chain, [line_of(run, row) for run, row in zip(runs, rows, strict=True)],
        memory_bytes=[row["memory_bytes"] for row in done], learn_seconds=[row["learn_seconds"] for row in done],
        walk_seconds=[row["seconds"] for row in done],
    )  # fmt: skip
    return result, write_result(result, out, benchmark)


def checked_entry(name: str) -> str:
    """How a model is spelled, without what is as by default. Raises InputError for what is none, and for a trained one."""
    if name.endswith(FILE_SUFFIX):
        raise InputError(
            f"{name}: the test bed teaches each world's route anew; give a model's name (see tussock models)"
        )
    return str(make_model(name))


def enter(
    make: Callable[[int], FamiliarityModel], name: str, out: Path, *, encoding: str = ENCODING,
    benchmark: Benchmark = BENCHMARK, progress: Callable[[int, int], object] = lambda done, total: None,
) -> tuple[Result, Path]:  # fmt: skip
    """Enter any familiarity model, under a name; returns the result and its file, in `out`/results.

    make(seed): a new, untrained model, called for each world with its seed. Runs follow one another in this process, on one thread
    of torch's. progress(done, total): runs. Raises InputError as `enter_named` does, and what the model raises.
    """
    lines, sizes, learn_seconds, walk_seconds = [], [], [], []
    chain = benchmark.chain(encoding)
    check_free(out, benchmark, name, chain)
    for runs in benchmark.by_world(encoding):
        taught = teach(runs[0], runs[0].open_route(), make(runs[0].seed))
        learn_seconds.append(taught.seconds)
        with taught.renderer:
            for run in runs:
                walked = walk(run, taught)
                lines.append(line_of(run, walked.found))
                sizes.append(walked.found["memory_bytes"])
                walk_seconds.append(walked.seconds)
                progress(len(lines), len(benchmark))
    result = result_of(
        benchmark, name, chain, lines, memory_bytes=sizes, learn_seconds=learn_seconds, walk_seconds=walk_seconds
    )
    return result, write_result(result, out, benchmark)
