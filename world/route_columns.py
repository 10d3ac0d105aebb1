"""What the names of a table's columns mean for a route: which hold x, y and the heading, and in which unit."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .errors import FileError, SettingError
from .meshes.reading import UNITS

LENGTHS = {  # names of units: metres, and what they are called in messages
    name: (metres, label)
    for metres, label, names in (
        (UNITS["m"], "metres", "m metre metres meter meters"),
        (UNITS["mm"], "millimetres", "mm millimetre millimetres millimeter millimeters"),
        (UNITS["cm"], "centimetres", "cm centimetre centimetres centimeter centimeters"),
        (1e3, "kilometres", "km kilometre kilometres kilometer kilometers"),
        (UNITS["in"], "inches", "in inch inches"),
        (UNITS["ft"], "feet", "ft foot feet"),
    )
    for name in names.split()
}
ANGLES = dict.fromkeys(["deg", "degree", "degrees", "°"], (np.pi / 180, "degrees"))
ANGLES |= dict.fromkeys(["rad", "radian", "radians"], (1.0, "radians"))
PIXELS = ("px", "pix", "pixel", "pixels")
POSITIONS = {
    **dict.fromkeys(["x", "px", "tx", "posx", "xpos", "easting", "east"], "x"),
    **dict.fromkeys(["y", "py", "ty", "posy", "ypos", "northing", "north"], "y"),
}
# Words for headings; of the second kind one is taken where none of the first is there.
CERTAIN = ("heading", "hdg", "yaw", "theta", "bearing", "azimuth")
POSSIBLE = ("orientation", "angle", "direction", "dir", "course", "compass", "cog", "psi", "phi", "th")
BEARINGS = ("bearing", "azimuth", "compass", "course", "cog")  # clockwise from north by their names
# Words that do not change what a column holds.
FILLERS = re.findall(
    r"\w+",
    """
    pos position pose point coord coords coordinate coordinates location loc field utm world map local ground
    truth gt raw filtered smooth smoothed centre center centroid head body robot ant agent animal true magnetic
    gps imu odom odometry of the wcentroid pcentroid
    """,
)  # the last two as in TRex: "X#wcentroid (cm)"
EUROC = ["p", "rs", "r"]  # positions of EuRoC: "p_RS_R_x [m]"
QUATERNION = re.compile(r"(?:quaternion|quat|orientation|rotation|q|qrs)([xyzw])")
TRACKS = {  # words for what a row belongs to, where a file holds several tracks
    *("track", "trajectory", "individual", "subject", "particle", "identity", "tag", "trial"),
    *("animal", "ant", "bee", "insect", "fly", "fish"),
}
NUMBERS = {"id", "no", "nr", "number", "name", "local", "identifier"}  # words beside those
GEOGRAPHIC = {"lat", "latitude", "lon", "long", "lng", "longitude"}


@dataclass(frozen=True)
class Column:
    """What a column holds.

    Attributes:
        axis: "x", "y" or "heading".
        name: Its name in the file.
        factor: Of its numbers, to metres or radians.
        unit: Name of the unit, for messages.
        stated: Whether the name contains the unit. Without it, metres and degrees are assumed.
        bearing: Whether its numbers are compass bearings, by its name.
        certain: Whether its name has no other meaning.
    """

    axis: str
    name: str
    factor: float
    unit: str
    stated: bool
    bearing: bool = False
    certain: bool = True


def column_of(name: str) -> Column | None:
    """What a column of this name holds, or None. Raises FileError for a unit that is unknown, or pixels."""
    words = [word for word in _words(name)[0] if word not in FILLERS]
    if len(words) == 2 and words[0] == "compass":
        words = words[1:]
    if words[:3] == EUROC:
        words = words[3:]
    if len(words) != 1:
        return None
    axis = POSITIONS.get(words[0]) or ("heading" if words[0] in (*CERTAIN, *POSSIBLE) else None)
    return chosen_column(name, axis) if axis else None


def chosen_column(name: str, axis: str) -> Column:
    """A column that is known to hold an axis, with the unit of its name. Raises FileError for a unit that is unknown, or pixels."""
    words, unit = _words(name)
    units = ANGLES if axis == "heading" else LENGTHS
    usual = "deg" if axis == "heading" else "m"
    if unit in PIXELS:
        raise FileError(f"{name!r} is in pixels; a route needs metres: multiply by the metres of a pixel")
    if (unit or usual) not in units:
        wanted = "degrees or radians" if axis == "heading" else "mm, cm or m"
        raise FileError(f"the unit of {name!r} is unknown; a route needs {wanted}")
    factor, label = units[unit or usual]
    bearing = any(word in BEARINGS for word in words)
    certain = axis != "heading" or any(word in CERTAIN for word in words)
    return Column(axis, name, factor, label, unit is not None, bearing, certain)


def _words(name: str) -> tuple[list[str], str | None]:
    """The words of a name in lower case, and its unit where it has one."""
    name = re.sub(r"([a-z])([A-Z])", r"\1 \2", name.strip())
    bracket = re.fullmatch(r"(.*?)\s*[\[({]\s*([^\[\](){}]*?)\s*[\])}]", name, re.DOTALL)
    base, unit = (bracket[1], bracket[2].lower() or None) if bracket else (name, None)
    words = re.findall(r"[^\W_]+|°", base.lower())
    if unit is None and len(words) > 1 and words[-1] in {*LENGTHS, *ANGLES, *PIXELS}:
        unit = words.pop()
    return words, unit


def find_columns(names: list[str]) -> dict[str, tuple[int, Column]]:
    """Which of some columns hold x, y and the heading.

    Returns:
        Index and meaning of each by its axis, x first; those that are not there are left out.

    Raises:
        FileError: Where several columns hold the same.
    """
    columns = [(index, column) for index, name in enumerate(names) if (column := column_of(name))]
    found = {}
    for axis in ("x", "y", "heading"):
        same = [each for each in columns if each[1].axis == axis]
        same = [each for each in same if each[1].certain] or same
        if len({column.name for _, column in same}) > 1:
            both = " and ".join(repr(column.name) for _, column in same)
            raise FileError(
                f"the columns {both} all hold {axis}; choose with --columns (names in their order, - skips one)"
            )
        if len(same) > 1:
            numbers = " and ".join(str(index + 1) for index, _ in same)
            raise FileError(f"columns {numbers} are all called {same[0][1].name!r}; rename all but one")
        if same:
            found[axis] = same[0]
    if "heading" in found:
        index, column = found["heading"]
        found["heading"] = index, as_of_database(column, names)
    return found


def find_quaternion(names: list[str]) -> list[int] | None:
    """Indices of the columns that hold x, y, z and w of an orientation, or None where one is missing or there twice."""
    parts = {}
    for index, name in enumerate(names):
        if match := QUATERNION.fullmatch("".join(word for word in _words(name)[0] if word not in FILLERS)):
            parts.setdefault(match[1], []).append(index)
    return [parts[part][0] for part in "xyzw"] if [len(parts.get(part, ())) for part in "xyzw"] == [1] * 4 else None


def find_height(names: list[str]) -> int | None:
    """Index of the only column z, or None."""
    found = [
        index
        for index, name in enumerate(names)
        if [word for word in _words(name)[0] if word not in FILLERS] in (["z"], ["tz"], ["posz"], ["zpos"])
    ]
    return found[0] if len(found) == 1 else None


def refuse_several_tracks(names: Sequence[str], values_of: Callable[[int], list]) -> None:
    """Refuse columns such as ant_id whose values tell several tracks apart. Raises FileError.

    Args:
        names: Of the columns.
        values_of: Gives the values of the column with an index, without empty ones.
    """
    for index, name in enumerate(names):
        words = set(_words(name)[0])
        if words != {"id"} and not (words & TRACKS and words <= TRACKS | NUMBERS):
            continue
        values = values_of(index)
        different = list(dict.fromkeys(values))
        if 2 <= len(different) <= len(values) / 3:  # else it numbers the rows
            listed = ", ".join(map(str, different[:3])) + (", .." if len(different) > 3 else "")
            raise FileError(
                f"it holds {len(different)} tracks by its column {name!r} ({listed}); keep the rows of one, or give --columns to read "
                "all as one"
            )


def with_unit(name: str, cell: str) -> str:
    """The name of a column, with the unit in a cell beneath it where it has none of its own."""
    unit = cell.strip("()[]{} ").lower()
    known = unit in {*LENGTHS, *ANGLES, *PIXELS}
    return f"{name} [{unit}]" if known and name and _words(name)[1] is None else name


def as_of_database(heading: Column, names: list[str]) -> Column:
    """A column of headings, which are bearings where the names are those of an image database of the BoB format."""
    is_database = {"X [mm]", "Heading [degrees]"} <= set(names)
    return replace(heading, bearing=True) if is_database else heading


def parse_columns(text: str) -> list[str]:
    """The names that --columns gives, in their order, "" for a column that is skipped. Raises SettingError."""
    names = [name.strip() for name in text.split(",")]
    names = ["" if name == "-" else name for name in names]
    try:
        for name in filter(None, names):
            if column_of(name) is None and name not in ("qx", "qy", "qz", "qw"):
                raise FileError(f"{name!r} is not a column of a route")
        found = find_columns(names)
    except FileError as error:
        raise SettingError(
            f"--columns {text!r}: {error}; give names such as x,y,heading or 'x [mm],y [mm],-'"
        ) from error
    if not {"x", "y"} <= found.keys():
        raise SettingError(
            f"--columns {text!r}: there is no x or no y; give names such as x,y,heading or 'x [mm],y [mm],-'"
        )
    return names


def is_geographic(names: list[str]) -> bool:
    """Whether columns hold latitudes or longitudes."""
    return any(set(_words(name)[0]) & GEOGRAPHIC for name in names)
