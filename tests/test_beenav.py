"""Orchards, and the protocol that lets a network lead home in them."""

import numpy as np
import pandas as pd
import pytest

from tussock.navigation.reports.claims import check_claims
from tussock.navigation.studies.protocols.beenav2026 import BEENAV2026, DISTANCES, STARTS
from tussock.navigation.training import goal_walk_poses
from tussock.world.errors import SettingError
from tussock.world.orchard import AROUND, CLEAR, MAX_AROUND, _positions, orchard
from tussock.world.scene import World


@pytest.mark.parametrize(("seed", "trees"), [(0, 15), (1, 40), (2, 40)])
def test_trees_stand_apart_and_off_the_middle(seed, trees):
    xy = _positions(trees, 50.0, 5.0, np.random.default_rng(seed))
    apart = np.hypot(*(xy[:, None] - xy).T)[np.triu_indices(trees, 1)]
    middle = np.hypot(*xy.T)
    assert len(xy) == trees
    assert apart.min() >= 5
    assert middle.min() >= CLEAR
    assert (middle < AROUND).sum() <= MAX_AROUND
    assert np.abs(xy).max() <= 50
    assert np.abs(xy).max() > 35


def test_an_orchard_is_that_of_its_seed():
    one, again, other = (World.generate("orchard trees=3 reach=12", seed) for seed in (4, 4, 5))
    assert one.triangles.tobytes() == again.triangles.tobytes()
    assert one.rgb.tobytes() == again.rgb.tobytes()
    assert one.triangles.tobytes() != other.triangles.tobytes()
    assert one.triangles[..., 2].max() > 3
    assert one.field == (-12, -12, 12, 12)
    assert len(World.generate("orchard trees=0", 0).triangles) == 0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"trees": -1}, "the orchard's trees is -1; give a whole number from 0"),
        ({"height": 0.0}, "height is 0.0; give a number from 0.2"),
        ({"reach": np.nan}, "reach is nan"),
        ({"trees": 50, "reach": 6.0}, "no room for 50 trees within 6 m"),
    ],
)
def test_impossible_orchards_are_refused(given, message):
    with pytest.raises(SettingError, match=message):
        orchard(0, **given)


def test_beenav_is_as_published():
    runs = BEENAV2026.sweep([{"world": "orchard", "world_seed": 0}]).experiments
    starts = {tuple(np.round(run.start(run.route)[:2], 6)) for run in runs}
    assert len(starts) == len(DISTANCES) * STARTS == 80
    assert sorted({round(float(np.hypot(*start)), 2) for start in starts}) == [5, 10, 15, 20, 25]
    assert {run.stopping.max_steps for run in runs} == {50}
    assert {run.stopping.arrival_radius for run in runs} == {1.2}
    assert {run.eye.z for run in runs} == {1.5}
    assert {str(run.senses) for run in runs} == {"ideal", "robot", "svo-gtsam", "stankiewicz-webb", "ant", "bee"}
    flight = goal_walk_poses(runs[0].training, runs[0].route)
    assert len(flight) == 147
    assert np.hypot(*flight[:, :2].T).max() == pytest.approx(11)
    turns = np.unwrap(np.arctan2(flight[:, 1], flight[:, 0]))
    assert (turns[-1] - turns[0]) / (2 * np.pi) == pytest.approx(5)


def test_the_networks_steps_are_as_published():
    """0.1 m and 0.4 / 3 of the home vector, at most 2.5 m."""
    run = BEENAV2026.sweep([{"world": "orchard", "world_seed": 0}]).experiments[0]
    navigator = run.make_navigator(run.make_model())
    for length in (0.0, 1.5, 9.0, 30.0):
        share = min(navigator.slowest + (1 - navigator.slowest) * length / navigator.whole_step_at, 1.0)
        assert share * run.body.step_length == pytest.approx(min(0.1 + 0.4 * length / 3, 2.5))


def test_beenav_by_hand():
    rows = [
        {"navigator": navigator, "senses": senses, "world_seed": world, "release_m": far, "arrived": arrived}
        for world in range(6)
        for navigator, senses, far, arrived in [
            ("home-vector slowest=0.04", "ideal", 5.0, True),
            ("home-vector slowest=0.04", "ideal", 10.0, world > 0),
            ("home-vector slowest=0.04", "ideal", 25.0, world > 3),
            ("home-vector slowest=0.04", "ant", 5.0, False),
            ("path-integration arrival=0.5", "ant", 5.0, world > 2),
        ]
    ]
    results = BEENAV2026.measure(pd.DataFrame(rows).assign(model="x", release_deg=0.0, steps=9, goal_m=0.5))
    table = results.tables["by_distance"].set_index(["navigator", "senses"])
    assert table.loc[("home-vector", "ideal")].tolist() == pytest.approx([1, 5 / 6, 2 / 6])
    assert table.loc[("path-integration", "ant"), "5 m"] == 0.5
    assert results.numbers["share that came home from up to 10 m"] == pytest.approx(11 / 12)
    outcomes = {each.claim.key: each for each in check_claims(BEENAV2026.claims, [results])}
    assert outcomes["home-from-learned-area"].holds == [True]
    (effect,) = outcomes["falls-outside"].effects
    assert effect is not None
    assert effect.value == pytest.approx(0.5)
    for item in BEENAV2026.items:
        if item.draw is not None:
            item.draw(results.tables[item.table])
