"""What the studies look at: views along a route and on the grid around it, from a world or from image databases."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from tussock.render.eye import Eye
from tussock.render.images.check import heading_convention_error
from tussock.render.images.database import Database, read_database
from tussock.render.images.entries import stored_poses
from tussock.render.images.writing import Grid, published_grid_area
from tussock.render.renderer import open_renderer
from tussock.world.errors import FileError, SettingError
from tussock.world.geometry import Route
from tussock.world.scene import World

from ...evaluation import nearest_view
from ...models.base import Images
from .parameters import ENCODING

MAX_DISTANCE = 0.5  # m; grid positions farther from the route are not used
NEAR = 0.2  # m; headings are recovered at grid positions within this distance of the route (4.3.1)
MIN_ROUTE_VIEWS, MIN_POSITIONS = 48, 8  # with fewer, the numbers have no meaning
GRID_SPACING = 0.2  # m (4.1)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyData:
    """Views to study.

    Attributes:
        route: The poses of the route views, which face along the route.
        route_views: Panoramas at these poses, (n, height, width, 3 or 4).
        poses: Poses of the grid views within MAX_DISTANCE of the route, (m, 3): m, m, rad.
        grid_views: Panoramas at these poses, (m, height, width, 3 or 4).
        grid: All positions of the grid, (k, 2), m.
        world: The world of the views; None for views from databases.
    """

    route: Route
    route_views: UInt8[np.ndarray, "n height width channels"]
    poses: Float[np.ndarray, "m 3"]
    grid_views: UInt8[np.ndarray, "m height width channels"]
    grid: Float[np.ndarray, "k 2"]
    world: World | None

    @cached_property
    def nearest(self) -> np.ndarray:
        """Index of the nearest route view, for each grid pose: the thesis's place recognition (4.3.2)."""
        return nearest_view(self.route, self.poses[:, :2])

    @cached_property
    def route_images(self) -> Images:
        """The route views as the thesis encodes them."""
        return ENCODING(self.route_views)

    @cached_property
    def grid_images(self) -> Images:
        """The grid views as the thesis encodes them."""
        return ENCODING(self.grid_views)

    @cached_property
    def set_headings(self) -> Float[np.ndarray, " m"]:
        """The heading of the nearest route view (rad), for each grid pose."""
        return self.route.poses[self.nearest, 2]

    @cached_property
    def near(self) -> np.ndarray:
        """Indices of the grid poses within NEAR of the route."""
        return np.flatnonzero(self.route.nearest(self.poses[:, :2])[0] <= NEAR)

    @cached_property
    def general_direction(self) -> float:
        """Direction from the route's start to its goal (rad)."""
        x, y = self.route.xy[-1] - self.route.xy[0]
        return float(np.arctan2(y, x))

    @cached_property
    def digest(self) -> str:
        """Digest of everything that the studies look at."""
        digest = hashlib.sha256()
        for array in (self.route.poses, self.route_views, self.poses, self.grid_views, self.grid):
            digest.update(repr((array.shape, str(array.dtype))).encode())
            digest.update(np.ascontiguousarray(array).data)
        return digest.hexdigest()


def data_of_world(
    world: World, route: Route, eye: Eye | None = None, *, spacing: float, backend: str = "auto"
) -> StudyData:
    """Render the views along a route and on the grid around it, at the poses that a database of them would hold.

    Args:
        world: The world.
        route: A route through it.
        eye: The eye; None for the default one.
        spacing: Distance between route views (m).
        backend: Name of the renderer.

    Returns:
        The views.

    Raises:
        SettingError: There are too few of them.
    """
    views = Route(stored_poses(route.resampled(spacing).poses))
    part = published_grid_area(world.field)
    grid = stored_poses(Grid.over(part if part.contains(*route.xy.T).all() else world.field, GRID_SPACING).poses())
    poses = grid[views.nearest(grid[:, :2])[0] <= MAX_DISTANCE]
    _check_enough(views, poses)
    with open_renderer(world, eye, backend) as renderer:
        return StudyData(
            route=views,
            route_views=renderer.render(views.poses),
            poses=poses,
            grid_views=renderer.render(poses),
            grid=grid[:, :2],
            world=world,
        )


def data_of_databases(grid_folder: Path, route_folder: Path, headings: str = "auto") -> StudyData:
    """Read the views along a route and on the grid around it.

    Args:
        grid_folder: Image database of a grid.
        route_folder: Image database of a route.
        headings: How the headings of both are meant, one of `tussock.world.headings.HEADINGS`; "path" is for the route alone. "auto"
            checks that those of the route do not follow another convention than bearings.

    Returns:
        The views.

    Raises:
        FileError: The databases do not fit a study.
        SettingError: They hold too few views.
    """
    grid = _read(grid_folder, "grid", "auto" if headings == "path" else headings)
    route = _read(route_folder, "route", headings)
    views = Route(route.poses)
    if len(views.poses) < len(route.poses):
        raise FileError(f"{route_folder}: two successive views have the same position; a study needs them apart")
    if headings == "auto" and (problem := heading_convention_error(views.poses)):
        raise FileError(f"{route_folder}: {problem}; a study measures against them: give --headings")
    rows = np.flatnonzero(views.nearest(grid.poses[:, :2])[0] <= MAX_DISTANCE)
    _check_enough(views, grid.poses[rows])
    route_views, grid_views = route.views(), grid.views(rows.tolist())
    channels = min(route_views.shape[3], grid_views.shape[3])  # alpha is used where both have it
    route_views, grid_views = route_views[..., :channels], grid_views[..., :channels]
    if route_views.shape[1:] != grid_views.shape[1:]:
        sizes = " and ".join(f"{views.shape[2]} x {views.shape[1]}" for views in (route_views, grid_views))
        raise FileError(
            f"{route_folder} and {grid_folder} hold views of different sizes ({sizes}); give two of one size"
        )
    return StudyData(
        route=views,
        route_views=route_views,
        poses=grid.poses[rows],
        grid_views=grid_views,
        grid=grid.poses[:, :2],
        world=None,
    )


def _read(folder: Path, kind: str, headings: str) -> Database:
    """The image database in a folder, which must be of a kind and hold panoramas at complete poses."""
    database = read_database(folder, headings)
    if database.kind != kind:
        raise FileError(f"{database.folder} is a database of a {database.kind}; give one of a {kind}")
    bad = np.flatnonzero(~np.isfinite(database.poses).all(axis=1))
    if len(bad):
        raise FileError(f"{database.folder}, row {bad[0] + 1} of its entries: the position or heading is missing")
    return database


def _check_enough(route: Route, poses: Float[np.ndarray, "m 3"]) -> None:
    """Refuse too few views."""
    if len(route.poses) < MIN_ROUTE_VIEWS:
        raise SettingError(
            f"{len(route.poses)} route views; a study needs at least {MIN_ROUTE_VIEWS}: give a longer route or a smaller spacing"
        )
    near = int((route.nearest(poses[:, :2])[0] <= NEAR).sum()) if len(poses) else 0
    if near < MIN_POSITIONS:
        raise SettingError(
            f"{near} grid positions lie within {NEAR:g} m of the route; a study needs at least {MIN_POSITIONS}"
        )
