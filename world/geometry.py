"""Poses, routes and the angle convention of the whole project (it is written nowhere else).

World frame: right-handed, x east, y north, z up, metres. A heading is an angle in radians, counter-clockwise
from +x, wrapped to [-pi, pi). A panorama of W columns looks, in column c, at the azimuth relative to the heading

    pi - (c + 1/2) * 2 pi / W

so behind is at both edges, ahead in the middle and clockwise to the right. Turning left by k columns' worth of
angle rolls the panorama right by k columns.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .errors import InputError

FARTHEST = (
    1e7  # m from 0, in each coordinate: beyond, float32 corners are metres apart, and squares of squares may overflow
)


def wrap_angle(angle):
    """Wrap an angle, or an array of them, to [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def column_azimuths(width: int) -> Float[np.ndarray, " width"]:
    """Azimuth relative to the heading at which each column of a panorama looks (rad, centre of the column)."""
    return np.pi - (np.arange(width) + 0.5) * 2 * np.pi / width


def turn_of_columns(columns, width: int):
    """Angle (rad, wrapped, left positive) of the turn that rolls a panorama right by `columns` of its `width`."""
    return wrap_angle(np.asarray(columns) * 2 * np.pi / width)


def columns_of_turn(turn, width: int, full_turn: float = 2 * np.pi):
    """Columns, of `width`, by which a turn (rad, left positive) rolls a panorama right; neither wrapped nor rounded.

    full_turn: what a whole turn is where `turn` is not in radians. Degrees are given as they are, with 360: halfway between two
    columns, a detour through radians would leave to chance which of them is the nearest.
    """
    return turn / full_turn * width


class Pose(NamedTuple):
    """Where an eye stands and where it faces. `np.asarray([pose, ...])` is the (n, 3) array renderers take."""

    x: float  # m
    y: float  # m
    heading: float  # rad, counter-clockwise from +x

    def turned(self, angle: float) -> "Pose":
        """The same place, turned left by `angle` (rad)."""
        return Pose(self.x, self.y, float(wrap_angle(self.heading + angle)))

    def moved(self, forward: float, left: float = 0.0) -> "Pose":
        """The same heading, moved `forward` and to the `left` (m)."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        return Pose(float(self.x + forward * c - left * s), float(self.y + forward * s + left * c), self.heading)


class Bounds(NamedTuple):
    """An axis-aligned rectangle on the ground (m)."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float

    def contains(self, x, y):
        """Whether points lie inside (borders included); works on arrays."""
        return (x >= self.x_min) & (x <= self.x_max) & (y >= self.y_min) & (y <= self.y_max)

    def __str__(self) -> str:
        return f"x {self.x_min:g}..{self.x_max:g} m, y {self.y_min:g}..{self.y_max:g} m"


@dataclass(frozen=True)
class Route:
    """A path over the ground with a heading at each of its points.

    poses: (n, 3) x [m], y [m], heading [rad]; n >= 2, within FARTHEST, consecutive points apart.
    """

    poses: Float[np.ndarray, "n 3"]

    def __post_init__(self):
        poses = np.array(self.poses, dtype=np.float64)
        if poses.ndim != 2 or poses.shape[1] != 3:
            raise InputError(f"a route needs points (x, y, heading), got an array of shape {poses.shape}")
        near = np.abs(poses) <= FARTHEST  # False for nan, too
        if not near.all():
            row = int(near.all(axis=1).argmin())
            raise InputError(
                f"route point {row + 1} is {poses[row].tolist()}; a route needs finite numbers up to {FARTHEST:g}"
            )
        keep = np.r_[True, np.hypot(*np.diff(poses[:, :2], axis=0).T) > 1e-9]  # m
        poses = poses[keep]
        if len(poses) < 2:
            raise InputError(f"a route needs at least 2 distinct points, got {len(poses)}")
        poses[:, 2] = wrap_angle(poses[:, 2])
        object.__setattr__(self, "poses", poses)

    @classmethod
    def through(cls, xy: Float[np.ndarray, "n 2"]) -> "Route":
        """The route through points (m), each heading towards the next one (the last keeps the direction it came in)."""
        xy = np.asarray(xy, dtype=np.float64)
        if xy.ndim != 2 or xy.shape[1] != 2 or len(xy) < 2:
            raise InputError(f"a route needs at least 2 points (x, y), got an array of shape {xy.shape}")
        with np.errstate(all="ignore"):  # the route refuses what is not finite
            steps = np.diff(xy, axis=0)
        heading = np.arctan2(steps[:, 1], steps[:, 0])
        return cls(np.column_stack([xy, np.r_[heading, heading[-1]]]))

    @property
    def xy(self) -> Float[np.ndarray, "n 2"]:
        """The points (m)."""
        return self.poses[:, :2]

    @property
    def start(self) -> Pose:
        """The first pose."""
        return Pose(*self.poses[0].tolist())

    @property
    def goal(self) -> Pose:
        """The last pose."""
        return Pose(*self.poses[-1].tolist())

    @cached_property
    def arc(self) -> Float[np.ndarray, " n"]:
        """Distance along the route of each point (m)."""
        return np.r_[0.0, np.cumsum(np.hypot(*np.diff(self.xy, axis=0).T))]

    @property
    def length(self) -> float:
        """Length of the route (m)."""
        return float(self.arc[-1])

    @cached_property
    def _unwrapped(self) -> Float[np.ndarray, " n"]:
        """The headings without jumps of a whole turn."""
        return np.unwrap(self.poses[:, 2])

    def at(self, distance) -> Float[np.ndarray, "k 3"]:
        """Poses at distances along the route (m, clipped to its ends); headings are interpolated on the circle."""
        distance, arc = np.atleast_1d(distance), self.arc
        x, y = (np.interp(distance, arc, self.poses[:, i]) for i in (0, 1))
        heading = np.interp(distance, arc, self._unwrapped)
        return np.column_stack([x, y, wrap_angle(heading)])

    def turning(self, distance, reach: float) -> Float[np.ndarray, " k"]:
        """Change of direction at distances along the route (m), from the chord of `reach` (m) before to the one after: rad, 0 to pi.

        0 nearer than `reach` to an end.
        """
        distance = np.atleast_1d(distance)
        before, here, after = (self.at(distance + off)[:, :2] for off in (-reach, 0.0, reach))
        came, goes = here - before, after - here
        turned = np.abs(wrap_angle(np.arctan2(goes[:, 1], goes[:, 0]) - np.arctan2(came[:, 1], came[:, 0])))
        return np.where((distance < reach) | (distance > self.length - reach), 0.0, turned)

    def resampled(self, spacing: float) -> "Route":
        """The route with a pose every `spacing` metres of arc length, from its start."""
        if not (np.isfinite(spacing) and 0 < spacing <= self.length):
            raise InputError(
                f"spacing {spacing:g} m does not fit a route of {self.length:.3f} m; give 0 < spacing <= length"
            )
        if self.length / spacing > 10**6:
            raise InputError(
                f"spacing {spacing:g} m cuts a route of {self.length:.3f} m into over a million; give a wider one"
            )
        return Route(self.at(np.arange(0.0, self.length * (1 + 1e-12), spacing)))

    def nearest(self, xy: Float[np.ndarray, "k 2"]) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
        """Distance to the route's polyline (m), and how far along the route (m) that nearest place is, of points."""
        xy = np.asarray(xy, dtype=np.float64)
        at_once = max(1, 10**6 // len(self.xy))  # bounds the memory of all distances
        if len(xy) > at_once:
            parts = [self.nearest(xy[i : i + at_once]) for i in range(0, len(xy), at_once)]
            return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
        (x, y), (dx, dy) = self.xy[:-1].T, np.diff(self.xy, axis=0).T
        length = np.hypot(dx, dy)
        from_x, from_y = xy[:, :1] - x, xy[:, 1:] - y  # (k, n - 1)
        share = ((from_x * dx + from_y * dy) / length**2).clip(0, 1)
        squared = (from_x - share * dx) ** 2 + (from_y - share * dy) ** 2
        best = squared.argmin(axis=1)
        rows = np.arange(len(xy))
        return np.sqrt(squared[rows, best]), self.arc[best] + share[rows, best] * length[best]
