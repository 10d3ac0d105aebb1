"""Statistics of a sweep's runs, against textbooks and by hand; and its figures and worst walks."""

import numpy as np
import pandas as pd
import pytest

from tussock.navigation.reports.report import Cell
from tussock.navigation.reports.results import plain_json
from tussock.navigation.sweeps.figures import along_axis
from tussock.navigation.sweeps.statistics import (
    axes_of,
    by_axis,
    choice_label,
    measures_of,
    pairings,
    setting_label,
    summary,
    worlds_of,
)
from tussock.navigation.sweeps.store import table_of
from tussock.navigation.sweeps.tables import pair_table, pairing_numbers
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


def test_models_are_compared_on_runs_that_are_equal_in_everything_else():
    rows = [
        {"model": model, "offset_m": offset, "world": "tiny", "world_seed": seed, "route": None, "route_seed": None, "route_length_m": 8.0,
         "seed": 0, "arrived": model == "good" or offset == 0, "mean_deviation_m": 0.1 if model == "good" else 0.3}
        for model in ("bad", "good") for offset in (0.0, 0.1) for seed in range(6)
    ]  # fmt: skip
    frame = pd.DataFrame([*rows, rows[0] | {"offset_m": 7.0}])  # this one has no partner
    settings = ["model", "offset_m", "world", "world_seed", "seed"]
    axes = axes_of(frame, settings)
    assert list(axes.values()) == [["model"], ["offset_m"], ["world_seed"]]
    (pair,) = pairings(frame, settings, ["arrived", "mean_deviation_m"], ["model"])
    assert (pair.first, pair.second, pair.pairs, pair.worlds) == ("bad", "good", 12, 6)
    arrived, deviation = pair.differences["arrived"], pair.differences["mean_deviation_m"]
    assert arrived.interval.value == -0.5
    assert arrived.interval.low < -0.5 < arrived.interval.high
    assert np.isclose(deviation.interval.value, 0.2)
    assert np.isnan(deviation.interval.low)  # it is the same in all worlds
    assert (arrived.better, arrived.worse, arrived.effect) == (0, 6, -0.5)
    assert (deviation.better, deviation.worse, deviation.effect) == (0, 12, -1)
    assert arrived.p == deviation.p == arrived.corrected_p == 2 / 2**6  # all worlds point one way


def test_what_there_is_nothing_to_say_of_is_not_shown():
    always = ["arrived", "mean_deviation_m", "mean_error_deg"]
    row = dict.fromkeys(always, 0.0) | {
        "navigator": "scan",
        "resets": 0,
        "looks_per_m": 1800.0,
        "touches": 0,
        "recovered": None,
    }
    row |= {"inward": None, "outward": 0.5}

    def shown(*changes):
        return measures_of(table_of({str(k): row | change for k, change in enumerate(changes)}))

    assert shown({}, {}) == always
    assert shown({}, {"resets": 1}) == [*always, "resets"]
    assert shown({}, {"touches": 2}) == [*always, "touches"]
    assert shown({}, {"recovered": False}) == [*always, "recovered"]
    assert shown({}, {"navigator": "lateral"}) == [*always, "looks_per_m", "inward", "outward"]
    assert shown({"navigator": "scan every=3"}) == [*always, "looks_per_m", "inward", "outward"]
    # A folder of an earlier version has no such columns.
    old = pd.DataFrame([{name: row[name] for name in (*always, "resets")} | {"navigator": "mine:Navigator"}])
    assert measures_of(old) == always


def test_measures_that_some_runs_do_not_have_are_over_the_others():
    rows = [
        {"navigator": name, "world": "tiny", "world_seed": seed, "route": None, "route_seed": None, "seed": 0,
         "recovered": None if seed == 0 else name == "good", "inward": None if seed == 1 else 0.5 + 0.1 * (name == "good") * seed,
         "outward": None}
        for name in ("bad", "good") for seed in range(9)
    ]  # fmt: skip
    frame = table_of({str(k): row for k, row in enumerate(rows)})
    measures = ["recovered", "inward", "outward"]
    both = summary(frame, measures).intervals
    assert both["recovered"].value == 0.5
    assert np.isnan(both["outward"].value)
    (pair,) = pairings(frame, ["navigator", "world_seed"], measures, ["navigator"])
    found = pair.differences
    assert found["recovered"].interval.value == -1
    assert (found["recovered"].better, found["recovered"].worse) == (0, 8)
    assert (found["inward"].better, found["inward"].worse) == (0, 7)  # the more the better; the first world is alike
    assert (found["outward"].better, found["outward"].worse) == (0, 0)
    pair_table([plain_json(pairing_numbers(pair))], measures)
    along_axis(frame, ["navigator"], measures, [])


def test_p_values_are_corrected_for_all_pairs():
    """Of three models, two of which are alike."""
    rows = [
        {"model": model, "world": "tiny", "world_seed": seed, "route": None, "route_seed": None, "seed": 0, "arrived": model != "c"}
        for model in "abc" for seed in range(8)
    ]  # fmt: skip
    pairs = pairings(pd.DataFrame(rows), ["model", "world_seed"], ["arrived"], ["model"])
    found = {pair.first + pair.second: pair.differences["arrived"] for pair in pairs}
    assert {name: each.p for name, each in found.items()} == {"ab": 1, "ac": 2 / 2**8, "bc": 2 / 2**8}
    assert {name: each.corrected_p for name, each in found.items()} == {"ab": 1, "ac": 6 / 2**8, "bc": 6 / 2**8}


def test_there_is_no_interval_and_no_test_with_too_few_worlds():
    rows = [
        {"model": model, "world": "tiny", "world_seed": seed, "route": None, "route_seed": None, "seed": run, "arrived": run < 3}
        for model in "ab" for seed in range(4) for run in range(5)
    ]  # fmt: skip
    frame = pd.DataFrame(rows)
    both = summary(frame, ["arrived"])
    assert (both.runs, both.worlds, both.intervals["arrived"].value) == (40, 4, 0.6)
    assert np.isnan(both.intervals["arrived"].low)
    (pair,) = pairings(frame, ["model", "world_seed", "seed"], ["arrived"], ["model"])
    assert np.isnan([pair.differences["arrived"].p, pair.differences["arrived"].interval.low]).all()
    table = pair_table([plain_json(pairing_numbers(pair))], ["arrived"])
    assert table.rows[0][:4] == ["a", "b", "20", Cell(text="4", note="no interval")]


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
