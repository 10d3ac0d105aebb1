"""One agent of a walk: where it is, what it has done so far, and each step that it makes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from jaxtyping import Bool, Float32, UInt8

from tussock.world.errors import SettingError
from tussock.world.flight import Flight
from tussock.world.geometry import Pose, place_text, wrap_angle
from tussock.world.scene import World
from tussock.world.terrain import Terrain

from .body import Body
from .displacement import Displacement
from .sense_models import Senses
from .senses import Readings
from .steering.navigator import Journey, Motion
from .stop_check import StopCheck
from .stopping import StoppingRules, StopReason

if TYPE_CHECKING:
    from .walk import Walk

RECOVERABLE = (
    StopReason.LOST,
    StopReason.STUCK,
    StopReason.OUT_OF_WORLD,
    StopReason.OFF_GROUND,
    StopReason.TOO_STEEP,
    StopReason.OFF_GRID,
)  # from where an agent can be put back on the route


@dataclass(frozen=True, kw_only=True)
class Step:
    """One look of an agent, and what it did then.

    Attributes:
        index: 0 for the first look.
        pose: Where the agent stands and faces as it looks.
        height: Of the ground beneath it (m).
        tilt: Pitch and roll of its eye (rad); None where the eye is always level.
        view: (height, width, 4) What it sees, RGBA (RGB where it comes from images without alpha); None where it was not drawn.
        encoded: (h, w) The feature image that the navigator gets of it; None likewise.
        looks: Headings that the navigator looked at for its decision.
        familiarity: (w,) Of every rotation, turned left by 0, 1, .. columns; None where the navigator does not scan.
        scanned: (w,) Which of these rotations the navigator compared; None likewise.
        aim: Turn that the navigator decided on (rad, left positive).
        turn: Turn that the body made: the aim and noise (rad), to a heading that is a multiple of 0.01 degrees.
        match: Index of the learned view that was recognised; None where the model keeps none.
        progress: Share of the learned sequence, 0 to 1, that the navigator believes to have walked; None where it does not know.
        signals: What the navigator decided by, by names of its own: numbers, or arrays.
        touched: Whether an obstacle stopped or turned the step before this look.
        displaced: Whether the agent was carried to the side of the route before this look.
        view_distance: Distance from the entry of the image database whose view it sees (m); None in a world.
        deviation: Distance from the route (m).
        along: Distance along the route of the point nearest to the agent (m).
        side: On which side of the route: 1 left, -1 right.
        goal_distance: Distance from the end of the route, as the crow flies (m).
        error: Angle from the route's heading there to the agent's new heading (rad, -pi..pi).
        reason: Why the walk ends here; None while it goes on.
        reset: Why the agent was put back on the route before this look; None where it was not.
        failure: Why it fails here, whether the walk ends or the agent is put back after this look; None where it does not fail.
    """

    index: int
    pose: Pose
    height: float
    tilt: tuple[float, float] | None
    view: UInt8[np.ndarray, "height width channels"] | None
    encoded: Float32[torch.Tensor, "h w"] | None
    looks: int
    familiarity: Float32[np.ndarray, " w"] | None
    scanned: Bool[np.ndarray, " w"] | None
    aim: float
    turn: float
    match: int | None
    progress: float | None
    signals: Mapping[str, Any]
    touched: bool
    displaced: bool
    view_distance: float | None
    deviation: float
    along: float
    side: int
    goal_distance: float
    error: float
    reason: StopReason | None
    reset: StopReason | None
    failure: StopReason | None


class Walker:
    """Where one agent of a walk is, and what it has done so far."""

    def __init__(
        self,
        walk: "Walk",
        number: int,
        start: Pose,
        body: Body,
        stopping: StoppingRules,
        displacement: Displacement,
        senses: Senses,
        random: np.random.Generator,
    ):
        check_inside(start, walk.world)
        self.walk, self.number, self.body, self.stopping, self.random = walk, number, body, stopping, random
        self.pose = Pose(start.x, start.y, float(wrap_angle(start.heading)))
        self.step_limit = stopping.step_limit(walk.route.length, body.step_length)
        self.stop_check = StopCheck(stopping, walk.route, walk.world.field, body.step_length)
        self.index, self.ended = 0, False
        self.displacement = displacement if displacement.left else None  # while it is to come
        self.readings = Readings(senses, random.spawn(1)[0] if senses.noisy else random, walk.world.light)
        self.walked, self.touched, self.displaced = 0.0, False, False  # since the look before
        self.reset: StopReason | None = None
        self.view_distance: float | None = None  # of the entry of an image database whose view it sees (m)
        self.before_step: tuple[Pose, float] | None = (
            None  # where it stood before its step, and how high; None after being put back
        )
        self.stopped: StopReason | None = None  # by the ground
        self.tilt: tuple[float, float] | None = None  # of its eye at the last look: pitch and roll (rad)

    def sense(self) -> tuple[float, float]:
        """What its compass reads (rad), and its odometer since the look before (m)."""
        compass, odometry = self.readings.read(np.array([self.pose.heading]), np.array([self.walked]), self.tilt)
        return float(compass[0]), float(odometry[0])

    def way_out(self) -> Journey:
        """The way from the goal to where its walk begins, as it measured it step by step: back along the route, and straight from there."""
        route, step = self.walk.route, self.body.step_length
        back = route.at(np.append(np.arange(route.length, self.along, -step), self.along))[:, :2]
        aside = np.linspace(0, 1, max(1, math.ceil(self.deviation / step)) + 1)[1:, None] * (self.pose[:2] - back[-1])
        parts = np.diff(np.vstack([back, back[-1] + aside]), axis=0)
        distances = np.hypot(*parts.T)
        parts, distances = parts[distances > 0], distances[distances > 0]
        compass, odometry = self.readings.read(np.arctan2(parts[:, 1], parts[:, 0]), distances)
        return Journey(compass=compass, odometry=odometry)

    def carry(self) -> bool:
        """Carry it to the side of the route, where that is due; whether it was carried."""
        due = self.displacement
        if due is None or self.reason is not None or self.along < due.at * self.walk.route.length:
            return False
        x, y = Pose(*self.pose[:2], self.route_heading).moved(0.0, due.left)[:2]
        self.displacement, world = None, self.walk.world
        if world.terrain is not None and not world.stands(np.array([[x, y]]))[0]:
            self.reason = StopReason.OFF_GROUND  # nothing can stand there, so it stays where it is
            return False
        self.pose = Pose(x, y, self.pose.heading).rounded()
        self.displaced, self.before_step = True, None
        return True

    def block(self, x: float, y: float) -> None:
        """End its step where an obstacle did not let it go on (m)."""
        before, _ = self.before_step or (self.pose, 0.0)
        self.pose = Pose(x, y, self.pose.heading).rounded()
        self.walked, self.touched = float(np.hypot(x - before.x, y - before.y)), True

    def stand_on(self, height: float) -> None:
        """Take in the height of the ground at its pose (m). It does not make a step that the ground does not allow."""
        terrain = self.walk.world.terrain
        self.stopped = None
        if terrain is not None and self.before_step is not None:
            before, height_before = self.before_step
            self.stopped = self._obstacle(terrain, before, height - height_before)
            if self.stopped is not None:
                self.pose, height = Pose(before.x, before.y, self.pose.heading), height_before
                self.walked = 0.0
        self.height = height

    def _obstacle(self, terrain: Terrain | Flight, before: Pose, rise: float) -> StopReason | None:
        """Why the step from a pose to the present one, which rises by some metres, cannot be made; None where it can."""
        x, y, _ = self.pose
        if not self.walk.world.field.contains(x, y):
            return StopReason.OUT_OF_WORLD
        if np.isnan(rise):
            return StopReason.TOO_STEEP if terrain.is_steep(x, y) else StopReason.OFF_GROUND
        return StopReason.TOO_STEEP if terrain.is_too_steep(np.hypot(x - before.x, y - before.y), rise) else None

    def measure(self, deviation: float, along: float, nearest: Pose) -> None:
        """Take in how far it is from the route (m) and along it (m), and the pose of the route there."""
        self.deviation, self.along, self.route_heading = deviation, along, nearest.heading
        east, north = self.pose.x - nearest.x, self.pose.y - nearest.y
        left = north * np.cos(nearest.heading) - east * np.sin(nearest.heading)
        self.side = 1 if left >= 0 else -1
        self.reason = self.stop_check.check(self.pose, deviation, along) or self.stopped
        if self.reason is not StopReason.ARRIVED and (self.view_distance or 0.0) > self.walk.reach:
            self.reason = StopReason.OFF_GRID
        if self.reason is None and self.index >= self.step_limit:
            self.reason = StopReason.OUT_OF_STEPS

    def step(self, motion: Motion, row: int, view: np.ndarray | None, encoded: torch.Tensor | None) -> Step:
        """Do as a row of a motion says."""
        stopping, body, pose = self.stopping, self.body, self.pose
        scan = motion.scan if motion.scan is not None and motion.scan.window[row].any() else None
        aim, share = float(motion.turn[row]), 1.0 if motion.step is None else float(motion.step[row])
        noise = body.heading_noise * self.random.standard_normal() if body.heading_noise else 0.0
        facing = pose.turned(aim + noise).rounded()
        turn = float(wrap_angle(facing.heading - pose.heading))
        put_back = stopping.put_back and self.reason in RECOVERABLE and self.index < self.step_limit
        step = Step(
            index=self.index,
            pose=pose,
            height=self.height,
            tilt=self.tilt,
            view=view,
            encoded=encoded,
            familiarity=None if scan is None else scan.familiarity[row],
            scanned=None if scan is None else scan.window[row],
            aim=aim,
            turn=turn,
            match=None if scan is None or scan.match is None else int(scan.match[row]),
            progress=None if scan is None else scan.progress[row],
            looks=motion.looks_of(row),
            signals={name: values[row] for name, values in motion.signals.items()},
            touched=self.touched,
            displaced=self.displaced,
            view_distance=self.view_distance,
            deviation=self.deviation,
            along=self.along,
            side=self.side,
            goal_distance=float(np.hypot(pose.x - self.walk.route.goal.x, pose.y - self.walk.route.goal.y)),
            error=float(wrap_angle(facing.heading - self.route_heading)),
            reason=None if put_back else self.reason,
            reset=self.reset,
            failure=None if self.reason is StopReason.ARRIVED else self.reason,
        )
        self.reset = self.reason if put_back else None
        self.ended = step.reason is not None
        self.before_step = None if put_back else (pose, self.height)
        self.walked, self.touched, self.displaced = 0.0, False, False
        if put_back:
            self.pose = self.stop_check.put_back()
        elif not self.ended:
            self.pose = facing.moved(share * body.step_length).rounded()
            self.walked = share * body.step_length
            self.stop_check.walked(share)
        self.index += 1
        return step


def check_inside(pose: Pose, world: World) -> None:
    """Refuse a start that is outside of the world, or off its ground. Raises SettingError."""
    if not np.isfinite(pose).all() or not world.field.contains(pose.x, pose.y):
        raise SettingError(
            f"the start {place_text(pose.x, pose.y)} is outside the world ({world.field}); choose another route, "
            "--offset-m or --release-m"
        )
    if world.terrain is not None and not world.stands(np.array([pose[:2]]))[0]:
        raise SettingError(
            f"a walk cannot start there: {world.terrain.problem(pose.x, pose.y)}; choose another route, --offset-m or --release-m"
        )
