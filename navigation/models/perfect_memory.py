"""Perfect memory: every view of the route is kept, and the nearest is recognised."""

import torch
from jaxtyping import Float32, Int64

from ..familiarity import Images, IncrementalModel, Learned, Scans, check_scan
from ..rotation import FilterBank, rotations

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
        self._level = self.snapshots.mean()
        centred = self.snapshots - self._level
        self._energies = centred.square().sum(dim=(1, 2))
        self._bank = FilterBank(centred)

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
        for part, correlation in self._bank.chunks(centred, among):
            # |v - s|^2 = |v|^2 + |s|^2 - 2 v . s; |v|^2 is the same for all s and joins at the end.
            nearest, which = (self._energies[part, None] - 2 * correlation).min(dim=1)
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
        for view, row, snapshot, mask in zip(views, squared, index, doubtful, strict=True):
            for turns in torch.nonzero(mask)[:, 0].split(32):
                difference = rotations(view, turns).double() - self.snapshots[snapshot[turns]]
                row[turns] = difference.square().sum(dim=(1, 2)).float()
