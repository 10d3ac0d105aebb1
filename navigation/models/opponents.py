"""Opponent memories: one attracts the agent, the other turns it away."""

import copy
import inspect
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, TypeVar

import torch

from ..feature_mask import FeatureMask, seeing
from .base import FamiliarityModel, Images, Learned, Model, Scans, Scores, Shapes, memory_bytes, recognises, score
from .incremental import IncrementalModel
from .registry import OPPONENT

T = TypeVar("T")
Memories = TypeVar("Memories", bound="Opponent")


class Opponent(Model):
    """Any model twice: an attractive memory of views that face along the route, a repulsive one of views that face away from it.

    Familiarity is the attractive memory's less the repulsive one's: their difference steers. The views that face away are the same
    ones turned by half a turn. Memory: twice the model's.

    Attributes:
        attractive: The model that learns the views.
        repulsive: The model that learns the views turned by half a turn.
    """

    paper = "Le Moel and Wystrach 2020"

    def __init__(self, model: Model):
        super().__init__(device=model.device, seed=model.seed)
        self.attractive, self.repulsive = copy.deepcopy(model), copy.deepcopy(model)
        self.name = OPPONENT + model.name

    def __repr__(self) -> str:
        return f"Opponent({self.attractive!r})"

    def __str__(self) -> str:
        return f"{OPPONENT}{self.attractive}"

    @property
    def parameters(self) -> dict[str, Any]:
        """Those of the model."""
        return self.attractive.parameters

    @property
    def dtypes(self) -> Mapping[str, torch.dtype | None]:  # type: ignore[override]
        """Of learned tensors that are not float32."""
        return _joined(self.attractive.dtypes, self.repulsive.dtypes)

    @property
    def takes_mask(self) -> bool:  # type: ignore[override]
        """Whether the model minds `mask`."""
        return self.attractive.takes_mask

    @property
    def recognises(self) -> bool:  # type: ignore[override]
        """Whether the model recognises views."""
        return self.attractive.recognises

    def see(self: Memories, mask: FeatureMask | None) -> Memories:
        """Both memories see through the same mask."""
        super().see(mask)
        for memory in (self.attractive, self.repulsive):
            memory.see(mask)
        return self

    def _learn(self, views: Images) -> Learned:
        return _joined(self.attractive._learn(views), self.repulsive._learn(facing_away(views)))

    def _shapes(self, height: int, width: int) -> Shapes:
        return _joined(self.attractive._shapes(height, width), self.repulsive._shapes(height, width))

    def _prepare(self) -> None:
        assert self.shape is not None
        for side in ("attractive", "repulsive"):
            model = copy.copy(getattr(self, side))
            model.restore(self.shape, _part(self.learned, side))
            setattr(self, side, model)

    def _scan(self, views: Images) -> Scans:
        return self.attractive.scan(views) - self.repulsive.scan(views)

    def _score(self, views: Images) -> Scores:
        return self.attractive.score(views) - self.repulsive.score(views)


class IncrementalOpponent(Opponent, IncrementalModel):
    """Opponent memories of a model that learns view by view."""

    attractive: IncrementalModel
    repulsive: IncrementalModel

    def _begin(self, height: int, width: int) -> Learned:
        return _joined(self.attractive._begin(height, width), self.repulsive._begin(height, width))

    def _add(self, learned: Learned, views: Images) -> Learned:
        attractive, repulsive = _part(learned, "attractive"), _part(learned, "repulsive")
        return _joined(self.attractive._add(attractive, views), self.repulsive._add(repulsive, facing_away(views)))


class OutsideOpponent:
    """Opponent memories of a model that does not derive from `Model`."""

    def __init__(self, model: Any):
        self.attractive, self.repulsive = copy.deepcopy(model), copy.deepcopy(model)

    def see(self, mask: FeatureMask | None) -> "OutsideOpponent":
        """Both memories see through the same mask. Raises SettingError where the model does not mind that."""
        seeing(self.attractive, mask)
        seeing(self.repulsive, mask)
        return self

    def fit(self, views: Images) -> "OutsideOpponent":
        """Let both memories learn the views."""
        self.attractive.fit(views)
        self.repulsive.fit(facing_away(views))
        return self

    def scan(self, views: Images) -> Scans:
        """Familiarity of each rotation, of the attractive memory less that of the repulsive one."""
        return self.attractive.scan(views) - self.repulsive.scan(views)

    def score(self, views: Images) -> Scores:
        """The same at the present heading."""
        return score(self.attractive, views) - score(self.repulsive, views)

    @property
    def recognises(self) -> bool:
        """Whether the model recognises views."""
        return recognises(self.attractive)

    @property
    def memory_bytes(self) -> int | None:
        """Size of what both have learned; None where the model does not report it."""
        attractive, repulsive = memory_bytes(self.attractive), memory_bytes(self.repulsive)
        return None if attractive is None or repulsive is None else attractive + repulsive


def opponent(model: FamiliarityModel) -> Any:
    """Opponent memories of an untrained model. They learn view by view, and can be saved, where the model does and can."""
    if isinstance(model, IncrementalModel):
        return IncrementalOpponent(model)
    return Opponent(model) if isinstance(model, Model) else OutsideOpponent(model)


@cache
def opponents_of(cls: Callable[..., FamiliarityModel]) -> Callable[..., FamiliarityModel]:
    """A function that makes opponent memories, with the parameters of a class of models."""

    def make(**parameters: Any) -> FamiliarityModel:
        return opponent(cls(**parameters))

    make.__signature__ = inspect.signature(cls)  # type: ignore[attr-defined]
    make.__module__, make.__qualname__ = cls.__module__, f"{OPPONENT}{getattr(cls, '__qualname__', '')}"
    make.renamed = getattr(cls, "renamed", {})  # type: ignore[attr-defined]
    return make


def facing_away(views: Images) -> Images:
    """The views turned by half a turn (to the column, where the width is odd)."""
    return torch.roll(views, views.shape[-1] // 2, dims=-1)


def _joined(attractive: Mapping[str, T], repulsive: Mapping[str, T]) -> dict[str, T]:
    """What two memories hold by name, in one mapping."""
    sides = {"attractive": attractive, "repulsive": repulsive}
    return {f"{side}.{key}": value for side, values in sides.items() for key, value in values.items()}


def _part(learned: Learned, side: str) -> Learned:
    """What one memory holds of a mapping that `_joined` made."""
    return {key.removeprefix(f"{side}."): value for key, value in learned.items() if key.startswith(f"{side}.")}
