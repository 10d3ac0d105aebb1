"""Perfect memory: every view of the route is kept, and the most similar one is recognised."""

import copy

import numpy as np
import torch
from jaxtyping import Float32, Float64, Int64

from tussock.render.compile import compiled
from tussock.world.errors import SettingError

from ..feature_mask import energies, is_partial
from ..overlap import BLOCK, overlaps
from .base import Images, Learned, Scans, Shapes, model
from .checks import check_scan
from .filter_bank import FilterBank, NearestFilters
from .growing import Growing
from .incremental import IncrementalModel
from .rotations import in_batches

Banks = list[tuple[FilterBank, Float64[torch.Tensor, " m"]]]

FILTERS = 1000  # snapshots whose responses behind a mask are computed at once; limits the memory that this takes

# Error of squared distances by correlation, as a share of sqrt(w) (|v|^2 + |s|^2). Measured: under a quarter of it.
ROUNDING = 1e-6


@model
class PerfectMemory(IncrementalModel):
    """Keeps every view; familiarity is minus the RMS difference from the most similar one.

    Equation 1 of the thesis (section 4.3), exactly: the distance |v - s|^2 = |v|^2 - 2 v . s + |s|^2 needs one correlation, and where
    rounding could change which rotation is the best, it is computed again directly. With a mask it is that of the visible pixels, in
    float64. Memory grows with the number of views.

    Where parts of images are unknown, the difference is that over what both show (see `Overlap`). Rotations that share too little of
    it with every snapshot are not compared: they are as familiar as the least familiar one of the others.
    """

    name = "perfect-memory"
    paper = "Zeil, Hofmann and Chahl 2003; Baddeley et al. 2012"
    takes_mask = True
    takes_partial = True

    @property
    def snapshots(self) -> Float32[torch.Tensor, "m h w"]:
        """The views it keeps, as the eye saw them."""
        return self._learned["snapshots"]

    def match(self, views: Images) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """`scan`, and which snapshot is the most similar at each rotation."""
        check_scan(views, self.shape, is_partial(self.mask))
        if len(views) == 0:
            return self.scan(views), torch.empty(0, views.shape[2], dtype=torch.int64)
        familiarity, index = zip(*(self._nearest(self._on_device(batch)) for batch in in_batches(views)), strict=True)
        return torch.cat(familiarity), torch.cat(index)

    def _begin(self, height: int, width: int) -> Learned:
        return {"snapshots": torch.empty(0, height, width, device=self.device)}

    def _add(self, learned: Learned, views: Images) -> Learned:
        return {"snapshots": torch.cat([learned["snapshots"], self._seen(views)])}

    def _shapes(self, height: int, width: int) -> Shapes:
        return {"snapshots": (None, height, width)}

    def _learn_more(self, shape: tuple[int, int], views: Images) -> None:
        """Only what is new is transformed and stored; snapshots that others hold stay as they are."""
        self._check_form(shape, self._learned)
        combined, seen = copy.copy(self), self._seen(views)
        combined._memory = self._memory.appended(seen)
        combined._learned = {"snapshots": combined._memory.tensor}
        combined._compare(seen)
        vars(self).update(vars(combined))

    def _prepare(self) -> None:
        self._memory = Growing(self.snapshots)
        self._filters, self._banks = None, []
        # The distance does not change when a constant is taken from all pixels; float32 keeps more digits of it around 0.
        self._level = float(self.snapshots[0].mean(dtype=torch.float64))
        self._energies = self.snapshots.new_empty(0)
        self._compare(self.snapshots)

    def _compare(self, snapshots: Images) -> None:
        """Make the last snapshots ready to be compared, next to those before them."""
        if self.mask is not None and self.mask.partial:
            self._overlaps = list(overlaps(self.snapshots, self.mask))
            return
        if self.mask is not None:
            self._banks = self._compared_seen(snapshots)
            return
        centred = snapshots - self._level
        new = energies(centred, None)[:, 0]
        self._energies = torch.cat([self._energies, new])
        self._filters = (
            NearestFilters(-2 * centred, new) if self._filters is None else self._filters.appended(-2 * centred, new)
        )
        self._on_cpu = self.snapshots.cpu().numpy()

    def _compared_seen(self, snapshots: Images) -> Banks:
        """The same behind a mask: snapshots in blocks of FILTERS, each with its |s|^2."""
        banks, squares = list(self._banks), energies(snapshots.double(), None)[:, 0]
        space = FILTERS - len(banks[-1][1]) if banks else 0
        if space:
            bank, before = banks.pop()
            banks.append((bank.appended(snapshots[:space]), torch.cat([before, squares[:space]])))
        blocks = zip(snapshots[space:].split(FILTERS), squares[space:].split(FILTERS), strict=True)
        return [*banks, *((self._bank(block), some) for block, some in blocks if len(block))]

    def _scan(self, views: Images) -> Scans:
        return self._nearest(views)[0]

    def _nearest(self, views: Images, among: slice = slice(None)) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """Minus the RMS difference from, and the index of, the most similar of some snapshots, at each rotation."""
        if self.mask is not None:
            return self._nearest_known(views) if self.mask.partial else self._nearest_seen(views, among)
        height, width = views.shape[1:]
        centred = views - self._level
        assert self._filters is not None
        responses, index = self._filters.nearest(centred, among)
        of_views = energies(centred, None)[:, 0]
        squared = (of_views[:, None] + responses).cpu().numpy()
        tolerance = ROUNDING * width**0.5 * (of_views + self._energies[among].max()).cpu().numpy()
        undecided = squared <= (squared.min(axis=1) + tolerance)[:, None]
        _rescore(views.cpu().numpy(), self._on_cpu, index.cpu().numpy(), undecided, squared)
        familiarity = -np.sqrt(squared / np.float32(height * width))
        return self._on_device(torch.from_numpy(familiarity)), index

    def _nearest_seen(self, views: Images, among: slice) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """The same behind a mask: what is seen of a view, and so its |v|^2, differs from rotation to rotation."""
        compared = torch.zeros(len(self.snapshots), dtype=torch.bool, device=views.device)
        compared[among] = True
        of_views = energies(views, self.mask)
        least, index = torch.full_like(of_views, torch.inf), torch.zeros_like(of_views, dtype=torch.int64)
        for k, ((bank, squares), some) in enumerate(zip(self._banks, compared.split(FILTERS), strict=True)):
            distances = (squares - 2 * bank.exact(views)).where(some, torch.inf)
            values, which = distances.min(dim=2)
            index = (which + k * FILTERS).where(values < least, index)
            least = torch.minimum(values, least)
        squared = (of_views + least).clamp(min=0)
        return -(squared / self._size(*views.shape[1:])).sqrt().float(), index

    def _nearest_known(self, views: Images) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """The same over what a view and each snapshot both show."""
        each_view = views.split(1)  # so that its bytes do not depend on the others
        blocks = [torch.cat([each.squared(view) for view in each_view]).min(dim=2) for each in self._overlaps]
        squared, which = torch.stack([each.values for each in blocks]).min(dim=0)
        indices = torch.stack([each.indices + k * BLOCK for k, each in enumerate(blocks)])
        compared = squared.isfinite()
        if not compared.any(dim=1).all():
            raise SettingError(
                f"{self.name}: a view shows too little of what any learned view shows; take images of the same camera"
            )
        farthest = squared.where(compared, -torch.inf).amax(dim=1, keepdim=True)
        return -squared.where(compared, farthest).sqrt().float(), indices.gather(0, which[None])[0]


@compiled(fastmath={"reassoc"})
def _rescore(views, snapshots, index, undecided, squared):
    """Compute squared distances (n, w) directly where rounding leaves undecided which of a view is the least, and next to these."""
    n, height, width = views.shape
    for v in range(n):
        for turn in range(width):
            if (
                undecided[v, turn] or undecided[v, turn - 1] or undecided[v, (turn + 1) % width]
            ):  # a heading is interpolated from three
                snapshot = snapshots[index[v, turn]]
                total = 0.0
                for i in range(height):  # the view rolled right by `turn`
                    for j in range(turn):
                        total += (np.float64(views[v, i, width - turn + j]) - snapshot[i, j]) ** 2
                    for j in range(width - turn):
                        total += (np.float64(views[v, i, j]) - snapshot[i, turn + j]) ** 2
                squared[v, turn] = total
            squared[v, turn] = max(squared[v, turn], np.float32(0.0))
