"""Steering by the central complex: a ring circuit that integrates the path turns the agent towards its nest."""

import logging
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import attrs
import numpy as np
from jaxtyping import Float, Float32

from tussock.world.errors import SettingError
from tussock.world.geometry import turn_of_columns
from tussock.world.settings import number, settings, whole

from ..models.base import FamiliarityModel
from .navigator import Images, Journey, Look, Motion
from .path_integration import distance_walked
from .ring_circuit import Activity, CentralComplex, Noise

_log = logging.getLogger(__name__)
_CIRCUIT = attrs.fields(CentralComplex)
SHARPNESS = 8  # power of the familiarity, 0 to 1 within a view: the most familiar headings count. Chosen here


@dataclass(kw_only=True)
class CircuitMemory:
    """What one agent remembers.

    Attributes:
        activity: Of its central complex.
        random: What the noise of its neurons is drawn from.
    """

    activity: Activity
    random: np.random.Generator


@settings
class CentralComplexSteering:
    """Turns by the difference of what the CPU1 neurons of both sides of a central complex fire.

    The circuit is that of Stone et al. (2017); see `CentralComplex`. An agent walks home along a nearly straight way, overshoots, and
    then searches in loops about the nest: no part of the circuit is there for that. It needs the noise of its neurons: without noise,
    an agent that has passed the nest may walk on and on halfway between the directions of two columns.

    With `vision`, a familiarity model takes part: the headings that it finds most familiar make a second vector, which is added to the
    home vector in the same columns, as in Sun, Yue and Mangan (2020), "A decentralised neural model explaining optimal integration of
    navigational strategies in insects", eLife 9, e54026. It is long where the most familiar headings agree, and short where they do
    not, as far off a route. So vision leads where the home vector is short or the view is clear, and path integration leads elsewhere.
    How the second vector is made, and its length, are chosen here.

    Attributes:
        model: Learns the views of the route; it is used only with `vision`.
        vision: Weight of what is seen, 0 to 1; the rest is that of the home vector. 0: the circuit of Stone et al. alone.
        balance: Length of the home vector that weighs as much as a clear view, at a `vision` of 0.5 (m).
        gain: Turn at a look, for a difference of one neuron that fires at its full rate (rad).
        max_turn: Largest turn at a look (rad).
        unit: Distance in one step of time of the circuit (m): a longer one makes a memory for longer ways, which steers less exactly.
        noise: Standard deviation of the noise on the rate of every neuron.
        seed: Of that noise.
    """

    model: FamiliarityModel | None = attrs.field(default=None)
    vision: float = number(0.0, low=0, high=1)
    balance: float = number(20.0, above=0, unit="m")
    gain: float = number(0.5, low=0)
    max_turn: float = number(np.pi / 2, above=0, high=np.pi, unit="rad")
    unit: float = number(_CIRCUIT.unit.default, above=0, unit="m")
    noise: float = number(_CIRCUIT.noise.default, low=0)
    seed: int = whole(0, low=0)

    @cached_property
    def circuit(self) -> CentralComplex:
        """The circuit, which all agents share; each has its own activity."""
        return CentralComplex(unit=self.unit, noise=self.noise)

    def learn(self, views: Images) -> None:
        """Train the model on the views, if they are to count."""
        if self.vision > 0 and self.model is not None:
            self.model.fit(views)

    def begin(self) -> CircuitMemory:
        """The activity at the nest."""
        return CircuitMemory(activity=self.circuit.start(1), random=np.random.default_rng(self.seed))

    def travel(self, memory: CircuitMemory, journey: Journey) -> None:
        """Take in the way from the goal to where the walk begins."""
        readings = np.stack([journey.compass, journey.odometry])
        # agents that walk side by side have the same seed; their noise must differ, as their ways do
        memory.random = np.random.default_rng([self.seed, zlib.crc32(np.ascontiguousarray(readings).tobytes())])
        for heading, distance in readings.T[:, :, None]:
            memory.activity = self._walked([memory], heading, distance, self._noise([memory]))
        if memory.activity.is_saturated.any():
            _log.warning(
                "the way out of %.0f m is too long for the memory of the central complex, which is saturated: its home vector is wrong; "
                "give central-complex a longer unit than %g m",
                journey.odometry.sum(),
                self.unit,
            )

    def decide(self, look: Look, memories: Sequence[CircuitMemory]) -> Motion:
        """Turn each agent as its circuit says."""
        noise = self._noise(memories)
        activity = self._walked(memories, look.compass, distance_walked(look, "central-complex"), noise)
        for row, memory in enumerate(memories):
            memory.activity = activity[row : row + 1]
        signals, looks = self._signals(activity), np.zeros(len(look), dtype=np.int64)
        if self.vision > 0:
            signals["visual_vector"] = vector = self._visual_vector(look)
            looks = np.full(len(look), look.views.shape[2])
            activity = self.circuit.blended(activity, vector, self.vision, noise)
        turn = np.clip(self.gain * self.circuit.steering(activity), -self.max_turn, self.max_turn)
        return Motion(turn=turn, looks=looks, signals=signals)

    def _visual_vector(self, look: Look) -> Float[np.ndarray, "n 2"]:
        """The vector of what is seen, in the directions of the compass (m)."""
        if self.model is None:
            raise SettingError("the navigator 'central-complex' has vision, but no model; give it one, or set vision=0")
        ahead = familiar_direction(self.model.scan(look.views).cpu().numpy())
        cos, sin = np.cos(look.compass), np.sin(look.compass)
        east, north = cos * ahead[:, 0] - sin * ahead[:, 1], sin * ahead[:, 0] + cos * ahead[:, 1]
        return self.balance * np.stack([east, north], axis=1)

    def _noise(self, memories: Sequence[CircuitMemory]) -> Noise | None:
        """Noise for an update, from the generator of each agent; None without noise."""
        return self.circuit.draw([memory.random for memory in memories]) if self.noise else None

    def _walked(
        self, memories: Sequence[CircuitMemory], heading: np.ndarray, distance: np.ndarray, noise: Noise | None
    ) -> Activity:
        """The activity of agents after they have walked."""
        return self.circuit.walk(Activity.join([memory.activity for memory in memories]), heading, distance, noise)

    def _signals(self, activity: Activity) -> dict[str, np.ndarray]:
        """What is recorded: the home vector in the memory (m), and the rates of neurons, one for each column."""
        n = len(activity)
        return {
            "home_vector": self.circuit.home_vector(activity),
            "tb1": activity.tb1,
            "cpu4": activity.cpu4.reshape(n, -1),
            "cpu1": activity.cpu1.reshape(n, -1),
        }


def familiar_direction(familiarity: Float32[np.ndarray, "n w"]) -> Float[np.ndarray, "n 2"]:
    """Mean direction of the most familiar rotations of views, ahead and to the left, 0 to 1 long: 1 where they all agree.

    Args:
        familiarity: (n, w) Of each view turned left by 0, 1, .. columns.
    """
    low, high = familiarity.min(axis=1, keepdims=True), familiarity.max(axis=1, keepdims=True)
    weights = np.where(high > low, (familiarity - low) / np.where(high > low, high - low, 1), 1.0) ** SHARPNESS
    turns = turn_of_columns(np.arange(familiarity.shape[1]), familiarity.shape[1])
    directions = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return (weights[:, :, None] * directions).sum(axis=1) / weights.sum(axis=1, keepdims=True)
