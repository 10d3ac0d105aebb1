"""The central complex as a circuit of firing rates: a ring for the heading, a memory for the way home, and two sides that steer.

    circuit = CentralComplex(noise=0.0)
    activity = circuit.start(1)
    for heading, metres in steps:
        activity = circuit.walk(activity, heading, metres)
    circuit.home_vector(activity)  # (n, 2) metres
    circuit.steering(activity)     # (n,) positive: turn left

Stone et al. (2017), "An anatomically constrained model for path integration in the bee brain", Current Biology 27, 3069-3085: the
rate model with pontine neurons, in its published size. All its parts are batched over agents, and the circuit keeps no state.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import expit

from tussock.world.settings import instance_of, number, settings

COLUMNS = 8
DIRECTIONS = np.arange(COLUMNS) * 2 * np.pi / COLUMNS  # rad, that the columns stand for
_AXES = np.stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])
_INHIBITION = (1 - np.cos(DIRECTIONS[:, None] - DIRECTIONS)) / 2  # (8, 8) of each TB1 neuron by the others
# numbers of neurons, each of which has its noise
_DRAWS = {"tl2": 16, "cl1": 16, "tb1": 8, "tn2": 2, "cpu4": 16, "pontine": 16, "cpu1": 16}
NOISES = sum(_DRAWS.values())

Rows = Float[np.ndarray, " n"]
Noise = Float[np.ndarray, "n noises"]


@settings
class Sigmoid:
    """How a neuron's rate depends on its input: 1 / (1 + exp(bias - slope x input)).

    Attributes:
        slope: Slope.
        bias: Bias.
    """

    slope: float = number()
    bias: float = number()

    def __call__(self, inputs: np.ndarray, noise: np.ndarray | float) -> np.ndarray:
        """Rates of an input, plus noise of the same shape, between 0 and 1."""
        return np.clip(expit(self.slope * inputs - self.bias) + noise, 0.0, 1.0)


def _sigmoid(slope: float, bias: float) -> Any:
    """A field for a sigmoid."""
    return instance_of(Sigmoid, Sigmoid(slope=slope, bias=bias), "a Sigmoid")


@dataclass(frozen=True, kw_only=True)
class Activity:
    """Rates of the neurons of n agents, 0 to 1. The last axis has one number per column; of two sides, the first is the left one.

    Attributes:
        tb1: (n, 8) The ring: lowest in the column of the heading, highest opposite.
        memory: (n, 2, 8) What CPU4 has summed up: highest in the direction from the nest to the agent.
        cpu4: (n, 2, 8) Rates of the memory neurons.
        cpu1: (n, 2, 8) Rates of the neurons that turn the agent to the left, and to the right.
    """

    tb1: Float[np.ndarray, "n 8"]
    memory: Float[np.ndarray, "n 2 8"]
    cpu4: Float[np.ndarray, "n 2 8"]
    cpu1: Float[np.ndarray, "n 2 8"]

    def __len__(self) -> int:
        return len(self.tb1)

    def __getitem__(self, rows: slice) -> "Activity":
        return Activity(tb1=self.tb1[rows], memory=self.memory[rows], cpu4=self.cpu4[rows], cpu1=self.cpu1[rows])

    @property
    def is_saturated(self) -> Bool[np.ndarray, " n"]:
        """Whether a neuron of the memory can hold no more, so that the home vector is wrong."""
        return np.any((self.memory <= 0) | (self.memory >= 1), axis=(1, 2))

    @classmethod
    def join(cls, activities: Sequence["Activity"]) -> "Activity":
        """The activity of the agents of all of them."""
        names = [each.name for each in fields(cls)]
        return cls(**{name: np.concatenate([getattr(each, name) for each in activities]) for name in names})


@settings
class CentralComplex:
    """A central complex: 16 TL2, 16 CL1, 8 TB1, 2 TN2, 16 CPU4, 16 pontine and 16 (14 + 2) CPU1 neurons.

    The constants are those of the paper and of its public code, but for `unit` and `speed`. The circuit was made for a flying bee
    and steps of time; here its time runs with the distance: an agent always walks at the same `speed`, and `unit` says how far it
    comes in one step of time. A longer unit makes a memory that saturates later, and steers less exactly.

    The memory of a straight way begins to saturate after `reach`: 56 m by default (46 m without noise), and in proportion to `unit`.
    Beyond it, the home vector is too short, and its direction becomes wrong as well.

    Attributes:
        memory_gain: What one step of time adds to the memory, for a full input.
        fade: Input that the memory loses in a step of time; at the default speed it balances what the ways in all directions add.
        noise: Standard deviation of the normal noise on the rate of every neuron.
        compass_share: Share of CL1 in the input of TB1; the rest is inhibition among TB1 neurons.
        flow_angle: Angle between the heading and the direction in which a TN2 neuron responds most (rad).
        speed: Flow that an agent sees as it walks, where 1 saturates the TN2 neurons. Chosen here.
        unit: Distance that it walks in one step of time (m). Chosen here.
        tl2: Sigmoid of the TL2 neurons, which respond to the compass.
        cl1: Sigmoid of the CL1 neurons, which TL2 inhibits.
        tb1: Sigmoid of the TB1 neurons.
        cpu4: Sigmoid of the CPU4 neurons.
        pontine: Sigmoid of the pontine neurons, through which each CPU4 neuron inhibits the opposite column.
        cpu1: Sigmoid of the CPU1 neurons.
    """

    memory_gain: float = number(0.0025, above=0, high=0.5)
    fade: float = number(0.125, low=0, high=1)
    noise: float = number(0.1, low=0)
    compass_share: float = number(0.667, low=0, high=1)
    flow_angle: float = number(np.pi / 4, low=0, high=np.pi / 2, unit="rad")
    speed: float = number(0.5, above=0, high=1)
    unit: float = number(0.05, above=0, unit="m")
    tl2: Sigmoid = _sigmoid(6.8, 3.0)
    cl1: Sigmoid = _sigmoid(3.0, -0.5)
    tb1: Sigmoid = _sigmoid(5.0, 0.0)
    cpu4: Sigmoid = _sigmoid(5.0, 2.5)
    pontine: Sigmoid = _sigmoid(5.0, 2.5)
    cpu1: Sigmoid = _sigmoid(7.5, -1.0)

    def start(self, n: int) -> Activity:
        """The activity of n agents at their nest: a memory of no way at all."""
        silent = np.zeros((n, 2, COLUMNS))
        return Activity(tb1=np.zeros((n, COLUMNS)), memory=silent + 0.5, cpu4=silent, cpu1=silent)

    def draw(self, generators: Sequence[np.random.Generator]) -> Noise:
        """Noise for one update: a row from the generator of each agent."""
        return np.array([each.standard_normal(NOISES) for each in generators]).reshape(-1, NOISES)

    def walk(self, activity: Activity, heading: Rows, distance: Rows, noise: Noise | None = None) -> Activity:
        """The activity after each agent has walked straight ahead.

        Args:
            activity: Their activity before.
            heading: (n,) Of each agent as it walked (rad).
            distance: (n,) That it walked (m).
            noise: (n, 90) As `draw` makes it; None means a circuit without noise.
        """
        forward = np.full(len(activity), self.speed)
        return self.update(activity, heading, forward, np.zeros(len(activity)), distance / self.unit, noise)

    def update(
        self,
        activity: Activity,
        heading: Rows,
        forward: Rows,
        left: Rows,
        duration: Rows,
        noise: Noise | None = None,
    ) -> Activity:
        """The activity after some steps of time with one heading, as the paper computes it for one.

        Args:
            activity: Before.
            heading: (n,) Of each agent (rad).
            forward: (n,) Its speed ahead, where 1 saturates the TN2 neurons.
            left: (n,) Its speed to its left, likewise: a bee drifts.
            duration: (n,) Number of steps of time.
            noise: (n, 90) As `draw` makes it; None means none.
        """
        of = self._noise(len(activity), noise)
        tb1 = self._compass(activity.tb1, heading, of)
        ahead, aside = np.cos(self.flow_angle), np.sin(self.flow_angle)
        flow = np.stack([ahead * forward + aside * left, ahead * forward - aside * left], axis=1)
        tn2 = np.clip(flow + of["tn2"], 0.0, 1.0)
        change = np.clip(tn2[:, :, None] - tb1[:, None], 0.0, 1.0) - self.fade
        memory = np.clip(activity.memory + self.memory_gain * duration[:, None, None] * change, 0.0, 1.0)
        cpu4 = self.cpu4(memory, of["cpu4"].reshape(-1, 2, COLUMNS))
        return Activity(tb1=tb1, memory=memory, cpu4=cpu4, cpu1=self._cpu1(tb1, cpu4, of))

    def steering(self, activity: Activity) -> Rows:
        """How much more the CPU1 neurons of the left side fire than those of the right; positive to turn left."""
        return activity.cpu1[:, 0].sum(axis=1) - activity.cpu1[:, 1].sum(axis=1)

    def home_vector(self, activity: Activity) -> Float[np.ndarray, "n 2"]:
        """The way to the nest that the memory holds, in the directions of the compass (m): its first Fourier component.

        No neuron computes it: it is for measuring.
        """
        return -self._outward(activity.memory) * self.unit / self._per_step

    def blended(
        self, activity: Activity, vector: Float[np.ndarray, "n 2"], weight: float, noise: Noise | None = None
    ) -> Activity:
        """The activity as if the home vector were a weighted mean of itself and another vector.

        Sun, Yue and Mangan (2020) add what vision says of the way home to the same columns: a longer vector weighs more, which is the
        best of both cues where its length says how sure it is.

        Args:
            activity: Of the agents. What their memory holds is not changed.
            vector: (n, 2) The other vector, in the directions of the compass (m).
            weight: Of the other vector, 0 to 1.
            noise: (n, 90) As of the last update, for the same noise on CPU4, pontine and CPU1 neurons.
        """
        of = self._noise(len(activity), noise)
        scale = self._per_step / self.unit / (np.sqrt(2) * COLUMNS / 2)  # of a cosine whose vector is 1 m long
        other = -scale * (vector[:, :, None] * _AXES).sum(axis=1)
        held = 0.5 + (1 - weight) * (activity.memory - 0.5) + weight * other[:, None]
        cpu4 = self.cpu4(held, of["cpu4"].reshape(-1, 2, COLUMNS))
        cpu1 = self._cpu1(activity.tb1, cpu4, of)
        return Activity(tb1=activity.tb1, memory=held, cpu4=cpu4, cpu1=cpu1)

    def towards_end(self, activity: Activity) -> Activity:
        """The activity of an agent at its nest that remembers the end of a way, as a vector memory: it steers to there.

        Args:
            activity: At the end of the way, as food was found there.
        """
        start = self.start(len(activity))
        memory = np.roll(activity.memory, COLUMNS // 2, axis=2)
        return Activity(tb1=start.tb1, memory=memory, cpu4=start.cpu4, cpu1=start.cpu1)

    @property
    def reach(self) -> float:
        """Length of a straight way after which the first neuron of the memory saturates (m)."""
        rate = np.abs(self._one_step(np.zeros(1))).max()
        return float(0.5 / rate * self.unit)

    def _compass(self, tb1: np.ndarray, heading: np.ndarray, of: dict[str, np.ndarray]) -> np.ndarray:
        """Rates (n, 8) of TB1, from those before and the heading, by way of TL2 and CL1, two neurons for each column."""
        tuned = np.tile(np.cos(heading[:, None] - DIRECTIONS), 2)
        cl1 = self.cl1(-self.tl2(tuned, of["tl2"]), of["cl1"])
        # no matrix product, whose last bits depend on the number of rows: a batch must give what singles give
        inhibition = (tb1[:, None] * _INHIBITION).sum(axis=2)
        excitation = cl1[:, :COLUMNS] + cl1[:, COLUMNS:]
        return self.tb1(self.compass_share * excitation - (1 - self.compass_share) * inhibition, of["tb1"])

    def _cpu1(self, tb1: np.ndarray, cpu4: np.ndarray, of: dict[str, np.ndarray]) -> np.ndarray:
        """Rates (n, 2, 8) of CPU1: memory, turned by a column to either side, against the heading."""
        pontine = self.pontine(cpu4, of["pontine"].reshape(-1, 2, COLUMNS))
        inputs = 0.5 * (cpu4 - np.roll(pontine, COLUMNS // 2, axis=2))
        crossed = np.stack([np.roll(inputs[:, 1], 1, axis=1), np.roll(inputs[:, 0], -1, axis=1)], axis=1)
        return self.cpu1(crossed - tb1[:, None], of["cpu1"].reshape(-1, 2, COLUMNS))

    def _outward(self, memory: np.ndarray) -> np.ndarray:
        """The vector (n, 2) that a memory holds, from the nest, in its own unit. Each side holds the way along its axis of flow."""
        sides = np.stack([np.roll(memory[:, 0], 1, axis=1), np.roll(memory[:, 1], -1, axis=1)], axis=1)
        columns = sides.sum(axis=1)
        return np.stack([(columns * axis).sum(axis=1) for axis in _AXES], axis=1)

    @cached_property
    def _per_step(self) -> float:
        """Length of the vector that a step of time adds to the memory, the mean over all headings."""
        headings = np.linspace(0, 2 * np.pi, 360, endpoint=False)
        outward = self._outward(self._one_step(headings))
        return float((outward[:, 0] * np.cos(headings) + outward[:, 1] * np.sin(headings)).mean())

    def _one_step(self, headings: np.ndarray) -> np.ndarray:
        """What a step of time adds to the memory (n, 2, 8), once the ring has settled; the mean over the noise."""
        random, still = np.random.default_rng(0), np.zeros(len(headings))
        parts = 100 if self.noise else 1
        activity = self.start(len(headings))
        for distance in [still] * 20 + [still + self.unit / parts] * parts:
            noise = random.standard_normal((len(headings), NOISES)) if self.noise else None
            activity = self.walk(activity, headings, distance, noise)
        return activity.memory - 0.5

    def _noise(self, n: int, noise: Noise | None) -> dict[str, np.ndarray]:
        """The noise (n, k) on the rates of each kind of neuron."""
        rows = np.zeros((n, NOISES)) if noise is None else self.noise * noise
        return dict(zip(_DRAWS, np.split(rows, np.cumsum(list(_DRAWS.values()))[:-1], axis=1), strict=True))
