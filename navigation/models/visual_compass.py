"""The visual compass: one snapshot and the rotation that brings it back (Zeil, Hofmann and Chahl 2003; thesis 4.2)."""

import torch
from jaxtyping import Float32, Int64

from ..familiarity import Images, check_training
from .perfect_memory import PerfectMemory


class VisualCompass(PerfectMemory):
    """Perfect memory of a single view: the last one it is given, which is the view at the goal."""

    def fit(self, views: Images) -> "VisualCompass":
        """Store the last view."""
        check_training(views)
        super().fit(views[-1:])
        self._index = len(views) - 1
        return self

    def match(self, views: Images) -> tuple[Float32[torch.Tensor, "n w"], Int64[torch.Tensor, "n w"]]:
        """`scan`, and the index of the last learned view throughout."""
        familiarity, first = super().match(views)
        return familiarity, first + self._index
