"""What the commands that learn share: flags that choose what learns, and how an agent walks by it."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from tussock.world.errors import InputError

from .options import RouteOptions

if TYPE_CHECKING:
    import numpy as np

    from tussock.render.renderer import Renderer
    from tussock.world.geometry import Route
    from tussock.world.scene import World

    from ..encoding import Encoding
    from ..models.base import FamiliarityModel
    from ..models.files import SavedModel
    from ..walk import Agent, AgentSettings

FILE_SUFFIX = ".safetensors"  # of trained models


@dataclass
class LearningOptions(RouteOptions):
    """What learns."""

    model: str = "perfect-memory"
    """A model's name (see tussock models), or a file that tussock train wrote: it knows its views, encoding and size.
    Parameters may follow the name, as in 'mushroom-body inputs=10 cells=20000' or 'mlp hidden_layer_sizes=100,50'."""
    threads: int | None = None
    """Threads to draw, learn and match with. Default: one a core. What networks learn depends on it in its last digits."""

    def open_renderer(self, world):
        return super().open_renderer(world, self.threads)

    def prepare(self, path: "tuple[World, Route] | None" = None) -> "Lesson":
        """Everything that a model is to learn, and everything that can be refused before long work begins.

        path: the world and the route through it, where they are open already.
        """
        from ..models import make_model
        from ..models.base import check_device
        from ..threads import use_threads
        from ..training import training_poses

        check_device(self.device)
        if self.threads is not None:
            use_threads(self.threads)
        saved = self._open_model() if self.model.endswith(FILE_SUFFIX) else None
        model = make_model(self.model, seed=self.seed, device=self.device) if saved is None else saved.model
        encoding = self.chosen_encoding() if saved is None or saved.encoding is None else saved.encoding
        world, route = path or self.open_route()
        views = route.resampled(self.spacing_m)
        poses = training_poses(views, every=self.every, learning_walk=self.learning_walk_m, field=world.field)
        return Lesson(
            world=world, route=route, route_views=views, poses=poses, encoding=encoding, model=model, saved=saved
        )

    def _open_model(self) -> "SavedModel":
        """A model from a file. Refuses flags that say otherwise than it."""
        from ..models.files import load_model

        saved = load_model(self.model, device=self.device)
        if saved.eye is not None:
            if self.size is None:
                self.size = f"{saved.eye.width}x{saved.eye.height}"
            if self.eye() != saved.eye:
                raise InputError(
                    f"{self.model} learned through another eye ({saved.eye}) than the flags ask for ({self.eye()}); "
                    "give the same --size, --samples, --eye-height-m, --top-deg and --bottom-deg, or none"
                )
        said = not (self.encoding is None and self.resize is None and self.blur == 0)
        if said and saved.encoding is not None and self.chosen_encoding() != saved.encoding:
            raise InputError(
                f"{self.model} learned views encoded as {str(saved.encoding)!r}, the flags ask for "
                f"{str(self.chosen_encoding())!r}; leave out --encoding, --resize and --blur"
            )
        return saved


@dataclass
class RunOptions(LearningOptions):
    """What a model learns, and how an agent walks by it: everything that decides what happens in a run."""

    learning_walk_m: float = 0.2
    """Also learn views displaced to both sides by up to this, each facing the route a little ahead; 0 is the thesis's training."""
    step_m: float = 0.05
    """Length of a step."""
    offset_m: float = 0.0
    """Start this far to the left of the route (negative: right)."""
    heading_noise_deg: float = 0.0
    """Standard deviation of the noise on every turn."""
    scan_deg: float = 180.0
    """Width of the scan."""
    scan_about_deg: float | None = None
    """Centre the scan on this direction of the world instead of the present heading."""
    on_lost: Annotated[str, tyro.conf.arg(metavar="stop|reset")] = "stop"
    """stop, or reset: put the agent back on the route at the waypoint after the furthest one reached, and count it."""
    waypoint_m: float = 0.1
    """Distance along the route between these waypoints."""
    arrive_m: float = 0.15
    """Arrived within this distance of the route's end."""
    lost_m: float = 0.5
    """Lost beyond this distance from the route."""
    patience_m: float = 3.0
    """Stuck in a loop after walking this far without getting farther along the route."""
    max_steps: int | None = None
    """Out of steps after so many. Default: as many as walk the route's length three times."""

    def check(self) -> None:
        """Refuse what can be refused before a world is grown. Raises InputError."""
        import numpy as np

        from tussock.render.renderer import check_backend
        from tussock.world.geometry import Route
        from tussock.world.params import PRESETS, WorldParams, is_generated
        from tussock.world.routes import check_length

        from ..models import make_model
        from ..models.base import check_device
        from ..stopping import check_distance
        from ..training import training_poses

        self.agent_settings()
        check_device(self.device)
        if self.model.endswith(FILE_SUFFIX):
            self._open_model()
        else:
            make_model(self.model, seed=self.seed, device=self.device)
        self.eye()
        self.chosen_encoding()
        training_poses(Route.through(np.eye(2)), every=self.every, learning_walk=self.learning_walk_m)
        check_backend(self.renderer)
        check_distance("spacing", self.spacing_m)
        check_length(self.route_length_m)
        if not math.isfinite(self.offset_m):
            raise InputError(f"an offset of {self.offset_m} m; give a finite distance")
        if self.threads is not None and self.threads < 1:
            raise InputError(f"{self.threads} threads; give at least 1")
        for seed in (self.seed, self.world_seed, self.route_seed):
            if seed is not None and seed < 0:
                raise InputError(f"seed {seed}; give a whole number from 0")
        if is_generated(self.world):
            WorldParams.named(self.world)
        elif not Path(self.world).is_file():
            raise InputError(f"there is no world {self.world!r}; give one of {', '.join(PRESETS)}, or a file")
        if self.route is not None and not self.route.is_file():
            raise InputError(f"there is no route {self.route}; give a file, or none to have one generated")

    def agent_settings(self) -> "AgentSettings":
        """How an agent walks by these flags."""
        from ..walk import AgentSettings

        if self.on_lost not in ("stop", "reset"):
            raise InputError(f"--on-lost {self.on_lost!r}: give stop or reset")
        return AgentSettings(
            step_length=self.step_m, scan=math.radians(self.scan_deg),
            scan_about=None if self.scan_about_deg is None else math.radians(self.scan_about_deg),
            heading_noise=math.radians(self.heading_noise_deg), arrive=self.arrive_m, lost=self.lost_m, patience=self.patience_m,
            max_steps=self.max_steps, reset_when_lost=self.on_lost == "reset", seed=self.seed, waypoint_spacing=self.waypoint_m,
        )  # fmt: skip

    def agent(self, renderer: "Renderer", lesson: "Lesson") -> "Agent":
        """The agent that walks by what the lesson's model learned."""
        from ..walk import Agent

        return Agent(
            renderer=renderer,
            encoding=lesson.encoding,
            model=lesson.model,
            route=lesson.route,
            **vars(self.agent_settings()),
        )


@dataclass(frozen=True, kw_only=True)
class Lesson:
    """A world, a route through it, and what is to be learned there.

    route_views: the route's poses at the spacing of its views. poses: (n, 3) all that views are learned from.
    saved: the file that the model comes from, if it does; then it has learned.
    """

    world: "World"
    route: "Route"
    route_views: "Route"
    poses: "np.ndarray"
    encoding: "Encoding"
    model: "FamiliarityModel"
    saved: "SavedModel | None"

    def teach(
        self, renderer: "Renderer", progress: Callable[[int, int], object] = lambda done, total: None
    ) -> "np.ndarray | None":
        """Train the model, unless it comes from a file; return the poses of the views it knows, if known."""
        from ..training import learn

        if self.saved is not None:
            return self.saved.poses
        return learn(self.model, self.encoding, renderer, self.poses, progress)
