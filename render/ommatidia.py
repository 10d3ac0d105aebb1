"""Where the ommatidia of compound eyes look: of animals, of regular eyes, and of files.

Azimuths are turns to the left of the direction ahead, elevations are over the horizon, and the acceptance angle is the full width of a
Gaussian at half its height, all in radians here and in degrees in names, tables and messages.
"""

import csv
import math
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int8

from tussock.world.errors import FileError, SettingError
from tussock.world.registry import suggestion
from tussock.world.specs import Spec, parse_spec

MAX_OMMATIDIA = 100_000
MAX_ASKED = 5_000  # at most, where a number is asked for: each row of an image has those that look equally high
NARROWEST, WIDEST = 0.2, 90.0  # acceptance angles (deg)
LEFT, RIGHT, EITHER = 1, -1, 0  # sides
STEP_DEG = 0.5  # to which the azimuths of the eyes here are rounded: so few rows of an image hold them all


class Ommatidia(NamedTuple):
    """The ommatidia of both eyes.

    Attributes:
        azimuth: (n,) To the left of the direction ahead (rad).
        elevation: (n,) Over the horizon (rad).
        acceptance: (n,) Full width of the Gaussian at half its height (rad).
        side: (n,) The eye that each belongs to: LEFT, RIGHT or EITHER, where that is not known.
    """

    azimuth: Float[np.ndarray, " n"]
    elevation: Float[np.ndarray, " n"]
    acceptance: Float[np.ndarray, " n"]
    side: Int8[np.ndarray, " n"]


def ant() -> Ommatidia:
    """A desert ant, Melophorus bagoti (Schwarz, Narendra and Zeil 2011): 420 to 590 ommatidia an eye, 3.7 degrees apart, 150 degrees wide.

    The acceptance angle is that of the rhabdom, 2.9 degrees, and of the lens, 2.3 degrees, together: 3.7 degrees. The outline is not
    published; it is an ellipse from straight ahead to 150 degrees, and from 10 degrees below the horizon to 50 above it.
    """

    def inside(azimuth: float, elevation: float) -> bool:
        return ((azimuth - 75) / 75) ** 2 + ((elevation - 20) / 30) ** 2 <= 1

    return _both(_hexagons(3.7, inside), 3.7)


def bee() -> Ommatidia:
    """A honeybee worker after Stuerzl et al. (2010): 1.5 to 4.5 degrees apart vertically, 2.4 to 4.6 horizontally, finest near the horizon.

    The acceptance angle is 2.6 degrees everywhere.
    """
    half = [*_bee_rows(1), *_bee_rows(-1)]
    return _both(sorted(set(half)), 2.6)


def fly(ommatidia: int = 700, acceptance_deg: float | None = None) -> Ommatidia:
    """A fly-like eye: a hexagonal grid, equally fine everywhere, over the half of the sphere that is to the left, and to the right.

    Args:
        ommatidia: In each eye, about; a fruit fly has 700 to 750.
        acceptance_deg: Acceptance angle; None is the distance between neighbours.
    """
    apart = _spacing(_counted("fly", ommatidia), 2 * math.pi)
    grid = _hexagons(apart, lambda azimuth, elevation: 0 <= azimuth <= 180)
    return _both(grid, _acceptance("fly", acceptance_deg, apart))


def sphere(ommatidia: int = 1000, acceptance_deg: float | None = None) -> Ommatidia:
    """One eye that looks everywhere, each ommatidium over an equal part of the sphere (a Fibonacci lattice).

    Args:
        ommatidia: How many.
        acceptance_deg: Acceptance angle; None is the distance between neighbours.
    """
    n = _counted("sphere", ommatidia)
    place, golden = np.arange(n), math.pi * (3 - math.sqrt(5))
    azimuth = np.radians(STEP_DEG * np.rint(np.degrees((place * golden) % (2 * math.pi) - math.pi) / STEP_DEG))
    elevation = np.arcsin(1 - (2 * place + 1) / n)
    spread = np.full(n, math.radians(_acceptance("sphere", acceptance_deg, _spacing(n, 4 * math.pi))))
    return Ommatidia(azimuth, elevation, spread, np.zeros(n, np.int8))


EYES: dict[str, Callable[..., Ommatidia]] = {"ant": ant, "bee": bee, "fly": fly, "sphere": sphere}


def eye_spec(text: str) -> Spec:
    """The eye that a text names, such as "fly ommatidia=300". Raises SettingError."""

    def find(name: str) -> Callable[..., Ommatidia]:
        if name not in EYES:
            known = ", ".join(EYES)
            raise SettingError(
                f"unknown eye {name!r}{suggestion(name, EYES)}; known: {known}, or a file (.eye or .csv)"
            )
        return EYES[name]

    return parse_spec(text, find)


@cache
def named_eye(text: str) -> Ommatidia:
    """The ommatidia of an eye by its name. Raises SettingError."""
    return eye_spec(text).make()


def read_eye(path: Path) -> Ommatidia:
    """The ommatidia of a file: .eye as compound-ray reads it, or a table (.csv) of azimuth_deg, elevation_deg and acceptance_deg.

    A line of .eye has position (x, y, z), direction (x to the right, y up, z ahead), acceptance angle (rad) and the offset of the focal
    point. Positions and offsets, which are millimetres, are left out: all ommatidia look from one point. A table may have a column
    side, of left and right.

    Raises:
        FileError: For a file that is not one of the two, with its line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise FileError(f"the eye {str(path)!r} was not found; give a name ({', '.join(EYES)}) or a file") from error
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path} cannot be read as an eye ({error}); give .eye or .csv") from error
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if not lines:
        raise FileError(f"{path} is empty; an eye has a line for each ommatidium")
    if len(lines) > MAX_OMMATIDIA:
        raise FileError(f"{path} has {len(lines)} lines; give at most {MAX_OMMATIDIA:,} ommatidia")
    found = _of_table(path, lines) if path.suffix.lower() == ".csv" else _of_eye_file(path, lines)
    if (problem := problem_of(found)) is not None:
        which, words = problem
        raise FileError(f"{path}, line {lines[which - len(found.azimuth)][0]}: {words}")
    return found


def _of_eye_file(path: Path, lines: list[tuple[int, str]]) -> Ommatidia:
    rows = [_numbers(path, number, line.replace(",", " ").split(), 8) for number, line in lines]
    x, y, z, acceptance = np.array(rows)[:, 3:7].T
    largest = np.maximum(np.abs([x, y, z]).max(axis=0), 1e-300)  # so that no square overflows
    x, y, z = x / largest, y / largest, z / largest
    length = np.sqrt(x * x + y * y + z * z)
    if (bad := ~(length > 0)).any():
        raise FileError(f"{path}, line {lines[int(bad.argmax())][0]}: its direction is 0; give a vector")
    return Ommatidia(np.arctan2(-x, z), np.arcsin(np.clip(y / length, -1, 1)), acceptance, np.zeros(len(x), np.int8))


def _of_table(path: Path, lines: list[tuple[int, str]]) -> Ommatidia:
    separator = ";" if ";" in lines[0][1] else ","
    cells = [[cell.strip() for cell in row] for row in csv.reader([line for _, line in lines], delimiter=separator)]
    names = [name.lower() for name in cells[0]]
    wanted = ["azimuth_deg", "elevation_deg", "acceptance_deg"]
    for name in wanted:
        if names.count(name) != 1:
            raise FileError(
                f"{path}, line {lines[0][0]}: {'no' if name not in names else 'more than one'} column {name}; the first line names "
                "azimuth_deg (to the left of ahead), elevation_deg, acceptance_deg (full width at half height) and, if you like, side"
            )
    angles, sides = [], []
    for (number, _), row in zip(lines[1:], cells[1:], strict=True):
        if len(row) != len(names):
            raise FileError(f"{path}, line {number}: {len(row)} values for {len(names)} columns")
        given = dict(zip(names, row, strict=True))
        angles.append(_numbers(path, number, [given[name] for name in wanted], 3))
        side = given.get("side", "").lower()
        if side not in ("", "left", "right"):
            raise FileError(f"{path}, line {number}: side is {side!r}; give left or right, or nothing")
        sides.append({"left": LEFT, "right": RIGHT}.get(side, EITHER))
    if not angles:
        raise FileError(f"{path} has no ommatidia; give a line for each below the names of the columns")
    azimuth, elevation, acceptance = np.radians(angles).T
    return Ommatidia(azimuth, elevation, acceptance, np.array(sides, np.int8))


def _numbers(path: Path, line: int, cells: list[str], count: int) -> list[float]:
    try:
        found = [float(cell) for cell in cells]
    except ValueError as error:
        raise FileError(f"{path}, line {line}: {error}; give numbers") from error
    if len(found) != count:
        raise FileError(
            f"{path}, line {line}: {len(found)} values; give position and direction (3 each), acceptance angle (rad) and focal offset"
        )
    if not all(map(math.isfinite, found)):
        raise FileError(f"{path}, line {line}: {' '.join(cells)!r} are not all finite; give numbers")
    return found


def problem_of(eyes: Ommatidia) -> tuple[int, str] | None:
    """Which ommatidium cannot be, and what is wrong with it; None where all can be."""
    limits = (
        ("acceptance angle", eyes.acceptance, NARROWEST, WIDEST),
        ("elevation", eyes.elevation, -90, 90),
        ("azimuth", eyes.azimuth, -360, 360),
    )
    for name, radians, low, high in limits:
        degrees = np.degrees(radians)
        if (bad := ~((degrees >= low - 1e-9) & (degrees <= high + 1e-9))).any():  # ~: of nan as well
            worst = int(bad.argmax())
            return worst, f"its {name} is {degrees[worst]:g} degrees; give {low:g} to {high:g}"
    if (bad := ~np.isin(eyes.side, (LEFT, RIGHT, EITHER))).any():
        return int(bad.argmax()), f"its side is {eyes.side[bad][0]}; give {LEFT} (left), {RIGHT} (right) or {EITHER}"
    return None


def _counted(name: str, ommatidia: int) -> int:
    if isinstance(ommatidia, bool) or not isinstance(ommatidia, int) or not 10 <= ommatidia <= MAX_ASKED:
        raise SettingError(f"eye {name}: ommatidia is {ommatidia!r}; give a whole number from 10 to {MAX_ASKED}")
    return ommatidia


def _acceptance(name: str, degrees: float | None, usual: float) -> float:
    if degrees is None:
        return usual
    if isinstance(degrees, bool) or not isinstance(degrees, int | float) or not NARROWEST <= degrees <= WIDEST:
        raise SettingError(f"eye {name}: acceptance_deg is {degrees!r}; give {NARROWEST:g} to {WIDEST:g}")
    return float(degrees)


def _spacing(n: int, solid_angle: float) -> float:
    """Distance of neighbours (deg) on a hexagonal grid of n over a solid angle (sr): each has the area d^2 sqrt(3) / 2."""
    return math.degrees(math.sqrt(2 * solid_angle / (math.sqrt(3) * n)))


def _hexagons(apart: float, inside: Callable[[float, float], bool]) -> list[tuple[float, float]]:
    """Azimuths and elevations (deg) of a hexagonal grid in rows from -90 to 90 degrees; every other row is shifted by half its step."""
    rows = round(180 / (apart * math.sqrt(3) / 2))
    found = []
    for row in range(rows):
        elevation = (row + 0.5) * 180 / rows - 90
        count = max(1, round(360 * math.cos(math.radians(elevation)) / apart))
        turns = ((k + 0.25 + 0.5 * (row % 2)) * 360 / count for k in range(count))
        found += [(azimuth, elevation) for azimuth in turns if inside(azimuth, elevation)]
    return found


def _both(left: list[tuple[float, float]], acceptance: float) -> Ommatidia:
    """Both eyes, from azimuths and elevations (deg) of the left one."""
    azimuth, elevation = np.array(left).T
    azimuth = np.radians(STEP_DEG * np.rint(azimuth / STEP_DEG))
    sides = np.repeat(np.array([LEFT, RIGHT], np.int8), len(left))
    elevation, width = np.radians(np.tile(elevation, 2)), np.full(2 * len(left), math.radians(acceptance))
    return Ommatidia(np.concatenate([azimuth, -azimuth]), elevation, width, sides)


# The edge of the bee's left eye (deg): at an elevation, how far it reaches outwards, and inwards over the middle.
_OUTWARDS = np.array([
    (-74.5, 270), (-69.7, 191.9), (-60.2, 176.8), (-50.2, 174.6), (-40.2, 173.4), (-30.3, 166.8), (-20.3, 160.5), (-10.2, 158.5),
    (0, 156.7), (10.2, 158.5), (20.2, 163.4), (30.1, 174.3), (39.9, 189), (49.4, 202.4), (58.9, 215.8), (67.8, 244.7), (69, 270),
]).T  # fmt: skip
_INWARDS = np.array([
    (-74.5, 90), (-67.8, 63.5), (-58.1, 52.5), (-48.5, 44.1), (-38.9, 36.1), (-29.4, 26.8), (-19.8, 20.6), (-9.9, 14.6), (0, 14.5),
    (9.9, 14.4), (19.8, 15.5), (29.6, 21.2), (39.4, 25.5), (49.2, 31.6), (58.9, 42), (68.1, 70.7), (69, 90),
]).T  # fmt: skip


def _bee_rows(upwards: int) -> Iterator[tuple[float, float]]:
    """Azimuths and elevations (deg) of the left eye, from the horizon upwards (1) or downwards (-1)."""
    elevation, row = 0.0, 0
    while abs(elevation) < 88:
        for side, (heights, reaches) in ((1, _OUTWARDS), (-1, _INWARDS)):
            reach = min(float(np.interp(elevation, heights, reaches)), 270.0 if side > 0 else 90.0)
            away = _on_row(3.7 / 2, elevation) if row % 2 else 0.0
            while away <= reach:
                yield side * away, elevation
                away += _on_row(_bee_spacing(side * away, abs(elevation)), elevation)
        elevation += upwards * (1.5 + 3.0 * abs(elevation) / 90) / 2
        row += 1


def _bee_spacing(azimuth: float, height: float) -> float:
    """Horizontal distance of neighbours (deg): 2.4 at 45 degrees, 3.7 ahead and to the side, up to 4.6 behind and inwards."""
    if 0 <= azimuth <= 90:
        return 2.4 + 1.3 * abs(azimuth - 45) / 45
    ramp = min(1.0, (azimuth - 90) / 60 if azimuth > 0 else -azimuth / 45)
    return 3.7 + 0.9 * ramp * min(1.0, (90 - height) / 40)


def _on_row(apart: float, elevation: float) -> float:
    """The difference of azimuths of two directions at an elevation, which are some degrees apart."""
    share = math.sin(math.radians(apart / 2)) / math.cos(math.radians(elevation))
    return math.degrees(2 * math.asin(min(1.0, share)))
