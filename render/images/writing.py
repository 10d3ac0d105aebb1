"""Drawing image databases: the views of a route or a grid, into a folder that can be completed after any interruption."""

import hashlib
import os
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from tussock.world.errors import SettingError
from tussock.world.flight import Flight
from tussock.world.geometry import Bounds
from tussock.world.progress import Progress, printed
from tussock.world.settings import MAX_COORDINATE, number, numbers, settings, wholes

from ..eye import Eye
from ..poses import Poses
from ..renderer import Renderer
from .completing import complete, metadata_of, missing_rows, start_or_resume
from .database import Database, read_database
from .entries import FILENAME, HEADING, Columns, X, Y, Z, format_decimal, stored_poses, to_file_units

MAX_VIEWS = 10**6  # of a grid
MASK_PIECE = 2000  # bytes
MIN_SPACING = 0.001  # m, because the names of images have whole millimetres


def published_grid_area(field: Bounds) -> Bounds:
    """The part of a field that the published grid covers: 0 to 10 m along both axes."""
    return Bounds(max(0.0, field.x_min), max(0.0, field.y_min), min(10.0, field.x_max), min(10.0, field.y_max))


@settings
class Grid:
    """Positions in rows and columns, with views that all face east.

    Attributes:
        begin: x and y of the first position (m).
        spacing: Distance between neighbours (m).
        size: Number of positions along x and along y.
    """

    begin: tuple[float, float] = numbers((0.0, 0.0), low=-MAX_COORDINATE, high=MAX_COORDINATE, unit="m")
    spacing: float = number(0.2, low=MIN_SPACING, high=MAX_COORDINATE, unit="m")
    size: tuple[int, int] = wholes((51, 51))

    def __attrs_post_init__(self):
        if len(self.begin) != 2 or len(self.size) != 2 or np.prod(self.size, dtype=float) > MAX_VIEWS:
            raise SettingError(
                f"Grid: begin {self.begin}, size {self.size}; give x and y, and up to {MAX_VIEWS:,} views"
            )

    @classmethod
    def over(cls, bounds: Bounds, spacing: float) -> "Grid":
        """The multiples of `spacing` (m) inside bounds, borders included. Raises SettingError if there are none or too many."""
        if not (MIN_SPACING <= spacing <= MAX_COORDINATE and (np.abs(bounds) <= MAX_COORDINATE).all()):
            raise SettingError(
                f"a grid of {spacing:g} m over {bounds}; give a spacing of at least {MIN_SPACING:g} m, and finite bounds"
            )
        # A billionth of the spacing is allowed beyond the borders: 0.6 / 0.2 is slightly less than 3.
        low = np.ceil(np.array(bounds[:2]) / spacing - 1e-9).astype(int)
        across, up = (np.floor(np.array(bounds[2:]) / spacing + 1e-9).astype(int) - low + 1).tolist()
        if min(across, up) < 1 or across * up > MAX_VIEWS:
            raise SettingError(
                f"a grid of {spacing:g} m over {bounds} has {max(0, across)} x {max(0, up)} positions; "
                f"give another spacing or other bounds, for 1 to {MAX_VIEWS:,} of them"
            )
        x, y = (low * spacing).tolist()
        return cls(begin=(x, y), spacing=spacing, size=(across, up))

    def poses(self) -> Float[np.ndarray, "n 3"]:
        """The poses, row by row along x."""
        x, y = (begin + self.spacing * np.arange(n) for begin, n in zip(self.begin, self.size, strict=True))
        x, y = np.meshgrid(x, y)
        return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def write_database(
    folder: str | os.PathLike,
    renderer: Renderer,
    poses: Poses | Grid,
    progress: Progress | None = None,
) -> tuple[Database, int]:
    """Draw the views at the poses of a route, or of a grid, into a folder.

    A folder that an interrupted call left is completed. At any moment it is a valid database, and in the end it is the same as if it
    was drawn at once, except for its time.

    Args:
        folder: A new or empty folder, or one to complete.
        renderer: Draws the views, at `stored_poses` of the poses. They are saved as RGBA.
        poses: (n, 3) x (m), y (m) and heading (rad), or a grid.
        progress: Called now and then with the number of views that are done, and of all; None prints a line where it takes long,
            `no_progress` none.

    Returns:
        The database, and how many views were drawn by this call.

    Raises:
        InputError: The folder holds anything else. Then nothing is changed.
    """
    if isinstance(renderer.world.terrain, Flight):
        raise SettingError(
            "the images of a database are of one height above the ground; for a level in the air give the eye that height"
        )
    if renderer.eye.compound is not None:
        raise SettingError("the images of a database are panoramas, which any eye looks at later; give no compound eye")
    progress = printed(progress, "drawing", "views")
    folder, grid = Path(folder), poses if isinstance(poses, Grid) else None
    stored = stored_poses(poses.poses() if isinstance(poses, Grid) else poses)
    columns = _columns(stored, renderer.eye.z, grid)
    start_or_resume(folder, _metadata(renderer, stored, grid))
    missing = missing_rows(folder, columns)
    complete(folder, columns, missing, lambda rows: renderer.render(stored[rows]), progress)
    return read_database(folder), len(missing)


def _columns(poses: Float[np.ndarray, "n 3"], z: float, grid: Grid | None) -> Columns:
    """The entries of a complete database."""
    n, height, values = len(poses), round(z * 1e9), to_file_units(poses)
    if n == 0:
        raise SettingError("a database of 0 views; give at least one pose")
    if grid is None:
        names = [f"image_{row:05d}.png" for row in range(n)]
    else:
        mm = np.rint(np.column_stack([values[:, :2], np.full(n, height)]) / 1e6).astype(int)
        names = ["image_" + "_".join(f"{number:+07d}" for number in position) + ".png" for position in mm]
    if len(set(names)) < n:
        raise SettingError(
            "two views of this grid have one name, because names have whole millimetres; give a wider spacing"
        )
    columns: Columns = {
        X: tuple(format_decimal(value, 6) for value in values[:, 0]),
        Y: tuple(format_decimal(value, 6) for value in values[:, 1]),
        Z: (format_decimal(height, 6),) * n,
        HEADING: tuple(format_decimal(value, 9) for value in values[:, 2]),
        "Pitch [degrees]": ("0",) * n,
        "Roll [degrees]": ("0",) * n,
        FILENAME: tuple(names),
    }
    if grid is not None:
        up, across = np.divmod(np.arange(n), grid.size[0])
        columns |= {"Grid X": tuple(map(str, across)), "Grid Y": tuple(map(str, up)), "Grid Z": ("0",) * n}
    return columns


def _metadata(renderer: Renderer, poses: Float[np.ndarray, "n 3"], grid: Grid | None) -> dict[str, Any]:
    """The metadata; under `tussock` is all that decides the views, except for the backend."""
    eye, world = renderer.eye, renderer.world
    triangles, rgb = world.surfaces()
    scene = triangles.tobytes() + rgb.tobytes() + bytes([*world.sky_rgb, world.double_sided])
    scene += world.texturing.to_bytes() if world.texturing else b""
    scene += repr(world.light).encode() if world.light else b""  # its sky is not in the colours
    tussock = {
        "world": hashlib.sha256(scene).hexdigest(),
        "poses": hashlib.sha256(poses.tobytes()).hexdigest(),
        "views": len(poses),
        "eye": _plain(eye),
    }
    if grid is None:
        return metadata_of("route", "tussock", eye, tussock)
    begin, spacing = [round(1e3 * m, 6) for m in (*grid.begin, eye.z)], round(1e3 * grid.spacing, 6)
    lattice = {"beginAtMM": begin, "separationMM": [spacing, spacing, 0.0], "size": [*grid.size, 1]}
    return metadata_of("grid", "tussock", eye, tussock, lattice)


def _plain(eye: Eye) -> dict[str, Any]:
    """The fields of an eye as the metadata holds them: OpenCV reads no text of over 4096 bytes, so that of a mask is cut to pieces."""
    fields = eye.plain() | {"samples": eye.rays}
    masks = {name: mask for name in ("mask", "known") if (mask := getattr(eye, name)) is not None}
    return fields | {
        name: [mask[start : start + MASK_PIECE] for start in range(0, len(mask), MASK_PIECE)]
        for name, mask in masks.items()
    }
