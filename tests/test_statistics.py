"""Statistics of a sweep's runs, against textbooks and by hand; and its figures and worst walks."""

import tracemalloc

import numpy as np
import pandas as pd
import pytest

from tussock.navigation.sweeps.figures import along_axis
from tussock.navigation.sweeps.statistics import (
    axes_of,
    by_axis,
    choice_label,
    mean_interval,
    pairings,
    setting_label,
    worlds_of,
)
from tussock.navigation.sweeps.store import table_of
from tussock.navigation.sweeps.worst import describe_evidence, step_to_show


def test_a_figure_has_every_choice():
    """With an axis that was added later, so that earlier runs have no value, and with values that differ in their last digits."""
    for choices in ([None, 1.0, 2.0], [0.1, 0.1000001], [100000.1, 100000.2]):
        rows = [
            {"world": "tiny", "world_seed": k, "seed": k, "route": None, "route_seed": None, "resize": each, "arrived": True}
            for each in choices for k in range(3)
        ]  # fmt: skip
        frame = table_of({str(k): row for k, row in enumerate(rows)})
        assert len(by_axis(frame, ["resize"], ["arrived"])) == len(choices)
        along_axis(frame, ["resize"], ["arrived"], [])


def test_intervals_are_those_of_the_textbook():
    """For many independent values, mean +- 1.96 standard errors; where runs share worlds, those of the means of the worlds."""
    random = np.random.default_rng(0)
    values = random.normal(3, 2, 2000)
    interval = mean_interval(values, np.arange(2000))
    assert np.allclose(
        [interval.low, interval.high], 3 + np.array([-1.96, 1.96]) * 2 / 2000**0.5 + values.mean() - 3, atol=0.02
    )
    worlds = np.repeat(np.arange(40), 50)
    shared = np.repeat(random.normal(size=40), 50)
    wide = mean_interval(shared, worlds)
    assert 0.8 < (wide.high - wide.low) / (2 * 1.96 * shared.std() / 40**0.5) < 1.2
    assert np.isnan(mean_interval(np.array([]), np.array([], dtype=int)).value)
    one = mean_interval(np.array([3.0]), np.array([0]))
    assert one.value == 3
    assert np.isnan([one.low, one.high]).all()  # undetermined


def test_runs_in_one_world_are_one_group():
    rows = [
        {"world": world, "world_seed": seed, "seed": 5, "route": route, "route_seed": route_seed}
        for world, route in (("tiny", None), ("a.glb", None), ("a.glb", "b.csv"))
        for seed in (None, 5, 6)
        for route_seed in (None, 1)
    ]
    groups = worlds_of(pd.DataFrame(rows)).tolist()
    # There are two generated worlds; in the world from a file, two generated routes and one from a file.
    assert groups == [0, 0, 0, 0, 1, 1, 2, 3, 2, 3, 2, 3, 4, 4, 4, 4, 4, 4]


@pytest.mark.parametrize("shape", ["share", "skewed"])
def test_the_interval_of_many_groups_is_that_of_the_bootstrap(monkeypatch, shape):
    """Up to a small part of its width, for groups of different sizes."""
    random = np.random.default_rng(0)
    groups = random.integers(0, 1500, 6000)
    values = random.random(6000) < 0.7 if shape == "share" else random.gamma(2, 0.05, 6000) + 0.1 * (groups % 2)
    drawn = mean_interval(values.astype(float), groups)
    monkeypatch.setattr("tussock.navigation.sweeps.statistics.MAX_GROUPS", 1000)
    normal = mean_interval(values.astype(float), groups)
    assert normal.value == drawn.value
    assert normal.low != drawn.low
    assert np.allclose([normal.low, normal.high], [drawn.low, drawn.high], rtol=0, atol=0.05 * (drawn.high - drawn.low))


def test_the_interval_of_a_share_ends_at_one():
    interval = mean_interval(np.r_[0.0, np.ones(5000)], np.arange(5001))
    assert interval.low < interval.value < interval.high <= 1


def test_many_groups_need_little_memory():
    tracemalloc.start()
    mean_interval(np.ones(30_000), np.arange(30_000))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2**27


def test_models_are_compared_on_runs_that_are_equal_in_everything_else():
    rows = [
        {"model": model, "offset_m": offset, "world": "w", "world_seed": seed, "route": None, "route_seed": None, "route_length_m": 8.0,
         "seed": 0, "arrived": model == "good" or offset == 0, "mean_deviation_m": 0.1 if model == "good" else 0.3}
        for model in ("bad", "good") for offset in (0.0, 0.1) for seed in range(3)
    ]  # fmt: skip
    frame = pd.DataFrame([*rows, rows[0] | {"offset_m": 7.0}])  # this one has no partner
    settings = ["model", "offset_m", "world", "world_seed", "seed"]
    axes = axes_of(frame, settings)
    assert list(axes.values()) == [["model"], ["offset_m"], ["world_seed"]]
    (pair,) = pairings(frame, settings, ["arrived", "mean_deviation_m"], ["model"])
    assert (pair.first, pair.second, pair.pairs) == ("bad", "good", 6)
    assert pair.difference["arrived"].value == -0.5
    assert np.isclose(pair.difference["mean_deviation_m"].value, 0.2)
    assert (pair.better["arrived"], pair.worse["arrived"], pair.worse["mean_deviation_m"]) == (0, 3, 6)


@pytest.mark.parametrize(
    ("setting", "label"),
    [
        ("offset_m", "offset (m)"),
        ("heading_noise_deg", "heading noise (°)"),
        ("max_steps", "max steps"),
        ("size", "size"),
    ],
)
def test_labels_of_settings(setting, label):
    assert setting_label(setting) == label


@pytest.mark.parametrize(
    ("choice", "label"), [(2.0, "2"), (0.1, "0.1"), (None, "by default"), (("rbm", 3.0), "rbm, 3"), (True, "True")]
)
def test_labels_of_choices(choice, label):
    assert choice_label(choice) == label


def test_settings_that_vary_together_are_one_axis():
    frame = pd.DataFrame(
        {"seed": [0, 0, 1, 1], "encoding": ["a", "b", "a", "b"], "model": ["x", "y", "x", "y"], "same": 0}
    )
    assert axes_of(frame, list(frame)) == {"encoding and model": ["encoding", "model"], "seed": ["seed"]}


def trajectory() -> pd.DataFrame:
    """Four steps: a good one, and three poor ones."""
    columns = {
        "cause": [None, "aliasing", "aliasing", "corner"],
        "deviation_m": [0.0, 0.1, 0.2, 0.3],
        "covered": [None, 0.1, 0.1, 0.1],
        "error_deg": [0.0, 90.0, -90.0, 60.0],
        "turning_deg": [None, 0.0, 0.0, 60.0],
        "nearest_view_m": [None, 0.1, 0.1, 0.1],
        "recognised_view_m": [None, 2.0, 2.5, 0.2],
    }
    return pd.DataFrame(columns)


@pytest.mark.parametrize(("cause", "step"), [("aliasing", 2), ("corner", 3), (None, 3)])
def test_the_step_to_show_is_the_last_one_with_the_walks_cause_or_the_farthest(cause, step):
    assert step_to_show({"cause": cause}, trajectory()) == step


def test_evidence_is_that_of_the_step():
    steps = trajectory()
    assert describe_evidence(steps.iloc[0]) is None
    assert "2.50 m" in str(describe_evidence(steps.iloc[2]))
    assert "60 degrees" in str(describe_evidence(steps.iloc[3]))
    chance = steps.iloc[2].copy()  # of a control that recognises nothing, far from all learned views
    chance["cause"], chance["nearest_view_m"] = "unexplained", 3.0
    assert str(describe_evidence(chance)).startswith("unexplained, the heading is 90 degrees")
