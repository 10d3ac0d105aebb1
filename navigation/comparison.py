"""Models side by side: the same route, the same eye, the same encoding."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tussock.render.renderer import Renderer
from tussock.world.geometry import Route

from .encoding import Encoding
from .evaluation import errors_on, views_east
from .models.base import Model
from .training import training_poses, training_views
from .walk import ARRIVED, Agent


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What one model does.

    Errors of the headings it recovers beside the route over the full circle (degrees), having learned the views on it; whether
    it then walks the route home, having learned those of a learning walk. memory_bytes and fit_seconds are of the first
    training, scan_ms of one view at all rotations, in batches.
    """

    median_error_deg: float
    mean_error_deg: float
    share_over_45: float
    arrived: bool
    memory_bytes: int
    fit_seconds: float
    scan_ms: float


def compare_models(
    models: Iterable[Callable[[], Model]], *, encoding: Encoding, renderer: Renderer, route: Route, route_views: Route,
    positions: Float[np.ndarray, "n 2"], every: int = 1, learning_walk: float = 0.2, offset: float = 0.1, seed: int = 0,
) -> Iterator[Comparison]:  # fmt: skip
    """Train and test models, one after the other. Each is made twice, by calling it: for the headings, and for the walk.

    positions: where headings are recovered. every: learn one route view in so many. learning_walk: its reach (m). offset: how far to
    the left of the route the walk starts (m).
    """
    field = renderer.world.field
    on_route, _ = training_views(encoding, renderer, training_poses(route_views, every=every))
    poses = training_poses(route_views, every=every, learning_walk=learning_walk, field=field)
    beside, _ = training_views(encoding, renderer, poses)
    seen = list(views_east(encoding, renderer, positions))
    east = np.column_stack([positions, np.zeros(len(positions))])
    for make in models:
        model = make()
        began = time.perf_counter()
        model.fit(on_route)
        fitted = time.perf_counter()
        found = errors_on(model, seen, route_views, east)
        scanned = time.perf_counter()
        walker = make().fit(beside)
        agent = Agent(renderer=renderer, encoding=encoding, model=walker, route=route, seed=seed)
        *_, last = agent.walk(agent.start(offset))
        yield Comparison(
            median_error_deg=found.median_error_deg, mean_error_deg=found.mean_error_deg, share_over_45=found.share_over_45,
            arrived=last.reason == ARRIVED, memory_bytes=model.memory_bytes, fit_seconds=fitted - began,
            scan_ms=1000 * (scanned - fitted) / len(positions),
        )  # fmt: skip
