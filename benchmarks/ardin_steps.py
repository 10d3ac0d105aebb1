"""Which step of Ardin et al. (2016) makes how much of the errors: the tables of docs/protocols.md.

    python benchmarks/ardin_steps.py decisions 100 101 SUSSEX/ant1_route1.bin > decisions.jsonl
    python benchmarks/ardin_steps.py walks 100 101 SUSSEX/ant1_route1.bin > walks.jsonl
    python benchmarks/ardin_steps.py rates 100 101 > rates.jsonl

A number is the seed of a generated world and route; a file is a route through the world in its folder, SUSSEX/world5000_gray.bin.
Each line is a result: the mean error (degrees) of decisions, or the number of errors of a walk.
"""

import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import torch

from tussock import Experiment, Eye, Pose, Route, make_model
from tussock.navigation.experiment import steps_of
from tussock.navigation.models.spiking_mushroom_body import SpikingMushroomBody
from tussock.navigation.scan import best_turn, scan_window
from tussock.navigation.studies.protocols import ARDIN2016
from tussock.world.errors import InputError

PUBLISHED = ARDIN2016.as_published.experiment
CHAIN = str(PUBLISHED.encoding)
FULL = attrs.evolve(PUBLISHED.eye, field=2 * math.pi)
VIEWS: dict[str, tuple[Eye, str]] = {
    "published": (PUBLISHED.eye, CHAIN),
    "field of 360 degrees": (FULL, CHAIN.replace("head-views 74 2 40 8 36 10", "head-views 90 2 40 8 44 10")),
    "clip limit 2": (PUBLISHED.eye, CHAIN.replace(" 40 8 ", " 2 8 ")),
    "those of ardin2016": (ARDIN2016.experiment.eye, str(ARDIN2016.experiment.encoding)),
}
MODELS = ("perfect-memory", "spiking-mushroom-body", "random")
SPACING, ASIDE = 1.0, (0.0, 0.05, -0.05)  # m, along the route and to its left, of decisions
RATES = (0.97, 3, 10, 20, 30, 50, 100, 150)  # of Infomax, times the square of the number of pixels
WINNERS = 200  # Kenyon cells that fire without spikes


def surroundings(name: str) -> dict[str, Any]:
    """Fields of an experiment."""
    if name.isdecimal():
        return {"world": "tussock-field", "world_seed": int(name), "route_seed": int(name)}
    return {"world": str(Path(name).parent / "world5000_gray.bin"), "route": name, "cull_back_faces": True}


def views_of(name: str, views: str) -> tuple[Any, torch.Tensor, torch.Tensor]:
    """An encoding, the learned views, and those of positions on the route and 5 cm next to it, facing along it."""
    eye, chain = VIEWS[views]
    base = PUBLISHED.replace(threads=1, eye=eye, encoding=chain, **surroundings(name))
    world, route = base.open_world_and_route()
    at = route.at(np.arange(0.5, route.length - 0.5, SPACING))
    poses = np.array([Pose(*pose).moved(0, aside) for pose in at.tolist() for aside in ASIDE])
    encoded = base.encoding.for_eye(eye)
    with base.open_renderer(world) as renderer:
        learned, _ = base.training_views(renderer, route)
        return encoded, learned, encoded.at(renderer, poses)


def rates(name: str) -> Iterator[dict[str, Any]]:
    """Mean errors of single decisions of Infomax, by its rate."""
    for views in ("those of ardin2016", "published"):
        encoded, learned, seen = views_of(name, views)
        pixels = make_model("infomax").see(encoded.mask)._size(*learned.shape[1:])
        of_rates = [f"infomax rate={rate / pixels**2:.3g}" for rate in RATES]
        for model in ("perfect-memory", "random", *of_rates, "infomax rate=baddeley"):
            try:
                trained = make_model(model).see(encoded.mask).fit(learned)
            except InputError as error:  # the weights grow without bound
                yield {"where": name, "views": views, "model": model, "failed": str(error)}
            else:
                yield decided(name, views, model, trained.scan(seen).numpy())


def decisions(name: str) -> Iterator[dict[str, Any]]:
    """Mean errors of single decisions on the route and 5 cm next to it, facing along it."""
    for views in VIEWS:
        encoded, learned, seen = views_of(name, views)
        for model in ("perfect-memory", "spiking-mushroom-body", "mushroom-body inputs=10 cells=20000"):
            if model.startswith("mushroom") and encoded.mask is not None:
                continue  # its projection neurons are fields of a panorama
            trained = make_model(model).see(encoded.mask).fit(learned)
            yield decided(name, views, model.split()[0], trained.scan(seen).numpy())
            if isinstance(trained, SpikingMushroomBody) and encoded.mask is not None:
                yield decided(name, views, "the same cells without spikes", without_spikes(trained, learned, seen))


def decided(name: str, views: str, model: str, familiarity: np.ndarray) -> dict[str, Any]:
    window = scan_window(familiarity.shape[1], math.radians(120))
    error = np.abs(np.degrees(best_turn(familiarity.astype(float), window)))
    on_route = np.tile(np.array(ASIDE) == 0, len(error) // len(ASIDE))
    means = {"on the route": error[on_route].mean(), "5 cm next to it": error[~on_route].mean()}
    return {"where": name, "views": views, "model": model} | {key: float(value) for key, value in means.items()}


def without_spikes(model: SpikingMushroomBody, learned: torch.Tensor, seen: torch.Tensor) -> np.ndarray:
    """Familiarity by the same wiring where the cells with the largest summed input fire once, and learning silences their synapses."""
    wiring = model.learned["wiring"].numpy()

    def firing(view: torch.Tensor, rotations: np.ndarray) -> np.ndarray:
        currents = model._currents(view, rotations).astype(np.float32)
        drive = sum(currents[:, wiring[:, k]] for k in range(wiring.shape[1]))
        return np.argpartition(-drive, WINNERS, axis=1)[:, :WINNERS]

    synapses = np.ones(len(wiring))
    for view in learned:
        synapses[firing(view, np.zeros(1, np.int64))] = 0
    return np.stack([-synapses[firing(view, np.arange(view.shape[1]))].mean(axis=1) for view in seen])


def walks(name: str) -> Iterator[dict[str, Any]]:
    """Errors of walks, on routes laid out as published and as they are."""
    base = PUBLISHED.replace(threads=1, **surroundings(name))
    world, given = base.open_world_and_route()
    layouts = {"as published": ARDIN2016.as_published.layout(given), "as it is": given}
    for layout, route in layouts.items():
        for model in MODELS:
            runs = [
                base.replace(route=route, model=model, start_offset=offset, stopping__put_back_at=put_back)
                for put_back in ("next-waypoint", "nearest-point")[: 2 if route is not given else 1]
                for offset in (0.0, 0.05)[: 2 if route is not given else 1]
            ]
            for run, errors in zip(runs, errors_of(runs, world, route), strict=True):
                about = {
                    "layout": layout,
                    "model": model,
                    "start_m": run.start_offset,
                    "put_back": run.stopping.put_back_at,
                }
                yield {"where": name, **about, "errors": errors}


def errors_of(runs: list[Experiment], world: Any, route: Route) -> list[int]:
    errors = [0] * len(runs)
    with runs[0].open_renderer(world) as renderer:
        for steps in steps_of(runs, runs[0].train(renderer, route)):
            for k, each in enumerate(steps):
                errors[k] += each is not None and each[0].reset is not None
    return errors


def main(what: str, *names: str) -> None:
    torch.set_num_threads(1)
    for name in names:
        for result in {"decisions": decisions, "walks": walks, "rates": rates}[what](name):
            print(json.dumps(result), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
