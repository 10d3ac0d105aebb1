"""Snapshot chaining: from one snapshot to the next, in the order of the route."""

import numpy as np
import torch
from jaxtyping import Bool, Float32, Int64

from tussock.world.settings import number

from ..feature_mask import energies
from .base import Images, model
from .checks import check_scan
from .filter_bank import FilterBank
from .perfect_memory import PerfectMemory

SAMPLE = 32  # snapshots between which the difference of unrelated positions is measured


@model
class Chain(PerfectMemory):
    """Perfect memory with progress: a walk compares only snapshots near the active one, and moves forward along them.

    Section 3.2 of the thesis. `follow` begins a walk; `scan` knows of no walk and compares all snapshots. Memory grows with the
    number of views.

    Attributes:
        window: Share of the sequence ahead of the active snapshot that is compared, and half as much behind.
        max_mismatch: Largest RMS difference of a match, as a share of the median between unrelated positions. Beyond it the match
            is rejected, and the window doubles. Unrelated positions are compared at their best rotation; with a mask, as they were seen.
    """

    name = "chain"
    paper = "Cartwright and Collett 1983; the thesis, section 3.2"
    takes_partial = False
    renamed = {"strange": "max_mismatch"}  # noqa: RUF012

    window: float = number(0.05, low=0.001, high=1)
    max_mismatch: float = number(0.85, low=0)

    def follow(self) -> "ChainWalk":
        """Begin a walk along the chain, with unknown progress."""
        return ChainWalk(self)

    def _compare(self, snapshots: Images) -> None:
        super()._compare(snapshots)
        self._max_difference: float | None = None

    @property
    def max_difference(self) -> float:
        """Largest RMS difference of a match."""
        if self._max_difference is None:
            self._max_difference = self._difference_between_positions()
        return self._max_difference

    def _difference_between_positions(self) -> float:
        pick = torch.linspace(0, len(self.snapshots) - 1, min(SAMPLE, len(self.snapshots))).round().long()
        sample = self.snapshots[pick] - (self._level if self.mask is None else 0)
        squares = energies(sample.double(), None)
        correlations = FilterBank(sample.double()).responses(sample)
        # What a mask hid of a snapshot is not known: then it is compared as it was seen, at rotation 0.
        correlation = correlations.amax(dim=1) if self.mask is None else correlations[:, 0]
        pairs = torch.triu_indices(len(sample), len(sample), 1).unbind()
        squared = (squares + squares[:, 0] - 2 * correlation)[pairs]
        rms = (squared.clamp(min=0) / self._size(*sample.shape[1:])).sqrt()
        return self.max_mismatch * float(rms.median()) if len(rms) else np.inf


class ChainWalk:
    """One walk along a chain.

    Attributes:
        chain: The trained chain.
        active: Index of the snapshot that the walk is at; None while that is unknown.
    """

    def __init__(self, chain: Chain):
        self.chain = chain
        self.active: int | None = None

    @property
    def progress(self) -> float | None:
        """Share of the sequence, 0 to 1, that it believes to have walked; None while that is unknown."""
        return None if self.active is None else self.active / max(1, len(self.chain.snapshots) - 1)

    def look(
        self, view: Float32[torch.Tensor, "h w"], allowed: Bool[np.ndarray, " w"]
    ) -> tuple[Float32[torch.Tensor, " w"], Int64[torch.Tensor, " w"]]:
        """Compare a view with the snapshots near the active one; the best match becomes the active one.

        The window doubles until the match is good enough. If nothing in the whole sequence matches, the progress is unknown, and the
        next look compares all snapshots.

        Args:
            view: (h, w)
            allowed: (w,) Rotations whose best match may become the active snapshot.

        Returns:
            Familiarity (w,) of each rotation, and the index (w,) of the snapshot that each resembles most.
        """
        chain = self.chain
        check_scan(view[None], chain.shape)
        view, allowed_ = chain._on_device(view), chain._on_device(torch.as_tensor(allowed))
        reach = 1.0 if self.active is None else chain.window
        while True:
            (familiarity,), (index,) = chain._nearest(view[None], allowed[None], self._within(reach))
            best = int(torch.where(allowed_, familiarity, -torch.inf).argmax())
            matches = -float(familiarity[best]) <= chain.max_difference
            if matches or reach >= 1:
                self.active = int(index[best]) if matches else None
                return familiarity, index
            reach *= 2

    def _within(self, reach: float) -> slice:
        """Snapshots up to `reach` of the sequence ahead of the active one, and half as much behind."""
        count = len(self.chain.snapshots)
        if self.active is None or reach >= 1:
            return slice(0, count)
        behind, ahead = round(reach * count / 2), max(1, round(reach * count))
        return slice(max(0, self.active - behind), min(count, self.active + ahead + 1))
