"""The commands that learn routes and walk them: a dataclass with a field a flag. Heavy packages are imported where they are used."""

import dataclasses
import math
import shlex
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from tussock.world.errors import InputError

from .options import RouteOptions, words_of
from .run_options import FILE_SUFFIX, LearningOptions, Lesson, RunOptions
from .terminal import progress, say

if TYPE_CHECKING:
    import numpy as np

    from tussock.render.renderer import Renderer


@dataclass
class EvaluateCommand(LearningOptions):
    """Learn a route, then recover the heading at every grid position beside it."""

    grid_m: float = 0.2
    """Positions are the multiples of this in x and y .."""
    within_m: float = 0.2
    """.. within this distance of the route."""
    scan_deg: float = 360.0
    """Width of the scan; under 360 it is centred on the right heading."""
    json: bool = False
    """Print one JSON object instead of text."""

    def run(self) -> dict[str, Any]:
        import time

        from ..evaluation import grid_positions, heading_errors

        began = time.perf_counter()
        if not 0 < self.scan_deg <= 360:
            raise InputError(f"--scan-deg {self.scan_deg:g}: give over 0 and up to 360")
        lesson = self.prepare()
        positions = grid_positions(lesson.route, grid=self.grid_m, within=self.within_m, field=lesson.world.field)
        with self.open_renderer(lesson.world) as renderer:
            learned = taught(lesson, renderer)
            with progress("recovering headings", "positions") as report:
                found = heading_errors(
                    lesson.model, lesson.encoding, renderer, lesson.route_views, positions,
                    scan=math.radians(self.scan_deg), progress=report,
                )  # fmt: skip
        return {
            "model": str(lesson.model), "encoding": str(lesson.encoding),
            "n_views": None if learned is None else len(learned), "n_positions": len(positions),
            "median_error_deg": found.median_error_deg, "mean_error_deg": found.mean_error_deg,
            "share_over_45": found.share_over_45, "seconds": time.perf_counter() - began,
        }  # fmt: skip


@dataclass
class TrainCommand(LearningOptions):
    """Learn a route and keep the model in a file, for evaluate and run."""

    out: Path = Path("model.safetensors")
    """File to write."""
    learning_walk_m: float = 0.2
    """Also learn views displaced to both sides by up to this, each facing the route a little ahead; 0 is the thesis's training."""
    json: bool = False
    """Print one JSON object instead of text."""

    def run(self) -> dict[str, Any]:
        import time

        import numpy as np

        from tussock.world.atomic import check_writable

        from ..models.base import IncrementalModel, Model
        from ..models.files import save_model
        from ..training import training_views

        if self.out.suffix != FILE_SUFFIX:
            raise InputError(f"{self.out}: a model is written as {FILE_SUFFIX}")
        check_writable(self.out)
        lesson = self.prepare()
        model, saved = lesson.model, lesson.saved
        assert isinstance(model, Model)
        if saved is None:
            learn = model.fit
        elif isinstance(model, IncrementalModel):
            learn = model.partial_fit
        else:
            raise InputError(
                f"{self.model}: {model.name} learns all its views at once and cannot go on; give --model '{model}'"
            )
        with self.open_renderer(lesson.world) as renderer:
            with progress("looking", "views") as report:
                views, poses = training_views(lesson.encoding, renderer, lesson.poses, report)
            say(f"learning {len(views)} views")
            began = time.perf_counter()
            learn(views)
            if saved is not None:
                poses = None if saved.poses is None else np.concatenate([saved.poses, poses])
            seconds = time.perf_counter() - began
            save_model(model, self.out, encoding=lesson.encoding, eye=renderer.eye, poses=poses)
        return {
            "file": str(self.out), "model": str(model), "encoding": str(lesson.encoding), "n_views": len(views),
            "memory_bytes": model.memory_bytes, "fit_seconds": seconds,
        }  # fmt: skip


@dataclass
class CompareCommand(RouteOptions):
    """Train and test models side by side: headings recovered beside the route, and a walk home."""

    models: str = "all"
    """all, or names separated by commas (see tussock models). Parameters may follow a name, as in 'infomax rate=baddeley,chain';
    commas inside parentheses separate no names: 'mlp hidden_layer_sizes=(100,50),chain'."""
    learning_walk_m: float = 0.2
    """Reach of the learning walk before the walk home. Headings are recovered from views on the route alone."""
    grid_m: float = 0.2
    """Headings are recovered at the multiples of this in x and y .."""
    within_m: float = 0.2
    """.. within this distance of the route."""
    offset_m: float = 0.1
    """The walk home starts this far to the left of the route (negative: right)."""
    json: bool = False
    """Print one JSON object instead of text."""

    def run(self) -> dict[str, Any]:
        from tussock.world.specs import split_list

        from ..comparison import compare_models
        from ..evaluation import grid_positions
        from ..models import MODELS, make_model
        from ..models.base import check_device
        from ..training import training_poses

        check_device(self.device)
        names = list(MODELS) if self.models == "all" else split_list(self.models)
        names = list(dict.fromkeys(names))
        for name in names:
            make_model(name)  # refuses what is none before the work begins
        encoding = self.chosen_encoding()
        world, route = self.open_route()
        views = route.resampled(self.spacing_m)
        positions = grid_positions(route, grid=self.grid_m, within=self.within_m, field=world.field)
        rows = {}
        with self.open_renderer(world) as renderer, progress("comparing", "models") as report:
            compared = compare_models(
                [partial(make_model, name, seed=self.seed, device=self.device) for name in names],
                encoding=encoding, renderer=renderer, route=route, route_views=views, positions=positions,
                every=self.every, learning_walk=self.learning_walk_m, offset=self.offset_m, seed=self.seed,
            )  # fmt: skip
            report(0, len(names))
            for name, row in zip(names, compared, strict=True):
                rows[name] = dataclasses.asdict(row)
                report(len(rows), len(names))
        return {
            "encoding": str(encoding),
            "n_views": len(training_poses(views, every=self.every)),
            "n_positions": len(positions),
            "models": rows,
        }


@dataclass
class ModelsCommand:
    """List the familiarity models, what they do and where they come from."""

    json: bool = False
    """Print one JSON object instead of text."""

    def run(self) -> dict[str, Any]:
        from ..models import MODELS, OPPONENT, model_class
        from ..models.opponents import Opponent

        classes = {name: model_class(name) for name in MODELS} | {f"{OPPONENT}...": Opponent}
        return {"models": {name: {"what": summary(cls), "paper": cls.paper} for name, cls in classes.items()}}


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
    json: bool = False
    """Print one JSON object instead of text."""

    def run(self) -> dict[str, Any]:
        from ..recording.run_folder import check_run_folder, record_walk

        viewer = self.viewer if self.live else None
        inputs = [Path(name) for name in (self.world, self.route) if name is not None]
        check_run_folder(self.out, overwrite=self.overwrite, inputs=inputs, viewer=viewer)
        self.check()
        lesson = self.prepare()
        with self.open_renderer(lesson.world) as renderer:
            agent = self.agent(renderer, lesson)
            start = agent.start(self.offset_m)
            learned = taught(lesson, renderer)
            settings = {each.name: getattr(self, each.name) for each in dataclasses.fields(RunOptions)}
            if lesson.saved is not None:  # they say nothing of what a model from a file has learned
                settings = {key: value for key, value in settings.items() if key not in ("every", "learning_walk_m")}
            n_views = None if learned is None else len(learned)
            settings |= {"encoding": str(lesson.encoding), "renderer": renderer.backend, "n_views": n_views}
            with progress("walking", "steps") as report:
                return record_walk(
                    agent, start, self.out, overwrite=self.overwrite, training_poses=learned, settings=settings,
                    command=f"tussock run {words_of(self, RunOptions)} --out {shlex.quote(str(self.out))} --overwrite",
                    viewer=viewer, progress=report,
                )  # fmt: skip


@dataclass
class PlayCommand:
    """Open a run's recording in the rerun viewer."""

    run_folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(name="dir", metavar="DIR")]
    """Folder of the run, or its .rrd file."""
    web: bool = False
    """Serve the viewer to a browser on this machine instead of opening a window."""
    screenshot: Path | None = None
    """Save a picture (.png) of the viewer instead, without a display."""
    json: bool = False
    """Print one JSON object instead of text."""

    def run(self) -> dict[str, Any]:
        from ..recording.run_folder import play

        return play(self.run_folder, web=self.web, screenshot=self.screenshot)


def taught(lesson: Lesson, renderer: "Renderer") -> "np.ndarray | None":
    """`Lesson.teach`, telling the person of it."""
    say(f"renderer: {renderer.backend}")
    with progress("learning", "views") as report:
        return lesson.teach(renderer, report)


def summary(cls: type) -> str:
    """The first paragraph of a class's documentation."""
    return " ".join((cls.__doc__ or "").split("\n\n")[0].split()).rstrip(".")
