"""The commands that make worlds and routes, and look at them. Heavy packages are imported where they are used."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from tussock.world.errors import FileError, SettingError

from ..surroundings import Surroundings
from .command import Command
from .options import WORLD, MeshOptions, ViewOptions
from .terminal import message

if TYPE_CHECKING:
    import numpy as np

    from tussock.render.renderer import Renderer
    from tussock.world.scene import World


@dataclass
class WorldCommand(Command):
    """Generate a world and save it, or list those that there are."""

    list: bool = False
    """List the presets instead."""
    out: Path | None = None
    """File to write: .glb or .ply. Needed, but for a list."""
    preset: str = "tussock-field"
    """Name of a preset, after which parameters may follow, as in 'meadow field_width=20'; --list lists the names."""
    seed: int = 0
    """The same seed gives the same file."""
    picture: Path | None = None
    """Also draw the world from above into this file (.png or .svg)."""

    def run(self) -> dict[str, Any]:
        from tussock.world.atomic import check_writable
        from tussock.world.files import write_world
        from tussock.world.params import DESCRIPTIONS, WORLDS
        from tussock.world.scene import World

        if self.list:
            return {"worlds": {name: {"what": DESCRIPTIONS.get(name, "")} for name in WORLDS.names}}
        if self.out is None:
            raise SettingError("--out is missing: give the file to write, such as --out world.glb, or --list")
        check_writable(self.out)
        check_picture(self.picture)
        world = World.generate(self.preset, self.seed)
        write_world(world, self.out)
        if self.picture is not None:
            from ..reports.maps import write_overview

            write_overview(world, self.picture, title=f"{self.preset}, seed {self.seed}")
        return {"world": str(self.out), "preset": self.preset, "seed": self.seed, "triangles": len(world.triangles)}


@dataclass
class ViewCommand(ViewOptions):
    """Draw the panorama seen at a pose."""

    at: Annotated[str | None, tyro.conf.arg(metavar="X,Y,HEADING_DEG")] = None
    """Where the eye is (m) and faces (degrees counter-clockwise from +x, east). Default: the middle of the world, facing north."""
    out: Path = Path("view.png")
    """PNG to write: ahead in the middle, behind at both edges."""
    pitch_deg: float | None = None
    """Elevation of the direction ahead of the eye. Default: that of the body, as --gaze and --pitch-noise-deg say."""
    roll_deg: float | None = None
    """Turn of the eye about the direction ahead; positive: its right side down. Default: likewise."""
    alpha: bool = False
    """Write RGBA: alpha is the share of each pixel that is not open sky."""

    def run(self) -> dict[str, Any]:
        import cv2
        import numpy as np

        from tussock.world.atomic import check_writable, replacing

        if self.out.suffix.lower() != ".png":
            raise FileError(f"{self.out}: a view is written as .png")
        check_writable(self.out)
        surroundings = self.surroundings()
        world = surroundings.open_world()
        x, y, heading_deg = self.position(world)
        with surroundings.open_renderer(world) as renderer:
            view = renderer.render(self._tilted(renderer, np.array([[x, y, math.radians(heading_deg)]])))[0]
            backend = renderer.backend
        message(f"renderer: {backend}")
        if surroundings.eye.compound is not None:
            from tussock.render.ommatidia_picture import draw_ommatidia

            count = len(surroundings.eye.compound.ommatidia().azimuth)
            message(f"each facet is what one of {count:,} ommatidia sees; black: none looks there")
            view = draw_ommatidia(view, surroundings.eye)
        elif surroundings.eye.masked:
            hidden, shown_as = 1 - surroundings.eye.visible().mean(), "transparent" if self.alpha else "black"
            message(f"{shown_as}: what the eye does not see, {hidden:.0%} of the panorama")
            view = surroundings.eye.hide(view[None])[0]
        image = cv2.cvtColor(view, cv2.COLOR_RGBA2BGRA)
        with replacing(self.out) as partial:
            partial.write_bytes(
                cv2.imencode(".png", image if self.alpha else np.ascontiguousarray(image[..., :3]))[1].tobytes()
            )
        return {"view": str(self.out), "width": view.shape[1], "height": view.shape[0], "renderer": backend}

    def _tilted(self, renderer: "Renderer", poses: "np.ndarray") -> "np.ndarray":
        """Poses with the pitch and the roll that are asked for."""
        from tussock.render.poses import poses_of_eye
        from tussock.render.tilted_eye import TiltedEye

        tilt = [None if angle is None else math.radians(angle) for angle in (self.pitch_deg, self.roll_deg)]
        if tilt == [None, None]:
            return poses
        if not all(angle is None or abs(angle) <= math.pi for angle in tilt):  # nan as well
            raise SettingError("--pitch-deg and --roll-deg are from -180 to 180")
        carried = isinstance(renderer, TiltedEye)
        full = renderer.full_poses(poses) if carried else poses_of_eye(renderer.world, renderer.eye, poses)
        for column, angle in enumerate(tilt, start=4):
            full[:, column] = full[:, column] if angle is None else angle
        return full

    def position(self, world) -> tuple[float, float, float]:
        """x, y (m) and heading (degrees) to look from."""
        from tussock.world.origin import local_xy

        field = world.field
        if self.at is None:
            return (field.x_min + field.x_max) / 2, (field.y_min + field.y_max) / 2, 90.0
        *xy, heading_deg = numbers(self.at, "--at", "X,Y,HEADING_DEG", "5,5,90")
        x, y = local_xy(world, [xy], "--at")[0].tolist()
        if not (math.isfinite(heading_deg) and field.contains(x, y)):
            raise SettingError(f"--at {self.at}: that is outside the world ({field}); choose a position inside")
        return x, y, heading_deg


@dataclass
class RouteCommand(MeshOptions):
    """Find a walkable route through a world and save it; several seeds and one goal give several routes to one place."""

    world: Annotated[str, tyro.conf.arg(help=WORLD)] = "tussock-field"
    ground: Annotated[str, tyro.conf.arg(metavar="flat|mesh")] = "flat"
    """flat: the route is at z = 0, or on generated hills. mesh: on the ground of the world's mesh, as of a scan (docs/your-data.md)."""
    max_slope_deg: float = 45.0
    """Steepest ground of a mesh that can be walked on."""
    seed: int = 0
    """The same seed gives the same route (and world, where it is generated)."""
    route_seed: int | None = None
    """Seed of the route alone. Default: --seed."""
    length_m: float = 8.0
    """Length of the route."""
    goal: Annotated[str | None, tyro.conf.arg(metavar="X,Y")] = None
    """Where it ends (m), to within a decimetre. Default: anywhere."""
    out: Path = Path("route.csv")
    """File to write (.csv)."""
    picture: Path | None = None
    """Also draw world and route from above into this file (.png or .svg)."""

    def run(self) -> dict[str, Any]:
        from tussock.world.atomic import check_writable
        from tussock.world.origin import local_xy
        from tussock.world.route_files import write_route
        from tussock.world.routes import generate_route

        if self.out.suffix.lower() != ".csv":
            raise FileError(f"{self.out}: a route is written as .csv")
        check_writable(self.out)
        check_picture(self.picture)
        goal = None if self.goal is None else numbers(self.goal, "--goal", "X,Y", "5,5")
        world = world_of(self)
        if goal is not None:
            goal = tuple(local_xy(world, [goal], "--goal")[0].tolist())
        seed = self.seed if self.route_seed is None else self.route_seed
        route = generate_route(world, seed, self.length_m, goal=goal)
        write_route(route, self.out)
        if self.picture is not None:
            from ..reports.maps import write_overview

            write_overview(world, self.picture, route=route, title=f"{self.world}, route {seed}")
        return {"route": str(self.out), "length_m": route.length, "start": route.start[:2], "goal": route.goal[:2]}


def world_of(command: Any) -> "World":
    """The world of a command whose flags describe no eye."""
    return Surroundings(
        world=command.world,
        seed=command.seed,
        reading=command.reading(),
        ground=command.ground,
        max_slope=math.radians(command.max_slope_deg),
    ).open_world()


def numbers(text: str, flag: str, form: str, example: str) -> tuple[float, ...]:
    """Numbers separated by commas, as many as the form has."""
    try:
        found = tuple(float(number) for number in text.split(","))
    except ValueError:
        found = ()
    if len(found) != form.count(",") + 1:
        raise SettingError(f"{flag} {text!r}: give {form}, for example {example}")
    return found


def check_picture(path: Path | None) -> None:
    """Refuse a picture that could not be written after the work. Raises FileError."""
    from tussock.world.atomic import check_writable

    if path is not None:
        check_writable(path)
        if path.suffix.lower() not in (".png", ".svg"):
            raise FileError(f"{path}: a picture from above is written as .png or .svg")
