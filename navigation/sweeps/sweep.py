"""Running a sweep: on the cores of this machine or on any Dask cluster, and going on where an earlier one stopped."""

import logging
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from pathlib import Path
from typing import Any

import dask.config
import numpy as np
import pandas as pd
from dask.base import tokenize
from distributed import CancelledError, Client, Future, LocalCluster, as_completed
from distributed.comm.core import CommClosedError

from tussock.render.cores import core_count
from tussock.render.eye import Eye
from tussock.world.errors import InputError, MissingDependencyError, first_line
from tussock.world.progress import Progress, printed

from ..experiment import Experiment
from ..experiment_keys import Keys
from ..experiment_settings import TYPES, run_command, settings_of
from . import work
from .recordings import record_again, recording_folder, recordings_in, worst_of
from .spec import Sweep
from .store import TABLE, Finished, Store, write_table, write_title
from .work import Walked, draw, learn, walk
from .workers import METHOD, WORK, prepare_workers, script_left_out

log = logging.getLogger(__name__)

MAX_TOGETHER = 16  # runs: more gain little, and are kept later ..
MAX_SMALL_TOGETHER, SMALL = (
    64,
    10_000,
)  # .. but for views of few rays, where what a look costs beside drawing is worth sharing
PARTS = 3  # groups of runs for each worker, where there are few runs
QUEUED = 4  # groups that each worker has before it; more would only fill the scheduler's memory
SECONDS = 10.0  # to wait for a scheduler
LOCAL: dict[str, Any] = {  # options of the workers on this machine, which nobody else can reach
    "threads_per_worker": 1,
    "memory_limit": None,
    "silence_logs": logging.CRITICAL,
    "preload": [WORK],
    "host": "127.0.0.1",
    **dict.fromkeys(("dashboard_address", "worker_dashboard_address"), "127.0.0.1:0"),
}


def run_sweep(
    sweep: Sweep, out: Path, *, workers: str | int | None = None, progress: Progress | None = None
) -> dict[str, Any]:
    """Do the runs of a sweep that the folder does not hold yet, keeping each as soon as it is finished.

    Args:
        sweep: What is asked for.
        out: The folder.
        workers: Address of a running Dask scheduler, whose workers do the runs; or the number of workers that are started on this
            machine, for this sweep alone; None means one for each core.
        progress: Called with how many runs are finished, of how many; None prints a line where it takes long, `no_progress` none.

    Returns:
        What `tussock sweep --json` prints.

    Raises:
        InputError: Where another sweep writes to the folder, and where runs could not be finished; all others are kept.
    """
    progress = printed(progress, "walking", "runs")
    began = time.perf_counter()
    runs = _by_key(sweep)
    with Store(out) as store:
        store.check_settings(TYPES)
        write_title(sweep.title, out)
        finished = store.finished()
        missing = {key: run for key, run in runs.items() if key not in finished}
        progress(len(runs) - len(missing), len(runs))
        try:
            if missing:
                before = len(runs) - len(missing)
                _run(missing, sweep.columns, store, workers, lambda done: progress(before + done, len(runs)))
        except BaseException:
            with suppress(InputError):  # what ended the sweep matters more, a full disk above all
                _write_table(store, out)
            raise
        table = _write_table(store, out)
    table = table[table["key"].isin(runs)]
    if len(failed := table["error"].dropna()):
        log.warning("%d runs could not be made; the first: %s", len(failed), failed.iloc[0])
    return {
        "table": str(out / TABLE),
        "runs": len(runs),
        "done_before": len(runs) - len(missing),
        "arrived": int(table["arrived"].sum()) if "arrived" in table else 0,
        "could_not_run": int(table["error"].notna().sum()),
        "seconds": time.perf_counter() - began,
    }


def record_worst(sweep: Sweep, out: Path, count: int) -> list[Path]:
    """Keep recordings of the worst runs of a finished sweep; returns their folders. Raises InputError as `record_again` does."""
    runs = _by_key(sweep)
    with Store(out) as store:
        table = store.table()
        worst = worst_of(table[table["key"].isin(runs)], count)
        there = recordings_in(out)
        folders = {
            key: (out / there[key]).parent if key in there else out / recording_folder(key, store.row(key)["model"])
            for key in worst
        }
        try:
            for key, folder in folders.items():
                record_again(runs[key], store.row(key), folder)
        finally:
            _write_table(store, out)
    return list(folders.values())


def _by_key(sweep: Sweep) -> dict[str, Experiment]:
    keys = Keys()
    return {keys.run(run): run for run in sweep.experiments}


def _run(
    missing: dict[str, Experiment],
    columns: Sequence[str] | None,
    store: Store,
    workers: str | int | None,
    progress: Callable[[int], object],
) -> None:
    """Do runs on a cluster and keep their results, of the steps some columns. Raises InputError for those that could not be finished."""
    done, unfinished = 0, []
    with cluster(workers) as client:
        for batch in _finished(client, missing, columns):
            kept = []
            for key, result in batch:
                if isinstance(result, Walked | InputError):
                    kept.append(finished_run(missing[key], key, result))
                else:
                    unfinished.append((key, result))
            store.add(kept)
            done += len(kept)
            progress(done)
    if unfinished:
        key, error = unfinished[0]
        raise InputError(
            f"{len(unfinished)} of {len(missing)} runs could not be finished; all others are kept, and the same command tries again. "
            f"The first, {run_command(missing[key], f'run-{key}')}: {first_line(error)}"
        )


def _finished(
    client: Client, missing: dict[str, Experiment], columns: Sequence[str] | None
) -> Iterator[list[tuple[str, Walked | BaseException]]]:
    """The results of runs, or what went wrong, as they finish. Raises InputError where the cluster is lost."""
    waiting, tasks = as_completed(loop=client.loop, raise_errors=False), _tasks(client, missing, columns)
    futures: dict[Future, list[str]] = {}
    gone: Exception | None = None
    while gone is None:
        results = []
        try:
            for future, keys in islice(tasks, max(0, QUEUED * _workers(client) - len(futures))):
                futures[future] = keys
                waiting.add(future)
            if not futures:
                return
            for future in waiting.next_batch(block=True):
                error, keys = future.exception(), futures[future]
                results += zip(keys, [error] * len(keys) if error is not None else future.result(), strict=True)
                del futures[future]
                future.release()
        except (CancelledError, CommClosedError, OSError) as lost:
            gone = lost
        yield results
    raise MissingDependencyError(
        "the scheduler is gone; all runs that were finished are kept: give the same command again"
    ) from gone


def _tasks(
    client: Client, missing: dict[str, Experiment], columns: Sequence[str] | None
) -> Iterator[tuple[Future, list[str]]]:
    """Submit walks side by side, and what they need, as they are asked for; with the keys of their runs.

    Workers forget a world, views and a model when the last walk that needs them is done: this holds on to those of the last one only.
    """
    needs: dict[str, Future] = {}
    known = Keys()
    for number, keys in enumerate(side_by_side(missing, _workers(client))):
        runs = [missing[key] for key in keys]
        first, earlier, given = runs[0], needs, []
        needs = {}
        options = {"priority": -number}  # worlds are finished one after the other
        for key, step in zip(known.shared(first), (Experiment.open_world_and_route, draw, learn), strict=True):
            needs[key] = earlier.get(key) or client.submit(step, first, *given, key=key, **options)
            given = [needs[key]]
        yield client.submit(walk, runs, *given, columns, key=f"walks-{tokenize(*keys)}", **options), keys


def side_by_side(runs: dict[str, Experiment], workers: int) -> list[list[str]]:
    """Which runs walk together, as keys: runs of one model in one world, enough of them for all workers. One world after the other."""
    groups: dict[tuple[str, ...], list[str]] = {}
    first: dict[str, int] = {}  # when a world, views and a model are first needed
    keys = Keys()
    for key, run in runs.items():
        names = *keys.shared(run), _world_of_walk(run)
        groups.setdefault(names, []).append(key)
        for name in names:
            first.setdefault(name, len(first))
    enough, parts = math.ceil(len(runs) / (PARTS * workers)), []
    for _, group in sorted(groups.items(), key=lambda item: [first[name] for name in item[0]]):
        size = min(_most_together(runs[group[0]].eye), enough)
        parts += [part.tolist() for part in np.array_split(group, max(1, round(len(group) / size)))]
    return parts


def _world_of_walk(run: Experiment) -> str:
    """What the worlds of runs differ in that have learned in the same one."""
    change = run.test_change
    return "change-" + ("" if change is None else f"{change.text_in_files()} {run.seed} {run.change_seed}")


def _most_together(eye: Eye) -> int:
    """How many runs with an eye walk together."""
    return MAX_SMALL_TOGETHER if eye.width * eye.height * eye.rays**2 <= SMALL else MAX_TOGETHER


def _workers(client: Client) -> int:
    """How many tasks a cluster works on at once, at least 1; workers may join and leave."""
    return max(1, sum(client.nthreads().values()))


@contextmanager
def cluster(workers: str | int | None) -> Iterator[Client]:
    """A client of a running cluster, or of one that lives as long as the block, on this machine and for it alone."""
    with ExitStack() as stack:
        if isinstance(workers, str):
            scheduler = workers
        else:
            prepare_workers()
            stack.enter_context(script_left_out())
            stack.enter_context(dask.config.set({"distributed.worker.multiprocessing-method": METHOD}))
            try:
                local: Any = LocalCluster(n_workers=workers or core_count(), **LOCAL)
            except RuntimeError as error:
                raise MissingDependencyError(
                    f"the workers of this sweep did not start ({error}); if memory is short, give --workers 1"
                ) from error
            scheduler = stack.enter_context(local).scheduler_address
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # errors are reported in one line, below
        try:
            client = stack.enter_context(Client(scheduler, timeout=SECONDS, set_as_default=False))
        except (OSError, ValueError) as error:
            raise MissingDependencyError(
                f"no Dask scheduler answers at {scheduler}; start one with: dask scheduler --host 127.0.0.1"
            ) from error
        if not client.scheduler_info()["workers"]:
            log.info(f"no worker has joined yet; waiting for one: dask worker {scheduler} --nthreads 1")
        client.register_plugin(work.Registrations())
        yield client


def finished_run(experiment: Experiment, key: str, result: Walked | InputError) -> Finished:
    """A run as it is kept. One whose world or learning failed is tried again another time: what it lacked may be there then."""
    settings, command = settings_of(experiment), run_command(experiment, f"run-{key}")
    if isinstance(result, InputError):
        row = settings | {"error": str(result), "command": command}
        return Finished(key=key, settings=settings, row=row, steps="", again=True)
    times = {"seconds": result.seconds, "learn_seconds": result.learn_seconds} if result.refused is None else {}
    row = settings | result.results | {"error": result.refused, "command": command} | times
    return Finished(key=key, settings=settings, row=row, steps=result.steps)


def _write_table(store: Store, out: Path) -> pd.DataFrame:
    """Write the table of all finished runs. A column gives the path of the recording, if there is one."""
    table = store.table()
    if len(table):
        table["recording"] = table["key"].map(recordings_in(out)).astype("string")
    write_table(table, out)
    return table
