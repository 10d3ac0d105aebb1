"""What the commands share: flags that choose the world, the eye, the route and what is kept of a view."""

import dataclasses
import math
import shlex
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from tussock.world.errors import InputError

from .terminal import saying_when_slow

if TYPE_CHECKING:
    from tussock.render.eye import Eye
    from tussock.world.geometry import Route
    from tussock.world.scene import World

    from ..encoding import Encoding

WORLD = (
    "A preset's name (tussock-field, meadow, scrub, tiny), grown from a seed; its parameters may follow, as in "
    "'tussock-field field_width=20'. Or a file (.glb, .ply, .bin, .obj, ...)."
)

ROUTE_SPACING = (
    0.02  # m, between the route views of a database and of the studies: docs/report.md derives it from the thesis
)


@dataclass
class SightOptions:
    """What world is seen, through what eye."""

    world: Annotated[str, tyro.conf.arg(help=WORLD)] = "tussock-field"
    world_seed: int | None = None
    """Seed of a generated world. Default: --seed."""
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
        from tussock.world.files import open_world

        world = open_world(self.world, self.seed if self.world_seed is None else self.world_seed)
        return dataclasses.replace(world, double_sided=False) if self.cull_back_faces else world

    def width_and_height(self) -> tuple[int, int]:
        """Columns and rows of a panorama."""
        width, cross, height = (self.size or "720x150").lower().partition("x")
        if not (cross and width.isdecimal() and height.isdecimal()):
            raise InputError(f"size {self.size!r}: give columns x rows, for example 720x150")
        return int(width), int(height)

    def eye(self) -> "Eye":
        """The eye that these flags describe."""
        from tussock.render import Eye

        width, height = self.width_and_height()
        return Eye(
            width=width, height=height, top=math.radians(self.top_deg), bottom=math.radians(self.bottom_deg),
            z=self.eye_height_m, samples=self.samples,
        )  # fmt: skip

    def open_renderer(self, world, threads: int | None = None):
        from tussock.render import open_renderer

        with saying_when_slow(
            "opening the renderer; where it is used for the first time, it is compiled, which takes some seconds"
        ):
            return open_renderer(world, self.eye(), self.renderer, threads=threads)


@dataclass
class PathOptions(SightOptions):
    """What world is seen, through what eye, and a route through it."""

    route: Path | None = None
    """A route file (.csv or AntWorld .bin); without it one is generated."""
    route_seed: int | None = None
    """Seed of a generated route. Default: --seed."""
    route_length_m: float = 8.0
    """Length of a generated route."""

    def open_route(self) -> tuple["World", "Route"]:
        """The world, and the route through it."""
        from tussock.world.route_files import read_route
        from tussock.world.routes import check_route, generate_route

        route = read_route(self.route) if self.route else None
        world = self.open_world()
        if route is None:
            route = generate_route(
                world, self.seed if self.route_seed is None else self.route_seed, self.route_length_m
            )
        check_route(world, route)
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
        from ..encoding import Encoding

        name = self.encoding or "edges"
        automatic = 1.0 if "|" in name else max(1.0, self.width_and_height()[0] / 120)
        return Encoding.named(name, resize=automatic if self.resize is None else self.resize, blur=self.blur)


def words_of(options: object, kind: type, leave_out: Collection[str] = ()) -> str:
    """The flags that spell options, those of the fields of `kind` that are not as by default, as they are typed."""
    words = []
    for each in dataclasses.fields(kind):
        value = getattr(options, each.name)
        if each.name in leave_out or value == each.default:
            continue
        flag = f"--{each.name.replace('_', '-')}"
        words += [flag] if value is True else [flag, str(value)]
    return shlex.join(words)
