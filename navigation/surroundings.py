"""Where an experiment takes place: a world, a route through it, and the eye that sees it. Light to import."""

import dataclasses
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import attrs

from tussock.render.eye import Eye
from tussock.world.errors import FileError, SettingError
from tussock.world.headings import HEADINGS
from tussock.world.settings import choice, instance_of, number, settings, switch, text, whole

if TYPE_CHECKING:
    from tussock.render.renderer import Renderer
    from tussock.world.geometry import Route
    from tussock.world.scene import World

S = TypeVar("S", bound="Surroundings")

BACKENDS = ("auto", "cpu", "egl", "osmesa")


def _world(value: Any) -> Any:
    """A world; a file as text, as the command line gives it."""
    if isinstance(value, str):
        return value
    from tussock.world.params import is_generated
    from tussock.world.scene import World

    if isinstance(value, Path):
        return os.path.join(os.curdir, value) if is_generated(str(value)) else str(value)  # a file named like a preset
    if not isinstance(value, World):
        raise SettingError(f"world is {value!r}; give a preset's name, a file or a World")
    return value


def _route(value: Any) -> Any:
    """A route; a file as its path."""
    if isinstance(value, str | Path):
        return Path(value)
    from tussock.world.geometry import Route

    if not isinstance(value, Route | None):
        raise SettingError(f"route is {value!r}; give a Route, its file, or None")
    return value


@settings
class Surroundings:
    """A world, a route through it, and the eye that sees it.

    Attributes:
        world: A preset's name (parameters may follow it), a file, or a `World`.
        world_seed: Of a generated world; None means `seed`.
        cull_back_faces: Triangles are seen from their front only, as the original Sussex renderer did.
        route: A `Route`, its file, or None to generate one.
        route_seed: Of a generated route; None means `seed`.
        route_length: Of a generated route (m).
        headings: How the headings of a route's file are meant; "auto" reads and checks them. See `read_route`.
        columns: Names of the columns of a route's file, as "x [mm],y [mm],-,heading"; None takes its own.
        smooth: Positions of a route's file are averaged along the path with a window of this standard deviation (m); 0 is none.
        eye: What part of the sphere is seen, and how finely.
        seed: Of everything random: world and route where they are generated, and, in an experiment, the model's start and the noise.
        renderer: "auto", "cpu", "egl" or "osmesa".
        threads: To draw with, and, in an experiment, to learn and compare with; None means one for each core.
    """

    world: Any = attrs.field(default="tussock-field", converter=_world)
    world_seed: int | None = whole(None, low=0, optional=True)
    cull_back_faces: bool = switch(False)
    route: Any = attrs.field(default=None, converter=_route)
    route_seed: int | None = whole(None, low=0, optional=True)
    route_length: float = number(8.0, low=0.1, unit="m")
    headings: str = choice("auto", HEADINGS)
    columns: str | None = text(None, optional=True)
    smooth: float = number(0.0, low=0, unit="m")
    eye: Eye = instance_of(Eye, attrs.Factory(Eye), "an Eye")
    seed: int = whole(0, low=0)
    renderer: str = choice("auto", BACKENDS)
    threads: int | None = whole(None, high=4096, optional=True)

    def __attrs_post_init__(self):
        if isinstance(self.world, str):
            from tussock.world.files import check_world

            check_world(self.world)
        if isinstance(self.route, Path) and not self.route.is_file():
            raise FileError(f"there is no route {self.route}; give a file, or none to have one generated")

    def replace(self: S, **changes: Any) -> S:
        """The same with some fields changed; `body__heading_noise=0.1` changes a field of a field."""
        inner: dict[str, dict[str, Any]] = {}
        for name in [name for name in changes if "__" in name]:
            outer, _, field = name.partition("__")
            inner.setdefault(outer, {})[field] = changes.pop(name)
        for outer, fields in inner.items():
            changes[outer] = attrs.evolve(changes.get(outer, getattr(self, outer)), **fields)
        return attrs.evolve(self, **changes)

    def open_world(self) -> "World":
        """The world. Raises InputError where its file cannot be read."""
        from tussock.world.files import open_world
        from tussock.world.scene import World

        seed = self.seed if self.world_seed is None else self.world_seed
        world = self.world if isinstance(self.world, World) else open_world(str(self.world), seed)
        return dataclasses.replace(world, double_sided=False) if self.cull_back_faces else world

    def open_route(self, world: "World") -> "Route":
        """The route through the world. Raises InputError where it leaves the world, or where none is found."""
        from tussock.world.geometry import Route
        from tussock.world.route_files import read_route
        from tussock.world.routes import check_route, generate_route

        seed = self.seed if self.route_seed is None else self.route_seed
        if self.route is None:
            route = generate_route(world, seed, self.route_length)
        else:
            read = (self.headings, self.columns, self.smooth)
            route = self.route if isinstance(self.route, Route) else read_route(self.route, *read)
        check_route(world, route)
        return route

    def open_world_and_route(self) -> "tuple[World, Route]":
        """The world, and the route through it."""
        world = self.open_world()
        return world, self.open_route(world)

    def open_renderer(self, world: "World") -> "Renderer":
        """A renderer of the world for the eye; use it in a `with` statement."""
        from tussock.render.renderer import open_renderer

        return open_renderer(world, self.eye, self.renderer, threads=self.threads)
