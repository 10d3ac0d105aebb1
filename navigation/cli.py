"""The command line: dataclasses with a field a flag, handed to tyro. Heavy packages are imported where they are used."""

import dataclasses
import json
import math
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from world.errors import InputError

from .options import LearningOptions, SightOptions
from .terminal import progress, say, show

NOT_SETTINGS = ("out", "overwrite", "live", "viewer", "json")  # flags of a run that do not change what happens in it


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
class ViewCommand(SightOptions):
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

        from .evaluation import grid_positions, heading_errors

        began = time.perf_counter()
        if not 0 < self.scan_deg <= 360:
            raise InputError(f"--scan-deg {self.scan_deg:g}: give over 0 and up to 360")
        lesson = self.prepare()
        positions = grid_positions(lesson.route, grid=self.grid_m, within=self.within_m, field=lesson.world.field)
        with self.open_renderer(lesson.world) as renderer:
            learned = lesson.teach(renderer)
            with progress("recovering headings", "positions") as report:
                found = heading_errors(
                    lesson.model, lesson.encoding, renderer, lesson.route_views, positions,
                    scan=math.radians(self.scan_deg), progress=report,
                )  # fmt: skip
        return {
            "model": self.model, "encoding": str(lesson.encoding), "n_views": len(learned), "n_positions": len(positions),
            "median_error_deg": found.median_error_deg, "mean_error_deg": found.mean_error_deg,
            "share_over_45": found.share_over_45, "seconds": time.perf_counter() - began,
        }  # fmt: skip


@dataclass
class RunCommand(LearningOptions):
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
    """Out of steps after so many. Default: as many as walk the route's length three times."""
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
        from .runs import check_run_folder, record_walk

        viewer = self.viewer if self.live else None
        inputs = [Path(name) for name in (self.world, self.route) if name is not None]
        check_run_folder(self.out, overwrite=self.overwrite, inputs=inputs, viewer=viewer)
        if self.on_lost not in ("stop", "reset"):
            raise InputError(f"--on-lost {self.on_lost!r}: give stop or reset")
        lesson = self.prepare()
        with self.open_renderer(lesson.world) as renderer:
            agent = Agent(
                renderer=renderer, encoding=lesson.encoding, model=lesson.model, route=lesson.route,
                step_length=self.step_m, scan=math.radians(self.scan_deg),
                scan_about=None if self.scan_about_deg is None else math.radians(self.scan_about_deg),
                heading_noise=math.radians(self.heading_noise_deg), arrive=self.arrive_m, lost=self.lost_m,
                patience=self.patience_m, max_steps=self.max_steps, reset_when_lost=self.on_lost == "reset",
                seed=self.seed,
            )  # fmt: skip
            start = agent.start(self.offset_m)
            learned = lesson.teach(renderer)
            settings = {key: value for key, value in dataclasses.asdict(self).items() if key not in NOT_SETTINGS}
            settings |= {"encoding": str(lesson.encoding), "renderer": renderer.backend, "n_views": len(learned)}
            with progress("walking", "steps") as report:
                return record_walk(
                    agent, start, self.out, overwrite=self.overwrite, training_poses=learned, settings=settings,
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
        from .runs import play

        return play(self.run_folder, web=self.web, screenshot=self.screenshot)


COMMANDS: dict[str, Any] = {
    "world": WorldCommand,
    "view": ViewCommand,
    "evaluate": EvaluateCommand,
    "run": RunCommand,
    "play": PlayCommand,
}


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; exit with 2 and one line for bad input, 130 when interrupted."""
    command = tyro.extras.subcommand_cli_from_dict(
        COMMANDS, prog="tussock", args=arguments, config=(tyro.conf.FlagCreatePairsOff,),
        description="Insect visual route navigation: grow a world, look around in it, learn a route, walk it home.",
    )  # fmt: skip
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # so that what is open is closed and viewers are ended
    try:
        if command.json:
            with standard_output_as_error():
                result = command.run()
            print(json.dumps(result), flush=True)
        else:
            show(command.run())
    except InputError as error:
        fail(str(error))
    except OSError as error:
        fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    except MemoryError as error:
        fail(f"not enough memory ({error}); take a smaller --size, or fewer views")
    except KeyboardInterrupt:
        say("tussock: interrupted")
        sys.exit(130)


@contextmanager
def standard_output_as_error() -> Iterator[None]:
    """Send what anyone prints to standard error meanwhile, libraries that write to file descriptor 1 included."""
    sys.stdout.flush()
    output = os.dup(1)
    os.dup2(2, 1)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        os.dup2(output, 1)
        os.close(output)


def fail(message: str) -> None:
    """Say what was wrong in one line and exit with code 2."""
    say(f"tussock: {' '.join(message.split())}")
    sys.exit(2)


if __name__ == "__main__":
    main()
