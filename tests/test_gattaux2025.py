"""gattaux2025: routes both ways, its measures by hand, and claims that can fail."""

import numpy as np
import pandas as pd
import pytest

from tussock.navigation.studies.protocols import GATTAUX2025, prepared, routes_in
from tussock.navigation.studies.protocols.gattaux2025 import BODY, MODELS, of_walk
from tussock.navigation.studies.protocols.protocol import back
from tussock.world.geometry import Route
from tussock.world.route_files import read_route


def test_the_way_back_leads_through_the_same_points_facing_back():
    route = Route.through(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]]))
    home = back(route)
    assert (home.xy == route.xy[::-1]).all()
    assert home.length == pytest.approx(route.length)
    apart = home.poses[::-1, 2] - route.poses[:, 2]
    assert np.cos(apart) == pytest.approx(-1.0)
    assert back(home).poses == pytest.approx(route.poses)


def test_each_route_is_prepared_both_ways(tmp_path):
    changes = prepared(GATTAUX2025, routes_in("tiny", [], seed=3, count=2), tmp_path)
    names = [change["route"].stem for change in changes]
    assert names == ["01-seed3", "01-seed3-home", "02-seed4", "02-seed4-home"]
    out, home = (read_route(change["route"]) for change in changes[:2])
    assert home.xy == pytest.approx(out.xy[::-1], abs=1e-4)
    assert [change["world_seed"] for change in changes] == [3, 3, 4, 4]
    assert len(GATTAUX2025.sweep(changes)) == 4 * len(MODELS) * 3


def walks(arrived=True, error=0.1):
    rows = [
        {
            "model": model.split()[0],
            "place": f"seed{seed}{end}",
            "offset_m": 0.0,
            "arrived": arrived,
            "error_lanes": error * (1 + (end != "")),
            "mean_deviation_m": 0.2,
            "step_m": 0.04,
            "steps": 100,
        }
        for model in MODELS
        for seed in range(6)
        for end in ("", "-home")
    ]
    return pd.DataFrame(rows)


def test_both_ways_are_told_apart():
    table = GATTAUX2025.measure(walks()).tables["by_model"].set_index(["model", "way"])
    assert (table["walks"] == 6).all()
    assert table.loc[(BODY, "out"), "median lateral error (lane widths)"] == pytest.approx(0.1)
    assert table.loc[(BODY, "home"), "median lateral error (lane widths)"] == pytest.approx(0.2)


@pytest.mark.parametrize(("arrived", "error", "holds"), [(True, 0.05, [True, True]), (False, 0.3, [False, False])])
def test_claims_can_fail(arrived, error, holds):
    results = GATTAUX2025.measure(walks(arrived, error))
    assert [claim.decide(results).holds for claim in GATTAUX2025.claims] == holds


def test_lateral_error_is_the_median_in_lanes():
    steps = pd.DataFrame({"x_m": [0.0, 0.04, 0.04], "y_m": [0.0, 0.0, 0.02], "deviation_m": [0.1, 0.3, 0.2]})
    assert of_walk({}, steps) == pytest.approx({"error_lanes": 0.2, "step_m": 0.03})
