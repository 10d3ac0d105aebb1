"""Snapshot chaining: from one snapshot to the next, in the order of the route."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float32, Int64

from .base import check_scan
from .filter_bank import FilterBank
from .perfect_memory import PerfectMemory, energies

SAMPLE = 32  # snapshots between which the usual difference of unrelated places is measured


@dataclass(kw_only=True, eq=False)
class Chain(PerfectMemory):
    """Perfect memory that knows where it is: a walk compares only snapshots near the active one, and steps forward along them.

    Section 3.2 of the thesis. `follow` begins a walk; `scan`, which knows of no walk, compares all snapshots.
    Memory grows with the number of views.

    window: share of the sequence ahead of the active snapshot that is searched, and half as much behind. strange: a best match
    whose RMS difference exceeds this share of that between unrelated places is none, and the window doubles.
    """

    name = "chain"
    paper = "Cartwright and Collett 1983; the thesis, section 3.2"

    LIMITS = {"window": (0.001, 1.0)}  # noqa: RUF012
    window: float = 0.05
    strange: float = 0.85

    def follow(self) -> "ChainWalk":
        """Begin a walk along the chain, not knowing yet where."""
        return ChainWalk(self)

    def _prepare(self) -> None:
        super()._prepare()
        pick = torch.linspace(0, len(self.snapshots) - 1, min(SAMPLE, len(self.snapshots))).round().long()
        sample = self.snapshots[pick] - self._level
        squares = self._here(torch.from_numpy(energies(sample)))
        correlation = FilterBank(sample).responses(sample).amax(dim=1)
        squared = (squares[:, None] + squares - 2 * correlation)[
            torch.triu_indices(len(sample), len(sample), 1).unbind()
        ]
        rms = (squared.clamp(min=0) / sample[0].numel()).sqrt()
        self.strange_from = self.strange * float(rms.median()) if len(rms) else np.inf  # RMS difference


class ChainWalk:
    """Where one walk along a chain has come to. active: index of the snapshot it is at, None while it is lost."""

    def __init__(self, chain: Chain):
        self.chain = chain
        self.active: int | None = None

    @property
    def progress(self) -> float | None:
        """Share of the sequence, 0 to 1, that it believes to have walked; None while it is lost."""
        return None if self.active is None else self.active / max(1, len(self.chain.snapshots) - 1)

    def look(
        self, view: Float32[torch.Tensor, "h w"], allowed: Bool[np.ndarray, " w"]
    ) -> tuple[Float32[torch.Tensor, " w"], Int64[torch.Tensor, " w"]]:
        """Familiarity of each rotation and the snapshot each resembles most; the best `allowed` one becomes the active snapshot.

        The window doubles until the match is no longer strange. Where nothing in the whole sequence matches, it is lost and
        will look everywhere again.
        """
        chain = self.chain
        check_scan(view[None], chain.shape)
        reach = 1.0 if self.active is None else chain.window
        while True:
            (familiarity,), (index,) = chain._nearest(chain._here(view[None]), self._within(reach))
            best = int(torch.where(chain._here(torch.as_tensor(allowed)), familiarity, -torch.inf).argmax())
            strange = -float(familiarity[best]) > chain.strange_from
            if not strange or reach >= 1:
                self.active = None if strange else int(index[best])
                return familiarity, index
            reach *= 2

    def _within(self, reach: float) -> slice:
        """Snapshots up to `reach` of the sequence ahead of the active one, and half as much behind."""
        count = len(self.chain.snapshots)
        if self.active is None or reach >= 1:
            return slice(0, count)
        return slice(
            max(0, self.active - round(reach * count / 2)), min(count, self.active + max(1, round(reach * count)) + 1)
        )
