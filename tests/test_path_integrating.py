"""Navigators that integrate their path: PathIntegration and CentralComplexSteering."""

import numpy as np
import pytest
import torch

from tussock.navigation.steering.central_complex import CentralComplexSteering, familiar_direction
from tussock.navigation.steering.navigator import Journey, Look, Motion, check_motion
from tussock.navigation.steering.path_integration import PathIntegration, Search
from tussock.world.errors import SettingError
from tussock.world.geometry import wrap_angle

STEP = 0.05
QUIET = {"path-integration": PathIntegration(), "central-complex": CentralComplexSteering(noise=0.0)}
ALL = QUIET | {"noisy": CentralComplexSteering()}


def journeys(n, metres, seed=0, mirrored=False):
    """Ways out of n agents that bend."""
    random = np.random.default_rng(seed)
    bends = random.normal(0, 0.15, (n, round(metres / STEP)))
    headings = wrap_angle(random.uniform(-3, 3, (n, 1)) + bends.cumsum(axis=1)) * (-1 if mirrored else 1)
    return [Journey(compass=each, odometry=np.full(len(each), STEP)) for each in headings]


class Plane:
    """Agents on an empty plane, at the ends of their ways out, and where they are from there on."""

    def __init__(self, navigator, ways):
        self.navigator, self.memories = navigator, [navigator.begin() for _ in ways]
        for memory, way in zip(self.memories, ways, strict=True):
            navigator.travel(memory, way)
        self.positions = [np.array([way.vector for way in ways])]
        self.headings = [np.array([way.compass[-1] for way in ways])]
        self.walked, self.motion = np.zeros(len(ways)), Motion(turn=np.zeros(len(ways)))

    def walk(self, steps):
        """The distance from the nest (n, steps + 1) before and after each step from here on."""
        for _ in range(steps):
            compass = wrap_angle(self.headings[-1])
            look = Look(views=torch.zeros(len(compass), 1, 8), compass=compass, odometry=self.walked)
            self.motion = self.navigator.decide(look, self.memories)
            check_motion(self.motion, len(compass), self.navigator)
            self.headings.append(compass + self.motion.turn)
            self.walked = np.full(len(compass), STEP)
            ahead = np.stack([np.cos(self.headings[-1]), np.sin(self.headings[-1])], axis=1)
            self.positions.append(self.positions[-1] + STEP * ahead)
        return np.linalg.norm(np.stack(self.positions[-steps - 1 :], axis=1), axis=2)


@pytest.mark.parametrize("navigator", ALL.values(), ids=ALL)
def test_agents_side_by_side_walk_like_agents_alone(navigator):
    ways = journeys(4, 3)
    together = Plane(navigator, ways)
    together.walk(60)
    for k, way in enumerate(ways):
        alone = Plane(navigator, [way])
        alone.walk(60)
        assert np.array_equal(np.array(alone.positions)[:, 0], np.array(together.positions)[:, k])


@pytest.mark.parametrize("name", QUIET)
def test_a_mirrored_way_out_mirrors_the_way_home(name):
    plain, mirrored = (Plane(QUIET[name], journeys(5, 4, mirrored=flag)) for flag in (False, True))
    plain.walk(200)
    mirrored.walk(200)
    assert np.allclose(np.array(plain.positions) * [1, -1], np.array(mirrored.positions), atol=1e-5)


@pytest.mark.parametrize("navigator", ALL.values(), ids=ALL)
def test_agents_without_odometry_are_refused(navigator):
    look = Look(views=torch.zeros(1, 1, 8), compass=np.zeros(1))
    with pytest.raises(SettingError, match="needs odometry"):
        navigator.decide(look, [navigator.begin()])


def test_the_home_vector_is_minus_the_sum_of_the_way_and_leads_straight_home():
    ways = journeys(20, 10)
    plane = Plane(PathIntegration(), ways)
    start = np.linalg.norm(plane.positions[0], axis=1)
    distance = plane.walk(round(float(start.max()) / STEP) + 2)
    home = plane.motion.signals["home_vector"]
    assert np.allclose(home, -plane.positions[-2], atol=1e-9)
    arrived = (distance <= STEP).argmax(axis=1)
    assert (distance.min(axis=1) <= STEP).all()
    assert (arrived <= np.ceil(start / STEP)).all()


def test_a_search_goes_in_wider_and_wider_loops_through_its_point():
    search = Search(direction=0.7, side=1)
    unit = np.pi * 0.3
    along = np.linspace(0, 55 * unit, 5_000)
    way = np.array([search.position(float(each), 0.3) for each in along])
    lengths = np.linalg.norm(np.diff(way, axis=0), axis=1)
    assert lengths.max() < along[1] * (1 + 1e-6)  # the loops are one way, without jumps
    assert lengths.mean() == pytest.approx(along[1], rel=1e-2)
    for loops in range(1, 10):
        assert np.linalg.norm(search.position(loops * (loops + 1) / 2 * unit, 0.3)) < 1e-6
    distance = np.linalg.norm(way, axis=1)
    widest = [
        distance[(along > k * (k + 1) / 2 * unit) & (along < (k + 1) * (k + 2) / 2 * unit)].max() for k in range(10)
    ]
    assert np.allclose(widest, 0.3 * np.arange(1, 11), rtol=1e-3)
    angles = np.arctan2(way[:, 1], way[:, 0])[distance > 1]
    assert (np.histogram(angles, bins=8, range=(-np.pi, np.pi))[0] > 0).all()


def test_an_agent_at_the_end_of_its_vector_searches_about_it():
    plane = Plane(PathIntegration(), journeys(5, 2))
    plane.walk(100)
    distance = plane.walk(1200)  # 60 m
    half = distance.shape[1] // 2
    assert ((distance < 0.1).sum(axis=1) > 5).all()
    assert (distance[:, :half].max(axis=1) < distance[:, half:].max(axis=1)).all()
    assert (distance.max(axis=1) < 5).all()


@pytest.mark.parametrize("navigator", QUIET.values(), ids=QUIET)
def test_an_odometer_may_read_less_than_nothing(navigator):
    memory, homes = navigator.begin(), []
    for reading in [0.0] * 10 + [-0.3, -0.1, 0.2]:  # the ring of the circuit settles first
        look = Look(views=torch.zeros(1, 1, 8), compass=np.full(1, np.pi / 4), odometry=np.full(1, reading))
        motion = navigator.decide(look, [memory])
        check_motion(motion, 1, navigator)
        homes.append(motion.signals["home_vector"][0])
    assert np.allclose(homes[-2], 0.4 / np.sqrt(2), atol=0.1)
    assert np.allclose(homes[-1], 0.2 / np.sqrt(2), atol=0.1)


def test_the_central_complex_leads_home_and_then_searches():
    plane = Plane(CentralComplexSteering(), journeys(12, 8, seed=2))
    assert np.median(np.linalg.norm(plane.positions[0], axis=1)) > 3
    distance = plane.walk(300)
    assert np.median(distance.min(axis=1)) < 0.5
    assert np.median(distance[:, 150:]) < 2.5


def test_a_way_that_is_too_long_for_the_memory_is_reported(caplog):
    navigator = CentralComplexSteering(unit=0.01)
    navigator.travel(navigator.begin(), Journey(compass=np.zeros(100), odometry=np.full(100, STEP)))
    assert not caplog.records
    navigator.travel(navigator.begin(), Journey(compass=np.zeros(400), odometry=np.full(400, STEP)))
    assert "a longer unit than 0.01 m" in caplog.text


def test_the_noise_of_neurons_differs_between_agents_and_repeats_with_the_seed():
    ways = journeys(2, 1)
    runs = []
    for navigator in (CentralComplexSteering(), CentralComplexSteering(), CentralComplexSteering(seed=1)):
        plane = Plane(navigator, [*ways, Journey(compass=-ways[0].compass, odometry=ways[0].odometry)])
        plane.walk(20)
        runs.append(np.array(plane.positions))
    assert np.array_equal(runs[0], runs[1])
    assert not np.allclose(runs[0], runs[2])
    assert not np.allclose(runs[0][:, 0] * [1, -1], runs[0][:, 2])


class Facing:
    """A model for which the heading that shows a bright first column ahead is the most familiar."""

    def fit(self, views):
        self.fitted = len(views)

    def scan(self, views):
        return views[:, 0]


def test_vision_weighs_what_is_familiar_against_the_home_vector():
    columns = 16
    views = torch.zeros(1, 1, columns)
    views[0, 0, 4] = 1.0  # 90 degrees to the left
    turns = {}
    for vision in (0.0, 0.02, 0.3, 1.0):
        model = Facing()
        navigator = CentralComplexSteering(model=model, vision=vision, noise=0.0)
        navigator.learn(torch.zeros(3, 1, columns))
        assert hasattr(model, "fitted") == (vision > 0)
        memory = navigator.begin()
        navigator.travel(memory, Journey(compass=np.full(200, np.pi / 2), odometry=np.full(200, STEP)))
        for _ in range(10):  # facing east, home is to the right
            look = Look(views=views, compass=np.zeros(1), odometry=np.zeros(1))
            motion = navigator.decide(look, [memory])
        assert motion.looks_of(0) == (columns if vision else 0)
        turns[vision] = float(motion.turn[0])
        assert motion.signals["home_vector"][0, 1] == pytest.approx(-10, rel=0.05)
        if vision:
            assert np.allclose(motion.signals["visual_vector"], [[0, navigator.balance]], atol=1e-5)
    assert turns[0.0] < turns[0.02] < turns[0.3] < turns[1.0]
    assert turns[0.0] < 0 < turns[1.0]


def test_the_visual_vector_is_in_the_directions_of_the_compass():
    navigator = CentralComplexSteering(model=Facing(), vision=1.0)
    views = torch.zeros(3, 1, 16)
    views[:, 0, 4] = 1.0  # 90 degrees to the left
    compass = np.array([0.3, 1.9, -2.0])
    look = Look(views=views, compass=compass, odometry=np.zeros(3))
    vector = navigator.decide(look, [navigator.begin() for _ in range(3)]).signals["visual_vector"]
    directions = np.stack([np.cos(compass + np.pi / 2), np.sin(compass + np.pi / 2)], axis=1)
    assert np.allclose(vector, navigator.balance * directions, atol=1e-5)


def test_without_a_model_there_is_no_vision():
    navigator = CentralComplexSteering(vision=0.5)
    look = Look(views=torch.zeros(1, 1, 8), compass=np.zeros(1), odometry=np.zeros(1))
    with pytest.raises(SettingError, match="no model"):
        navigator.decide(look, [navigator.begin()])


def test_the_familiar_direction_is_sure_only_where_familiar_headings_agree():
    sharp, split, flat = np.zeros((3, 1, 36), np.float32)
    sharp[0, [8, 9, 10]] = 1.0
    split[0, [9, 27]] = 1.0
    assert np.allclose(familiar_direction(sharp), [[0, 1]], atol=0.02)
    assert np.abs(familiar_direction(split)).max() < 1e-6
    assert np.abs(familiar_direction(flat)).max() < 1e-6
    assert np.allclose(familiar_direction(7 * sharp - 3), familiar_direction(sharp), atol=1e-6)
