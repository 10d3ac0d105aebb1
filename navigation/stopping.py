"""When a walk along a route ends, whoever walks it: an agent with a familiarity model, or a learner in the Gymnasium environment."""

from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np

from tussock.world.errors import InputError
from tussock.world.geometry import Bounds, Pose, Route

NUMBER = int | float | np.integer | np.floating
# Why a walk ends. The first is success.
ARRIVED, LOST, STUCK, OUT_OF_WORLD, OUT_OF_STEPS = (
    "arrived",
    "lost",
    "stuck in a loop",
    "out of the world",
    "out of steps",
)


@dataclass(frozen=True, kw_only=True)
class Rules:
    """When a walk along `route` in `field` ends.

    step_length: of the longest step (m). arrive: the walk is done within this distance of the route's end (m); where the route
    ends as near to its start, once the walker has been farther away. lost: farther than this from the route is lost (m).
    patience: metres walked without getting farther along the route before the walker counts as stuck.
    max_steps: None takes as many as walk the route's length three times.
    """

    route: Route
    field: Bounds
    step_length: float
    arrive: float
    lost: float
    patience: float
    max_steps: int | None

    def __post_init__(self):
        check_limits(self)

    @property
    def step_limit(self) -> int:
        """The number of steps after which the walk ends."""
        return self.max_steps or int(np.ceil(3 * self.route.length / self.step_length))

    def from_goal(self, pose: Pose) -> float:
        """Distance from the route's end (m)."""
        return float(np.hypot(pose.x - self.route.goal.x, pose.y - self.route.goal.y))

    def check_inside(self, pose: Pose) -> None:
        """Refuse a start that is outside the world. Raises InputError."""
        if not np.isfinite(pose).all() or not self.field.contains(pose.x, pose.y):
            raise InputError(
                f"the start ({pose.x:g}, {pose.y:g}) m is outside the world ({self.field}); choose another route or offset"
            )


def check_limits(limits: Any) -> None:
    """Refuse limits of a walk, fields of `Rules` by name, that make no sense. Raises InputError."""
    for name in ("step_length", "arrive", "lost", "patience"):
        check_distance(name, getattr(limits, name))
    if limits.max_steps is not None:
        check_count("steps", limits.max_steps)


def check_distance(name: str, value: Any) -> None:
    """Refuse what is no distance over 0. Raises InputError."""
    if not (isinstance(value, NUMBER) and 0 < value < np.inf):
        raise InputError(f"{name.replace('_', ' ')} {value} m; give a finite distance over 0")


def check_noise(noise: Any) -> None:
    """Refuse what is no standard deviation of headings (rad). Raises InputError."""
    if not isinstance(noise, NUMBER):
        raise InputError(f"heading noise {noise!r}; give a number")
    if not 0 <= noise < np.inf:
        raise InputError(f"heading noise {np.degrees(noise):g} degrees; give 0 or more")


def check_count(what: str, value: Any) -> None:
    """Refuse what is no whole number of at least 1. Raises InputError."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise InputError(f"{value!r} {what}; give a whole number")
    if int(value) < 1:
        raise InputError(f"{value} {what}; give at least 1")


class Progress:
    """How far one walk has come.

    furthest: along the route (m). since: what it has walked since it got there, in steps of the rules' length.
    """

    def __init__(self, rules: Rules):
        self.rules = rules
        self.furthest, self.since = -np.inf, 0.0
        self.been_away = rules.from_goal(rules.route.start) > rules.arrive  # else the route ends where it starts

    def look(self, index: int, pose: Pose, deviation: float, along: float) -> str | None:
        """Why the walk ends with its look `index`, at `pose`, or None; deviation, along: from and along the route there (m)."""
        rules = self.rules
        if along > self.furthest:
            self.put(along)
        self.been_away = self.been_away or rules.from_goal(pose) > rules.arrive
        if self.been_away and rules.from_goal(pose) <= rules.arrive:
            return ARRIVED
        if not rules.field.contains(pose.x, pose.y):
            return OUT_OF_WORLD
        if deviation > rules.lost:
            return LOST
        if self.since * rules.step_length >= rules.patience:
            return STUCK
        return OUT_OF_STEPS if index >= rules.step_limit else None

    def step(self, share: float = 1.0) -> None:
        """Count a step of this share of the rules' length."""
        self.since += share

    def put(self, along: float) -> None:
        """Begin to count anew from `along` (m)."""
        self.furthest, self.since = along, 0.0
