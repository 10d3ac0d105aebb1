"""Entering learning agents: the runs of the test bed in the Gymnasium environment. Needs Gymnasium, which is an extra."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from tussock.world.errors import SettingError
from tussock.world.progress import Progress, printed

from ..experiment import Experiment
from ..rl.environment import RouteFollowing
from .definition import BENCHMARK, ENCODING, Benchmark
from .results import PANORAMA, Result, check_free, result_of, write_result

Act = Callable[[np.ndarray, int], np.ndarray]  # observation, number of the look from 0 on -> action


@dataclass(frozen=True, kw_only=True)
class Task:
    """A run for a learner: `RouteFollowing(**settings)`, then `reset(**reset)`.

    Attributes:
        run: The run.
        settings: What the environment is made with; tasks of one world and noise share them, and so can one environment.
        reset: What it is reset with.
    """

    run: Experiment
    settings: dict[str, Any]
    reset: dict[str, Any]


def tasks(benchmark: Benchmark = BENCHMARK, encoding: str | None = ENCODING) -> Iterator[Task]:
    """All runs of the test bed, those of one world, and of one noise there, together.

    Args:
        benchmark: What is asked.
        encoding: What the learner gets of a view; None is the panorama itself.
    """
    _check_has_no_conditions(benchmark)
    for runs in benchmark.by_world(encoding or ENCODING):
        yield from _tasks_of(runs, encoded=encoding is not None)


def enter_learner(
    learn: Callable[[RouteFollowing], Act],
    name: str,
    out: Path,
    *,
    encoding: str | None = ENCODING,
    benchmark: Benchmark = BENCHMARK,
    progress: Progress | None = None,
) -> tuple[Result, Path]:
    """Enter a learner.

    Args:
        learn: Called for each world with an environment there that is reset; `env.training_views()` is what it may learn from. It
            returns act(observation, look), which gives the action after each look; look 0 is the first of a walk.
        name: Of the entry.
        out: The result is written to `out`/results.
        encoding: What the learner gets of a view; None is the panorama itself.
        benchmark: What is asked.
        progress: Called with how many runs are finished, of how many; None prints a line where it takes long, `no_progress` none.

    Returns:
        The result and its file.

    Raises:
        InputError: As `enter_named` does.
    """
    progress = printed(progress, "walking", "runs")
    results: list[dict[str, Any]] = []
    _check_has_no_conditions(benchmark)
    chain = PANORAMA if encoding is None else benchmark.chain(encoding)
    check_free(out, benchmark, name, chain)
    for runs in benchmark.by_world(encoding or ENCODING):
        act: Act | None = None
        learned = 0.0
        for _, group in groupby(_tasks_of(runs, encoded=encoding is not None), key=lambda task: id(task.settings)):
            here = list(group)
            with closing(RouteFollowing(**here[0].settings)) as env:
                if act is None:
                    env.reset(**here[0].reset)
                    began = time.perf_counter()
                    act = learn(env)
                    learned = time.perf_counter() - began
                for task in here:
                    began = time.perf_counter()
                    walked = walk(env, task, act)
                    results.append(walked | {"seconds": time.perf_counter() - began, "learn_seconds": learned})
                    progress(len(results), len(benchmark))
    result = result_of(benchmark, name, chain, results)
    return result, write_result(result, out, benchmark)


def walk(env: RouteFollowing, task: Task, act: Act) -> dict[str, Any]:
    """Do a run; its results, by name."""
    observation, info = env.reset(**task.reset)
    deviation = [info["deviation_m"]]
    while info["reason"] is None:
        observation, _, _, _, info = env.step(act(observation, len(deviation) - 1))
        deviation.append(info["deviation_m"])
    return {
        "arrived": info["is_success"],
        "reason": info["reason"],
        "steps": len(deviation) - 1,
        "mean_deviation_m": float(np.mean(deviation)),
        "max_deviation_m": max(deviation),
    }


def _check_has_no_conditions(benchmark: Benchmark) -> None:
    """Refuse a benchmark that the Gymnasium task cannot do. Raises SettingError."""
    if benchmark.conditions:
        raise SettingError(
            f"{benchmark.name} changes worlds after learning, and the Gymnasium task does not; enter {BENCHMARK.name}"
        )


def _tasks_of(runs: list[Experiment], *, encoded: bool) -> list[Task]:
    """The tasks of the runs in one world. Those of one noise share their settings."""
    world, route = runs[0].open_world_and_route()
    shared: dict[float, dict[str, Any]] = {}
    for run in runs:
        shared.setdefault(
            run.body.heading_noise,
            {
                "world": world,
                "route": route,
                "eye": run.eye,
                "renderer": run.renderer,
                "encoding": run.encoding if encoded else None,
                "offset": max(abs(each.start_offset) for each in runs),
                "heading_noise": run.body.heading_noise,
                "step_length": run.body.step_length,
                "arrive": run.stopping.arrival_radius,
                "lost": run.stopping.max_deviation,
                "patience": run.stopping.patience,
                "max_steps": run.stopping.max_steps,
            },
        )
    return [
        Task(
            run=run,
            settings=shared[run.body.heading_noise],
            reset={"seed": run.seed, "options": {"start": tuple(run.start(route))}},
        )
        for run in runs
    ]
