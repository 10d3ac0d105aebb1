"""The parts of a run as the workers of a sweep do them: open the world, learn, walk."""

import signal
import time
from dataclasses import dataclass
from typing import Any

from distributed import WorkerPlugin

from tussock.world.errors import InputError
from tussock.world.geometry import Route
from tussock.world.scene import World

from ..experiment import Experiment, TrainedNavigator
from ..failures import Cause
from ..models.base import memory_bytes
from ..registry import registry
from ..trajectory import Trajectory


@dataclass(frozen=True, kw_only=True)
class Walked:
    """The results of a run.

    Attributes:
        refused: Why the walk has no valid start, where it has none; then there are no results, and never will be.
        results: By name.
        steps: The trajectory as CSV.
        seconds: Of the walk.
        learn_seconds: Of the learning before it.
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
            group: registry(group).registered for group in ("models", "encodings", "navigators", "worlds")
        }

    def setup(self, worker: Any) -> None:
        for group, targets in self.registered.items():
            for name, target in targets.items():
                registry(group).register(name, target)


def dask_setup(worker: Any) -> None:
    """Called by Dask in each worker that a sweep starts. Ctrl-C in a terminal reaches all processes; the sweep ends these."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def learn(experiment: Experiment, path: tuple[World, Route]) -> TrainedNavigator:
    """What the navigator of an experiment learns before the walk."""
    world, route = path
    return experiment.train(experiment.open_renderer(world), route)


def walk(experiment: Experiment, trained: TrainedNavigator) -> Walked:
    """Walk as an experiment says."""
    began, trajectory = time.perf_counter(), Trajectory()
    try:
        for step, diagnosis in experiment.steps(trained):
            trajectory.add(step, diagnosis)
    except InputError as error:
        if len(trajectory):
            raise
        return Walked(refused=str(error), results={}, steps="", seconds=0.0, learn_seconds=trained.seconds)
    summary = trajectory.summary()
    causes = summary.pop("causes")
    results = summary | {
        "n_views": None if trained.poses is None else len(trained.poses),
        "route_m": trained.route.length,
        "memory_bytes": None if trained.model is None else memory_bytes(trained.model.model),
        **{f"{cause.replace(' ', '_')}_steps": causes.get(cause, 0) for cause in Cause},
    }
    seconds = time.perf_counter() - began
    return Walked(results=results, steps=trajectory.to_csv(), seconds=seconds, learn_seconds=trained.seconds)
