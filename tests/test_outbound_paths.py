"""The experiment of Stone et al. (2017): random ways out, home vectors, and flights home."""

import numpy as np

from tussock.navigation.steering.ring_circuit import CentralComplex
from tussock.navigation.studies.outbound_paths import fly_home, home_vector_errors, home_vectors, random_flights


def bee(noise):
    return CentralComplex(noise=noise, unit=0.5)  # distances in the paper's unit


def test_flights_are_smooth_and_never_faster_than_the_flow_neurons_can_tell():
    flight = random_flights(20, 400, np.random.default_rng(0))
    speed = np.linalg.norm(flight.velocity, axis=2)
    assert speed.max() < 1
    assert np.allclose(flight.position[:, -1], flight.velocity.sum(axis=1))
    assert np.abs(np.diff(np.unwrap(flight.heading, axis=1), axis=1)).max() < 1
    again = random_flights(20, 400, np.random.default_rng(0))
    assert (again.velocity == flight.velocity).all()


def test_home_vectors_are_within_a_tenth_of_the_distance_at_the_noise_of_the_paper():
    flight = random_flights(40, 400, np.random.default_rng(1))
    steps = np.array([200, 400])
    errors = home_vector_errors(bee(0.1), flight, steps, np.random.default_rng(2))
    assert errors.end_distance.shape == (40, 2)
    assert (errors.path_length >= errors.end_distance).all()
    assert np.median(errors.distance / errors.end_distance, axis=0).max() < 0.1
    assert np.median(np.abs(errors.angle)) < np.radians(4)
    noisy = home_vector_errors(bee(0.3), flight, steps, np.random.default_rng(2))
    assert np.median(noisy.distance) > 1.5 * np.median(errors.distance)


def test_bees_fly_home_and_search_about_the_nest():
    circuit, flight = bee(0.1), random_flights(30, 600, np.random.default_rng(3))
    _, activity = home_vectors(circuit, flight, np.array([600]), np.random.default_rng(4))
    distance = np.linalg.norm(fly_home(circuit, activity, flight, 900, np.random.default_rng(5)), axis=2)
    assert np.median(distance[:, 0]) > 50
    assert np.median(distance.min(axis=1)) < 5
    assert np.median(distance[:, 600:]) < 40
