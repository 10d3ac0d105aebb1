"""The studies of the thesis, against laws, other libraries and the thesis's own numbers."""

import dataclasses
import logging

import matplotlib
import numpy as np
import pandas as pd
import pytest
from figure_laws import check_figure
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from matplotlib.cbook import boxplot_stats
from sklearn.model_selection import ParameterGrid

from tussock.navigation.encoding import Encoding
from tussock.navigation.models import make_model
from tussock.navigation.reports.claims import Outcome, check_claims
from tussock.navigation.reports.drawing import STYLE
from tussock.navigation.reports.results import StudyResults
from tussock.navigation.studies.thesis import published
from tussock.navigation.studies.thesis.classifier import FIRST, held_out_views
from tussock.navigation.studies.thesis.confidence import random_errors
from tussock.navigation.studies.thesis.corners import corner_section, corner_views, equally_different, turning
from tussock.navigation.studies.thesis.effects import difference_of_medians, fall_of_median, median_error
from tussock.navigation.studies.thesis.figures import FIGURES
from tussock.navigation.studies.thesis.grid_search import share_of
from tussock.navigation.studies.thesis.headings import box_of, errors_of, headings
from tussock.navigation.studies.thesis.parameters import StudySettings
from tussock.navigation.studies.thesis.studies import STUDIES, run_studies
from tussock.navigation.studies.thesis.study_data import StudyData, data_of_databases, data_of_world
from tussock.navigation.studies.thesis.visual_compass import count_minima
from tussock.render.eye import Eye
from tussock.render.images.writing import Grid, published_grid_area, write_database
from tussock.render.renderer import open_renderer
from tussock.world.errors import FileError, SettingError
from tussock.world.geometry import Route, wrap_angle
from tussock.world.routes import generate_route
from tussock.world.scene import World

EYE = Eye(width=72, height=15, samples=1)
WORLD = World.generate("tiny", 1)
ROUTE = generate_route(WORLD, 1, 2.0)
TURNS = np.linspace(0, 3 * np.pi, 60)
BENDING = Route.through(np.column_stack([0.6 + 0.02 * np.arange(60), 1.5 + 0.15 * np.sin(TURNS)]))
FAST = ("setting", "visual-compass", "frequency")


@pytest.fixture(scope="module")
def data() -> StudyData:
    return data_of_world(WORLD, ROUTE, EYE, spacing=0.02)


@pytest.fixture
def log(caplog) -> pytest.LogCaptureFixture:
    """What the library logs."""
    caplog.set_level(logging.INFO, "tussock")
    return caplog


def bent(angle: float, leg: float = 2.0) -> Route:
    """Two straight legs with a turn of `angle` (rad) between them."""
    first = np.column_stack([np.arange(0, leg, 0.02), np.zeros(round(leg / 0.02))])
    second = (leg, 0) + np.arange(0, leg, 0.02)[:, None] * (np.cos(angle), np.sin(angle))
    return Route.through(np.vstack([first, second]))


# The thesis's own numbers


@pytest.mark.parametrize(("name", "row"), [("first_20", 206), ("whole_route", 713), ("more_in_corners", 403)])
def test_row_numbers_of_the_appendices_fit_the_grids(name, row):
    """The appendices print row numbers of scikit-learn's grid: the best tuning of each must be that row of our grid."""
    rows = list(ParameterGrid({key: list(values) for key, values in published.GRIDS[name].items()}))
    best = published.BEST_TUNINGS[name][2]
    assert {key: rows[row][key] for key in best} == best


@pytest.mark.parametrize(
    ("name", "row", "tuning"),
    [
        ("first_20", 179, ("relu", (20,), "lbfgs", 1e-5, 1e-4)),
        ("first_20", 80, ("logistic", (20,), "lbfgs", 1e-5, 1e-5)),
        ("whole_route", 303, ("logistic", (100,), "sgd", 1e-6, 1e-3)),
        ("whole_route", 506, ("tanh", (100,), "lbfgs", 1e-4, 1e-4)),
        ("whole_route", 608, ("relu", (20, 20), "adam", 1e-6, 1e-3)),
        ("more_in_corners", 81, ("identity", (100, 100), "sgd", 1e-3, 1e-3)),
        ("more_in_corners", 233, ("relu", (20,), "lbfgs", 1e-5, 1e-4)),
        ("more_in_corners", 367, ("tanh", (20, 20), "lbfgs", 1e-4, 1e-4)),
    ],
)
def test_further_rows_of_the_appendices(name, row, tuning):
    rows = list(ParameterGrid({key: list(values) for key, values in published.GRIDS[name].items()}))
    keys = ("activation", "hidden_layer_sizes", "solver", "tol", "learning_rate_init")
    assert tuple(rows[row][key] for key in keys) == tuning


def test_held_out_views_are_half_as_many_as_learned_ones_and_lie_between_them():
    for learned, expected in ((FIRST, 10), (92, 46)):  # figures 24 and 26
        views = np.arange(0, 6 * learned, 6)
        held_out = held_out_views(views)
        assert len(held_out) == expected
        assert not np.isin(held_out, views).any()
        assert (held_out % 6 == 3).all()


# Tables


@given(hnp.arrays(float, st.integers(5, 60), elements=st.floats(0, 180)))
def test_boxes_are_matplotlibs(errors):
    theirs = boxplot_stats(errors)[0]
    ours = box_of(pd.Series(errors))
    for name, key in (
        ("median_error_deg", "med"),
        ("lower_quartile_deg", "q1"),
        ("upper_quartile_deg", "q3"),
        ("mean_error_deg", "mean"),
    ):
        assert np.isclose(ours[name], theirs[key])
    assert np.isclose(ours["lower_whisker_deg"], theirs["whislo"])
    assert np.isclose(ours["upper_whisker_deg"], theirs["whishi"])


def test_headings_of_learned_views_are_recovered_exactly(data):
    """At the poses that perfect memory has stored, every error is under half a column."""
    encoding = Encoding.parse("grey")
    chosen = np.arange(0, len(data.route.poses), 10)
    known = StudyData(
        route=data.route,
        route_views=data.route_views,
        poses=data.route.poses[chosen],
        grid_views=data.route_views[chosen],
        grid=data.grid,
        world=None,
    )
    memory = make_model("perfect-memory").fit(encoding(data.route_views))
    table = headings(known, memory, encoding(known.grid_views), range(len(chosen)))
    assert table["error_deg"].max() < 2.5
    assert errors_of(table)["share_over_45"] == 0
    assert (table["nearest_view"] == chosen).all()


@pytest.mark.parametrize("scan_deg", [180.0, 90.0])
def test_a_narrow_scan_is_centred_on_the_general_direction(data, scan_deg):
    encoding = Encoding.parse("grey")
    memory = make_model("perfect-memory").fit(encoding(data.route_views[:1]))
    table = headings(data, memory, encoding(data.grid_views), scan_deg=scan_deg)
    away = np.abs(wrap_angle(np.radians(table["heading_deg"]) - data.general_direction))
    assert np.degrees(away).max() <= scan_deg / 2 + 360 / EYE.width


def test_the_median_error_of_random_headings_is_a_quarter_of_the_scan_about_the_right_one():
    straight = Route.through(np.column_stack([np.linspace(0, 2, 50), np.full(50, 1.0)]))
    poses = np.column_stack([np.linspace(0.2, 1.8, 9), np.full((9, 1), 1.1), np.zeros(9)])
    blank = np.zeros((1, 4, 8, 3), np.uint8)
    known = StudyData(
        route=straight,
        route_views=blank.repeat(50, 0),
        poses=poses,
        grid_views=blank.repeat(9, 0),
        grid=poses[:, :2],
        world=None,
    )
    chance = random_errors(known).set_index("scan_deg")["median_error_deg"]
    assert np.allclose(chance[[360, 180, 90]], [90, 45, 22.5], atol=0.5)


@given(st.integers(1, 6), st.floats(0, 6), st.floats(5, 50))
def test_minima_are_counted_over_the_full_circle(waves, phase, height):
    curve = 50 + height * np.cos(waves * np.arange(120) * 2 * np.pi / 120 + phase)
    assert count_minima(curve) == waves


# Corners


@pytest.mark.parametrize("angle_deg", [30, 90, -120])
def test_turning_is_the_angle_at_a_bend_and_zero_on_straights(angle_deg):
    route = bent(np.radians(angle_deg))
    turned = np.degrees(turning(route))
    middle = len(turned) // 2
    assert abs(turned[middle] - abs(angle_deg)) < 1
    straight = np.abs(route.arc - route.length / 2) > 0.61
    assert turned[straight].max() < 1e-6


def test_corners_of_a_bent_route_are_around_its_bend():
    route = bent(np.pi / 2)
    corners = corner_views(route)
    assert 0 < len(corners) <= round(0.2 * len(route.poses))
    assert (np.abs(route.arc[corners] - route.length / 2) < 0.5).all()
    first, last = corner_section(route)
    assert first < len(route.poses) // 2 < last


def test_a_straight_route_has_no_corners_but_a_section():
    straight = Route.through(np.column_stack([np.linspace(0, 3, 150), np.zeros(150)]))
    assert len(corner_views(straight)) == 0
    first, last = corner_section(straight)
    assert 0 <= first < last < 150


@given(hnp.arrays(float, st.integers(5, 80), elements=st.floats(0.1, 10)), st.integers(2, 20))
def test_equally_different_views_span_the_route_in_steps_of_similar_size(steps, views):
    chosen = equally_different(steps, views)
    sums = np.r_[0, np.cumsum(steps)]
    assert chosen[0] == 0
    assert chosen[-1] == len(steps)
    assert len(chosen) <= views
    assert np.diff(sums[chosen]).max() <= sums[-1] / (views - 1) + steps.max() + 1e-6


def test_equal_steps_choose_evenly():
    assert equally_different(np.ones(20), 5).tolist() == [0, 5, 10, 15, 20]


def test_the_order_of_ties_in_a_search_does_not_count():
    table = pd.DataFrame(
        {"mean_test_score": [0.9, 0.8, 0.8, 0.8, 0.7], "param_solver": ["adam", "sgd", "lbfgs", "lbfgs", "adam"]}
    )
    assert share_of("adam", table, 1) == 1
    assert share_of("lbfgs", table, 2) == 0.5
    assert share_of("lbfgs", table.iloc[[0, 2, 3, 1, 4]], 2) == 0.5


# Studies


def test_studies_of_databases_have_the_results_of_studies_of_the_world(data, tmp_path):
    with open_renderer(WORLD, EYE) as renderer:
        write_database(tmp_path / "grid", renderer, Grid.over(published_grid_area(WORLD.field), 0.2))
        write_database(tmp_path / "route", renderer, ROUTE.resampled(0.02).poses)
    read = data_of_databases(tmp_path / "grid", tmp_path / "route")
    assert read.digest == data.digest
    settings = StudySettings(quick=True)
    results = [run_studies(each, settings, tmp_path / name, FAST) for each, name in ((read, "a"), (data, "b"))]
    for name in FAST:
        a, b = (run[name].to_json() for run in results)
        del a["numbers"]["seconds"], b["numbers"]["seconds"]
        assert a == b


def test_databases_that_do_not_fit_a_study_are_refused(tmp_path):
    with open_renderer(WORLD, EYE) as renderer:
        write_database(tmp_path / "grid", renderer, Grid.over(published_grid_area(WORLD.field), 0.2))
        write_database(tmp_path / "route", renderer, ROUTE.resampled(0.1).poses)
        write_database(tmp_path / "fine", renderer, ROUTE.resampled(0.02).poses)
        write_database(tmp_path / "mirrored", renderer, BENDING.resampled(0.02).poses * [1, 1, -1] + [0, 0, np.pi / 2])
        write_database(tmp_path / "coarse", renderer, Grid(begin=(0.0, 0.0), spacing=0.1, size=(2, 2)))
    with open_renderer(WORLD, Eye(width=36, height=15, samples=1)) as renderer:
        write_database(tmp_path / "small", renderer, ROUTE.resampled(0.02).poses)
    cases = (
        ("route", "route", FileError, "route is a database of a route; give one of a grid"),
        ("grid", "small", FileError, r"different sizes \(36 x 15 and 72 x 15\)"),
        ("grid", "route", SettingError, "20 route views; a study needs at least 48"),
        ("grid", "mirrored", FileError, "headings are .* degrees off the path .*counter-clockwise from .x they fit"),
        ("coarse", "fine", SettingError, "0 grid positions lie within 0.2 m"),
    )
    for grid, route, kind, message in cases:
        with pytest.raises(kind, match=message):
            data_of_databases(tmp_path / grid, tmp_path / route)


def test_finished_studies_are_not_done_again_unless_damaged_or_with_other_views(data, tmp_path, log):
    settings = StudySettings(quick=True)
    first = run_studies(data, settings, tmp_path, FAST)
    assert sum("done in" in message for message in log.messages) == 3
    log.clear()
    again = run_studies(data, settings, tmp_path, FAST)
    assert [message.partition(": ")[2] for message in log.messages] == ["kept from before"] * 3
    assert [results.to_json() for results in again.values()] == [results.to_json() for results in first.values()]
    (damaged,) = tmp_path.glob("frequency-*.json")
    damaged.write_bytes(damaged.read_bytes()[:-100])
    log.clear()
    run_studies(data, settings, tmp_path, FAST)
    assert sum("kept from before" in message for message in log.messages) == 2
    assert any(f"{damaged} is damaged" in message for message in log.messages)
    log.clear()
    other = data_of_world(WORLD, generate_route(WORLD, 2, 2.0), EYE, spacing=0.02)
    run_studies(other, settings, tmp_path, FAST)
    assert sum("done in" in message for message in log.messages) == 3


def test_seeds_matter_only_where_something_is_random(data, tmp_path, log):
    run_studies(data, StudySettings(quick=True, seed=0), tmp_path, FAST)
    log.clear()
    run_studies(data, StudySettings(quick=True, seed=1), tmp_path, FAST)
    assert sum("kept from before" in message for message in log.messages) == 3
    random = {name for name, study in STUDIES.items() if study.random}
    assert random == {"classifier", "corners", "confidence", "beyond"}
    assert not set(StudySettings(seed=0).seeds) & set(StudySettings(seed=1).seeds)


def test_a_study_that_needs_the_tuning_runs_the_classifier_first(data, tmp_path, monkeypatch):
    order = []

    def recorded(name):
        def run(data, settings, progress, **needed):
            order.append((name, needed))
            tuning = {"tuning_whole_route": {"hidden_layer_sizes": [20]}}
            return StudyResults(tables={}, numbers=tuning if name == "classifier" else {})

        return run

    for name in ("classifier", "corners"):
        monkeypatch.setitem(STUDIES, name, dataclasses.replace(STUDIES[name], run=recorded(name)))
    run_studies(data, StudySettings(quick=True), tmp_path, ["corners"])
    assert order == [("classifier", {}), ("corners", {"tuning": {"hidden_layer_sizes": (20,)}})]


def test_errors_of_the_visual_compass_follow_from_its_headings(data, tmp_path):
    results = run_studies(data, StudySettings(quick=True), tmp_path, ["visual-compass"])["visual-compass"]
    around = results.tables["around"]
    from_reference = around["x_m"] - around["reference_x_m"], around["y_m"] - around["reference_y_m"]
    assert np.allclose(around["distance_m"], np.hypot(*from_reference))
    assert around["distance_m"].max() <= 0.5
    off = np.abs(wrap_angle(np.radians(around["heading_deg"] - around["set_heading_deg"])))
    assert np.allclose(np.degrees(off), around["error_deg"])


def test_every_text_of_the_figures_can_be_read_and_their_axes_fit_their_data(data, tmp_path):
    results = run_studies(data, StudySettings(quick=True), tmp_path, FAST)
    for item in FIGURES:
        if item.study in FAST:
            assert item.draw is not None
            with matplotlib.rc_context(STYLE):
                check_figure(item.draw(results[item.study], data))


# Claims about networks


def trained(short: float, long: float, narrow: float) -> StudyResults:
    """Results of the study of confidence: median errors (degrees) after a short and a long training, and with narrow scans."""
    medians = {(600, 360): short, (3000, 360): long, (3000, 180): (long + narrow) / 2, (3000, 90): narrow}
    rows = [
        {
            "iterations": n,
            "scan_deg": scan,
            "seed": seed,
            "median_error_deg": median,
            "high_share": n / 6000,
            "reversed_share": 0.5,
        }
        for (n, scan), median in medians.items()
        for seed in range(3)
    ]
    spread = np.linspace(-10, 10, 21)
    tables = {
        f"headings_{name}": pd.DataFrame({"error_deg": median + spread})
        for name, median in (("short", short), ("long", long), ("scan_90", narrow))
    }
    chance = pd.DataFrame({"scan_deg": [360, 180, 90], "median_error_deg": [90.0, 45, 22.5]})
    tables |= {"networks": pd.DataFrame(rows), "chance": chance}
    return StudyResults(tables=tables, numbers={"iterations": [600, 3000]})


def outcomes_of_training(results: StudyResults, *, quick: bool = False) -> dict[str, Outcome]:
    outcomes = check_claims(STUDIES["confidence"].claims, [results], quick=quick)
    return {each.claim.key: each for each in outcomes}


def test_a_network_that_is_worse_than_chance_supports_no_claim():
    """Errors that fall from 135 to 130 degrees, and with narrower scans to 60, are worse than those of random headings."""
    chance = outcomes_of_training(trained(135, 130, 60))
    better = outcomes_of_training(trained(110, 40, 10))
    for key in ("longer-training-helps", "longer-training-broadens", "narrower-scans-help"):
        assert chance[key].label == "does not hold", key
        assert better[key].label == "holds", key
    assert outcomes_of_training(trained(110, 40, 39))["narrower-scans-help"].label == "does not hold"


def test_a_quick_study_judges_no_network():
    quick = outcomes_of_training(trained(110, 40, 10), quick=True)
    assert {each.label for each in quick.values()} == {"not tested"}
    assert all("--quick" in each.reason for each in quick.values())
    networks = {claim.key for name in ("classifier", "confidence", "beyond") for claim in STUDIES[name].claims}
    judged = {claim.key for study in STUDIES.values() for claim in study.claims if not claim.not_quick}
    assert not networks & judged
    assert "idf-minimum" in judged


def test_effects_of_medians_by_hand():
    table, other = (pd.DataFrame({"error_deg": np.arange(9.0) + shift}) for shift in (0, 5))
    assert median_error("", table).value == 4
    fall = fall_of_median("", other, table)
    assert (fall.value, fall.units, fall.of) == (5, 9, "positions")
    apart = difference_of_medians("", table, np.arange(9) > 5)
    assert apart.value == 7 - 2.5
    assert apart.low < apart.value < apart.high
