"""Perfect memory: every view of the route is kept, and the most similar one is recognised."""

import copy

import numpy as np
import torch
from jaxtyping import Float32, Float64, Int64

from tussock.render.compile import compiled
from tussock.world.errors import SettingError

from ..feature_mask import energies, is_partial
from ..overlap import BLOCK, overlaps
from .base import Images, Learned, Scans, Scores, Shapes, Windows, model
from .checks import check_scan
from .filter_bank import FilterBank, NearestFilters
from .growing import Growing
from .incremental import IncrementalModel
from .rotations import in_batches

Banks = list[tuple[FilterBank, Float64[torch.Tensor, " m"]]]

FILTERS = 1000  # snapshots whose responses behind a mask are computed at once; limits the memory that this takes

# Error of squared distances by correlation, as a share of sqrt(w) (|v|^2 + |s|^2). Measured: under a quarter of it.
ROUNDING = 1e-6
PRODUCT_ROUNDING = (
    2.5e-7  # of those by plain products, as a share of sqrt(h w) (|v|^2 + |s|^2). Measured: under a quarter of it.
)
DECIMALS = 8  # of squared distances in float64 behind a mask


@model
class PerfectMemory(IncrementalModel):
    """Keeps every view; familiarity is minus the RMS difference from the most similar one.

    Equation 1 of the thesis (section 4.3), exactly: the distance |v - s|^2 = |v|^2 - 2 v . s + |s|^2 needs one correlation, and where
    rounding could change which rotation or which snapshot is the best, it is computed again directly. Encoded views are multiples of
    1/4096 (`scale` excepted), whose float64 sums are exact in any order, so every processor decides alike. With a mask it is the
    distance of the visible pixels, in float64. Memory grows with the number of views.

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

    def match(self, views: Images, windows: Windows | None = None) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """`scan`, and which snapshot is the most similar at each rotation."""
        check_scan(views, self.shape, is_partial(self.mask))
        if len(views) == 0:
            return self.scan(views), torch.empty(0, views.shape[2], dtype=torch.int64)
        batches, begin, parts = in_batches(views), 0, []
        for batch in batches:
            some = None if windows is None else windows[begin : begin + len(batch)]
            parts.append(self._nearest(self._on_device(batch), some))
            begin += len(batch)
        familiarity, index = zip(*parts, strict=True)
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
        self._on_cpu = self.snapshots.cpu().numpy()
        centred = snapshots - self._level
        new = energies(centred, None)[:, 0]
        self._energies = torch.cat([self._energies, new])
        if self.mask is not None:
            self._banks = self._compared_seen(snapshots)
            return
        self._filters = (
            NearestFilters(-2 * centred, new) if self._filters is None else self._filters.appended(-2 * centred, new)
        )

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

    def _score(self, views: Images) -> Scores:
        """Plain products leave few snapshots that may be the most similar; from these the distance is computed directly."""
        if is_partial(self.mask):  # the familiarity of a rotation that is not compared depends on the others
            return super()._score(views)
        seen, count = self._seen(views).contiguous(), views[0].numel()
        centred = seen - self._level
        rough = self._energies - 2 * centred.flatten(start_dim=1) @ self.snapshots.flatten(start_dim=1).T
        sizes = energies(centred, None)[:, 0] + self._energies.max() + count * self._level**2
        limits = rough.amin(dim=1) + PRODUCT_ROUNDING * count**0.5 * sizes
        some, distances, allowed = (each.cpu().numpy() for each in (seen, rough, limits))
        squared = torch.from_numpy(_least(some, self._on_cpu, distances, allowed))
        squared = squared if self.mask is None else self._coarse(squared)
        return self._on_device(-(squared / self._size(*views.shape[1:])).sqrt().float())

    def _nearest(
        self, views: Images, windows: Windows | None = None, among: slice = slice(None)
    ) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """Minus the RMS difference from, and the index of, the most similar of some snapshots, at each rotation.

        Args:
            views: (n, h, w)
            windows: (n, w) Rotations whose order rounding must not change; None means all.
            among: The snapshots to compare.
        """
        if self.mask is not None:
            return self._nearest_known(views) if self.mask.partial else self._nearest_seen(views, among)
        height, width = views.shape[1:]
        centred = views - self._level
        assert self._filters is not None
        of_views = energies(centred, None)[:, 0]
        tolerance = ROUNDING * width**0.5 * (of_views + self._energies[among].max())
        nearest = self._filters.nearest(centred, tolerance, among)
        squared = (of_views[:, None].double() + nearest.least).cpu().numpy()
        allowed = np.ones(squared.shape, dtype=bool) if windows is None else windows
        first, last, _ = among.indices(len(self._on_cpu))
        doubts = tolerance.cpu().numpy(), nearest.doubtful.cpu().numpy()
        index = nearest.index.cpu().numpy()
        _decide_exactly(views.cpu().numpy(), self._on_cpu, first, last, allowed, *doubts, squared, index)
        familiarity = -np.sqrt(squared.clip(min=0) / (height * width)).astype(np.float32)
        return self._on_device(torch.from_numpy(familiarity)), self._on_device(torch.from_numpy(index))

    def _nearest_seen(self, views: Images, among: slice) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """The same behind a mask: what is seen of a view, and so its |v|^2, differs from rotation to rotation."""
        compared = torch.zeros(len(self.snapshots), dtype=torch.bool, device=views.device)
        compared[among] = True
        of_views = energies(views, self.mask)
        least, index = torch.full_like(of_views, torch.inf), torch.zeros_like(of_views, dtype=torch.int64)
        for k, ((bank, squares), some) in enumerate(zip(self._banks, compared.split(FILTERS), strict=True)):
            distances = self._coarse(squares - 2 * bank.exact(views)).where(some, torch.inf)
            values, which = distances.min(dim=2)
            index = (which + k * FILTERS).where(values < least, index)
            least = torch.minimum(values, least)
        squared = (self._coarse(of_views) + least).clamp(min=0)
        return -(squared / self._size(*views.shape[1:])).sqrt().float(), index

    def _coarse(self, squared: Float64[torch.Tensor, "..."]) -> Float64[torch.Tensor, "..."]:
        """Squared distances behind a mask, rounded so that the last bits do not decide between equal ones."""
        assert self.mask is not None
        unit = self.mask.gain**2
        return (squared / unit).round(decimals=DECIMALS) * unit

    def _nearest_known(self, views: Images) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """The same over what a view and each snapshot both show."""
        each_view = views.split(1)  # so that its bytes do not depend on the others
        blocks = [
            torch.cat([self._coarse(each.squared(view)) for view in each_view]).min(dim=2) for each in self._overlaps
        ]
        squared, which = torch.stack([each.values for each in blocks]).min(dim=0)
        indices = torch.stack([each.indices + k * BLOCK for k, each in enumerate(blocks)])
        compared = squared.isfinite()
        if not compared.any(dim=1).all():
            raise SettingError(
                f"{self.name}: a view shows too little of what any learned view shows; take images of the same camera"
            )
        farthest = squared.where(compared, -torch.inf).amax(dim=1, keepdim=True)
        return -squared.where(compared, farthest).sqrt().float(), indices.gather(0, which[None])[0]


@compiled
def _decide_exactly(views, snapshots, first, last, allowed, tolerance, doubtful, squared, index):
    """Compute squared distances (n, w) directly where rounding leaves undecided which of the allowed is the least, and next to these.

    Where another of the snapshots `first` to `last` may be as near, all of them are compared.
    """
    n, height, width = views.shape
    turned, needed = np.empty((height, width)), np.empty(width, np.bool_)
    for v in range(n):
        least = np.inf
        for turn in range(width):
            if allowed[v, turn]:
                least = min(least, squared[v, turn])
        needed[:] = False
        for turn in range(width):
            if allowed[v, turn] and squared[v, turn] <= least + tolerance[v]:
                for neighbour in range(turn - 1, turn + 2):  # a heading is interpolated from three
                    needed[neighbour % width] = True
        for turn in range(width):
            if not needed[turn]:
                continue
            turned[:, turn:], turned[:, :turn] = views[v, :, : width - turn], views[v, :, width - turn :]
            if not doubtful[v, turn]:
                squared[v, turn] = _distance(turned, snapshots[index[v, turn]], np.inf)
                continue
            squared[v, turn] = np.inf
            for k in range(first, last):
                distance = _distance(turned, snapshots[k], squared[v, turn])
                if distance < squared[v, turn]:
                    squared[v, turn], index[v, turn] = distance, k


@compiled
def _least(views, snapshots, rough, limits):
    """Squared distance (n,) of each view from the snapshot that is the most similar at its present heading.

    Only those are compared whose `rough` (n, m) distance is within the view's limit (n,).
    """
    squared, view = np.full(len(views), np.inf), np.empty(views.shape[1:])
    for v in range(len(views)):
        view[:] = views[v]
        for k in range(len(snapshots)):
            if rough[v, k] <= limits[v]:
                squared[v] = min(squared[v], _distance(view, snapshots[k], squared[v]))
    return squared


@compiled(fastmath={"reassoc"})
def _distance(view, snapshot, limit):
    """Squared distance of two images (h, w), or any number over the limit if it is over it."""
    total = 0.0
    for i in range(view.shape[0]):
        for j in range(view.shape[1]):
            total += (view[i, j] - snapshot[i, j]) ** 2
        if total > limit:
            break
    return total
