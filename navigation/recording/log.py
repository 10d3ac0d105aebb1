"""Walks as rerun recordings. The only module that imports rerun.

A recorder consumes steps as they come and streams them to disk, so the loop knows nothing of it and a crash leaves a
recording that opens up to the crash. The blueprint travels inside the file: opening it needs no clicking.
"""

import os
import shutil
import socket
import subprocess
import time
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float, Int64, UInt8
from rerun.experimental import ViewerClient

from tussock.render.renderer import Renderer
from tussock.world.atomic import replacing
from tussock.world.errors import InputError
from tussock.world.geometry import Pose, Route, turn_of_columns
from tussock.world.scene import World

from ..failures import ALIASING, CORNER, OCCLUSION, OFF_CATCHMENT, UNEXPLAINED, UNLEARNED, Evidence, cause, in_words
from ..walk import ARRIVED, Step

TIMELINE = "step"

ROUTE_COLOUR, LEARNED_COLOUR, PATH_COLOUR, MATCH_COLOUR = (60, 120, 255), (150, 190, 255), (235, 60, 50), (250, 170, 30)
CAUSE_COLOURS = {  # names are written in them on dark grey
    OCCLUSION: (185, 130, 255), OFF_CATCHMENT: (255, 255, 255), ALIASING: (255, 110, 205), UNLEARNED: (255, 225, 0), CORNER: (0, 225, 225),
    UNEXPLAINED: (185, 185, 185),
}  # fmt: skip
FLUSH_SECONDS = 0.5  # what a crash may lose of a recording
ABOVE = 0.015  # m; lines on the ground are drawn this high to stay visible ..
MARKED = 0.04  # m; .. and marks of poor steps above these
CLOSE = 0.6  # m; marks of one cause nearer than this to the one that names it bear no name


class Recording:
    """A `.rrd` file being written; use it in a `with` statement and `log` each step.

    renderer, training_poses: draw the learned view that was recognised beside the present one (None: not shown).
    lost: deviation (m) to which its plot reaches. live: the address of a running viewer to stream to as well, or None.
    title: shown with the recording, markdown.
    """

    def __init__(
        self, path: Path, world: World, route: Route, *, renderer: Renderer | None = None,
        training_poses: Float[np.ndarray, "n 3"] | None = None, lost: float = 0.5, live: str | None = None, title: str = "",
    ):  # fmt: skip
        self._path, self._renderer, self._training_poses = path, renderer, training_poses
        self._waiting: list[tuple[Step, Evidence | None]] = []
        self._previous: Step | None = None
        self._named: tuple[str, Pose] | None = None  # the cause that was last written beside its mark, and where
        self._streams = [rr.RecordingStream("tussock")]
        blueprint = _blueprint(route, lost)
        self._streams[0].save(path, default_blueprint=blueprint)
        if live is not None:
            check_viewer(live)
            self._streams.append(rr.RecordingStream("tussock"))
            self._streams[1].connect_grpc(live, default_blueprint=blueprint)
        self._log_surroundings(world, route, title)
        self._flush()

    def log(self, step: Step, evidence: Evidence | None = None) -> None:
        """Add one step, and what a `Witness` has to say of it. Steps are written together, those of FLUSH_SECONDS at a time."""
        self._waiting.append((step, evidence))
        if time.monotonic() - self._flushed > FLUSH_SECONDS:
            self._flush()

    def close(self) -> None:
        """Write what is left and close the file."""
        try:
            self._flush()
        finally:
            for stream in self._streams:
                stream.disconnect()

    def _log(
        self, entity: str, what: rr.AsComponents | Iterable[rr.DescribedComponentBatch], *, static: bool = False
    ) -> None:
        for stream in self._streams:
            stream.log(entity, what, static=static)

    def _send(self, entity: str, steps: list[Step], columns: Iterable[rr.ComponentColumn]) -> None:
        """Log an entity at several steps at once."""
        if steps:
            when = rr.TimeColumn(TIMELINE, sequence=[step.index for step in steps])
            for stream in self._streams:
                stream.send_columns(entity, [when], columns)

    def _send_steps(self, steps: list[Step]) -> None:
        """Log what changes from step to step, and the first time what of it does not."""
        if self._previous is None:
            self._log_constants(steps[0])
        here = np.array([(*step.pose[:2], ABOVE) for step in steps])
        facing = _directions(np.array([step.pose.heading + step.turn for step in steps]), 0.2)
        self._send("world/agent", steps, rr.Arrows3D.columns(origins=here, vectors=facing))
        known = steps if self._previous is None else [self._previous, *steps]
        walked = [(before, step) for before, step in pairwise(known) if step.reset is None]
        ways = [[(*before.pose[:2], ABOVE), (*step.pose[:2], ABOVE)] for before, step in walked]
        self._send("world/path", [step for _, step in walked], rr.LineStrips3D.columns(strips=ways))
        self._send("view", steps, _images(np.stack([step.view for step in steps])))
        self._send_matches([step for step in steps if step.match is not None])
        self._send("deviation/m", steps, rr.Scalars.columns(scalars=[step.deviation for step in steps]))
        self._send("error/degrees", steps, rr.Scalars.columns(scalars=np.degrees([step.error for step in steps])))
        for step in steps:
            for stream in self._streams:
                stream.set_time(TIMELINE, sequence=step.index)
            # A bar chart stands on zero: show how much more familiar each heading is than the least familiar one.
            values = step.familiarity[_rightwards(len(step.familiarity))] - step.familiarity.min()
            self._log("familiarity", rr.BarChart(values))
        self._previous = steps[-1]

    def _send_causes(self, poor: list[tuple[Step, Evidence]]) -> None:
        """A mark where a step is poor or failed, in the colour of its cause; the first of several close by says which."""
        marks: dict[str, list[tuple[Step, str]]] = {}
        for step, evidence in poor:
            found = cause(evidence)
            last, where = self._named or ("", step.pose)
            close = last == found and np.hypot(step.pose.x - where.x, step.pose.y - where.y) < CLOSE
            marks.setdefault(found, []).append((step, "" if close else found))
            self._named = self._named if close else (found, step.pose)
        for found, places in marks.items():
            at, labels = [(*step.pose[:2], MARKED) for step, _ in places], [label for _, label in places]
            columns = rr.Points3D.columns(positions=at, labels=labels, show_labels=[label != "" for label in labels])
            self._send(_entity_of(found), [step for step, _ in places], columns)

    def _log_events(self, steps: list[tuple[Step, Evidence | None]]) -> None:
        """What became of a step, in words, where anything did."""
        for step, evidence in steps:
            events = [step.reset and f"{step.reset}: put back on the route", step.reason or step.failure]
            events += [] if evidence is None else [in_words(evidence)]
            for stream in self._streams:
                stream.set_time(TIMELINE, sequence=step.index)
            level = rr.TextLogLevel.INFO if step.reason == ARRIVED else rr.TextLogLevel.WARN
            for event in filter(None, events):
                self._log("events", rr.TextLog(f"step {step.index}: {event}", level=level))

    def _flush(self) -> None:
        """Bring what was logged to disk; rerun by itself holds small things back until there are megabytes of them."""
        waiting, self._waiting = self._waiting, []
        if waiting:
            self._send_steps([step for step, _ in waiting])
            self._send_causes([(step, evidence) for step, evidence in waiting if evidence is not None])
            self._log_events(waiting)
        file, *viewers = self._streams
        try:
            file.flush()
        except RuntimeError as error:
            raise InputError(f"{self._path} cannot be written any more ({error}); make room on its disk") from error
        for viewer in viewers:
            try:
                viewer.flush(timeout_sec=5)
            except RuntimeError as error:  # somebody closed it; the walk and its file go on
                warnings.warn(f"the live viewer is gone ({error}); the walk goes on without it", stacklevel=2)
                self._streams.remove(viewer)
        self._flushed = time.monotonic()

    def __enter__(self) -> "Recording":
        return self

    def __exit__(self, kind, error, at) -> None:
        self.close()

    def _log_surroundings(self, world: World, route: Route, title: str) -> None:
        """What does not change: the world, the route, where views were learned, the axes' names."""
        log = self._log
        log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        triangles, rgb = world.surfaces()
        colours = np.repeat(rgb, 3, axis=0)
        mesh = rr.Mesh3D(
            vertex_positions=triangles.reshape(-1, 3), vertex_colors=colours, vertex_normals=_up(len(colours))
        )
        log("world/mesh", mesh, static=True)
        strip = np.column_stack([route.xy, np.full(len(route.xy), ABOVE)])
        log("world/route", rr.LineStrips3D([strip], colors=ROUTE_COLOUR, radii=0.008), static=True)
        goal = [*route.xy[-1], ABOVE]
        log(
            "world/goal",
            rr.Points3D([goal], colors=ROUTE_COLOUR, radii=0.06),
            static=True,
        )
        if self._training_poses is not None:
            points = np.column_stack([self._training_poses[:, :2], np.full(len(self._training_poses), ABOVE)])
            log("world/learned_views", rr.Points3D(points, colors=LEARNED_COLOUR, radii=0.006), static=True)
        log("deviation/m", rr.SeriesLines(names="deviation from the route (m)", colors=PATH_COLOUR), static=True)
        log("error/degrees", rr.SeriesLines(names="heading error (degrees)", colors=MATCH_COLOUR), static=True)
        for found, colour in CAUSE_COLOURS.items():
            log(_entity_of(found), rr.Points3D.from_fields(colors=colour, radii=0.03), static=True)
        if title:
            log("about", rr.TextDocument(title, media_type="text/markdown"), static=True)

    def _log_constants(self, step: Step) -> None:
        """What steps do not change of what they log."""
        width = len(step.familiarity)
        self._log("world/agent", rr.Arrows3D.from_fields(colors=PATH_COLOUR, radii=0.012), static=True)
        self._log("world/path", rr.LineStrips3D.from_fields(colors=PATH_COLOUR, radii=0.008), static=True)
        self._log("view", rr.Image.from_fields(format=_format(step.view.shape[1], step.view.shape[0])), static=True)
        if step.match is not None and self._renderer is not None and self._training_poses is not None:
            eye = self._renderer.eye
            self._log("recognised", rr.Image.from_fields(format=_format(eye.width, eye.height)), static=True)
            self._log("world/recognised", rr.Arrows3D.from_fields(colors=MATCH_COLOUR, radii=0.008), static=True)
        degrees_right = -np.degrees(turn_of_columns(_rightwards(width), width))
        chart = rr.BarChart(step.familiarity, abscissa=degrees_right, color=MATCH_COLOUR).as_component_batches()
        self._log(
            "familiarity",
            [batch for batch in chart if batch.component_descriptor().component != "BarChart:values"],
            static=True,
        )

    def _send_matches(self, steps: list[Step]) -> None:
        """The learned views that were recognised, and where they were learned."""
        if not steps or self._training_poses is None or self._renderer is None:
            return
        poses = self._training_poses[np.array([step.match for step in steps])]
        self._send("recognised", steps, _images(self._renderer.render(poses)))
        origins = np.column_stack([poses[:, :2], np.full(len(poses), ABOVE)])
        self._send(
            "world/recognised", steps, rr.Arrows3D.columns(origins=origins, vectors=_directions(poses[:, 2], 0.15))
        )


def check_viewer(url: str) -> None:
    """Raise InputError where no viewer listens."""
    at = urlsplit(url)
    try:
        socket.create_connection((at.hostname or "", at.port or 9876), timeout=2).close()
    except (OSError, ValueError) as error:
        raise InputError(f"no rerun viewer listens at {url}; start one with: rerun --bind 127.0.0.1") from error


def screenshot(recording: Path, picture: Path, *, seconds: float = 60.0) -> None:
    """Save what the viewer shows of a recording, once it shows all of it, as a PNG; needs no display.

    Raises InputError where the viewer cannot draw, or is not done within `seconds`.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    options = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", "1600x1000", str(recording)]
    until = time.monotonic() + seconds
    # The viewer loads and greets in the background and tells nobody when it is done: it is when its picture stays the same.
    earlier: list[bytes] = []
    with replacing(picture) as partial, _viewer(options) as viewer:
        while len(earlier) < 4 or len(set(earlier[-4:])) > 1:
            if viewer.poll() is not None or time.monotonic() > until:
                raise InputError("the viewer drew no picture; it needs Vulkan (Debian: mesa-vulkan-drivers libvulkan1)")
            time.sleep(0.5)
            try:
                ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy").save_screenshot(str(partial.absolute()))
                earlier.append(partial.read_bytes())
            except (ConnectionError, OSError, RuntimeError, ValueError):
                continue  # not up yet


def watch(recording: Path, *, web: bool = False) -> None:
    """Open a recording in the viewer and wait until it is closed: a window, or a page served to browsers on this machine only."""
    options = ["--bind", "127.0.0.1", str(recording), *(["--web-viewer"] if web else [])]
    with _viewer(options) as viewer:
        if viewer.wait():
            raise InputError(f"the viewer ended with code {viewer.returncode}; try --web, or --screenshot FILE.png")


def viewer_program() -> str:
    """Path of the viewer. The command `rerun` only starts it, and would leave it running when it is ended itself."""
    package = find_spec("rerun_cli")
    folders = list(package.submodule_search_locations or []) if package else []
    program = shutil.which("rerun", path=os.pathsep.join(folders)) if folders else None
    if program is None:
        raise InputError("the rerun viewer is not installed here; install rerun-sdk")
    return program


@contextmanager
def _viewer(options: list[str]) -> Iterator[subprocess.Popen]:
    """The viewer that came with rerun-sdk, running; ended with the block."""
    program = viewer_program()
    quiet = subprocess.DEVNULL if "--headless" in options else None
    with subprocess.Popen(
        [program, *options], env=os.environ | {"RERUN_ANALYTICS": "false"}, stdout=quiet, stderr=quiet
    ) as viewer:
        try:
            yield viewer
        finally:
            viewer.terminate()
            try:
                viewer.wait(timeout=5)
            except subprocess.TimeoutExpired:
                viewer.kill()


def _entity_of(cause: str) -> str:
    """Where the marks of a cause are logged."""
    return f"world/causes/{cause.replace(' ', '_')}"


def _directions(headings: Float[np.ndarray, " n"], length: float) -> Float[np.ndarray, "n 3"]:
    return length * np.column_stack([np.cos(headings), np.sin(headings), np.zeros(len(headings))])


def _format(width: int, height: int) -> rr.components.ImageFormat:
    return rr.components.ImageFormat(width=width, height=height, color_model="RGB", channel_datatype="U8")


def _images(views: UInt8[np.ndarray, "n height width channels"]) -> Iterable[rr.ComponentColumn]:
    """Images as a column; their format is logged once (`_log_constants`)."""
    return rr.Image.columns(buffer=views[..., :3].reshape(len(views), -1))


def _rightwards(width: int) -> Int64[np.ndarray, " width"]:
    """Rotations in the order of the headings they look to, from left to right."""
    return np.argsort(-turn_of_columns(np.arange(width), width))


def _up(n: int) -> np.ndarray:
    """Normals that all point up: the triangles' colours carry their shading already, and every one is lit alike."""
    return np.tile(np.array([0, 0, 1], dtype=np.float32), (n, 1))


def _blueprint(route: Route, lost: float) -> rrb.Blueprint:
    """Where things are shown: what the agent sees and thinks to the left, the world to the right."""
    middle = (route.xy.min(axis=0) + route.xy.max(axis=0)) / 2
    reach = max(float(np.ptp(route.xy, axis=0).max()), 1.0)
    so_far = rrb.VisibleTimeRanges(
        timeline=TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative()
    )
    world = rrb.Spatial3DView(
        origin="world", name="World, route (blue, to the ball) and path (red)",
        overrides=dict.fromkeys(("world/path", *map(_entity_of, CAUSE_COLOURS)), so_far),
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=[middle[0] - 0.75 * reach, middle[1] - 0.55 * reach, 0.85 * reach],
            look_target=[*middle, 0.0], eye_up=[0.0, 0.0, 1.0],
        ),
    )  # fmt: skip
    seen = rrb.Vertical(
        rrb.Spatial2DView(origin="view", name="What the agent sees (ahead is the middle)"),
        rrb.Spatial2DView(origin="recognised", name="The learned view it recognises"),
        rrb.BarChartView(
            origin="familiarity", name="Familiarity by degrees to the right", plot_legend=rrb.PlotLegend(visible=False)
        ),
        rrb.TimeSeriesView(
            origin="deviation", name="Deviation from the route (m)", axis_y=rrb.ScalarAxis(range=(0.0, lost)),
            plot_legend=rrb.PlotLegend(visible=False),
        ),
        rrb.TimeSeriesView(
            origin="error", name="Heading error (degrees)", axis_y=rrb.ScalarAxis(range=(-90.0, 90.0)),
            plot_legend=rrb.PlotLegend(visible=False),
        ),
        row_shares=[1.3, 1.3, 1, 1, 1],
    )  # fmt: skip
    around = rrb.Vertical(
        world,
        rrb.Horizontal(
            rrb.TextDocumentView(origin="about", name="About this walk"),
            rrb.TextLogView(
                origin="events",
                name="Events",
                columns=rrb.TextLogColumns(text_log_columns=["loglevel", "body"]),
            ),
            column_shares=[1, 2.2],
        ),
        row_shares=[3, 1],
    )
    return rrb.Blueprint(
        rrb.Horizontal(seen, around, column_shares=[1, 1]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed", play_state="following"),
        collapse_panels=True,
    )
