"""Blend: two navigators at once, each as far as it is certain."""

import copy
from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np
from jaxtyping import Float

from tussock.world.settings import converted, number, settings, whole
from tussock.world.specs import Spec

from ..models.base import FamiliarityModel
from .combined import Remembered, learn_each, made, models_of, navigator_spec, take_trained, travel
from .navigator import Images, Journey, Look, Motion, Navigator


@settings
class Blend:
    """Turns to the mean of two directions, weighed by the certainty of the navigators that want them.

        direction = angle of (1 - weight) c1 exp(i turn1) + weight c2 exp(i turn2)

    where c1 and c2 are their certainties: of lateral memories, how familiar the view is; of a scan, how far its best heading stands out;
    of path integration, how long the home vector is. So a ring of neurons adds cues of different reliability (Sun et al. 2020).

    Attributes:
        model: Of which each navigator that needs one gets a copy.
        one: A navigator's spec.
        other: Another's.
        weight: Of the other, 0 to 1.
        seed: For the one of them that draws random numbers.
    """

    model: FamiliarityModel = attrs.field()
    one: Spec = converted(default="lateral", converter=navigator_spec)
    other: Spec = converted(default="path-integration", converter=navigator_spec)
    weight: float = number(0.5, low=0, high=1)
    seed: int = whole(0, low=0)
    navigators: tuple[Navigator, Navigator] = attrs.field(init=False)

    def __attrs_post_init__(self) -> None:
        both = tuple(made(spec, copy.deepcopy(self.model), self.seed) for spec in (self.one, self.other))
        object.__setattr__(self, "navigators", both)

    @property
    def models(self) -> tuple[FamiliarityModel, ...]:
        """What it steers by."""
        return models_of(self.navigators)

    @property
    def takes_trained(self) -> bool:
        """Whether it can use a model that has learned already."""
        return take_trained(self.navigators)

    def learn(self, views: Images) -> None:
        """Let both learn the views (n, h, w)."""
        learn_each(self.navigators, views, None)

    def learn_at(self, views: Images, places: Float[np.ndarray, "n 3"]) -> None:
        """Let both learn the views (n, h, w), and where they were seen (n, 3), if they do."""
        learn_each(self.navigators, views, places)

    def begin(self) -> Remembered:
        """What an agent remembers for each of them."""
        return Remembered([navigator.begin() for navigator in self.navigators])

    def travel(self, memory: Remembered, journey: Journey) -> None:
        """Take in the way out."""
        travel(self.navigators, memory, journey)

    def decide(self, look: Look, memories: Sequence[Any]) -> Motion:
        """Turn each agent to the mean direction; it steps as far as the two do on average."""
        motions = [
            navigator.decide(look, [memory.parts[k] for memory in memories])
            for k, navigator in enumerate(self.navigators)
        ]
        ones = np.ones(len(look))
        weights = [
            share * (ones if motion.certainty is None else motion.certainty)
            for share, motion in zip((1 - self.weight, self.weight), motions, strict=True)
        ]
        unsure = weights[0] + weights[1] <= 0  # then the shares alone decide
        weights = [
            np.where(unsure, share, each) for share, each in zip((1 - self.weight, self.weight), weights, strict=True)
        ]
        total = np.maximum(weights[0] + weights[1], np.finfo(float).tiny)
        vector = sum(weight * np.exp(1j * motion.turn) for weight, motion in zip(weights, motions, strict=True)) / total
        steps = [ones if motion.step is None else motion.step for motion in motions]
        signals = {
            f"{name}_{key}": value
            for name, motion in zip(("one", "other"), motions, strict=True)
            for key, value in motion.signals.items()
        }
        return Motion(
            turn=np.angle(vector),
            step=((weights[0] * steps[0] + weights[1] * steps[1]) / total).clip(0, 1),
            scan=next((motion.scan for motion in motions if motion.scan is not None), None),
            certainty=np.abs(vector).clip(0, 1),
            looks=np.array([max(motion.looks_of(row) for motion in motions) for row in range(len(look))]),
            signals=signals | {"weight_of_other": weights[1] / total},
        )
