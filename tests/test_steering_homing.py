"""Navigators that home to a place: what they learn, how they turn, and that they come to the goal."""

import numpy as np
import pytest
import torch
from navigators import Ahead

from tussock.navigation.body import Body
from tussock.navigation.experiment import Experiment, steps_of
from tussock.navigation.experiment_keys import Keys, key_of
from tussock.navigation.learning import learn_views
from tussock.navigation.senses import ANT, Readings, Senses, measured_places
from tussock.navigation.steering import NAVIGATORS
from tussock.navigation.steering.average_landmark_vector import AverageLandmarkVector
from tussock.navigation.steering.home_vector import HomeVector, Network, units_within, ways_home, weights_of
from tussock.navigation.steering.homing import Homing
from tussock.navigation.steering.image_gradient import ImageGradient
from tussock.navigation.steering.navigator import Look
from tussock.navigation.stopping import StoppingRules, StopReason
from tussock.navigation.sweeps.spec import Sweep
from tussock.navigation.training_setup import TrainingSetup
from tussock.render.eye import Eye
from tussock.world.errors import SettingError
from tussock.world.geometry import Bounds, Route, column_azimuths, wrap_angle
from tussock.world.scene import Ground, World

LEARNING_PLACES = ("homing", "average-landmark-vector", "image-gradient", "home-vector")
WIDTH = 72
POSTS = np.array(
    [[3.0, 0.13], [-1.5, 2.5], [-1.0, -3.0], [0.5, 4.0], [2.0, -2.1]]
)  # m; none at the edge of a column of 5 degrees


class Placed(Ahead):
    """A navigator that keeps the places at which it learned."""

    def learn(self, views):
        raise AssertionError

    def learn_at(self, views, places):
        self.places = places


class Recorder:
    """A model that keeps what it learns; the familiarity of a view is minus its distance from the mean of these."""

    def fit(self, views):
        self.views = views
        return self

    def scan(self, views):
        turned = torch.stack([views.roll(k, dims=2) for k in range(views.shape[2])], dim=1)
        return -(turned - self.views.mean(dim=0)).abs().mean(dim=(2, 3))


class Brightness:
    """A model that knows how bright the one view was that it learned."""

    def fit(self, views):
        (self.learned,) = views.mean(dim=(1, 2))

    def scan(self, views):
        return -(views.mean(dim=(1, 2)) - self.learned).abs()[:, None].expand(-1, views.shape[2])


def views_of(poses: np.ndarray) -> torch.Tensor:
    """Posts seen from poses: the column of each is 1, and the higher the nearer it is."""
    views = torch.zeros(len(poses), 6, WIDTH)
    for view, (x, y, heading) in zip(views, poses, strict=True):
        away = POSTS - (x, y)
        columns = np.floor((np.pi - wrap_angle(np.arctan2(away[:, 1], away[:, 0]) - heading)) / (2 * np.pi) * WIDTH)
        for column, distance in zip(columns.astype(int) % WIDTH, np.hypot(*away.T), strict=True):
            view[max(0, 6 - round(9 / distance)) :, column] = 1.0
    return views


def around(radius: float, count: int = 16, seed: int = 0) -> np.ndarray:
    """Poses on a circle about the goal, that face anywhere."""
    angle = 2 * np.pi * np.arange(count) / count
    heading = np.random.default_rng(seed).uniform(-np.pi, np.pi, count)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), heading])


def look_at(poses: np.ndarray) -> Look:
    return Look(views=views_of(poses), compass=poses[:, 2])


def errors_deg(poses: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Angles between where agents turn to and the goal."""
    home = np.arctan2(-poses[:, 1], -poses[:, 0])
    return np.degrees(np.abs(wrap_angle(poses[:, 2] + turn - home)))


def decided(navigator, look: Look):
    return navigator.decide(look, [navigator.begin() for _ in range(len(look))])


# ------------------------------------------------------------------------------------------------- places


def test_ideal_senses_measure_places_exactly():
    poses = np.random.default_rng(0).uniform(-3, 3, (20, 3))
    places = measured_places(poses, np.array([0.5, -0.2]), Readings(Senses(), np.random.default_rng(0)))
    np.testing.assert_allclose(places, poses - [0.5, -0.2, 0], atol=1e-12)


def test_an_odometer_errs_along_the_way_and_a_drift_turns_all_that_follows():
    poses = np.array([[2.0, 1.0, 0.3], [4.0, 2.0, 0.3]])
    goal = np.zeros(2)
    odometry = measured_places(poses, goal, Readings(Senses(odometry=0.3), np.random.default_rng(1)))
    np.testing.assert_allclose(odometry[:, 1] / odometry[:, 0], 0.5)
    np.testing.assert_allclose(odometry[:, 2], 0.3)
    assert np.abs(odometry[:, 0] - poses[:, 0]).min() > 1e-3
    slow = Senses(compass_drift=0.2, speed=100.0)  # one reading a leg
    drift = measured_places(poses, goal, Readings(slow, np.random.default_rng(1)))
    legs = np.diff(np.vstack([goal, drift[:, :2]]), axis=0)
    turned = np.arctan2(legs[:, 1], legs[:, 0]) - np.arctan2(1, 2)
    np.testing.assert_allclose(np.hypot(*legs.T), 5**0.5)
    np.testing.assert_allclose(drift[:, 2] - 0.3, turned)


def test_the_error_of_a_long_leg_is_that_of_its_parts():
    """A compass that errs anew at each reading: over n readings the error to the side grows with the root of n."""
    senses, reading = Senses(compass=0.1, speed=1.0), 0.5
    ends = []
    for seed in range(400):
        readings = Readings(senses, np.random.default_rng(seed))
        ends.append(measured_places(np.array([[20.0, 0.0, 0.0]]), np.zeros(2), readings)[0, 1])
    expected = reading * np.sin(0.1 * reading**0.5) * (20 / reading) ** 0.5
    assert np.std(ends) == pytest.approx(expected, rel=0.1)


def test_a_navigator_that_learns_places_gets_them_and_another_does_not():
    poses, route = around(1.0), Route.through(np.array([[0.0, -1.0], [0.0, 0.0]]))
    plain, placed = Ahead(), Placed()
    learn_views(plain, views_of(poses), poses, route=route, senses=Senses(), seed=3)
    learn_views(placed, views_of(poses), poses, route=route, senses=Senses(), seed=3)
    np.testing.assert_allclose(placed.places, poses, atol=1e-12)
    noisy = []
    for seed in (3, 3, 4):
        learn_views(placed, views_of(poses), poses, route=route, senses=ANT(), seed=seed)
        noisy.append(placed.places)
    assert (noisy[0] == noisy[1]).all()
    assert not np.allclose(noisy[0], noisy[2])


@pytest.mark.parametrize("name", LEARNING_PLACES)
def test_views_without_places_are_refused(name):
    navigator = NAVIGATORS.spec(name).make(model=Recorder(), seed=0)
    with pytest.raises(SettingError, match=rf"'{name}' learns views with the places"):
        navigator.learn(views_of(around(1.0)))


def test_senses_are_in_the_keys_of_a_sweep():
    """They decide where views are believed to be, and how a walk reads its compass."""
    sweep = Sweep.over("senses", Experiment(world="tiny"), {"senses": ["ideal", "ant"]})
    keys = Keys()
    assert [keys.run(run) for run in sweep.experiments] == [key_of(run) for run in sweep.experiments]
    assert len({keys.run(run) for run in sweep.experiments}) == 2
    assert len({keys.shared(run)[2] for run in sweep.experiments}) == 2


# ------------------------------------------------------------------------------------------------- average landmark vector


def test_an_average_landmark_vector_by_hand():
    """Landmarks at columns 2, 5 and, half each, 11 and 0; the weak one at 9 does not count."""
    view = torch.zeros(1, 2, 12)
    view[0, 0, 2], view[0, 1, 2], view[0, 1, 9] = -3.0, 1.0, 0.2
    view[0, 1, 5], view[0, 0, 11], view[0, 1, 0] = 1.0, 2.0, -2.0
    azimuths = column_azimuths(12) + 0.4
    weights = {2: 1.0, 5: 1.0, 11: 0.5, 0: 0.5}
    expected = [sum(w * f(azimuths[k]) for k, w in weights.items()) / 3 for f in (np.cos, np.sin)]
    navigator = AverageLandmarkVector(contrast=0.3)
    np.testing.assert_allclose(navigator.vectors(view, np.array([0.4]))[0], expected)
    assert (navigator.vectors(torch.zeros(1, 2, 8), np.zeros(1)) == 0).all()


def test_average_landmark_vectors_lead_home_among_posts_whichever_way_agents_face():
    navigator = AverageLandmarkVector()
    flight = np.vstack([around(1.0, 8), [[0.0, 0.0, 2.0]]])
    navigator.learn_at(views_of(flight), flight)
    for radius in (0.4, 1.0):
        poses = around(radius)
        motion = decided(navigator, look_at(poses))
        assert errors_deg(poses, motion.turn).mean() < 25
    assert motion.signals["home_direction"].shape == (16, 2)
    at_home = decided(navigator, look_at(flight[-1:]))
    assert at_home.turn[0] == 0


# ------------------------------------------------------------------------------------------------- image gradient


@pytest.mark.parametrize(("first", "side"), [("left", 1), ("right", -1)])
def test_an_image_gradient_goes_on_while_the_difference_falls(first, side):
    navigator = ImageGradient(model=Brightness(), first=first, angle=1.5)
    flight = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.4]])
    navigator.learn_at(torch.tensor([0.9, 0.0])[:, None, None].expand(2, 3, 8).clone(), flight)
    memory, turns = navigator.begin(), []
    for brightness in (0.6, 0.5, 0.2, 0.4, 0.1, 0.1):  # 0.1 twice: it has not fallen
        look = Look(views=torch.full((1, 3, 8), brightness), compass=np.zeros(1))
        turns.append(float(navigator.decide(look, [memory]).turn[0]))
    assert turns == [0, 0, 0, side * 1.5, 0, side * 1.5]


def test_the_difference_depends_on_the_place_alone():
    navigator = ImageGradient(model=Recorder())
    flight = np.array([[0.0, 0.0, np.radians(30)]])
    navigator.learn_at(views_of(flight), flight)
    poses = np.array([[0.4, 0.3, heading] for heading in np.radians([0, 35, -95, 170])])
    difference = decided(navigator, look_at(poses)).signals["difference"]
    np.testing.assert_allclose(difference, difference[0], atol=1e-6)
    here = np.array([[0.0, 0.0, np.radians(-60)]])
    assert decided(navigator, look_at(here)).signals["difference"][0] == pytest.approx(0, abs=1e-6)


# ------------------------------------------------------------------------------------------------- homing


def test_homing_learns_views_that_face_the_goal_whichever_way_they_faced():
    headings = 2 * np.pi * np.arange(WIDTH) / WIDTH  # of whole columns
    flight = around(1.0, 8)
    flight[:, 2] = wrap_angle(np.random.default_rng(1).choice(headings, 8))
    model = Recorder()
    navigator = Homing(model=model)
    facing = flight.copy()
    facing[:, 2] = np.arctan2(-flight[:, 1], -flight[:, 0])
    flight[-1, :2] = facing[-1, :2] = 0.0
    facing[-1, 2] = flight[-1, 2]  # the goal's view is learned as it is
    navigator.learn_at(views_of(flight), flight)
    expected = views_of(facing)
    assert (model.views == expected).double().mean() > 0.99  # posts may be at the edge of a column


# ------------------------------------------------------------------------------------------------- home vector


def network(seed: int = 0, count: int = 12) -> tuple[Network, torch.Tensor]:
    views = torch.rand(count, 5, 40, generator=torch.Generator().manual_seed(seed))
    return Network(views, 6, seed), views


def test_a_turned_view_gives_the_turned_home_vector():
    net, views = network()
    for columns in (1, 7, 20, -3):
        angle = torch.tensor(2 * np.pi * columns / 40)  # turning left: the goal is farther to the right
        cos, sin = angle.cos(), angle.sin()
        expected = net(views) @ torch.tensor([[cos, -sin], [sin, cos]])
        torch.testing.assert_close(net(views.roll(columns, dims=2)), expected, atol=1e-5, rtol=1e-4)


def test_a_mirrored_view_gives_the_mirrored_home_vector():
    net, views = network()
    torch.testing.assert_close(net(views.flip(2)), net(views) * torch.tensor([1.0, -1.0]), atol=1e-6, rtol=1e-5)


def test_ways_home_by_hand():
    places = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, np.pi], [0.0, -2.0, 0.0], [3.0, 0.0, np.pi / 2]])
    np.testing.assert_allclose(ways_home(places), [[-1, 0], [1, 0], [0, 2], [0, 3]], atol=1e-6)


@pytest.mark.parametrize("memory_kb", [3.4, 42.0])
def test_a_network_has_as_many_units_as_fit(memory_kb):
    views = torch.rand(3, 19, 45)
    units = units_within(memory_kb * 250, 19)
    weights = sum(each.numel() for layer in Network(views, units, 0).layers for each in layer)
    assert weights == weights_of(units, 19) <= memory_kb * 250 < weights_of(units + 1, 19)


def test_a_home_vector_is_learned_among_posts():
    flight = np.vstack([around(radius, 16, seed) for seed, radius in enumerate((0.2, 0.6, 1.0, 1.4))])
    navigators = [HomeVector(memory_kb=8.0, passes=60, rate=5e-3, seed=seed, whole_step_at=1.0) for seed in (1, 1, 2)]
    for navigator in navigators:
        navigator.learn_at(views_of(flight), flight)
    poses = np.vstack([around(0.8, 20, 7), around(1.2, 20, 8)])
    look = look_at(poses)
    one, again, other = (decided(navigator, look) for navigator in navigators)
    assert (one.turn == again.turn).all()
    assert (one.turn != other.turn).any()
    assert np.median(errors_deg(poses, one.turn)) < 25
    home = one.signals["home_vector"]
    length = np.hypot(*home.T)
    assert length[:20].mean() < length[20:].mean()
    np.testing.assert_allclose(np.asarray(one.step), (0.2 + 0.8 * length).clip(max=1))
    off = wrap_angle(np.arctan2(home[:, 1], home[:, 0]) - poses[:, 2] - one.turn)
    np.testing.assert_allclose(off, 0, atol=1e-9)
    row = 5
    alone = Look(views=look.views[row : row + 1], compass=look.compass[row : row + 1])
    assert decided(navigators[0], alone).turn[0] == one.turn[row]


def test_a_flight_that_stays_at_home_gives_finite_turns():
    flight = np.zeros((3, 3))
    navigator = HomeVector(memory_kb=1.0, passes=2)
    navigator.learn_at(views_of(flight), flight)
    assert np.isfinite(decided(navigator, look_at(around(1.0))).turn).all()


# ------------------------------------------------------------------------------------------------- walks


@pytest.fixture(scope="module")
def posts() -> tuple[World, Route]:
    """Posts about a goal at (0, 0)."""
    feet = np.repeat(np.column_stack([POSTS, np.zeros(len(POSTS))])[:, None], 3, axis=1)
    blade = np.array([[-0.15, 0, 0], [0.15, 0, 0], [0, 0, 1.5]])
    triangles = np.concatenate([feet + blade, feet + blade[:, [1, 0, 2]]]).astype(np.float32)  # across each other
    world = World(
        triangles=triangles,
        rgb=np.full((len(triangles), 3), 30, np.uint8),
        ground=Ground((200, 190, 170), Bounds(-99.0, -99.0, 99.0, 99.0)),
        sky_rgb=(180, 200, 230),
        field=Bounds(-5.0, -5.0, 5.0, 5.0),
    )
    return world, Route.through(np.array([[0.0, -1.5], [0.0, 0.0]]))


@pytest.mark.parametrize(
    ("navigator", "encoding"),
    [
        ("scan", "edges"),
        ("homing", "edges"),
        ("lateral", "edges"),
        ("average-landmark-vector", "edges"),
        ("image-gradient", "foreground-mask | blur 4 | resize 3 | normalise"),
        ("home-vector memory_kb=8 passes=60 rate=5e-3", "foreground-mask | resize 3 | normalise"),
    ],
)
def test_agents_come_home(posts, navigator, encoding):
    world, route = posts
    base = Experiment(
        world=world,
        route=route,
        eye=Eye(width=180, height=40),
        encoding=encoding,
        navigator=navigator,
        training=TrainingSetup(goal_walk=1.2, goal_only=True, goal_views=40),
        body=Body(step_length=0.05),
        stopping=StoppingRules(arrival_radius=0.15, max_deviation=5.0, patience=100.0, max_steps=300),
        release=0.8,
        threads=1,
    )
    with base.opened() as trained:
        released = [base.replace(release_direction=angle) for angle in np.arange(6) * np.pi / 3]
        last = {}
        for steps in steps_of(released, trained):
            last |= {k: each[0] for k, each in enumerate(steps) if each is not None}
    reasons = [step.reason for step in last.values()]
    assert reasons.count(StopReason.ARRIVED) >= 5
