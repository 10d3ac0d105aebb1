"""Where an experiment takes place: a world or image databases, a route, and the eye that sees them. Light to import."""

import logging
import math
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import attrs

from tussock.render.backends import BACKENDS
from tussock.render.eye import Eye
from tussock.render.posture import Posture
from tussock.world.errors import FileError, SettingError
from tussock.world.heading_names import HEADINGS
from tussock.world.meshes.reading import MeshReading
from tussock.world.settings import (
    MAX_COORDINATE,
    choice,
    converted,
    instance_of,
    number,
    refuse,
    settings,
    switch,
    text,
    whole,
)

from .surroundings_fields import as_folder, as_light, as_route, as_world

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

    from tussock.render.renderer import Renderer
    from tussock.world.eye_change import EyeMount
    from tussock.world.geometry import Route
    from tussock.world.scene import World
    from tussock.world.specs import Spec

log = logging.getLogger(__name__)
S = TypeVar("S", bound="Surroundings")

GROUNDS = ("flat", "mesh", "route")
LOW = 0.05  # m; what is lower counts as walked
OF_WORLDS = (
    "world",
    "world_seed",
    "reading",
    "ground",
    "max_slope",
    "altitude",
    "cull_back_faces",
    "light",
    "route",
    "route_seed",
    "route_length",
    "columns",
    "smooth",
    "renderer",
    "posture",
)  # fields that databases do not take


def _eye(surroundings: "Surroundings") -> Eye:
    """The eye that saw the images of the databases; without them, the default one."""
    if surroundings.route_database is None:
        return Eye()
    from tussock.render.images.folders import eye_of

    return eye_of(surroundings.route_database, surroundings.grid_database)


@cache  # once, however many renderers are opened
def _remark_on_flat_ground() -> None:
    log.warning("gaze body changes nothing on flat ground: give --ground mesh for the ground of the world's mesh")


@settings
class Surroundings:
    """A world and a route through it, or image databases of a route and of the views around it; and the eye that sees them.

    Attributes:
        world: A preset's name (parameters may follow it), a file, or a `World`.
        world_seed: Of a generated world; None means `seed`.
        reading: How the file of a world is read: its axis that is up, its unit, and whether losses are refused.
        ground: "flat": agents stand at z = 0, or, in a world that has a terrain of its own (a generated one with hills), on that.
            "mesh": on the surface of the world's mesh beneath them (see `World.on_mesh`). "route":
            they fly, at the heights of the route (`Route.heights`): everywhere at that of its nearest point.
        max_slope: Steepest ground of a mesh that can be stood and walked on (rad).
        altitude: Height over z = 0 at which they fly, as that of their eye (m); None: as `ground` says.
        cull_back_faces: Triangles are seen from their front only, as the original Sussex renderer did.
        light: The sun and the sky: a spec, such as "sun azimuth_deg=90" (see world/light.py). None: the light in the world's own
            colours, without shadows, and a sky of one colour.
        route: A `Route`, its file, or None to generate one. It may be in the coordinates of the world's file; see `World.origin_m`.
        route_seed: Of a generated route; None means `seed`.
        route_length: Of a generated route (m).
        headings: How the headings of a route's file, or of image databases, are meant; "auto" reads and checks them. See `read_route`.
        columns: Names of the columns of a route's file, as "x [mm],y [mm],-,heading"; None takes its own.
        smooth: Positions of a route's file are averaged along the path with a window of this standard deviation (m); 0 is none.
        route_database: Folder of an image database of a route, in place of a world and a route.
        grid_database: Folder of an image database of the views around that route, which agents see: the one nearest to them. None:
            they see those of the route.
        eye: What part of the sphere is seen, and how finely. Default: that of the databases, or `Eye()`.
        posture: How the body holds the eye: level, or as the ground slopes.
        seed: Of everything random: world and route where they are generated, and, in an experiment, the model's start and the noise.
        renderer: "auto", "cpu", "cuda", "egl" or "osmesa".
        threads: To draw with, and, in an experiment, to learn and compare with; None means one for each core.
    """

    world: Any = attrs.field(default="tussock-field", converter=as_world)
    world_seed: int | None = whole(None, low=0, optional=True)
    reading: MeshReading = instance_of(MeshReading, attrs.Factory(MeshReading), "a MeshReading")
    ground: str = choice("flat", GROUNDS)
    max_slope: float = number(math.radians(45.0), low=math.radians(1.0), high=math.radians(89.0), unit="rad")
    altitude: float | None = number(None, low=-MAX_COORDINATE, high=MAX_COORDINATE, unit="m", optional=True)
    cull_back_faces: bool = switch(False)
    light: "Spec | None" = converted(default=None, converter=as_light)
    route: Any = attrs.field(default=None, converter=as_route)
    route_seed: int | None = whole(None, low=0, optional=True)
    route_length: float = number(8.0, low=0.1, unit="m")
    headings: str = choice("auto", HEADINGS)
    columns: str | None = text(None, optional=True)
    smooth: float = number(0.0, low=0, unit="m")
    route_database: Path | None = attrs.field(default=None, converter=as_folder)
    grid_database: Path | None = attrs.field(default=None, converter=as_folder)
    eye: Eye = instance_of(Eye, attrs.Factory(_eye, takes_self=True), "an Eye")
    posture: Posture = instance_of(Posture, attrs.Factory(Posture), "a Posture")
    seed: int = whole(0, low=0)
    renderer: str = choice("auto", BACKENDS)
    threads: int | None = whole(None, high=4096, optional=True)

    def __attrs_post_init__(self):
        if self.route_database is not None or self.grid_database is not None:
            self._check_databases()
            return
        if self.eye.known is not None:
            raise SettingError(
                "an eye's known pixels are of recorded images, and a world is drawn all around; give mask instead"
            )
        if self.altitude is not None and self.ground != "flat":
            raise SettingError(
                f"agents fly at an altitude of {self.altitude:g} m, or as ground {self.ground!r} says: give one of the two"
            )
        if isinstance(self.world, str):
            from tussock.world.files import check_world

            check_world(self.world)
        if isinstance(self.route, Path) and not self.route.is_file():
            raise FileError(f"there is no route {self.route}; give a file, or none to have one generated")

    def _check_databases(self) -> None:
        """Refuse a grid without a route, and what contradicts databases. Raises SettingError."""
        if self.route_database is None:
            raise SettingError(
                f"{self.grid_database} is a grid without a route; give the image database of a route as well"
            )
        fields = attrs.fields_dict(type(self))
        usual = {name: fields[name].default for name in OF_WORLDS} | {"reading": MeshReading(), "posture": Posture()}
        for name in OF_WORLDS:
            if (value := getattr(self, name)) != usual[name]:
                refuse(self, fields[name], value, "none with image databases, which take the place of a world")

    def replace(self: S, **changes: Any) -> S:
        """The same with some fields changed; `body__heading_noise=0.1` changes a field of a field."""
        inner: dict[str, dict[str, Any]] = {}
        for name in [name for name in changes if "__" in name]:
            outer, _, field = name.partition("__")
            inner.setdefault(outer, {})[field] = changes.pop(name)
        for outer, fields in inner.items():
            changes[outer] = attrs.evolve(changes.get(outer, getattr(self, outer)), **fields)
        return attrs.evolve(self, **changes)

    def check_reading(self) -> None:
        """Refuse an axis or a unit where the world is not a file. Raises SettingError."""
        from tussock.world.params import is_generated

        of_file = isinstance(self.world, str) and not is_generated(self.world)
        if self.reading.changes_coordinates and not of_file:
            made = "generated" if isinstance(self.world, str) else "in memory"
            raise SettingError(f"up, unit and scale are for files of meshes, and this world is {made}: leave them out")

    def open_world(self) -> "World":
        """The world; that of databases has no triangles.

        Raises InputError where its file cannot be read, or where an axis or a unit is given without a file.
        """
        if self.route_database is not None:
            from tussock.render.images.folders import world_of

            return world_of(self.route_database, self.grid_database)
        from .opened_world import lit_world

        return lit_world(self)

    def open_route(self, world: "World") -> "Route":
        """The route through the world, or that of the database. Raises InputError where it leaves the world, or where none is found."""
        if self.route_database is not None:
            from tussock.render.images.folders import route_of

            return route_of(self.route_database, self.headings)
        from tussock.world.routes import check_route, generate_route

        route = self.given_route(world)
        if route is None:
            route = generate_route(world, self.seed if self.route_seed is None else self.route_seed, self.route_length)
        elif (
            route.heights is not None
            and self.ground == "flat"
            and self.altitude is None
            and (high := abs(route.heights).max()) > LOW
        ):
            log.warning(
                "the route is up to %.3g m high, and agents stay on the ground: give --ground route to fly at its heights",
                high,
            )
        check_route(world, route)
        return route

    def given_route(self, world: "World") -> "Route | None":
        """The route that was given, in the world's own coordinates; None where it is to be generated."""
        from tussock.world.geometry import Route
        from tussock.world.origin import local_route
        from tussock.world.route_files import read_route

        if self.route is None:
            return None
        read = (self.headings, self.columns, self.smooth)
        route = self.route if isinstance(self.route, Route) else read_route(self.route, *read)
        return local_route(world, route, "the route" if route is self.route else f"the route {self.route}")

    def open_world_and_route(self) -> "tuple[World, Route]":
        """The world, and the route through it."""
        world = self.open_world()
        return world, self.open_route(world)

    def open_renderer(self, world: "World", *, mount: "EyeMount | None" = None) -> "Renderer":
        """A renderer of the world for the eye, or the views of the databases; use it in a `with` statement.

        Args:
            world: The world.
            mount: How the eye is mounted, if otherwise than it was.
        """
        if self.route_database is not None:
            from tussock.render.images.source import open_views

            return open_views(self.route_database, self.grid_database, self.eye, self.headings)
        from tussock.render.renderer import open_renderer

        if self.posture.gaze == "body" and world.terrain is None:
            _remark_on_flat_ground()
        if self.eye.z < 0 and world.ground is not None:
            log.warning("the eye is %g m under the ground: give --eye-height-m over 0", -self.eye.z)
        renderer = open_renderer(world, self.eye, self.renderer, threads=self.threads)
        if mount is not None and mount != type(mount)():
            from tussock.render.mounted_eye import MountedEye

            renderer = MountedEye(renderer, mount)
        if not self.posture.tilts(world):
            return renderer
        from tussock.render.tilted_eye import TiltedEye

        return TiltedEye(renderer, self.posture, self.seed)

    def open_views_beside(self) -> "Float[np.ndarray, 'k 3']":
        """Poses of the views of the grid database (m, m, rad); none where there is no such database."""
        import numpy as np

        if self.grid_database is None:
            return np.empty((0, 3))
        from tussock.render.images.folders import open_database

        return open_database(self.grid_database, self.headings).poses
