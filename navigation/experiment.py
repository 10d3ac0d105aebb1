"""An experiment: everything that decides what happens when an agent learns a route and walks it.

    trajectory = Experiment(world="meadow", seed=7, model="infomax", start_offset=0.1).run()
    print(trajectory.summary())

The command line, sweep files, protocols, the test bed, the Gymnasium task and scripts all build one. Defaults stand here, and in the
settings that it consists of, and nowhere else. Importing this module is light: what does the work is loaded when it is used.
"""

import logging
import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs

from tussock.world.change import Change, as_change
from tussock.world.errors import SettingError
from tussock.world.progress import Progress, no_progress, printed
from tussock.world.settings import converted, instance_of, number, settings, whole
from tussock.world.specs import Spec, takes

from .body import Body
from .changed_world import changed_views, with_views
from .devices import check_device, chosen_device
from .displacement import Displacement
from .experiment_fields import as_encoding, as_model, as_navigator, check_matches, check_start
from .sense_models import as_senses
from .stopping import StoppingRules
from .surroundings import Surroundings
from .trained_navigator import TrainedNavigator
from .training_setup import TrainingSetup

if TYPE_CHECKING:
    from tussock.render.renderer import Renderer
    from tussock.world.geometry import Pose, Route
    from tussock.world.scene import World

    from .encoding import Encoding
    from .failures import Diagnosis
    from .models.base import FamiliarityModel
    from .training import TrainingViews
    from .trajectory import Trajectory
    from .walk import Walk
    from .walker import Step

log = logging.getLogger(__name__)


@settings
class Experiment(Surroundings):
    """Everything that decides a run, in SI units: the surroundings, and what an agent does there.

    Attributes:
        encoding: What is kept of a view; also a preset's name or a chain.
        navigator: What steers: a spec, such as "scan".
        model: What tells how familiar a view is: a spec, such as "infomax rate=baddeley", or a file of a trained model.
        training: Which views are learned. A model from a file has learned already.
        body: How the agent moves.
        senses: How well the agent measures its heading and the distance that it walks: a spec, such as "ant" (see sense_models.py).
        start_offset: The walk starts this far to the left of the route's start (m; negative: right).
        release: The walk starts this far from the route's end instead (m), facing it. 0: at the route's start.
        release_direction: In which direction of the world from there (rad, counter-clockwise from east).
        displacement: Where the agent is carried to the side of the route.
        stopping: When the walk ends.
        test_change: What differs in the world when the agent walks: "removed amount=0.2" (see `World.changed`). None: nothing.
        change_seed: Of what is drawn for this change; None means `seed`.
        device: Where the model learns and scans: "cpu", "cuda", another device of torch, or "auto": a GPU, if any.
    """

    encoding: "Encoding" = converted(default="edges", converter=as_encoding, takes_self=True)
    navigator: Spec = converted(default="scan", converter=as_navigator)
    model: Spec | Path = converted(default="perfect-memory", converter=as_model)
    training: TrainingSetup = instance_of(TrainingSetup, attrs.Factory(TrainingSetup), "a TrainingSetup")
    body: Body = instance_of(Body, attrs.Factory(Body), "a Body")
    senses: Spec = converted(default="ideal", converter=as_senses)
    start_offset: float = number(0.0, unit="m")
    release: float = number(0.0, low=0, unit="m")
    release_direction: float = number(0.0, unit="rad")
    displacement: Displacement = instance_of(Displacement, attrs.Factory(Displacement), "a Displacement")
    stopping: StoppingRules = instance_of(StoppingRules, attrs.Factory(StoppingRules), "StoppingRules")
    test_change: Change | None = converted(default=None, converter=as_change)
    change_seed: int | None = whole(None, low=0, optional=True)
    device: str = attrs.field(default="cpu", converter=chosen_device)

    def __attrs_post_init__(self):
        from .models.base import FamiliarityModel
        from .models.random import RandomHeadings
        from .steering.navigator import Navigator

        super().__attrs_post_init__()
        check_device(self.device)
        if self.route_database is not None and self.training.is_of_worlds:
            raise SettingError(
                "--spacing-m, --parallel-views and --goal-walk-m are of worlds; an image database has its views: give --every instead"
            )
        check_start(self)
        if isinstance(self.model, Spec):
            model = self.make_model()  # refuses bad parameters
            if not isinstance(model, FamiliarityModel):
                raise SettingError(
                    f"the model {str(self.model)!r} lacks fit(views) or scan(views); name a familiarity model"
                )
            if not isinstance(self.make_navigator(model), Navigator):
                raise SettingError(
                    f"the navigator {str(self.navigator)!r} lacks learn, begin or decide; name a class that has them"
                )
            if not (self.eye.sees_all or takes(self.navigator.target, "model")):
                raise SettingError(
                    f"the navigator {str(self.navigator)!r} takes no model, so it would see all of a panorama: no field, side, mask or "
                    "compound eye"
                )
        elif not takes(self.navigator.target, "model"):
            raise SettingError(
                f"the navigator {str(self.navigator)!r} takes no model, so it cannot use {self.model}; name another"
            )
        elif not getattr(self.navigator.make(model=RandomHeadings()), "takes_trained", True):
            raise SettingError(
                f"the navigator {str(self.navigator)!r} must learn the views itself, so it cannot use {self.model}; give a model's name"
            )

    def replace(self, **changes: Any) -> "Experiment":
        """The same with some fields changed, as for `Surroundings`. With another eye, a preset encoding keeps its number of columns."""
        from .encoding import PRESETS, Encoding, automatic_resize, describe_encoding

        changed = super().replace(**changes)
        if changed.eye == self.eye:
            return changed
        name, resize, blur = describe_encoding(self.encoding, self.eye)
        if "encoding" in changes or name not in PRESETS or resize is not None:
            return changed
        encoding = Encoding.named(name, resize=automatic_resize(changed.eye), blur=blur)
        return attrs.evolve(changed, encoding=encoding)

    def make_model(self) -> "FamiliarityModel":
        """The untrained model, told what the eye sees. Raises SettingError where it comes from a file."""
        from .feature_mask import seeing

        if isinstance(self.model, Path):
            raise SettingError(f"{self.model} is a trained model; give a model's name")
        return seeing(self.model.make(seed=self.seed, device=self.device), self.encoding.for_eye(self.eye).mask)

    def make_navigator(self, model: "FamiliarityModel") -> Any:
        """The navigator, with a model that it may take."""
        return self.navigator.make(model=model, seed=self.seed)

    def start(self, route: "Route") -> "Pose":
        """Where the walk begins."""
        from tussock.world.geometry import Pose

        if self.release:
            towards = Pose(route.goal.x, route.goal.y, self.release_direction + math.pi)
            return towards.moved(-self.release).rounded()
        return route.start.moved(0.0, self.start_offset).rounded()

    def train(
        self,
        renderer: "Renderer",
        route: "Route",
        progress: Progress = no_progress,
        *,
        model: Any = None,
        views: "TrainingViews | None" = None,
    ) -> "TrainedNavigator":
        """Let a navigator learn the route, unless its model comes from a file.

        Args:
            renderer: Of the world, for the experiment's eye.
            route: Through it.
            progress: Called with how many training views are drawn, of how many.
            model: An untrained model to take in place of the experiment's, told what the eye sees.
            views: The training views, as `training_views` gives them, where they are drawn already.
        """
        from .learning import learn_views
        from .models.base import FamiliarityModel, Model
        from .models.files import TrainedModel, load_model
        from .threads import threads
        from .training import shared_views

        began = time.perf_counter()
        with threads(self.threads):
            if model is None and isinstance(self.model, Path):
                loaded = load_model(self.model, device=self.device)
                check_matches(self, loaded)
                navigator = self.make_navigator(loaded.model)
                images, poses = None, loaded.poses
            else:
                navigator = self.make_navigator(self.make_model() if model is None else model)
                images, poses = views or self.training_views(renderer, route, progress)
                own = images.clone()  # others learn them, too, and a model of the user's may change them
                light = renderer.world.light
                learn_views(navigator, own, poses, route=route, senses=self.senses.make(), seed=self.seed, light=light)
        model = getattr(navigator, "model", None)
        trained = None  # where the navigator has no model, or learns without it
        if isinstance(model, FamiliarityModel) and not (isinstance(model, Model) and model.shape is None):
            trained = TrainedModel(model=model, encoding=self.encoding, eye=self.eye, poses=poses)
        return TrainedNavigator(
            renderer=renderer,
            route=route,
            navigator=navigator,
            model=trained,
            poses=poses,
            views=images if images is None or trained is None else shared_views(model, images),
            seconds=time.perf_counter() - began,
            encoding=self.encoding,
        )

    def training_views(self, renderer: "Renderer", route: "Route", progress: Progress = no_progress) -> "TrainingViews":
        """The encoded views that are learned, and their poses; see `training_views` of training.py."""
        from .training import training_views as draw

        return draw(self.encoding, renderer, self.training_poses(renderer.world, route), progress)

    def training_poses(self, world: "World", route: "Route"):
        """(n, 3) Poses that views are learned at; see `poses_of_setup` and, for databases, `training_poses_in`."""
        from .training import poses_of_setup, training_poses_in

        setup = self.training
        if self.route_database is not None:
            beside = self.open_views_beside()[:, :2]
            return training_poses_in(route, beside, every=setup.every, learning_walk=setup.learning_walk)
        poses = poses_of_setup(setup, route, world.field)
        return poses[world.stands(poses[:, :2])]

    def walk(self, renderer: "Renderer", route: "Route") -> "Walk":
        """The walk of one agent along a route, to be steered by a navigator."""
        return walk_of([self], renderer, route)

    def steps(self, trained: "TrainedNavigator") -> Iterator[tuple["Step", "Diagnosis | None"]]:
        """Walk: each step as it is made, and what is wrong with it."""
        yield from (step for (step,) in steps_of([self], trained) if step is not None)

    @contextmanager
    def opened(self, progress: Progress | None = None) -> Iterator["TrainedNavigator"]:
        """Open the world, find the route, and let the navigator learn it, then change the world; the renderer is closed with the block."""
        progress = printed(progress, "learning", "views")
        from .walker import check_inside

        world, route = self.open_world_and_route()
        check_inside(self.start(route), world)  # before the work begins
        with self.open_renderer(world) as renderer, changed_views(self, renderer, route) as views:
            device = "" if self.device == "cpu" else f", device: {self.device}"
            log.info(f"renderer: {renderer.backend}{device}")
            yield with_views(self.train(renderer, route, progress), views)

    def run(self, progress: Progress | None = None) -> "Trajectory":
        """Learn the route and walk it.

        Args:
            progress: Called with how many steps are made, of how many there may be; None prints a line where it
                takes long, `no_progress` none.
        """
        learning = None if progress is None else no_progress
        progress = printed(progress, "walking", "steps")
        from .trajectory import Trajectory

        trajectory = Trajectory()
        with self.opened(learning) as trained:
            limit = self.stopping.step_limit(trained.route.length, self.body.step_length)
            for step, diagnosis in self.steps(trained):
                trajectory.add(step, diagnosis)
                progress(step.index, limit)
        return trajectory


def walk_of(experiments: Sequence[Experiment], renderer: "Renderer", route: "Route") -> "Walk":
    """The walk of agents side by side, one for each experiment. These have the same eye and encoding."""
    from numpy.random import default_rng

    from .walk import Walk

    return Walk(
        renderer=renderer,
        encoding=experiments[0].encoding,
        route=route,
        starts=[each.start(route) for each in experiments],
        body=[each.body for each in experiments],
        stopping=[each.stopping for each in experiments],
        displacement=[each.displacement for each in experiments],
        senses=[each.senses.make() for each in experiments],
        noise=[default_rng(each.seed) for each in experiments],
    )


def steps_of(
    experiments: Sequence[Experiment], trained: TrainedNavigator, *, diagnosed: bool = True
) -> Iterator[list["tuple[Step, Diagnosis | None] | None"]]:
    """Walk side by side what has the same `training_key`.

    Args:
        experiments: One for each walk.
        trained: What they have learned.
        diagnosed: Whether to find out what is wrong with poor steps.

    Yields:
        A list with what `Experiment.steps` gives, or None for a walk that has ended.
    """
    from .threads import threads

    with threads(experiments[0].threads):
        walk = walk_of(experiments, trained.renderer, trained.route).steps(trained.navigator)
        if diagnosed:
            yield from trained.diagnostics.along(walk)
        else:
            for steps in walk:
                yield [None if step is None else (step, None) for step in steps]
