"""Memories of both hemifields: one of what is seen to the left of straight ahead, one of what is seen to the right."""

from typing import Any

import attrs
import torch

from tussock.world.errors import SettingError

from ..feature_mask import FeatureMask
from .base import FamiliarityModel, Model
from .incremental import IncrementalModel
from .registry import HEMIFIELDS
from .two_memories import IncrementalTwoMemories, OutsideMemories, TwoMemories, two_memories

MAX_PIXELS = 10**8  # of a view, as rays of an eye: a damaged file may name a shape for which no mask can be made


class Hemifields(TwoMemories):
    """Any model twice: a memory of what is seen to the left of straight ahead, and one of what is seen to the right.

    Familiarity is the sum of both. Each memory sees through its half of the eye's mask, or of the whole image where there is no mask.
    Images have straight ahead in the middle; the middle column of an odd width belongs to both. Memory: that of two models of half
    a view.

    Attributes:
        left: The model that learns what is to the left.
        right: The model that learns what is to the right.
    """

    paper = "Gattaux et al. 2025 (a memory in each hemisphere)"
    prefix = HEMIFIELDS
    sides = ("left", "right")
    left: Model
    right: Model

    @classmethod
    def check_model(cls, model: Any) -> None:
        """Refuse a model that does not mind masks, and two memories already. Raises SettingError."""
        super().check_model(model)
        name = getattr(model, "name", type(model).__name__)
        minds = model.takes_mask if isinstance(model, Model) else hasattr(model, "see")
        if not minds:
            raise SettingError(
                f"{name} does not mind what the eye cannot see, so it cannot have a memory of each hemifield; give another model "
                "(docs/extending.md)"
            )

    @classmethod
    def combined(cls, first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
        """The sum of both."""
        return first + second

    @classmethod
    def mask_of(cls, side: str, mask: FeatureMask | None, shape: tuple[int, ...]) -> FeatureMask:
        """The half of a mask on one side. Raises SettingError where nothing is visible there, and for views that are too large."""
        height, width = shape
        if height * width > MAX_PIXELS:
            raise SettingError(f"views of {width} x {height} pixels; give at most {MAX_PIXELS:,} pixels")
        left = (2 * torch.arange(width) < width).repeat(height, 1)
        half = left if side == "left" else left.flip(1)
        if mask is None:
            return FeatureMask(half)
        visible = half.to(mask.visible.device) & mask.visible
        if not visible.any():
            raise SettingError(
                f"the eye sees nothing to the {side} of straight ahead, so there is nothing to learn in that hemifield; "
                f"give an eye that sees both sides, or a model without {HEMIFIELDS}"
            )
        return attrs.evolve(mask, visible=visible)


class IncrementalHemifields(Hemifields, IncrementalTwoMemories):
    """Memories of both hemifields of a model that learns view by view."""

    left: IncrementalModel
    right: IncrementalModel


class OutsideHemifields(OutsideMemories):
    """Memories of both hemifields of a model that does not derive from `Model`."""

    kind = Hemifields


def hemifields(model: FamiliarityModel) -> Any:
    """Memories of both hemifields of an untrained model. They learn view by view, and can be saved, where the model does and can.

    Raises:
        SettingError: For a model that does not mind what the eye sees (`Model.takes_mask`), and for opponent memories.
    """
    return two_memories(model, Hemifields, IncrementalHemifields, OutsideHemifields)
