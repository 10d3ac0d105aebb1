"""Poses, routes and the angle convention of the whole project (it is written nowhere else).

The world frame is right-handed, in metres: x east, y north, z up. A heading is an angle in radians, counter-clockwise
from +x, wrapped to [-pi, pi). Column c of a panorama of W columns looks at the azimuth, relative to the heading,

    pi - (c + 1/2) * 2 pi / W

so that behind is at both edges, ahead in the middle, and clockwise to the right. Turning left by the angle of k columns
rolls the panorama right by k columns.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .errors import SettingError
from .settings import MAX_COORDINATE

HEADING_STEP_DEG = 0.01  # of rounded headings


def wrap_angle(angle):
    """Wrap an angle, or an array of angles, to [-pi, pi) (rad)."""
    full_turn = 2 * np.pi
    return (angle + np.pi) % full_turn % full_turn - np.pi  # twice: rounding takes what lies just below 0 to full_turn


def column_azimuths(width: int) -> Float[np.ndarray, " width"]:
    """Azimuth, relative to the heading, at which each column of a panorama looks (rad, centre of the column)."""
    return np.pi - (np.arange(width) + 0.5) * 2 * np.pi / width


def turn_of_columns(columns, width: int):
    """Convert columns to a turn (rad, left positive, wrapped); turning left rolls the panorama right.

    Args:
        columns: Number of columns, or an array of numbers.
        width: Columns of the panorama.
    """
    return wrap_angle(np.asarray(columns) * 2 * np.pi / width)


def columns_of_turn(turn, width: int, full_turn: float = 2 * np.pi):
    """Columns by which a turn rolls a panorama right; neither wrapped nor rounded.

    Args:
        turn: Angle, or an array of angles, left positive, in the unit of `full_turn`.
        width: Columns of the panorama.
        full_turn: A whole turn: 2 pi for radians, 360 for degrees. Give degrees as degrees: halfway between two columns, rounding
            errors of a conversion would decide which column is the nearest.
    """
    return turn / full_turn * width


class Pose(NamedTuple("Pose", [("x", float), ("y", float), ("heading", float)])):
    """Position and heading of an eye. `np.asarray([pose, ...])` is the (n, 3) array that renderers take.

    Attributes:
        x: Position to the east (m).
        y: Position to the north (m).
        heading: Direction in which the eye faces (rad, counter-clockwise from +x); wrapped if it is not in [-pi, pi).
    """

    __slots__ = ()

    def __new__(cls, x: float, y: float, heading: float) -> "Pose":
        if isfinite(heading) and not -np.pi <= heading < np.pi:
            heading = float(wrap_angle(heading))
        return super().__new__(cls, x, y, heading)

    def rounded(self) -> "Pose":
        """As `rounded`, for one pose: an agent rounds its pose at each step, and arrays of three numbers take ten times as long."""
        degrees = round(math.degrees(self.heading) / HEADING_STEP_DEG, 0) * HEADING_STEP_DEG
        x, y = round(self.x * 1e9, 0) / 1e9, round(self.y * 1e9, 0) / 1e9
        return Pose(x, y, wrap_angle(math.radians(degrees)))

    def turned(self, angle: float) -> "Pose":
        """The same position, turned left by `angle` (rad)."""
        return Pose(self.x, self.y, float(wrap_angle(self.heading + angle)))

    def moved(self, forward: float, left: float = 0.0) -> "Pose":
        """The same heading, moved `forward` and to the `left` (m)."""
        c, s = np.cos(self.heading), np.sin(self.heading)
        return Pose(float(self.x + forward * c - left * s), float(self.y + forward * s + left * c), self.heading)


def rounded(poses: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    """Poses whose headings are multiples of 0.01 degrees, and whose positions are whole nanometres.

    The last bits of a sine, or of what a scan interpolates, differ from processor to processor. Along a walk they would add up.
    """
    degrees = np.rint(np.degrees(poses[..., 2:]) / HEADING_STEP_DEG) * HEADING_STEP_DEG
    return np.concatenate([np.rint(poses[..., :2] * 1e9) / 1e9, wrap_angle(np.radians(degrees))], axis=-1)


class Bounds(NamedTuple):
    """An axis-aligned rectangle on the ground (m)."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float

    @property
    def size(self) -> Float[np.ndarray, "2"]:
        """Extent along x and along y (m)."""
        return np.array([self.x_max - self.x_min, self.y_max - self.y_min], dtype=np.float64)

    def contains(self, x, y):
        """Whether points lie inside (borders included); works on arrays."""
        return (x >= self.x_min) & (x <= self.x_max) & (y >= self.y_min) & (y <= self.y_max)

    def widened(self, margin: float) -> "Bounds":
        """The rectangle with a margin added on every side (m); a negative margin makes it smaller."""
        return Bounds(self.x_min - margin, self.y_min - margin, self.x_max + margin, self.y_max + margin)

    def __str__(self) -> str:
        return f"x {_span(self.x_min, self.x_max)} m, y {_span(self.y_min, self.y_max)} m"


def place_text(x: float, y: float) -> str:
    """A place (m) as messages give it, to the millimetre, so that it can be copied and used."""
    return f"({round(x, 3) + 0.0:.12g}, {round(y, 3) + 0.0:.12g}) m"


def _span(low: float, high: float) -> str:
    """Two limits (m) to the millimetre, rounded so that what is copied lies between them; others with all digits."""
    if abs(low) + abs(high) < 1e9:  # False for nan
        near, far = math.ceil(low * 1000) / 1000, math.floor(high * 1000) / 1000
        if low <= near < far <= high:
            return f"{near + 0.0:.12g}..{far + 0.0:.12g}"
    return f"{low + 0.0!r}..{high + 0.0!r}"


@dataclass(frozen=True, eq=False)
class Route:
    """A path over the ground with a heading at each of its points.

    Attributes:
        poses: (n, 3) x (m), y (m) and heading (rad, wrapped) of each point. At least 2 points, within MAX_COORDINATE. Of
            consecutive points at the same position the first is kept.
        heights: (n,) Height of the eye over z = 0 at each point (m), of a path that is flown; None where that is not known. A route
            that is made of this one has none.
    """

    poses: Float[np.ndarray, "n 3"]
    heights: Float[np.ndarray, " n"] | None = None

    def __post_init__(self):
        poses = np.array(self.poses, dtype=np.float64)
        if poses.ndim != 2 or poses.shape[1] != 3:
            raise SettingError(f"a route needs points (x, y, heading), got an array of shape {poses.shape}")
        valid = np.abs(poses) <= MAX_COORDINATE  # False for nan
        if not valid.all():
            row = int(valid.all(axis=1).argmin())
            raise SettingError(
                f"route point {row + 1} is {poses[row].tolist()}; a route needs finite numbers up to {MAX_COORDINATE:g}"
            )
        keep = np.r_[True, np.hypot(*np.diff(poses[:, :2], axis=0).T) > 1e-9]  # m
        poses = poses[keep]
        if len(poses) < 2:
            raise SettingError(f"a route needs at least 2 distinct points, got {len(poses)}")
        poses[:, 2] = wrap_angle(poses[:, 2])
        object.__setattr__(self, "poses", poses)
        if self.heights is not None:
            heights = np.array(self.heights, dtype=np.float64)
            if heights.shape != keep.shape or not (np.abs(heights) <= MAX_COORDINATE).all():
                raise SettingError(f"heights of a route are {len(keep)} finite numbers up to {MAX_COORDINATE:g} (m)")
            object.__setattr__(self, "heights", heights[keep])

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Route) and self._numbers == other._numbers

    def __hash__(self) -> int:
        return hash(self._numbers)

    @property
    def _numbers(self) -> tuple[bytes | None, ...]:
        return tuple(
            None if each is None else (each + 0.0).tobytes() for each in (self.poses, self.heights)
        )  # of -0.0 as of 0.0

    @classmethod
    def through(cls, xy: Float[np.ndarray, "n 2"]) -> "Route":
        """The route through points (m), each heading towards the next one; the last keeps the heading of the one before."""
        xy = np.asarray(xy, dtype=np.float64)
        if xy.ndim != 2 or xy.shape[1] != 2 or len(xy) < 2:
            raise SettingError(f"a route needs at least 2 points (x, y), got an array of shape {xy.shape}")
        with np.errstate(all="ignore"):  # the constructor refuses values that are not finite
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
        """Distance of each point along the route (m)."""
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
        """Change of direction at distances along the route (rad, 0 to pi).

        Args:
            distance: Positions along the route (m).
            reach: Length of the stretches before and after, whose directions are compared (m). The change is 0 nearer than
                this to an end.
        """
        distance = np.atleast_1d(distance)
        before, here, after = (self.at(distance + offset)[:, :2] for offset in (-reach, 0.0, reach))
        arriving, leaving = here - before, after - here
        turn = np.arctan2(leaving[:, 1], leaving[:, 0]) - np.arctan2(arriving[:, 1], arriving[:, 0])
        return np.where((distance < reach) | (distance > self.length - reach), 0.0, np.abs(wrap_angle(turn)))

    def resampled(self, spacing: float) -> "Route":
        """The route with a pose every `spacing` metres of its length, from its start."""
        if not (np.isfinite(spacing) and 0 < spacing <= self.length):
            raise SettingError(
                f"spacing {spacing:g} m does not fit a route of {self.length:.3f} m; give 0 < spacing <= length"
            )
        if self.length / spacing > 10**6:
            raise SettingError(
                f"spacing {spacing:g} m cuts a route of {self.length:.3f} m into over a million; give a wider one"
            )
        return Route(self.at(np.arange(0.0, self.length * (1 + 1e-12), spacing)))

    def nearest(self, xy: Float[np.ndarray, "k 2"]) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
        """Where the route is nearest to points (m).

        Returns:
            The distance of each point to the route, and how far along the route its nearest position is (both m).
        """
        xy = np.asarray(xy, dtype=np.float64)
        batch = max(1, 10**6 // len(self.xy))  # bounds the memory of all distances
        if len(xy) > batch:
            parts = [self.nearest(xy[i : i + batch]) for i in range(0, len(xy), batch)]
            return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])
        (x, y), (dx, dy) = self.xy[:-1].T, np.diff(self.xy, axis=0).T
        length = np.hypot(dx, dy)
        from_x, from_y = xy[:, :1] - x, xy[:, 1:] - y  # (k, n - 1)
        share = ((from_x * dx + from_y * dy) / length**2).clip(0, 1)
        squared = (from_x - share * dx) ** 2 + (from_y - share * dy) ** 2
        best = squared.argmin(axis=1)
        rows = np.arange(len(xy))
        return np.sqrt(squared[rows, best]), self.arc[best] + share[rows, best] * length[best]
