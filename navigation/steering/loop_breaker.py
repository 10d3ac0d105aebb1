"""Loop breaker: any navigator, and a way out where it walks in loops."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import attrs
import numpy as np
from jaxtyping import Float

from tussock.world.errors import SettingError
from tussock.world.geometry import wrap_angle
from tussock.world.settings import choice, converted, number, settings, whole
from tussock.world.specs import Spec

from ..models.base import FamiliarityModel
from .combined import Remembered, learn_each, made, models_of, navigator_spec, take_trained, travel
from .navigator import SIDES, Images, Journey, Look, Motion, Navigator


@settings
class LoopBreaker:
    """Steers as another navigator does, unless the agent's own path integration says that it gets nowhere.

    Over the last `within` metres that it walked, an agent adds up its steps by compass and odometry. Where it has come less far than
    `progress` of these, it is in a loop: for `escape` metres it keeps the direction in which it came into the loop, turned by `aside`, and
    to the other side the next time. Ants that get nowhere likewise break off and walk on straight (a reading of ours; no published model).

    Attributes:
        model: Of the navigator.
        navigator: Its spec.
        within: Distance over which progress is measured (m).
        progress: Share of it, 0 to 1, that the agent must get on.
        escape: Length of the way out (m).
        aside: How much the way out turns from the direction of the way before (rad).
        first: The side of the first way out.
        seed: For a navigator that draws random numbers.
    """

    model: FamiliarityModel = attrs.field()
    navigator: Spec = converted(default="scan", converter=navigator_spec)
    within: float = number(1.0, above=0, unit="m")
    progress: float = number(0.1, low=0, high=1)
    escape: float = number(0.2, above=0, unit="m")
    aside: float = number(np.pi / 6, low=0, high=np.pi, unit="rad")
    first: str = choice("left", tuple(SIDES))
    seed: int = whole(0, low=0)
    steers: Navigator = attrs.field(init=False)

    def __attrs_post_init__(self) -> None:
        object.__setattr__(self, "steers", made(self.navigator, self.model, self.seed))

    @property
    def models(self) -> tuple[FamiliarityModel, ...]:
        """What it steers by."""
        return models_of([self.steers])

    @property
    def takes_trained(self) -> bool:
        """Whether it can use a model that has learned already."""
        return take_trained([self.steers])

    def learn(self, views: Images) -> None:
        """Let the navigator learn the views (n, h, w)."""
        learn_each([self.steers], views, None)

    def learn_at(self, views: Images, places: Float[np.ndarray, "n 3"]) -> None:
        """Let the navigator learn the views (n, h, w), and where they were seen (n, 3), if it does."""
        learn_each([self.steers], views, places)

    def begin(self) -> "LoopMemory":
        """What an agent remembers: the navigator's part, and its own steps."""
        return LoopMemory([self.steers.begin()], side=SIDES[self.first])

    def travel(self, memory: "LoopMemory", journey: Journey) -> None:
        """Take in the way out from the goal."""
        travel([self.steers], memory, journey)

    def decide(self, look: Look, memories: Sequence[Any]) -> Motion:
        """As the navigator, or out of a loop."""
        if look.odometry is None:
            raise SettingError("loop-breaker needs an odometer; give the look its odometry")
        motion = self.steers.decide(look, [memory.parts[0] for memory in memories])
        turn, escapes = np.array(motion.turn, dtype=float), np.zeros(len(look))
        for row, (memory, compass, walked) in enumerate(zip(memories, look.compass, look.odometry, strict=True)):
            direction = self._way_out(memory, float(compass), float(walked))
            if direction is not None:
                turn[row], escapes[row] = wrap_angle(direction - compass), 1.0
        return replace(motion, turn=turn, signals={**motion.signals, "escaping": escapes})

    def _way_out(self, memory: "LoopMemory", compass: float, walked: float) -> float | None:
        """The direction in which an agent leaves a loop (rad); None while it is in none."""
        memory.add(walked * np.exp(1j * compass), walked)
        if memory.left > 0:
            memory.left -= walked
            return memory.direction
        if memory.length < self.within or abs(sum(memory.steps)) >= self.progress * memory.length:
            memory.forget(self.within)
            return None
        way_in = memory.way_in if abs(memory.way_in) > 0 else np.exp(1j * compass)
        memory.direction = float(np.angle(way_in)) + memory.side * self.aside
        memory.left, memory.side = self.escape, -memory.side
        memory.steps.clear()
        memory.lengths.clear()
        return memory.direction


@dataclass
class LoopMemory(Remembered):
    """What an agent remembers of its own steps.

    Attributes:
        side: Of the next way out: 1 left, -1 right.
        steps: The last ones, east + i north (m), as it measured them.
        lengths: Of these (m).
        way_in: Sum of the steps before these, in which newer ones weigh more (m).
        direction: Of the present way out (rad).
        left: Of it (m).
    """

    side: float = 1.0
    steps: deque[complex] = field(default_factory=deque)
    lengths: deque[float] = field(default_factory=deque)
    way_in: complex = 0j
    direction: float = 0.0
    left: float = 0.0

    def resume(self, progress: float) -> None:
        """Go on where it was put back, after this share (0 to 1) of the route, out of any loop."""
        super().resume(progress)
        self.steps.clear()
        self.lengths.clear()
        self.way_in, self.left = 0j, 0.0

    @property
    def length(self) -> float:
        """Of the last steps together (m)."""
        return sum(self.lengths)

    def add(self, step: complex, length: float) -> None:
        """Remember a step."""
        self.steps.append(step)
        self.lengths.append(length)

    def forget(self, within: float) -> None:
        """Leave the steps that lie longer back than this (m) to the way in."""
        while self.length - (self.lengths[0] if self.lengths else 0.0) >= within:
            self.way_in = 0.9 * self.way_in + self.steps.popleft()
            self.lengths.popleft()
