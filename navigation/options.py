"""What the commands share: flags that choose the world, the eye, the route and what is learned."""

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from world.errors import InputError

from .terminal import progress, say, saying_when_slow

if TYPE_CHECKING:
    import numpy as np

    from render.eye import Eye
    from render.renderer import Renderer
    from world.geometry import Route
    from world.scene import World

    from .encoding import Encoding
    from .familiarity import Model
    from .model_files import SavedModel

WORLD = (
    "A preset's name (tussock-field, meadow, scrub, tiny), grown from --seed, or a file (.glb, .ply, .bin, .obj, ...)."
)

ROUTE_SPACING = (
    0.02  # m, between the route views of a database and of the studies: docs/report.md derives it from the thesis
)
FILE_SUFFIX = ".safetensors"  # of trained models


@dataclass
class SightOptions:
    """What world is seen, through what eye."""

    world: Annotated[str, tyro.conf.arg(help=WORLD)] = "tussock-field"
    seed: int = 0
    """Seed of everything random: the world and route where they are generated, the model's start, the heading noise."""
    size: str | None = None
    """Columns x rows of a panorama; a pixel wider than a degree is averaged from several rays. Default: 720x150, or the model file's."""
    renderer: str = "auto"
    """auto (the fastest here), cpu, egl or osmesa."""
    samples: int | None = None
    """Rays along each side of a pixel. Default: 1 where a pixel is at most a degree wide, else 4."""
    eye_height_m: float = 0.01
    """Height of the eye above z = 0."""
    top_deg: float = 60.0
    """Elevation of a panorama's upper edge."""
    bottom_deg: float = -15.0
    """Elevation of its lower edge."""
    cull_back_faces: bool = False
    """See triangles only from their front, as the original Sussex renderer did."""

    def open_world(self):
        from world import World
        from world.files import read_world
        from world.params import PRESETS

        if self.world in PRESETS:
            world = World.generate(self.world, self.seed)
        elif not Path(self.world).suffix and not Path(self.world).exists():
            raise InputError(f"unknown world {self.world!r}; give one of {', '.join(PRESETS)}, or a file")
        else:
            world = read_world(self.world)
        return dataclasses.replace(world, double_sided=False) if self.cull_back_faces else world

    def width_and_height(self) -> tuple[int, int]:
        """Columns and rows of a panorama."""
        width, cross, height = (self.size or "720x150").lower().partition("x")
        if not (cross and width.isdecimal() and height.isdecimal()):
            raise InputError(f"size {self.size!r}: give columns x rows, for example 720x150")
        return int(width), int(height)

    def eye(self) -> "Eye":
        """The eye that these flags describe."""
        from render import Eye

        width, height = self.width_and_height()
        return Eye(
            width=width, height=height, top=math.radians(self.top_deg), bottom=math.radians(self.bottom_deg),
            z=self.eye_height_m, samples=self.samples,
        )  # fmt: skip

    def open_renderer(self, world):
        from render import open_renderer

        with saying_when_slow(
            "opening the renderer; where it is used for the first time, it is compiled, which takes some seconds"
        ):
            return open_renderer(world, self.eye(), self.renderer)


@dataclass
class PathOptions(SightOptions):
    """What world is seen, through what eye, and a route through it."""

    route: Path | None = None
    """A route file (.csv or AntWorld .bin); without it a route of about 8 m is generated."""

    def open_route(self) -> tuple["World", "Route"]:
        """The world, and the route through it."""
        from world.files import read_route
        from world.walk import generate_route

        route = read_route(self.route) if self.route else None
        world = self.open_world()
        route = route or generate_route(world, self.seed)
        inside = world.field.contains(*route.xy.T)
        if not inside.all():
            x, y = route.xy[~inside][0]
            raise InputError(
                f"the route leaves the world ({world.field}) at ({x:g}, {y:g}) m; choose a route of this world"
            )
        return world, route


@dataclass
class RouteOptions(PathOptions):
    """Along which route views are learned, and what is kept of them."""

    encoding: str | None = None
    """edges (the default), grey or sky; or a chain of steps, such as 'sky-mask | vertical-edges | resize 6 | normalise'."""
    resize: float | None = None
    """Factor by which a view's width and height are reduced. Default: whatever brings the width down to 120."""
    blur: float = 0.0
    """Standard deviation (pixels of the view) of Gaussian smoothing before all else; 0 is none."""
    spacing_m: float = 0.04
    """Distance between route views."""
    every: int = 1
    """Learn one route view in so many."""
    learning_walk_m: float = 0.0
    """Also learn views displaced to both sides by up to this, each facing the route a little ahead; 0 is none."""
    device: str = "cpu"
    """Where the model learns and scans: cpu, cuda, or another device of torch's."""

    def chosen_encoding(self) -> "Encoding":
        """The encoding that these flags spell."""
        from .encoding import Encoding

        name = self.encoding or "edges"
        automatic = 1.0 if "|" in name else max(1.0, self.width_and_height()[0] / 120)
        return Encoding.named(name, resize=automatic if self.resize is None else self.resize, blur=self.blur)


@dataclass
class LearningOptions(RouteOptions):
    """What learns."""

    model: str = "perfect-memory"
    """A model's name (see tussock models), or a file that tussock train wrote: it knows its views, encoding and size."""

    def prepare(self) -> "Lesson":
        """Everything that a model is to learn, and everything that can be refused before long work begins."""
        from .familiarity import check_device
        from .models import make_model
        from .training import training_poses

        check_device(self.device)
        saved = self._open_model() if self.model.endswith(FILE_SUFFIX) else None
        model = make_model(self.model, seed=self.seed, device=self.device) if saved is None else saved.model
        encoding = self.chosen_encoding() if saved is None or saved.encoding is None else saved.encoding
        world, route = self.open_route()
        views = route.resampled(self.spacing_m)
        poses = training_poses(views, every=self.every, learning_walk=self.learning_walk_m, field=world.field)
        return Lesson(
            world=world, route=route, route_views=views, poses=poses, encoding=encoding, model=model, saved=saved
        )

    def _open_model(self) -> "SavedModel":
        """A model from a file. Refuses flags that say otherwise than it."""
        from .model_files import load_model

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
    model: "Model"
    saved: "SavedModel | None"

    def teach(self, renderer: "Renderer") -> "np.ndarray | None":
        """Train the model, showing progress, unless it comes from a file; return the poses of the views it knows, if known."""
        from .training import learn

        say(f"renderer: {renderer.backend}")
        if self.saved is not None:
            return self.saved.poses
        with progress("learning", "views") as report:
            return learn(self.model, self.encoding, renderer, self.poses, report)
