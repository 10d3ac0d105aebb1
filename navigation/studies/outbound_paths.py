"""Random ways out, and how well a central complex knows the way home from their ends: the experiment of Stone et al. (2017).

This needs no world: a bee flies by the paper's simple physics. Distances are in the paper's unit, the way of one step of time at the
speed that saturates the flow neurons.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from tussock.world.geometry import wrap_angle

from ..steering.ring_circuit import NOISES, Activity, CentralComplex

CONCENTRATION = 100.0  # of the von Mises distribution of turns
FILTER = 0.4  # share of the turn before in each turn
MAX_ACCELERATION = 0.15
HOMING_ACCELERATION = 0.1
DRAG = 0.15  # share of the speed that is lost in a step of time
STEPS_PER_SPEED = 50  # between two random speeds
TURN_SHARE = 0.25  # of the difference of both CPU1 sides, that is the turn of a step of time (rad)


@dataclass(frozen=True, kw_only=True)
class Flight:
    """Flights of n bees, from a nest at (0, 0).

    Attributes:
        heading: (n, steps) In each step of time (rad).
        velocity: (n, steps, 2) In each step, in the directions of the compass.
    """

    heading: Float[np.ndarray, "n steps"]
    velocity: Float[np.ndarray, "n steps 2"]

    @property
    def position(self) -> Float[np.ndarray, "n steps 2"]:
        """Where the bees are after each step."""
        return self.velocity.cumsum(axis=1)


@dataclass(frozen=True, kw_only=True)
class HomeVectorErrors:
    """How far home vectors are from the true ones, after each of some numbers of steps.

    Attributes:
        steps: (k,) Numbers of steps out.
        angle: (n, k) Angle from the true direction of the nest (rad).
        distance: (n, k) Distance between both vectors' ends.
        end_distance: (n, k) Distance of the bee from the nest.
        path_length: (n, k) Length of the way out.
    """

    steps: np.ndarray
    angle: Float[np.ndarray, "n k"]
    distance: Float[np.ndarray, "n k"]
    end_distance: Float[np.ndarray, "n k"]
    path_length: Float[np.ndarray, "n k"]


def random_flights(n: int, steps: int, random: np.random.Generator) -> Flight:
    """Ways out of n bees: turns from a von Mises distribution, filtered, at speeds that vary smoothly."""
    turns = lfilter([1.0], [1.0, -FILTER], random.vonmises(0.0, CONCENTRATION, (n, steps)), axis=1)
    turns[:, 0] = 0.0
    knots = max(4, steps // STEPS_PER_SPEED)
    drawn = random.uniform(0.0, MAX_ACCELERATION, (n, knots))
    acceleration = CubicSpline(np.linspace(0, 1, knots), drawn, axis=1)(np.linspace(0, 1, steps))
    heading, velocity = np.zeros((n, steps)), np.zeros((n, steps, 2))
    for step in range(1, steps):
        heading[:, step], velocity[:, step] = _fly(
            heading[:, step - 1], velocity[:, step - 1], turns[:, step], acceleration[:, step]
        )
    return Flight(heading=heading, velocity=velocity)


def home_vectors(
    circuit: CentralComplex, flight: Flight, steps: np.ndarray, random: np.random.Generator
) -> tuple[Float[np.ndarray, "n k 2"], Activity]:
    """The home vectors of a circuit after each of some numbers of steps, and its activity at the end of the flight.

    Args:
        circuit: Its `unit` must be its `speed`, so that distances are in the paper's unit.
        flight: What the bees fly.
        steps: (k,) Numbers of steps, from 1.
        random: What the circuit's noise is drawn from.
    """
    n, total = flight.heading.shape
    activity, vectors = circuit.start(n), []
    for step in range(total):
        activity = _perceive(circuit, activity, flight.heading[:, step], flight.velocity[:, step], random)
        if step + 1 in steps:
            vectors.append(circuit.home_vector(activity))
    return np.stack(vectors, axis=1), activity


def home_vector_errors(
    circuit: CentralComplex, flight: Flight, steps: np.ndarray, random: np.random.Generator
) -> HomeVectorErrors:
    """How far the home vectors of a circuit are from the true ones; arguments as `home_vectors`."""
    vectors, _ = home_vectors(circuit, flight, steps, random)
    return errors_of(vectors, flight, steps)


def errors_of(vectors: Float[np.ndarray, "n k 2"], flight: Flight, steps: np.ndarray) -> HomeVectorErrors:
    """How far home vectors are from the true ones, after each of some numbers of steps (k,) of a flight."""
    home = -flight.position[:, steps - 1]
    lengths = np.linalg.norm(flight.velocity, axis=2).cumsum(axis=1)
    bearing = np.arctan2(vectors[..., 1], vectors[..., 0]) - np.arctan2(home[..., 1], home[..., 0])
    return HomeVectorErrors(
        steps=steps,
        angle=wrap_angle(bearing),
        distance=np.linalg.norm(vectors - home, axis=2),
        end_distance=np.linalg.norm(home, axis=2),
        path_length=lengths[:, steps - 1],
    )


def fly_home(
    circuit: CentralComplex, activity: Activity, flight: Flight, steps: int, random: np.random.Generator
) -> Float[np.ndarray, "n steps 2"]:
    """Positions of bees that the circuit steers home from the end of a flight, with its activity there."""
    heading, velocity, position = flight.heading[:, -1], flight.velocity[:, -1], flight.position[:, -1]
    positions = []
    for _ in range(steps):
        activity = _perceive(circuit, activity, heading, velocity, random)
        turn = TURN_SHARE * circuit.steering(activity)
        heading, velocity = _fly(heading, velocity, turn, np.full(len(turn), HOMING_ACCELERATION))
        position = position + velocity
        positions.append(position)
    return np.stack(positions, axis=1)


def _fly(heading: np.ndarray, velocity: np.ndarray, turn: np.ndarray, acceleration: np.ndarray):
    """Headings and velocities a step later: a bee turns, and accelerates ahead against drag."""
    heading = wrap_angle(heading + turn)
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    return heading, (1 - DRAG) * (velocity + acceleration[:, None] * ahead)


def _perceive(
    circuit: CentralComplex, activity: Activity, heading: np.ndarray, velocity: np.ndarray, random: np.random.Generator
) -> Activity:
    """The activity after a step of time with a heading and a velocity."""
    cos, sin = np.cos(heading), np.sin(heading)
    forward, left = cos * velocity[:, 0] + sin * velocity[:, 1], cos * velocity[:, 1] - sin * velocity[:, 0]
    noise = random.standard_normal((len(heading), NOISES)) if circuit.noise else None
    return circuit.update(activity, heading, forward, left, np.ones(len(heading)), noise)
