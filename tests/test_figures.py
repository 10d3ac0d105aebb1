"""Figures of reports: every text can be read, and the axes fit what they show."""

from collections.abc import Iterator

import matplotlib
import numpy as np
import pandas as pd
import pytest
from figure_laws import check_figure, drawn_texts

from tussock.navigation import models
from tussock.navigation.reports.drawing import (
    STYLE,
    canvas,
    draw_lines,
    from_zero,
    legend_above,
)
from tussock.navigation.reports.layout import fit_texts
from tussock.navigation.studies.protocols.figures import boxes_by_model, lines_by_model, means_by_model
from tussock.navigation.studies.protocols.intervals import intervals
from tussock.navigation.studies.thesis.heading_maps import heading_maps
from tussock.navigation.studies.thesis.study_data import StudyData
from tussock.navigation.sweeps.figures import along_axis
from tussock.navigation.sweeps.model_colours import MODEL_COLOURS, model_colour, model_markers
from tussock.navigation.sweeps.store import table_of
from tussock.world.geometry import Route

MODELS = [
    "perfect-memory",
    "mushroom-body inputs=10 cells=20000 share=0.05",
    "infomax rate=unit-range",
    "random",
    "chain",
    "rbm",
]


@pytest.fixture(autouse=True)
def style() -> Iterator[None]:
    """Figures as in reports."""
    with matplotlib.rc_context(STYLE):
        yield


def data_along(across: float, up: float) -> tuple[StudyData, pd.DataFrame]:
    """Views along a straight route, and headings on both sides of it."""
    way = np.linspace((0, 0), (across, up), 60)
    route = Route.through(way)
    blank = np.zeros((60, 2, 4, 3), np.uint8)
    poses = route.poses + (0.05, 0.05, 0)
    data = StudyData(route=route, route_views=blank, poses=poses, grid_views=blank, grid=poses[:, :2], world=None)
    error = np.linspace(0, 180, 60)
    columns = {
        "x_m": poses[:, 0],
        "y_m": poses[:, 1],
        "heading_deg": np.degrees(poses[:, 2]) + error,
        "error_deg": error,
    }
    return data, pd.DataFrame(columns)


@pytest.mark.parametrize(("across", "up"), [(0.2, 8.0), (8.0, 0.2), (4.0, 3.0), (0.3, 0.3)])
@pytest.mark.parametrize("maps", [1, 2, 3])
def test_maps_of_routes_of_any_shape_have_room_for_their_titles(across, up, maps):
    data, table = data_along(across, up)
    titles = {f"map {k}": f"the classifier of the whole route after {10**k:,} iterations" for k in range(maps)}
    check_figure(heading_maps(dict.fromkeys(titles, table), data, titles))


@pytest.mark.parametrize("models", [1, 3, 6])
def test_figures_of_protocols_have_every_model(models):
    rows = [
        {"model": model, "offset": offset, "errors": 3.0 * number + offset + 0.2 * place, "place": place}
        for number, model in enumerate(MODELS[:models])
        for offset in (1, 2, 2, 5)
        for place in range(6)
    ]
    walks = pd.DataFrame(rows)
    lines = lines_by_model(
        walks, "offset", "errors", "displacement of the start (cm)", "errors per walk", diagonal=True
    )
    check_figure(lines)
    shown = {text.get_text() for text in drawn_texts(lines)}
    assert set(MODELS[:models]) <= shown
    check_figure(boxes_by_model(walks, "errors", "errors per walk"))
    means = means_by_model(intervals(walks, {"errors": "number of errors"}), "number of errors", "errors per walk")
    check_figure(means)
    assert set(MODELS[:models]) <= {text.get_text() for text in drawn_texts(means)}


@pytest.mark.parametrize(
    "choices", [MODELS, [0.0, 0.001, 0.5], list(range(20)), [f"a choice with number {k}" for k in range(24)]]
)
def test_figures_of_sweeps_have_room_for_all_choices(choices):
    rows = [
        {"model": model, "choice": choice, "world": "tiny", "world_seed": k, "seed": k, "route": None, "route_seed": None,
         "arrived": k > 1, "mean_deviation_m": 0.001 * k, "mean_error_deg": 5.0 + k}
        for model in MODELS for choice in choices for k in range(6)
    ]  # fmt: skip
    table = table_of({str(k): row for k, row in enumerate(rows)})
    check_figure(along_axis(table, ["choice"], ["arrived", "mean_deviation_m", "mean_error_deg"], ["model"]))
    check_figure(along_axis(table, ["model"], ["arrived"], []))


def test_an_axis_from_zero_shows_what_is_drawn_later_and_on_axes_that_share_it():
    figure, axes = canvas((6, 2), 1, 3, sharey=True)
    for number, axis in enumerate(axes[0]):
        axis.plot([0, 1], [100.0**number, 2 * 100.0**number])
        from_zero(axis)
        axis.plot([0, 1], [3 * 100.0**number] * 2)
    check_figure(figure)
    assert axes[0, 0].get_ylim() == pytest.approx((0, 30_000 * 1.05))


def test_small_errors_fill_their_axis():
    figure, axes = canvas((6, 3))
    for number in range(2):
        draw_lines(axes[0, 0], [1, 2, 3], {f"a line with number {number}": ([5.0, 3, 20 * number], "red", "o-")})
    legend_above(axes[0, 0])
    check_figure(figure)


def test_a_figure_that_is_large_enough_keeps_its_size():
    figure, axes = canvas((6, 3))
    axes[0, 0].plot([0, 1])
    axes[0, 0].set_title("short")
    fit_texts(figure)
    assert figure.get_size_inches().tolist() == [6, 3]


def test_a_model_has_one_colour_whatever_stands_beside_it():
    colours = {name: model_colour(name) for name in models.MODELS.builtin}
    assert len(set(colours.values())) == len(colours)
    assert model_colour("infomax units=20") == colours["infomax"]
    assert model_colour("my.package:Model") == model_colour("my.package:Model power=2") in MODEL_COLOURS
    assert model_markers(["chain", "infomax", "chain every=2", "infomax units=3"]) == ["o", "o", "s", "s"]


def test_a_point_on_an_axis_of_numbers_is_at_its_number():
    runs = [
        {"model": model, "offset_m": offset, "world": "tiny", "seed": seed, "world_seed": seed, "route": None, "route_seed": None,
         "arrived": True, "error": None}
        for model in ("chain", "infomax") for offset in (0.0, 0.1) for seed in range(3)
    ]  # fmt: skip
    figure = along_axis(pd.DataFrame(runs), ["offset_m"], ["arrived"], ["model"])
    drawn = [np.array(line.get_xdata()) for line in figure.axes[0].lines]
    assert len(drawn) >= 2
    assert all(np.isin(places, [0.0, 0.1]).all() for places in drawn)
