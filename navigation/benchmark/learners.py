"""Entering learning agents: the runs of the test bed in the Gymnasium environment. Needs Gymnasium, which is an extra."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from ..cli.run_options import RunOptions
from ..rl.environment import RouteFollowing
from .definition import BENCHMARK, ENCODING, Benchmark
from .results import Line, Result, check_free, line_of, result_of, write_result

PANORAMA = "panorama"  # the encoding of entries that see the view as it is
Act = Callable[[np.ndarray, int], np.ndarray]  # observation, number of the look from 0 on -> action


@dataclass(frozen=True, kw_only=True)
class Task:
    """A run for a learner: what the environment is made with, and what it is reset with.

    `RouteFollowing(**settings)`, then `reset(**reset)`. Tasks of one world and noise share one `settings`, and so can one environment.
    """

    run: RunOptions
    settings: dict[str, Any]
    reset: dict[str, Any]


def tasks(benchmark: Benchmark = BENCHMARK, encoding: str | None = ENCODING) -> Iterator[Task]:
    """All runs of the test bed, those of one world, and of one noise there, together. encoding: None leaves the panorama as it is."""
    for runs in benchmark.by_world(encoding or ENCODING):
        yield from _tasks_of(runs, encoded=encoding is not None)


def enter_learner(
    learn: Callable[[RouteFollowing], Act], name: str, out: Path, *, encoding: str | None = ENCODING,
    benchmark: Benchmark = BENCHMARK, progress: Callable[[int, int], object] = lambda done, total: None,
) -> tuple[Result, Path]:  # fmt: skip
    """Enter a learner, under a name; returns the result and its file, in `out`/results.

    learn(env): called for each world with an environment there that is reset; what it may learn from is `env.training_views()`. It
    returns act(observation, look), which gives the action after each look; look 0 is the first of a walk. Raises InputError as
    `enter_named` does.
    """
    lines: list[Line] = []
    learn_seconds, walk_seconds = [], []
    chain = PANORAMA if encoding is None else benchmark.chain(encoding)
    check_free(out, benchmark, name, chain)
    for runs in benchmark.by_world(encoding or ENCODING):
        act: Act | None = None
        for _, group in groupby(_tasks_of(runs, encoded=encoding is not None), key=lambda task: id(task.settings)):
            here = list(group)
            with closing(RouteFollowing(**here[0].settings)) as env:
                if act is None:
                    env.reset(**here[0].reset)
                    began = time.perf_counter()
                    act = learn(env)
                    learn_seconds.append(time.perf_counter() - began)
                for task in here:
                    began = time.perf_counter()
                    lines.append(line_of(task.run, walk(env, task, act)))
                    walk_seconds.append(time.perf_counter() - began)
                    progress(len(lines), len(benchmark))
    result = result_of(
        benchmark, name, chain, lines, memory_bytes=[], learn_seconds=learn_seconds, walk_seconds=walk_seconds
    )
    return result, write_result(result, out, benchmark)


def walk(env: RouteFollowing, task: Task, act: Act) -> dict[str, Any]:
    """Do a run; what was found, by name."""
    observation, info = env.reset(**task.reset)
    deviation = [info["deviation_m"]]
    while info["reason"] is None:
        observation, _, _, _, info = env.step(act(observation, len(deviation) - 1))
        deviation.append(info["deviation_m"])
    return {
        "arrived": info["is_success"], "reason": info["reason"], "steps": len(deviation) - 1,
        "mean_deviation_m": float(np.mean(deviation)), "max_deviation_m": max(deviation),
    }  # fmt: skip


def _tasks_of(runs: list[RunOptions], *, encoded: bool) -> list[Task]:
    """The tasks of the runs in one world. Those of one noise have one `settings`."""
    world, route = runs[0].open_route()
    made: dict[float, dict[str, Any]] = {}
    for run in runs:
        agent = run.agent_settings()
        made.setdefault(run.heading_noise_deg, {
            "world": world, "route": route, "eye": run.eye(), "renderer": run.renderer,
            "encoding": run.chosen_encoding() if encoded else None, "offset": max(abs(each.offset_m) for each in runs),
            "heading_noise": agent.heading_noise, "step_length": agent.step_length, "arrive": agent.arrive, "lost": agent.lost,
            "patience": agent.patience, "max_steps": agent.max_steps,
        })  # fmt: skip
    starts = [tuple(route.start.moved(0.0, run.offset_m)) for run in runs]
    return [
        Task(run=run, settings=made[run.heading_noise_deg], reset={"seed": run.seed, "options": {"start": start}})
        for run, start in zip(runs, starts, strict=True)
    ]
