"""Perfect memory: every view of the route is kept, and the nearest is recognised."""

import numpy as np
import torch
from jaxtyping import Float32, Int64

from tussock.render.compile import compiled

from .base import Images, IncrementalModel, Learned, Scans, check_scan
from .filter_bank import FilterBank, all_rotations, in_parts

# Squared distances, as the bank finds them, are off by less than this times sqrt(w) (|v|^2 + |s|^2) (measured: a quarter of it).
ROUNDING = 1e-6
SEARCH = 64  # distances of which the least is found before it is looked where that stands


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
        found = [self._nearest(self._here(part), slice(0, len(self.snapshots))) for part in in_parts(views)]
        familiarity, index = (torch.cat(parts) for parts in zip(*found, strict=True))
        return familiarity, index

    def _begin(self, height: int, width: int) -> Learned:
        return {"snapshots": torch.empty(0, height, width, device=self.device)}

    def _add(self, learned: Learned, views: Images) -> Learned:
        return {"snapshots": torch.cat([learned["snapshots"], views])}

    def _shapes(self, height: int, width: int) -> dict[str, tuple[int | None, ...]]:
        return {"snapshots": (None, height, width)}

    def _prepare(self) -> None:
        self._on_cpu = self.snapshots.cpu()
        # The distance does not change when one number is taken from all pixels; float32 keeps more digits of it around 0.
        self._level = float(self._on_cpu.numpy().mean(dtype=float))
        centred = self.snapshots - self._level
        self._energies = energies(centred)
        # |v - s|^2 = |s|^2 - 2 v . s + |v|^2
        self._bank = FilterBank(-2 * centred, self._here(torch.from_numpy(self._energies)))

    def _scan(self, views: Images) -> Scans:
        return self._nearest(views, slice(0, len(self.snapshots)))[0]

    def _nearest(self, views: Images, among: slice) -> tuple[Scans, Int64[torch.Tensor, "n w"]]:
        """Minus the RMS difference from, and the index of, the most similar of some snapshots, at each rotation."""
        n, height, width = views.shape
        centred = views - self._level
        squared = np.full((n, width), np.inf, dtype=np.float32)
        index = np.zeros((n, width), dtype=np.int64)
        for part, even, odd in self._bank.halves(centred, among):
            if centred.device.type == "cpu":
                _nearer(even.numpy(), odd.numpy(), part.start, part.stop, squared, index)
            else:
                _nearer_on_device(even, odd, part.start, part.stop, squared, index)
        of_views = energies(centred)
        squared += of_views[:, None]
        tolerance = ROUNDING * width**0.5 * (of_views + self._energies[among].max())
        _rescore(views.cpu().numpy(), self._on_cpu.numpy(), index, tolerance, squared)
        familiarity = -np.sqrt(squared / np.float32(height * width))
        return self._here(torch.from_numpy(familiarity)), self._here(torch.from_numpy(index))


def energies(images: Images) -> Float32[np.ndarray, " n"]:
    """Sum of the squares of each. By numpy: torch's depends on the number of threads."""
    parts = [part.square().flatten(start_dim=1).cpu().numpy().sum(axis=1) for part in images.split(1000)]
    return np.concatenate(parts)


@compiled
def _nearer(even, odd, first, last, squared, index):
    """Where one of the snapshots first .. last - 1 is nearer than squared (n, w) says, change that, and index (n, w) to it.

    even + odd (half, n, m) are the squared distances from them at rotations 0 .. half - 1, even - odd those at rotations 0, -1, ..
    See `FilterBank.halves`. Of equally near ones the first is taken.
    """
    width, m = squared.shape[1], last - first
    for k in range(even.shape[0]):
        for v in range(even.shape[1]):
            for turn, sign in ((k, np.float32(1)), (width - k if k else 0, np.float32(-1))):
                least, at = _order(squared[v, turn]), -1
                for start in range(0, m, SEARCH):
                    end = min(start + SEARCH, m)
                    here = _least(even[k, v, start:end], odd[k, v, start:end], sign)
                    if here < least:
                        least, at = here, start
                if at >= 0:
                    while at < m - 1 and _order(even[k, v, at] + sign * odd[k, v, at]) != least:
                        at += 1
                    squared[v, turn], index[v, turn] = even[k, v, at] + sign * odd[k, v, at], first + at


def _nearer_on_device(
    even: torch.Tensor, odd: torch.Tensor, first: int, last: int, squared: np.ndarray, index: np.ndarray
) -> None:
    """`_nearer`, of tensors on another device, of which only the nearest are fetched."""
    left, right = ((even + sign * odd)[..., : last - first].min(dim=2) for sign in (1, -1))
    values = all_rotations(left.values, right.values, squared.shape[1]).T.cpu().numpy()
    which = all_rotations(left.indices, right.indices, squared.shape[1]).T.cpu().numpy()
    nearer = values < squared
    squared[nearer], index[nearer] = values[nearer], first + which[nearer]


@compiled(inline="always")
def _order(x):
    """A whole number that is the greater the greater a float32 is: of these, unlike of floats, many are compared at once."""
    bits = np.float32(x).view(np.int32)
    return bits ^ (bits >> 31 & 0x7FFFFFFF)


@compiled
def _least(even, odd, sign):
    """The least of even + sign odd, in `_order`."""
    least = np.int32(0x7FFFFFFF)
    for i in range(len(even)):
        least = min(least, _order(even[i] + sign * odd[i]))
    return least


@compiled(fastmath={"reassoc"})
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
                for i in range(height):  # the view rolled right by `turn`
                    for j in range(turn):
                        total += (np.float64(views[v, i, width - turn + j]) - snapshot[i, j]) ** 2
                    for j in range(width - turn):
                        total += (np.float64(views[v, i, j]) - snapshot[i, turn + j]) ** 2
                squared[v, turn] = total
            squared[v, turn] = max(squared[v, turn], np.float32(0.0))
