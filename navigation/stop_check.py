"""Whether a walk ends at a look of its agent, by the stopping rules."""

import numpy as np

from tussock.world.geometry import Bounds, Pose, Route

from .stopping import StoppingRules, StopReason


class StopCheck:
    """How far one agent has come along a route, and whether its walk ends for that.

    Attributes:
        furthest: Greatest distance along the route that it has reached (m).
        since: Steps that it has made since it got there, in whole steps.
        along: Distance along the route where it was checked last (m).
        resumed: Distance along the route where it was put back last (m).
    """

    def __init__(self, stopping: StoppingRules, route: Route, field: Bounds, step_length: float):
        self.stopping, self.route, self.field, self.step_length = stopping, route, field, step_length
        self.furthest, self.since = -np.inf, 0.0
        self.along, self.resumed = 0.0, 0.0
        self.been_away = not self._at_goal(route.start)  # where the route ends near its start, it must leave first

    def check(self, pose: Pose, deviation: float, along: float) -> StopReason | None:
        """Why the walk ends at a pose, this far from the route and along it (m); None where it goes on."""
        self.along = along
        if along > self.furthest:
            self.furthest, self.since = along, 0.0
        self.been_away = self.been_away or not self._at_goal(pose)
        if self.been_away and self._at_goal(pose):
            return StopReason.ARRIVED
        if not self.field.contains(pose.x, pose.y):
            return StopReason.OUT_OF_WORLD
        if deviation > self.stopping.max_deviation:
            return StopReason.LOST
        return StopReason.STUCK if self.since * self.step_length >= self.stopping.patience else None

    def walked(self, share: float) -> None:
        """Count a step, which is this share of a whole one."""
        self.since += share

    def put_back(self) -> Pose:
        """Go on from where the rules say; its pose."""
        spacing, ahead = self.stopping.waypoint_spacing, self.stopping.put_back_ahead
        self.since = 0.0
        if self.stopping.put_back_at == "nearest-point":
            return Pose(*self.route.at(self.along)[0].tolist()).rounded()
        waypoint = (np.floor(self.furthest / spacing + 1e-9) + 1) * spacing
        # Never behind where it was put back before.
        target = waypoint if ahead is None else max(self.along, self.resumed) + ahead
        self.furthest = self.resumed = min(target, self.route.length)
        return Pose(*self.route.at(self.furthest)[0].tolist()).rounded()

    def _at_goal(self, pose: Pose) -> bool:
        goal = self.route.goal
        return bool(np.hypot(pose.x - goal.x, pose.y - goal.y) <= self.stopping.arrival_radius)
