"""What a sweep of very many runs costs apart from the walks: python benchmarks/scale.py FOLDER --runs 100000

Fills the folder with made-up results, as large as real ones, and measures each step in a process of its own.
"""

import argparse
import json
import multiprocessing
import resource
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from tussock.navigation.experiment_keys import Keys
from tussock.navigation.failures import Cause
from tussock.navigation.sweeps.report import write_sweep_report
from tussock.navigation.sweeps.store import Store
from tussock.navigation.sweeps.sweep import finished_run, run_sweep, side_by_side
from tussock.navigation.sweeps.sweep_file import read_sweep
from tussock.navigation.sweeps.work import Walked
from tussock.navigation.trajectory import COLUMNS

MODELS = ("perfect-memory", "infomax", "mushroom-body inputs=10", "mushroom-body inputs=20")
OFFSETS, NOISES = 10, 5
PER_WORLD = len(MODELS) * OFFSETS * NOISES
TOGETHER = 16  # runs that a worker finishes at once
STEPS = 158  # of a walk of 8 m


def sweep_file(folder: Path, runs: int) -> Path:
    """A sweep file that asks for about that number of runs: models, worlds, starts and noise."""
    path = folder / "sweep.toml"
    path.write_text(
        f"[axes]\nmodel = {json.dumps(MODELS)}\nworld-seed = {{ from = 1, to = {max(1, round(runs / PER_WORLD))} }}\n"
        f"offset-m = {{ from = -0.2, to = 0.2, count = {OFFSETS} }}\n"
        f"heading-noise-deg = {{ from = 0, to = 20, count = {NOISES} }}\n"
    )
    return path


def steps_text(rng: np.random.Generator) -> str:
    """Steps as CSV, as long as those of a walk."""
    lines = [",".join(COLUMNS)]
    x, y = 2 + np.cumsum(rng.normal(0.02, 0.01, (STEPS, 2)), axis=0).T
    for k in range(STEPS):
        numbers = [x[k], y[k], 0.0, *rng.uniform(-180, 180, 2), *rng.random(3), rng.normal(0, 20)]
        lines.append(",".join([str(k), *map(repr, map(float, numbers)), str(k), *[""] * (len(COLUMNS) - 11)]))
    return "\n".join(lines) + "\n"


def made_up(rng: np.random.Generator) -> dict[str, Any]:
    """The results of a walk, by name."""
    arrived, poor, causes = bool(rng.random() < 0.7), int(rng.integers(0, 9)), list(Cause)
    cause = None if arrived else str(causes[rng.integers(len(causes))])
    return {
        "arrived": arrived, "reason": "arrived" if arrived else "lost", "steps": STEPS - 1,
        "mean_deviation_m": float(rng.gamma(2, 0.05)), "max_deviation_m": float(rng.gamma(2, 0.1)),
        "mean_error_deg": float(rng.gamma(2, 6)), "resets": 0, "cause": cause, "poor_steps": poor,
        "looks_per_m": 1220.0, "touches": 0, "inward": 0.5, "outward": 0.25, "goal_m": 0.14, "recovered": None,
        "max_view_distance_m": None, "n_views": 1400, "route_m": 7.999738810199725, "memory_bytes": 16800000,
        **{f"{each.replace(' ', '_')}_steps": poor if each == cause else 0 for each in causes},
    }  # fmt: skip


def fill(path: Path, out: Path, runs: int) -> None:
    """Keep made-up results of the first runs that a sweep file asks for, as a sweep keeps them."""
    rng = np.random.default_rng(0)
    steps = [steps_text(rng) for _ in range(20)]
    keys, experiments = Keys(), islice(read_sweep(path).experiments, runs)
    with Store(out) as store:
        while part := list(islice(experiments, TOGETHER)):
            walked = [
                Walked(results=made_up(rng), steps=steps[rng.integers(20)], seconds=2.0, learn_seconds=4.0)
                for _ in part
            ]
            store.add(finished_run(run, keys.run(run), each) for run, each in zip(part, walked, strict=True))


def read(path: Path, out: Path) -> None:
    read_sweep(path)


def keys(path: Path, out: Path) -> None:
    made = Keys()
    for run in read_sweep(path).experiments:
        made.run(run)


def group(path: Path, out: Path) -> None:
    runs = {str(number): run for number, run in enumerate(read_sweep(path).experiments)}
    side_by_side(runs, 2)


def restart(path: Path, out: Path) -> None:
    run_sweep(read_sweep(path), out)


def report(path: Path, out: Path) -> None:
    write_sweep_report(out)


STAGES = {
    "read the sweep file": read,
    "and compute keys": keys,
    "and group what walks together": group,
    "the same command again": restart,
    "report": report,
}


def measured(stage: Callable[..., None], *arguments: Any) -> tuple[float, float, float]:
    """Seconds, seconds of the processor, and peak memory (MB) of a stage; for a process that does nothing else."""
    before, began, used = peak(), time.perf_counter(), time.process_time()
    stage(*arguments)
    return time.perf_counter() - began, time.process_time() - used, peak() - before


def peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measurements(stages: dict[str, tuple]) -> Iterator[tuple[str, float, float, float]]:
    """What `measured` gives for each stage and its arguments."""
    for name, arguments in stages.items():
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
            yield name, *process.submit(measured, *arguments).result()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--runs", type=int, default=100_000)
    parser.add_argument(
        "--only", default="", help="stages, by the first words of their names, with commas between them"
    )
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    path, out = sweep_file(options.folder, options.runs), options.folder / "out"
    stages = {name: (stage, path, out) for name, stage in STAGES.items()}
    if not out.exists():
        stages = {"keep the runs": (fill, path, out, options.runs)} | stages
    chosen = tuple(options.only.split(","))
    for name, wall, cpu, memory in measurements({n: each for n, each in stages.items() if n.startswith(chosen)}):
        print(f"{name:32} {wall:8.1f} s {cpu:8.1f} s CPU {memory:8.0f} MB", flush=True)


if __name__ == "__main__":
    main()
