"""Perfect memory: keep every view of the route, recognise the nearest (Zeil et al. 2003; Baddeley et al. 2012; thesis 4.3)."""

import torch
from jaxtyping import Float32, Int64

from ..familiarity import Images, check_scan, check_training
from ..rotation import FilterBank, rotations

# float32 correlations of images with norms a and b are off by less than this times a b (measured: 1.4e-7).
ROUNDING = 4e-6


class PerfectMemory:
    """All views of the route, stored. Familiarity is minus the RMS difference (equation 1) from the most similar of them."""

    def __init__(self):
        self.snapshots: Float32[torch.Tensor, "m h w"] | None = None

    def fit(self, views: Images) -> "PerfectMemory":
        """Store the views."""
        check_training(views)
        self.snapshots = views.clone()
        # The distance does not change when one number is taken from all pixels; float32 keeps more digits of it around 0.
        self._level = views.mean()
        centred = views - self._level
        self._energies = centred.square().sum(dim=(1, 2))
        self._bank = FilterBank(centred)
        return self

    def scan(self, views: Images) -> Float32[torch.Tensor, "n w"]:
        """Minus the RMS difference of each rotation from its most similar snapshot."""
        return self.match(views)[0]

    def match(self, views: Images) -> tuple[Float32[torch.Tensor, "n w"], Int64[torch.Tensor, "n w"]]:
        """`scan`, and which snapshot is the most similar at each rotation."""
        check_scan(views, None if self.snapshots is None else self.snapshots.shape[1:])
        assert self.snapshots is not None
        n, _, width = views.shape
        centred = views - self._level
        energies = centred.square().sum(dim=(1, 2))
        best = torch.full((n, width), torch.inf, device=views.device)
        index = torch.zeros((n, width), dtype=torch.int64, device=views.device)
        if n == 0:
            return best, index
        for part, correlation in self._bank.chunks(centred):
            # |v - s|^2 = |v|^2 + |s|^2 - 2 v . s; |v|^2 is the same for all s and joins at the end.
            nearest, which = (self._energies[part, None] - 2 * correlation).min(dim=1)
            closer = nearest < best
            best = torch.where(closer, nearest, best)
            index = torch.where(closer, which + part.start, index)
        squared = best + energies[:, None]
        self._rescore(views, squared, index, ROUNDING * (energies + self._energies.max()))
        pixels = views.shape[1] * width
        return -(squared.clamp(min=0) / pixels).sqrt(), index

    def _rescore(self, views: Images, squared: torch.Tensor, index: torch.Tensor, tolerance: torch.Tensor) -> None:
        """Make the squared distances exact that rounding leaves in doubt about being the smallest, and their neighbours, in place."""
        assert self.snapshots is not None
        doubtful = squared <= squared.min(dim=1, keepdim=True).values + tolerance[:, None]
        doubtful |= doubtful.roll(1, dims=1) | doubtful.roll(-1, dims=1)  # a heading is interpolated from three
        for view, row, snapshot, mask in zip(views, squared, index, doubtful, strict=True):
            for turns in torch.nonzero(mask)[:, 0].split(32):
                difference = rotations(view, turns).double() - self.snapshots[snapshot[turns]]
                row[turns] = difference.square().sum(dim=(1, 2)).float()
