"""Walks as rerun recordings.

A recorder takes steps as they come and streams them to disk, so the walk knows nothing of it, and a crash leaves a recording that
opens up to the crash. A thread of its own writes while the walk goes on. The blueprint travels inside the file: opening it needs no
clicking.
"""

import time
import warnings
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import numpy as np
import rerun as rr
from jaxtyping import Float

from tussock.render.changed_views import at_step
from tussock.render.images.source import DatabaseViews
from tussock.render.renderer import Renderer
from tussock.render.tilted_eye import TiltedEye
from tussock.world.geometry import Route
from tussock.world.scene import World

from ..failures import Diagnosis
from ..stopping import StopReason
from ..training import training_source
from ..walker import Step
from . import disk
from .blueprint import MARKS, OF_A_SCAN, TILT, Shown, blueprint, image_format
from .columns import image_columns
from .marks import Marks, ends_of_scale, events_of, scale
from .scans import ScanLog
from .signals import SignalLog
from .viewer import TIMELINE, check_viewer

ROUTE_COLOUR, LEARNED_COLOUR, PATH_COLOUR, MATCH_COLOUR = (60, 120, 255), (150, 190, 255), (235, 60, 50), (250, 170, 30)
VIEW_COLOUR = (130, 130, 130)  # of the positions of an image database
GUIDES, GUIDE_COLOUR = "error/guides", (90, 90, 90)  # lines at 45 degrees to the left and right
FLUSH_SECONDS = 0.5  # how often steps are brought to disk; a crash may lose those of twice as long
BATCH = 32  # steps whose views are sent at once: fresh memory for more of them takes longer than copying them
ABOVE = 0.015  # m; lines on the ground are drawn this high to stay visible


class Recording:
    """A `.rrd` file being written; use it in a `with` statement and `log` each step.

    A thread writes, and draws the learned views that are recognised; `log` and `close` raise what goes wrong there.
    """

    def __init__(
        self,
        path: Path,
        renderer: Renderer,
        route: Route,
        *,
        training_poses: Float[np.ndarray, "n 3"] | None = None,
        max_deviation: float = 0.5,
        live: str | None = None,
        about: str = "",
    ):
        """Begin a recording.

        Args:
            path: The file to write.
            renderer: Of the world; it also draws the learned view that is recognised.
            route: The route that is walked.
            training_poses: (n, 3) Of the views that were learned; None: they are not shown.
            max_deviation: Deviation to which its plot reaches (m).
            live: Address of a running viewer to stream to as well.
            about: What the walk is, in Markdown; see `describe`.
        """
        self._path, self._renderer, self._training_poses = path, renderer, training_poses
        self._new: list[tuple[Step, Diagnosis | None]] = []  # steps that the thread has not got yet,
        self._waiting: list[tuple[Step, Diagnosis | None]] = []  # and those of which it has sent only the views
        self._previous: Step | None = None
        self._touching = False  # whether an obstacle stopped or turned the step before the last look
        self._marks = Marks(self._send)
        self._scans, self._signals = ScanLog(self._send, self._log), SignalLog(self._send, self._log)
        self._route, self._max_deviation = route, max_deviation
        self._shown, self._layout = Shown(), OF_A_SCAN  # what the steps have, and what is laid out
        self._streams = [rr.RecordingStream("tussock")]
        layout = blueprint(route, max_deviation)
        self._streams[0].save(path, default_blueprint=layout)
        if live is not None:
            check_viewer(live)
            self._streams.append(rr.RecordingStream("tussock"))
            self._streams[1].connect_grpc(live, default_blueprint=layout)
        self._log_surroundings(renderer.world, route)
        self.describe(about)
        self._thread = ThreadPoolExecutor(1, "recording")
        self._writing = self._thread.submit(self._flush)
        self._flushed = time.monotonic()

    def log(self, step: Step, diagnosis: Diagnosis | None = None) -> None:
        """Add a step and its diagnosis. Waits for the thread where it is behind by more than FLUSH_SECONDS or BATCH steps.

        Raises:
            DiskFullError: Where the file cannot be written any more.
        """
        self._new.append((step, diagnosis))
        if self._is_due() or len(self._new) == BATCH:
            self._hand_over(flush=self._is_due())
        if self._is_due():  # where FLUSH_SECONDS is 0, each step is on disk before the next
            self._writing.result()

    def describe(self, about: str) -> None:
        """Show what the walk is, in Markdown, in place of what was shown before."""
        if about:
            self._log("about", rr.TextDocument(about, media_type="text/markdown"), static=True)

    def close(self) -> None:
        """Write what is left and close the file. Raises DiskFullError where it cannot be written."""
        try:
            self._hand_over(flush=True)
            self._writing.result()
        finally:
            self._thread.shutdown()
            for stream in self._streams:
                disk.close(stream)

    def _is_due(self) -> bool:
        """Whether it is time to bring steps to disk."""
        return time.monotonic() - self._flushed >= FLUSH_SECONDS

    def _hand_over(self, *, flush: bool) -> None:
        """Give the new steps to the thread, once it is done with the earlier ones. Raises what went wrong with those."""
        self._writing.result()
        new, self._new = self._new, []
        self._writing = self._thread.submit(self._write, new, flush)
        if flush:
            self._flushed = time.monotonic()

    def __enter__(self) -> "Recording":
        return self

    def __exit__(self, kind, error, at) -> None:
        self.close()

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

    def _write(self, steps: list[tuple[Step, Diagnosis | None]], flush: bool) -> None:
        """Send the views of some steps, and, with a flush, what is left of all; called in the thread, as all that it calls."""
        if steps and self._previous is None and not self._waiting:
            self._log_constants(steps[0][0])
        self._lay_out([step for step, _ in steps])
        self._waiting += steps
        self._send_views([step for step, _ in steps])
        if flush:
            waiting, self._waiting = self._waiting, []
            if waiting:
                self._send_steps([step for step, _ in waiting])
                self._marks.write(waiting)
                self._log_events(waiting)
            self._flush()

    def _flush(self) -> None:
        """Bring what was logged to disk; rerun by itself holds small things back until there are megabytes of them."""
        file, *viewers = self._streams
        disk.flush(file, self._path)
        for viewer in viewers:
            try:
                viewer.flush(timeout_sec=5)
            except RuntimeError as error:  # somebody closed it; the walk and its file go on
                warnings.warn(f"the live viewer is gone ({error}); the walk goes on without it", stacklevel=2)
                self._streams.remove(viewer)

    def _log_surroundings(self, world: World, route: Route) -> None:
        """What does not change: the world, the route, where views were learned, the names of curves."""
        self._log("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        triangles, rgb = world.surfaces()
        corners = triangles.reshape(-1, 3)
        # Normals that all point up light every triangle alike: colours contain their shading already.
        normals = np.tile(np.array([0, 0, 1], dtype=np.float32), (len(corners), 1))
        mesh = rr.Mesh3D(vertex_positions=corners, vertex_colors=np.repeat(rgb, 3, axis=0), vertex_normals=normals)
        if len(triangles):
            self._log("world/mesh", mesh, static=True)
        if isinstance(self._renderer, DatabaseViews):
            points = self._above(self._renderer.poses[:, :2])
            self._log("world/views", rr.Points3D(points, colors=VIEW_COLOUR, radii=0.004), static=True)
        line = self._above(route.xy)
        goal = line[-1:]
        self._log("world/scale", scale(self._above(ends_of_scale(route))), static=True)
        self._log("world/route", rr.LineStrips3D([line], colors=ROUTE_COLOUR, radii=0.008), static=True)
        self._log("world/goal", rr.Points3D(goal, colors=ROUTE_COLOUR, radii=0.06), static=True)
        if self._training_poses is not None:
            points = self._above(self._training_poses[:, :2])
            self._log("world/learned_views", rr.Points3D(points, colors=LEARNED_COLOUR, radii=0.006), static=True)
        names = {"deviation/m": "deviation from the route (m)", "error/degrees": "heading error (degrees)"}
        for (entity, name), colour in zip(names.items(), (PATH_COLOUR, MATCH_COLOUR), strict=True):
            self._log(entity, rr.SeriesLines(names=name, colors=colour), static=True)
        if isinstance(at_step(self._renderer, 0), TiltedEye):
            self._log(TILT, rr.SeriesLines(colors=[PATH_COLOUR, ROUTE_COLOUR], names=["pitch", "roll"]), static=True)
        self._log(GUIDES, rr.SeriesLines(colors=[GUIDE_COLOUR] * 2, names=["45 left", "45 right"]), static=True)
        for entity, colour in MARKS.items():
            self._log(entity, rr.Points3D.from_fields(colors=colour, radii=0.03), static=True)

    def _log_constants(self, step: Step) -> None:
        """What stays the same from step to step."""
        self._log("world/agent", rr.Arrows3D.from_fields(colors=PATH_COLOUR, radii=0.012), static=True)
        self._log("world/path", rr.LineStrips3D.from_fields(colors=PATH_COLOUR, radii=0.008), static=True)
        self._log("world/start", rr.Points3D([_place(step)], colors=PATH_COLOUR, radii=0.04), static=True)
        eye = self._renderer.eye
        pixels = rr.Image.from_fields(format=image_format(eye.width, eye.height))
        self._log("view", pixels, static=True)
        if step.match is not None and self._training_poses is not None:
            self._log("recognised", pixels, static=True)
            self._log("world/recognised", rr.Arrows3D.from_fields(colors=MATCH_COLOUR, radii=0.008), static=True)

    def _send_steps(self, steps: list[Step]) -> None:
        """What changes from step to step, but for the views."""
        here = np.array([_place(step) for step in steps])
        facing = _directions(np.array([step.pose.heading + step.turn for step in steps]), 0.2)
        self._send("world/agent", steps, rr.Arrows3D.columns(origins=here, vectors=facing))
        known = steps if self._previous is None else [self._previous, *steps]
        walked = [(before, step) for before, step in pairwise(known) if step.reset is None and not step.displaced]
        strips = [np.array([_place(before), _place(step)]) for before, step in walked]
        self._send("world/path", [step for _, step in walked], rr.LineStrips3D.columns(strips=strips))
        matched = [step for step in steps if step.match is not None]
        if matched and self._training_poses is not None:
            poses = self._training_poses[np.array([step.match for step in matched])]
            arrows = rr.Arrows3D.columns(origins=self._above(poses[:, :2]), vectors=_directions(poses[:, 2], 0.15))
            self._send("world/recognised", matched, arrows)
        self._send("deviation/m", steps, rr.Scalars.columns(scalars=[step.deviation for step in steps]))
        self._send("error/degrees", steps, rr.Scalars.columns(scalars=np.degrees([step.error for step in steps])))
        guides = np.tile([45.0, -45.0], len(steps))
        self._send(GUIDES, steps, rr.Scalars.columns(scalars=guides).partition([2] * len(steps)))
        if self._shown.tilt:
            tilts = np.degrees([step.tilt or (0.0, 0.0) for step in steps])
            self._send(TILT, steps, rr.Scalars.columns(scalars=tilts.ravel()).partition([2] * len(steps)))
        self._send("goal/m", steps, rr.Scalars.columns(scalars=[step.goal_distance for step in steps]))
        self._send("looks/headings", steps, rr.Scalars.columns(scalars=[step.looks for step in steps]))
        self._signals.write(steps, {step.index: _place(step) for step in steps})
        self._scans.write(steps)
        self._previous = steps[-1]

    def _send_views(self, steps: list[Step]) -> None:
        """What the agent sees, and the learned views that it recognises."""
        eye, seen = self._renderer.eye, [step for step in steps if step.view is not None]
        if seen:
            self._send("view", seen, image_columns(eye, [step.view for step in seen if step.view is not None]))
        matched = [step for step in steps if step.match is not None]
        if matched and self._training_poses is not None:
            views = training_source(self._renderer).render(
                self._training_poses[np.array([step.match for step in matched])]
            )
            self._send("recognised", matched, image_columns(eye, list(views)))

    def _above(self, xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 3"]:
        """Points a little above the ground."""
        return np.column_stack([xy, self._renderer.world.ground_height(xy) + ABOVE])

    def _log_events(self, steps: list[tuple[Step, Diagnosis | None]]) -> None:
        """What happened at a step, where anything did."""
        for step, diagnosis in steps:
            level = rr.TextLogLevel.INFO if step.reason == StopReason.ARRIVED else rr.TextLogLevel.WARN
            for event in events_of(step, diagnosis, touching=self._touching):
                for stream in self._streams:
                    stream.set_time(TIMELINE, sequence=step.index)
                self._log("events", rr.TextLog(f"step {step.index}: {event}", level=level))
            self._touching = step.touched

    def _lay_out(self, steps: list[Step]) -> None:
        """Make panels for what there is to show, where the steps have something that earlier ones do not."""
        for step in steps:
            self._shown = self._shown.with_step(step, learned=self._training_poses is not None)
        if steps and self._shown != self._layout:
            self._layout = self._shown
            for stream in self._streams:
                stream.send_blueprint(blueprint(self._route, self._max_deviation, self._shown))


def _place(step: Step, above: float = ABOVE) -> tuple[float, float, float]:
    """The place of an agent at a step, a little above the ground."""
    return *step.pose[:2], step.height + above


def _directions(headings: Float[np.ndarray, " n"], length: float) -> Float[np.ndarray, "n 3"]:
    return length * np.column_stack([np.cos(headings), np.sin(headings), np.zeros(len(headings))])
