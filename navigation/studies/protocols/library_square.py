"""The published images of Knight et al. (2019): six routes and a grid in Library Square, Sussex, as BrainsOnBoard published them."""

import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from tussock.render.images.database import Database, read_database
from tussock.world.errors import FileError

log = logging.getLogger(__name__)

ROUTES = tuple(f"route{number}" for number in range(1, 7))
IMAGES = ("mask", "skymask", "horizon", "unwrapped")
GRID = Path("image_grids") / "mid_day"
WIDTH, HEIGHT = 120, 25  # pixels that images are reduced to
TOLERANCE = 0.15  # m: how far a route is simplified where its folder does not say
AT_ONCE = 64  # images that are held in full size
FETCH = "give a clone of https://github.com/BrainsOnBoard/sussex_library_square_data, after git lfs pull (docs/protocols.md says how)"


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """Images of a route or of the grid.

    Attributes:
        images: (n, h, w) Grey.
        xy: (n, 2) Where they were taken (m).
        facing: (n,) The heading in the file (degrees, from x towards y), nan where it has none.
    """

    images: UInt8[np.ndarray, "n h w"]
    xy: Float[np.ndarray, "n 2"]
    facing: Float[np.ndarray, " n"]


def present_sets(folder: Path) -> list[tuple[str, str]]:
    """The routes and kinds of images that a folder has, in order. Raises FileError where it has none."""
    sets = [(route, kind) for route in ROUTES for kind in IMAGES if all(_folders(folder, route, kind))]
    if not sets:
        raise FileError(f"{folder} has none of the published images (routes/route1/mask and {GRID}/mask, say); {FETCH}")
    missing = len(ROUTES) * len(IMAGES) - len(sets)
    if missing:
        log.warning("%s lacks %d of the 24 sets of images; their numbers are left empty", folder, missing)
    return sets


def _folders(folder: Path, route: str, kind: str) -> list[Path | None]:
    """Where the images of a route and of the grid are, or what they are made of; None for those that are missing."""
    places = [folder / "routes" / route, folder / GRID]
    chosen = [kind, "mask"] if kind == "horizon" else [kind]
    return [next((place / each for each in chosen if (place / each).is_dir()), None) for place in places]


def read_set(folder: Path, route: str, kind: str) -> tuple[Recorded, Recorded]:
    """The images of a route, and those of the grid.

    `horizon` is, where its folder is missing, the mean of each column of `mask`: how high the foreground reaches.

    Args:
        folder: As of `present_sets`.
        route: One of ROUTES.
        kind: One of IMAGES.

    Raises:
        FileError: Where an image is missing or damaged, or is only a pointer of Git LFS.
    """
    route_folder, grid_folder = _folders(folder, route, kind)
    assert route_folder is not None
    assert grid_folder is not None
    return _read(route_folder, kind), _read(grid_folder, kind)


def _read(folder: Path, kind: str) -> Recorded:
    database = read_database(folder, "as-is")
    images = np.concatenate(list(_reduced(database)))
    if kind == "horizon" and folder.name != kind:
        images = images.mean(axis=1, keepdims=True).round().astype(np.uint8)
    x, y, heading = database.poses.T
    return Recorded(images=images, xy=np.column_stack([x, y]), facing=90 - np.degrees(heading))  # as the file has them


def _reduced(database: Database) -> Iterator[UInt8[np.ndarray, "n h w"]]:
    """The images in grey and reduced as the original does it, by bilinear samples."""
    for start in range(0, len(database), AT_ONCE):
        views = database.views(slice(start, start + AT_ONCE))[..., :3]
        yield np.stack(
            [
                cv2.resize(cv2.cvtColor(np.ascontiguousarray(view), cv2.COLOR_RGB2GRAY), (WIDTH, HEIGHT))
                for view in views
            ]
        )


def tolerance_of(folder: Path, route: str) -> float:
    """How far the line of a route is simplified (m): as the file decimate.sh in its folder says, in centimetres."""
    path = folder / "routes" / route / "decimate.sh"
    try:
        text = path.read_text(encoding="utf-8", errors="replace")[:1000]
    except OSError:
        log.warning("%s is missing, so this route is simplified to %g m, the original's default", path, TOLERANCE)
        return TOLERANCE
    match = re.search(r"DECIMATE_DISTANCE\s*=\s*([0-9.]+)", text)
    try:
        return float(match.group(1)) / 100 if match else TOLERANCE
    except ValueError as error:
        raise FileError(f"{path}: DECIMATE_DISTANCE is {match and match.group(1)!r}; give a number of cm") from error


def simplified(xy: Float[np.ndarray, "n 2"], tolerance: float) -> Float[np.ndarray, "m 2"]:
    """Corners of a line that leaves out what is within a tolerance of it.

    Points nearer than the tolerance to the last one that was kept are left out first, then those that Ramer, Douglas and Peucker's
    method leaves out, as the library does that the original uses (psimpl).

    Args:
        xy: Points of the line (m).
        tolerance: m.
    """
    kept = [xy[0]]
    for point in xy[1:-1]:
        if np.hypot(*(point - kept[-1])) >= tolerance:
            kept.append(point)
    points = np.array([*kept, xy[-1]])
    corners, parts = {0, len(points) - 1}, [(0, len(points) - 1)]
    while parts:
        first, last = parts.pop()
        if last - first < 2:
            continue
        distance, *_ = nearest_segment(points[first + 1 : last], points[[first, last]])
        far = int(distance.argmax())
        if distance[far] > tolerance:
            corner = first + 1 + far
            corners.add(corner)
            parts += [(first, corner), (corner, last)]
    return points[sorted(corners)]


def nearest_segment(
    xy: Float[np.ndarray, "n 2"], corners: Float[np.ndarray, "m 2"]
) -> tuple[Float[np.ndarray, " n"], Int[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """The segment of a line that is nearest to each position.

    Args:
        xy: Positions (m).
        corners: Of the line (m).

    Returns:
        Distance from it (m); its number, of segments that are as near, as at their common corner, the first one's; and its direction
        (degrees, from x towards y).
    """
    start, along = corners[:-1], np.diff(corners, axis=0)
    squared = np.maximum((along**2).sum(axis=1), 1e-30)
    share = (((xy[:, None] - start) * along).sum(axis=2) / squared).clip(0, 1)
    distances = np.linalg.norm(xy[:, None] - start - share[..., None] * along, axis=2)
    number = (distances <= distances.min(axis=1, keepdims=True) + 1e-9).argmax(axis=1)
    directions = np.degrees(np.arctan2(along[:, 1], along[:, 0]))
    return distances[np.arange(len(xy)), number], number, directions[number]
