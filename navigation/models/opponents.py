"""Opponent memories: one attracts the agent, the other turns it away."""

from typing import Any

import torch

from .base import FamiliarityModel, Images, Model
from .incremental import IncrementalModel
from .registry import OPPONENT
from .two_memories import IncrementalTwoMemories, OutsideMemories, TwoMemories, two_memories


class Opponent(TwoMemories):
    """Any model twice: an attractive memory of views that face along the route, a repulsive one of views that face away from it.

    Familiarity is the attractive memory's less the repulsive one's: their difference steers. The views that face away are the same
    ones turned by half a turn. Memory: twice the model's.

    Attributes:
        attractive: The model that learns the views.
        repulsive: The model that learns the views turned by half a turn.
    """

    paper = "Le Moel and Wystrach 2020"
    prefix = OPPONENT
    sides = ("attractive", "repulsive")
    attractive: Model
    repulsive: Model

    @classmethod
    def combined(cls, first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
        """The attractive memory's less the repulsive one's."""
        return first - second

    @classmethod
    def views_of(cls, side: str, views: Images) -> Images:
        """The views, or the same turned away."""
        return facing_away(views) if side == "repulsive" else views


class IncrementalOpponent(Opponent, IncrementalTwoMemories):
    """Opponent memories of a model that learns view by view."""

    attractive: IncrementalModel
    repulsive: IncrementalModel


class OutsideOpponent(OutsideMemories):
    """Opponent memories of a model that does not derive from `Model`."""

    kind = Opponent


def opponent(model: FamiliarityModel) -> Any:
    """Opponent memories of an untrained model. They learn view by view, and can be saved, where the model does and can."""
    return two_memories(model, Opponent, IncrementalOpponent, OutsideOpponent)


def facing_away(views: Images) -> Images:
    """The views turned by half a turn (to the column, where the width is odd)."""
    return torch.roll(views, views.shape[-1] // 2, dims=-1)
