"""Conventions of headings in files: the only place that knows them. Which one do the headings of a path follow?

A heading is compared with the direction of the path over a chord: the straight line between two points some distance apart. Where a
tracker's jitter is as large as a step, the direction from row to row is noise, and that over a longer chord is not. The displacement over a
chord is the sum of the steps, so its direction is that of the mean heading vector of its rows, around bends too.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float

from .errors import SettingError
from .geometry import wrap_angle
from .heading_names import HEADINGS


class Convention(NamedTuple):
    """How the numbers in a file mean directions.

    Attributes:
        label: What such headings are, for messages.
        heading: Converts what the numbers are as degrees counter-clockwise from +x (rad) to headings (rad).
        mirrored: Whether they turn clockwise.
        radians: Whether the numbers are radians.
    """

    label: str
    heading: Callable
    mirrored: bool = False
    radians: bool = False


CONVENTIONS = {
    "ccw": Convention("degrees counter-clockwise from +x", lambda angle: angle),
    "bearing": Convention("bearings clockwise from north", lambda angle: np.pi / 2 - angle, mirrored=True),
    "radians": Convention("radians counter-clockwise from +x", np.degrees, radians=True),
    "radians-bearing": Convention(
        "bearings in radians", lambda angle: np.pi / 2 - np.degrees(angle), mirrored=True, radians=True
    ),
    "clockwise": Convention("degrees clockwise from +x", lambda angle: -angle, mirrored=True),
    "ccw-from-north": Convention("degrees counter-clockwise from +y", lambda angle: angle + np.pi / 2),
    "backwards": Convention("degrees counter-clockwise from -x (backwards)", lambda angle: angle + np.pi),
    "bearing-backwards": Convention("bearings backwards", lambda angle: 3 * np.pi / 2 - angle, mirrored=True),
}

SAME = np.radians(10)  # median angle to the path up to which no other convention is considered
FIT = np.radians(20)  # .. up to which a convention fits
OFF = np.radians(40)  # .. beyond which headings do not follow the path
MIN_CHORDS = 8  # of the longest chords that are tried
EVIDENCE = 12.0  # of Rayleigh's test, n R^2: random angles exceed it once in e^12 = 160,000 cases
EXPLAINED = 0.25  # of the variation of the path may be left between the path and headings that follow it
STRAIGHT = 0.002  # a path whose directions are spread less, 1 - R (a standard deviation of 4 degrees), is straight
NEARLY_STRAIGHT = 0.02  # .. and one whose single heading may be that of another convention (11 degrees)
CONSTANT = np.radians(3)  # circular standard deviation of headings that count as constant
MAX_ROWS = 20_000  # that are examined; of more, every n-th


@dataclass(frozen=True)
class Diagnosis:
    """How headings go with a path.

    Attributes:
        kind: "follows": along the path, or nothing speaks against it. "convention": another convention fits. "perhaps": another one fits,
            but the path is too straight or too short to exclude chance. "turned": always at the same angle to the path. "zero", "constant":
            all the same, and the path is not. "unrelated": none of these.
        off: Median angle between headings and path (rad), nan where there is no path.
        convention: Name of another convention that fits, or None.
        angle: The constant angle, of "turned" to the path, of "constant" in the convention of the file (rad).
    """

    kind: str
    off: float
    convention: str | None = None
    angle: float = 0.0

    def __str__(self) -> str:
        """What is unusual about the headings, as a part of a sentence; empty where nothing is."""
        off, angle = (
            f"{np.degrees(self.off):.0f} degrees off the path (median)",
            f"{np.degrees(self.angle):.0f} degrees",
        )
        fits = f"; as {CONVENTIONS[self.convention].label} they fit" if self.convention else ""
        side = "left" if self.angle > 0 else "right"
        if abs(np.degrees(self.angle)) > 170:
            turned = "headings point backwards along the path"
        else:
            turned = f"headings are a constant {abs(np.degrees(self.angle)):.0f} degrees to the {side} of the path"
        return {
            "follows": "",
            "convention": f"headings are {off}{fits}",
            "perhaps": f"headings are {off}{fits} (the path is too straight or too short to be sure)",
            "turned": f"{turned}{fits}",
            "zero": f"headings are all 0, and {off}{fits}",
            "constant": f"headings do not follow the path: constant {angle}{fits}",
            "unrelated": f"headings do not follow the path: they are {off}, and no known convention fits",
        }[self.kind]

    @property
    def flags(self) -> str:
        """The flags that take the headings otherwise, as a part of a sentence."""
        other = f"--headings {self.convention} reads them so, " if self.convention else ""
        return f"{other}--headings path takes the path's directions, --headings as-is takes them as they are"


def convert(poses: Float[np.ndarray, "n 3"], convention: str, read_as: str = "ccw") -> Float[np.ndarray, "n 3"]:
    """Poses with their headings read in another way.

    Args:
        poses: x (m), y (m) and heading (rad).
        convention: One of HEADINGS. "auto" and "as-is" change nothing, "path" takes the direction to the next point.
        read_as: The convention in which they were read, a name in CONVENTIONS.

    Raises:
        SettingError: For an unknown convention.
    """
    if convention not in HEADINGS:
        raise SettingError(f"headings are {convention!r}; give one of {', '.join(HEADINGS)}")
    if convention in ("auto", "as-is", read_as):
        return poses
    if convention == "path":
        return np.column_stack([poses[:, :2], path_directions(poses[:, :2])])
    numbers = _numbers(poses[:, 2], read_as)
    return np.column_stack([poses[:, :2], wrap_angle(CONVENTIONS[convention].heading(numbers))])


def of_radians(convention: str) -> str:
    """The convention of headings that a name means where their unit was read: they are not taken for degrees."""
    return {"radians": "ccw", "radians-bearing": "bearing"}.get(convention, convention)


def path_directions(xy: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """Direction from each point to the next other one (rad); the last ones keep that of the one before, 0 where there is none."""
    step = np.diff(xy, axis=0)
    moved = np.hypot(*step.T) > 1e-9
    if not moved.any():
        return np.zeros(len(xy))
    direction, rows = np.arctan2(step[moved, 1], step[moved, 0]), np.flatnonzero(moved)
    return direction[np.searchsorted(rows, np.arange(len(xy))).clip(max=len(rows) - 1)]


def diagnose(poses: Float[np.ndarray, "n 3"], read_as: str = "ccw") -> Diagnosis:
    """Compare the headings of a path with its direction.

    Args:
        poses: x (m), y (m) and heading (rad) of each row, as they were read; rows with nan are left out.
        read_as: The convention in which they were read, a name in CONVENTIONS.
    """
    poses = poses[np.isfinite(poses).all(axis=1)]
    poses = poses[:: len(poses) // MAX_ROWS + 1]
    numbers = _numbers(poses[:, 2], read_as)
    headings = {name: np.exp(1j * each.heading(numbers)) for name, each in CONVENTIONS.items()}
    fits = [_Fit.of(chords, headings) for chords in _scales(poses[:, :2])]
    if not fits:
        return Diagnosis("follows", np.nan)
    fit = min(fits, key=lambda each: min(each.off.values()) + 2 * FIT / each.chords)  # many chords say more
    off, least = fit.off[read_as], min(each.off[read_as] for each in fits)
    others = {name: value for name, value in fit.off.items() if name != read_as and value < min(FIT, least / 2)}
    best = min(others, key=lambda name: others[name], default=None)
    if best is not None and least > SAME and fit.explains(best) and not fit.explains(read_as):
        return Diagnosis("convention", off, best)
    mean, several = float(np.angle(fit.remainder[read_as].mean())), fits[0].chords > 4
    if not np.ptp(numbers) and least > (SAME if abs(mean) > SAME and several else FIT):
        best = best if fit.spread < NEARLY_STRAIGHT else None
        return Diagnosis(
            "constant" if numbers.any() or not several else "zero", off, best, float(wrap_angle(numbers[0]))
        )
    if least <= FIT or (len(poses) < 4 and least <= OFF):
        return Diagnosis("follows", least)
    if least > OFF and _deviation(np.exp(1j * numbers)) < CONSTANT:
        return Diagnosis("constant", off, None, float(np.angle(np.exp(1j * numbers).mean())))
    unsure = fit.bend / 2  # how well the path's direction at a row is known
    if fit.explains(read_as):
        return Diagnosis("turned", off, best, mean) if abs(mean) > max(SAME, unsure) else Diagnosis("follows", off)
    if best is not None:
        return Diagnosis("perhaps", off, best)
    return Diagnosis("unrelated" if least > OFF and unsure < SAME else "follows", off)


def _numbers(heading: Float[np.ndarray, " n"], read_as: str) -> Float[np.ndarray, " n"]:
    """What the numbers in the file are as degrees counter-clockwise from +x (rad), from headings that were read in a convention."""
    if CONVENTIONS[read_as].radians:
        return np.radians(heading if read_as == "radians" else np.pi / 2 - heading)
    inverse = {"ccw-from-north": -np.pi / 2, "backwards": -np.pi}
    return heading + inverse[read_as] if read_as in inverse else CONVENTIONS[read_as].heading(heading)


class _Chords(NamedTuple):
    """Chords of a path that follow one another.

    Attributes:
        direction: Unit vector of each, as a complex number.
        ends: First rows, and the last row.
        shift: 0 where a row belongs to the chord after it, 1 to the one before it.
    """

    direction: Complex[np.ndarray, " m"]
    ends: np.ndarray
    shift: int


def _scales(xy: Float[np.ndarray, "n 2"]) -> list[_Chords]:
    """Chords of the length of a step, and of twice and four times .. it, while there are enough."""
    points = xy[:, 0] + 1j * xy[:, 1]
    scales, length = [], 1e-9
    while True:
        ends = _ends(points, length)
        if len(ends) < 2 or (scales and len(ends) <= MIN_CHORDS):
            return scales
        chord = np.diff(points[ends])
        scales += [_Chords(chord / np.abs(chord), ends, shift) for shift in (0, 1)]
        length = 2 * max(length, float(np.median(np.abs(chord))))


def _ends(points: Complex[np.ndarray, " n"], length: float) -> np.ndarray:
    """Rows of a path, each of which is the first one farther than `length` from the one before."""
    rows, last = [0] if len(points) else [], points[0] if len(points) else 0
    for row, point in enumerate(points.tolist()):
        if abs(point - last) > length:
            rows.append(row)
            last = point
    return np.array(rows, dtype=int)


@dataclass(frozen=True)
class _Fit:
    """How headings fit chords.

    Attributes:
        off: Median angle to the path of each convention (rad).
        remainder: Unit vectors at the angle between heading and path of each chord, of each convention.
        spread: 1 - R of the directions of the path. R is the length of the mean of unit vectors.
        bend: Median angle between chords that follow one another (rad).
    """

    off: dict[str, float]
    remainder: dict[str, Complex[np.ndarray, " m"]]
    spread: float
    bend: float

    @classmethod
    def of(cls, chords: _Chords, headings: dict[str, Complex[np.ndarray, " n"]]) -> "_Fit":
        """Compare the mean heading of the rows of each chord with its direction, in each convention."""
        remainder = {}
        for name, heading in headings.items():
            total = np.r_[0, np.cumsum(heading)]
            mean = np.diff(total[chords.ends + chords.shift])
            remainder[name] = np.exp(1j * np.angle(mean * chords.direction.conj()))
        off = {name: float(np.median(np.abs(np.angle(each)))) for name, each in remainder.items()}
        bends = np.abs(np.angle(chords.direction[1:] * chords.direction[:-1].conj()))
        return cls(
            off, remainder, 1 - float(np.abs(chords.direction.mean())), float(np.median(bends)) if len(bends) else 0.0
        )

    @property
    def chords(self) -> int:
        """Number of chords."""
        return len(next(iter(self.remainder.values())))

    def explains(self, name: str) -> bool:
        """Whether headings turn as the path does, which neither constant nor random headings do."""
        each = self.remainder[name]
        length = float(np.abs(each.mean()))
        straight = self.spread < STRAIGHT
        return not straight and len(each) * length**2 > EVIDENCE and 1 - length < EXPLAINED * self.spread


def _deviation(unit: Complex[np.ndarray, " n"]) -> float:
    """Circular standard deviation of unit vectors (rad)."""
    return float(np.sqrt(-2 * np.log(max(np.abs(unit.mean()), 1e-12).clip(max=1))))
