"""The parts of runs as the workers of a sweep do them: open the world, draw the training views, learn, walk."""

import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from distributed import WorkerPlugin

from tussock.render.renderer import Renderer
from tussock.world.errors import InputError, first_line
from tussock.world.geometry import Route
from tussock.world.scene import World
from tussock.world.specs import Spec

from ..changed_world import in_changed_world
from ..experiment import Experiment, TrainedNavigator, steps_of
from ..failures import Cause
from ..registry import registry
from ..threads import threads
from ..trajectory import Trajectory

if TYPE_CHECKING:
    from ..training import TrainingViews


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """What is ready when models begin to learn, for all that learn the same views.

    Attributes:
        renderer: Of the world.
        route: Through it.
        views: The training views; None where models come from files.
        seconds: That drawing them took.
    """

    renderer: Renderer
    route: Route
    views: "TrainingViews | None"
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Walked:
    """The results of a run.

    Attributes:
        refused: Why the walk has no valid start, where it has none; then there are no results, and never will be.
        results: By name.
        steps: The trajectory as CSV.
        seconds: Of the walk; of walks side by side, each has a share by its steps.
        learn_seconds: Of the learning before it, as if it had been for this run alone.
    """

    refused: str | None = None
    results: dict[str, Any]
    steps: str
    seconds: float
    learn_seconds: float


class Registrations(WorkerPlugin):
    """Makes what this process has registered known to every worker, also to those that join later."""

    def __init__(self) -> None:
        self.registered = {
            group: registry(group).registered for group in ("models", "encodings", "navigators", "worlds", "changes")
        }

    def setup(self, worker: Any) -> None:
        for group, targets in self.registered.items():
            for name, target in targets.items():
                registry(group).register(name, target)


def dask_setup(worker: Any) -> None:
    """Called by Dask in each worker that a sweep starts. Ctrl-C in a terminal reaches all processes; the sweep ends these."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def draw(experiment: Experiment, path: tuple[World, Route]) -> Drawn:
    """The views that an experiment learns."""
    began, (world, route) = time.perf_counter(), path
    renderer = experiment.open_renderer(world)
    with threads(experiment.threads):
        views = experiment.training_views(renderer, route) if isinstance(experiment.model, Spec) else None
    return Drawn(renderer=renderer, route=route, views=views, seconds=time.perf_counter() - began)


def learn(experiment: Experiment, drawn: Drawn, model: Any = None) -> TrainedNavigator:
    """What the navigator of an experiment learns before the walk; see `Experiment.train` for the model."""
    trained = experiment.train(drawn.renderer, drawn.route, model=model, views=drawn.views)
    return replace(trained, seconds=drawn.seconds + trained.seconds)


def walk(
    experiments: Sequence[Experiment], trained: TrainedNavigator, columns: Sequence[str] | None = None
) -> list[Walked | Exception]:
    """Walk side by side, as experiments that have learned the same say.

    Args:
        experiments: One for each walk; the world has the same changes for all of them.
        trained: What they have learned.
        columns: See `Sweep.columns`.

    Returns:
        The results of each run, or its error.
    """
    try:
        with in_changed_world(experiments[0], trained) as there:
            return _walk(experiments, there, columns)
    except Exception as error:
        if len(experiments) > 1:  # one of them is in the way of the others
            return [result for each in experiments for result in walk([each], trained, columns)]
        if isinstance(error, InputError):
            return [error]
        told = RuntimeError(first_line(error))
        told.__cause__ = error  # lost on the way from a worker, which need not know how to send it
        return [told]


def _walk(
    experiments: Sequence[Experiment], trained: TrainedNavigator, columns: Sequence[str] | None
) -> list[Walked | Exception]:
    began = time.perf_counter()
    refused = {k: refusal for k, each in enumerate(experiments) if (refusal := _refusal(each, trained))}
    walking = [k for k in range(len(experiments)) if k not in refused]
    trajectories = [Trajectory() for _ in experiments]
    diagnosed = columns is None or "cause" in columns
    for steps in steps_of([experiments[k] for k in walking], trained, diagnosed=diagnosed) if walking else ():
        for k, step in zip(walking, steps, strict=True):
            if step is not None:
                trajectories[k].add(*step)
    per_step = (time.perf_counter() - began) / max(1, sum(map(len, trajectories)))
    return [
        Walked(
            refused=refused.get(k),
            results={} if k in refused else _results(trajectory, trained),
            steps="" if k in refused else trajectory.to_csv(columns),
            seconds=per_step * len(trajectory),
            learn_seconds=trained.seconds,
        )
        for k, trajectory in enumerate(trajectories)
    ]


def _refusal(experiment: Experiment, trained: TrainedNavigator) -> str | None:
    """Why a walk cannot start; None where it can."""
    try:
        experiment.walk(trained.renderer, trained.route)
    except InputError as error:
        return str(error)
    return None


def _results(trajectory: Trajectory, trained: TrainedNavigator) -> dict[str, Any]:
    """The results of a walk, by name."""
    summary = trajectory.summary()
    causes = summary.pop("causes")
    return summary | {
        "n_views": None if trained.poses is None else len(trained.poses),
        "route_m": trained.route.length,
        "memory_bytes": trained.memory_bytes,
        **{f"{cause.replace(' ', '_')}_steps": causes.get(cause, 0) for cause in Cause},
    }
