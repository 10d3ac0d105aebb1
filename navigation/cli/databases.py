"""The commands of `tussock database`. Heavy packages are imported where they are used."""

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from tussock.render.posture import Posture
from tussock.world.errors import InputError, SettingError

from ..training_setup import ROUTE_SPACING
from .command import Command
from .options import RouteOptions, ViewOptions
from .terminal import message, progress
from .worlds import numbers

if TYPE_CHECKING:
    from tussock.render.images.writing import Grid
    from tussock.render.poses import Poses
    from tussock.world.geometry import Bounds
    from tussock.world.scene import World

MIN_SPACING = 0.001  # m


@dataclass(kw_only=True)
class DatabaseGridCommand(ViewOptions):
    """Draw the views at all positions of a grid, facing east, as an image database in the BoB format."""

    out: Path
    """Folder to write; one that was interrupted is completed."""
    spacing_m: float = 0.2
    """Positions are the multiples of this in x and y .."""
    from_m: Annotated[str | None, tyro.conf.arg(metavar="X,Y")] = None
    """.. from here .. Default: 0,0, or the world's corner where that lies farther inside."""
    to_m: Annotated[str | None, tyro.conf.arg(metavar="X,Y")] = None
    """.. to here. Default: 10,10, or the world's corner where that lies farther inside."""

    def run(self) -> dict[str, Any]:
        from tussock.world.origin import local_xy

        if not (math.isfinite(self.spacing_m) and self.spacing_m >= MIN_SPACING):
            raise SettingError(
                f"--spacing-m {self.spacing_m:g}: give at least {MIN_SPACING:g}; names hold whole millimetres"
            )
        low, high = (
            None if text is None else numbers(text, flag, "X,Y", "0,0")
            for text, flag in ((self.from_m, "--from-m"), (self.to_m, "--to-m"))
        )
        world = self.surroundings().open_world()
        low, high = (
            corner and tuple(local_xy(world, [corner], flag)[0].tolist())
            for corner, flag in ((low, "--from-m"), (high, "--to-m"))
        )
        return write(self, world, self.grid(world.field, low, high), self.out)

    def grid(self, field: "Bounds", low: tuple[float, ...] | None, high: tuple[float, ...] | None) -> "Grid":
        """The grid from one corner to the other (m), each by default the published grid's or the field's."""
        from tussock.render.images.writing import Grid, published_grid_area
        from tussock.world.geometry import Bounds

        for flag, corner in (("--from-m", low), ("--to-m", high)):
            if corner is not None and not field.contains(*corner):
                raise SettingError(f"{flag} {corner[0]:.12g},{corner[1]:.12g}: that is outside the world ({field})")
        usual = published_grid_area(field)
        return Grid.over(Bounds(*(low or usual[:2]), *(high or usual[2:])), self.spacing_m)


@dataclass(kw_only=True)
class DatabaseRouteCommand(RouteOptions):
    """Draw the views along a route, facing along it, as an image database in the BoB format."""

    out: Path
    """Folder to write; one that was interrupted is completed."""
    spacing_m: float = ROUTE_SPACING
    """Distance between views."""

    def run(self) -> dict[str, Any]:
        world, route = self.surroundings().open_world_and_route()
        return write(self, world, route.resampled(self.spacing_m).poses, self.out)


@dataclass
class DatabaseCheckCommand(Command):
    """Look for what is wrong with an image database; exit with 1 where something is."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(name="dir", metavar="DIR")]
    """Folder of the database."""
    headings: Annotated[str, tyro.conf.arg(metavar="auto|ccw|bearing|radians|path|as-is")] = "auto"
    """How its headings are meant. auto: as bearings, which the format has; as-is leaves out their check."""

    def run(self) -> dict[str, Any]:
        import dataclasses

        from tussock.render.images.check import check_database
        from tussock.render.images.database import read_database

        problems = check_database(self.folder, self.headings)
        try:
            database = read_database(self.folder)
            kind, images = database.kind, len(database)
        except InputError:  # it is among the problems
            kind, images = None, None
        return {
            "database": str(self.folder),
            "type": kind,
            "images": images,
            "problems": [dataclasses.asdict(problem) for problem in problems],
            "ok": not problems,
        }


def write(options: ViewOptions, world: "World", poses: "Poses | Grid", out: Path) -> dict[str, Any]:
    """Draw a database, showing progress."""
    from tussock.render.images.writing import write_database

    began, surroundings = time.perf_counter(), options.surroundings()
    if surroundings.posture != Posture():
        raise SettingError(
            "the images of a database are turned later, so they are drawn by a level eye: leave out --gaze, --body-length-m, "
            "--pitch-noise-deg and --roll-noise-deg"
        )
    with surroundings.open_renderer(world) as renderer:
        message(f"renderer: {renderer.backend}")
        with progress("drawing", "views") as report:
            database, rendered = write_database(out, renderer, poses, report)
    return {
        "database": str(out),
        "type": database.kind,
        "images": len(database),
        "rendered": rendered,
        "seconds": time.perf_counter() - began,
    }
