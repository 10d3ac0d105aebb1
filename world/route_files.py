"""Routes on disk: tables as text, MATLAB's .mat, numpy's .npy, AntWorld `.bin`. And what all readers of files here share."""

import csv
import logging
import os
from pathlib import Path

import numpy as np
from jaxtyping import Float

from .atomic import replacing
from .errors import FileError, InputError, SettingError
from .geometry import Route
from .heading_names import HEADINGS
from .headings import Diagnosis, convert, diagnose, of_radians, path_directions
from .route_points import Points, read_points
from .route_smoothing import jitter, smoothed

logger = logging.getLogger(__name__)

COLUMNS = ("x_m", "y_m", "heading_deg")  # of a route as CSV
MAX_BYTES = 2**29  # of a file, which is read whole
LARGE, SMALL = 100.0, 0.05  # m; a route that is larger or smaller, and whose unit is not stated, may be in another unit
JITTERY = 0.3  # of a step; with more jitter, the direction from point to point is noise
MANY_REPEATED = 0.05  # of the points


def read_route(
    path: str | os.PathLike, headings: str = "auto", columns: str | None = None, smooth: float = 0.0
) -> Route:
    """Read a route: a table as text, MATLAB's .mat, numpy's .npy or .npz, or AntWorld `.bin`.

    What the columns of a table mean is taken from their names: x_m, `X [mm]`, pos_x, easting, heading_deg, yaw, bearing and others. Without
    a unit they are metres and degrees. Without headings each point faces the next one. What is assumed or lost is logged as a warning.

    Args:
        path: The file.
        headings: How its headings are meant, one of `headings.HEADINGS`. "auto" reads them as their column states, else as degrees
            counter-clockwise from +x, and refuses those that follow the path in another convention only. "path" takes the direction to the
            next point, "as-is" is "auto" without a check.
        columns: Names of the columns in their order, as "x [mm],y [mm],-,heading"; None takes those of the file. Of a file with several
            arrays: the name of one, those of x, y and heading, or "name:x,y,heading".
        smooth: Standard deviation of the window over which positions are averaged along the path (m); 0 is none.

    Raises:
        FileError: With the number of the line that cannot be used, or with the convention that the headings follow.
        SettingError: For invalid arguments.
    """
    if headings not in HEADINGS:
        raise SettingError(f"headings are {headings!r}; give one of {', '.join(HEADINGS)}")
    if not 0 <= smooth < np.inf:
        raise SettingError(f"smooth is {smooth!r}; give metres from 0")
    if os.path.isfile(Path(path) / "database_entries.csv"):
        raise FileError(f"{path} is the folder of an image database; give it as --route-database")
    path = existing_file(path, "route")
    if (size := path.stat().st_size) > MAX_BYTES:
        raise FileError(f"{path} has {size >> 20} MB; a route has up to {MAX_BYTES >> 20} MB")
    try:
        return _route(path, read_points(path, columns), headings, smooth)
    except csv.Error as error:
        raise FileError(f"{path} cannot be read as CSV ({error}); is it a route?") from error
    except InputError as error:
        raise naming(path, error) from error


def _route(path: Path, points: Points, headings: str, smooth: float) -> Route:
    """The route through points, with their headings as `read_route` takes them."""
    if len(points.xy) < 2:
        raise FileError(f"holds {len(points.xy)} point(s); a route needs at least 2")
    heading = np.zeros(len(points.xy)) if points.heading is None else points.heading
    route = Route(np.column_stack([points.xy, heading]))  # refuses what is not finite, and a single position
    _remark_positions(path, points, route, smooth)
    xy = smoothed(points.xy, smooth) if smooth else points.xy
    if points.heading is None and headings not in ("auto", "path", "as-is"):
        logger.warning(
            "%s has no headings, and --headings %s does nothing: each point faces the next one", path, headings
        )
    if points.heading is None or headings == "path":
        return Route(np.column_stack([xy, path_directions(xy)]), points.heights)
    read_as = "bearing" if points.bearing else "ccw"
    poses = np.column_stack([points.xy, heading])
    if points.radians:
        headings = of_radians(headings)
    if headings in ("auto", "as-is"):
        poses = convert(poses, read_as)
    else:
        poses, read_as = convert(poses, headings), headings
    if headings != "as-is":
        _check_headings(path, diagnose(poses, read_as), points.planes, chosen=headings != "auto")
    return Route(np.column_stack([xy, poses[:, 2]]), points.heights)


def _check_headings(path: Path, diagnosis: Diagnosis, planes: bool, chosen: bool) -> None:
    """Refuse headings that were not chosen and clearly mean something else; remark on those that are unusual.

    Args:
        path: The file.
        diagnosis: Of its headings.
        planes: Whether it is an AntWorld .bin, whose third plane may be a height.
        chosen: Whether the user has said how they are meant.
    """
    same = diagnosis.kind in ("zero", "constant")
    height = "; the third plane may be a height (cm)" if planes and same else ""
    message = f"{diagnosis}{height}; {diagnosis.flags}"
    if not chosen and (diagnosis.kind in ("convention", "zero") or height):
        raise FileError(message)
    if str(diagnosis):
        logger.warning("%s: %s", path, message if not chosen else f"with --headings as given, {diagnosis}")


def _remark_positions(path: Path, points: Points, route: Route, smooth: float) -> None:
    """Warn of points left out, positions that jitter, and units that were assumed and seem wrong."""
    count, kept = len(points.xy), len(route.xy)
    if points.gaps:
        lines = ", ".join(map(str, points.gaps[:3])) + (", .." if len(points.gaps) > 3 else "")
        logger.warning(
            "%s: %d of %d rows lack a number and are left out (lines %s)",
            path,
            len(points.gaps),
            count + len(points.gaps),
            lines,
        )
    if count - kept > max(2, MANY_REPEATED * count):
        logger.warning("%s: %d of %d points repeat the one before and are left out", path, count - kept, count)
    extent = float(np.ptp(route.xy, axis=0).max())
    if points.unstated and not SMALL < extent < LARGE:
        logger.warning(
            "%s: %s have no unit; taken as metres, the route is %.4g m wide. If they are %s",
            path,
            points.unstated,
            extent,
            "millimetres, give --columns 'x [mm],y [mm]', with the other columns in their order; pixels must be converted"
            if extent > LARGE
            else "degrees on the globe, convert them to metres (UTM)",
        )
    noise, step = jitter(route.xy), float(np.median(np.diff(route.arc)))
    if not smooth and noise > JITTERY * step:
        logger.warning(
            "%s: positions jitter by about %.2g m at steps of %.2g m: length and directions are not exact; --smooth-m %.1g averages them",
            path,
            noise,
            step,
            10 * noise,
        )


def write_route(route: Route, path: str | os.PathLike) -> None:
    """Write a route as CSV (x_m, y_m, heading_deg; and z_m where its heights are known)."""
    if Path(path).suffix.lower() != ".csv":
        raise FileError(f"{path}: a route is written as .csv")
    heights = [] if route.heights is None else [route.heights]
    rows = np.column_stack([route.xy, np.degrees(route.poses[:, 2]), *heights]).tolist()
    with replacing(path) as partial, partial.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow((*COLUMNS, *("z_m",) * len(heights)))
        writer.writerows(rows)


def existing_file(path: str | os.PathLike, kind: str) -> Path:
    """The path of a file that exists. kind: what it holds, for the FileError."""
    path = Path(path)
    if not os.path.isfile(path):  # unlike Path.is_file, it is False for a name that is too long
        raise FileError(f"there is no {kind} file {path}; check the name")
    return path


def naming(path: Path, error: InputError) -> InputError:
    """The error, with the file that it is about."""
    message = str(error)
    if message.startswith(str(path)):
        return error
    return FileError(f"{path}, {message}" if message.startswith("line ") else f"{path}: {message}")


def read_planes(path: Path, planes: int, what: str) -> Float[np.ndarray, "planes n"]:
    """The arrays of little-endian float64 that an AntWorld file consists of, one after the other.

    Args:
        path: The file.
        planes: Number of arrays.
        what: What the file holds, for the FileError.
    """
    size = path.stat().st_size
    if size == 0 or size % (8 * planes):
        raise FileError(f"{path} has {size} bytes; {what} has a multiple of {8 * planes} (is it truncated?)")
    return np.fromfile(path, dtype="<f8").reshape(planes, -1)
