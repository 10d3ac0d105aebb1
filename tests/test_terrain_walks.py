"""Walks and routes over a mesh: they stand on it, keep off what is too steep, and end where they cannot go on."""

import dataclasses
import functools
import hashlib
import itertools
import json

import cv2
import numpy as np
import pandas as pd
import pytest
import trimesh
from commands import tussock
from navigators import Ahead
from scenes import hills, mesh_world, post, random_world, surface, world_of

from tussock.navigation.experiment import Experiment
from tussock.navigation.experiment_settings import experiment_of
from tussock.navigation.recording.log import Recording
from tussock.navigation.rl.task import Courses, RouteTask
from tussock.navigation.stopping import StoppingRules, StopReason
from tussock.navigation.walk import Walk
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.errors import InputError, SettingError
from tussock.world.geometry import Bounds, Pose, Route
from tussock.world.obstacles import clearance
from tussock.world.route_files import read_route, write_route
from tussock.world.routes import check_route, generate_route
from tussock.world.scene import Ground

EYE = Eye(width=120, height=25)
POSTS = np.random.default_rng(4).uniform(0.3, 5.7, (40, 2))
EAST = Route.through(np.column_stack([np.linspace(0.5, 5.5, 101), np.full(101, 3.0)]))


@functools.cache
def posts_on_hills(up: float = 0.0):
    """Hills with posts, as a mesh at some height."""
    ground = hills() + (0, 0, up)
    feet = mesh_world(ground).on_mesh().ground_height(POSTS)
    return mesh_world(ground, *(post(*xy, z, 0.6) for xy, z in zip(POSTS.tolist(), feet.tolist(), strict=True)))


def straight_walk(world, end: float = 20.0, **rules):
    """The steps of an agent that walks east from (0.5, 3) as far as it comes."""
    with open_renderer(world, EYE, "cpu") as renderer:
        walk = Walk(
            renderer=renderer,
            encoding=Experiment(eye=EYE).encoding,
            route=Route.through(np.array([[0.5, 3.0], [end, 3.0]])),
            starts=[Pose(0.5, 3.0, 0.0)],
            stopping=StoppingRules(max_deviation=9, max_steps=300, **rules),
        )
        return [step for (step,) in walk.steps(Ahead())]


# Walks


def test_a_walk_over_hills_stands_on_them_and_arrives():
    trajectory = Experiment(world=posts_on_hills(), ground="mesh", eye=EYE, route=EAST).run()
    assert trajectory.summary()["arrived"]
    world = posts_on_hills().on_mesh()
    np.testing.assert_allclose(trajectory.column("z_m"), world.ground_height(trajectory.xy), atol=1e-12)
    assert np.ptp(trajectory.column("z_m")) > 0.4
    steps = np.hypot(*np.diff(trajectory.xy, axis=0).T)
    np.testing.assert_allclose(steps, 0.05)  # over the x-y plane


def test_a_mesh_that_is_moved_up_is_walked_alike():
    low, high = (Experiment(world=posts_on_hills(up), ground="mesh", eye=EYE, route=EAST).run() for up in (0.0, 42.0))
    n = min(len(low), len(high))
    assert abs(len(low) - len(high)) <= 1
    np.testing.assert_allclose(low.xy[:n], high.xy[:n], atol=0.03)
    np.testing.assert_allclose(np.add(low.column("z_m")[:n], 42), high.column("z_m")[:n], atol=0.02)


def test_a_flat_mesh_is_walked_as_the_flat_ground_is():
    plants, floor = random_world(3, ground=False, n=200).triangles, surface(lambda x, y: 0.0, 0.5, -3.0, 3.0)
    rgb = np.random.default_rng(0).integers(0, 256, (len(plants), 3)).astype(np.uint8)
    flat = dataclasses.replace(world_of(plants, rgb), ground=Ground((200, 180, 140), Bounds(-3, -3, 3, 3)))
    colours = np.concatenate([rgb, np.tile(np.uint8([200, 180, 140]), (len(floor), 1))])
    mesh = world_of(np.concatenate([plants, floor]), colours, ground=False)
    route = Route.through(np.column_stack([np.linspace(-2, 2, 81), np.linspace(-1, 1, 81)]))
    runs = [
        Experiment(world=world, ground=ground, eye=EYE, route=route, start_offset=0.05).run()
        for world, ground in ((flat, "flat"), (mesh, "mesh"))
    ]
    assert runs[0].to_csv() == runs[1].to_csv()


@pytest.mark.parametrize(
    ("ground", "reason", "x"),
    [
        (surface(lambda x, y: 2.0 * (x > 3.9), 0.2), StopReason.TOO_STEEP, 3.8),  # a slope from 3.8 to 4 m
        (np.concatenate([surface(lambda x, y: 0.0, 1.0, 0.0, 3.0) + (0, 1.5, 0), surface(lambda x, y: 0.3, 1.0, 3.0, 6.0) - (0, 1.5, 0)]),
         StopReason.TOO_STEEP, 3.0),  # a ledge, without a wall
        (np.concatenate([surface(lambda x, y: 0.0, 1.0, 0.0, 4.0), surface(lambda x, y: 0.0, 1.0, 5.0, 6.0)]), StopReason.OFF_GROUND, 4.0),
        (surface(lambda x, y: 0.0, 0.5), StopReason.OUT_OF_WORLD, 6.0),
    ],
)  # fmt: skip
def test_a_walk_ends_before_what_it_cannot_step_on(ground, reason, x):
    steps = straight_walk(mesh_world(ground).on_mesh())
    assert steps[-1].reason == steps[-1].failure == reason
    assert x - 0.051 < steps[-1].pose.x <= x + 1e-6
    assert steps[-1].pose == steps[-2].pose  # it looks once more from where it stopped
    assert all(step.reason is None for step in steps[:-1])
    assert (steps[0].pose.x, steps[0].height) == (0.5, 0.0)


def test_the_limit_of_the_slope_ends_a_walk():
    slope = surface(lambda x, y: np.tan(np.radians(30)) * np.maximum(x - 3.0, 0.0), 0.5)
    assert straight_walk(mesh_world(slope).on_mesh(np.radians(31)))[-1].reason == StopReason.OUT_OF_WORLD
    steps = straight_walk(mesh_world(slope).on_mesh(np.radians(29)))
    assert steps[-1].reason == StopReason.TOO_STEEP
    assert abs(steps[-1].pose.x - 3.0) < 0.06


def test_an_agent_that_the_ground_stops_is_put_back_on_the_route():
    hole = np.concatenate(
        [surface(lambda x, y: 0.0, 1.0, 0.0, 4.0), surface(lambda x, y: 0.1, 1.0, 4.0, 6.0) - (0, 2, 0)]
    )
    steps = straight_walk(mesh_world(hole).on_mesh(), end=5.8, put_back=True)
    back = next(step for step in steps if step.reset)
    assert back.reset == StopReason.TOO_STEEP
    assert back.pose.x >= 4.0
    assert back.height == pytest.approx(0.1)
    assert steps[back.index + 1].pose.x == pytest.approx(back.pose.x + 0.05)


def test_posts_do_not_stop_a_walk_as_plants_do_not():
    world = mesh_world(hills(), post(2.0, 3.0, -0.5, 1.0, width=0.4)).on_mesh()
    assert straight_walk(world)[-1].reason == StopReason.OUT_OF_WORLD


def test_agents_side_by_side_stand_each_on_its_ground():
    world = posts_on_hills().on_mesh()
    starts = [Pose(1.0, y, 0.3) for y in (1.0, 2.5, 5.0)]
    with open_renderer(world, EYE, "cpu") as renderer:
        settings = {"renderer": renderer, "encoding": Experiment(eye=EYE).encoding, "route": EAST}
        rules = StoppingRules(max_deviation=9, max_steps=20)
        together = list(Walk(starts=starts, stopping=rules, **settings).steps(Ahead()))
        for k, start in enumerate(starts):
            alone = list(Walk(starts=[start], stopping=rules, **settings).steps(Ahead()))
            assert [steps[k].height for steps in together] == [step.height for (step,) in alone]


def test_a_start_off_the_ground_is_refused():
    world = mesh_world(surface(lambda x, y: 0.0, 1.0, 0.0, 4.0), hills() + (3, 3, 0))
    route = Route.through(np.array([[3.0, 3.5], [3.9, 3.9]]))
    with pytest.raises(InputError, match=r"cannot start there: the mesh has no ground at \(2\.\d+, 5\.\d+\) m"):
        Experiment(world=world, ground="mesh", eye=EYE, route=route, start_offset=2.0).run()


def test_views_are_learned_on_the_ground_only():
    world = mesh_world(surface(lambda x, y: 0.0, 1.0, 0.0, 4.0), hills() + (3, 4, 0)).on_mesh()
    route = Route.through(np.array([[0.5, 3.9], [2.5, 3.9]]))
    poses = Experiment(eye=EYE).training_poses(world, route)
    assert world.stands(poses[:, :2]).all()
    assert len(poses) < len(Experiment(eye=EYE).training_poses(dataclasses.replace(world, terrain=None), route))


# Routes


def test_a_route_over_hills_keeps_clear_of_posts_whatever_the_height():
    for up in (0.0, 42.0):
        world = posts_on_hills(up).on_mesh()
        for seed in range(3):
            route = generate_route(world, seed, 4.0)
            distance = np.hypot(*(route.xy[:, None] - POSTS).transpose(2, 0, 1)) - 0.04  # at least, from a square post
            assert distance.min() > 0.04 - 0.017
            assert clearance(world, route.xy).min() >= 0.04
            check_route(world, route)


def test_a_seed_keeps_giving_the_same_route_over_a_mesh():
    known = ["cd6e05d013a3", "a102dd59c97c", "65761c7474f1"]  # to a tenth of a millimetre
    routes = [generate_route(posts_on_hills().on_mesh(), seed, 4.0) for seed in range(3)]
    tenths = [np.round(route.xy * 1e4).astype(np.int64).tobytes() for route in routes]
    assert [hashlib.sha256(each).hexdigest()[:12] for each in tenths] == known


def test_heights_of_obstacles_are_those_above_the_ground():
    flat = mesh_world(surface(lambda x, y: 0.0, 0.5), post(3.0, 3.0, 0.0), post(2.0, 2.0, 0.3))
    xy = np.random.default_rng(0).uniform(0.5, 5.5, (200, 2))
    tilted = dataclasses.replace(
        flat, triangles=(flat.triangles + flat.triangles[..., :1] * [0, 0, 0.5]).astype(np.float32)
    )
    np.testing.assert_allclose(clearance(tilted.on_mesh(), xy), clearance(flat.on_mesh(), xy), atol=1e-6)
    np.testing.assert_allclose(clearance(flat.on_mesh(), xy), clearance(flat, xy), atol=1e-9)
    assert not np.allclose(clearance(tilted, xy), clearance(flat, xy), atol=0.5)


def test_a_route_goes_around_a_hole_and_up_no_cliff():
    """A plateau with steep walls, and a hole in the ground."""
    ground = surface(lambda x, y: np.clip((x - 3.0) * 5.0, 0, 1.0), 0.1)
    middle = ground.mean(axis=1)
    ground = ground[~((middle[:, 0] < 2.0) & (abs(middle[:, 1] - 3.0) < 0.8) & (middle[:, 0] > 0.6))]
    world = mesh_world(ground).on_mesh()
    for seed in range(4):
        route = generate_route(world, seed, 3.0)
        check_route(world, route)
        assert route.xy[:, 0].max() < 3.0 or route.xy[:, 0].min() > 3.2  # it stays on its side of the cliff
        in_hole = (route.xy[:, 0] > 0.6) & (route.xy[:, 0] < 2.0) & (abs(route.xy[:, 1] - 3.0) < 0.8)
        assert not in_hole.any()


def test_a_route_is_planned_over_what_ground_there_is():
    """A ring around a large hole, over which a route without a plan would lead."""
    ground = surface(lambda x, y: 0.1 * x, 0.1)
    world = mesh_world(ground[np.abs(ground.mean(axis=1)[:, :2] - 3.0).max(axis=1) > 2.2]).on_mesh()
    for seed in range(3):
        route = generate_route(world, seed, 5.0)
        assert np.abs(route.xy - 3.0).max(axis=1).min() > 2.2 + 0.02  # to about a cell of the grid


def test_a_route_that_leaves_the_ground_is_refused_with_the_place(tmp_path):
    world = mesh_world(surface(lambda x, y: 0.0, 1.0, 0.0, 4.0), hills() + (0, 5, 3)).on_mesh()
    gap = Route.through(np.array([[2.0, 3.0], [2.0, 6.0]]))  # only between its points
    with pytest.raises(InputError, match=r"cannot be walked: the mesh has no ground at \(2, 4.01\) m"):
        check_route(world, gap)
    cliff = mesh_world(surface(lambda x, y: 3.0 * (x > 2.9), 0.2)).on_mesh()
    with pytest.raises(InputError, match=r"steeper than 45 degrees at \(2\.\d+, 3\) m; .*--max-slope-deg"):
        check_route(cliff, EAST)
    ledge = mesh_world(
        surface(lambda x, y: 0.0, 1.0, 0.0, 3.0) + (0, 1.5, 0), surface(lambda x, y: 0.3, 1.0, 3.0, 6.0) - (0, 1.5, 0)
    )
    with pytest.raises(InputError, match=r"the ground rises from 0 to 0.3 m at \((2\.99|3), 3\) m"):
        check_route(ledge.on_mesh(), EAST)
    write_route(EAST, tmp_path / "route.csv")
    with pytest.raises(InputError, match="cannot be walked"):
        Experiment(world=cliff, ground="mesh", route=tmp_path / "route.csv").run()


def test_a_goal_off_the_ground_is_refused():
    world = mesh_world(surface(lambda x, y: 0.0, 1.0, 0.0, 4.0), hills() + (3, 3, 0)).on_mesh()
    with pytest.raises(SettingError, match=r"a goal at \(2, 5\) m: the mesh has no ground"):
        generate_route(world, 0, goal=(2.0, 5.0))


# Commands


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """hills.obj, and the same 42 m up, with posts."""
    folder = tmp_path_factory.mktemp("hills")
    for name, up in (("hills", 0.0), ("hills_42", 42.0)):
        triangles = posts_on_hills(up).triangles
        trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)).export(
            folder / f"{name}.obj"
        )
    return folder


def test_run_stands_on_the_mesh_in_all_that_it_writes(files, tmp_path, capfd, monkeypatch):
    logged = {}
    monkeypatch.setattr(
        Recording, "_send", lambda self, entity, steps, columns: logged.setdefault(entity, []).extend(columns)
    )
    world, out = str(files / "hills_42.obj"), tmp_path / "run"
    command = ["run", "--world", world, "--ground", "mesh", "--size", "120x25", "--route-length-m", "2", "--json"]
    code, printed, _ = tussock(capfd, *command, "--out", out)
    assert (code, json.loads(printed)["arrived"]) == (0, True)
    rows = pd.read_csv(out / "trajectory.csv")
    standing = posts_on_hills(42.0).on_mesh()
    np.testing.assert_allclose(rows["z_m"], standing.ground_height(rows[["x_m", "y_m"]].to_numpy()), atol=1e-3)
    settings = json.loads((out / "summary.json").read_text())["settings"]
    assert settings["ground"] == "mesh"
    assert settings["max_slope_deg"] == 45
    assert experiment_of({"world": world, "ground": "mesh", "max_slope_deg": 30}).max_slope == pytest.approx(np.pi / 6)
    check_route(standing, read_route(out / "route.csv"))
    arrows = [each.component_batch for each in logged["world/agent"]]
    names = [each.component_descriptor().component for each in arrows]
    placed = [each.as_arrow_array().to_pylist() for each, name in zip(arrows, names, strict=True) if "origins" in name]
    origins = np.array(list(itertools.chain(*placed))).reshape(-1, 3)
    np.testing.assert_allclose(origins[:, 2], rows["z_m"] + 0.015, atol=1e-4)


def test_views_of_both_heights_are_alike(files, tmp_path, capfd):
    for name in ("hills", "hills_42"):
        view = ["view", "--world", str(files / f"{name}.obj"), "--at", "3,3,90", "--size", "360x75", "--ground", "mesh"]
        code, _, messages = tussock(capfd, *view, "--out", tmp_path / f"{name}.png")
        assert code == 0
        assert "--ground mesh" not in messages
    low, high = (cv2.imread(str(tmp_path / f"{name}.png")) for name in ("hills", "hills_42"))
    assert (low != high).any(axis=-1).mean() < 0.001


def test_route_and_evaluate_take_the_ground(files, tmp_path, capfd):
    world = ["--world", str(files / "hills_42.obj"), "--ground", "mesh"]
    route = tmp_path / "route.csv"
    assert tussock(capfd, "route", *world, "--length-m", 3, "--out", route)[0] == 0
    check_route(posts_on_hills(42.0).on_mesh(), read_route(route))
    code, printed, _ = tussock(capfd, "evaluate", *world, "--route", route, "--size", "120x25", "--json")
    assert code == 0
    assert json.loads(printed)["median_error_deg"] < 10


def test_an_unknown_ground_is_refused(capfd):
    code, _, messages = tussock(capfd, "view", "--ground", "hills")
    assert code == 2
    assert "one of flat, mesh" in messages


def test_a_task_takes_place_on_the_mesh(files):
    task = RouteTask(world=str(files / "hills_42.obj"), ground="mesh", length=3.0)
    courses = Courses(task)
    try:
        assert courses[0].renderer.world.ground_height(np.array([[3.0, 3.0]]))[0] > 40
        views, poses = courses.training_views(0, spacing=0.5)
        assert len(views) == len(poses)
    finally:
        courses.close()
