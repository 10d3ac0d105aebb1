"""Where the headings that a model recovers are tested, and the route views that they are compared with."""

import numpy as np
from jaxtyping import Float

from tussock.world.errors import SettingError
from tussock.world.geometry import Route
from tussock.world.scene import World

from .evaluation import facing_east, grid_positions
from .experiment import Experiment

GRID = 0.2  # m; of the thesis (4.1)


def poses_to_test(
    experiment: Experiment, world: World, route: Route, *, grid: float | None = None, within: float = 0.2
) -> Float[np.ndarray, "n 3"]:
    """Poses near the route to test headings at.

    In a world these are grid positions, where views face east. Of image databases they are the poses of the grid's views; without a
    grid, those of the route's views that are not learned.

    Args:
        experiment: The surroundings, and which route views are learned.
        world: The world.
        route: The route.
        grid: In a world, positions are the multiples of this in x and y (m); None is GRID.
        within: Greatest distance from the route (m).

    Raises:
        SettingError: Where there are none, and for the grid of a world that is asked of a database.
    """
    if experiment.route_database is None:
        spacing = GRID if grid is None else grid
        return facing_east(grid_positions(route, grid=spacing, within=within, field=world.field))
    if grid is not None:
        raise SettingError(
            "--grid-m is of worlds; the views of an image database are where they are: give --within-m alone"
        )
    if experiment.grid_database is None:
        every = experiment.training.every
        if every == 1:
            raise SettingError(
                "all views of the route are learned and none is left to test; give --grid-database, or --every 2 (or more)"
            )
        return route.poses[np.arange(len(route.poses)) % every > 0]
    poses = experiment.open_views_beside()
    near = poses[route.nearest(poses[:, :2])[0] <= within]
    if len(near) == 0:
        raise SettingError(
            f"no view of {experiment.grid_database} lies within {within:g} m of the route; give a greater --within-m"
        )
    return near


def route_views_of(experiment: Experiment, route: Route) -> Route:
    """The poses of the route views: every `spacing` metres in a world; those of an image database."""
    return route if experiment.route_database is not None else route.resampled(experiment.training.spacing)
