"""The central complex as a ring circuit: laws of its parts, and an oracle that computes it neuron by neuron."""

import math

import numpy as np
import pytest

from tussock.navigation.steering.ring_circuit import COLUMNS, DIRECTIONS, NOISES, Activity, CentralComplex

QUIET = CentralComplex(noise=0.0)
COLUMN = 2 * np.pi / COLUMNS


def walked(headings, metres, circuit=QUIET, noise=None):
    """The activity after ways of n agents: headings (n, k), and the length of every step."""
    activity = circuit.start(len(headings))
    for step, heading in enumerate(headings.T):
        row = None if noise is None else noise[:, step]
        activity = circuit.walk(activity, heading, np.full(len(headings), metres), row)
    return activity


def random_ways(n, steps, seed=0):
    """Headings (n, steps) of ways that bend."""
    random = np.random.default_rng(seed)
    return random.uniform(-np.pi, np.pi, (n, 1)) + random.normal(0, 0.2, (n, steps)).cumsum(axis=1)


def differences(one, other, turn=lambda rates: rates):
    return max(
        np.abs(turn(getattr(one, name)) - getattr(other, name)).max() for name in ("tb1", "memory", "cpu4", "cpu1")
    )


@pytest.mark.parametrize("columns", range(1, COLUMNS))
def test_turning_by_columns_moves_the_bump_by_as_many(columns):
    headings = random_ways(20, 30, seed=columns)
    straight, turned = walked(headings, 0.05), walked(headings + columns * COLUMN, 0.05)
    assert differences(straight, turned, lambda rates: np.roll(rates, columns, axis=-1)) < 1e-9
    assert np.allclose(QUIET.steering(straight), QUIET.steering(turned), atol=1e-9)


@pytest.mark.parametrize("column", range(COLUMNS))
def test_the_ring_is_lowest_in_the_column_of_the_heading(column):
    tb1 = walked(np.full((1, 20), DIRECTIONS[column]), 0.05).tb1[0]
    assert tb1.argmin() == column
    assert tb1.argmax() == (column + 4) % COLUMNS


def test_a_mirrored_way_mirrors_the_steering():
    headings = random_ways(5, 200)
    way, mirrored = walked(headings, 0.05), walked(-headings, 0.05)
    assert np.allclose(QUIET.steering(way), -QUIET.steering(mirrored), atol=1e-9)
    assert np.abs(QUIET.steering(way)).min() > 0.01
    assert np.allclose(QUIET.home_vector(way) * [1, -1], QUIET.home_vector(mirrored), atol=1e-9)


def test_agents_side_by_side_are_like_agents_alone():
    circuit = CentralComplex()
    headings = random_ways(6, 50)
    noise = np.random.default_rng(1).standard_normal((6, 50, NOISES))
    together = walked(headings, 0.05, circuit, noise)
    for k in range(6):
        alone = walked(headings[k : k + 1], 0.05, circuit, noise[k : k + 1])
        assert differences(alone, together[k : k + 1]) == 0
    parts = Activity.join([together[:2], together[2:]])
    assert differences(parts, together) == 0


def test_an_agent_at_its_nest_does_not_steer():
    headings = np.linspace(0, 2 * np.pi, 40)[:, None] + np.zeros((1, 20))
    activity = QUIET.start(40)
    for heading in headings.T:
        activity = QUIET.walk(activity, heading, np.zeros(40))
    assert np.abs(QUIET.steering(activity)).max() < 1e-12
    assert np.abs(QUIET.home_vector(activity)).max() < 1e-12


@pytest.mark.parametrize("facing_deg", [20, 60, 100, 160, -20, -60, -100, -160])
@pytest.mark.parametrize("way_deg", [0, 45, 70, 200])
def test_it_turns_to_the_side_of_the_nest(way_deg, facing_deg):
    way = math.radians(way_deg)
    activity = walked(np.full((1, 200), way), 0.05)
    facing = way + np.pi + math.radians(facing_deg)  # the nest is on the right where this is positive
    for _ in range(10):
        activity = QUIET.walk(activity, np.array([facing]), np.zeros(1))
    assert np.sign(QUIET.steering(activity)[0]) == -np.sign(facing_deg)


def test_the_memory_holds_minus_the_sum_of_the_way():
    headings = random_ways(50, 400)  # 20 m
    home = -0.05 * np.stack([np.cos(headings).sum(axis=1), np.sin(headings).sum(axis=1)], axis=1)
    vector = QUIET.home_vector(walked(headings, 0.05))
    far = np.linalg.norm(home, axis=1) > 3
    angle = np.angle((vector @ [1, 1j]) / (home @ [1, 1j]))[far]
    assert far.sum() > 30
    assert np.median(np.abs(angle)) < math.radians(3)
    assert np.abs(angle).max() < math.radians(13)  # what eight columns allow on a straight way
    assert (np.linalg.norm(vector - home, axis=1) / np.linalg.norm(home, axis=1))[far].mean() < 0.07


def test_its_length_grows_evenly_with_a_straight_way_until_it_saturates():
    circuit = CentralComplex(noise=0.0, unit=0.02)
    activity = circuit.start(1)
    for _ in range(20):
        activity = circuit.walk(activity, np.zeros(1), np.zeros(1))
    lengths = []
    for _ in range(60):
        activity = circuit.walk(activity, np.zeros(1), np.full(1, circuit.reach / 20))
        lengths.append(np.linalg.norm(circuit.home_vector(activity)))
    assert np.allclose(np.diff(lengths[:19]), lengths[0], rtol=1e-3)  # the ring is still settling
    assert abs(lengths[18] / (0.95 * circuit.reach) - 1) < 0.05
    assert lengths[-1] < 0.8 * 3 * circuit.reach


def test_a_longer_unit_makes_a_longer_reach():
    assert CentralComplex(unit=0.2, noise=0.0).reach == pytest.approx(4 * CentralComplex(unit=0.05, noise=0.0).reach)
    assert 40 < QUIET.reach < 50


def test_the_vector_to_food_points_back_along_the_home_vector_and_is_used_up_by_the_way():
    headings = random_ways(20, 300, seed=4)
    at_food = walked(headings, 0.05)
    at_nest = QUIET.towards_end(at_food)
    assert np.allclose(QUIET.home_vector(at_nest), -QUIET.home_vector(at_food), atol=1e-12)
    again = at_nest
    for heading in headings.T:
        again = QUIET.walk(again, heading, np.full(20, 0.05))
    assert np.linalg.norm(QUIET.home_vector(again), axis=1).max() < 0.01


def sigmoid(value, slope, bias, noise):
    return min(max(1 / (1 + math.exp(bias - slope * value)) + 0.1 * noise, 0), 1)


def neuron_by_neuron(tb1, memory, heading, flows, noise):
    """One step of time of one agent, as the paper's anatomy says it: each neuron by itself. CPU4, CPU1: eight left, eight right."""
    draws = iter(noise)
    tl2 = [sigmoid(math.cos(heading - (i % 8) * math.pi / 4), 6.8, 3.0, next(draws)) for i in range(16)]
    cl1 = [sigmoid(-tl2[i], 3.0, -0.5, next(draws)) for i in range(16)]
    ring = []
    for i in range(8):
        inhibition = sum((1 - math.cos((i - j) * math.pi / 4)) / 2 * tb1[j] for j in range(8))
        ring.append(sigmoid(0.667 * (cl1[i] + cl1[i + 8]) - 0.333 * inhibition, 5.0, 0.0, next(draws)))
    tn2 = [min(max(flow + 0.1 * next(draws), 0), 1) for flow in flows]
    kept = []
    for i in range(16):
        drive = min(max(tn2[i // 8] - ring[i % 8], 0), 1)
        kept.append(min(max(memory[i] + 0.0025 * (drive - 0.125), 0), 1))
    cpu4 = [sigmoid(each, 5.0, 2.5, next(draws)) for each in kept]
    pontine = [sigmoid(each, 5.0, 2.5, next(draws)) for each in cpu4]
    cpu1 = []
    for i in range(16):  # a neuron that turns to one side gets the memory of the other, from the neighbouring column
        column = i % 8
        source = 8 + (column - 1) % 8 if i < 8 else (column + 1) % 8
        opposite = source // 8 * 8 + (source + 4) % 8
        cpu1.append(sigmoid(0.5 * cpu4[source] - 0.5 * pontine[opposite] - ring[column], 7.5, -1.0, next(draws)))
    return ring, kept, cpu4, cpu1


def test_it_computes_what_the_anatomy_says():
    circuit, random = CentralComplex(), np.random.default_rng(5)
    activity, ring, kept = circuit.start(1), [0.0] * 8, [0.5] * 16
    for _ in range(300):
        heading, forward, left = random.uniform(-4, 4), random.uniform(0, 1), random.uniform(-0.2, 0.2)
        noise = random.standard_normal((1, NOISES))
        flows = [forward * math.cos(math.pi / 4) + side * left * math.sin(math.pi / 4) for side in (1, -1)]
        activity = circuit.update(
            activity, np.array([heading]), np.array([forward]), np.array([left]), np.ones(1), noise
        )
        ring, kept, cpu4, cpu1 = neuron_by_neuron(ring, kept, heading, flows, noise[0])
        for rates, expected in (
            (activity.tb1, ring),
            (activity.memory, kept),
            (activity.cpu4, cpu4),
            (activity.cpu1, cpu1),
        ):
            assert np.allclose(rates.ravel(), expected, atol=1e-12)
        assert circuit.steering(activity)[0] == pytest.approx(sum(cpu1[:8]) - sum(cpu1[8:]))


@pytest.mark.parametrize("weight", [0.0, 0.3, 1.0])
def test_a_blend_holds_the_weighted_mean_of_two_vectors(weight):
    activity = walked(random_ways(10, 100), 0.05)
    other = np.random.default_rng(1).normal(0, 5, (10, 2))
    home = QUIET.home_vector(activity)
    blended = QUIET.blended(activity, other, weight)
    assert np.allclose(QUIET.home_vector(blended), (1 - weight) * home + weight * other, atol=1e-9)
    if weight == 0:
        assert differences(blended, activity) < 1e-12


@pytest.mark.parametrize("drift", [-0.15, 0.15])
def test_drifting_to_a_side_turns_the_home_vector(drift):
    headings = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    activity = QUIET.start(64)
    for _ in range(100):
        activity = QUIET.update(activity, headings, np.full(64, 0.5), np.full(64, drift), np.ones(64))
    vector = QUIET.home_vector(activity) @ [1, 1j]
    turned = np.angle(-vector * np.exp(-1j * headings))
    assert turned.mean() == pytest.approx(np.arctan2(drift, 0.5), abs=0.05)
