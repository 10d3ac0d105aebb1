"""apiaviz2026: its steps of colour against torch and scipy, its model against plain loops, its statistics, and its numbers by hand."""

import dataclasses
import itertools
import math

import numpy as np
import pandas as pd
import pytest
import torch
from scenes import random_poses, random_world
from scipy import ndimage

from tussock.navigation import training
from tussock.navigation.encoding import Encoding
from tussock.navigation.encoding_steps_colour import COLOUR_STEPS, _filtered, _hexagonal
from tussock.navigation.models import SpikeOverlap, make_model
from tussock.navigation.models.spike_overlap import averaging, first_to_fire
from tussock.navigation.reports.claims import check_claims
from tussock.navigation.steering import NAVIGATORS, Look
from tussock.navigation.studies.protocols import APIAVIZ2026, routes_in
from tussock.navigation.studies.protocols.apiaviz2026 import ANTS, INPUTS, PUBLISHED, SEEDS, coloured
from tussock.navigation.studies.protocols.crossed import crossed_interval
from tussock.navigation.studies.protocols.protocol import prepared, route_files
from tussock.navigation.training import training_poses
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.errors import FileError, SettingError
from tussock.world.files import read_world, write_world
from tussock.world.geometry import Route, rounded

RANDOM = np.random.default_rng(1)


@pytest.fixture(scope="module")
def views():
    with open_renderer(random_world(), Eye(width=60, height=12, samples=1, z=0.05), "cpu") as renderer:
        return renderer.render(random_poses(5))


def unrounded(chain, views):
    """What the steps of an encoding make of views."""
    for step in Encoding.parse(chain).steps:
        views = step(views)
    return views


def planes_of(views, name):
    """The five planes (n, 5, h, w) of an input."""
    images = unrounded(INPUTS[name], views)
    return images.reshape(len(images), 5, -1, images.shape[2])


# Steps of the encodings


@pytest.mark.parametrize("name", INPUTS)
def test_rolling_the_view_rolls_the_planes(views, name):
    chain = Encoding.parse(INPUTS[name])
    turned = chain(np.roll(views, 6, axis=2)).numpy()  # a tile of CLAHE
    away = np.abs(turned - np.roll(chain(views).numpy(), 6, axis=2))
    assert away.max() < (1.01 / 255 if "clahe" in INPUTS[name] else 1e-5)


@pytest.mark.parametrize("pixel", [1, 2, 3])
def test_a_filter_is_scipys_correlation_on_each_ring(pixel):
    images, kernel = RANDOM.random((2, 7, 12)).astype(np.float32), RANDOM.random((5, 3))
    filtered = _filtered(images, kernel, pixel)
    for image, other in zip(images, filtered, strict=True):
        for start in range(pixel):
            ring = image[:, start::pixel].astype(float)
            rows = ndimage.correlate(np.pad(ring, ((0, 0), (3, 3)), mode="wrap"), kernel, mode="mirror")[:, 3:-3]
            assert np.allclose(other[:, start::pixel], rows, atol=1e-6)


def test_a_point_reaches_its_six_neighbours_in_a_hexagonal_grid():
    for row in (4, 5):
        image = np.zeros((1, 10, 8), dtype=np.float32)
        image[0, row, 3] = 6
        reached = {(int(y), int(x)) for y, x in np.argwhere(_hexagonal(image, 1)[0])}
        side = (
            -1 if row % 2 else 1
        )  # neighbours above and below are in rows of the other parity, which are shifted by half a pixel
        assert reached == {(row, 2), (row, 4), (row - 1, 3), (row + 1, 3), (row - 1, 3 + side), (row + 1, 3 + side)}
    flat = np.full((1, 6, 8), 0.7, dtype=np.float32)
    assert np.allclose(_hexagonal(flat, 2), flat)


def receptors(views):
    """Green and blue (n, 2, h, w), 0..1."""
    return torch.from_numpy(views[..., 1:3].astype(np.float32) / 255).movedim(-1, 1)


def padded(images, rows, columns):
    """As the steps pad: around the ring, and mirrored at top and bottom."""
    wrapped = torch.nn.functional.pad(images, (columns, columns, 0, 0), mode="circular")
    return torch.nn.functional.pad(wrapped, (0, 0, rows, rows), mode="reflect")


def convolved(images, kernel):
    size = kernel.shape[-1] // 2
    return torch.nn.functional.conv2d(padded(images, size, size), kernel[None, None].float())


def bell(size, sigma):
    axis = torch.arange(size) - size // 2
    kernel = torch.exp(-(axis[:, None] ** 2 + axis**2) / (2 * sigma**2))
    return kernel / kernel.sum()


def test_simple_planes(views):
    light = receptors(views)
    green, blue = light.numpy()[:, 0], light.numpy()[:, 1]
    mean = (green + blue) / 2
    opponent = [np.maximum(green - blue, 0), np.maximum(blue - green, 0)]
    for name, planes in {
        "grey": [mean] * 5,
        "raw colour": [mean, green, blue, green, blue],
        "opponency": [mean] * 3 + opponent,
    }.items():
        assert np.allclose(planes_of(views, name), np.stack(planes, axis=1), atol=1e-6), name


def test_edges_of_the_control_with_edges(views):
    """Of pixels that are one column apart, against torch."""
    images = unrounded("green-blue | sobel-planes 1", views).reshape(len(views), 5, -1, 60)
    smooth = convolved(receptors(views).mean(dim=1, keepdim=True), bell(5, 1.0))
    sobel = torch.tensor([[-1.0, 0, 1], [-2, 0, 2], [-1, 0, 1]]) / 8
    x, y = convolved(smooth, sobel)[:, 0].numpy(), convolved(smooth, sobel.T)[:, 0].numpy()
    assert np.allclose(images[:, 0], x, atol=1e-5)
    assert np.allclose(images[:, 1], y, atol=1e-5)
    assert np.allclose(images[:, 2], np.hypot(x, y), atol=1e-5)


def test_the_planes_of_apiaviz(views):
    """Local adaptation, centre and surround and opponent colours against torch; hexagonal averages have their own test."""
    images = unrounded("green-blue | apia-planes 1", views).reshape(len(views), 5, -1, 60)
    light = receptors(views).numpy()
    green, blue = (torch.from_numpy(_hexagonal(light[:, k].copy(), 1))[:, None] for k in (0, 1))
    mean = (green + blue) / 2
    around = convolved(mean, torch.full((9, 9), 1 / 81))
    adapted = torch.tanh(2 * (mean - around) / (around.abs() + 0.05))
    difference = bell(5, 1.0) - bell(5, 2.5)
    contrast = convolved(adapted, difference / difference.norm())
    smooth = convolved(adapted, bell(5, 1.0) / bell(5, 1.0).norm())
    opponent = torch.tanh(2 * (green - around)) - torch.tanh(2 * (blue - around))
    expected = torch.cat([contrast.relu(), (-contrast).relu(), smooth, opponent.relu(), (-opponent).relu()], dim=1)
    assert np.allclose(images, expected.numpy(), atol=2e-5)


def test_planes_of_another_number_are_refused(views):
    for chain in ("grey | apia-planes 1", "grey | luminance", "green-blue | grey-planes | colour-planes"):
        with pytest.raises(SettingError, match="takes 2 planes"):
            Encoding.parse(chain)(views[:, :11])
    with pytest.raises(SettingError, match="whole number"):
        Encoding.parse("green-blue | sobel-planes 1.5")
    assert {step.name for step in COLOUR_STEPS} >= {"green-blue", "apia-planes"}


# The model


def integrated(drive):
    """When a leaky cell fires (ms), in small steps."""
    step, voltage, time = 1e-3, 0.0, 0.0
    while voltage < 1 and time < 60:
        voltage += step * (1 + 0.1 * drive - voltage) / 10
        time += step
    return time if voltage >= 1 else math.inf


def solved(drive):
    """The same, by the formula."""
    return 10 * math.log1p(1 / (0.1 * drive))


def spikes_by_loops(drive, active, fires=solved):
    """Which of some cells fire, until inhibition arrives. fires: when a cell does."""
    times = [math.ceil(fires(each)) if each > 0 else math.inf for each in drive]
    stop = sorted(times)[max(1, round(active * len(drive))) - 1] + 1
    return [time <= min(stop, 50) for time in times]


def test_cells_race_to_fire_as_leaky_integrators_do():
    drive = torch.tensor(
        [[0.05, 3.03, 2.1, 0.52, -1.0, 0.0, 1.23, 0.81, 2.95, 4.4, 3.9, 3.4]]
    )  # spikes at 12, 13, 14 ms, ..
    for active in (0.1, 0.3, 0.6):
        assert first_to_fire(drive, active)[0].tolist() == spikes_by_loops(drive[0].tolist(), active, integrated)


def test_averages_overlap_where_fields_share_a_pixel():
    assert averaging(2, 3).tolist() == [[0.5, 0.5, 0], [0, 0.5, 0.5]]
    assert averaging(3, 2).tolist() == [[1, 0], [0.5, 0.5], [0, 1]]
    assert torch.equal(averaging(4, 4), torch.eye(4))
    for fields, pixels in ((64, 74), (8, 18), (8, 10)):
        pooled = torch.nn.functional.adaptive_avg_pool1d(torch.eye(pixels)[None], fields)[0].T
        assert torch.allclose(averaging(fields, pixels), pooled, atol=1e-6)


def small_model(**parameters) -> SpikeOverlap:
    return make_model(
        "spike-overlap",
        **{"planes": (3, 2), "columns": 8, "rows": 2, "cells": 60, "inputs": 4, "active": 0.1} | parameters,
    )


def codes_by_loops(model, view):
    """The cells that fire at a view, from the learned wiring, cell by cell. view: (h, w) as the eye faces it."""
    width = view.shape[1]
    count = round(model.field / (2 * math.pi) * width)
    columns = range((width - count) // 2, (width - count) // 2 + count, model.pixel)
    planes = np.array_split(view[:, list(columns)], 5)
    pool = torch.nn.functional.adaptive_avg_pool2d
    pooled = [pool(torch.from_numpy(plane)[None], (model.rows, model.columns))[0].numpy().ravel() for plane in planes]
    fired = []
    for stream, cells in ((pooled[:3], range(30)), (pooled[3:], range(30, 60))):
        inputs = np.concatenate(stream)
        inputs = (inputs - inputs.mean()) / (inputs.std(ddof=1) + 1e-6)
        drive = [
            sum(inputs[i] * w for i, w in zip(model.learned["wiring"][c], model.learned["weights"][c], strict=True))
            for c in cells
        ]
        fired += spikes_by_loops([float(each) for each in drive], model.active)
    return np.array(fired)


@pytest.mark.parametrize("parameters", [{}, {"field": math.radians(300), "pixel": 2}])
def test_familiarity_is_the_overlap_of_codes_by_loops(parameters):
    random = np.random.default_rng(4)
    views = random.random((3, 20, 24)).astype(np.float32)
    model = small_model(**parameters).fit(torch.from_numpy(views))
    learned = [codes_by_loops(model, view) for view in views]
    assert np.array_equal(model.learned["codes"].numpy(), learned)
    probe = random.random((20, 24)).astype(np.float32)
    familiarity, index = model.match(torch.from_numpy(probe)[None])
    for k in (0, 1, 11, 23):
        code = codes_by_loops(model, np.roll(probe, k, axis=1))
        overlaps = [(code & other).sum() / math.sqrt(code.sum() * other.sum()) for other in learned]
        assert familiarity[0, k] == pytest.approx(max(overlaps), abs=1e-6)
        assert overlaps[index[0, k]] == max(overlaps)


def test_views_that_are_not_so_many_planes_are_refused():
    with pytest.raises(SettingError, match="not 5 planes"):
        small_model().fit(torch.rand(2, 12, 24))
    with pytest.raises(SettingError, match="inputs is 40, of 32 fields"):
        small_model(inputs=40).fit(torch.rand(2, 20, 24))


def test_a_flat_view_lets_no_cell_fire():
    model = small_model().fit(torch.rand(2, 20, 24))
    assert (model.scan(torch.zeros(1, 20, 24)) == -1).all()


# The navigator, and what is learned


def test_a_stepped_scan_turns_by_whole_steps():
    views = torch.from_numpy(np.random.default_rng(0).random((6, 4, 36)).astype(np.float32))
    model = make_model("perfect-memory").fit(views[:3])
    navigator = NAVIGATORS.spec("stepped-scan width_deg=120 step_deg=20").make(model=model)
    motion = navigator.decide(Look(views=views, compass=np.zeros(6)), [None] * 6)
    steps = np.degrees(motion.turn) / 20
    assert np.allclose(steps, steps.round())
    assert (np.abs(np.degrees(motion.turn)) <= 60 + 1e-9).all()
    assert motion.scan is not None
    assert (motion.scan.window.sum(axis=1) == 7).all()
    familiarity = motion.scan.familiarity
    for row, turn in enumerate(motion.turn):
        allowed = {k: familiarity[row, k % 36] for k in range(-6, 7, 2)}
        assert familiarity[row, round(np.degrees(turn) / 10) % 36] == max(allowed.values())


def test_parallel_views_lie_side_by_side_and_face_along_the_route():
    route = Route.through(np.array([[0.0, 0], [1, 0], [1, 1]]))
    on_route = training_poses(route, 0.1)
    poses = training_poses(route, 0.1, learning_walk=0.2, parallel=9).reshape(-1, 9, 3)
    assert np.allclose(poses[:, -1], on_route)  # last, so that the last view of all is the route's own
    assert np.array_equal(poses, rounded(poses))
    assert np.allclose(poses[..., 2], on_route[:, None, 2])
    left = np.column_stack([-np.sin(on_route[:, 2]), np.cos(on_route[:, 2])])
    for k, offset in enumerate([-0.2, 0.2, -0.15, 0.15, -0.1, 0.1, -0.05, 0.05, 0]):
        assert np.allclose(poses[:, k, :2], on_route[:, :2] + offset * left)
    assert np.allclose(training_poses(route, 0.1, learning_walk=0.2, parallel=1), on_route)


def test_parallel_views_without_a_reach_are_a_remark(caplog):
    training._remark_on_parallel_views.cache_clear()
    route = Route.through(np.array([[0.0, 0], [1, 0]]))
    assert np.array_equal(training_poses(route, 0.1, parallel=9), training_poses(route, 0.1))
    (record,) = caplog.records
    assert "--learning-walk-m" in record.message


# Statistics


def test_a_crossed_interval_is_that_of_drawing_routes_and_seeds():
    values = np.random.default_rng(5).normal(size=(8, 5)) + np.arange(8)[:, None]
    random = np.random.default_rng(9)
    means = [values[np.ix_(random.integers(8, size=8), random.integers(5, size=5))].mean() for _ in range(20_000)]
    assert crossed_interval(values) == pytest.approx(np.quantile(means, [0.025, 0.975]), abs=0.05)
    assert np.isnan(crossed_interval(values[:4])).all()
    assert crossed_interval(np.full((6, 3), 2.0)) == pytest.approx((2.0, 2.0))


# The protocol


def walks_of(shares: dict[str, float], deviations: dict[str, float]) -> pd.DataFrame:
    """Eight routes and five seeds: the first of the walks of each input arrive."""
    rows = []
    for name, chain in INPUTS.items():
        pairs = list(itertools.product(range(8), SEEDS))
        for k, (route, seed) in enumerate(pairs):
            rows.append(
                (
                    str(Encoding.parse(chain)),
                    f"route {route}",
                    seed,
                    k < shares[name] * len(pairs),
                    deviations[name] + 0.01 * route,
                )
            )
    columns = ["encoding", "place", "seed", "arrived", "mean_deviation_m"]
    return pd.DataFrame(rows, columns=columns).assign(model="spike-overlap", steps=90)


def test_numbers_by_hand():
    shares = {name: count / 40 for name, (count, _) in PUBLISHED.items()}
    deviations = {name: cm / 100 for name, (_, cm) in PUBLISHED.items()}
    results = APIAVIZ2026.measure(walks_of(shares, deviations))
    table = results.tables["by_input"].set_index("input")
    assert table["completed"].to_dict() == pytest.approx(shares)
    assert (table["completed walks"] == table["completed of 40, published"]).all()
    assert table.loc["grey", "mean deviation (cm)"] == pytest.approx(63.38 + 3.5)
    differences = results.tables["differences"].set_index("input")
    assert differences.loc["raw colour", "obtained (cm)"] == pytest.approx(38.00 - 55.22)
    assert (differences["p (Holm)"] == 5 * 2 / 256).all()
    holds = {each.claim.key: each.holds[0] for each in check_claims(APIAVIZ2026.claims, [results])}
    assert holds == {"counts-repeat": True, "ardin-least": True, "no-input-differs": False}


def test_two_routes_decide_nothing_about_counts():
    shares = dict.fromkeys(INPUTS, 0.5)
    walks = walks_of(shares, shares)
    results = APIAVIZ2026.measure(walks[walks["place"].isin(["route 0", "route 1"])])
    holds = {each.claim.key: each.holds[0] for each in check_claims(APIAVIZ2026.claims, [results])}
    assert holds == {"counts-repeat": None, "ardin-least": None, "no-input-differs": None}
    assert results.tables["by_input"]["completed, low"].isna().all()


def test_it_is_as_published():
    runs = list(APIAVIZ2026.sweep(routes_in("tiny", [], count=2)).experiments)
    assert len(runs) == 2 * 6 * 5
    assert APIAVIZ2026.worlds == len(ANTS) == 8
    run = runs[0]
    assert (run.training.spacing, run.training.learning_walk, run.training.parallel_views) == (0.1, 0.2, 9)
    assert (run.body.step_length, run.stopping.arrival_radius, run.stopping.max_steps) == (0.1, 0.2, 200)
    assert not run.stopping.put_back
    model = run.make_model()
    assert (model.cells, model.inputs, model.rows, model.columns, model.planes) == (8000, 10, 8, 64, (3, 2))
    assert len(range(0, round(model.field / (2 * math.pi) * run.eye.width), model.pixel)) == 74
    assert np.degrees(run.eye.elevations())[[0, -1]] == pytest.approx([60, -15])
    assert {each.seed for each in runs} == set(SEEDS)


def green_world():
    """A world in shades of green, as those of AntWorld are."""
    world = random_world()
    shades = np.zeros_like(world.rgb)
    shades[:, 1] = np.random.default_rng(2).integers(20, 250, len(shades))
    return dataclasses.replace(world, rgb=shades, texturing=None)


def test_tints_change_colour_and_not_brightness():
    world = green_world()
    painted = coloured(world)
    shade = world.rgb[:, 1].astype(float)
    light = 255 * (shade - shade.min()) / np.ptp(shade)
    red, green, blue = painted.rgb.astype(float).T
    assert np.allclose(red, light, atol=0.51)
    inside = (light > 61) & (light < 194)  # where nothing is cut off
    assert np.allclose((green + blue)[inside] / 2, light[inside], atol=1.01)
    assert set(np.round((green - blue)[inside] / 2).astype(int)) <= {-60, 0, 60}
    assert 0.2 < np.mean(green != blue) < 0.8
    assert np.array_equal(coloured(world).rgb, painted.rgb)
    assert coloured(painted) is painted  # has colours already


def test_the_coloured_world_is_kept_in_the_folder(tmp_path):
    write_world(green_world(), tmp_path / "green.glb")
    given = routes_in(str(tmp_path / "green.glb"), [], count=2)
    one, other = prepared(APIAVIZ2026, given, tmp_path / "out")
    assert one["world"] == other["world"]
    assert np.array_equal(read_world(one["world"]).rgb, coloured(read_world(tmp_path / "green.glb")).rgb)
    assert prepared(APIAVIZ2026, given, tmp_path / "out") == [one, other]
    assert prepared(APIAVIZ2026, routes_in("tiny", []), tmp_path / "out") == routes_in("tiny", [])


def test_routes_are_taken_of_a_folder(tmp_path, caplog):
    world = tmp_path / "world.bin"
    for name in ("ant4_route1.csv", "ant4_route2.csv", "notes.md", "world.bin"):
        (tmp_path / name).write_text("x")
    other = tmp_path / "other"
    other.mkdir()
    assert [each.name for each in route_files([tmp_path], (), world)] == ["ant4_route1.csv", "ant4_route2.csv"]
    assert [each.name for each in route_files([tmp_path, world], APIAVIZ2026.route_names, world)] == [
        "ant4_route2.csv",
        "world.bin",
    ]
    assert "1 of the 8 published routes" in caplog.text
    with pytest.raises(FileError, match="has no route file"):
        route_files([other])
