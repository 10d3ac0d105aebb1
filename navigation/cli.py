"""The command line: dataclasses with a field a flag, handed to tyro. Heavy packages are imported where they are used."""

import dataclasses
import json
import math
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from world.errors import InputError

NOT_SETTINGS = ("out", "overwrite", "live", "viewer", "json")  # flags of a run that do not change what happens in it
WORLD = (
    "A preset's name (tussock-field, meadow, scrub, tiny), grown from --seed, or a file (.glb, .ply, .bin, .obj, ...)."
)


@dataclass
class WorldCommand:
    """Grow a world and save it."""

    out: Path
    """File to write: .glb or .ply."""
    preset: str = "tussock-field"
    """tussock-field, meadow, scrub or tiny."""
    seed: int = 0
    """The same seed gives the same file."""
    picture: Path | None = None
    """Also draw the world from above into this file (.png or .svg)."""
    json: bool = False
    """Print one JSON object instead of text."""

    def run(self) -> dict[str, Any]:
        from world.files import check_writable, write_world
        from world.scene import World

        check_writable(self.out)
        if self.picture is not None:
            check_writable(self.picture)
            if self.picture.suffix.lower() not in (".png", ".svg"):
                raise InputError(f"{self.picture}: a picture from above is written as .png or .svg")
        world = World.generate(self.preset, self.seed)
        write_world(world, self.out)
        if self.picture is not None:
            from .plots import overview

            overview(world, self.picture, title=f"{self.preset}, seed {self.seed}")
        return {"world": str(self.out), "preset": self.preset, "seed": self.seed, "triangles": len(world.triangles)}


@dataclass
class Sight:
    """What world is seen, through what eye."""

    world: Annotated[str, tyro.conf.arg(help=WORLD)] = "tussock-field"
    seed: int = 0
    """Seed of everything random: the world and route where they are generated, the model's start, the heading noise."""
    size: str = "720x150"
    """Columns x rows of a panorama. A pixel wider than a degree is averaged from several rays."""
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
        from world.generate import PRESETS

        if self.world in PRESETS:
            world = World.generate(self.world, self.seed)
        elif not Path(self.world).suffix and not Path(self.world).exists():
            raise InputError(f"unknown world {self.world!r}; give one of {', '.join(PRESETS)}, or a file")
        else:
            world = read_world(self.world)
        return dataclasses.replace(world, double_sided=False) if self.cull_back_faces else world

    def width_and_height(self) -> tuple[int, int]:
        """Columns and rows of a panorama."""
        width, cross, height = self.size.lower().partition("x")
        if not (cross and width.isdecimal() and height.isdecimal()):
            raise InputError(f"size {self.size!r}: give columns x rows, for example 720x150")
        return int(width), int(height)

    def open_renderer(self, world):
        from render import Eye, open_renderer

        width, height = self.width_and_height()
        eye = Eye(
            width=width, height=height, top=math.radians(self.top_deg), bottom=math.radians(self.bottom_deg),
            z=self.eye_height_m, samples=self.samples,
        )  # fmt: skip
        return open_renderer(world, eye, self.renderer)


@dataclass
class ViewCommand(Sight):
    """Draw the panorama seen at a pose."""

    at: Annotated[str | None, tyro.conf.arg(metavar="X,Y,HEADING_DEG")] = None
    """Where to stand (m) and face (degrees counter-clockwise from +x, east). Default: the middle of the world, facing north."""
    out: Path = Path("view.png")
    """PNG to write: ahead in the middle, behind at both edges."""
    alpha: bool = False
    """Write RGBA: alpha is the share of each pixel that is not open sky."""
    json: bool = False
    """Print one JSON object instead of text."""

    def run(self) -> dict[str, Any]:
        import cv2
        import numpy as np

        from world.files import check_writable, replacing

        if self.out.suffix.lower() != ".png":
            raise InputError(f"{self.out}: a view is written as .png")
        check_writable(self.out)
        world = self.open_world()
        x, y, heading_deg = self.place(world.field)
        with self.open_renderer(world) as renderer:
            view = renderer.render([(x, y, math.radians(heading_deg))])[0]
            backend = renderer.backend
        say(f"renderer: {backend}")
        image = cv2.cvtColor(view, cv2.COLOR_RGBA2BGRA)
        with replacing(self.out) as partial:
            partial.write_bytes(
                cv2.imencode(".png", image if self.alpha else np.ascontiguousarray(image[..., :3]))[1].tobytes()
            )
        return {"view": str(self.out), "width": view.shape[1], "height": view.shape[0], "renderer": backend}

    def place(self, field) -> tuple[float, float, float]:
        """x, y (m) and heading (degrees) to look from."""
        if self.at is None:
            return (field.x_min + field.x_max) / 2, (field.y_min + field.y_max) / 2, 90.0
        try:
            x, y, heading_deg = (float(number) for number in self.at.split(","))
        except ValueError:
            raise InputError(f"--at {self.at!r}: give X,Y,HEADING_DEG, for example 5,5,90") from None
        if not (math.isfinite(heading_deg) and field.contains(x, y)):
            raise InputError(f"--at {self.at}: that is outside the world ({field}); choose a place inside")
        return x, y, heading_deg


@dataclass
class Learning(Sight):
    """What is learned, and from which views."""

    route: Path | None = None
    """A route file (.csv or AntWorld .bin); without it a route of about 8 m is generated."""
    model: str = "perfect-memory"
    """visual-compass, perfect-memory or mlp."""
    encoding: str = "edges"
    """edges, grey or sky; or a chain of steps, such as 'sky-mask | vertical-edges | resize 6 | normalise'."""
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

    def prepare(self):
        """The world, the route (resampled), the encoding and the untrained model: everything that can be refused early."""
        from world.files import read_route
        from world.walk import generate_route

        from .encoding import Encoding
        from .models import make_model

        model = make_model(self.model, self.seed)
        automatic = 1.0 if "|" in self.encoding else max(1.0, self.width_and_height()[0] / 120)
        encoding = Encoding.named(
            self.encoding, resize=automatic if self.resize is None else self.resize, blur=self.blur
        )
        route = read_route(self.route) if self.route else None
        world = self.open_world()
        route = (route or generate_route(world, self.seed)).resampled(self.spacing_m)
        inside = world.field.contains(*route.xy.T)
        if not inside.all():
            x, y = route.xy[~inside][0]
            raise InputError(
                f"the route leaves the world ({world.field}) at ({x:g}, {y:g}) m; choose a route of this world"
            )
        return world, route, encoding, model

    def learn(self, model, encoding, renderer, route):
        """Train the model; return the poses whose views it learned."""
        from .training import learn, training_poses

        poses = training_poses(route, every=self.every, learning_walk=self.learning_walk_m, field=renderer.world.field)
        say(f"renderer: {renderer.backend}")
        with progress("learning", "views") as report:
            return learn(model, encoding, renderer, poses, report)


@dataclass
class EvaluateCommand(Learning):
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

        from .evaluation import grid_positions, heading_errors

        began = time.perf_counter()
        check_scan_deg(self.scan_deg)
        world, route, encoding, model = self.prepare()
        positions = grid_positions(route, grid=self.grid_m, within=self.within_m, field=world.field)
        with self.open_renderer(world) as renderer:
            poses = self.learn(model, encoding, renderer, route)
            with progress("recovering headings", "positions") as report:
                found = heading_errors(
                    model, encoding, renderer, route, positions, scan=math.radians(self.scan_deg), progress=report
                )
        return {
            "model": self.model, "encoding": str(encoding), "n_views": len(poses), "n_positions": len(positions),
            "median_error_deg": found.median_error_deg, "mean_error_deg": found.mean_error_deg,
            "share_over_45": found.share_over_45, "seconds": time.perf_counter() - began,
        }  # fmt: skip


@dataclass
class RunCommand(Learning):
    """Learn a route and walk it home, recorded."""

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
    """stop, or reset: put the agent back on the route after the furthest waypoint reached, and count it."""
    arrive_m: float = 0.15
    """Arrived within this distance of the route's end."""
    lost_m: float = 0.5
    """Lost beyond this distance from the route."""
    patience_m: float = 3.0
    """Stuck in a loop after walking this far without getting farther along the route."""
    max_steps: int | None = None
    """Out of steps after so many. Default: three times the route's length."""
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
        from .agent import Agent
        from .runs import check_free, claim, record_walk

        viewer = self.viewer if self.live else None
        check_free(self.out, overwrite=self.overwrite, viewer=viewer)
        check_scan_deg(self.scan_deg)
        if self.on_lost not in ("stop", "reset"):
            raise InputError(f"--on-lost {self.on_lost!r}: give stop or reset")
        world, route, encoding, model = self.prepare()
        with self.open_renderer(world) as renderer:
            agent = Agent(
                renderer=renderer, encoding=encoding, model=model, route=route, step_length=self.step_m,
                scan=math.radians(self.scan_deg),
                scan_about=None if self.scan_about_deg is None else math.radians(self.scan_about_deg),
                heading_noise=math.radians(self.heading_noise_deg), arrive=self.arrive_m, lost=self.lost_m,
                patience=self.patience_m, max_steps=self.max_steps, reset_when_lost=self.on_lost == "reset", seed=self.seed,
            )  # fmt: skip
            start = agent.start(self.offset_m)
            claim(self.out)
            poses = self.learn(model, encoding, renderer, route)
            settings = {key: value for key, value in dataclasses.asdict(self).items() if key not in NOT_SETTINGS}
            settings |= {"encoding": str(encoding), "renderer": renderer.backend, "n_views": len(poses)}
            with progress("walking", "steps") as report:
                return record_walk(
                    agent, start, self.out, training_poses=poses, settings=settings, viewer=viewer, progress=report
                )


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
        from .runs import play

        return play(self.run_folder, web=self.web, screenshot=self.screenshot)


COMMANDS: dict[str, Any] = {
    "world": WorldCommand,
    "view": ViewCommand,
    "evaluate": EvaluateCommand,
    "run": RunCommand,
    "play": PlayCommand,
}


def check_scan_deg(scan_deg: float) -> None:
    """Refuse a scan that is no angle. Raises InputError."""
    if not 0 < scan_deg <= 360:
        raise InputError(f"--scan-deg {scan_deg:g}: give over 0 and up to 360")


def say(text: str) -> None:
    """Tell the person something that is not the result."""
    print(text, file=sys.stderr)


def progress(what: str, unit: str):
    """A context that shows progress on standard error; it gives a function report(done, total)."""
    from contextlib import contextmanager

    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    @contextmanager
    def shown():
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn(unit),
            TimeRemainingColumn(),
        )
        console = Console(stderr=True)
        with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
            task = bar.add_task(what, total=None)
            yield lambda done, total: bar.update(task, completed=done, total=total)

    return shown()


def show(result: dict[str, Any]) -> None:
    """Print a result for people: a line a value."""
    width = max(map(len, result))
    for key, value in result.items():
        print(f"{key:<{width}}  {f'{value:.4g}' if isinstance(value, float) else value}")


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exit with 2 and one line for bad input, 130 when interrupted."""
    command = tyro.extras.subcommand_cli_from_dict(
        COMMANDS, prog="tussock", args=arguments, config=(tyro.conf.FlagCreatePairsOff,),
        description="Insect visual route navigation: grow a world, look around in it, learn a route, walk it home.",
    )  # fmt: skip
    as_json = command.json
    # Libraries may print where they like; with --json only the object reaches standard output.
    output = os.dup(1)
    try:
        if as_json:
            sys.stdout.flush()
            os.dup2(2, 1)
        result = command.run()
        sys.stdout.flush()
        os.dup2(output, 1)
        if as_json:
            print(json.dumps(result), flush=True)
        else:
            show(result)
    except InputError as error:
        fail(str(error))
    except OSError as error:
        fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    except KeyboardInterrupt:
        say("tussock: interrupted")
        sys.exit(130)
    finally:
        os.close(output)


def fail(message: str) -> None:
    """Say what was wrong in one line and exit with code 2."""
    say(f"tussock: {' '.join(message.split())}")
    sys.exit(2)


if __name__ == "__main__":
    main()
