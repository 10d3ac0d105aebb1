"""The visual compass: one snapshot, and the rotation that brings it back."""

import torch
from jaxtyping import Int64

from tussock.world.errors import SettingError

from ..feature_mask import is_partial
from .base import Images, Learned, Model, Scans, Scores, Shapes, Windows, model
from .checks import check_scan
from .perfect_memory import PerfectMemory


@model
class VisualCompass(Model):
    """Keeps one view, the last one that it is given, at the goal; familiarity is minus the RMS difference from it.

    Section 4.2 of the thesis. Memory: one view.
    """

    name = "visual-compass"
    paper = "Zeil, Hofmann and Chahl 2003"
    takes_mask = True
    takes_partial = True
    dtypes = {"index": torch.int64}  # noqa: RUF012

    def match(self, views: Images, windows: Windows | None = None) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """`scan`, and the index of the last learned view throughout."""
        check_scan(views, self.shape, is_partial(self.mask))
        familiarity, _ = self._memory.match(views, windows)
        return familiarity, self.learned["index"].expand(familiarity.shape)

    def check_learned(self, shape: tuple[int, int], learned: Learned) -> None:
        """As for all models; and the index of the view is not negative."""
        super().check_learned(shape, learned)
        if learned["index"] < 0:
            raise SettingError(f"{self.name}: the index of its view is {int(learned['index'])}, not 0 or more")

    def _learn(self, views: Images) -> Learned:
        return {"snapshot": self._seen(views[-1:]).clone(), "index": torch.tensor(len(views) - 1)}

    def _shapes(self, height: int, width: int) -> Shapes:
        return {"snapshot": (1, height, width), "index": ()}

    def _prepare(self) -> None:
        assert self.shape is not None
        self._memory = PerfectMemory(device=self.device).see(self.mask)
        self._memory.restore(self.shape, {"snapshots": self.learned["snapshot"]})

    def _scan(self, views: Images) -> Scans:
        return self._memory.scan(views)

    def _score(self, views: Images) -> Scores:
        return self._memory.score(views)
