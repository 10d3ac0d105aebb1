"""What the studies look at: panoramas along a route and at grid places beside it, from a world or from image databases."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from tussock.render.eye import Eye
from tussock.render.images.check import heading_convention_error
from tussock.render.images.database import read_database
from tussock.render.images.entries import stored_poses
from tussock.render.images.writing import Grid, published_grid_area
from tussock.render.renderer import open_renderer
from tussock.world.errors import InputError
from tussock.world.geometry import Route
from tussock.world.scene import World

from ...evaluation import nearest_view
from ...training_setup import ROUTE_SPACING

BESIDE = 0.5  # m; grid places farther from the route are not looked at
NEAR = 0.2  # m; headings are recovered at the grid places this near to the route (section 4.3.1 of the thesis)
LEAST_VIEWS, LEAST_PLACES = 48, 8  # fewer say nothing
GRID = 0.2  # m, between grid places (4.1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """Panoramas to study.

    route: poses of the route views, which face along it. route_views: (n, height, width, 3 or 4).
    places: (m, 3) poses of grid views within BESIDE of the route. place_views: alike.
    grid: (k, 2) all places of the grid (m). world: what they were taken in, where it is at hand.
    """

    route: Route
    route_views: UInt8[np.ndarray, "n height width channels"]
    places: Float[np.ndarray, "m 3"]
    place_views: UInt8[np.ndarray, "m height width channels"]
    grid: Float[np.ndarray, "k 2"]
    world: World | None

    @cached_property
    def nearest(self) -> np.ndarray:
        """Index of the route view nearest to each place: the thesis's place recognition (4.3.2)."""
        return nearest_view(self.route, self.places[:, :2])

    @cached_property
    def wanted(self) -> Float[np.ndarray, " m"]:
        """The set heading of each place: the nearest route view's (rad)."""
        return self.route.poses[self.nearest, 2]

    @cached_property
    def near(self) -> np.ndarray:
        """Indices of the places within NEAR of the route."""
        return np.flatnonzero(self.route.nearest(self.places[:, :2])[0] <= NEAR)

    @cached_property
    def general_direction(self) -> float:
        """Heading (rad) from the route's start to its goal."""
        x, y = self.route.xy[-1] - self.route.xy[0]
        return float(np.arctan2(y, x))

    @cached_property
    def digest(self) -> str:
        """Of all that the studies see."""
        whole = hashlib.sha256()
        for array in (self.route.poses, self.route_views, self.places, self.place_views, self.grid):
            whole.update(repr((array.shape, str(array.dtype))).encode())
            whole.update(np.ascontiguousarray(array).data)
        return whole.hexdigest()


def material_of_world(
    world: World, route: Route, eye: Eye | None = None, *, backend: str = "auto", spacing: float = ROUTE_SPACING
) -> Material:  # fmt: skip
    """Draw the views along a route and at the grid beside it, at the poses that a database of them would hold."""
    views = Route(stored_poses(route.resampled(spacing).poses))
    part = published_grid_area(world.field)
    every = stored_poses(Grid.over(part if part.contains(*route.xy.T).all() else world.field, GRID).poses())
    places = every[views.nearest(every[:, :2])[0] <= BESIDE]
    check_enough(views, places)
    with open_renderer(world, eye, backend) as renderer:
        return Material(
            route=views, route_views=renderer.render(views.poses), places=places, place_views=renderer.render(places),
            grid=every[:, :2], world=world,
        )  # fmt: skip


def material_of_databases(grid: Path, route: Path) -> Material:
    """Read the views along a route and at the grid beside it from two image databases. Raises InputError for unusable ones."""
    grid_database, route_database = read_database(grid), read_database(route)
    for database, kind in ((grid_database, "grid"), (route_database, "route")):
        if database.kind != kind:
            raise InputError(f"{database.folder} is a database of a {database.kind}; give one of a {kind}")
        if database.metadata.get("needsUnwrapping"):
            raise InputError(f"{database.folder} holds images that need unwrapping; a study takes panoramas")
        bad = np.flatnonzero(~np.isfinite(database.poses).all(axis=1))
        if len(bad):
            raise InputError(f"{database.folder}, row {bad[0] + 1} of its entries: a place or heading is missing")
    views = Route(route_database.poses)
    if len(views.poses) < len(route_database.poses):
        raise InputError(f"{route}: two views in a row stand at one place; a study needs them apart")
    if meant := heading_convention_error(views.poses):
        raise InputError(f"{route}: {meant}; a study measures against them")
    rows = np.flatnonzero(views.nearest(grid_database.poses[:, :2])[0] <= BESIDE)
    places = grid_database.poses[rows]
    check_enough(views, places)
    route_views, place_views = route_database.views(), grid_database.views(rows.tolist())
    channels = min(route_views.shape[3], place_views.shape[3])  # alpha counts where both have it
    route_views, place_views = route_views[..., :channels], place_views[..., :channels]
    if route_views.shape[1:] != place_views.shape[1:]:
        sizes = " and ".join(f"{views.shape[2]} x {views.shape[1]}" for views in (route_views, place_views))
        raise InputError(f"{route} and {grid} hold views of different sizes ({sizes}); a study needs them alike")
    return Material(
        route=views, route_views=route_views, places=places, place_views=place_views, grid=grid_database.poses[:, :2], world=None,
    )  # fmt: skip


def check_enough(route: Route, places: Float[np.ndarray, "m 3"]) -> None:
    """Refuse a route or a grid beside it that says too little. Raises InputError."""
    if len(route.poses) < LEAST_VIEWS:
        raise InputError(
            f"{len(route.poses)} route views; a study needs at least {LEAST_VIEWS}: give a longer route or a smaller spacing"
        )
    near = int((route.nearest(places[:, :2])[0] <= NEAR).sum()) if len(places) else 0
    if near < LEAST_PLACES:
        raise InputError(
            f"{near} grid places lie within {NEAR:g} m of the route; a study needs at least {LEAST_PLACES}"
        )
