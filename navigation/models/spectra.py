"""Filters by their Fourier transforms along azimuth, and what comes of their responses to all rotations of views."""

import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64

from ..threads import in_threads
from .growing import Tiles
from .products import TILE, absolute, nearest, respond

# Filters, and views, that are multiplied at once: what is computed on the way then stays in the processor's cache
# (measured on an AMD EPYC with 1 MB of it per core).
FILTERS, VIEWS = 960, 16
SMALL = 2**23  # multiplications; below it, one thread is the quickest


class Spectra:
    """Transforms of filters. Further ones can be added; this computes nothing of the others again.

    Args:
        filters: (m, h, w) The first ones, float32 or float64.
    """

    def __init__(self, filters: Float[torch.Tensor, "m h w"]):
        self.width, self.size, self._blocks = filters.shape[2], FILTERS, []
        self._inverse = inverse(self.width).to(filters)
        self._add(filters)

    def __len__(self) -> int:
        return sum(len(block) for block in self._blocks)

    def appended(self, filters: Float[torch.Tensor, "m h w"]) -> "Spectra":
        """These filters and then others; this object stays as it is."""
        combined = copy.copy(self)
        combined._blocks = list(self._blocks)
        combined._add(filters)
        return combined

    def _add(self, filters: Float[torch.Tensor, "m h w"]) -> None:
        space = self.size - len(self._blocks[-1]) if self._blocks else 0
        if space and len(filters):
            self._blocks[-1] = self._blocks[-1].appended(torch.fft.rfft(filters[:space]))
        self._blocks += [Tiles(torch.fft.rfft(some)) for some in filters[space:].split(self.size) if len(some)]

    def chunks(
        self,
        views: Float[torch.Tensor, "n h w"],
        biases: Float[torch.Tensor, " m"] | None = None,
        among: slice = slice(None),
    ) -> Iterator["Chunk"]:
        """Some views and filters after the other, to compute what is wanted of their responses.

        Args:
            views: (n, h, w)
            biases: (m,) Added to the responses; None means none.
            among: The filters that respond.
        """
        rows = _rows(views)
        start, stop, _ = among.indices(len(self))
        for begin, block in zip(range(0, stop, self.size), self._blocks, strict=False):
            first, last = max(start - begin, 0), min(stop - begin, len(block))
            if first >= last:
                continue
            filters = slice(begin + first, begin + last)
            added = views.new_zeros(last - first) if biases is None else biases[filters]
            tiles = block.storage[first // TILE : -(-last // TILE)]
            for view in range(0, len(views), VIEWS):
                some = slice(view, min(view + VIEWS, len(views)))
                of_views = rows[:, 2 * some.start : 2 * some.stop].contiguous()
                yield Chunk(some, filters, of_views, self._inverse, tiles, added, first % TILE, self.width)


@dataclass(frozen=True)
class Chunk:
    """Some views and filters whose products are computed at once.

    Attributes:
        views: Which views.
        filters: Which filters.
        rows: (f, 2 n, k) Of each view what gives the real parts of its products, then what gives the imaginary parts.
        inverse: (2, i, f) As `inverse`.
        tiles: (t, f, k, TILE) Transforms of the filters.
        biases: (m,) Added to the responses.
        first: Where the first of the filters is in the tiles.
        width: Number of rotations.
    """

    views: slice
    filters: slice
    rows: torch.Tensor
    inverse: torch.Tensor
    tiles: torch.Tensor
    biases: torch.Tensor
    first: int
    width: int

    def responses(self) -> Float[torch.Tensor, "n w m"]:
        """Responses of the filters to all rotations of the views."""
        if not self._compiled:
            return self.by_torch()
        responses = self.rows.new_empty(*self._shape, len(self.biases))
        self._in_threads(lambda *arguments: respond(*arguments, responses.numpy()))
        return responses

    def least(self) -> tuple[Float[torch.Tensor, "n w"], Int64[torch.Tensor, "n w"]]:
        """The least response to each rotation of the views, and the number of the filter among all filters that gives it."""
        if not self._compiled:
            least, index = self.by_torch().min(dim=2)
            return least, self.filters.start + index
        found = {}

        def work(*arguments) -> None:
            least, index = np.full(self._shape, np.inf, self.rows.numpy().dtype), np.zeros(self._shape, np.int64)
            nearest(*arguments, least, index)
            found[arguments[-2]] = torch.from_numpy(least), torch.from_numpy(index)

        self._in_threads(work)
        least, index = (torch.stack(parts) for parts in zip(*(found[begin] for begin in sorted(found)), strict=True))
        which = least.argmin(dim=0)[None]
        return least.gather(0, which)[0], self.filters.start + index.gather(0, which)[0]

    def absolute(self) -> Float[torch.Tensor, "n w"]:
        """Sum of the absolute responses of the filters to each rotation of the views."""
        if not self._compiled:
            return self.by_torch().abs_().sum(dim=2)
        sums = self.rows.new_empty(len(self.tiles), *self._shape)
        self._in_threads(lambda *arguments: absolute(*arguments, sums.numpy()))
        return sum(sums[1:], start=sums[0])

    def by_torch(self) -> Float[torch.Tensor, "n w m"]:
        """`responses` on any device. Sums may be rounded differently in another batch."""
        products = torch.matmul(self.rows, self.tiles).movedim(0, 2).flatten(2)  # (f, 2 n, filters of all tiles)
        products = products[..., self.first : self.first + len(self.biases)].unflatten(1, self._shape[:1] + (2,))
        real, imaginary = products.permute(2, 1, 0, 3)
        count = self.width // 2 + 1
        even, odd = torch.matmul(self.inverse[0, :count], real), torch.matmul(self.inverse[1, :count], imaginary)
        right = (even - odd)[:, 1 : (self.width + 1) // 2].flip(1)
        return torch.cat([even + odd, right], dim=1) + self.biases

    @property
    def _compiled(self) -> bool:
        return self.rows.device.type == "cpu"

    @property
    def _shape(self) -> tuple[int, int]:
        return self.rows.shape[1] // 2, self.width

    def _in_threads(self, work: Callable[..., None]) -> None:
        """Call `work` with the arguments of a compiled function of products.py up to `end`, for the tiles of each thread."""
        arrays = [each.numpy() for each in (self.rows, self.inverse, self.tiles, self.biases)]
        large = self.rows.numel() * len(self.tiles) * TILE >= SMALL
        count = min(torch.get_num_threads(), len(self.tiles)) if large else 1
        in_threads(lambda begin, end: work(*arrays, self.first, begin, end), len(self.tiles), count)


def _rows(views: Float[torch.Tensor, "n h w"]) -> Float[torch.Tensor, "f rows parts"]:
    """For each view two rows: conj(V) F has the real part Re V Re F + Im V Im F, and the imaginary part Re V Im F - Im V Re F."""
    if views.device.type == "cpu":  # by numpy, which transforms each row by itself, and so to the same bytes in every batch
        transformed = torch.from_numpy(np.fft.rfft(views.numpy()))
    else:
        transformed = torch.fft.rfft(views)
    n, h, f = transformed.shape
    rows = views.new_empty(f, n, 2, h, 2)
    rows[:, :, 0] = torch.view_as_real(transformed).permute(2, 0, 1, 3)
    rows[:, :, 1, :, 0] = -rows[:, :, 0, :, 1]
    rows[:, :, 1, :, 1] = rows[:, :, 0, :, 0]
    return rows.flatten(3).flatten(1, 2)


def inverse(width: int) -> Float64[torch.Tensor, "2 i f"]:
    """What makes responses of real parts of products, and of imaginary ones: at rotations 0 to w // 2, and 0 up to an even number."""
    count = width // 2 + 1
    identity = torch.eye(count, dtype=torch.float64)
    halves = torch.stack([torch.fft.irfft(parts, n=width, dim=0)[:count] for parts in (identity, 1j * identity)])
    return torch.nn.functional.pad(halves, (0, 0, 0, count % 2))
