"""Models compared: the same route, the same eye, the same encoding."""

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tussock.render.renderer import Renderer
from tussock.world.geometry import Route
from tussock.world.specs import Spec

from .evaluation import encoded_views, errors_of_views, facing_east
from .experiment import Experiment
from .learning import learn_views
from .models.base import memory_bytes
from .stopping import StopReason
from .tested_poses import route_views_of
from .training import training_views
from .walker import check_inside


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """What one model achieves.

    Attributes:
        median_error_deg: Of the headings that it recovers near the route over the full circle, trained on the route's views alone.
        mean_error_deg: The same, mean.
        share_over_45: The same, share of errors over 45 degrees.
        arrived: Whether it then walks the route home, trained with the learning walk.
        memory_bytes: Size of what it learned in the first training; None where the model does not tell.
        fit_seconds: Of the first training.
        scan_ms: Time of one view at all rotations, in batches.
    """

    median_error_deg: float
    mean_error_deg: float
    share_over_45: float
    arrived: bool
    memory_bytes: int | None
    fit_seconds: float
    scan_ms: float


def compare_models(
    models: Iterable[Spec],
    experiment: Experiment,
    renderer: Renderer,
    route: Route,
    positions: Float[np.ndarray, "n k"],
) -> Iterator[Comparison]:
    """Train and test models, one after the other. Each is made twice: for the headings, and for the walk.

    Args:
        models: The models.
        experiment: How they are trained, and how they walk.
        renderer: Of the experiment's world, for its eye.
        route: Through it.
        positions: (n, 2) Where headings are recovered, facing east (m); or (n, 3) poses.
    """
    check_inside(experiment.start(route), renderer.world)
    encoding = experiment.encoding
    on_route = experiment.replace(training__learning_walk=0.0)
    (views_on_route, _), (views_around, around) = (
        training_views(encoding, renderer, each.training_poses(renderer.world, route))
        for each in (on_route, experiment)
    )
    senses = experiment.senses.make()
    route_views, poses = route_views_of(experiment, route), facing_east(positions)
    views = list(encoded_views(encoding, renderer, poses))
    for spec in models:
        model = experiment.replace(model=spec).make_model()
        began = time.perf_counter()
        model.fit(views_on_route)
        fitted = time.perf_counter()
        errors = errors_of_views(model, views, route_views, poses)
        scanned = time.perf_counter()
        navigator = experiment.make_navigator(experiment.replace(model=spec).make_model())
        light = renderer.world.light
        learn_views(navigator, views_around, around, route=route, senses=senses, seed=experiment.seed, light=light)
        *_, (last,) = experiment.walk(renderer, route).steps(navigator)
        yield Comparison(
            median_error_deg=errors.median_error_deg,
            mean_error_deg=errors.mean_error_deg,
            share_over_45=errors.share_over_45,
            arrived=last is not None and last.reason == StopReason.ARRIVED,
            memory_bytes=memory_bytes(model),
            fit_seconds=fitted - began,
            scan_ms=1000 * (scanned - fitted) / len(positions),
        )
