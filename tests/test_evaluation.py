"""Heading errors: what they are made of, and the published study's results in the Sussex world."""

import numpy as np
import pytest

from tussock.navigation.encoding import Encoding
from tussock.navigation.evaluation import HeadingErrors, grid_positions, heading_errors, nearest_view
from tussock.navigation.models import PerfectMemory, make_model
from tussock.navigation.training import train, training_poses
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.errors import SettingError
from tussock.world.files import read_world
from tussock.world.geometry import Bounds, Route, wrap_angle
from tussock.world.route_files import read_route
from tussock.world.routes import generate_route
from tussock.world.scene import World

FIELD = Bounds(0, 0, 10, 10)
ROUTE = Route.through(np.array([[1.0, 1.0], [2.0, 1.3], [2.5, 2.2]])).resampled(0.05)


def test_grid_positions_are_the_multiples_near_the_route():
    positions = grid_positions(ROUTE, grid=0.2, within=0.25, field=FIELD)
    assert np.allclose(positions / 0.2, np.round(positions / 0.2))
    everywhere = np.stack(np.meshgrid(np.arange(51) * 0.2, np.arange(51) * 0.2), axis=-1).reshape(-1, 2)
    assert len(positions) == (ROUTE.nearest(everywhere)[0] <= 0.25).sum()
    inside = grid_positions(ROUTE, grid=0.2, within=0.25, field=Bounds(0, 0, 1.5, 10))
    assert inside[:, 0].max() <= 1.5


@pytest.mark.parametrize("settings", [{"grid": 0}, {"grid": np.nan}, {"grid": 1e-6}, {"grid": 5.0, "within": 0.01}])
def test_grids_without_positions_are_refused(settings):
    with pytest.raises(SettingError, match=f"{settings['grid']:g} m"):
        grid_positions(ROUTE, **({"grid": 0.2, "within": 0.2, "field": FIELD} | settings))


def test_place_recognition_takes_the_nearest_view():
    positions = np.random.default_rng(0).uniform(0, 4, (30, 2))
    for position, nearest in zip(positions, nearest_view(ROUTE, positions), strict=True):
        assert nearest == min(range(len(ROUTE.xy)), key=lambda i: np.hypot(*(ROUTE.xy[i] - position)))


@pytest.fixture(scope="module")
def tiny():
    with open_renderer(World.generate("tiny", 0), Eye(width=180, height=40, samples=2), "cpu") as renderer:
        yield renderer, generate_route(renderer.world, 0).resampled(0.05)


def test_on_the_route_itself_perfect_memory_makes_no_error(tiny):
    renderer, route = tiny
    encoding = Encoding.parse("grey")
    model = train(PerfectMemory(), encoding, renderer, route.poses).model
    result = heading_errors(model, encoding, renderer, route, route.xy)
    # Views face east, so their columns of 2 degrees lie between those of the learned views: a column either way.
    assert np.degrees(result.errors).max() <= 4
    assert result.median_error_deg < 1
    assert np.array_equal(result.nearest, np.arange(len(route.xy)))


def test_errors_are_between_the_recovered_and_the_nearest_views_heading(tiny):
    renderer, route = tiny
    encoding = Encoding.parse("grey | resize 3")
    model = make_model("visual-compass").fit(encoding(renderer.render(route.poses)))
    positions = grid_positions(route, grid=0.2, within=0.2, field=renderer.world.field)
    result = heading_errors(model, encoding, renderer, route, positions)
    assert np.allclose(result.errors, np.abs(wrap_angle(result.headings - route.poses[result.nearest, 2])))
    degrees = np.degrees(result.errors)
    assert (result.median_error_deg, result.mean_error_deg) == (np.median(degrees), np.mean(degrees))
    assert result.share_over_45 == (degrees > 45).mean()
    narrow = heading_errors(model, encoding, renderer, route, positions, scan=np.radians(90))
    assert np.degrees(narrow.errors).max() <= 45 + 6


def test_bands_of_distance_hold_each_position_once(tiny):
    renderer, route = tiny
    encoding = Encoding.parse("grey | resize 3")
    model = train(PerfectMemory(), encoding, renderer, route.poses).model
    positions = grid_positions(route, grid=0.1, within=0.2, field=renderer.world.field)
    errors = heading_errors(model, encoding, renderer, route, positions)
    segments = np.linspace(0, 1, 101)[:, None, None]
    points = (route.xy[:-1] + segments * np.diff(route.xy, axis=0)).reshape(-1, 2)
    brute = np.hypot(*(positions[:, None] - points).transpose(2, 0, 1)).min(axis=1)
    assert np.allclose(errors.distances, brute, atol=1e-3)
    bands = errors.by_distance()
    assert list(bands) == ["0 to 5 cm", "5 to 10 cm", "10 to 15 cm", "15 to 20 cm"]
    for k, band in enumerate(bands.values()):
        within = errors.distances <= 0.05 * (k + 1)
        assert len(band) == (within & (errors.distances > (0.05 * k if k else -1))).sum() > 5
        assert np.allclose(band.errors, np.abs(wrap_angle(band.headings - route.poses[band.nearest, 2])))
    together = np.concatenate([band.positions for band in bands.values()])
    assert sorted(map(tuple, together)) == sorted(map(tuple, positions))
    total = sum(len(band) * band.mean_error_deg for band in bands.values())
    assert np.isclose(total / len(errors), errors.mean_error_deg)


def test_a_distance_between_two_bands_belongs_to_the_nearer_one():
    distances = np.array([0.0, 0.05, 0.05 + 1e-6, 0.1, 3 * 0.05, 0.4])
    n = len(distances)
    errors = HeadingErrors(
        positions=np.zeros((n, 2)), headings=np.zeros(n), nearest=np.zeros(n, int), errors=np.arange(n) / 10,
        distances=distances,
    )  # fmt: skip
    bands = {name: band.distances.tolist() for name, band in errors.by_distance().items()}
    assert bands == {
        "0 to 5 cm": [0.0, 0.05], "5 to 10 cm": [0.05 + 1e-6, 0.1], "10 to 15 cm": [3 * 0.05], "35 to 40 cm": [0.4]
    }  # fmt: skip


@pytest.mark.parametrize("name", ["ant1_route1", "ant4_route1"])
def test_the_sussex_routes_give_the_results_of_the_study(sussex, name):
    world = read_world(sussex / "world5000_gray.bin")
    route = read_route(sussex / f"{name}.bin").resampled(0.04)
    positions = grid_positions(route, grid=0.2, within=0.2, field=world.field)
    with open_renderer(world, backend="cpu") as renderer:

        def errors(encoding: Encoding, every: int):
            model = train(PerfectMemory(), encoding, renderer, training_poses(route, 0.04, every=every)).model
            return heading_errors(model, encoding, renderer, route, positions)

        grey = errors(Encoding.named("grey", resize=6), 6)
        assert 8 < grey.median_error_deg < 20
        assert 35 < grey.mean_error_deg < 55
        edges = errors(Encoding.named("edges", resize=3), 1)
        assert edges.median_error_deg < 3.5
        assert edges.mean_error_deg < 14
