"""The studies' parts against laws, other libraries' numbers and the thesis's own."""

import json

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from matplotlib.cbook import boxplot_stats
from sklearn.model_selection import ParameterGrid

from tussock.navigation.encoding import Encoding
from tussock.navigation.models import make_model
from tussock.navigation.reports.findings import Claim, Findings, plain, read_findings, write_findings
from tussock.navigation.reports.page import cell
from tussock.navigation.studies.thesis import published
from tussock.navigation.studies.thesis.classifier import FIRST, held_out_views
from tussock.navigation.studies.thesis.confidence import _chance
from tussock.navigation.studies.thesis.corners import corner_section, corner_views, equally_different, turning
from tussock.navigation.studies.thesis.grid_search import share_of
from tussock.navigation.studies.thesis.headings import box_of, errors_of, headings
from tussock.navigation.studies.thesis.material import Material, material_of_databases, material_of_world
from tussock.navigation.studies.thesis.settings import Settings
from tussock.navigation.studies.thesis.thesis import STUDIES, run_studies
from tussock.navigation.studies.thesis.visual_compass import _minima
from tussock.render.eye import Eye
from tussock.render.images.writing import Grid, published_grid_area, write_database
from tussock.render.renderer import open_renderer
from tussock.world.errors import InputError
from tussock.world.geometry import Route, wrap_angle
from tussock.world.routes import generate_route
from tussock.world.scene import World

EYE = Eye(width=72, height=15, samples=1)
WORLD = World.generate("tiny", 1)
ROUTE = generate_route(WORLD, 1, 2.0)
FAST = ("setting", "visual-compass", "frequency")


@pytest.fixture(scope="module")
def material() -> Material:
    return material_of_world(WORLD, ROUTE, EYE, spacing=0.02)


def bent(angle: float, leg: float = 2.0) -> Route:
    """Two straight legs with a turn of `angle` (rad) between them."""
    first = np.column_stack([np.arange(0, leg, 0.02), np.zeros(round(leg / 0.02))])
    second = (leg, 0) + np.arange(0, leg, 0.02)[:, None] * (np.cos(angle), np.sin(angle))
    return Route.through(np.vstack([first, second]))


# The thesis's own numbers


@pytest.mark.parametrize(("name", "row"), [("first_20", 206), ("whole_route", 713), ("more_in_corners", 403)])
def test_the_grids_are_the_ones_whose_rows_the_thesis_numbers(name, row):
    """The appendices print row numbers of scikit-learn's grid: the best tuning of each must be that row of ours."""
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


def test_views_that_were_learned_are_recovered_exactly(material):
    """At the very places and headings that perfect memory knows, every error is under half a column."""
    encoding = Encoding.parse("grey")
    chosen = np.arange(0, len(material.route.poses), 10)
    known = Material(
        route=material.route, route_views=material.route_views, places=material.route.poses[chosen],
        place_views=material.route_views[chosen], grid=material.grid, world=None,
    )  # fmt: skip
    memory = make_model("perfect-memory").fit(encoding(material.route_views))
    table = headings(known, memory, encoding(known.place_views), range(len(chosen)))
    assert table["error_deg"].max() < 2.5
    assert errors_of(table)["share_over_45"] == 0
    assert (table["nearest_view"] == chosen).all()


@pytest.mark.parametrize("scan_deg", [180.0, 90.0])
def test_a_narrow_scan_looks_about_the_general_direction(material, scan_deg):
    encoding = Encoding.parse("grey")
    memory = make_model("perfect-memory").fit(encoding(material.route_views[:1]))
    table = headings(material, memory, encoding(material.place_views), scan_deg=scan_deg)
    away = np.abs(wrap_angle(np.radians(table["heading_deg"]) - material.general_direction))
    assert np.degrees(away).max() <= scan_deg / 2 + 360 / EYE.width


def test_a_random_heading_in_a_window_about_the_right_one_is_a_quarter_of_it_off():
    straight = Route.through(np.column_stack([np.linspace(0, 2, 50), np.full(50, 1.0)]))
    places = np.column_stack([np.linspace(0.2, 1.8, 9), np.full((9, 1), 1.1), np.zeros(9)])
    blank = np.zeros((1, 4, 8, 3), np.uint8)
    known = Material(
        route=straight, route_views=blank.repeat(50, 0), places=places, place_views=blank.repeat(9, 0), grid=places[:, :2], world=None
    )  # fmt: skip
    chance = _chance(known).set_index("scan_deg")["median_error_deg"]
    assert np.allclose(chance[[360, 180, 90]], [90, 45, 22.5], atol=0.5)


@given(st.integers(1, 6), st.floats(0, 6), st.floats(5, 50))
def test_minima_of_waves_are_counted_around_the_ring(waves, phase, height):
    curve = 50 + height * np.cos(waves * np.arange(120) * 2 * np.pi / 120 + phase)
    assert _minima(curve) == waves


# Corners


@pytest.mark.parametrize("angle_deg", [30, 90, -120])
def test_turning_is_the_bend_at_the_bend_and_nothing_on_straights(angle_deg):
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


def test_a_straight_route_has_no_corners_and_still_a_part_to_look_at():
    straight = Route.through(np.column_stack([np.linspace(0, 3, 150), np.zeros(150)]))
    assert len(corner_views(straight)) == 0
    first, last = corner_section(straight)
    assert 0 <= first < last < 150


@given(hnp.arrays(float, st.integers(5, 80), elements=st.floats(0.1, 10)), st.integers(2, 20))
def test_equally_different_views_span_the_route_in_steps_of_like_size(steps, views):
    chosen = equally_different(steps, views)
    sums = np.r_[0, np.cumsum(steps)]
    assert chosen[0] == 0
    assert chosen[-1] == len(steps)
    assert len(chosen) <= views
    assert np.diff(sums[chosen]).max() <= sums[-1] / (views - 1) + steps.max() + 1e-6


def test_equal_steps_choose_evenly():
    assert equally_different(np.ones(20), 5).tolist() == [0, 5, 10, 15, 20]


def test_ties_in_a_search_are_not_decided_by_their_order():
    table = pd.DataFrame(
        {"mean_test_score": [0.9, 0.8, 0.8, 0.8, 0.7], "param_solver": ["adam", "sgd", "lbfgs", "lbfgs", "adam"]}
    )
    assert share_of("adam", table, 1) == 1
    assert share_of("lbfgs", table, 2) == 0.5
    assert share_of("lbfgs", table.iloc[[0, 2, 3, 1, 4]], 2) == 0.5


# Findings on disk


def example() -> Findings:
    claim = Claim(
        key="k", statement="s", figure="6", published={"a": 1.0}, obtained={"a": 1 / 3}, test="t", holds=True, note="n"
    )
    table = pd.DataFrame({"x": [1, 2], "y": [0.1, float("nan")], "name": ["a", "b"], "yes": [True, False]})
    return Findings(tables={"t": table}, numbers={"n": np.float64(0.1), "several": (1, 2)}, claims=[claim])


def test_findings_come_back_as_they_were(tmp_path):
    path = tmp_path / "f.json"
    write_findings(example(), path, "key")
    back = read_findings(path, "key")
    assert back is not None
    assert back.claims == example().claims
    pd.testing.assert_frame_equal(back.tables["t"], example().tables["t"])
    assert back.numbers == {"n": 0.1, "several": [1, 2]}
    assert read_findings(path, "another key") is None
    assert read_findings(tmp_path / "missing.json", "key") is None


@pytest.mark.parametrize("spoil", ["cut", "digit", "empty", "binary", "another shape"])
def test_damaged_findings_are_noticed(tmp_path, spoil):
    path = tmp_path / "f.json"
    write_findings(example(), path, "key")
    whole = path.read_bytes()
    path.write_bytes({
        "cut": whole[:-40], "digit": whole.replace(b"0.333", b"0.334"), "empty": b"", "binary": b"\xff\x00" * 9, "another shape": b"[1]",
    }[spoil])  # fmt: skip
    with pytest.raises(ValueError):  # noqa: PT011 (says why, whatever it is)
        read_findings(path, "key")


def test_plain_json_has_no_nan_and_no_numpy():
    value = plain({"a": np.float32(1.5), "b": [float("nan"), np.int64(2)], "c": (float("inf"), True)})
    assert json.loads(json.dumps(value, allow_nan=False)) == {"a": 1.5, "b": [None, 2], "c": [None, True]}


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.5, "0.5"), (12.0, "12"), (110.4, "110"), (float("nan"), "–"), (True, "yes"), (None, "–"), ([20, 20], "20, 20")],
)
def test_numbers_as_people_read_them(value, text):
    assert cell(value) == text


# Studies


def test_studies_of_databases_find_what_studies_of_the_world_find(material, tmp_path):
    with open_renderer(WORLD, EYE) as renderer:
        write_database(tmp_path / "grid", renderer, Grid.over(published_grid_area(WORLD.field), 0.2))
        write_database(tmp_path / "route", renderer, ROUTE.resampled(0.02).poses)
    read = material_of_databases(tmp_path / "grid", tmp_path / "route")
    assert read.digest == material.digest
    settings = Settings(quick=True)
    found = [run_studies(each, settings, tmp_path / name, FAST) for each, name in ((read, "a"), (material, "b"))]
    for name in FAST:
        a, b = (run[name].to_json() for run in found)
        del a["numbers"]["seconds"], b["numbers"]["seconds"]
        assert a == b


def test_databases_that_do_not_fit_a_study_are_refused(material, tmp_path):
    with open_renderer(WORLD, EYE) as renderer:
        write_database(tmp_path / "grid", renderer, Grid.over(published_grid_area(WORLD.field), 0.2))
        write_database(tmp_path / "route", renderer, ROUTE.resampled(0.1).poses)
        write_database(tmp_path / "fine", renderer, ROUTE.resampled(0.02).poses)
        write_database(tmp_path / "turned", renderer, ROUTE.resampled(0.02).poses + [0, 0, np.pi / 2])
        write_database(tmp_path / "coarse", renderer, Grid(begin=(0.0, 0.0), spacing=0.1, size=(2, 2)))
    with open_renderer(WORLD, Eye(width=36, height=15, samples=1)) as renderer:
        write_database(tmp_path / "small", renderer, ROUTE.resampled(0.02).poses)
    cases = (
        ("route", "route", "give one of a grid"),
        ("grid", "small", "different sizes"),
        ("grid", "route", "20 route views; a study needs at least 48"),
        ("grid", "turned", "headings are 8. degrees off the path"),
        ("coarse", "fine", "0 grid places lie within 0.2 m"),
    )
    for grid, route, why in cases:
        with pytest.raises(InputError, match=why):
            material_of_databases(tmp_path / grid, tmp_path / route)


def test_finished_studies_are_not_done_again_unless_damaged_or_of_something_else(material, tmp_path, capsys):
    settings = Settings(quick=True)
    first = run_studies(material, settings, tmp_path, FAST)
    assert capsys.readouterr().err.count("done in") == 3
    again = run_studies(material, settings, tmp_path, FAST)
    assert capsys.readouterr().err.count("kept from before") == 3
    assert [found.to_json() for found in again.values()] == [found.to_json() for found in first.values()]
    (damaged,) = tmp_path.glob("frequency-*.json")
    damaged.write_bytes(damaged.read_bytes()[:-100])
    run_studies(material, settings, tmp_path, FAST)
    said = capsys.readouterr().err
    assert "is damaged" in said
    assert said.count("kept from before") == 2
    other = material_of_world(WORLD, generate_route(WORLD, 2, 2.0), EYE, spacing=0.02)
    run_studies(other, settings, tmp_path, FAST)
    assert capsys.readouterr().err.count("done in") == 3


def test_seeds_matter_only_where_something_is_random(material, tmp_path, capsys):
    run_studies(material, Settings(quick=True, seed=0), tmp_path, FAST)
    capsys.readouterr()
    run_studies(material, Settings(quick=True, seed=1), tmp_path, FAST)
    assert capsys.readouterr().err.count("kept from before") == 3
    assert {name for name, study in STUDIES.items() if study.random} == {
        "classifier",
        "corners",
        "confidence",
        "beyond",
    }
    assert not set(Settings(seed=0).seeds) & set(Settings(seed=1).seeds)


def test_error_grows_around_a_snapshot_in_the_study(material, tmp_path):
    """The visual compass recovers nearly every heading within a decimetre: an independent look at its table."""
    around = run_studies(material, Settings(quick=True), tmp_path, ("visual-compass",))["visual-compass"].tables[
        "around"
    ]
    reference = around.iloc[0]
    assert np.isclose(
        reference["distance_m"],
        np.hypot(reference["x_m"] - reference["reference_x_m"], reference["y_m"] - reference["reference_y_m"]),
    )
    assert around["distance_m"].max() <= 0.5
    off = np.abs(wrap_angle(np.radians(around["heading_deg"] - around["set_heading_deg"])))
    assert np.allclose(np.degrees(off), around["error_deg"])
