"""Opponent memories: one draws the agent on, the other turns it away."""

import copy
from typing import Any, TypeVar

import torch

from .base import Images, IncrementalModel, Learned, Model, Scans

T = TypeVar("T")


class Opponent(Model):
    """Any model twice: an attractive memory of views that face along the route, a repulsive one of views that face away from it.

    Familiarity is the attractive memory's less the repulsive one's: their difference steers. The views that face away are the same
    ones turned by half a turn. Memory: twice the model's.
    """

    paper = "Le Moel and Wystrach 2020"

    def __init__(self, model: Model):
        super().__init__(device=model.device, seed=model.seed)
        self.attractive, self.repulsive = copy.deepcopy(model), copy.deepcopy(model)
        self.name = f"opponent-{model.name}"

    def __repr__(self) -> str:
        return f"Opponent({self.attractive!r})"

    def __str__(self) -> str:
        return f"opponent-{self.attractive}"

    @property
    def parameters(self) -> dict[str, Any]:
        """Those of the model it is made of."""
        return self.attractive.parameters

    def check_parameters(self) -> None:
        """As the model it is made of."""
        self.attractive.check_parameters()

    def _learn(self, views: Images) -> Learned:
        return both(self.attractive._learn(views), self.repulsive._learn(facing_away(views)))

    def _shapes(self, height: int, width: int) -> dict[str, tuple[int | None, ...]]:
        shapes = self.attractive._shapes(height, width)
        return both(shapes, shapes)

    def _prepare(self) -> None:
        assert self.shape is not None
        for side in ("attractive", "repulsive"):
            model = copy.copy(getattr(self, side))
            model.restore(self.shape, one(side, self.learned))
            setattr(self, side, model)

    def _scan(self, views: Images) -> Scans:
        return self.attractive.scan(views) - self.repulsive.scan(views)


class IncrementalOpponent(Opponent, IncrementalModel):
    """Opponent memories of a model that learns view by view."""

    attractive: IncrementalModel
    repulsive: IncrementalModel

    def _begin(self, height: int, width: int) -> Learned:
        return both(self.attractive._begin(height, width), self.repulsive._begin(height, width))

    def _add(self, learned: Learned, views: Images) -> Learned:
        attractive, repulsive = one("attractive", learned), one("repulsive", learned)
        return both(self.attractive._add(attractive, views), self.repulsive._add(repulsive, facing_away(views)))


def opponent(model: Model) -> Opponent:
    """Opponent memories of an untrained model; they learn view by view where it does."""
    return (IncrementalOpponent if isinstance(model, IncrementalModel) else Opponent)(model)


def facing_away(views: Images) -> Images:
    """The views turned by half a turn (to the column, where the width is odd)."""
    return torch.roll(views, views.shape[-1] // 2, dims=-1)


def both(attractive: dict[str, T], repulsive: dict[str, T]) -> dict[str, T]:
    """What two memories hold, by name, as one holds it."""
    sides = {"attractive": attractive, "repulsive": repulsive}
    return {f"{side}.{key}": value for side, values in sides.items() for key, value in values.items()}


def one(side: str, learned: Learned) -> Learned:
    """What one memory holds of what `both` put together."""
    return {key.removeprefix(f"{side}."): value for key, value in learned.items() if key.startswith(f"{side}.")}
