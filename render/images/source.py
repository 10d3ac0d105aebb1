"""Views out of image databases in place of a renderer: the image nearest to a pose, rolled to its heading.

`open_views(route, grid)` is a `tussock.render.renderer.Renderer`, so whatever looks at a world looks at a database as well.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int64, UInt8
from scipy.spatial import KDTree

from tussock.world.errors import FileError, InputError
from tussock.world.geometry import columns_of_turn, wrap_angle
from tussock.world.scene import World

from ..eye import Eye
from ..poses import Poses, as_poses
from .database import Database
from .folders import eye_of, first_view, open_database, reach_of, world_of
from .metadata import group_in

CACHE_BYTES = 256 * 2**20  # of images that are kept once used: an agent stays near an entry for several steps
SHARE_PASSED = 0.25  # of it for frames of a video that are passed on the way to one
SAME_PLACE = 1e-9  # m; entries nearer to each other than this have one position, and the heading decides
BACKEND = "database"


@dataclass(frozen=True, kw_only=True, eq=False)
class Entries:
    """Views of one or several databases, which are not read yet.

    Attributes:
        databases: The databases.
        poses: (n, 3) Of all their entries, in their order: x (m), y (m) and the heading that the image faces (rad).
        rows: (n,) Row of each entry in its database.
        owners: (n,) Index of its database.
    """

    databases: tuple[Database, ...]
    poses: Float[np.ndarray, "n 3"]
    rows: Int64[np.ndarray, " n"]
    owners: Int64[np.ndarray, " n"]

    @classmethod
    def of(cls, databases: Sequence[Database]) -> "Entries":
        """All entries of databases; of equally near ones, those of the first database are taken."""
        return cls(
            databases=tuple(databases),
            poses=np.concatenate([each.poses for each in databases]),
            rows=np.concatenate([np.arange(len(each)) for each in databases]),
            owners=np.concatenate([np.full(len(each), owner) for owner, each in enumerate(databases)]),
        )

    @cached_property
    def tree(self) -> KDTree:
        """The positions."""
        return KDTree(self.poses[:, :2])

    def nearest(self, poses: Float[np.ndarray, "m 3"]) -> tuple[Int64[np.ndarray, " m"], Float[np.ndarray, " m"]]:
        """The entry that is nearest to each pose, and how far away it is (m); at one position, that of the nearest heading."""
        distance, nearest = self.tree.query(poses[:, :2])
        found = np.array(nearest, dtype=np.int64)
        same = self.tree.query_ball_point(poses[:, :2], distance + SAME_PLACE, return_sorted=True)
        for k, candidates in enumerate(same):
            if len(candidates) > 1:
                off = np.abs(wrap_angle(self.poses[candidates, 2] - poses[k, 2]))
                found[k] = candidates[int(off.argmin())]
        return found, np.asarray(distance, dtype=np.float64)


class DatabaseViews:
    """The views of image databases at any pose, as a renderer gives them: each is the image of the nearest entry.

    An image shows what is seen facing the heading of its entry. At another heading it is rolled by the turn between the two, in whole
    columns: the nearest number of them (of two that are equally near, the even one). At the heading of its entry it is
    the image itself, unchanged.

    Attributes:
        world: A world without triangles. Its field is the extent of the databases.
        eye: The eye that saw the images.
        backend: "database".
        poses: (n, 3) Of the entries that `render` chooses from.
        reach: A pose that is farther than this from all entries is off the grid (m): half the diagonal of a cell of a grid, the
            spacing of a route.
        training: The views to learn from: those of the route, at its own poses, and those beside it.
    """

    backend = BACKEND

    def __init__(self, databases: Sequence[Database], eye: Eye, world: World, training: "DatabaseViews | None" = None):
        """Prepare to show the entries of databases.

        Args:
            databases: The databases; of equally near entries, those of the first one are taken.
            eye: The eye that saw them.
            world: See `world_of`.
            training: The views to learn from; None: these.

        Raises:
            FileError: Where the images have another size than the eye, or it has a mask where images may not show what turns into view.
        """
        for each in databases:
            _check_mask(each, eye)
        self.world, self.eye, self.training = world, eye, training or self
        self._entries = Entries.of(databases)
        self.poses = self._entries.poses
        self.reach = max(reach_of(each) for each in databases) * (1 + 1e-6)  # rounding
        channels = [_check_size(each, eye) for each in databases] + ([] if training is None else [training._channels])
        self._channels = min(channels)  # alpha is used where all images have it
        self._kept: OrderedDict[int, UInt8[np.ndarray, "height width channels"]] | None = OrderedDict()
        self._lock = Lock()  # of the images kept; threads may share a renderer

    def __getstate__(self) -> dict[str, Any]:
        """What goes to another process: everything but the images kept."""
        return vars(self) | {"_lock": None, "_kept": None if self._kept is None else OrderedDict()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _lock=Lock())

    def nearest(self, poses: Poses) -> tuple[Int64[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """The row in `self.poses` of the entry that is nearest to each pose, and how far away it is (m)."""
        return self._entries.nearest(as_poses(poses))

    def label(self, pose: Float[np.ndarray, "3"]) -> str:
        """The image that is seen at a pose, for messages."""
        (row,), _ = self._entries.nearest(as_poses(pose[None]))
        database = self._entries.databases[self._entries.owners[row]]
        return f"{database.folder / database.label(int(self._entries.rows[row]))}"

    def render(self, poses: Poses) -> UInt8[np.ndarray, "n height width channels"]:
        """The views at poses.

        Args:
            poses: (n, 3) x (m), y (m) and heading (rad).

        Returns:
            (n, height, width, 4) RGBA as a renderer gives it where all images have alpha, else (n, height, width, 3) RGB.

        Raises:
            InputError: A pose is not finite or too far, an image cannot be read, or the source is closed.
        """
        rows, columns = self._turned(poses)
        with self._lock:
            images = self._images(rows)
        views = np.empty((len(rows), self.eye.height, self.eye.width, self._channels), dtype=np.uint8)
        for view, row, roll in zip(views, rows.tolist(), columns.tolist(), strict=True):
            view[:] = np.roll(images[row], roll, axis=1)
        return views

    def known(self, poses: Poses) -> Bool[np.ndarray, "n height width"] | None:
        """Which pixels of the views at poses show the world: `eye.known`, turned as each image is; None where all do."""
        if self.eye.known is None:
            return None
        known = self.eye.known.visible()
        return np.stack([np.roll(known, roll, axis=1) for roll in self._turned(poses)[1].tolist()])

    def _turned(self, poses: Poses) -> tuple[Int64[np.ndarray, " n"], Int64[np.ndarray, " n"]]:
        """The entry that is seen at each pose, and the columns by which its image is rolled."""
        poses = as_poses(poses)
        rows, _ = self._entries.nearest(poses)
        turns = wrap_angle(poses[:, 2] - self.poses[rows, 2])
        return rows, np.rint(columns_of_turn(turns, self.eye.width)).astype(np.int64)

    def _images(self, rows: Int64[np.ndarray, " n"]) -> dict[int, UInt8[np.ndarray, "height width channels"]]:
        """The images of entries, as they are."""
        if self._kept is None:
            raise InputError("this source of views is closed; open it again")
        wanted = np.unique(rows)
        images = {row: self._kept[row] for row in wanted.tolist() if row in self._kept}
        missing = wanted[[row not in images for row in wanted.tolist()]]
        for owner, database in enumerate(self._entries.databases):
            part = missing[self._entries.owners[missing] == owner]
            if len(part) == 1:  # as in a walk; the frames of a video that are passed may be seen next
                row, first = int(self._entries.rows[part[0]]), int(np.searchsorted(self._entries.owners, owner))
                passed = database.passed(row, limit=int(SHARE_PASSED * CACHE_BYTES / self._view_bytes))
                part = np.array([first + each for each in passed if first + each not in self._kept])
            try:
                views = database.views(self._entries.rows[part].tolist())
            except FileError:  # a frame that is passed may be damaged
                part = np.intersect1d(part, missing)
                views = database.views(self._entries.rows[part].tolist())
            for row, image in zip(part.tolist(), views, strict=True):
                if image.shape[2] < self._channels:
                    raise FileError(
                        f"{database.folder}: some of its images have alpha and others none; give images of one kind"
                    )
                images[row] = image[..., : self._channels]
        for row, image in images.items():
            self._kept[row] = image
            self._kept.move_to_end(row)
        while len(self._kept) * self._view_bytes > CACHE_BYTES:
            self._kept.popitem(last=False)
        return images

    @property
    def _view_bytes(self) -> int:
        return self.eye.width * self.eye.height * self._channels

    def close(self) -> None:
        """Free the images and close videos; the source cannot be used afterwards."""
        self._kept = None
        for database in self._entries.databases:
            database.close()
        if self.training is not self:
            self.training.close()

    def __enter__(self) -> "DatabaseViews":
        return self

    def __exit__(self, kind, error, traceback) -> None:
        self.close()


def open_views(route: Path, grid: Path | None = None, eye: Eye | None = None, headings: str = "auto") -> DatabaseViews:
    """Open image databases as a source of views, for a `with` statement.

    Args:
        route: Image database of a route.
        grid: Image database of the views around it. Its views are those that agents and evaluations see; None: those of the route.
        eye: The eye that saw the images; None: see `eye_of`.
        headings: How the headings of the databases are meant; see `read_database`.

    Raises:
        InputError: Where a database cannot be used, or where the two do not fit each other or the eye.
    """
    eye = eye_of(route, grid) if eye is None else eye
    databases = [open_database(each, headings) for each in (route, grid) if each is not None]
    world = world_of(route, grid)
    if grid is None:
        return DatabaseViews(databases, eye, world)
    return DatabaseViews(databases[1:], eye, world, training=DatabaseViews(databases, eye, world))


def _check_mask(database: Database, eye: Eye) -> None:
    """Refuse a mask for images of others: if it says what they do not show, such as the body of a robot, that turns with the image.

    What tussock drew shows the full circle behind any mask. Rows that are hidden all around stay where they are. Raises FileError.
    """
    if eye.mask is None or "world" in group_in(database.metadata, "tussock"):
        return
    visible = eye.mask.visible()
    if (visible != visible[:, :1]).any():
        raise FileError(
            f"{database.folder}: its mask hides parts that are not the same all around, and what is behind them is not known; make a "
            "database of it with tussock database import --mask, which keeps what images do not show"
        )


def _check_size(database: Database, eye: Eye) -> int:
    """The number of channels of the images of a database. Raises FileError where they have another size than the eye."""
    height, width, channels = first_view(database).shape
    if (height, width) != (eye.height, eye.width):
        raise FileError(
            f"the images of {database.folder} are {width} x {height}, the eye has {eye.width} x {eye.height}; give those of one size"
        )
    return channels
