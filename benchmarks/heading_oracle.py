"""How much of the error of recovered headings no view can tell: python benchmarks/heading_oracle.py WORLD ROUTE [ROUTE ..]

Headings are recovered as `tussock evaluate` does it: at the multiples of --grid-m near the route, from the views of the route. Next to
the models stand two oracles that have seen everything: a view at every --dense-m around the route, turned as the nearest route view is.

    dense memory    perfect memory of all these views: what more experience would give
    known position  compares with the nearest of these views alone: what is left where even the position is known

No view is at a tested position itself.
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from tussock.navigation.evaluation import (
    HeadingErrors,
    encoded_views,
    errors_of_views,
    facing_east,
    grid_positions,
    nearest_view,
)
from tussock.navigation.experiment import Experiment
from tussock.navigation.models import PerfectMemory, make_model
from tussock.navigation.training import training_views
from tussock.world.geometry import Bounds, Route
from tussock.world.obstacles import clearance

ROOM = 0.02  # m; an agent has room to stand where no obstacle is nearer


def errors_on(route: Path, world: str, options: argparse.Namespace) -> Iterator[tuple[str, HeadingErrors, np.ndarray]]:
    """For each model and oracle its name, its errors, and the clearance of their positions (m)."""
    experiment = Experiment(world=world, route=route)
    opened, whole = experiment.open_world_and_route()
    views_of_route = whole.resampled(experiment.training.spacing)
    poses = facing_east(
        grid_positions(views_of_route, grid=options.grid_m, within=options.within_m, field=opened.field)
    )
    room = clearance(opened, poses[:, :2])
    with experiment.open_renderer(opened) as renderer:
        learned, _ = training_views(experiment.encoding, renderer, views_of_route.poses)
        seen = list(encoded_views(experiment.encoding, renderer, poses))
        for name in options.models.split(","):
            yield name, errors_of_views(make_model(name).fit(learned), seen, views_of_route, poses), room
        dense = dense_poses(views_of_route, options, opened.field)
        memories, kept = training_views(experiment.encoding, renderer, dense)
        errors = errors_of_views(PerfectMemory().fit(memories), seen, views_of_route, poses)
        yield "dense memory", errors, room
        yield "known position", known_position(memories, kept, torch.cat(seen), views_of_route, poses), room


def dense_poses(route: Route, options: argparse.Namespace, field: Bounds) -> np.ndarray:
    """Poses (n, 3) around the route, between the tested positions, each turned as the nearest route view."""
    shift = options.dense_m / 2
    fine = Route(route.poses - [shift, shift, 0])  # so that its grid, moved back, has no tested position
    xy = grid_positions(fine, grid=options.dense_m, within=options.within_m + options.dense_m, field=field) + shift
    xy = xy[field.contains(xy[:, 0], xy[:, 1])]
    return np.column_stack([xy, route.poses[nearest_view(route, xy), 2]])


def known_position(
    memories: torch.Tensor, at: np.ndarray, seen: torch.Tensor, route: Route, poses: np.ndarray
) -> HeadingErrors:
    """Errors where each view is compared with the memory from nearest to it alone."""
    nearest = np.hypot(*(poses[:, None, :2] - at[:, :2]).transpose(2, 0, 1)).argmin(axis=1)
    each = [
        errors_of_views(PerfectMemory().fit(memories[k][None]), [view[None]], route, pose[None])
        for k, view, pose in zip(nearest, seen, poses, strict=True)
    ]
    return HeadingErrors(**{name: np.concatenate([vars(one)[name] for one in each]) for name in vars(each[0])})


def table(errors: HeadingErrors) -> dict[str, dict[str, float]]:
    """Number of positions, and median and mean error (degrees), by distance from the route."""
    bands = errors.by_distance() | {"all": errors}
    return {
        name: {"n": len(band), "median_error_deg": band.median_error_deg, "mean_error_deg": band.mean_error_deg}
        for name, band in bands.items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world")
    parser.add_argument("routes", nargs="+", type=Path)
    parser.add_argument("--models", default="perfect-memory,mlp-rotation,autoencoder")
    parser.add_argument("--grid-m", type=float, default=0.2)
    parser.add_argument("--within-m", type=float, default=0.2)
    parser.add_argument("--dense-m", type=float, default=0.02)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    together: dict[str, list[tuple[HeadingErrors, np.ndarray]]] = {}
    for route in options.routes:
        for name, errors, room in errors_on(route, options.world, options):
            together.setdefault(name, []).append((errors, room))
    tables = {
        "all positions": {name: table(joined(parts, 0.0)) for name, parts in together.items()},
        f"with {100 * ROOM:g} cm of room": {name: table(joined(parts, ROOM)) for name, parts in together.items()},
    }
    if options.json:
        print(json.dumps(tables))
        return
    for title, rows in tables.items():
        print(f"{title}: median, mean (degrees), in parentheses the number of positions")
        print(
            pd.DataFrame(rows).T.map("{median_error_deg:.1f}, {mean_error_deg:.1f} ({n})".format_map).to_string(),
            end="\n\n",
        )


def joined(parts: list[tuple[HeadingErrors, np.ndarray]], least: float) -> HeadingErrors:
    """The errors of all routes at positions with at least this clearance (m)."""
    kept = [errors.among(room >= least) for errors, room in parts]
    return HeadingErrors(**{field: np.concatenate([vars(part)[field] for part in kept]) for field in vars(kept[0])})


if __name__ == "__main__":
    main()
