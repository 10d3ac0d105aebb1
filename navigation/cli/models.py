"""The commands that train, test and run models. Heavy packages are imported where they are used."""

import ast
import dataclasses
import math
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from tussock.render.posture import Posture
from tussock.world.errors import FileError, SettingError

from ..experiment_fields import MODEL_SUFFIX
from .command import Command
from .options import ChangeOptions, LearningOptions, ModelOptions, RunOptions
from .terminal import message, progress, progress_of_parts
from .unimported import class_at

if TYPE_CHECKING:
    from tussock.world.scene import World

    from ..evaluation import HeadingErrors
    from ..experiment import Experiment


@dataclass
class EvaluateCommand(ChangeOptions):
    """Learn a route, then recover the heading at every grid position near it."""

    grid_m: float | None = None
    """Positions are the multiples of this in x and y (default: 0.2), or those of --grid-database .."""
    within_m: float = 0.2
    """.. within this distance of the route."""
    scan_deg: float = 360.0
    """Width of the scan; under 360 it is centred on the right heading."""
    clearance_m: float = 0.02
    """Errors are also given of those positions alone that have room to stand: no obstacle is nearer than this."""

    def run(self) -> dict[str, Any]:
        from ..changed_world import changed_views, check_no_gusts
        from ..evaluation import heading_errors
        from ..tested_poses import poses_to_test, route_views_of

        began = time.perf_counter()
        if not 0 < self.scan_deg <= 360:
            raise SettingError(f"--scan-deg {self.scan_deg:g}: give over 0 and up to 360")
        if not (math.isfinite(self.clearance_m) and self.clearance_m >= 0):
            raise SettingError(f"--clearance-m {self.clearance_m:g}: give a finite distance, 0 or more")
        experiment = self.experiment()
        check_no_gusts(experiment)
        world, route = experiment.open_world_and_route()
        positions = poses_to_test(experiment, world, route, grid=self.grid_m, within=self.within_m)
        with experiment.open_renderer(world) as renderer:
            message(f"renderer: {renderer.backend}")
            with progress("learning", "views") as report:
                trained = experiment.train(renderer, route, report)
            assert trained.model is not None
            model, encoding, scan = trained.model.model, experiment.encoding, math.radians(self.scan_deg)
            views = route_views_of(experiment, route)
            tested = changed_views(experiment, renderer, route)
            with tested as seen, progress("recovering headings", "positions") as report:
                errors = heading_errors(model, encoding, seen, views, positions, scan=scan, progress=report)
                world = seen.world
        # From the route itself: the line through its views cuts corners.
        errors = dataclasses.replace(errors, distances=route.nearest(errors.positions)[0])
        return {
            "model": str(model),
            "encoding": str(encoding),
            "n_views": None if trained.poses is None else len(trained.poses),
            **errors.summary(),
            "by_distance": table_by_distance(errors),
            "clearance_m": self.clearance_m,
            "with_room": self._with_room(experiment, world, errors),
            "seconds": time.perf_counter() - began,
        }

    def _with_room(
        self, experiment: "Experiment", world: "World", errors: "HeadingErrors"
    ) -> dict[str, dict[str, float]] | None:
        """The errors at the positions that have room to stand; None for images, which do not show what stands where."""
        from tussock.world.obstacles import clearance

        if experiment.route_database is not None:
            return None
        return table_by_distance(errors.among(clearance(world, errors.positions) >= self.clearance_m))

    def settings(self) -> dict[str, Any]:
        """As for all; the scan is of the evaluation, not of a navigator."""
        return {name: value for name, value in super().settings().items() if name != "scan_deg"}


@dataclass
class TrainCommand(ModelOptions):
    """Learn a route and keep the model in a file, for evaluate and run."""

    out: Path = Path("model.safetensors")
    """File to write."""
    learning_walk_m: float = RunOptions.learning_walk_m
    """Also learn views displaced to both sides by up to this, each facing the route a little ahead; 0 is the thesis's training."""

    def run(self) -> dict[str, Any]:
        import numpy as np

        from tussock.world.atomic import check_writable

        from ..models.base import memory_bytes
        from ..models.files import TrainedModel, check_can_be_saved, load_model, save_model
        from ..models.incremental import IncrementalModel
        from ..threads import threads
        from ..training import training_views

        if self.out.suffix != MODEL_SUFFIX:
            raise FileError(f"{self.out}: a model is written as {MODEL_SUFFIX}")
        check_writable(self.out)
        experiment = self.experiment()
        before = load_model(experiment.model, device=experiment.device) if isinstance(experiment.model, Path) else None
        model = experiment.make_model() if before is None else before.model
        if before is not None and not isinstance(model, IncrementalModel):
            raise SettingError(
                f"{self.model}: {model} learns all its views at once and cannot go on; give --model '{model}'"
            )
        check_can_be_saved(model)
        if experiment.posture != Posture():
            message(
                "the file does not keep --gaze, --pitch-noise-deg and --roll-noise-deg: give them again to what uses it"
            )
        world, route = experiment.open_world_and_route()
        with experiment.open_renderer(world) as renderer, progress("drawing", "views") as report:
            wanted = experiment.training_poses(world, route)
            views, poses = training_views(experiment.encoding, renderer, wanted, report)
        message(f"learning {len(views)} views")
        began = time.perf_counter()
        with threads(experiment.threads):
            (model.partial_fit if isinstance(model, IncrementalModel) and before is not None else model.fit)(views)
        seconds = time.perf_counter() - began
        if before is not None:
            poses = None if before.poses is None else np.concatenate([before.poses, poses])
        trained = TrainedModel(model=model, encoding=experiment.encoding, eye=experiment.eye, poses=poses)
        save_model(trained, self.out)
        return {
            "file": str(self.out),
            "model": str(model),
            "encoding": str(experiment.encoding),
            "n_views": len(views),
            "memory_bytes": memory_bytes(model),
            "fit_seconds": seconds,
        }


@dataclass
class CompareCommand(LearningOptions):
    """Train and test models side by side: headings recovered near the route, and a walk home."""

    models: str = "all"
    """all, or names separated by commas (see tussock models). Parameters may follow a name, as in 'infomax rate=baddeley,chain';
    commas inside parentheses separate no names: 'mlp hidden_layer_sizes=(100,50),chain'. A model of your own is package.module:Class."""
    learning_walk_m: float = RunOptions.learning_walk_m
    """Reach of the learning walk before the walk home. Headings are recovered from views on the route alone."""
    grid_m: float | None = None
    """Headings are recovered at the multiples of this in x and y (default: 0.2), or where --grid-database has views .."""
    within_m: float = 0.2
    """.. within this distance of the route."""
    offset_m: float = 0.1
    """The walk home starts this far to the left of the route (negative: right)."""
    navigator: str = RunOptions.navigator
    """What steers on the walk home. Headings are recovered by the models alone."""

    def run(self) -> dict[str, Any]:
        from tussock.world.specs import split_list

        from ..comparison import compare_models
        from ..models import MODELS, model_spec
        from ..tested_poses import poses_to_test

        experiment = self.experiment()
        names = list(MODELS.builtin) if self.models == "all" else split_list(self.models)
        specs = {name: model_spec(name) for name in dict.fromkeys(names)}
        for spec in specs.values():
            experiment.replace(model=spec)  # refuses bad parameters before the work begins
        world, route = experiment.open_world_and_route()
        positions = poses_to_test(experiment, world, route, grid=self.grid_m, within=self.within_m)
        rows = {}
        with experiment.open_renderer(world) as renderer, progress("comparing", "models") as report:
            report(0, len(specs))
            for name, row in zip(
                specs, compare_models(specs.values(), experiment, renderer, route, positions), strict=True
            ):
                rows[name] = dataclasses.asdict(row)
                report(len(rows), len(specs))
        message(
            "1 world, and 1 walk of each model: no intervals and no tests; a sweep over world-seed gives both (docs/sweeps.md)"
        )
        on_route = experiment.replace(training__learning_walk=0.0)
        return {
            "encoding": str(experiment.encoding),
            "n_views": len(on_route.training_poses(world, route)),
            "n_positions": len(positions),
            "n_worlds": 1,
            "n_walks": 1,
            "models": rows,
        }


@dataclass
class ModelsCommand(Command):
    """List the familiarity models, what they do and where they come from."""

    def run(self) -> dict[str, Any]:
        from ..models import MODELS

        told = {name: described(where) for name, where in MODELS.builtin.items()}
        others = {name: MODELS.find(name) for name in MODELS.names if name not in told}
        told |= {
            name: {"what": first_paragraph(cls.__doc__), "paper": getattr(cls, "paper", "")}
            for name, cls in others.items()
        }
        told["opponent-..."] = described("tussock.navigation.models.opponents:Opponent")
        told["hemifields-..."] = described("tussock.navigation.models.hemifield_memories:Hemifields")
        return {"models": told}


def described(where: str) -> dict[str, str]:
    """What a class of tussock is and where it comes from; its file is read, not imported, as that takes seconds."""
    found = class_at(where)
    papers = [
        each.value.value for each in found.body
        if isinstance(each, ast.Assign) and ast.unparse(each.targets[0]) == "paper" and isinstance(each.value, ast.Constant)
    ]  # fmt: skip
    return {"what": first_paragraph(ast.get_docstring(found)), "paper": str(papers[0]) if papers else ""}


@dataclass
class RunCommand(RunOptions):
    """Learn a route and walk it home, recorded."""

    out: Path = Path("run")
    """Folder for the recording, trajectory, summary and picture."""
    overwrite: bool = False
    """Replace the run that the folder holds."""
    live: bool = False
    """Also stream to a running rerun viewer, at --viewer."""
    viewer: str = "rerun+http://127.0.0.1:9876/proxy"
    """Address of the viewer for --live."""

    def run(self) -> dict[str, Any]:
        from ..recording.run_folder import check_run_folder, record_run
        from .unused_flags import warn_of_unused_flags

        viewer = self.viewer if self.live else None
        given = (self.world, self.route, self.route_database, self.grid_database)
        files = [Path(name) for name in given if name is not None]
        check_run_folder(self.out, overwrite=self.overwrite, inputs=files, viewer=viewer)
        experiment = self.experiment()
        warn_of_unused_flags(experiment)
        with progress_of_parts() as report:
            parts = {part: partial(report, part) for part in ("learning", "walking")}
            return record_run(experiment, self.out, overwrite=self.overwrite, viewer=viewer, **parts)


@dataclass
class PlayCommand(Command):
    """Open a run's recording in the rerun viewer, or make a picture or a film of it."""

    run_folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(name="dir", metavar="DIR")]
    """Folder of the run, or its .rrd file."""
    web: bool = False
    """Serve the viewer to a browser on this machine instead of opening a window."""
    screenshot: Path | None = None
    """Save a picture (.png) of the viewer instead, without a display."""
    step: int | None = None
    """The step that the picture shows. Default: the last one."""
    video: Path | None = None
    """Save a film of the walk instead: .mp4 (needs pip install imageio-ffmpeg), or .gif."""
    steps_per_second: float = 10.0
    """Speed of the film."""

    def run(self) -> dict[str, Any]:
        from ..recording.playback import play

        if self.video is None:
            return play(self.run_folder, web=self.web, screenshot=self.screenshot, step=self.step)
        with progress("drawing", "steps") as report:
            return play(
                self.run_folder,
                web=self.web,
                screenshot=self.screenshot,
                step=self.step,
                video=self.video,
                steps_per_second=self.steps_per_second,
                progress=report,
            )


def table_by_distance(errors: "HeadingErrors") -> dict[str, dict[str, float]]:
    """The numbers of heading errors by the distance from the route, and of all; empty without positions."""
    bands = errors.by_distance() | ({"all": errors} if len(errors) else {})
    return {name: band.summary() for name, band in bands.items()}


def first_paragraph(text: str | None) -> str:
    """The first paragraph of a docstring, in one line."""
    return " ".join((text or "").split("\n\n")[0].split()).rstrip(".")
