"""Image differences, catchments and place recognition: laws, brute force, and what scikit-learn counts."""

import numpy as np
import pytest
import torch
from commands import printed, tussock
from hypothesis import given
from hypothesis import strategies as st
from quick_cases import quick
from scenes import views
from sklearn.metrics import average_precision_score

from tussock.navigation.encoding import Encoding
from tussock.navigation.measures.catchment import Landscape, catchment, landscape, positions_around
from tussock.navigation.measures.image_difference import (
    differences,
    displaced,
    rotational,
    spread,
    translational,
)
from tussock.navigation.measures.place_recognition import recognise
from tussock.navigation.measures.valley import valley, valley_of_rotations
from tussock.navigation.models import PerfectMemory
from tussock.render.eye import Eye
from tussock.render.images import Grid, write_database
from tussock.render.renderer import open_renderer
from tussock.world.errors import SettingError
from tussock.world.geometry import Pose, Route
from tussock.world.routes import generate_route
from tussock.world.scene import World

GREY = Encoding.parse("grey")


@pytest.fixture(scope="module")
def tiny():
    with open_renderer(World.generate("tiny", 0), Eye(width=90, height=20, samples=2), "cpu") as renderer:
        yield renderer, generate_route(renderer.world, 0, 2.0)


# Differences


def test_differences_are_those_of_rolled_views():
    some, others = views(3, 0), views(4, 1) + 5
    found = differences(some, others)
    for n in range(3):
        for m in range(4):
            for k in range(some.shape[2]):
                off = torch.roll(some[n], k, dims=1).double() - others[m].double()
                assert found[n, m, k] == pytest.approx(float(off.square().mean().sqrt()))


def test_a_view_differs_not_from_itself_and_turning_it_moves_the_minimum():
    some = views(1)
    assert differences(some, some)[0, 0].argmin() == 0
    assert differences(some, some)[0, 0, 0] < 1e-6
    assert (
        differences(torch.roll(some, -5, dims=2), some)[0, 0].argmin() == 5
    )  # turned right by 5: 5 to the left is back


def test_the_valley_of_a_triangle():
    x = np.linspace(-2, 2, 41)
    found = valley(x, 1 + 3 * np.abs(x))
    assert found.minimum == pytest.approx(1)
    assert found.depth == pytest.approx(6)
    assert found.width == pytest.approx(2)  # half the depth is reached 1 m to both sides
    assert valley(x, x).width is None  # which falls all the way to the border
    assert valley(x, np.ones(41)).width is None


@given(st.integers(0, 89))
def test_the_width_of_a_rotational_valley_does_not_depend_on_where_it_is(shift):
    turns = np.arange(90) * 2 * np.pi / 90
    curve = 2 - np.cos(turns)  # half the depth at a quarter turn to both sides
    found = valley_of_rotations(np.roll(curve, shift))
    assert (found.minimum, found.depth) == (pytest.approx(1), pytest.approx(2))
    assert found.width == pytest.approx(np.pi)


def test_displaced_poses_are_those_of_a_pose():
    poses = np.random.default_rng(0).uniform(-3, 3, (5, 3))
    for pose, moved in zip(poses.tolist(), displaced(poses, 0.3, -0.2).tolist(), strict=True):
        assert np.allclose(moved, Pose(*pose).moved(0.3, -0.2))


def test_the_rotational_function_in_a_world(tiny):
    renderer, route = tiny
    references = spread(route, 0.5)
    same, beside = rotational(renderer, GREY, references, [0, 0.1])
    assert same.curve[0] < 1e-6
    assert np.abs(same.errors).max() < 1e-6
    assert same.distance == 0
    assert beside.distance == pytest.approx(0.1)
    assert len(beside.valleys) == 2 * len(references)
    assert np.mean([each.depth for each in beside.valleys]) < np.mean([each.depth for each in same.valleys])
    images = GREY(renderer.render(references))
    moved = GREY(renderer.render(displaced(references, 0, 0.1)))
    first = [float((torch.roll(moved[0], k, 1) - images[0]).square().mean().sqrt()) for k in range(90)]
    assert beside.valleys[0].minimum == pytest.approx(min(first), abs=1e-6)


def test_the_translational_function_in_a_world(tiny):
    renderer, route = tiny
    found = translational(renderer, GREY, spread(route, 0.5), 0.3, steps=3)
    assert set(found) == {"ahead", "left"}
    for each in found.values():
        assert np.allclose(each.distances, np.linspace(-0.3, 0.3, 7))
        assert each.curve[3] == 0 < each.curve[2] < each.curve[0]


def test_points_of_a_route_are_spread():
    route = Route.through(np.array([[0.0, 0], [0.3, 0], [0.6, 0], [1.0, 0], [1.1, 0]]))
    assert spread(route, 0.5)[:, 0].tolist() == [0, 0.6, 1.1]


# Catchments


def bowl(n: int = 11, spacing: float = 0.1, hill: float = 0.0) -> Landscape:
    """The difference rises from the middle of a square; where there is a hill, falls again on the right."""
    x, y = np.meshgrid(*[(np.arange(n) - n // 2) * spacing] * 2)
    poses = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    distance = np.hypot(*poses[:, :2].T)
    difference = np.where(poses[:, 0] > 0.31, hill or 1, 1) * distance if hill else distance
    return Landscape(
        poses=poses,
        spacing=spacing,
        difference=difference,
        headings=poses[:, 2],
        right=poses[:, 2],
        distance=distance,
        homeward=np.arctan2(-poses[:, 1], -poses[:, 0]),
    )


def test_a_bowl_is_one_catchment():
    ground = bowl()
    found = catchment(ground)
    assert found.inside.all()
    assert found.area == pytest.approx(121 * 0.01)
    assert found.volume == pytest.approx(float((ground.difference.max() - ground.difference).sum() * 0.01))
    assert found.reach == pytest.approx(np.hypot(0.5, 0.5))
    away = ~ground.home
    off = np.abs(np.angle(np.exp(1j * (found.downhill - ground.homeward))))[away]
    assert np.degrees(off).max() < 45
    assert np.isnan(found.downhill[ground.distance.argmin()])


def test_beyond_a_ridge_nothing_leads_home():
    ground = bowl(hill=-1.0)
    assert np.array_equal(
        catchment(ground).inside, ground.poses[:, 0] < 0.21
    )  # next to the cliff, it is the steepest way


def test_every_descent_is_followed_to_its_end():
    """Against a walk, step by step, over random ground."""
    random = np.random.default_rng(0)
    ground = bowl()
    object.__setattr__(ground, "difference", ground.difference + random.uniform(0, 0.3, len(ground.poses)))
    xy, home, found = ground.poses[:, :2], ground.home, catchment(ground)
    for start in range(len(xy)):
        here = start
        while not home[here]:
            away = np.hypot(*(xy - xy[here]).T)
            near = np.flatnonzero((away > 0) & (away < 0.15))
            slope = (ground.difference[here] - ground.difference[near]) / away[near]
            if slope.max() <= 0:
                break
            here = int(near[slope.argmax()])
        assert found.inside[start] == home[here]
    assert 0 < found.inside.sum() < len(xy)


@pytest.mark.parametrize("best", [True, False])
def test_the_landscape_around_a_view(tiny, best):
    renderer, route = tiny
    pose = Pose(*route.at(1.0)[0].tolist())
    poses, spacing = positions_around(renderer, pose, grid=0.1, within=0.35)
    assert np.allclose(poses[:, :2] / 0.1, np.round(poses[:, :2] / 0.1))
    assert np.hypot(*(poses[:, :2] - pose[:2]).T).max() <= 0.35
    model = PerfectMemory().fit(GREY(renderer.render([pose])))
    ground = landscape(renderer, GREY, model, pose, poses, spacing, best=best)
    scans = differences(GREY(renderer.render(poses)), GREY(renderer.render([pose])))[:, 0]
    turn = int(np.rint(pose.heading / (2 * np.pi) * 90)) % 90
    assert np.allclose(ground.difference, scans.min(axis=1) if best else scans[:, turn], atol=1e-5)
    assert catchment(ground).area >= 0.01
    assert np.median(ground.errors) < np.radians(10)


def test_positions_that_cannot_be_are_refused(tiny):
    renderer, route = tiny
    for grid, within in ((0.0, 1.0), (np.nan, 1.0), (1e-6, 1.0), (3.0, 0.01)):
        with pytest.raises(SettingError):
            positions_around(renderer, route, grid=grid, within=within)


# Place recognition


def recall_by_hand(difference, near, n):
    """Straight from the definition."""
    hits, possible = 0, 0
    for row, truth in zip(difference, near, strict=True):
        possible += truth.any()
        hits += any(truth[k] for k in sorted(range(len(row)), key=lambda k: row[k])[:n])
    return hits / possible


@pytest.mark.parametrize("seed", range(6))
def test_places_are_counted_as_scikit_learn_and_the_definitions_count_them(seed):
    random = np.random.default_rng(seed)
    queries, references = random.uniform(0, 4, (60, 2)), random.uniform(0, 4, (40, 2))
    away = np.hypot(*(queries[:, None] - references).transpose(2, 0, 1))
    difference = np.round(away + random.normal(0, 0.6, away.shape), 1)  # with ties
    found = recognise(difference, queries, references, 0.5)
    near = away <= 0.5
    for n, value in found.recall_at.items():
        assert value == pytest.approx(recall_by_hand(difference, near, n))
    assert np.array_equal(found.correct, near[np.arange(60), found.matches])
    best = difference[np.arange(60), found.matches]
    assert np.array_equal(best, difference.min(axis=1))
    expected = average_precision_score(found.correct, -best) * found.correct.sum() / found.recognisable.sum()
    assert found.area == pytest.approx(expected)
    for precision, recall, threshold in zip(found.precision, found.recall, np.unique(best), strict=True):
        accepted = best <= threshold
        assert precision == pytest.approx((accepted & found.correct).sum() / accepted.sum())
        assert recall == pytest.approx((accepted & found.correct).sum() / found.recognisable.sum())


def test_perfect_recognition_has_the_area_one():
    places = np.arange(10.0)[:, None] * [1, 0]
    found = recognise(np.abs(places[:, :1] - places[:, 0]), places, places, 0.1)
    assert found.area == found.recall_at[1] == 1
    with pytest.raises(SettingError, match="tolerance"):
        recognise(np.ones((10, 10)), places, places + 50, 0.1)


# Commands


@pytest.fixture(scope="module")
def databases(tmp_path_factory, tiny) -> list:
    folder, (renderer, route) = tmp_path_factory.mktemp("databases"), tiny
    write_database(folder / "route", renderer, route.resampled(0.05).poses)
    low, high = route.xy.min(axis=0) - 0.4, route.xy.max(axis=0) + 0.4
    size = tuple(np.ceil((high - low) / 0.1).astype(int).tolist())
    write_database(folder / "grid", renderer, Grid(begin=tuple(low.tolist()), spacing=0.1, size=size))
    return ["--route-database", folder / "route", "--grid-database", folder / "grid"]


WORLD = ["--world", "tiny", "--size", "90x20", "--route-length-m", 2]


AT = ["--at", "1.2,2,90"]


@pytest.mark.parametrize(
    ("source", "at"),
    quick([("world", []), ("world", AT), ("databases", []), ("databases", AT)], ("world", []), ("databases", AT)),
)
def test_commands_take_worlds_and_databases(capfd, databases, tmp_path, source, at):
    flags = WORLD if source == "world" else databases
    result = printed(capfd, "ridf", *flags, *at, "--out", tmp_path / "a.svg")
    rows = result["rotational"]
    assert rows["0 m"]["minimum"] < 1e-6 < rows["0.4 m"]["minimum"]
    assert (result["n_references"] == 1) == bool(at)
    found = printed(capfd, "catchment", *flags, *at, "--within-m", 0.4, "--out", tmp_path / "b.png")
    assert 0 < found["area_m2"] <= found["n_positions"] * found["spacing_m"] ** 2 + 1e-9
    assert found["spacing_m"] == pytest.approx(0.1, abs=1e-5)
    assert found["heading_within_45"] <= found["heading_within_90"]
    if not at:
        place = printed(capfd, "place", *flags, "--out", tmp_path / "c.png")
        assert place["recall_at_1"] <= place["recall_at_5"] <= place["recall_at_10"]
        assert place["precision_recall_area"] > 0.5
        aligned = printed(capfd, "place", *flags, "--aligned", "--out", tmp_path / "d.png")
        assert aligned["precision_recall_area"] > 0.5
    assert all(path.stat().st_size > 5000 for path in tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["ridf", "--at", "1,2"], "--at"),
        (["ridf", "--at", "99,2,0"], "outside"),
        (["ridf", "--displacements-m", "0,-1"], "--displacements-m"),
        (["ridf", "--reach-m", "nan"], "--reach-m"),
        (["ridf", "--out", "a.pdf"], "a.pdf"),
        (["catchment", "--heading", "north"], "best or reference"),
        (["place", "--tolerance-m", "0"], "--tolerance-m"),
    ],
)
def test_bad_flags_are_refused_in_a_line(capfd, tmp_path, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    code, _, err = tussock(capfd, *arguments, *WORLD)
    assert code == 2
    assert words in err.splitlines()[-1]
    assert not list(tmp_path.iterdir())
