"""Perfect memory: every view of the route is kept, and the nearest is recognised."""

from typing import no_type_check

import numba
import numpy as np
import torch
from jaxtyping import Float32, Int64

from ..familiarity import Images, IncrementalModel, Learned, Scans, check_scan
from ..rotation import FilterBank

# float32 correlations of images with norms a and b are off by less than this times a b (measured: 1.4e-7).
ROUNDING = 4e-6


class PerfectMemory(IncrementalModel):
    """Keeps every view; familiarity is minus the RMS difference from the most similar one.

    Equation 1 of the thesis (section 4.3), exactly. Memory grows with the number of views.
    """

    name = "perfect-memory"
    paper = "Zeil, Hofmann and Chahl 2003; Baddeley et al. 2012"

    @property
    def snapshots(self) -> Float32[torch.Tensor, "m h w"]:
        """The views it keeps."""
        return self.learned["snapshots"]

    def match(self, views: Images) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """`scan`, and which snapshot is the most similar at each rotation."""
        check_scan(views, self.shape)
        return self._nearest(self._here(views), slice(0, len(self.snapshots)))

    def _begin(self, height: int, width: int) -> Learned:
        return {"snapshots": torch.empty(0, height, width, device=self.device)}

    def _add(self, learned: Learned, views: Images) -> Learned:
        return {"snapshots": torch.cat([learned["snapshots"], views])}

    def _shapes(self, height: int, width: int) -> dict[str, tuple[int | None, ...]]:
        return {"snapshots": (None, height, width)}

    def _prepare(self) -> None:
        # The distance does not change when one number is taken from all pixels; float32 keeps more digits of it around 0.
        self._on_cpu = self.snapshots.cpu()
        self._level = self.snapshots.mean()
        centred = self.snapshots - self._level
        self._energies = centred.square().sum(dim=(1, 2))
        self._bank = FilterBank(-2 * centred, self._energies)  # |v - s|^2 = |s|^2 - 2 v . s + |v|^2

    def _scan(self, views: Images) -> Scans:
        return self.match(views)[0]

    def _nearest(self, views: Images, among: slice) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """Minus the RMS difference from, and the index of, the most similar of some snapshots, at each rotation."""
        if len(views) == 0:
            nothing = views.new_empty(0, views.shape[2])
            return nothing, nothing.long()
        centred = views - self._level
        energies = centred.square().sum(dim=(1, 2))
        best = torch.full((len(views), views.shape[2]), torch.inf, device=views.device)
        index = torch.zeros_like(best, dtype=torch.int64)
        for part, distances in self._bank.chunks(centred, among):  # but for |v|^2, which is the same for all
            nearest, which = distances.min(dim=2)
            index = torch.where(nearest < best, which + part.start, index)
            best = torch.minimum(nearest, best)
        squared = (best + energies[:, None]).cpu().numpy()
        tolerance = ROUNDING * (energies.cpu().numpy() + float(self._energies[among].max()))
        _rescore(views.cpu().numpy(), self._on_cpu.numpy(), index.cpu().numpy(), tolerance, squared)
        return self._here(torch.from_numpy(-np.sqrt(squared / np.float32(views[0].numel())))), index


@no_type_check  # or the tests' type checker would wrap it before numba compiles it
@numba.njit(nogil=True, cache=True)
def _rescore(views, snapshots, index, tolerance, squared):
    """Make the squared distances (n, w) exact that rounding leaves in doubt about being their view's least, and their neighbours."""
    n, height, width = views.shape
    for v in range(n):
        limit = squared[v].min() + tolerance[v]
        doubtful = squared[v] <= limit
        for turn in range(width):
            # A heading is interpolated from three.
            if doubtful[turn] or doubtful[turn - 1] or doubtful[(turn + 1) % width]:
                snapshot = snapshots[index[v, turn]]
                total = 0.0
                for i in range(height):
                    for j in range(width):  # the view rolled right by `turn`
                        total += (np.float64(views[v, i, j - turn]) - snapshot[i, j]) ** 2
                squared[v, turn] = total
            squared[v, turn] = max(squared[v, turn], np.float32(0.0))
