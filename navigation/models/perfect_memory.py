"""Perfect memory: every view of the route is kept, and the nearest is recognised."""

from typing import no_type_check

import numba
import numpy as np
import torch
from jaxtyping import Float32, Int64

from ..familiarity import Images, IncrementalModel, Learned, Scans, check_scan
from ..rotation import FilterBank, rotations

# float32 correlations of images with norms a and b are off by less than this times a b (measured: 1.4e-7).
ROUNDING = 4e-6
AT_ONCE = 256  # rotations scored exactly at once


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
        self._level = self.snapshots.mean()
        centred = self.snapshots - self._level
        self._energies = centred.square().sum(dim=(1, 2))
        self._bank = FilterBank(-2 * centred, self._energies)  # |v - s|^2 = |s|^2 - 2 v . s + |v|^2

    def _scan(self, views: Images) -> Scans:
        return self.match(views)[0]

    def _nearest(self, views: Images, among: slice) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """Minus the RMS difference from, and the index of, the most similar of some snapshots, at each rotation."""
        n, height, width = views.shape
        centred = views - self._level
        energies = centred.square().sum(dim=(1, 2))
        best = torch.full((n, width), torch.inf, device=views.device)
        index = torch.zeros((n, width), dtype=torch.int64, device=views.device)
        if n == 0:
            return best, index
        for part, distances in self._bank.chunks(centred, among):  # but for |v|^2, which is the same for all
            nearest, which = lowest(distances)
            closer = nearest < best
            best = torch.where(closer, nearest, best)
            index = torch.where(closer, which + part.start, index)
        squared = best + energies[:, None]
        self._rescore(views, squared, index, ROUNDING * (energies + self._energies[among].max()))
        return -(squared.clamp(min=0) / (height * width)).sqrt(), index

    def _rescore(self, views: Images, squared: torch.Tensor, index: torch.Tensor, tolerance: torch.Tensor) -> None:
        """Make the squared distances exact that rounding leaves in doubt about being the smallest, and their neighbours, in place."""
        doubtful = squared <= squared.min(dim=1, keepdim=True).values + tolerance[:, None]
        doubtful |= doubtful.roll(1, dims=1) | doubtful.roll(-1, dims=1)  # a heading is interpolated from three
        for view, turn in zip(*(each.split(AT_ONCE) for each in torch.nonzero(doubtful, as_tuple=True)), strict=True):
            difference = rotations(views[view], turn).double() - self.snapshots[index[view, turn]]
            squared[view, turn] = difference.square().sum(dim=(1, 2)).float()


def lowest(
    distances: Float32[torch.Tensor, "n w m"],
) -> tuple[Float32[torch.Tensor, "n w"], Int64[torch.Tensor, "n w"]]:
    """The least of each row, and where it is: the first of equal ones."""
    if distances.device.type != "cpu":
        return distances.min(dim=2)
    rows = distances.movedim(0, 1).contiguous()  # as it lies in memory
    values, index = torch.empty(rows.shape[:2]), torch.empty(rows.shape[:2], dtype=torch.int64)
    _lowest(rows.numpy(), values.numpy(), index.numpy())
    return values.movedim(0, 1), index.movedim(0, 1)


@no_type_check  # or the tests' type checker would wrap it before numba compiles it
@numba.njit(nogil=True, cache=True, fastmath={"nnan", "nsz"})
def _lowest(rows, values, index):
    """See `lowest`: the least of 64 numbers after the other, and then where it is among them."""
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            best, first = np.inf, 0
            for start in range(0, rows.shape[2], 64):
                low = rows[i, j, start]
                for k in range(start + 1, min(start + 64, rows.shape[2])):
                    low = min(low, rows[i, j, k])
                if low < best:
                    best, first = low, start
            while rows[i, j, first] != best:
                first += 1
            values[i, j], index[i, j] = best, first
