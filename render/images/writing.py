"""Drawing image databases: the views of a route or a grid, into a folder that can be completed after any interruption."""

import hashlib
import os
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from tussock.world.atomic import replacing
from tussock.world.errors import InputError
from tussock.world.geometry import MAX_COORDINATE, Bounds

from ..renderer import Poses, Renderer
from .database import HEADING, Database, X, Y, Z, read_database
from .files import (
    ENTRIES,
    METADATA,
    Columns,
    as_kept,
    billionths,
    decimal,
    make_folder,
    read_entries,
    read_metadata,
    write_entries,
    write_metadata,
)

BATCH = 64  # views rendered while those before are encoded
MOST_VIEWS = 10**6  # of a grid
FINEST = 0.001  # m between the views of a grid: names hold whole millimetres


def published_part(field: Bounds) -> Bounds:
    """The part of a field that the published grid covers: from 0 to 10 m in both axes."""
    return Bounds(max(0.0, field.x_min), max(0.0, field.y_min), min(10.0, field.x_max), min(10.0, field.y_max))


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Places to look from, all facing east.

    begin: x, y of the first (m). spacing: from each to the next (m). size: how many along x and along y.
    """

    begin: tuple[float, float]
    spacing: float
    size: tuple[int, int]

    @classmethod
    def over(cls, bounds: Bounds, spacing: float) -> "Grid":
        """The multiples of `spacing` (m) inside bounds, borders included. Raises InputError where there are none, or over a million."""
        if not (FINEST <= spacing <= MAX_COORDINATE and (np.abs(bounds) <= MAX_COORDINATE).all()):
            raise InputError(
                f"a grid of {spacing:g} m over {bounds}; give a spacing from {FINEST:g} up, and finite metres"
            )
        # A billionth of a spacing beyond the borders: 0.6 / 0.2 is not quite 3.
        low = np.ceil(np.array(bounds[:2]) / spacing - 1e-9).astype(int)
        across, up = (np.floor(np.array(bounds[2:]) / spacing + 1e-9).astype(int) - low + 1).tolist()
        if min(across, up) < 1 or across * up > MOST_VIEWS:
            raise InputError(
                f"a grid of {spacing:g} m over {bounds} has {max(0, across)} x {max(0, up)} places; give another spacing or part"
            )
        x, y = (low * spacing).tolist()
        return cls(begin=(x, y), spacing=spacing, size=(across, up))

    def poses(self) -> Float[np.ndarray, "n 3"]:
        """The poses, x running fastest."""
        x, y = np.meshgrid(
            *(start + self.spacing * np.arange(n) for start, n in zip(self.begin, self.size, strict=True))
        )
        return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def write_database(
    out: str | os.PathLike, renderer: Renderer, poses: Poses | Grid,
    progress: Callable[[int, int], object] = lambda done, total: None,
) -> tuple[Database, int]:  # fmt: skip
    """Draw the views of a route's poses, or of a grid, into a folder; give the database and how many views were drawn.

    Views are RGBA and drawn at `as_kept` of the poses. A folder that an interrupted call left is completed: it is whole at any
    moment, and in the end the same, but for its time, as if drawn at once. progress(done, total) is called now and then.
    Raises InputError, and touches nothing, where the folder holds anything else.
    """
    out, grid = Path(out), poses if isinstance(poses, Grid) else None
    kept = as_kept(poses.poses() if isinstance(poses, Grid) else poses)
    columns = _columns(kept, renderer.eye.z, grid)
    _enter(out, _metadata(renderer, kept, grid))
    missing = _missing(out, columns)
    for path in _leftovers(out):
        path.unlink(missing_ok=True)
    if missing:
        _draw(out, renderer, kept, columns, missing, progress)
    return read_database(out), len(missing)


def _columns(poses: Float[np.ndarray, "n 3"], z: float, grid: Grid | None) -> Columns:
    """The entries of a database with all its rows."""
    n, height, whole = len(poses), round(z * 1e9), billionths(poses)
    if n == 0:
        raise InputError("a database of no views; give at least one pose")
    if grid is None:
        names = [f"image_{row:05d}.png" for row in range(n)]
    else:
        mm = np.rint(np.column_stack([whole[:, :2], np.full(n, height)]) / 1e6).astype(int)
        names = ["image_" + "_".join(f"{number:+07d}" for number in place) + ".png" for place in mm]
    if len(set(names)) < n:
        raise InputError("two views of this grid have one name, which holds whole millimetres; give a wider spacing")
    columns: Columns = {
        X: tuple(decimal(number, 6) for number in whole[:, 0]), Y: tuple(decimal(number, 6) for number in whole[:, 1]),
        Z: (decimal(height, 6),) * n, HEADING: tuple(decimal(number, 9) for number in whole[:, 2]),
        "Pitch [degrees]": ("0",) * n, "Roll [degrees]": ("0",) * n, "Filename": tuple(names),
    }  # fmt: skip
    if grid is not None:
        up, across = np.divmod(np.arange(n), grid.size[0])
        columns |= {"Grid X": tuple(map(str, across)), "Grid Y": tuple(map(str, up)), "Grid Z": ("0",) * n}
    return columns


def _metadata(renderer: Renderer, poses: Float[np.ndarray, "n 3"], grid: Grid | None) -> dict[str, Any]:
    """Metadata; under `tussock` what makes the views those that they are, all but the backend."""
    eye, world = renderer.eye, renderer.world
    triangles, rgb = world.surfaces()
    seen = triangles.tobytes() + rgb.tobytes() + bytes([*world.sky_rgb, world.double_sided])
    tussock = {
        "version": 1, "world": hashlib.sha256(seen).hexdigest(), "poses": hashlib.sha256(poses.tobytes()).hexdigest(),
        "views": len(poses),
        "eye": {
            "width": eye.width, "height": eye.height, "top": float(eye.top), "bottom": float(eye.bottom),
            "z": float(eye.z), "samples": eye.rays,
        },
    }  # fmt: skip
    metadata: dict[str, Any] = {
        "time": time.strftime("%Y-%m-%d %H:%M:%S"), "type": "route" if grid is None else "grid",
    }  # fmt: skip
    if grid is not None:
        begin, apart = [round(1e3 * m, 6) for m in (*grid.begin, eye.z)], round(1e3 * grid.spacing, 6)
        metadata["grid"] = {"beginAtMM": begin, "separationMM": [apart, apart, 0.0], "size": [*grid.size, 1]}
    camera = {"name": "tussock", "resolution": [eye.width, eye.height], "isPanoramic": 0}
    return metadata | {"camera": camera, "needsUnwrapping": 0, "isGreyscale": 0, "tussock": tussock}


def _enter(out: Path, metadata: dict[str, Any]) -> None:
    """Start a database in a new or empty folder, or go on in one. Raises InputError where another one, or anything else, is there."""
    if (out / METADATA).is_file():
        theirs = read_metadata(out / METADATA)
        for what, given in {"type": metadata["type"], **metadata["tussock"]}.items():
            found = theirs if what == "type" else theirs.get("tussock")
            if not isinstance(found, dict) or found.get(what) != given:
                raise InputError(f"{out} holds an image database that differs in its {what}; give another folder")
    elif out.exists() and (not out.is_dir() or set(out.iterdir()) - set(_leftovers(out))):
        raise InputError(f"{out} is there already and is no image database; give a new folder")
    else:
        make_folder(out)
        write_metadata(out / METADATA, metadata)


def _leftovers(out: Path) -> list[Path]:
    """The temporary files of a writer that was killed."""
    return [*out.glob(".image_*.partial.png"), *out.glob(".database_*.partial.*")]


def _missing(out: Path, columns: Columns) -> list[int]:
    """Rows that are not in the folder's entries, or whose image is not there."""
    there = set()
    if (out / ENTRIES).is_file():
        found, _ = read_entries(out / ENTRIES)
        if list(found) != list(columns):
            raise InputError(f"{out / ENTRIES} was changed since it was written; give another folder")
        there = set(zip(*found.values(), strict=True))
    rows = zip(*columns.values(), strict=True)
    images = {path.name for path in out.glob("image_*.png")}
    return [i for i, row in enumerate(rows) if row not in there or columns["Filename"][i] not in images]


def _draw(
    out: Path,
    renderer: Renderer,
    poses: Float[np.ndarray, "n 3"],
    columns: Columns,
    missing: list[int],
    progress: Callable,
) -> None:
    """Draw the missing rows' images, and list each batch when all of it is there."""
    done = np.ones(len(poses), dtype=bool)
    done[missing] = False

    def finish(rows: list[int], saving: list[Future]) -> None:
        for each in saving:
            each.result()
        done[rows] = True
        kept = {
            name: tuple(cell for cell, keep in zip(cells, done, strict=True) if keep) for name, cells in columns.items()
        }
        write_entries(out / ENTRIES, kept)
        progress(int(done.sum()), len(done))

    with ThreadPoolExecutor() as pool:
        before: tuple[list[int], list[Future]] = ([], [])
        for start in range(0, len(missing), BATCH):
            rows = missing[start : start + BATCH]
            views = renderer.render(poses[rows])
            finish(*before)
            names = [columns["Filename"][row] for row in rows]
            before = rows, [pool.submit(_save, out / name, view) for name, view in zip(names, views, strict=True)]
        finish(*before)


def _save(path: Path, view: UInt8[np.ndarray, "height width 4"]) -> None:
    data = cv2.imencode(".png", cv2.cvtColor(view, cv2.COLOR_RGBA2BGRA), [cv2.IMWRITE_PNG_COMPRESSION, 1])[1]
    with replacing(path) as partial:
        partial.write_bytes(data.tobytes())
