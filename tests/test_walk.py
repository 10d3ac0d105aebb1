"""The walk: what a step is, why walks end, and what brings an agent back."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
import torch
from scenes import random_poses

from tussock.navigation.agent import Agent
from tussock.navigation.body import Body
from tussock.navigation.encoding import Encoding
from tussock.navigation.experiment import Experiment
from tussock.navigation.models import Chain, PerfectMemory
from tussock.navigation.models.files import TrainedModel
from tussock.navigation.stopping import StoppingRules, StopReason
from tussock.navigation.threads import one_torch_thread
from tussock.navigation.training import AHEAD, SIDES, train, training_poses
from tussock.navigation.trajectory import COLUMNS, Trajectory
from tussock.render.eye import Eye
from tussock.render.renderer import open_renderer
from tussock.world.errors import InputError, SettingError
from tussock.world.geometry import Bounds, Pose, Route, wrap_angle
from tussock.world.routes import generate_route
from tussock.world.scene import World

ENCODING = Encoding.named("edges", resize=3)


class Turner:
    """A model that always finds the same turn most familiar."""

    def __init__(self, columns: int):
        self.columns = columns

    def fit(self, views):
        return self

    def scan(self, views):
        scan = torch.zeros(len(views), views.shape[-1])
        scan[:, self.columns] = 1
        return scan


@pytest.fixture(scope="module")
def renderer():
    with open_renderer(World.generate("tiny", 2), Eye(width=360, height=60), "cpu") as opened:
        yield opened


@pytest.fixture(scope="module")
def route(renderer):
    return generate_route(renderer.world, 2)


@pytest.fixture(scope="module")
def memory(renderer, route):
    poses = training_poses(route, 0.04, learning_walk=0.2, field=renderer.world.field)
    return train(PerfectMemory(), ENCODING, renderer, poses).model


OF_BODY, OF_SCAN = ("step_length", "heading_noise"), ("scan_width", "scan_about", "seed")


def agent(renderer, route, model, encoding=ENCODING, **settings) -> Agent:
    """An agent with some settings of its scan, its body or its stopping rules."""
    body = Body(**{name: settings.pop(name) for name in OF_BODY if name in settings})
    scan = {name: settings.pop(name) for name in OF_SCAN if name in settings}
    trained = TrainedModel(model=model, encoding=encoding, eye=None, poses=None)
    return Agent(renderer=renderer, trained=trained, route=route, body=body, stopping=StoppingRules(**settings), **scan)


STRAIGHT = Route.through(np.column_stack([np.linspace(0.5, 2.5, 51), np.full(51, 1.5)]))


@pytest.mark.parametrize("offset", [0.0, 0.1, -0.1])
def test_a_learning_walk_brings_the_agent_home(renderer, route, memory, offset):
    walker = agent(renderer, route, memory)
    steps = list(walker.walk(walker.start(offset)))
    assert steps[-1].reason == StopReason.ARRIVED
    assert all(step.reason is None for step in steps[:-1])
    assert np.hypot(steps[-1].pose.x - route.goal.x, steps[-1].pose.y - route.goal.y) <= walker.stopping.arrival_radius
    assert abs(steps[0].deviation - abs(offset)) < 0.02
    assert np.mean([step.deviation for step in steps]) < 0.05


def test_each_step_follows_from_the_one_before(renderer, route, memory):
    walker = agent(renderer, route, memory, heading_noise=0.1, scan_width=2.0)
    steps = list(walker.walk(walker.start()))
    for number, (step, following) in enumerate(pairwise(steps)):
        assert step.index == number
        assert np.allclose(following.pose, step.pose.turned(step.turn).moved(0.05))
        assert np.isclose(step.deviation, route.nearest(np.array([step.pose[:2]]))[0][0])
        assert np.isclose(wrap_angle(step.pose.heading + step.turn - route.at(step.along)[0, 2]), step.error)
        assert np.array_equal(step.view, renderer.render([step.pose])[0])


def test_the_same_seed_walks_the_same_and_another_does_not(renderer, route, memory):
    def path(seed):
        walker = agent(renderer, route, memory, heading_noise=0.1, seed=seed)
        return [step.pose for step in walker.walk(walker.start())]

    assert path(3) == path(3)
    assert path(3) != path(4)


@pytest.mark.parametrize("kind", [PerfectMemory, Chain])
def test_walks_side_by_side_are_those_that_each_start_makes_alone(renderer, route, memory, kind):
    """In the same places to the last bit; views that are not the best match may differ by rounding."""
    model = memory if kind is PerfectMemory else kind().fit(memory.snapshots)
    settings = {"heading_noise": 0.2, "max_steps": 40, "max_deviation": 0.3}
    starts = [route.start.moved(0.0, offset) for offset in (0.0, 0.15)]
    starts.append(Pose(*route.at(route.length - 0.4)[0].tolist()))  # which arrives before the others
    together = list(agent(renderer, route, model, seed=5, **settings).walk_many(starts))
    assert all(len(steps) == 3 for steps in together)
    for k, start in enumerate(starts):
        side = [steps[k] for steps in together if steps[k] is not None]
        alone = list(agent(renderer, route, model, seed=5 + k, **settings).walk(start))
        assert [step.pose for step in side] == [step.pose for step in alone]
        assert [(step.turn, step.match, step.progress, step.reason) for step in side] == [
            (step.turn, step.match, step.progress, step.reason) for step in alone
        ]
    assert len({sum(steps[k] is not None for steps in together) for k in range(3)}) > 1  # some end before others


def test_torch_keeps_its_threads_between_steps_and_after_runs(renderer, route, memory):
    torch.set_num_threads(2)
    walk = agent(renderer, route, memory).walk(route.start)
    next(walk)
    assert torch.get_num_threads() == 2
    with one_torch_thread():
        assert torch.get_num_threads() == 1
        with one_torch_thread():
            assert torch.get_num_threads() == 1
        assert torch.get_num_threads() == 1
    assert torch.get_num_threads() == 2
    Experiment(world="tiny", threads=1, stopping=StoppingRules(max_steps=2)).run()
    assert torch.get_num_threads() == 2


def test_noise_has_the_spread_that_was_asked_for(renderer):
    walker = agent(
        renderer, STRAIGHT, Turner(0), heading_noise=0.05, max_deviation=9, patience=99, max_steps=60, step_length=0.001
    )
    turns = [step.turn for step in walker.walk(walker.start())]
    assert 0.035 < np.std(turns) < 0.065


@pytest.mark.parametrize(
    ("columns", "settings", "reason"),
    [
        (0, {}, StopReason.ARRIVED),
        (30, {"max_deviation": 0.3, "scan_width": 2 * np.pi}, StopReason.LOST),
        (30, {"max_deviation": 9, "patience": 1.0, "scan_width": 2 * np.pi}, StopReason.STUCK),
        (30, {"max_deviation": 9, "patience": 9, "max_steps": 12, "scan_width": 2 * np.pi}, StopReason.OUT_OF_STEPS),
        (0, {"arrival_radius": 0.01, "max_deviation": 9}, StopReason.OUT_OF_WORLD),
    ],
)
def test_walks_end_for_the_reason_they_should(renderer, columns, settings, reason):
    # 30 of 120 columns to the left at every step is a small square; straight on passes the goal between steps of 7 cm.
    walker = agent(
        renderer,
        STRAIGHT,
        Turner(columns),
        **({"step_length": 0.3} | settings if columns else {"step_length": 0.07} | settings),
    )
    steps = list(walker.walk(walker.start()))
    assert steps[-1].reason == reason
    trajectory = Trajectory()
    for step in steps:
        trajectory.add(step)
    assert trajectory.summary()["reason"] == reason
    assert trajectory.summary()["steps"] == len(steps) - 1


def test_a_lost_agent_is_put_back_after_the_furthest_waypoint_and_gets_home(renderer):
    # Every step turns 9 degrees to the left: it keeps leaving the route.
    walker = agent(
        renderer,
        STRAIGHT,
        Turner(3),
        scan_width=2 * np.pi,
        max_deviation=0.1,
        put_back=True,
        step_length=0.05,
        waypoint_spacing=0.1,
    )
    steps = list(walker.walk(walker.start()))
    assert steps[-1].reason == StopReason.ARRIVED
    resets = [(before, after) for before, after in pairwise(steps) if after.reset]
    assert len(resets) >= 3
    for before, after in resets:
        assert after.reset == StopReason.LOST
        assert before.deviation > 0.1
        assert after.deviation < 1e-9
        assert np.isclose(after.pose.heading, 0)
        waypoint = after.along / 0.1
        assert np.isclose(waypoint, round(waypoint))
        reached = max(step.along for step in steps[: after.index])
        assert reached < after.along <= reached + 0.1 + 1e-9
    assert not any(step.reason for step in steps[:-1])


def test_a_lost_agent_is_put_back_at_the_nearest_point_of_the_route(renderer):
    walker = agent(
        renderer,
        STRAIGHT,
        Turner(3),
        scan_width=2 * np.pi,
        max_deviation=0.1,
        put_back=True,
        put_back_at="nearest-point",
        step_length=0.05,
    )
    steps = list(walker.walk(walker.start()))
    assert steps[-1].reason == StopReason.ARRIVED
    resets = [(before, after) for before, after in pairwise(steps) if after.reset]
    assert len(resets) >= 3
    for before, after in resets:
        assert after.deviation < 1e-9
        assert np.isclose(after.along, before.along)
        assert np.isclose(after.pose.heading, 0)


def test_a_route_that_ends_where_it_starts_is_walked_around(renderer):
    angle = np.linspace(0, 2 * np.pi, 64)
    ring = Route.through(1.5 + 0.6 * np.column_stack([np.cos(angle), np.sin(angle)]))
    # Steps of 6 cm and turns of 6 degrees to the left go around a circle of 0.57 m.
    walker = agent(renderer, ring, Turner(2), scan_width=2 * np.pi, step_length=0.06, max_deviation=9)
    steps = list(walker.walk(walker.start()))
    assert steps[-1].reason == StopReason.ARRIVED
    assert 50 < len(steps) < 66


def test_a_walk_always_ends_with_a_reason(renderer):
    # It is lost on its very last step, when putting it back would be of no use.
    settings = {"scan_width": 2 * np.pi, "max_deviation": 0.1, "put_back": True, "step_length": 0.3}
    free = list(agent(renderer, STRAIGHT, Turner(30), **settings).walk(STRAIGHT.start))
    lost_at = next(step.index for step in free if step.reset) - 1
    steps = list(agent(renderer, STRAIGHT, Turner(30), **settings, max_steps=lost_at).walk(STRAIGHT.start))
    assert steps[-1].index == lost_at
    assert steps[-1].reason == StopReason.LOST


def test_an_agent_that_starts_near_the_end_arrives(renderer):
    steps = list(agent(renderer, STRAIGHT, Turner(0)).walk(Pose(2.1, 1.5, 0.0)))
    assert steps[-1].reason == StopReason.ARRIVED
    assert len(steps) < 8


def test_a_mirrored_world_mirrors_the_walk(renderer, route):
    def flipped(poses):
        return poses * np.array([1, -1, -1])

    world = renderer.world
    x0, y0, x1, y1 = world.field
    mirrored = dataclasses.replace(
        world, triangles=world.triangles * np.float32([1, -1, 1]), field=Bounds(x0, -y1, x1, -y0), ground=None
    )
    level = dataclasses.replace(world, ground=None)
    poses = training_poses(route, 0.04, learning_walk=0.2)
    # Grey, since vertical edges stand half a column to the right of what makes them.
    encoding = Encoding.parse("grey | resize 3")
    walks = []
    for seen, mirror in ((level, np.asarray), (mirrored, flipped)):
        with open_renderer(seen, renderer.eye, "cpu") as opened:
            model = train(PerfectMemory(), encoding, opened, mirror(poses)).model
            walker = agent(opened, Route(mirror(route.poses)), model, encoding, max_steps=15, max_deviation=9)
            walks.append(list(walker.walk(Pose(*mirror(np.array(route.start.moved(0.0, 0.1))).tolist()))))
    for step, image in zip(*walks, strict=True):
        assert np.allclose(flipped(np.array(step.pose)), image.pose, atol=0.02)


def test_a_scan_about_a_fixed_direction_keeps_to_it(renderer, route, memory):
    walker = agent(renderer, route, memory, scan_width=np.pi / 3, scan_about=1.0, max_deviation=9, max_steps=8)
    for step in walker.walk(Pose(1.5, 1.5, -2.5)):
        assert abs(wrap_angle(step.pose.heading + step.turn - 1.0)) <= np.pi / 6 + 2 * np.pi / 120


def test_a_start_outside_the_world_is_refused(renderer, route, memory):
    walker = agent(renderer, route, memory)
    for start in (walker.start(50.0), Pose(np.nan, 0.0, 0.0)):
        with pytest.raises(InputError, match="outside the world"):
            next(walker.walk(start))


@pytest.mark.parametrize(
    "settings",
    [
        {"step_length": 0},
        {"arrival_radius": -1},
        {"max_deviation": np.nan},
        {"heading_noise": -1},
        {"max_steps": 0},
        {"patience": np.inf},
        {"scan_width": 0},
        {"scan_about": np.nan},
    ],
)
def test_settings_that_make_no_sense_are_refused(renderer, route, memory, settings):
    with pytest.raises(SettingError, match=next(iter(settings)).removeprefix("scan_")):
        next(agent(renderer, route, memory, **settings).walk(route.start))


def test_a_learning_walk_looks_ahead_from_both_sides():
    poses = training_poses(STRAIGHT, 0.04, every=10, learning_walk=0.2).reshape(-1, 1 + 2 * len(SIDES), 3)
    assert np.allclose(poses[:, -1], STRAIGHT.poses[::10])  # the last view is the one at the end of the route
    assert np.allclose(poses[0, :-1, 1] - 1.5, [0.05, -0.05, 0.1, -0.1, 0.2, -0.2])
    for x, y, heading in poses[0]:
        aim = np.arctan2(1.5 - y, 0.5 + AHEAD - x)  # each looks at the point AHEAD on the route
        assert abs(heading - aim) <= np.radians(0.0051)
    assert np.allclose(training_poses(STRAIGHT, 0.04, every=3), STRAIGHT.poses[::3])


def test_training_poses_are_evenly_spaced_however_few_points_the_route_has():
    corner = Route.through(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]))
    poses = training_poses(corner, 0.1)
    assert len(poses) == 21
    assert np.allclose(np.hypot(*np.diff(poses[:, :2], axis=0).T), 0.1)


class Blinking:
    """A renderer that sees nothing at the poses whose positions in the batch are `blind`."""

    backend = "cpu"

    def __init__(self, renderer, blind: slice):
        self.renderer, self.blind = renderer, blind
        self.world, self.eye = renderer.world, renderer.eye

    def render(self, poses):
        views = self.renderer.render(poses)
        views[self.blind] = 255
        return views

    def close(self): ...

    def __enter__(self): ...

    def __exit__(self, kind, error, at): ...


def test_views_that_show_nothing_are_not_learned(renderer, caplog):
    poses = random_poses(6) * 0.2 + [1.5, 1.5, 0]
    trained = train(PerfectMemory(), ENCODING, Blinking(renderer, slice(1, None, 2)), poses)
    assert np.array_equal(trained.poses, poses[::2])
    assert len(trained.model.snapshots) == 3
    (record,) = caplog.records  # once, not once for each view
    x, y = poses[1, :2]
    for text in (
        "3 of 6 training views",
        f"'{ENCODING}'",
        f"x {x:.2f} m, y {y:.2f} m",
        "3 are not learned",
        "--encoding",
    ):
        assert text in record.message
    with pytest.raises(InputError, match="none of 6 training views shows anything"):
        train(PerfectMemory(), ENCODING, Blinking(renderer, slice(None)), poses)


def test_views_that_show_hardly_anything_are_learned_with_a_warning(renderer, caplog):
    """Without normalising, a view that is nearly constant lies near to every other one."""

    class Dim(Blinking):
        def render(self, poses):
            views = self.renderer.render(poses)
            views[self.blind, ..., :3] = 100 + views[self.blind, ..., :3] // 64
            return views

    grey, poses = Encoding.parse("grey | resize 2"), random_poses(6) * 0.2 + [1.5, 1.5, 0]
    assert len(train(PerfectMemory(), grey, Dim(renderer, slice(2, 3)), poses).model.snapshots) == 6
    (record,) = caplog.records
    assert "1 of 6 training views" in record.message
    assert "0 are not learned" in record.message
    caplog.clear()
    train(PerfectMemory(), grey, renderer, poses)
    assert not caplog.records


def test_a_trajectory_is_its_steps(renderer, route, memory, tmp_path):
    walker = agent(renderer, route, memory, max_steps=5)
    trajectory = Trajectory()
    for step in walker.walk(walker.start()):
        trajectory.add(step)
    trajectory.write(tmp_path / "t.csv")
    lines = (tmp_path / "t.csv").read_text().splitlines()
    assert lines[0] == ",".join(COLUMNS)
    assert len(lines) == len(trajectory) + 1 == 7
    assert lines[-1].split(",")[COLUMNS.index("reason")] == StopReason.OUT_OF_STEPS
    assert np.allclose([float(line.split(",")[1]) for line in lines[1:]], trajectory.xy[:, 0])


def test_the_trajectory_has_the_familiarity_of_the_rotations_that_were_scanned(renderer, route, memory):
    narrow = agent(renderer, route, memory, scan_width=np.radians(20), max_steps=5)
    trajectory = Trajectory()
    for step in narrow.walk(Pose(*route.start[:2], wrap_angle(route.start.heading + np.pi))):  # away from the route
        trajectory.add(step)
        assert step.scanned.sum() < 10
        assert trajectory.column("familiarity")[-1] == step.familiarity[step.scanned].max()
        if step.index == 0:
            assert trajectory.column("familiarity")[0] < step.familiarity.max()


def test_a_trajectory_without_steps_has_a_summary():
    summary = Trajectory().summary()
    assert summary["arrived"] is False
    assert summary["steps"] == 0
    assert summary["reason"] is summary["mean_deviation_m"] is summary["cause"] is None


def test_the_heading_of_a_start_is_wrapped(renderer, route, memory):
    for turns in (-3, 1, 5):
        start = Pose(*route.start[:2], route.start.heading + 2 * np.pi * turns)
        step = next(agent(renderer, route, memory).walk(start))
        assert -np.pi <= step.pose.heading < np.pi
        assert np.isclose(step.pose.heading, route.start.heading)
