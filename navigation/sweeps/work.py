"""The parts of a run as the workers of a sweep do them: open the world, teach the model, walk."""

import dataclasses
import hashlib
import json
import signal
import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from tussock.render.renderer import Renderer, open_renderer
from tussock.world.errors import InputError
from tussock.world.geometry import Route
from tussock.world.params import is_generated
from tussock.world.scene import World

from ..cli.options import PathOptions
from ..cli.run_options import LearningOptions, Lesson, RunOptions
from ..failures import CAUSES, Witness
from ..models.base import FamiliarityModel
from ..threads import use_threads
from ..trajectory import Trajectory

VERSION = 3  # of what a run does: a change that alters what comes of one counts it up, and what was kept is done again
_NOT_OF_PATH = {"size", "renderer", "samples", "eye_height_m", "top_deg", "bottom_deg"}  # the eye's


@dataclass(frozen=True, kw_only=True)
class Taught:
    """A lesson that was learned, what draws its world, who says why walks fail there, and how many views the model knows."""

    lesson: Lesson
    renderer: Renderer
    witness: Witness
    n_views: int | None
    seconds: float


@dataclass(frozen=True, kw_only=True)
class Walked:
    """What came of a run. found: its numbers by name. steps: its trajectory as CSV. seconds: of the walk, and of the lesson before it.

    refused: why it has no start, where it has none; then nothing was found, nor ever will be.
    """

    refused: str | None = None
    found: dict[str, Any]
    steps: str
    seconds: float
    learn_seconds: float


def dask_setup(worker: Any) -> None:
    """What Dask calls in each worker that a sweep starts. Ctrl-C in a terminal reaches all processes: it is the sweep that ends these."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def open_path(options: RunOptions) -> tuple[World, Route]:
    """The world of a run, and the route through it."""
    return options.open_route()


def teach(options: RunOptions, path: tuple[World, Route], model: FamiliarityModel | None = None) -> Taught:
    """What a run's model learns before the walk. model: an untrained one to take instead of the one that the options name."""
    began = time.perf_counter()
    lesson = options.prepare(path)
    if model is not None:
        lesson = dataclasses.replace(lesson, model=model)
    renderer = open_renderer(lesson.world, options.eye(), options.renderer, threads=options.threads)
    poses = lesson.teach(renderer)
    witness = Witness(renderer, lesson.encoding, lesson.route, poses)
    seconds, n_views = time.perf_counter() - began, None if poses is None else len(poses)
    return Taught(lesson=lesson, renderer=renderer, witness=witness, n_views=n_views, seconds=seconds)


def walk(options: RunOptions, taught: Taught) -> Walked:
    """Walk as a run's settings say."""
    began = time.perf_counter()
    if options.threads is not None:
        use_threads(options.threads)
    agent, trajectory = options.agent(taught.renderer, taught.lesson), Trajectory()
    try:
        start = agent.start(options.offset_m)
    except InputError as error:
        return Walked(refused=str(error), found={}, steps="", seconds=0.0, learn_seconds=taught.seconds)
    for step in agent.walk(start):
        trajectory.add(step, taught.witness.evidence(step))
    found: dict[str, Any] = trajectory.summary() | {"n_views": taught.n_views, "route_m": taught.lesson.route.length}
    found["memory_bytes"] = getattr(taught.lesson.model, "memory_bytes", None)
    causes = found.pop("causes")
    found |= {f"{label.replace(' ', '_')}_steps": causes.get(label, 0) for label in CAUSES}
    seconds = time.perf_counter() - began
    return Walked(found=found, steps=trajectory.to_csv(), seconds=seconds, learn_seconds=taught.seconds)


def run_key(options: RunOptions) -> str:
    """What tells a run from all others, to share with whoever asks for the same one: a digest of everything that decides it."""
    return _digest(options, {each.name for each in dataclasses.fields(RunOptions)})


def path_key(options: RunOptions) -> str:
    """The same, of the world and route of a run."""
    return "path-" + _digest(options, {each.name for each in dataclasses.fields(PathOptions)} - _NOT_OF_PATH)


def lesson_key(options: RunOptions) -> str:
    """The same, of what its model learns."""
    return "lesson-" + _digest(options, {each.name for each in dataclasses.fields(LearningOptions)})


def settings_of(options: RunOptions) -> dict[str, Any]:
    """The settings of a run as its row of the table has them."""
    settings = {each.name: getattr(options, each.name) for each in dataclasses.fields(RunOptions)}
    return {name: str(value) if isinstance(value, Path) else value for name, value in settings.items()}


def options_of(row: dict[str, Any]) -> RunOptions:
    """The settings of a run from its row of the table."""
    settings = {each.name: row[each.name] for each in dataclasses.fields(RunOptions)}
    return RunOptions(**settings | {"route": None if row["route"] is None else Path(row["route"])})


def _digest(options: RunOptions, names: set[str]) -> str:
    settings = {name: getattr(options, name) for name in sorted(names)}
    world_seed, route_seed = (
        options.seed if seed is None else seed for seed in (options.world_seed, options.route_seed)
    )
    settings |= {"world_seed": world_seed, "route_seed": route_seed}
    if "model" not in names:
        del settings["seed"]  # of which nothing else here depends
    if options.route is not None:
        settings |= {"route": _content(options.route), "route_seed": None, "route_length_m": None}
    if not is_generated(options.world):
        settings |= {"world": _content(Path(options.world)), "world_seed": None}
    if "model" in names and Path(options.model).is_file():
        settings["model"] = _content(Path(options.model))
    return hashlib.sha256(json.dumps([VERSION, settings], default=str).encode()).hexdigest()[:16]


def _content(path: Path) -> str:
    """Digest of a file."""
    status = path.stat()
    return _content_of(path, status.st_size, status.st_mtime_ns)


@lru_cache(maxsize=1024)
def _content_of(path: Path, size: int, changed: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
