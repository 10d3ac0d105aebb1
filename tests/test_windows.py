"""The memory of a window of the route against plain loops, and walks that are put back ahead of where they failed."""

import math

import numpy as np
import pandas as pd
import pytest
import torch

from tussock.navigation.experiment import Experiment
from tussock.navigation.models import make_model
from tussock.navigation.reports.claims import check_claims
from tussock.navigation.steering import Look, Motion
from tussock.navigation.stop_check import StopCheck
from tussock.navigation.stopping import StoppingRules
from tussock.navigation.studies.protocols import KAGIOULIS2024, routes_in
from tussock.render.eye import Eye
from tussock.world.geometry import Bounds, Pose, Route

VIEWS = np.cumsum(np.random.default_rng(0).normal(size=(60, 4, 12)), axis=0).astype(np.float32)  # like their neighbours
EVERYWHERE = np.ones(12, dtype=bool)


class ByLoops:
    """The rule of the original's code, in plain numbers."""

    def __init__(self, views, window, adaptive=True, smallest=10):
        self.views, self.size, self.adaptive, self.smallest = views, min(window, len(views)), adaptive, smallest
        self.first, self.last, self.before = 0, self.size, 0.0

    def look(self, view):
        best = None
        for k in range(self.first, self.last):
            for turn in range(view.shape[1]):
                difference = float(np.sqrt(np.mean((np.roll(view, turn, axis=1).astype(float) - self.views[k]) ** 2)))
                if best is None or difference < best[0] - 1e-9:
                    best = difference, k
        difference, matched = best
        if self.adaptive:
            change = round(len(self.views) / self.size)
            larger, smaller = min(self.size + change, len(self.views)), max(self.size - change, self.smallest)
            self.size = larger if difference > self.before else min(smaller, len(self.views))
            self.before = difference
        self.go_to(matched)
        return matched

    def go_to(self, matched):
        ahead = round(self.size / 2)
        self.first = max(0, min(matched - (self.size - ahead), len(self.views) - self.size))
        self.last = min(len(self.views), max(matched + ahead, self.size))


@pytest.mark.parametrize(("window", "adaptive"), [(20, True), (20, False), (5, True), (5, False), (500, True)])
def test_the_window_is_that_of_the_rule_by_loops(window, adaptive):
    model = make_model("window-memory", window=window, adaptive=adaptive).fit(torch.from_numpy(VIEWS))
    following, plain, random = model.follow(), ByLoops(VIEWS, window, adaptive), np.random.default_rng(1)
    assert following.progress is None
    sizes = []
    for k in [*range(0, 60, 3), 59, 59, 20, 0]:
        view = np.roll(VIEWS[k] + random.normal(scale=random.choice([0.01, 0.5]), size=(4, 12)), -2, axis=1).astype(
            np.float32
        )
        following.look(torch.from_numpy(view), EVERYWHERE)
        assert following.matched == plain.look(view)
        assert (following.window.start, following.window.stop) == (plain.first, plain.last)
        assert following.progress == following.matched / 59
        sizes.append(following.size)
    assert (len(set(sizes)) > 1) == adaptive


def test_only_the_window_is_compared_and_it_moves_where_the_walk_is_put_back():
    model = make_model("window-memory", window=10, adaptive=False).fit(torch.from_numpy(VIEWS))
    following = model.follow()
    _, index = following.look(torch.from_numpy(VIEWS[40]), EVERYWHERE)
    assert int(index.max()) < 10
    following.resume(40 / 59)
    assert (following.window.start, following.window.stop) == (35, 45)
    following.look(torch.from_numpy(VIEWS[42]), EVERYWHERE)
    assert following.matched == 42
    following.resume(1.0)
    assert (following.window.start, following.window.stop) == (50, 60)


def check_of(**rules) -> StopCheck:
    route = Route.through(np.column_stack([np.linspace(0, 4, 41), np.zeros(41)]))
    return StopCheck(StoppingRules(put_back=True, **rules), route, Bounds(-9, -9, 9, 9), 0.1)


def test_put_back_ahead_of_the_nearest_point():
    check = check_of(put_back_ahead=0.25)
    check.check(Pose(1.5, 0.1, 0.0), 0.1, 1.5)
    check.check(Pose(1.2, 0.9, 0.0), 0.9, 1.2)  # it has turned back since
    assert check.put_back() == pytest.approx((1.45, 0, 0))
    check.check(Pose(0.3, 0.9, 0.0), 0.9, 0.3)
    assert check.put_back() == pytest.approx((1.7, 0, 0))  # ahead of where it was put back before
    check.check(Pose(3.9, 0.9, 0.0), 0.9, 3.9)
    assert check.put_back() == pytest.approx((4, 0, 0))
    nearest = check_of(put_back_ahead=0.0)
    nearest.check(Pose(1.2, 0.9, 0.0), 0.9, 1.2)
    assert nearest.put_back() == pytest.approx((1.2, 0, 0))
    waypoint = check_of(waypoint_spacing=0.5)
    waypoint.check(Pose(1.2, 0.9, 0.0), 0.9, 1.2)
    assert waypoint.put_back() == pytest.approx((1.5, 0, 0))


def test_the_variant_is_as_published():
    variant = KAGIOULIS2024.as_published
    assert variant is not None
    runs = list(variant.sweep(routes_in("tiny", [], count=1)).experiments)
    assert len(runs) == 5 * 3
    assert list(dict.fromkeys(str(run.model) for run in runs)) == [
        "perfect-memory", "window-memory", "window-memory adaptive=false", "window-memory window=50 adaptive=false",
        "window-memory window=100 adaptive=false",
    ]  # fmt: skip
    for run in runs:
        assert math.isclose(run.stopping.put_back_ahead, 5 * run.training.spacing)
        assert run.stopping.put_back
        assert run.stopping.max_deviation == 0.3
    assert KAGIOULIS2024.experiment.stopping.put_back_ahead is None


def test_windows_have_names_in_its_results():
    variant = KAGIOULIS2024.as_published
    specs = [str(model) for model in variant.axes["model"]]
    walks = pd.DataFrame({
        "spec": specs, "model": [spec.split()[0] for spec in specs], "place": "a", "resets": [4, 2, 3, 3, 5],
        "mean_error_deg": [20.0, 12, 11, 13, 14], "mean_deviation_m": 0.1, "arrived": True,
    })  # fmt: skip
    results = variant.measure(walks)
    names = ["perfect-memory", "adaptive window", "window of 20", "window of 50", "window of 100"]
    assert results.tables["by_model"]["model"].tolist() == names
    assert {each.claim.key: each.holds[0] for each in check_claims(variant.claims, [results])} == {
        "window-lowers-error": True,
        "window-fails-less": True,
    }


def test_walks_that_are_all_alike_decide_nothing():
    variant = KAGIOULIS2024.as_published
    specs = [str(model) for model in variant.axes["model"]]
    walks = pd.DataFrame({"spec": specs, "model": [spec.split()[0] for spec in specs]}).assign(
        place="a", resets=0, mean_error_deg=1.0, mean_deviation_m=0.1, arrived=True
    )
    outcomes = check_claims(variant.claims, [variant.measure(walks)])
    assert {each.label for each in outcomes} == {"not tested"}


class Circling:
    """A navigator that walks in circles, with a memory that is told where it was put back."""

    def __init__(self):
        self.resumed: list[float] = []

    def learn(self, views): ...

    def begin(self):
        return self

    def resume(self, progress: float) -> None:
        self.resumed.append(progress)

    def decide(self, look: Look, memories) -> Motion:
        return Motion(turn=np.full(len(look), 0.4))


def test_a_walk_that_is_put_back_is_told_where():
    experiment = Experiment(
        world="tiny",
        eye=Eye(width=36, height=8),
        encoding="grey",
        route_length=2.0,
        threads=1,
        stopping=StoppingRules(put_back=True, put_back_ahead=0.2, max_deviation=0.15, max_steps=60),
    )
    world, route = experiment.open_world_and_route()
    navigator = Circling()
    with experiment.open_renderer(world) as renderer:
        steps = [step for (step,) in experiment.walk(renderer, route).steps(navigator) if step is not None]
    put_back = [step.along / route.length for step in steps if step.reset is not None]
    assert len(put_back) > 2
    assert navigator.resumed == put_back
    assert (np.diff(put_back) > 0).all()
